"""Paper Fig. 2 of huba2024: the family of (29) over the time constant of its double zero."""

from __future__ import annotations

from functools import cache
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from pidalab.ledger import Ledger, every
from pidalab.rules import automatic_reset as ar

from . import loops
from .tables import tabled

ORDERS = (2, 3, 4, 5, 6, 8)
STANDARD = "T_e = 0.8, T_f = T_e/n, T_s = 0.001, the family of eq. (29) from the unrounded eq. (18)"
EQUAL_SLOPE = (
    ar.MRDP_PIDA.times[0] / 2
)  # τ_D/2: (1 + τ_2 x)² then has the linear term of the pair that it replaces
MARKS = (EQUAL_SLOPE, 0.232, 0.348)


@cache
def taus() -> np.ndarray:
    """Time constants τ_2 of the map."""
    return np.unique(np.round([*np.arange(0.14, 0.4401, 0.005), 0.232, 0.348, EQUAL_SLOPE], 6))


@cache
def portrait(n: int, step: str) -> pidalab.Portrait:
    """Measures of the family over τ_2 for one order of the filter."""
    points = [loops.point(ar.double_zero(tau / ar.PIDA_1.ti)) for tau in taus()]
    return loops.portrait(points, loops.T_S, step, n=n, filter_time=0.8 / n)


def at(tau: float, step: str, measure: str, n: int = 4) -> float:
    """One measure at one τ_2 of the map."""
    return float(getattr(portrait(n, step), measure)[np.argmin(np.abs(taus() - tau))])


def draw() -> Figure:
    """IAE and the excess of u over one pulse, over τ_2, for four orders of the filter."""
    figure, axes = plt.subplots(2, 2, figsize=(6.4, 3.7), sharex=True)
    for column, step in zip(axes.T, loops.STEPS, strict=True):
        for n in (2, 3, 4, 6):
            column[0].plot(taus(), portrait(n, step).iae, label=f"n = {n}")
            column[1].semilogy(taus(), np.maximum(portrait(n, step).tv1_u, 1e-6))
        for ax in column:
            for place, style in zip(MARKS, (":", "--", "-."), strict=True):
                ax.axvline(place, color="#808080", linestyle=style, linewidth=1.0)
        column[1].set(xlabel=r"$\tau_2 = T_2/T_d$", ylim=(1e-6, 1))
    axes[0, 0].set(title="set-point step", ylabel="IAE")
    axes[0, 1].set(title="load step")
    axes[1, 0].set(ylabel=r"$\mathrm{TV}_1$ of u")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=4)
    return figure


@tabled
def servo(book: Ledger) -> pd.DataFrame:
    """What the text says of the set-point half."""
    excess = {tau: at(tau, "setpoint", "tv1_u") for tau in (0.14, 0.16, 0.18, 0.2, 0.232, 0.42)}
    range_of_u = float(np.max(portrait(4, "setpoint").u_max - portrait(4, "setpoint").u_min))
    book.statement(
        "fig2.optimum.zero",
        excess[0.232],
        "<=",
        range_of_u,
        convention="settled",
        left_name="TV_1(u_s) at 0.232, n = 4",
        right_name="range of u",
        note=f"{STANDARD}. TV_1(u_s) at 0.232 is "
        + ", ".join(f"{at(0.232, 'setpoint', 'tv1_u', n):.5f} with n = {n}" for n in ORDERS)
        + ".",
    )
    zero = {n: taus()[portrait(n, "setpoint").tv1_u < 1e-6] for n in ORDERS}
    better = int(np.sum(portrait(4, "setpoint").tv1_u < 0.5 * excess[0.232]))
    book.statement(
        "fig2.optimum.best",
        better,
        "==",
        0,
        left_name=f"places of the map, of {taus().size}, with less than half the TV_1(u_s) of 0.232, n = 4",
        note=f"{STANDARD}. It is zero, below 1e-6, "
        + "; ".join(
            f"for n = {n} " + (f"from {x[0]:.3f} to {x[-1]:.3f}" if x.size else "nowhere")
            for n, x in zero.items()
        )
        + f" (grid of 0.005), and {excess[0.232]:.5f} at 0.232 for n = 4.",
    )
    fall = (excess[0.14] - excess[0.2]) / (0.2 - 0.14)
    rise = (excess[0.42] - excess[0.232]) / (0.42 - 0.232)
    book.statement(
        "fig2.below",
        fall,
        ">",
        rise,
        convention="much",
        left_name="mean slope of TV_1(u_s) below 0.2, n = 4",
        right_name="above 0.232",
        note=f"{STANDARD}. TV_1(u_s) is "
        + ", ".join(f"{max(excess[tau], 0.0):.4f} at {tau:g}" for tau in (0.2, 0.18, 0.16, 0.14))
        + f" and {excess[0.42]:.4f} at 0.42.",
    )
    up = np.flatnonzero((taus() >= 0.232 - 1e-9) & (taus() <= 0.42 + 1e-9))
    steps: dict[str, tuple[float, float]] = {}
    for measure in ("tv1_u", "iae"):
        values = getattr(portrait(4, "setpoint"), measure)[up]
        steps |= {
            f"{measure} at {taus()[i]:g}": (float(b), float(a))
            for i, a, b in zip(up[1:], values, values[1:], strict=False)
        }
    cost = [at(tau, "setpoint", "iae") for tau in (0.232, 0.42)]
    book.statement(
        "fig2.above",
        *every(steps, ">"),
        left_name="value",
        right_name="that one step of the grid before",
        note=f"{STANDARD}, n = 4. From 0.232 to 0.42 TV_1(u_s) grows from {excess[0.232]:.4f} to "
        f"{excess[0.42]:.4f} and "
        f"IAE_s from {cost[0]:.2f} to {cost[1]:.2f}, both at every step of the grid of 0.005.",
    )
    grids = {"text": np.arange(0.2, 0.41, 0.05), "caption": np.arange(0.16, 0.421, 0.02)}
    common = np.intersect1d(np.round(grids["text"], 3), np.round(grids["caption"], 3))
    book.note(
        "fig2.grid",
        "The "
        + ", the ".join(
            f"{name} has {x[0]:g} to {x[-1]:g} in steps of {x[1] - x[0]:.2f}" for name, x in grids.items()
        )
        + f": {common.size} places in common, and three numbers of one grid would have to be misread. Neither contains "
        "0.232 or 0.348. Which one was used is not known; the text also describes what happens below 0.2.",
    )
    return pd.DataFrame(
        {f"n = {n}": {"zero from": f"{x[0]:.3f}", "to": f"{x[-1]:.3f}"} for n, x in zero.items() if x.size}
    ).T


@tabled
def disturbance(book: Ledger) -> pd.DataFrame:
    """What the text says of the load half."""
    way = np.flatnonzero((taus() >= 0.232 - 1e-9) & (taus() <= 0.348 + 1e-9))
    changes = {name: getattr(portrait(4, "load"), name)[way] for name in ("iae", "tv1_y", "tv1_u")}
    pairs = {
        name: {f"at {taus()[i]:g}": (float(b), float(a)) for i, a, b in zip(way[1:], x, x[1:], strict=False)}
        for name, x in changes.items()
    }
    given: dict[str, Any] = {"left_name": "value", "right_name": "one step of the grid before"}
    best = taus()[np.argmin(portrait(4, "load").iae)]
    book.statement(
        "fig2.disturbance.iae",
        *every(pairs["iae"], "<"),
        **given,
        note=f"{STANDARD}, n = 4. IAE_d falls from {changes['iae'][0]:.1f} at 0.232 to "
        f"{changes['iae'][-1]:.1f} at 0.348, "
        f"and on to {np.min(portrait(4, 'load').iae):.1f} at {best:.2f}.",
    )
    shapes = {f"{name} {k}": pair for name in ("tv1_y", "tv1_u") for k, pair in pairs[name].items()}
    book.statement(
        "fig2.disturbance.shape",
        *every(shapes, "<="),
        **given,
        note=f"{STANDARD}, n = 4. From 0.232 to 0.348 TV_1(y_d) rises from {changes['tv1_y'][0]:.4f} to "
        f"{changes['tv1_y'][-1]:.4f} and TV_1(u_d) from {changes['tv1_u'][0]:.4f} to {changes['tv1_u'][-1]:.4f}.",
    )
    jumps = {n: jump(n) for n in ORDERS}
    book.statement(
        "fig2.disturbance.limit",
        *every({f"n = {n}": (tau, 0.348) for n, tau in jumps.items()}, "within", "similar"),
        left_name="τ_2 from which u makes a second move",
        right_name="1.5 · 0.232",
        note=f"{STANDARD}. From there on TV_1(u_d) is above 2 % of the range of u, the settling band: "
        + ", ".join(f"{tau:.3f} for n = {n}" for n, tau in jumps.items())
        + ". The paper does not say for which n it speaks; its Fig. 3 has n = 4.",
    )
    return pd.DataFrame({f"n = {n}": {"second move of u from": f"{tau:.3f}"} for n, tau in jumps.items()}).T


def jump(n: int) -> float:
    """τ_2 from which the control signal leaves one pulse by more than 2 % of its range after the load."""
    x, bound = portrait(n, "load").tv1_u, 0.02 * (1.0 + 2 * loops.SPARE)
    first = np.flatnonzero((x > bound) & (taus() > 0.25))[0]
    low, high = taus()[first - 1 : first + 1]
    return float(low + (high - low) * np.log(bound / x[first - 1]) / np.log(x[first] / x[first - 1]))


def tight_limits(book: Ledger) -> None:
    """Section 2.4: set point and load need different limits."""
    ends = {}
    for name, bounds in (("own", loops.limits("load")), ("of the set point", loops.limits("setpoint"))):
        loop = loops.designs()["PIDA_1"].loop()
        ends[name] = float(np.max(np.abs(loops.sampled(loop, "load", bounds).y)))
    book.statement(
        "fig2.limits",
        ends["of the set point"],
        ">",
        ends["own"],
        convention="negligible",
        left_name="largest y within 60 time units of the load, limits ±0.1",
        right_name="limits −1.1 and 0.1",
        note="At rest u = 0 after the set-point step and u = −1 after the load: with the limits "
        "±0.1 the unit load drives "
        f"the output away, to {ends['of the set point']:.1f} after 60 time units.",
    )


@tabled
def equal_slope() -> pd.DataFrame:
    """Not in the paper: τ_2 = τ_D/2 keeps the sum of the zeros' time constants, and has no excess at all."""
    rows = {}
    for n in ORDERS:
        rows[f"n = {n}"] = {
            f"{label} at {name}": f"{max(at(tau, step, measure, n), 0.0):.{digits}f}"
            for tau, name in ((EQUAL_SLOPE, "τ_D/2"), (0.232, "0.232"))
            for label, step, measure, digits in (
                ("TV_1(u_s)", "setpoint", "tv1_u", 5),
                ("TV_1(y_d)", "load", "tv1_y", 5),
                ("IAE_d", "load", "iae", 2),
            )
        }
    return pd.DataFrame(rows).T
