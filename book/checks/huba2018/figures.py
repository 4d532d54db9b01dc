"""Figures of huba2018 that both of its pages show, or that are more than a few lines; they hand nothing over."""

import math
from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from pidalab import plots
from pidalab.rules import mrdp

from .designs import EXPERIMENTS, GROWTH, ORDERS, SHORTEST, USED_DELAY, ruled_step, shortest_filter, unit
from .equations import far_poles
from .robustness import family
from .setpoint import BY_M

GREY = "#808080"
SHOWN = (0, 1, 2, 4)  # derivative orders in a figure of steps


def steps_by_order(te: float, orders: Sequence[int] = SHOWN, until: float = 14.0) -> Figure:
    """Draw set-point and load steps over the derivative order: y above u."""
    t = np.linspace(0, until, 3501)
    figure, axes = plt.subplots(2, 2, figsize=(6.4, 3.7), sharex=True)
    for m in orders:
        loop = mrdp.tune(unit(), m, m + 2, te).loop()
        runs = pidalab.step_response(loop, t), pidalab.load_response(loop, t)
        for column, run in enumerate(runs):
            axes[0, column].plot(*plots.thin(run.t, run.y), label=f"m = {m}")
            axes[1, column].plot(*plots.thin(run.t, run.u))
    for ax, title in zip(axes[0], ("set-point step", "load step"), strict=True):
        ax.set(title=title, xlim=(0, until))
    axes[0, 0].set_ylabel("output y")
    axes[1, 0].set(ylabel="control u", xlabel="time, dead times")
    axes[1, 1].set_xlabel("time, dead times")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=len(orders))
    return figure


def ruled_steps() -> Figure:
    """Draw the settings of Paper Figs 2 and 3: for each m a line for n = m + 1, and a band for every n up to 6."""
    figure, axes = plt.subplots(2, 2, figsize=(6.4, 4.0), sharex=True, sharey="row")
    shown = np.r_[0:150:2, 150:751:10]  # samples: dense where the control signal has its pulse
    for column, q in enumerate(GROWTH):
        for m in ORDERS:
            runs = [ruled_step(q, m, n) for n in BY_M[m]]
            middle = ruled_step(q, m, m + 1)
            for ax, name in zip(axes[:, column], "yu", strict=True):
                values = np.array([getattr(run, name)[shown] for run in runs])
                (line,) = ax.plot(middle.t[shown], getattr(middle, name)[shown], label=f"m = {m}")
                colour = line.get_color()
                ax.fill_between(
                    middle.t[shown], values.min(axis=0), values.max(axis=0), color=colour, alpha=0.25, lw=0
                )
        axes[0, column].set(title=f"$T_e = {SHORTEST} \\cdot {q:g}^m$", xlim=(0, 15))
        axes[1, column].set_xlabel("time, dead times")
    axes[0, 0].set_ylabel("output y")
    axes[1, 0].set_ylabel("control u")
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=5, columnspacing=1.0
    )
    return figure


def reason() -> Figure:
    """Draw loop gain and output of PIDA with a filter that is long enough and with one that is not."""
    w, t = np.logspace(-1, 2.7, 800), np.linspace(0, 6, 6001)
    figure, axes = plt.subplots(1, 2, figsize=(6.4, 3.0))
    for te in (0.2, 0.04):
        loop = mrdp.tune(unit(), 2, 4, te).loop()
        axes[0].loglog(w, np.abs(loop.L(1j * w)), label=f"$T_e = {te:g}$")
        axes[1].plot(*plots.thin(t, pidalab.step_response(loop, t).y), label=f"$T_e = {te:g}$")
    axes[0].axhline(1.0, color=GREY, linestyle=":", linewidth=1.2)
    axes[0].set(xlabel="frequency, rad per dead time", ylabel="loop gain |L|", ylim=(0.01, 20))
    axes[1].set(xlabel="time, dead times", ylabel="output y", ylim=(-0.5, 2.0), xlim=(0, 6))
    axes[0].legend(loc="lower left")
    return figure


def tails() -> Figure:
    """Draw the far poles of the loops without filter."""
    figure, ax = plt.subplots(figsize=(6.4, 3.6))
    for m, mark in zip(ORDERS, "osD^v", strict=True):
        x = far_poles(m)
        ax.plot(x.real, x.imag, mark, markersize=4, label=f"m = {m}")
    ax.axvline(0.0, color=GREY, linewidth=1.2)
    ax.set(xlabel="real part times $T_d$", ylabel="imaginary part times $T_d$")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside upper left", ncols=5, columnspacing=1.0)
    return figure


def stability_map() -> Figure:
    """Draw where the tuned loops are stable over T_e, with the settings of the paper."""
    pairs = [(m, n) for m in (2, 3, 4) for n in BY_M[m]]
    row = {key: k + 0.6 * key[0] for k, key in enumerate(pairs)}
    left, right = 0.01, 8.0
    figure, ax = plt.subplots(figsize=(6.4, 3.9))
    for m, n in pairs:
        border = shortest_filter(m, n)
        ax.barh(
            row[m, n], border - left, left=left, color="#c8591a", hatch="////", edgecolor="white", linewidth=0
        )
        ax.barh(row[m, n], right - border, left=border, color="#2a8f5b", alpha=0.35)
    marks = {"o": (f"$T_e$ = {SHORTEST}", 1.0), "D": ("(16), q = 1.5", 1.5), "s": ("(16), q = 2", 2.0)}
    for mark, (label, q) in marks.items():
        te = [SHORTEST * q**m for m, _ in pairs]
        ax.plot(te, list(row.values()), mark, color="black", mfc="none", ms=4.5, label=label)
    stars = [(te / USED_DELAY, row[m, n]) for m, n, te in EXPERIMENTS.values()]
    ax.plot(*zip(*stars, strict=True), "*", color="black", ms=10, label="Paper Figs 5 to 7")
    ax.set(xscale="log", xlim=(left, right), xlabel="$T_e / T_{dm}$")
    ax.set_yticks(list(row.values()), [f"m = {m}, n = {n}" for m, n in pairs], fontsize=9)
    ax.grid(axis="y", visible=False)
    ax.invert_yaxis()
    figure.legend(*ax.get_legend_handles_labels(), loc="outside upper left", ncols=2)
    return figure


def short_pid() -> Figure:
    """Draw set-point steps of PID with filters down to thousandths of a dead time."""
    t = np.linspace(0, 8, 8001)
    figure, axes = plt.subplots(2, 1, figsize=(6.4, 5.0))
    for te in (0.5, 0.1, 0.005):
        run = pidalab.step_response(mrdp.tune(unit(), 1, 2, te).loop(), t)
        axes[0].plot(*plots.thin(t, run.y), label=f"$T_e = {te:g}$")
        axes[1].plot(*plots.thin(t[t <= 2], run.u[t <= 2]))
    axes[0].set(ylabel="output y", xlim=(0, 8))
    axes[1].set(ylabel="control u", xlabel="time, dead times", xlim=(0, 2))
    axes[1].set_yscale("symlog", linthresh=1.0)
    axes[0].legend(loc="lower right")
    return figure


def around_the_limit() -> Figure:
    """Draw set-point steps just below and just above the shortest filter."""
    figure, axes = plt.subplots(3, 2, figsize=(6.4, 6.4), sharex=True, sharey=True)
    t = np.linspace(0, 12, 6001)
    for m, row in zip((2, 3, 4), axes, strict=True):
        for ax, factor in zip(row, (0.85, 1.15), strict=True):
            run = pidalab.step_response(mrdp.tune(unit(), m, 6, factor * shortest_filter(m, 6)).loop(), t)
            ax.plot(*plots.thin(t, run.y))
            ax.set(
                title=f"m = {m}, 15 % {'below' if factor < 1 else 'above'}", ylim=(-0.6, 2.4), xlim=(0, 12)
            )
        row[0].set_ylabel("output y")
    for ax in axes[-1]:
        ax.set_xlabel("time, dead times")
    return figure


def price(columns: Mapping[str, str], families: Mapping[str, pd.DataFrame]) -> Figure:
    """Draw measures over the derivative order, a line for each family."""
    figure, axes = plt.subplots(math.ceil(len(columns) / 2), 2, figsize=(6.4, 3.9), sharex=True)
    for ax, (column, label) in zip(axes.flat, columns.items(), strict=True):
        for (name, one), mark in zip(families.items(), "osD", strict=False):
            ax.plot(one.index, one[column], marker=mark, markersize=5, label=name)
        ax.set(title=label, xticks=list(ORDERS))
        ax.set_ylim(0, 1.1 * max(one[column].max() for one in families.values()))
    for ax in axes[-1]:
        ax.set_xlabel("derivative order m")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=2)
    return figure


def price_of_order() -> Figure:
    """Draw what a higher derivative order brings and costs at equal set-point and at equal load steps."""
    families = {
        "equal set-point IE, 4.5": family("IAE_s", 4.5, 1),
        "equal load IE, 15": family("load", 15.0, 1),
    }
    columns = {
        "noise in u": "noise in u",
        "Ms": "$M_s$",
        "delay margin": "delay margin, dead times",
        "IE load": "IE after a load step",
    }
    return price(columns, families)


def engines(path: str) -> Figure:
    """Draw the errors of several engines over their time of computation, from the file of the benchmark."""
    speed = pd.read_csv(path, comment="#")
    methods = dict(zip(speed.method.unique(), ["k*", "o-", "s-", "^-", "D-", "v-"], strict=True))
    figure, axes = plt.subplots(2, 2, figsize=(6.4, 6.4), sharex=True, sharey=True)
    for ax, ((m, n, te), rows) in zip(axes.flat, speed.groupby(["m", "n", "te"], sort=False), strict=True):
        _engines_of_one_loop(ax, rows, methods)
        stable = pidalab.is_stable(mrdp.tune(unit(), m, n, te).loop())
        ax.set_title(f"m = {m}, $T_e$ = {te:g}: {'stable' if stable else 'unstable'}")
    for ax in axes[1]:
        ax.set_xlabel("time, s")
    for ax in axes[:, 0]:
        ax.set_ylabel("largest error")
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=3, columnspacing=1.0
    )
    return figure


def _engines_of_one_loop(ax: Axes, rows: pd.DataFrame, methods: Mapping[str, str]) -> None:
    for method, one in rows.groupby("method", sort=False):
        ax.loglog(one.seconds, one.error.clip(upper=10.0), methods[str(method)], markersize=5, label=method)


def engines_table(path: str) -> pd.DataFrame:
    """Give the least error that each method reached, and its time in multiples of pidalab's."""
    speed = pd.read_csv(path, comment="#")
    top = speed.loc[speed.groupby(["m", "n", "te", "method"], sort=False).error.idxmin()]
    cells: dict[str, dict[str, str]] = {}
    for one in top.itertuples():
        reached = f"{one.error:.0e} in {one.ratio:.2g}" if one.error < 1 else "no digit"
        cells.setdefault(f"m = {one.m}, Tₑ = {one.te:g}", {})[str(one.method)] = reached
    return pd.DataFrame(cells)
