"""Section 2: the loops of Table 2, and the same gains from records without noise."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable
from functools import cache
from itertools import pairwise, product

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from pidalab import areas, plots
from pidalab.ledger import Ledger, every
from pidalab.rules import magnitude_optimum as mo
from scipy.special import gammainc

from . import problem
from .names import typeset

PREFILTER = 0.5  # T_FR of (19), s
STEPS = {1: (4, 0.0), 2: (2, 0.5)}  # lags and dead time of G_P1 and G_P2
LENGTHS = (20, 30, 40, 50, 80)  # of the records, s
SUPPORTED = (50, 80)  # lengths for which the statement of the abstract is read


@cache
def responses(g: int, m: int) -> dict[str, pidalab.Response]:
    """Set-point steps with and without prefilter, and the load step, with a controller of Table 2."""
    t, controller = np.linspace(0, 60, 12001), problem.example(g, m)
    bare = problem.loop(g, controller)
    return {
        "set point": pidalab.step_response(problem.loop(g, controller, PREFILTER), t),
        "bare": pidalab.step_response(bare, t),
        "load": pidalab.load_response(bare, t),
    }


def measured_exactly(t: np.ndarray, g: int) -> np.ndarray:
    """Step response of G_P1 or G_P2, right to its last digit: the incomplete gamma function."""
    order, delay = STEPS[g]
    return gammainc(order, np.clip(t - delay, 0.0, None))


@cache
def from_record(length: int, g: int) -> tuple[np.ndarray, list[float]]:
    """Areas of a record of that length in s, sampled every 0.002 s, and the twelve gains from them."""
    t = np.linspace(0, length, 500 * length + 1)
    with warnings.catch_warnings(action="ignore", category=areas.RecordWarning):
        found = areas.from_record(t, 1.0, measured_exactly(t, g), 10, start=(0.0, 0.0))
    made = (problem.pid(mo.tune(found.values, m, m, problem.SHORT_FILTER)) for m in (1, 2, 3))
    return found.values, [gain for controller in made for gain in controller.coefficients]


@typeset
def records(book: Ledger) -> pd.DataFrame:
    """How many gains of Table 2 a record without noise gives as printed, over its length."""
    ids = {g: [f"table2.gp{g}.m{m}.{k}" for m in (1, 2, 3) for k in problem.GAINS[: m + 2]] for g in (1, 2)}
    off = {}
    for length, g in product(LENGTHS, (1, 2)):
        _, gains = from_record(length, g)
        off[length, g] = [_units(book, id, gain) for id, gain in zip(ids[g], gains, strict=True)]
    right = {f"{length} s": sum(off[length, g].count(0) for g in (1, 2)) for length in LENGTHS}
    total = sum(map(len, ids.values()))
    book.statement(
        "st.abstract.measured",
        *every({f"{length} s": (right[f"{length} s"], total) for length in SUPPORTED}, "=="),
        left_name="gains as printed",
        right_name="gains of Table 2",
        note="Areas from step responses without noise, right to their last digit, sampled every 0.002 s. As "
        "printed: " + ", ".join(f"{n} over {length}" for length, n in right.items()) + ".",
    )
    rows: dict[str, dict[str, str]] = {}
    for (length, g), units in off.items():
        share = from_record(length, g)[0][9] / problem.plain_areas(g, 10)[9] - 1
        row = rows.setdefault(f"{length} s", {})
        row[f"error of A_9, G_P{g}"] = "below 1e-9" if abs(share) < 1e-9 else f"{share:.0e}"
        row[f"gains of G_P{g}"] = f"{units.count(0)} of {len(units)}, worst off by {max(units)}"
    return pd.DataFrame(rows).T


def _units(book: Ledger, id: str, value: float) -> int:
    """By how many units of the last printed place a value, rounded, misses the print."""
    unit = 2 * book.row(id).half_unit
    return abs(round(value / unit) - round(book.printed(id) / unit))


@typeset
def fragile(book: Ledger) -> pd.DataFrame:
    """K_0 of PID_3^3 for G_P2 from records of 50 s that are rounded after some decimals."""
    t, rows = np.linspace(0, 50, 25001), {"model": problem.example(2, 3).coefficients[1]}
    for decimals in (13, 12, 11, 10):
        y = np.round(measured_exactly(t, 2), decimals)
        with warnings.catch_warnings(action="ignore", category=areas.RecordWarning):
            found = areas.from_record(t, 1.0, y, 10, start=(0.0, 0.0))
        rows[f"record with {decimals} decimals"] = mo.tune(found.values, 3, 3, problem.SHORT_FILTER).gains[1]
    return pd.DataFrame({"K_0 of PID_3^3": rows}).map("{:.3f}".format)


@typeset
def figures_3_4(book: Ledger) -> pd.DataFrame:
    """The statements about Figs 3 and 4, and the measures of their curves."""
    runs = {key: responses(*key) for key in problem.EXAMPLE_1}
    track = {key: run["set point"].iae(math.inf) for key, run in runs.items()}
    reject = {key: run["load"].iae() for key, run in runs.items()}
    peak = {key: run["set point"].peak("u") for key, run in runs.items()}
    jump = {key: float(run["bare"].u.max()) for key, run in runs.items()}
    for g in (1, 2):
        falls = {
            f"{kind}, m = {high}": (cost[g, high], cost[g, low])
            for kind, cost in (("tracking", track), ("load", reject))
            for low, high in pairwise((1, 2, 3))
        }
        settling = [runs[g, m]["set point"].settling_time() for m in (1, 2, 3)]
        book.statement(
            f"st.fig{g + 2}.order",
            *every(falls, "<"),
            left_name="IAE, this order",
            right_name="order below",
            note=f"Tracking {_list(track[g, m] for m in (1, 2, 3))}, load {_list(reject[g, m] for m in (1, 2, 3))} "
            f"for m = 1, 2 and 3. Settling to 2 %: {_list(settling)}.",
        )
    book.statement(
        "st.fig3.cut",
        *every({f"m = {m}": (peak[1, m], peak[1, 3]) for m in (1, 2)}, "<", "much"),
        left_name="largest u, G_P1",
        right_name="PID_3^3",
        note=f"{_list((peak[1, m] for m in (1, 2, 3)), '.3g')} for m = 1, 2 and 3. For G_P2 (Fig. 4) it would "
        f"fit: {_list((peak[2, m] for m in (1, 2, 3)), '.3g')}.",
    )
    gain = {g: track[g, 1] / track[g, 3] for g in (1, 2)}
    load = {g: reject[g, 1] / reject[g, 3] for g in (1, 2)}
    book.statement(
        "st.fig34.relative",
        gain[1],
        ">",
        gain[2],
        left_name="IAE of PID_1^1 over PID_3^3, G_P1",
        right_name="G_P2",
        note=f"For the load {load[1]:.2f} and {load[2]:.2f}.",
    )
    book.statement(
        "st.fig4.slightly",
        track[2, 3],
        "<",
        track[2, 2],
        convention="slightly",
        left_name="IAE of PID_3^3",
        right_name="PID_2^2",
        note=f"Tracking with T_FR = {PREFILTER:g}: {track[2, 3]:.3f} against {track[2, 2]:.3f}.",
    )
    swings = {f"G_P{g}, m = {m}": (peak[g, m], jump[g, m]) for g, m in runs}
    book.statement(
        "eq19.swing",
        *every(swings, "<"),
        left_name="largest u with the prefilter",
        right_name="without",
        note="Without and with it: "
        + "; ".join(f"{name} {b:.3g} and {a:.3g}" for name, (a, b) in swings.items())
        + ".",
    )
    rows = {
        f"G_P{g}, m = {m}": {
            "IAE, set point": track[g, m],
            "IAE, load": reject[g, m],
            "peak, load": runs[g, m]["load"].peak(),
            "settling": runs[g, m]["set point"].settling_time(),
            "overshoot, %": round(runs[g, m]["set point"].overshoot(), 3),
            "largest u": peak[g, m],
            "without prefilter": jump[g, m],
            "noise gain, 0.002 s": pidalab.noise_gain(problem.loop(g, problem.example(g, m)), 0.002),
        }
        for g, m in runs
    }
    return pd.DataFrame(rows).T.map("{:.4g}".format)


def _list(values: Iterable[float], form: str = ".2f") -> str:
    return ", ".join(format(x, form) for x in values)


def draw_3_4() -> Figure:
    """Paper Figs 3 and 4, computed: set-point step at 0, load step at 15 s."""
    t = np.linspace(0, 30, 6001)
    figure, axes = plt.subplots(2, 2, figsize=(6.4, 4.8), sharex=True, sharey="row")
    for column, g in zip(axes.T, (1, 2), strict=True):
        runs = {}
        for m in (1, 2, 3):
            loop = problem.loop(g, problem.example(g, m), PREFILTER)
            runs[f"PID$_{m}^{m}$"] = pidalab.simulate(loop, t, setpoint=1.0, load=np.where(t < 15, 0.0, 1.0))
        for ax, name in zip(column, "yu", strict=True):
            plots.signal(ax, runs, name, until=30)
        column[0].set(title=f"$G_{{P{g}}}$", xlabel="")
        column[1].set(xlabel="time, s")
    axes[0, 0].set(ylabel="output y", ylim=(0, 1.6))
    axes[1, 0].set(ylabel="control u", ylim=(-3, 6))
    axes[1, 0].annotate("up to 20", (1.2, 5.2))
    axes[0, 1].legend(loc="lower right")
    return figure


def draw_flatness() -> Figure:
    """|T| with the controllers of Table 2."""
    w = np.geomspace(0.05, 20, 400)
    figure, axes = plt.subplots(1, 2, figsize=(6.4, 2.6), sharey=True)
    for ax, g in zip(axes, (1, 2), strict=True):
        for m in (1, 2, 3):
            ax.semilogx(w, abs(problem.loop(g, problem.example(g, m)).T(1j * w)), label=f"PID$_{m}^{m}$")
        ax.set(title=f"$G_{{P{g}}}$", xlabel="frequency, rad/s", ylim=(0, 1.1))
    axes[0].set_ylabel(r"$|T(j\omega)|$")
    axes[0].legend(loc="lower left")
    return figure
