"""What the paper does not say: the process of Tables 3 to 5, how T_F was iterated, which ISE."""

from __future__ import annotations

from functools import cache

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from pidalab import areas
from pidalab.ledger import Ledger, some
from pidalab.rules import magnitude_optimum as mo
from scipy.optimize import least_squares

from . import noise, problem
from .names import typeset
from .rounding import decimals, twice

LAGS = 2, 3, 4, 5, 6  # numbers of equal lags that are tried for G_P3
STARTS = np.unique(np.round(np.append(np.geomspace(0.01, 0.3, 18), [0.032, 0.035, 0.038, 0.05, 0.1]), 4))
PASSES = 6  # corrections of T_F that are tried: 0 to 5


def first_area(book: Ledger) -> dict[str, tuple[float, float]]:
    """A_1 of the process from two printed gains and T_F of each design, and its doubt: first line of (14)."""
    found = {}
    for key in problem.NOISY:
        n = problem.CASES[key].n
        K_I, K_P, T = (book.printed(f"{key}.{k}") for k in ("km1", "k0", "tf"))
        half_I, half_P, half_T = (book.row(f"{key}.{k}").half_unit for k in ("km1", "k0", "tf"))
        value = (K_P + 0.5) / K_I - n * T
        found[key] = value, half_P / K_I + (K_P + 0.5) / K_I**2 * half_I + n * half_T
    return found


@typeset
def process_3(book: Ledger) -> pd.DataFrame:
    """Equal lags and a dead time fitted to the printed gains of Tables 3 to 5."""
    found = first_area(book)
    printed, used = (areas.from_process(P, 2)[1] for P in (problem.printed_gp3(), problem.process(3)))
    distance = {str(problem.CASES[key]): (abs(printed - a), doubt) for key, (a, doubt) in found.items()}
    fits = fitted(book)
    (lag, delay), miss = fits[3]
    values = [a for a, _ in found.values()]
    others, nearest = (
        ", ".join(str(q) for q in LAGS if q != 3),
        min(x for q, (_, x) in fits.items() if q != 3),
    )
    book.statement(
        "eq33.process",
        *some(distance, "<="),
        left_name="distance of A_1 of (33) from that of the printed gains",
        right_name="what their rounding allows",
        note="The first line of (14) with the printed gains gives A_1 = (K_0 + 0.5)/K_-1 − nT_F between "
        f"{min(values):.3f} and {max(values):.3f} in all {len(values)} designs; (33) has {printed:g}. Least squares "
        f"over all printed gains, from two starts each, with q equal lags: q = 3 ends at a lag of {lag:.4f} and a dead "
        f"time of {delay:.4f}, off by {miss:.1f} units at most; of q = {others} the nearest is off by {nearest:.0f}. "
        f"e^(−0.5s)/(1+s)^3, with A_1 = {used:g}, is taken.",
    )
    rows = {
        q: {"lag, s": f"{lag:.4f}", "dead time, s": f"{delay:.4f}", "largest miss, units": f"{miss:.3g}"}
        for q, ((lag, delay), miss) in fits.items()
    }
    return pd.DataFrame(rows).T.rename_axis("equal lags")


def fitted(book: Ledger) -> dict[int, tuple[tuple[float, float], float]]:
    """By number of lags: lag and dead time that miss the printed gains least, and the largest miss in units."""
    target = {
        key: (
            np.array([book.printed(f"{key}.{k}") for k in problem.GAINS[: problem.CASES[key].m + 2]]),
            2 * book.row(f"{key}.k0").half_unit,
            book.printed(f"{key}.tf"),
            book.row(f"{key}.tf").half_unit,
        )
        for key in problem.NOISY
    }

    def misses(x: np.ndarray, q: int) -> np.ndarray:
        # each T_F is free within its printed digits: x[2:] in half units of its last place
        parts = []
        for (key, (K, unit, T, half)), free in zip(target.items(), x[2:], strict=True):
            _, m, n, _ = problem.CASES[key]
            plain = lags_with_delay(q, abs(x[0]), abs(x[1]), 2 * m + 4)
            parts.append((problem.written_out(plain, m, n, T + free * half) - K) / unit)
        return np.concatenate(parts)

    found = {}
    for q in LAGS:
        tries = []
        for share in (0.5, 0.95):  # of A_1 = 3.5 that the lags take: two starts
            start = np.array([3.5 * share / q, 3.5 * (1 - share), *np.zeros(len(target))])
            bounds = [0.05, 0.0, *(-np.ones(len(target)))], [3.5, 3.5, *np.ones(len(target))]
            scale = [0.1, 0.1, *np.ones(len(target))]
            tries.append(least_squares(misses, start, bounds=bounds, args=(q,), x_scale=scale))
        best = min(tries, key=lambda one: one.cost)
        found[q] = (float(best.x[0]), float(best.x[1])), float(np.max(abs(best.fun)))
    return found


def lags_with_delay(q: int, lag: float, delay: float, count: int) -> np.ndarray:
    """Areas of q equal lags and a dead time in floating point, for a fit."""
    k = np.arange(count)
    plain = np.cumprod([1.0, *(delay / k[1:])])
    for _ in range(q):
        plain = np.convolve(plain, lag**k)[:count]
    return plain


@typeset
def peaks_of_t(book: Ledger) -> pd.DataFrame:
    """A sign, not a proof: the peak of |T| with the printed gains on either process."""
    rows = {}
    for label, P in (("as used", problem.process(3)), ("(33)", problem.printed_gp3())):
        for own in (False, True):
            peaks = []
            for key in problem.NOISY:
                _, m, n, _ = problem.CASES[key]
                K, T = [book.printed(f"{key}.{k}") for k in problem.GAINS[: m + 2]], book.printed(f"{key}.tf")
                C = problem.pid(mo.tune(P, m, n, T)) if own else pidalab.HighOrderPID(K, T, n)
                peaks.append(pidalab.margins(pidalab.Loop(P, C)).mt)
            gains = "gains for this process" if own else "printed gains"
            rows[f"{gains}, process {label}"] = {"least peak of |T|": min(peaks), "largest": max(peaks)}
    return pd.DataFrame(rows).T.map("{:.3f}".format)


@cache
def iterated(start: float, key: str) -> list[tuple[float, np.ndarray]]:
    """T_F and the gains for it after 0 to 5 corrections."""
    g, m, n, wanted = problem.CASES[key]
    steps, time = [], start
    for _ in range(PASSES):
        K = problem.written_out(problem.plain_areas(g)[: 2 * m + 4], m, n, time)
        steps.append((time, K))
        time = mo.filter_time(K[-1], m, n, wanted, problem.SAMPLE_TIME)
    return steps


def misses(book: Ledger) -> dict[str, np.ndarray]:
    """Printed entries of Tables 3 to 6 that each recipe misses: ties accepted, and by more than a unit."""
    out = {name: np.zeros((STARTS.size, PASSES), dtype=int) for name in ("ties accepted", "beyond a unit")}
    for i, start in enumerate(STARTS):
        for key in problem.ONCE:
            ids = [f"{key}.{k}" for k in ("tf", *problem.GAINS[: problem.CASES[key].m + 2])]
            goal, half = [book.printed(id) for id in ids], [book.row(id).half_unit for id in ids]
            for corrected, (time, K) in enumerate(iterated(float(start), key)):
                for value, shown, h in zip((time, *K), goal, half, strict=True):
                    out["ties accepted"][i, corrected] += not twice(value, shown, h)
                    out["beyond a unit"][i, corrected] += abs(value - shown) > 3 * h
    return out


@typeset
def start(book: Ledger) -> pd.DataFrame:
    """Which start and how many corrections of T_F give Tables 3 to 6."""
    missed = misses(book)
    tenth = int(np.flatnonzero(STARTS == 0.1)[0])
    total = sum(problem.CASES[key].m + 3 for key in problem.ONCE)
    perfect = [(float(STARTS[i]), c) for i, c in zip(*np.nonzero(missed["ties accepted"] == 0), strict=True)]
    ties = missed["ties accepted"][tenth]
    far = {c: int(missed["beyond a unit"][tenth, c]) for c in (3, 4)}
    book.statement(
        "st.start",
        min(far.values()),
        "==",
        0,
        left_name="entries missed by more than a unit from T_F = 0.1, the better of 3 and 4 corrections",
        note=f"Of {total} different entries three and four corrections from 0.1 miss {ties[3]} and {ties[4]}, ties of "
        f"a fourth place accepted, and by more than a unit {far[3]} and {far[4]}. Of {STARTS.size} starts from "
        f"{STARTS[0]:g} to {STARTS[-1]:g} with 0 to {PASSES - 1} corrections all come out with "
        f"{_recipes(perfect)}.",
    )
    settled = {key: _settled(book, key) for key in problem.ONCE}
    late = [f"{problem.CASES[key]} in Table {key[5]}" for key, ok in settled.items() if not ok]
    book.statement(
        "fig5.settles",
        len(late),
        "<",
        sum(settled.values()),
        left_name="designs that three corrections from 0.1 leave unsettled",
        right_name="settled to the printed digits of T_F",
        note=f"Unsettled: {'; '.join(late)}. A correction leaves {100 * _rate('table4.n3'):.0f} % of the error there "
        f"with n = m and {100 * _rate('table5.m4'):.0f} % with m = 4.",
    )
    rows = {
        f"{STARTS[i]:g}": {f"{c} corrections": missed["ties accepted"][i, c] for c in range(1, PASSES)}
        for i in range(0, STARTS.size, 2)
    }
    return pd.DataFrame(rows).T.rename_axis("T_F to begin with")


def _recipes(perfect: list[tuple[float, int]]) -> str:
    """Say which numbers of corrections, and which starts, miss nothing."""
    if not perfect:
        return "none"
    starts, corrections = zip(*perfect, strict=True)
    return (
        f"{' or '.join(map(str, sorted({*corrections})))} corrections from {min(starts):g} to {max(starts):g}"
    )


@cache
def _limit(key: str) -> float:
    g, m, n, wanted = problem.CASES[key]
    return problem.pid(mo.tune_for_noise(problem.process(g), m, n, wanted, problem.SAMPLE_TIME)).filter_time


def _settled(book: Ledger, key: str) -> bool:
    places = decimals(book.row(f"{key}.tf").half_unit)
    return round(iterated(0.1, key)[3][0], places) == round(_limit(key), places)


def _rate(key: str) -> float:
    """Share of the error of T_F that a correction leaves."""
    before, after = (iterated(0.1, key)[c][0] - _limit(key) for c in (3, 4))
    return after / before


def draw_start(book: Ledger) -> Figure:
    """Entries missed over the first T_F, for three, four and five corrections."""
    missed = misses(book)["ties accepted"]
    figure, ax = plt.subplots(figsize=(6.4, 3.0))
    for corrected in (3, 4, 5):
        ax.semilogx(STARTS, missed[:, corrected], label=f"{corrected} corrections")
    ticks = [0.01, 0.02, 0.035, 0.05, 0.1, 0.2]
    ax.set_xticks(ticks, [f"{x:g}" for x in ticks])
    ax.minorticks_off()
    ax.set(xlabel="$T_F$ to begin with, s", ylabel="entries missed, of 76", ylim=(-1, 45))
    figure.legend(loc="outside upper left", ncols=3)
    return figure


def draw_first_area(book: Ledger) -> Figure:
    """A_1 of the process in Tables 3 to 5 from the printed gains, with what rounding allows."""
    found = first_area(book)
    figure, ax = plt.subplots(figsize=(6.4, 3.6))
    value, doubt = zip(*found.values(), strict=True)
    ax.errorbar(value, np.arange(len(found)), xerr=doubt, fmt="o", capsize=3)
    for P, style, name in (
        (problem.process(3), "-.", "as used"),
        (problem.printed_gp3(), "--", "as printed"),
    ):
        A_1 = areas.from_process(P, 2)[1]
        ax.axvline(A_1, linestyle=style, color="#808080")
        ax.annotate(f"{name}: {A_1:g}", (A_1, -0.9), xytext=(6, 0), textcoords="offset points", va="center")
    ax.set_yticks(np.arange(len(found)), [noise.label(key) for key in found])
    ax.set(xlabel="area $A_1$, s", xlim=(3.4, 4.6), ylim=(len(found) - 0.4, -1.5))
    return figure


@typeset
def gain_of_6(book: Ledger) -> pd.DataFrame:
    """Gains of (44) with 1/18 and with 0.0556."""
    rows: dict[str, dict[str, str]] = {}
    for name, gain in (("1/18", 1 / 18), ("0.0556", 0.0556)):
        P = pidalab.Process([18 * gain], problem.process(6).den)
        for m in (2, 3):
            for k, K in enumerate(problem.pid(mo.tune(P, m, m, 0.005)).coefficients, start=-1):
                rows.setdefault(f"PID_{m}^{m}, K_{k}", {})[name] = f"{K:.2f}"
    return pd.DataFrame(rows).T


@typeset
def noise_reference(book: Ledger) -> pd.DataFrame:
    """By which output sigma_rel divides."""
    t = problem.SAMPLE_TIME * np.arange(20000)
    pulse = np.eye(1, t.size)[0]
    run = pidalab.simulate(problem.loop(3, problem.tuned("table4.n4")), t, noise=pulse)
    size = np.linalg.norm
    found = {"measured, with the noise": run.y + pulse, "the noise": pulse, "before the noise": run.y}
    gains = {name: float(size(run.u) / size(y)) for name, y in found.items()}
    printed = book.printed("table3.khf10.sigma")
    book.statement(
        "eq35.output",
        gains["measured, with the noise"],
        "within",
        printed,
        convention="similar",
        left_name="σ_u over σ of the measured output, PID_4^3 with K_HF = 10",
        right_name="printed",
        note=f"Divided by σ_n, as the text says, {gains['the noise']:.3f}; by σ of y before the noise is added, as in "
        f"Fig. 1, it would be {gains['before the noise']:.0f}.",
    )
    return pd.DataFrame({"σ_rel of PID_4^3": gains}).map("{:.4g}".format)
