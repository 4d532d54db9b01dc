"""Section 3: Tables 3 to 5, the measured noise, and Figs 7 to 9."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from pidalab.ledger import CONVENTIONS, Ledger, every
from scipy.signal import fftconvolve

from . import problem
from .names import typeset
from .rounding import entry

RECORDS, SPAN, SETTLE = 200, 10_000, 10_000  # simulated noise records, and samples of each
SEED = 1340


def tables_3_to_6(book: Ledger) -> None:
    """Every gain and filter time of Tables 3 to 6, and the expected noise gains."""
    for key in problem.CASES:
        controller = problem.tuned(key)
        named = zip(("tf", *problem.GAINS), (controller.filter_time, *controller.coefficients), strict=False)
        for name, value in named:
            entry(book, f"{key}.{name}", value)
        if key in problem.TABLE_6:
            continue
        noise, scatter = problem.noise(key), _scatter(key)
        book.check(
            f"{key}.sigma",
            noise,
            note=f"The noise record is not published{_tolerance(key)}. Computed for white noise held for "
            f"T_S = {problem.SAMPLE_TIME:g}, u taken at its instants; over {RECORDS} simulated records of "
            f"{SPAN * problem.SAMPLE_TIME:g} s the ratio scatters by {100 * scatter:.2g} %.",
        )


def _tolerance(key: str) -> str:
    """4 %, about one scatter of most; none for n = m, where a record of noise scatters by less than the print."""
    return (
        ""
        if problem.CASES[key].n == problem.CASES[key].m
        else ": tolerance 4 %, about one scatter of most designs"
    )


@cache
def ratios() -> dict[str, np.ndarray]:
    """sigma_rel of each design in simulated records, the same noise for all; shape (RECORDS,) each."""
    t = problem.SAMPLE_TIME * np.arange(SETTLE)
    white = np.random.default_rng(SEED).normal(size=(RECORDS, SETTLE + SPAN))
    found = {}
    for key in problem.NOISY:
        # u after a single held sample of noise; by superposition u is its convolution with the noise
        kernel = pidalab.simulate(problem.loop(3, problem.tuned(key)), t, noise=np.eye(1, SETTLE)[0]).u
        u = fftconvolve(white, kernel[None, :], axes=1)[:, SETTLE : SETTLE + SPAN]
        found[key] = u.std(axis=1) / white[:, SETTLE:].std(axis=1)
    return found


def _scatter(key: str) -> float:
    same = "table3.khf10" if key in problem.REPEATED else key
    return float(ratios()[same].std() / problem.noise(same))


@typeset
def printed_noise(book: Ledger) -> pd.DataFrame:
    """The printed sigma_rel beside what chance gives, and the statements about the noise."""
    rows = {}
    for key, found in ratios().items():
        printed, half = book.printed(f"{key}.sigma"), book.row(f"{key}.sigma").half_unit
        low, high = np.quantile(found, [0.025, 0.975])
        rows[str(problem.CASES[key])] = {
            "printed": f"{printed:g}",
            "expected": f"{problem.noise(key):.3f}",
            "95 % of records": f"{low:.3f} to {high:.3f}",
            "inside": "yes" if low - half <= printed <= high + half else "no",
            "printed / expected": f"{printed / problem.noise(key):.3f}",
        }
    wanted = {key: problem.CASES[key].wanted for key in problem.NOISY}
    sigma = {key: problem.noise(key) for key in problem.NOISY}
    above = [str(problem.CASES[key]) for key in sigma if sigma[key] > wanted[key]]
    book.statement(
        "st.abstract.noise",
        *every({str(problem.CASES[key]): (sigma[key], wanted[key]) for key in sigma}, "<="),
        left_name="σ_rel",
        right_name="K_HF",
        note=f"{len(above)} of the {len(sigma)} exceed it: {'; '.join(above)}. The lowest has "
        f"{100 * (min(sigma[k] / wanted[k] for k in sigma)):.0f} % of what was wanted.",
    )
    _similar(book, "st.table3.similar", problem.TABLE_3)
    _similar(book, "st.table5.similar", problem.TABLE_5)
    _similar(book, "st.table4.similar", ("table4.n3", "table4.n4"))
    low_noise = {f"n = {n}": problem.noise(f"table4.n{n}") for n in (5, 6)}
    book.statement(
        "st.table4.lower",
        *every({name: (value, 10) for name, value in low_noise.items()}, "<", "clearly"),
        left_name="σ_rel",
        right_name="K_HF",
        note="; ".join(f"{value:.2f} for {name}" for name, value in low_noise.items()) + ".",
    )
    by_order = [problem.noise(key) for key in problem.TABLE_5]
    book.statement(
        "st.conclusion.noise",
        *every({f"m = {m + 2}": pair[::-1] for m, pair in enumerate(pairwise(by_order))}, "<="),
        left_name="σ_rel, this order",
        right_name="order below",
        note=f"Table 5: {', '.join(f'{x:.2f}' for x in by_order)} for m = 1 to 4.",
    )
    return pd.DataFrame(rows).T


def _similar(book: Ledger, id: str, keys: Sequence[str]) -> None:
    """Noise gains near the wanted ones: the expected values decide, the printed ones are told."""
    cases = {str(problem.CASES[key]): (problem.noise(key), problem.CASES[key].wanted) for key in keys}
    shown = [book.printed(f"{key}.sigma") for key in keys]
    far = max(abs(x / problem.CASES[key].wanted - 1) for x, key in zip(shown, keys, strict=True))
    book.statement(
        id,
        *every(cases, "within", "similar"),
        left_name="σ_rel",
        right_name="K_HF",
        note=f"Expected {', '.join(f'{x:.2f}' for x, _ in cases.values())}. The printed ones, "
        f"{', '.join(f'{x:g}' for x in shown)}, are up to {100 * far:.1f} % off"
        + (", which by themselves would fail." if far > CONVENTIONS["similar"].limit else "."),
    )


@typeset
def one_record(book: Ledger) -> pd.DataFrame:
    """How the simulated records of the six designs with n = m + 1 > 2 rise and fall together."""
    keys = [k for k in problem.NOISY if 1 < problem.CASES[k].m == problem.CASES[k].n - 1]
    together = np.corrcoef([ratios()[key] for key in keys])
    names = [str(problem.CASES[key]) for key in keys]
    return pd.DataFrame(together, names, range(1, len(names) + 1)).map("{:.2f}".format)


def draw_noise(book: Ledger) -> Figure:
    """Printed sigma_rel beside simulated records, both over the expected value."""
    figure, ax = plt.subplots(figsize=(6.4, 3.6))
    place = np.arange(len(problem.NOISY))
    share = [ratios()[key] / problem.noise(key) for key in problem.NOISY]
    spread = [1.96 * x.std() for x in share]
    ax.errorbar(
        [x.mean() for x in share], place, xerr=spread, fmt="o", capsize=4, label="200 simulated records"
    )
    shown = [book.printed(f"{key}.sigma") / problem.noise(key) for key in problem.NOISY]
    ax.plot(shown, place, "x", markersize=9, markeredgewidth=2, label="printed")
    ax.set_yticks(place, [label(key) for key in problem.NOISY])
    ax.invert_yaxis()
    ax.set(xlabel=r"$\sigma_{rel}$ over its expected value", xlim=(0.84, 1.16))
    figure.legend(loc="outside upper left", ncols=2)
    return figure


def label(key: str) -> str:
    case = problem.CASES[key]
    return f"PID$_{case.n}^{case.m}$, {case.wanted}"
