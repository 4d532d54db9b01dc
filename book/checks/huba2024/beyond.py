"""Experiments around huba2024 that no row of the ledger asks for: protections, the sampled engine, hidden choices."""

from __future__ import annotations

import json
from functools import cache
from itertools import product
from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from pidalab import plots
from pidalab.rules import automatic_reset as ar

from . import loops
from .tables import tabled

WAYS = {
    "automatic reset": "reset",
    "no protection": None,
    "clamping": "clamping",
    "conditioning": "conditioning",
}
ORACLE = Path(__file__).parents[3] / "tests" / "oracle" / "reset_loops.json"


@cache
def protected(name: str, way: str, step: str) -> pidalab.Response:
    """The same linear controller under one of four protections against windup."""
    kind = WAYS[way]
    if kind == "reset":
        return loops.run(name, step)
    return loops.sampled(loops.parallel(name), step, anti_windup=kind)


@tabled
def protections() -> pd.DataFrame:
    """Set point and load under the four protections."""
    rows = {}
    for name, way in product(("MRDP-PIDA", "PIDA_1"), WAYS):
        servo, load = (protected(name, way, step) for step in loops.STEPS)
        rows[f"{name.removesuffix('-PIDA')}, {way.removeprefix('automatic ')}"] = {
            "IAE, set point": f"{servo.iae():.2f}",
            "overshoot": f"{loops.beyond(servo, 'setpoint'):.2%}",
            "TV_1(u)": f"{abs(servo.tv1('u', final=0.0)):.2g}",
            "IAE, load": f"{load.iae():.2f}",
            "undershoot": f"{loops.beyond(load, 'load'):.4f}",
            "TV_1(u), load": f"{abs(load.tv1('u', final=-1.0)):.2g}",
        }
    return pd.DataFrame(rows).T


@tabled
def tracking() -> pd.DataFrame:
    """How fast conditioning follows the limit, and how often clamping switches."""
    rows = {}
    for name in ("MRDP-PIDA", "PIDA_1"):
        own, r = loops.designs()[name], protected(name, "clamping", "load")
        moves = np.abs(np.diff(r.u[(r.t > 5) & (r.t < 15)]))
        rows[name] = {
            "time of conditioning, T_d": f"{(own.ti + own.kd / own.kp - own.n * own.filter_time) / own.delay:.2f}",
            "moves of u with clamping, t from 5 to 15": str(int(np.sum(moves > 1e-9))),
            "largest of them": f"{np.max(moves):.1g}",
        }
    return pd.DataFrame(rows).T


def draw_protections(*names: str) -> Figure:
    """The load step under four protections, a row for each controller: output and control signal."""
    names = names or ("MRDP-PIDA", "PIDA_1")
    figure, axes = plt.subplots(
        len(names), 2, figsize=(6.4, 0.5 + 2.2 * len(names)), sharex=True, squeeze=False
    )
    for row, name in zip(axes, names, strict=True):
        for (ax, signal), way in product(zip(row, "yu", strict=True), WAYS):
            r = protected(name, way, "load")
            ax.plot(*plots.thin(r.t, getattr(r, signal), 480), label=way)
        row[0].set(ylabel="output y", xlim=(0, 50), title=loops.LABELS.get(name, name))
        row[1].set(ylabel="control u")
    for ax in axes[-1]:
        ax.set_xlabel("time units")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=2)
    return figure


@tabled
def filtered_setpoint() -> pd.DataFrame:
    """Does Q_n filter the set point? Both ways, with n = 3 (PID: 2) so that the prefilter F_p/Q_n is proper."""
    rows: dict[str, dict[str, str]] = {}
    for name in ("PID", "MRDP-PIDA", "PPM-PIDA", "PIDA_1", "PIDA_2"):
        n = 2 if name == "PID" else 3
        own = loops.design(ar.SETTINGS[name], n=n, filter_time=0.8 / n)
        around = control.tf((np.poly1d([own.filter_time, 1.0]) ** n).coeffs, 1.0) * own.prefilter
        for way, prefilter in (("filtered", own.prefilter), ("not filtered", around)):
            r = loops.sampled(pidalab.Loop(loops.plant(), own.controller, prefilter=prefilter), "setpoint")
            rows.setdefault(name, {})[f"IAE, {way}"] = f"{r.iae():.3f}"
            rows[name][f"overshoot, {way}"] = f"{loops.beyond(r, 'setpoint'):.3%}"
    return pd.DataFrame(rows).T


@tabled
def without_equivalent_delay() -> pd.DataFrame:
    """The set-point step if the filter is left out of T_d."""
    rows = {}
    for name, setting in ar.SETTINGS.items():
        r = loops.sampled(loops.design(setting, weight=0.0).loop(), "setpoint")
        own = loops.beyond(loops.run(name, "setpoint"), "setpoint")
        rows[name] = {"overshoot, T_d = 1": f"{loops.beyond(r, 'setpoint'):.1%}", "T_d = 1.8": f"{own:.1%}"}
    return pd.DataFrame(rows).T


@tabled
def filter_of_fixed_time() -> pd.DataFrame:
    """Paper Fig. 2 with T_f = 0.2 for every n in place of T_e = 0.8: the family at three τ_2."""
    rows = {}
    for n in (2, 3, 4, 6):
        points = [loops.point(ar.double_zero(tau / ar.PIDA_1.ti)) for tau in (0.2, 0.232, 0.348)]
        servo, load = (loops.portrait(points, loops.T_S, step, n=n, filter_time=0.2) for step in loops.STEPS)
        rows[f"n = {n}, T_d = {1 + 0.2 * n:g}"] = {
            f"{label} at {tau:g}": f"{max(p.tv1_u[i], 0):.5f}"
            for i, tau in enumerate((0.2, 0.232, 0.348))
            for label, p in (("TV_1(u_s)", servo), ("TV_1(u_d)", load))
        }
    return pd.DataFrame(rows).T


@tabled
def accuracy() -> pd.DataFrame:
    """The sampled engine against the exact one without limits, and against the oracle of the tests with limits."""
    kept = json.loads(ORACLE.read_text())
    late: dict[tuple[str, float], list[np.ndarray]] = {}
    times = (0.02, 0.01, 0.005, 0.0025)
    for h, case in product(times, [case for case in kept["cases"] if case["delay"] == 1.0]):
        own = pidalab.SeriesPIDA(**case["controller"])
        before = control.tf(1, case["prefilter"]) if case["setpoint"] else None
        loop, clock = pidalab.Loop(loops.plant(), own, prefilter=before), loops.clock(30.0, h)
        inputs, each = {"setpoint": case["setpoint"], "load": case["load"]}, round(0.5 / h)
        free = pidalab.simulate_sampled(loop, clock, **inputs)
        tight = pidalab.simulate_sampled(loop, clock, **inputs, limits=tuple(case["limits"]))
        late.setdefault(("without limits", h), []).append(
            (free.y - pidalab.simulate(loop, clock, **inputs).y)[::each]
        )
        late.setdefault(("with limits", h), []).append(tight.y[::each] - case["y"])
    rows = {}
    for kind in ("without limits", "with limits"):
        for h, half in zip(times, (*times[1:], None), strict=True):
            row = rows[f"{kind}, T_s = {h:g}"] = {"largest error": f"{np.max(np.abs(late[kind, h])):.2e}"}
            if half:
                better = 2 * np.array(late[kind, half]) - np.array(late[kind, h])
                row["extrapolated"] = f"{np.max(np.abs(better)):.1e}"
    return pd.DataFrame(rows).T.fillna("")


@tabled
def machines() -> pd.DataFrame:
    """The stored benchmark of portraits: our engine beside two other ways."""
    kept = pd.read_csv(Path(__file__).parents[2] / "data" / "portrait_comparison.csv", comment="#").set_index(
        "method"
    )
    return pd.DataFrame(
        {
            "loops run": kept.sets.map("{:d}".format),
            "seconds for 10⁴": kept.seconds_for_all.map("{:.3g}".format),
            "times as long": kept.ratio.map("{:.2g}".format),
            "IAE differs by": kept.iae_difference.map("{:.0e}".format, na_action="ignore"),
        }
    ).fillna("")


def draw_reset() -> Figure:
    """What the reset does: PIDA_1 and MRDP-PIDA after the load, output and state of the reset, with u in pale."""
    figure, axes = plt.subplots(1, 2, figsize=(6.4, 2.9))
    for name in ("MRDP-PIDA", "PIDA_1"):
        r, label = loops.run(name, "load"), loops.LABELS.get(name, name)
        axes[0].plot(*plots.thin(r.t, r.y, 800), label=label)
        (line,) = axes[1].plot(*plots.thin(r.t, -loops.estimate(name), 800))
        style = {"color": line.get_color(), "linestyle": line.get_linestyle()}
        axes[1].plot(*plots.thin(r.t, r.u, 800), alpha=0.4, **style)
    axes[0].set(ylabel="output y", xlabel="time units", xlim=(0, 40))
    axes[1].set(ylabel="reset x, and u in pale", xlabel="time units", xlim=(0, 40))
    axes[0].legend()
    return figure
