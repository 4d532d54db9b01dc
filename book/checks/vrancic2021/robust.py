"""Section 4: Table 6, and Figs 10 to 12."""

from __future__ import annotations

from functools import cache
from itertools import pairwise, product
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from numpy.typing import ArrayLike
from pidalab import plots
from pidalab.ledger import CONVENTIONS, Ledger, every
from scipy.optimize import minimize_scalar
from scipy.signal import find_peaks

from . import problem
from .names import typeset

PREFILTER = 0.2  # T_FR of Figs 10 to 12: assumed, the text has none
ORDERS = 2, 3, 4
SHARES = {"nominal": 1.0, "+10 %": 1.1, "−10 %": 0.9}
CHANGED = "+10 %", "−10 %"
SLOWER = 0.8  # all gains times this, to slow a loop down


def _controller(m: int) -> pidalab.HighOrderPID:
    return problem.tuned(f"table6.m{m}")


def _name(m: int) -> str:
    return f"PID_{m + 1}^{m}"


@cache
def sensitivity(m: int, gain: float = 1.0, delay: float = 1.0, lag: float = 1.0) -> float:
    """M_S with a controller of Table 6, on G_P4 with other parameters; infinite if the loop is unstable."""
    loop = pidalab.Loop(pidalab.lags(3, lag=lag, gain=gain, delay=delay), _controller(m))
    return pidalab.max_sensitivity(loop)[0] if pidalab.is_stable(loop) else float("inf")


def sensitivities(book: Ledger) -> None:
    """M_S of Table 6, and what is said of it."""
    ms = {m: sensitivity(m) for m in ORDERS}
    book.check({f"table6.m{m}.ms": value for m, value in ms.items()})
    shown = ", ".join(f"{x:.3f}" for x in ms.values())
    book.statement(
        "st.ms.increases",
        *every({_name(b): (ms[a], ms[b]) for a, b in pairwise(ORDERS)}, "<", "slightly"),
        left_name="M_S, order below",
        right_name="this order",
        note=f"{shown} for m = 2, 3 and 4.",
    )
    book.statement(
        "st.ms.below",
        *every({_name(m): (value, 2.0) for m, value in ms.items()}, "<"),
        left_name="M_S",
        right_name="the limit",
        note=f"{shown} for m = 2, 3 and 4.",
    )
    misses = [abs(1 / _nearest(m) / ms[m] - 1) for m in ORDERS]
    book.identity(
        "st.ms.definition",
        max(misses),
        1e-9,
        note="The least distance of L, written out with its filter, from −1 over all frequencies, for the three "
        f"controllers of Table 6: {', '.join(f'{_nearest(m):.6f}' for m in ORDERS)}.",
    )


def _nearest(m: int) -> float:
    """Least distance of L(jw) from -1: the controller with its filter, and the process, written out."""
    C = _controller(m)

    def distance(w: ArrayLike) -> Any:
        s = 1j * np.asarray(w)
        filtered = np.polyval(C.coefficients[::-1], s) / s / (C.filter_time * s + 1) ** C.filter_order
        return abs(1 + filtered * np.exp(-s) / (s + 1) ** 3)

    w = np.linspace(0.01, 60, 20000)
    i = int(np.argmin(distance(w)))
    return float(
        minimize_scalar(distance, bounds=(w[i - 1], w[i + 1]), method="bounded", options={"xatol": 1e-12}).fun
    )


@cache
def responses(m: int, change: str) -> dict[str, pidalab.Response]:
    """Set-point and load step with all three parameters of G_P4 changed by the same share."""
    x, t = SHARES[change], np.linspace(0, 60, 12001)
    process = pidalab.lags(3, lag=x, gain=x, delay=x)
    filtered = pidalab.Loop(process, _controller(m), prefilter=problem.smooth(PREFILTER))
    bare = pidalab.Loop(process, _controller(m))
    return {"set point": pidalab.step_response(filtered, t), "load": pidalab.load_response(bare, t)}


def _turns(m: int, change: str) -> tuple[float, float]:
    """First maximum of the output after a set-point step, and the least value after it."""
    y = responses(m, change)["set point"].y
    tops = find_peaks(y, prominence=0.003)[0]
    first = int(tops[0]) if tops.size else y.size - 1
    return float(y[first]), float(y[first:].min())


@cache
def _off(kind: str, m: int, change: str) -> float:
    """Largest deviation from the nominal response."""
    return float(np.max(abs(responses(m, change)[kind].y - responses(m, "nominal")[kind].y)))


@typeset
def changed_parameters(book: Ledger) -> pd.DataFrame:
    """The loops of Table 6 on processes that are 10 % off."""
    corners = {
        (m, k, d, lag): sensitivity(m, k, d, lag)
        for m, (k, d, lag) in product(ORDERS, product((0.9, 1.0, 1.1), repeat=3))
    }
    worst = {m: max((x, key[1:]) for key, x in corners.items() if key[0] == m) for m in ORDERS}
    book.statement(
        "st.robust.stable",
        max(corners.values()),
        "<",
        float("inf"),
        left_name=f"largest M_S of {len(corners)} loops, infinite for an unstable one",
        note=f"By the count of unstable poles. M_S up to {', '.join(f'{worst[m][0]:.2f}' for m in ORDERS)} for m = 2, "
        "3 and 4, with gain, delay and lag {:g}, {:g}, {:g} times the nominal.".format(*worst[4][1]),
    )
    _oscillation(book)
    _deviations(book)
    joint = {(m, change): sensitivity(m, *[SHARES[change]] * 3) for m in ORDERS for change in CHANGED}
    book.statement(
        "st.robust.ms",
        *every({change: (joint[2, change], joint[4, change]) for change in CHANGED}, "<"),
        left_name="M_S of PID_3^2, all parameters changed",
        right_name="PID_5^4",
        note="; ".join(f"{c}: {', '.join(f'{joint[m, c]:.3f}' for m in ORDERS)}" for c in CHANGED)
        + " for m = 2, 3 and 4.",
    )
    slowed = {m: pidalab.max_sensitivity(pidalab.Loop(problem.process(4), _slower(m)))[0] for m in ORDERS}
    book.statement(
        "st.conclusion.slower",
        *every({_name(m): (slowed[m], sensitivity(m)) for m in ORDERS}, "<"),
        left_name=f"M_S with all gains times {SLOWER:g}",
        right_name="as designed",
        note=f"{', '.join(f'{x:.2f}' for x in slowed.values())} for m = 2, 3 and 4. The paper leaves the method to "
        "further work.",
    )
    rows = {
        _name(m): {
            "Ms": f"{sensitivity(m):.3f}",
            "all +10 %": f"{joint[m, '+10 %']:.3f}",
            "all −10 %": f"{joint[m, '−10 %']:.3f}",
            "worst of 27": f"{worst[m][0]:.2f}",
            "gain, delay, lag there": "{:g}, {:g}, {:g}".format(*worst[m][1]),
            f"Ms, gains × {SLOWER:g}": f"{slowed[m]:.2f}",
        }
        for m in ORDERS
    }
    return pd.DataFrame(rows).T


def _slower(m: int) -> pidalab.HighOrderPID:
    C = _controller(m)
    return pidalab.HighOrderPID([SLOWER * K for K in C.coefficients], C.filter_time, C.filter_order)


def _oscillation(book: Ledger) -> None:
    fall = {f"{_name(m)}, {change}": 1 - _turns(m, change)[1] for m in ORDERS for change in CHANGED}
    limit = CONVENTIONS["clearly"].limit
    top, low = _turns(4, "−10 %")
    book.statement(
        "st.robust.oscillation",
        *every({name: (x, limit) for name, x in fall.items()}, "<"),
        left_name="fall below the set point after the first maximum",
        right_name="share of the step that the conventions call significant",
        note="Falls of "
        + "; ".join(f"{100 * x:.1f} % ({name})" for name, x in fall.items())
        + ". With all down "
        f"PID_5^4 turns at {top:.3f} and falls back to {low:.3f}: significant it is not by our convention, without "
        f"oscillation neither. T_FR is not in the text; {PREFILTER:g} is assumed, and a longer one smooths this away.",
    )


def _deviations(book: Ledger) -> None:
    """PID_5^4 against PID_3^2: who is moved further by changed parameters?"""
    for kind, short in (("set point", "tracking"), ("load", "load")):
        pairs = {change: (_off(kind, 2, change), _off(kind, 4, change)) for change in CHANGED}
        book.statement(
            f"st.robust.{short}",
            *every(pairs, "<"),
            left_name="largest deviation of PID_3^2",
            right_name="PID_5^4",
            note="; ".join(
                f"{change}: {b:.3f} against {a:.3f}, {100 * (b / a - 1):+.0f} %"
                for change, (a, b) in pairs.items()
            )
            + ".",
        )


@typeset
def overshoots(book: Ledger) -> pd.DataFrame:
    """Measures of the curves of Figs 10 to 12."""
    rows = {}
    for m, change in product(ORDERS, SHARES):
        run = responses(m, change)
        top, low = _turns(m, change)
        rows[f"{_name(m)}, {change}"] = {
            "overshoot, %": run["set point"].overshoot(),
            "first maximum": top,
            "least after it": low,
            "largest u": run["set point"].peak("u"),
            "peak, load": run["load"].peak(),
            "off, set point": _off("set point", m, change),
            "off, load": _off("load", m, change),
        }
    return pd.DataFrame(rows).T.map("{:.3f}".format)


def draw_10_to_12(m: int) -> Figure:
    """Paper Fig. 10, 11 or 12, computed: set-point step at 0, load step at 20 s."""
    t = np.linspace(0, 40, 8001)
    runs = {}
    for change, x in SHARES.items():
        process = pidalab.lags(3, lag=x, gain=x, delay=x)
        loop = pidalab.Loop(process, _controller(m), prefilter=problem.smooth(PREFILTER))
        runs[change] = pidalab.simulate(loop, t, setpoint=1.0, load=np.where(t < 20, 0.0, 1.0))
    figure, axes = plt.subplots(2, 1, figsize=(6.4, 4.6), sharex=True)
    for ax, name in zip(axes, "yu", strict=True):
        plots.signal(ax, runs, name, until=40)
    axes[0].set(ylabel="output y", xlabel="")
    axes[1].set(ylabel="control u", xlabel="time, s", ylim=(-1.5, 4))
    axes[0].legend(loc="lower right", ncols=3)
    return figure
