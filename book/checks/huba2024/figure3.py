"""Paper Fig. 3 of huba2024, and what its text says of the controllers at the limits."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from pidalab import plots
from pidalab.ledger import Ledger, every

from . import loops
from .tables import tabled

SHOWN = ("MRDP-PIDA", "PPM-PIDA", "PIDA_1", "PIDA_2")
ROUNDING = 1e-9
STANDARD = "Loop of Paper Fig. 3, T_s = 0.001, 60 time units"


def draw() -> Figure:
    """Set-point and load step of the paper's four controllers, y above u, with the state of the reset."""
    figure, axes = plt.subplots(2, 2, figsize=(6.4, 3.7), sharex="col")
    for column, step in zip(axes.T, loops.STEPS, strict=True):
        runs = {loops.LABELS.get(name, name): loops.run(name, step) for name in SHOWN}
        for ax, signal in zip(column, "yu", strict=True):
            plots.signal(ax, runs, signal, until=40 if step == "load" else 30)
    for line, name in zip(axes[1, 1].get_lines(), SHOWN, strict=False):
        x = -loops.estimate(name)
        axes[1, 1].plot(loops.clock()[:40001:100], x[:40001:100], color=line.get_color(), alpha=0.45)
    axes[0, 0].set(title="set-point step", ylabel="output y", xlabel="")
    axes[0, 1].set(title="load step", xlabel="")
    axes[1, 0].set(ylabel="control u", xlabel="time units")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=4)
    return figure


def overshoot_of(name: str, step: str, linear: bool = False) -> float:
    return loops.beyond(loops.run(name, step, linear), step)


@cache
def iae(name: str, step: str) -> float:
    return loops.run(name, step).iae()


@cache
def known(name: str) -> float:
    """Time after which the reset knows the load within 2 %."""
    far = np.flatnonzero(np.abs(loops.estimate(name) - 1) > 0.02)[-1]
    return float(loops.run(name, "load").t[far])


@tabled
def measures(book: Ledger) -> pd.DataFrame:
    """All six controllers in numbers."""
    rows = {}
    for name in loops.designs():
        servo, load = loops.run(name, "setpoint"), loops.run(name, "load")
        rows[name] = {
            "IAE, set point": f"{servo.iae():.3f}",
            "overshoot": f"{overshoot_of(name, 'setpoint'):.2%}",
            "TV_1 of u": f"{abs(loops.excess(servo, 'setpoint')[1]):.4f}",
            "IAE, load": f"{load.iae():.2f}",
            "undershoot": f"{overshoot_of(name, 'load'):.4f}",
            "TV_1 of u, load": f"{abs(loops.excess(load, 'load')[1]):.4f}",
            "load known after": f"{known(name):.1f}",
        }
    return pd.DataFrame(rows).T


def faster(book: Ledger) -> None:
    """Abstract and Section 4: faster with each derivative, in smooth shapes; Section 1: odd degrees."""
    order = ("PI", "PID", "PIDA_1")
    pairs = {
        f"{b} and {a}, {step}": (iae(b, step), iae(a, step))
        for step in loops.STEPS
        for a, b in pairwise(order)
    }
    said = "; ".join(f"{step} " + ", ".join(f"{iae(n, step):.2f}" for n in order) for step in loops.STEPS)
    book.statement(
        "st.abstract.accelerate",
        *every(pairs, "<"),
        left_name="IAE",
        right_name="that with one derivative fewer",
        note=f"IAE of PI, PID and PIDA_1: {said}; T_s = 0.001, 300 time units for PI and 60 for the others.",
    )
    shapes = {key: pair for name in loops.SHORT_RESET for key, pair in loops.shapes(name).items()}
    worst = {name: max(abs(e) / c for e, c in loops.shapes(name).values()) for name in loops.SHORT_RESET}
    book.statement(
        "st.abstract.shapes",
        *every(shapes, "<="),
        convention="settled",
        left_name="excess over the ideal shape",
        right_name="change of the signal",
        note="Controllers with a short reset, both signals and both steps. Largest excess, as a share of the change: "
        + ", ".join(f"{name} {x:.2%}" for name, x in worst.items())
        + ".",
    )
    ways = {}
    for name in loops.MRDP:
        r = loops.run(name, "load")
        ways[name] = r.tv("y", final=0.0) / (2 * float(np.max(r.y)))
    book.statement(
        "st.intro.odd",
        *every({name: (ways["PID"], ways[name]) for name in ("PI", "MRDP-PIDA")}, "<"),
        left_name="way of y after the load over that of one pulse, m = 1",
        right_name="even m",
        note="Multiple-pole settings with the smallest real zero as reset, load step of Paper Fig. 3: y moves "
        + ", ".join(f"{x:.3f} times as far as one pulse with {name}" for name, x in ways.items())
        + ". m = 0, 1 and 2 only.",
    )


@tabled
def unlimited(book: Ledger) -> pd.DataFrame:
    """Section 2.2: ideal shapes without limits."""
    rows = {}
    for name, short in zip(loops.MRDP, ("pi", "pid", "pida"), strict=True):
        found = loops.shapes(name, linear=True)
        book.statement(
            f"st.unconstrained.{short}",
            *every(found, "<="),
            convention="settled",
            left_name="excess over the ideal shape",
            right_name="change of the signal",
            note=f"No limits, loop of Paper Fig. 3, unrounded settings, T_s = 0.001: excess at most "
            f"{max(e for e, _ in found.values()):.4f}, where the bound of (23) for the search is "
            "0.001. A zero has no digits.",
        )
        rows[name] = {key.partition(", ")[2]: f"{e:.5f}" for key, (e, _) in found.items()}
    return pd.DataFrame(rows).T


def overshoot(book: Ledger) -> None:
    """Sections 2.2 and 2.4: MRDP-PIDA overshoots at the limits, at output and input."""
    name, both = "MRDP-PIDA", {}
    for step in loops.STEPS:
        r = loops.run(name, step)
        of_y, of_u = loops.change(r, step)
        both[f"y, {step}"] = (overshoot_of(name, step), of_y)
        both[f"u, {step}"] = (loops.excess(r, step)[1], of_u)
    said = (
        f"MRDP-PIDA: the output overshoots by {both['y, setpoint'][0]:.1%} of the step and falls "
        f"{both['y, load'][0]:.3f} below zero after the load; TV_1 of the input is {both['u, setpoint'][0]:.3f} "
        f"and {both['u, load'][0]:.3f}. Without limits the output overshoots by "
        f"{max(overshoot_of(name, step, True) for step in loops.STEPS):.4f}."
    )
    given: dict[str, Any] = {"left_name": "way beyond the ideal shape", "right_name": "change of the signal"}
    book.statement("fig3.mrdp", *every(both, ">"), convention="settled", **given, note=f"{STANDARD}. {said}")
    servo = {key: both[key] for key in ("y, setpoint", "u, setpoint")}
    book.statement("st.constrained.overshoot", *every(servo, ">"), convention="settled", **given)
    against = {
        f"overshoot, {step}": (overshoot_of(name, step), overshoot_of("PIDA_1", step)) for step in loops.STEPS
    }
    against |= {f"IAE, {step}": (iae(name, step), iae("PIDA_1", step)) for step in loops.STEPS}
    book.statement(
        "eq26.slow",
        *every(against, ">"),
        left_name="MRDP-PIDA",
        right_name="PIDA_1",
        note=f"{STANDARD}. MRDP-PIDA and PIDA_1: "
        + "; ".join(f"{key} {a:.4f} and {b:.4f}" for key, (a, b) in against.items())
        + ".",
    )


def comparison(book: Ledger) -> None:
    """Section 2.4: how the text ranks the controllers of Paper Fig. 3."""
    M, P, one, two = SHOWN
    better = {f"overshoot, {step}": (overshoot_of(P, step), overshoot_of(M, step)) for step in loops.STEPS}
    for step in loops.STEPS:
        of_u = [loops.excess(loops.run(name, step), step)[1] for name in (P, M)]
        better[f"TV_1 of u, {step}"] = (of_u[0], of_u[1])
    costs = {(name, step): iae(name, step) for name in SHOWN for step in loops.STEPS}
    book.statement(
        "fig3.ppm",
        *every(better, "<", "clearly"),
        left_name="PPM-PIDA",
        right_name="MRDP-PIDA",
        note=f"{STANDARD}. "
        + "; ".join(f"{key} {b:.4f} to {a:.4f}" for key, (a, b) in better.items())
        + f"; IAE {costs[M, 'setpoint']:.2f} to {costs[P, 'setpoint']:.2f} and {costs[M, 'load']:.1f} to "
        f"{costs[P, 'load']:.1f}.",
    )
    book.statement(
        "fig3.order.setpoint",
        costs[one, "setpoint"],
        "<",
        costs[two, "setpoint"],
        convention="slightly",
        left_name="IAE of PIDA_1",
        right_name="that of PIDA_2",
        note=f"{STANDARD}. The overshoot is {overshoot_of(one, 'setpoint'):.2%} against "
        f"{overshoot_of(two, 'setpoint'):.2%}.",
    )
    of_y = {name: loops.excess(loops.run(name, "load"), "load")[0] for name in (one, two, P)}
    book.statement(
        "fig3.order.disturbance",
        costs[two, "load"],
        "<",
        costs[one, "load"],
        convention="clearly",
        left_name="IAE of PIDA_2",
        right_name="that of PIDA_1",
        note=f"{STANDARD}. In shape it is worse: TV_1 of the output {of_y[two]:.4f} and {of_y[one]:.4f}.",
    )
