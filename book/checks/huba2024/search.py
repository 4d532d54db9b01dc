"""The performance portrait of huba2024, eqs. (23) to (25): whether (25) fulfils it, and what does better."""

from __future__ import annotations

from functools import cache

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from pidalab.ledger import Ledger, every, some
from pidalab.rules import automatic_reset as ar

from . import loops
from .tables import tabled

BOUND = 1e-3  # of (23)
PRINTED = loops.point(ar.PPM_PIDA)
SPARES = (0.1, 0.05, 0.04, 0.03, 0.02)
AXES = ("κ", "τ_D", "T_A²/T_d²", "τ_i")


def mesh(*axes: np.ndarray) -> np.ndarray:
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def worst(p: pidalab.Portrait, step: str = "load") -> np.ndarray:
    """The larger excess of y and u, which (23) bounds."""
    return np.maximum(loops.y_excess(p, step), p.tv1_u)


@cache
def _tight(spare: float) -> pidalab.Portrait:
    """(25) with limits so far beyond rest; the run is longer as the way back takes longer."""
    return loops.portrait(PRINTED, loops.T_S, spare=spare, end=loops.END + 3.0 / spare)


@tabled
def printed_setting(book: Ledger) -> pd.DataFrame:
    """Eq. (25) against (23), over the sample time and the length of the run."""
    kp, kd, ka = (book.printed(f"eq25.{name}") for name in ("kp", "kd", "ka"))
    book.check({"eq25.td": kd / kp, "eq25.ta2": ka / kp})
    old = loops.pida()
    moved = {"K_p": (kp, old.kp), "T_i": (book.printed("eq25.ti"), old.ti)}
    moved |= {
        "K_d": (old.kd, kd),
        "K_a": (old.ka, ka),
        "T_D": (old.times[0], kd / kp),
        "T_A²": (old.times[1], ka / kp),
    }
    book.statement("eq25.changes", *every(moved, "<"), left_name="smaller", right_name="larger")
    runs = {
        (h, end): loops.portrait(PRINTED, h, end=end)
        for h, end in [(0.01, 60), (0.001, 60), (0.0005, 60), (0.001, 22)]
    }
    fine = {f"T_s = {h:g}": (float(runs[h, 60].tv1_y), BOUND) for h in (0.001, 0.0005)}
    r = loops.run("PPM-PIDA", "load")
    book.statement(
        "eq25.feasible.y",
        *every(fine, "<="),
        left_name="TV_1(y_d)",
        right_name="bound of (23)",
        note=f"Limits of Paper Fig. 3, 0.1 beyond rest. The output passes zero by {-r.y.min():.5f}, farthest "
        f"{r.t[np.argmin(r.y)]:.0f} time units after the step: a run that ends at 22 would not show it "
        f"({abs(float(runs[0.001, 22].tv1_y)):.5f}). The excess is proportional to that reserve of the limits, see "
        "eq25.feasible.limits.",
    )
    of_u = {f"T_s = {h:g}": (float(runs[h, 60].tv1_u), BOUND) for h in (0.001, 0.0005)}
    book.statement("eq25.feasible.u", *every(of_u, "<="), left_name="TV_1(u_d)", right_name="bound of (23)")
    rows = {}
    for (h, end), p in runs.items():
        rows[f"T_s = {h:g}, run of {end}"] = {
            "IAE_d": f"{p.iae:.3f}",
            "TV_1(y_d)": f"{max(p.tv1_y, 0):.5f}",
            "TV_1(u_d)": f"{max(p.tv1_u, 0):.5f}",
            "fulfils (23)": "yes" if worst(p) <= BOUND else "no",
        }
    return pd.DataFrame(rows).T


@tabled
def spare_range(book: Ledger) -> pd.DataFrame:
    """The excess of (25) over the reserve of the limits: "as tight as possible"."""
    found = {spare: _tight(spare) for spare in SPARES}
    slope = float(found[0.1].tv1_y) / 0.1
    border = BOUND / slope
    short = loops.portrait(PRINTED, loops.T_S, spare=0.05, end=120.0, n=2)
    book.statement(
        "eq25.feasible.limits",
        *some({f"{spare:g} beyond rest": (float(p.tv1_y), BOUND) for spare, p in found.items()}, "<="),
        left_name="TV_1(y_d)",
        right_name="bound of (23)",
        note=f"TV_1(y_d) is {slope:.5f} times the reserve of the limits beyond rest: "
        + ", ".join(f"{float(p.tv1_y):.5f} with {spare:g}" for spare, p in found.items())
        + f". So (25) fulfils (23) with a reserve below {border:.4f}, and with Q_2, T_f = 0.2 and a reserve of 0.05 it "
        f"has {float(short.tv1_y):.5f}. The paper chose its limits as tight as possible, and "
        "prints them for Figs 2 and "
        "3 only.",
    )
    return pd.DataFrame(
        {
            f"{spare:g}": {
                "TV_1(y_d)": f"{p.tv1_y:.5f}",
                "TV_1(u_d)": f"{p.tv1_u:.5f}",
                "TV_1(y_d) / reserve": f"{p.tv1_y / spare:.5f}",
                "IAE_d": f"{p.iae:.2f}",
                "fulfils (23)": "yes" if worst(p) <= BOUND else "no",
            }
            for spare, p in found.items()
        }
    ).T


@cache
def grid(values: int = 10) -> np.ndarray:
    """So many values for each parameter within 30 % of (25)."""
    return mesh(*(np.linspace(0.7 * x, 1.3 * x, values) for x in PRINTED))


@cache
def grid_map(step: str = "load", spare: float = loops.SPARE, values: int = 10) -> pidalab.Portrait:
    """Portrait of the grid with T_s = 0.01, for a first look; 30 time units more for limits that are tighter."""
    return loops.portrait(grid(values), 0.01, step, spare=spare, end=loops.END + 3.0 / spare - 30.0)


@tabled
def first_map() -> pd.DataFrame:
    """What a map finds at two reserves of the limits, and what a shorter sample time leaves of it."""
    rows = {}
    for spare, values in ((0.1, 10), (0.03, 6)):
        spots, p, end = grid(values), grid_map("load", spare, values), loops.END + 3.0 / spare - 30.0
        own = loops.portrait(PRINTED, 0.01, spare=spare, end=end)
        good = worst(p) <= BOUND
        first = np.flatnonzero(good)[np.argsort(p.iae[good])][:100]
        again = loops.portrait(spots[first], loops.T_S, spare=spare, end=end)
        stays = worst(again) <= BOUND
        rows[f"{spare:g} beyond rest"] = {
            "settings": len(spots),
            "fulfil (23)": int(good.sum()),
            "of these below IAE_d of (25)": int(np.sum(good & (p.iae < own.iae))),
            "of the best 100 lost with T_s = 0.001": int(np.sum(~stays)),
            "IAE_d of (25)": f"{own.iae:.2f}",
            "best that stays": f"{again.iae[stays].min():.2f}",
        }
    return pd.DataFrame(rows).T


@tabled
def reasons(book: Ledger) -> pd.DataFrame:
    """Section 2.4: would a search that also asks for the set point have found another setting?"""
    load, servo = grid_map("load"), grid_map("setpoint")
    alone = worst(load) <= BOUND
    both = alone & (worst(servo, "setpoint") <= BOUND)
    best = {
        name: int(np.argmin(np.where(good, load.iae, np.inf)))
        for name, good in (("alone", alone), ("both", both))
    }
    book.statement(
        "st.ppm.reason",
        best["both"],
        "!=",
        best["alone"],
        left_name="number of the best setting of the map, set point and load",
        right_name="load only",
        note=f"Map of 10⁴ settings within 30 % of (25), limits of Paper Fig. 3, T_s = 0.01: {int(alone.sum())} fulfil "
        f"(23), and {int(both.sum())} the same for the set point too. The best IAE_d is "
        f"{load.iae[best['alone']]:.3f} and {load.iae[best['both']]:.3f}. That the steps of the parameters were finite "
        "remains as a reason.",
    )
    root = loops.pida().times[1] ** 0.5
    book.statement(
        "st.taua",
        abs(root - book.printed("table1.m2.tau_a")),
        "<=",
        book.row("table1.m2.tau_a").half_unit,
        left_name="distance of T_A/T_d from the 0.0484 of Table 1",
        right_name="half a unit of its last place",
        note=f"As read. Table 1 has τ_A = T_A²/T_d²; T_A/T_d would be {root:.2f}. An exponent "
        "may be lost in the reading.",
    )
    return pd.DataFrame(
        {name: {AXES[i]: f"{x:.3f}" for i, x in enumerate(grid()[k])} for name, k in best.items()}
    ).T


def draw_spare() -> Figure:
    """The excess of (25) over the reserve of the limits."""
    figure, ax = plt.subplots(figsize=(6.4, 2.3))
    spare = np.array(sorted(SPARES))
    excess = [float(_tight(x).tv1_y) for x in spare]
    ax.plot(spare, excess, "o-", label="(25)")
    ax.axhline(BOUND, linestyle="--", color="#808080", label="bound of (23)")
    ax.set(
        xlabel="reserve of the limits beyond rest, unit of u",
        ylabel=r"$\mathrm{TV}_1(y_d)$",
        xlim=(0, None),
        ylim=(0, None),
    )
    ax.legend()
    return figure
