"""Paper Figs 7 to 9: how fast the loops of Tables 3 to 5 are."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from pidalab import plots
from pidalab.ledger import Ledger, every

from . import problem
from .names import typeset

PREFILTER = 0.2  # T_FR of (34), s
GROUPS = {
    "$K_{HF}$": {"2": "table3.khf2", "5": "table3.khf5", "10": "table3.khf10", "20": "table3.khf20"},
    "$n$, $m = 3$": {str(n): f"table4.n{n}" for n in (3, 4, 5, 6)},
    "$m$, $n = m + 1$": {str(m): f"table5.m{m}" for m in (1, 2, 3, 4)},
}


@cache
def responses(key: str) -> dict[str, pidalab.Response]:
    """Set-point step with and without prefilter, and load step, with a design of Tables 3 to 6."""
    t, g, controller = np.linspace(0, 60, 15001), problem.CASES[key].g, problem.tuned(key)
    bare = problem.loop(g, controller)
    return {
        "set point": pidalab.step_response(problem.loop(g, controller, PREFILTER), t),
        "bare": pidalab.step_response(bare, t),
        "load": pidalab.load_response(bare, t),
    }


@cache
def measures(key: str) -> dict[str, float]:
    """By what Figs 7 to 9 are judged."""
    run = responses(key)
    return {
        "rise time": run["set point"].rise_time(),
        "settling": run["set point"].settling_time(),
        "IAE": run["set point"].iae(math.inf),
        "IAE, load": run["load"].iae(math.inf),
        "peak, load": run["load"].peak(),
        "largest u": run["set point"].peak("u"),
    }


@typeset
def speed(book: Ledger) -> pd.DataFrame:
    """The statements about Figs 7, 8 and 9, and the measures of their curves."""
    rise, track = ({key: measures(key)[name] for key in problem.CASES} for name in ("rise time", "IAE"))
    steps = pairwise(problem.TABLE_3)
    faster = {f"K_HF = {problem.CASES[b].wanted}": (rise[b], rise[a]) for a, b in steps}
    book.statement(
        "st.fig7.speed",
        *every(faster, "<"),
        left_name="rise time, this K_HF",
        right_name="the one below",
        note=f"Rise time {_row(problem.TABLE_3, rise)} and σ_rel "
        f"{', '.join(f'{problem.noise(k):.2f}' for k in problem.TABLE_3)} for K_HF = 2, 5, 10, 20.",
    )
    gained = [track[a] - track[b] for a, b in pairwise(problem.TABLE_3)]
    book.statement(
        "st.fig7.less",
        gained[2],
        "<",
        gained[1],
        left_name="fall of the IAE from K_HF = 10 to 20",
        right_name="from 5 to 10",
        note=f"IAE in tracking {_row(problem.TABLE_3, track)} for K_HF = 2, 5, 10, 20.",
    )
    _filter_orders(book)
    slower = {f"m = {problem.CASES[b].m}": (rise[b], rise[a]) for a, b in pairwise(problem.TABLE_5)}
    book.statement(
        "st.fig9.speed",
        *every(slower, "<"),
        left_name="rise time, this order",
        right_name="order below",
        note=f"{_row(problem.TABLE_5, rise)} for m = 1 to 4.",
    )
    _integral_gains(book)
    rows = {
        str(problem.CASES[key]): {
            "K_-1": problem.integral_gain(key),
            **measures(key),
            "σ_rel": problem.noise(key),
        }
        for key in problem.NOISY
    }
    return pd.DataFrame(rows).T.map("{:.3f}".format)


def _row(keys: Sequence[str], values: Mapping[str, float], form: str = ".3f") -> str:
    return ", ".join(format(values[key], form) for key in keys)


def _filter_orders(book: Ledger) -> None:
    names = ("rise time", "settling", "IAE")
    others = [key for key in problem.TABLE_4 if key != "table4.n4"]
    best = {
        f"{name}, n = {problem.CASES[key].n}": (measures("table4.n4")[name], measures(key)[name])
        for name in names
        for key in others
    }
    book.statement(
        "st.fig8.fastest",
        *every(best, "<"),
        left_name="PID_4^3",
        right_name="another n",
        note="; ".join(
            f"{name} {', '.join(f'{measures(key)[name]:.2f}' for key in problem.TABLE_4)}" for name in names
        )
        + " for n = 3 to 6.",
    )
    rise = {n: measures(f"table4.n{n}")["rise time"] for n in (4, 5, 6)}
    book.statement(
        "st.fig8.slightly",
        *every({f"n = {n}": (rise[4], rise[n]) for n in (5, 6)}, "<", "slightly"),
        left_name="rise time, n = 4",
        right_name="this n",
        note=f"{100 * (rise[5] / rise[4] - 1):.1f} % and {100 * (rise[6] / rise[4] - 1):.1f} % longer.",
    )


def _integral_gains(book: Ledger) -> None:
    """Statements about K_-1, the integral gain."""
    K = {key: problem.integral_gain(key) for key in problem.CASES}
    rising = {f"K_HF = {problem.CASES[b].wanted}": (K[a], K[b]) for a, b in pairwise(problem.TABLE_3)}
    book.statement(
        "st.abstract.limited",
        *every(rising, "<"),
        left_name="K_-1, the K_HF below",
        right_name="this one",
        note=f"{_row(problem.TABLE_3, K)} for K_HF = 2, 5, 10, 20.",
    )
    for table, best in ((problem.TABLE_4, "table4.n4"), (problem.TABLE_5, "table5.m4")):
        rest = {str(problem.CASES[key]): (K[key], K[best]) for key in table if key != best}
        book.statement(
            f"st.{best[:6]}.largest",
            *every(rest, "<"),
            left_name="K_-1",
            right_name=str(problem.CASES[best]),
            note=f"{_row(table, K)} down the table.",
        )
    n3, n4, n5, n6 = problem.TABLE_4
    humped = {"n = 3 to 4": (K[n3], K[n4]), "n = 5 to 4": (K[n5], K[n4]), "n = 6 to 5": (K[n6], K[n5])}
    equal = [problem.exact_noise(3, 3, n, 10.0).coefficients[0] for n in (3, 4, 5, 6)]
    book.statement(
        "st.conclusion.filterorder",
        *every(humped, "<"),
        left_name="K_-1",
        right_name="the next one toward n = 4",
        note=f"{_row(problem.TABLE_4, K)} for n = 3 to 6. With equal noise it rises and falls as well, but later: "
        f"{', '.join(f'{x:.3f}' for x in equal)}.",
    )
    pairs = {}
    for number, table in zip((3, 4, 5), (problem.TABLE_3, problem.TABLE_4, problem.TABLE_5), strict=True):
        by_gain = sorted(table, key=lambda key: -K[key])
        for name in ("rise time", "settling", "IAE"):
            for fast, slow in pairwise(by_gain):
                label = f"Table {number}, {name}, {problem.CASES[fast]} before {problem.CASES[slow]}"
                pairs[label] = measures(fast)[name], measures(slow)[name]
    book.statement(
        "st.ie.speed",
        *every(pairs, "<"),
        left_name="with the larger K_-1",
        right_name="with the next smaller",
        note=f"{len(pairs)} pairs of neighbours by K_-1: three tables, three measures; T_FR = {PREFILTER:g}.",
    )


def draw_7_to_9(number: int) -> Figure:
    """Paper Fig. 7, 8 or 9, computed: lines without noise, and faintly one simulated run with it."""
    title, members = list(GROUPS.items())[number - 7]
    t = problem.SAMPLE_TIME * np.arange(12501)
    n = 0.01 * np.random.default_rng(9).normal(size=t.size)
    clean, noisy = {}, {}
    for label, key in members.items():
        loop = problem.loop(3, problem.tuned(key), PREFILTER)
        both = pidalab.simulate_ensemble(
            loop, t, np.stack([0 * n, n]), setpoint=1.0, load=np.where(t < 15, 0.0, 1.0)
        )
        clean[label], noisy[label] = both
    figure, axes = plt.subplots(2, 1, figsize=(6.4, 3.8), sharex=True)
    plots.signal(axes[0], clean, "y", until=25)
    plots.signal(axes[1], clean, "u", until=25, faint=noisy)
    axes[0].set(ylabel="output y", xlabel="")
    axes[1].set(ylabel="control u", xlabel="time, s", ylim=(-1, 4))
    axes[0].legend(title=title, ncols=2, loc="lower center")
    return figure
