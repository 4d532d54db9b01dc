"""Absolute stability in huba2024: circle and Popov criterion with the exact dead time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from itertools import product
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from pidalab import plots
from pidalab.ledger import Ledger, every
from pidalab.robustness import limits as criteria
from pidalab.rules import automatic_reset as ar

from . import loops
from .tables import tabled

WAYS, WHATS = ("gains stay", "gains anew"), ("criterion", "stable")
TABLE = Path(__file__).parents[2] / "data" / "shortest_filters.csv"


@cache
def circle(name: str) -> criteria.Criterion:
    """Circle criterion for one of the six controllers."""
    return criteria.circle(loops.designs()[name].loop())


@cache
def popov(name: str) -> criteria.Criterion:
    """Popov criterion for one of the six controllers."""
    return criteria.popov(loops.designs()[name].loop())


def draw_circle() -> Figure:
    """Loci of the linear part, of those that do not pass and those that do."""
    figure, axes = plt.subplots(1, 2, figsize=(6.4, 3.1))
    w = np.geomspace(0.02, 60, 3000)
    for ax, names in zip(axes, (("PI", "MRDP-PIDA"), loops.SHORT_RESET), strict=True):
        parts = {loops.LABELS.get(n, n): criteria.linear_part(loops.designs()[n].loop()) for n in names}
        plots.circle_locus(ax, parts, w)
        ax.legend(loc="lower right", fontsize=9)
    axes[0].set(title="do not pass", xlim=(-2.2, 0.6), ylim=(-3, 1))
    axes[1].set(title="pass", xlim=(-1.3, 0.6), ylim=(-3, 1), ylabel="")
    return figure


def draw_popov() -> Figure:
    """Popov plots of the two that do not pass the circle criterion."""
    figure, axes = plt.subplots(1, 2, figsize=(6.4, 2.9))
    for ax, name in zip(axes, ("PI", "MRDP-PIDA"), strict=True):
        part = criteria.linear_part(loops.designs()[name].loop())
        plots.popov_plot(ax, {name: part}, np.geomspace(0.02, 60, 3000), {name: popov(name).multiplier})
        ax.set(title=name)
    axes[0].set(xlim=(-2.0, 0.5), ylim=(-1, 0.5))
    axes[1].set(xlim=(-2.0, 0.5), ylim=(-1, 1.2), ylabel="")
    return figure


@tabled
def margins(book: Ledger) -> pd.DataFrame:
    """What the paper says of PI, PID and PIDA_1, and what the criteria say."""
    book.statement(
        "st.absolute.pid",
        circle("PID").margin,
        ">",
        0,
        left_name="min Re(1 + G)",
        note="Circle criterion in the loop of Paper Fig. 3, the infimum over all frequencies bracketed.",
    )
    tried = {}
    for kp, ti in product((0.01, 0.1, ar.PI.kp, 1.0), (0.3, 1.0, ar.PI.ti, 20.0)):
        own = pidalab.SeriesPIDA(kp, 0.0, 0.0, ti, filter_time=0.2, filter_order=4)
        tried[f"K_p = {kp:.3g}, T_i = {ti:.3g}"] = (
            criteria.circle(pidalab.Loop(loops.plant(), own)).margin,
            0,
        )
    book.statement(
        "st.absolute.pi.circle",
        *every(tried, "<"),
        left_name="min Re(1 + G)",
        note=f"{len(tried)} PI controllers tried; the proof covers all of them: for ω → 0 Re(1 + G) tends to "
        "K_s(K_d − K_p T_d), with T_d = T_dp + n T_f, which is negative without derivative.",
    )
    book.statement(
        "st.absolute.pi.popov",
        popov("PI").margin,
        "<=",
        0,
        left_name="min Re(1 + (1 + jωθ)G)",
        note=f"The criterion of Popov certifies PI of eq. (15): {popov('PI').margin:.3f} with θ = "
        f"{popov('PI').multiplier:.2f}, loop of Paper Fig. 3. The paper cites Popov (1961).",
    )
    members = {
        f"τ_2 = {tau:g}": (criteria.circle(loops.design(ar.double_zero(tau / ar.PIDA_1.ti)).loop()).margin, 0)
        for tau in (0.16, 0.2, 0.232, 0.3, 0.348, 0.42)
    }
    book.statement(
        "st.absolute.pida1",
        *every(members, ">"),
        left_name="min Re(1 + G)",
        note="Loop of Paper Fig. 3: "
        + ", ".join(f"{x:.3f} with {key}" for key, (x, _) in members.items())
        + ". It needs the filter, see the table of the shortest ones.",
    )
    certified = {}
    for name in loops.designs():
        if max(circle(name).margin, popov(name).margin) > 0:
            for step in loops.STEPS:
                r = loops.run(name, step)
                certified[f"{name}, {step}"] = (loops.beyond(r, step), loops.change(r, step)[0])
    book.statement(
        "st.absolute.equivalent",
        *every(certified, "<="),
        convention="settled",
        left_name="overshoot of an absolutely stable loop",
        right_name="change of y",
        note="Circle or Popov criterion and overshoot in the loop of Paper Fig. 3: "
        + "; ".join(f"{key} {a / c:.2%}" for key, (a, c) in certified.items())
        + ". So absolute stability does not keep a loop from overshooting.",
    )
    return pd.DataFrame({name: _row(name) for name in loops.designs()}).T


def _row(name: str) -> dict[str, str]:
    own, by = (
        loops.designs()[name],
        "circle" if circle(name).holds else "Popov" if popov(name).holds else "no",
    )
    return {
        "circle": f"{circle(name).margin:+.3f}",
        "at frequency": f"{circle(name).frequency:.2f}",
        "limit at 0": f"{own.setting.kd - own.setting.kp:+.3f}",
        "Popov": f"{popov(name).margin:+.3f}",
        "with θ": f"{popov(name).multiplier:.2f}",
        "certified by": by,
    }


def shortest(name: str, way: str, what: str) -> float:
    """Shortest T_f down to 0.01 with which a loop has a property, its gains held or computed anew; 0 for all."""
    family = partial(_same_gains if way == "gains stay" else _new_gains, name)
    test = criteria.circle if circle(name).holds else criteria.popov
    holds = pidalab.is_stable if what == "stable" else partial(_passes, test)
    return criteria.smallest_filter_time(family, holds, 0.2, shortest=0.01)


@tabled
def shortest_filters() -> pd.DataFrame:
    """The table of studies/shortest_filters.py; of its 24 entries the four of PIDA_1 are computed again."""
    kept = pd.read_csv(TABLE, comment="#", index_col=["controller", "way"])
    for way in WAYS:
        for what in WHATS:
            fresh, stored = shortest("PIDA_1", way, what), kept.loc[("PIDA_1", way), what]
            if abs(fresh - stored) > 1e-6:
                raise ArithmeticError(f"PIDA_1, {way}, {what}: stored {stored}, computed {fresh:.6f}")
    shown = kept[list(WHATS)].map(lambda T: f"{T:.4f}" if T else "below 0.01")
    shown.insert(0, "by", ["circle" if circle(name).holds else "Popov" for name, _ in kept.index])
    return shown.rename(columns={what: f"{what} from T_f" for what in WHATS})


def _same_gains(name: str, filter_time: float) -> pidalab.Loop:
    return pidalab.Loop(loops.plant(), replace(loops.series(name), filter_time=filter_time))


def _new_gains(name: str, filter_time: float) -> pidalab.Loop:
    return loops.design(ar.SETTINGS[name], filter_time=filter_time).loop()


def _passes(test: Callable[[pidalab.Loop], criteria.Criterion], loop: pidalab.Loop) -> bool:
    return test(loop).holds
