"""Which ISE Section 5 integrates: of which error, with which prefilter, for how long."""

from __future__ import annotations

from functools import cache
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from pidalab.ledger import Ledger
from scipy.integrate import cumulative_trapezoid

from . import contest, problem
from .names import typeset

FILTERS = np.linspace(0.008, 0.02, 7)  # T_FR that are tried, s


@cache
def _tried() -> dict[str, tuple[int, Any, str]]:
    """Controllers whose printed ISE in tracking confines T_FR; two with another filter order."""
    known = {
        f"Table {g + 2}, {name}": (g, C, contest.SHORT[name])
        for g in problem.RIVAL
        for name, C in problem.contest(g).items()
    }
    return known | {
        f"{problem.RIVAL[g]}, n = 3": (g, problem.rival(g, 3), problem.RIVAL_ID[g]) for g in (5, 6)
    }


def confined(book: Ledger) -> dict[str, tuple[float, float]]:
    """The T_FR with which the ISE of r_f - y rounds to each printed tracking value."""
    found = {}
    for name, (g, _, short) in _tried().items():
        id = f"table{g + 2}.{short}.tracking"
        curve = _ise_over_filter(name)
        back = np.polynomial.Polynomial.fit(curve, FILTERS, 5)
        ends = back(book.printed(id) + book.row(id).half_unit * np.array([-1.0, 1.0]))
        found[name] = float(min(ends)), float(max(ends))
    return found


@cache
def _ise_over_filter(name: str) -> tuple[float, ...]:
    g, C, _ = _tried()[name]
    end = contest.ENDS[g][0]
    return tuple(contest.servo_ise(g, C, time, end, samples=16001) for time in FILTERS)


@typeset
def prefilter(book: Ledger) -> pd.DataFrame:
    """Which error the ISE of Section 5 integrates, and with which T_FR."""
    found = confined(book)
    agreed = [ends for name, ends in found.items() if name.startswith("Table")]
    low, high = max(a for a, _ in agreed), min(b for _, b in agreed)
    C, t = problem.contest(5)["PID_2^2"], np.linspace(0, 4, contest.SAMPLES)
    least = pidalab.step_response(problem.loop(5, C), t).ise()
    with_filter = pidalab.step_response(problem.loop(5, C, contest.PREFILTER), t).ise()
    id = "table7.pid22.tracking"
    third = [
        f"{name.partition(',')[0]} would need {1e3 * a:.1f} to {1e3 * b:.1f} ms"
        for name, (a, b) in found.items()
        if "n = 3" in name
    ]
    book.statement(
        "st.ise.reference",
        least,
        "<=",
        book.printed(id) + book.row(id).half_unit,
        left_name="ISE of r − y without a prefilter, PID_2^2 on G_P5",
        right_name="what rounds to the print",
        note=f"With T_FR = {contest.PREFILTER:g} it would be {with_filter:.4f}. Of r_f − y each of the {len(agreed)} "
        f"printed tracking values confines T_FR, together to {1e3 * low:.3f} to {1e3 * high:.3f} ms. With filters of "
        f"order 3 {' and '.join(third)}.",
    )
    rows = {
        name: {"T_FR from, ms": f"{1e3 * a:.3f}", "to, ms": f"{1e3 * b:.3f}"}
        for name, (a, b) in found.items()
    }
    return pd.DataFrame(rows).T


def draw_prefilter(book: Ledger) -> Figure:
    """The T_FR that each printed tracking value allows."""
    figure, ax = plt.subplots(figsize=(6.4, 3.4))
    found = confined(book)
    for place, (name, ends) in enumerate(found.items()):
        color = "#1f5fa8" if name.startswith("Table") else "#c8591a"
        ax.plot(1e3 * np.array(ends), [place, place], "-", linewidth=5, solid_capstyle="butt", color=color)
        ax.plot(1e3 * np.mean(ends), place, "D", color="#808080", markersize=4)
    ax.axvline(1e3 * contest.PREFILTER, color="#808080", linewidth=0.8, linestyle="-", zorder=0)
    ax.set_yticks(range(len(found)), [_with_tex(name) for name in found])
    ax.set(xlabel="$T_{FR}$, ms", xlim=(8, 21))
    ax.invert_yaxis()
    return figure


def _with_tex(name: str) -> str:
    table, _, controller = name.rpartition(", ")
    return f"{table}, {problem.tex(controller)}"


@typeset
def load_ends(book: Ledger) -> pd.DataFrame:
    """Ends of the integral, after the load step, with which the ISE rounds to the print."""
    t, rows = np.linspace(0, 40, 200001), {}
    for name, (g, C, short) in _tried().items():
        id = f"table{g + 2}.{short}.load"
        if "n = 3" in name or id in ("table7.pid22.load", "table7.pid33.load"):
            continue
        growing = cumulative_trapezoid(pidalab.load_response(problem.loop(g, C), t).y ** 2, t, initial=0.0)
        good = t[abs(growing - book.printed(id)) <= book.row(id).half_unit]
        rows[name] = {
            "printed": f"{book.printed(id):g}",
            "end from, s": f"{good[0]:.2f}",
            "to, s": "any later" if good[-1] > 39 else f"{good[-1]:.2f}",
            "to infinity": f"{growing[-1]:.4g}",
        }
    return pd.DataFrame(rows).T


@typeset
def sign_of_46(book: Ledger) -> pd.DataFrame:
    """ISE in tracking of the Puangdownreong controller with either sign of K_2."""
    rows = {}
    for name, sign in (("as printed, negative", 1), ("positive", -1)):
        *K, K_2 = problem.RIVAL_GAINS[7]
        rows[name] = contest.servo_ise(7, problem.with_filter_47([*K, sign * K_2]), end=20.0)
    return pd.DataFrame({"ISE in tracking": rows}).map("{:.4f}".format)
