"""The sixteen printed IAE values: which error, which noise, which horizon."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from pidalab.ledger import Ledger

from .work import AMPLITUDE, CASES, EXPERIMENTS, ORDERS, RECORDS, Array, Case, Work, once, work

PLACES = [(case, test) for case in CASES for test in EXPERIMENTS]
SLOW = 0.1  # another time for which a value of the noise may be held


@cache
def iae_values(shared: Work, amplitude: float, hold: float) -> dict[tuple[Case, str], Array]:
    """IAE of the measured error at the horizons found, one value for each record."""
    return {
        (case, test): np.array(
            [run.measured().iae(case.horizon) for run in shared.noisy(case, test, amplitude, hold)]
        )
        for case, test in PLACES
    }


def paper_values(book: Ledger) -> dict[tuple[Case, str], float]:
    """The printed values."""
    return {(case, test): book.printed(f"{case.row}.iae.{test}") for case, test in PLACES}


def iae(book: Ledger) -> pd.DataFrame:
    """IAE of the measured error, mean over the records."""
    shared = work(book)
    values = iae_values(shared, AMPLITUDE, shared.t[1])
    rows = {}
    for (case, test), found in values.items():
        spread = float(found.std(ddof=1))
        clean = pidalab.simulate(shared.loops[case], shared.t, **EXPERIMENTS[test]).iae(case.horizon)
        book.check(
            f"{case.row}.iae.{test}",
            float(found.mean()),
            note=f"Mean of {RECORDS} noise records, of which one scatters by {spread:.3f} (standard deviation), "
            f"against one unknown record: tolerance 1 %. Without noise {clean:.3f} to the same horizon.",
        )
        printed = book.row(f"{case.row}.iae.{test}").printed
        rows[f"{case.label}, {test}"] = [printed, f"{found.mean():.3f}", f"{spread:.3f}", f"{clean:.3f}"]
    columns = ["printed", f"mean of {RECORDS}", "spread of one", "without noise"]
    return pd.DataFrame(rows, index=columns).T


def growth(book: Ledger) -> dict[tuple[Case, str], float]:
    """Growth of the mean IAE per time unit over the last four before the horizon."""
    shared, rates = work(book), {}
    for case, test in PLACES:
        runs = [run.measured() for run in shared.noisy(case, test)]
        late, early = (np.mean([run.iae(case.horizon - back) for run in runs]) for back in (0.0, 4.0))
        rates[case, test] = float(late - early) / 4
    return rates


def horizons(book: Ledger) -> Figure:
    """The horizon at which each printed value is reached; eq. (16) to infinity."""
    shared, rates, printed = work(book), growth(book), paper_values(book)
    values = iae_values(shared, AMPLITUDE, shared.t[1])
    solved = {
        (case, test): case.horizon + (printed[case, test] - found.mean()) / rates[case, test]
        for (case, test), found in values.items()
    }
    groups = {
        "Example 1": [solved[place] for place in PLACES if place[0].example == "ex1"],
        "Example 2, Ms 1.4": [
            solved[place] for place in PLACES if place[0].example == "ex2" and place[0].ms < 2
        ],
        "Example 2, Ms 2.0": [
            solved[place] for place in PLACES if place[0].example == "ex2" and place[0].ms == 2
        ],
    }
    ranges = "; ".join(f"{name}: {min(found):.2f} to {max(found):.2f}" for name, found in groups.items())
    book.statement(
        "st.iae.infinite",
        max(rates.values()),
        "<=",
        book.row("ex1.pida.ms14.iae.setpoint").half_unit,
        left_name="growth of the IAE per time unit at its horizon",
        right_name="half a unit of the last printed digit",
        note=f"Under the paper's noise the integral grows without end, by {min(rates.values()):.4f} to "
        f"{max(rates.values()):.4f} per time unit. Solved for its horizon, a printed value gives: {ranges}.",
    )
    return _horizon_figure(values, rates, solved)


def _horizon_figure(values: dict[Any, Array], rates: dict[Any, float], solved: dict[Any, float]) -> Figure:
    figure, ax = plt.subplots(figsize=(6.4, 3.4))
    pairs = [(example, ms) for example in ORDERS for ms in (1.4, 2.0)]
    for marker, kind in (("o", "pida"), ("s", "pid")):
        mine = [place for place in PLACES if place[0].kind == kind]
        bars = [2 * values[place].std(ddof=1) / rates[place] for place in mine]
        shift = 0.08 * (kind == "pid")
        x = [pairs.index((case.example, case.ms)) + 0.2 * (test == "load") + shift for case, test in mine]
        ax.errorbar(x, [solved[place] for place in mine], bars, fmt=marker, capsize=3, label=kind.upper())
    for level in (20, 40, 60):
        ax.axhline(level, color="#808080", linestyle=":", linewidth=1, zorder=1)
    names = [f"{example}\n$M_s = {ms}$" for example, ms in pairs]
    ax.set(ylabel="horizon, time units", xticks=np.arange(4) + 0.14, xticklabels=names)
    ax.legend(loc="upper left")
    return once(figure)


def readings(book: Ledger) -> pd.DataFrame:
    """Largest deviation from the sixteen printed values, for other readings of error, noise and horizon."""
    shared, printed = work(book), paper_values(book)
    mean: dict[str, dict[tuple[Case, str], Any]] = {
        "measured error, horizons 20, 40, 60": iae_values(shared, AMPLITUDE, shared.t[1]),
        "measured error, horizon 60 throughout": {
            place: [run.measured().iae() for run in shared.noisy(*place)] for place in PLACES
        },
        "true error r − y in the noisy loop": {
            (case, test): [run.iae(case.horizon) for run in shared.noisy(case, test)] for case, test in PLACES
        },
        f"measured error, noise held for {SLOW:g}": iae_values(shared, AMPLITUDE, SLOW),
        "no noise, infinite horizon": {place: [shared.iae[place]] for place in PLACES},
    }
    worst = {
        name: max(abs(float(np.mean(found[place])) / printed[place] - 1) for place in PLACES)
        for name, found in mean.items()
    }
    return pd.Series(
        {name: f"{100 * x:.1f} %" for name, x in worst.items()}, name="largest deviation"
    ).to_frame()


def amplitude(book: Ledger) -> pd.DataFrame:
    """The amplitude of the noise, found again from the sixteen printed values."""
    shared, printed = work(book), paper_values(book)
    sizes = np.array([0.09, AMPLITUDE, 0.11])
    found = [iae_values(shared, float(size), shared.t[1]) for size in sizes]
    off = np.array([[values[place].mean() - printed[place] for place in PLACES] for values in found])
    # Sum of squares of the relative deviations, a parabola in the amplitude near its least value.
    squares = np.sum((off / np.array([printed[place] for place in PLACES])) ** 2, axis=1)
    a, b, _ = np.polyfit(sizes, squares, 2)
    best = -b / (2 * a)
    book.check(
        "sec4.noise",
        100 * best,
        note="Least squares over the sixteen printed IAE values, at the horizons found, in per cent of the unit step. "
        f"The relative deviations are then {100 * math.sqrt(np.polyval(np.polyfit(sizes, squares, 2), best) / 16):.2f} "
        "% (root mean square).",
    )
    return pd.DataFrame({"amplitude": sizes, "root mean square, %": 100 * np.sqrt(squares / 16)}).round(3)
