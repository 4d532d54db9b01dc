"""Figures of the chapter on heo2023 and its audit: at most two columns, 6.4 inches wide."""

import math
from collections.abc import Iterable, Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colorbar import Colorbar
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from pidalab import plots
from pidalab.ledger import Ledger
from pidalab.rules import itae

from . import beyond
from .examples import KINDS, METHODS, SPOKEN, runs
from .printed_itae import ENDS, START, misfits
from .statements import predicted
from .table1 import data, figure1, unit

GREY = "#808080"
ORDER = (
    "Example 1, set point",
    "Example 1, load",
    "Example 2, set point",
    "Example 2 with dead time 0.2, set point",
    "Example 3, set point",
    "Example 2, load",
    "Example 3, load",
)


def _panels(rows: int, height: float, **options: object) -> tuple[Figure, np.ndarray]:
    """A figure of two columns."""
    return plt.subplots(rows, 2, figsize=(6.4, height), **options)  # type: ignore[call-overload]


def _ratio_axis(ax: Axes) -> None:
    """A logarithmic axis of the ratio of dead time to time constant, with plain numbers."""
    ax.set(xscale="log", xticks=[0.1, 0.3, 1, 2])
    ax.xaxis.set_major_formatter("{x:g}")
    ax.minorticks_off()


def responses(k: int, until: float, first: float) -> Figure:
    """Paper Figs 2 to 4: output above control signal, set point on the left, load on the right."""
    figure, axes = _panels(2, 4.4)
    for column, (kind, end) in enumerate(zip(KINDS, (first, until), strict=True)):
        shown = {name: runs()[k, method, kind] for method, name in METHODS.items()}
        plots.signal(axes[0, column], shown, "y", until=until)
        plots.signal(axes[1, column], shown, "u", until=end)
        axes[0, column].set(title=("set-point step", "load step")[column])
    axes[1, 0].set_yscale("symlog", linthresh=10, linscale=2)
    axes[1, 0].set_yticks([x * s for x in (10, 100, 1000) for s in (-1, 1)] + [0])
    axes[1, 0].yaxis.set_major_formatter("{x:g}")
    axes[0, 0].set_ylabel("output y")
    axes[1, 0].set_ylabel("control u")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=3)
    return figure


def misfit(book: Ledger) -> Figure:
    """How far the printed ITAE values are missed, over step time and end."""
    starts, after, missed = misfits(book)
    figure, axes = _panels(4, 8.4, sharey=True)
    for ax, name in zip(axes.flat, ORDER, strict=False):
        kind = "load" if name.endswith("load") else "setpoint"
        end = starts[:, None] + after
        at = end, starts[:, None] + 0 * after, 100 * missed[name]
        shade = ax.contourf(*at, [0, 1, 3, 10, 30], cmap="viridis_r", extend="max")
        ax.plot(ENDS[int(name[8]), kind], START, "*", color="#c8591a", markersize=9, markeredgecolor="white")
        ax.set_title(name.replace(" with", "\nwith"), fontsize=10)
        ax.set(xlim=(5, 30), xlabel="end $t_1$, time units")
    for ax in axes[:, 0]:
        ax.set_ylabel("step at $t_0$")
    axes[3, 1].axis("off")
    _as_drawn(figure.colorbar(shade, ax=axes[3, 1], label="misfit, %", location="left"))
    return figure


def _as_drawn(bar: Colorbar) -> None:
    """Keep the colour of what lies beyond the scale in the dark, as that of the scale itself."""
    for i, patch in enumerate(bar.ax.findobj(PathPatch)):
        patch.set_gid(f"as-drawn-{i}")


def prediction() -> Figure:
    """What the controller looks at: an error, the same error later, and its predictions."""
    p = predicted(1, "proposed", "load")
    shown = p.t < 6
    figure, ax = plt.subplots(figsize=(6.4, 2.9))
    ax.plot(*plots.thin(p.t[shown], p.now[shown]), "-", color=GREY, lw=1.0, label="$e(t)$")
    labels = r"$e(t + \tau_a)$", r"predicted with $\dot e$", r"with $\dot e$ and $\ddot e$"
    for label, line in zip(labels, (p.later, p.one, p.two), strict=True):
        ax.plot(*plots.thin(p.t[shown], line[shown], 400), label=label)
    ax.set(xlabel="time units", ylabel="error e")
    figure.legend(loc="outside upper left", ncols=2, fontsize=10)
    return figure


def table1() -> Figure:
    """The factors of Table 1 over the range."""
    r = np.linspace(0.1, 2, 381)
    figure, axes = _panels(1, 3.4)
    for xi in (0.3, 0.65, 1.0, 1.5, 2.0):
        found = [itae.factors(unit(xi, x)) for x in r]
        for ax, values in zip(axes, zip(*found, strict=True), strict=True):
            ax.plot(r, values, label=f"ξ = {xi:g}")
    for ax, name in zip(axes, ("$f_d$", "$f_a$"), strict=True):
        ax.set(title=name, xlabel=r"$\theta_m/\tau_m$")
    for at in (0.37, 1.0):
        axes[1].axvline(at, color=GREY, linewidth=0.8, linestyle=":")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=5, fontsize=10)
    return figure


def cost() -> Figure:
    """The factors of Table 1, and those of least IAE and of least ITAE."""
    ratios, found = np.linspace(0.1, 2, 191), data("itae_factors.csv")
    figure, axes = _panels(4, 8.4, sharex=True, sharey="col")
    for row, xi in zip(axes, (0.3, 0.5, 0.75, 1.0), strict=True):
        lines = np.array([itae.factors(unit(xi, x)) for x in ratios])
        for column, ax in enumerate(row):
            ax.plot(ratios, lines[:, column], "-", label="Table 1")
            for name, mark in (("IAE", "o"), ("ITAE", "x")):
                one = found.query("measure == @name and damping == @xi")
                ax.plot(one.ratio, one[("f_d", "f_a")[column]], mark, markersize=6, label=f"least {name}")
            ax.set_ylabel((f"$f_d$, ξ = {xi:g}", "$f_a$")[column])
    for ax in axes[-1]:
        ax.set_xlabel(r"$\theta_m/\tau_m$")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=3)
    return figure


def paper_figure1() -> Figure:
    """Paper Fig. 1 with an assumed dead time of half the time constant."""
    figure, axes = _panels(1, 3.4, sharey=True)
    for ax, xi, tag in zip(axes, (0.5, 1.0), "ab", strict=True):
        shown = {
            name: figure1()[xi, 0.5][name] for name in ("PIDA, proposed", "PIDA, optimal", "PID, ITAE-2")
        }
        plots.signal(ax, shown, "y", until=8)
        ax.set_title(rf"({tag}) $\xi_m = {xi:g}$")
    axes[0].set_ylabel("output y")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=3)
    return figure


def limits() -> Figure:
    """Set-point steps with a limited actuator, without and with a filter of the set point."""
    figure, axes = _panels(1, 3.2, sharey=True)
    for limit in (math.inf, 100.0, 10.0, 5.0):
        label = "no limit" if limit == math.inf else f"±{limit:g}"
        for ax, lag in zip(axes, (0.0, beyond.best_lag("proposed", limit)[1]), strict=True):
            run = beyond.limited("proposed", limit, lag)
            ax.plot(*plots.thin(run.t[run.t <= 6], run.y[run.t <= 6], 800), label=label)
    pid = beyond.limited("ITAE-2", math.inf, 0.0)
    for ax, title in zip(axes, ("no filter", "best filter"), strict=True):
        ax.plot(
            *plots.thin(pid.t[pid.t <= 6], pid.y[pid.t <= 6], 800),
            "-",
            color=GREY,
            lw=1,
            label="PID, no limit",
        )
        ax.set(title=f"set point: {title}", xlabel="time units")
    axes[0].set_ylabel("output y")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=5, fontsize=10)
    return figure


def _maps(
    axes: Iterable[Axes], chosen: Sequence[tuple[str, pd.DataFrame]], column: str, levels: list[float]
) -> object:
    """Draw one quantity over ratio and damping; where the loop is unstable the hatched ground is left bare."""
    for ax, (title, rows) in zip(axes, chosen, strict=True):
        grid = rows.pivot(index="damping", columns="ratio", values=column)
        at = grid.columns, grid.index, grid.replace(math.inf, math.nan).clip(lower=levels[0])
        ax.patch.set(hatch="////", edgecolor=GREY)
        shade = ax.contourf(*at, levels, cmap="viridis_r", extend="max")
        ax.grid(False)
        _ratio_axis(ax)
        ax.set_title(title, fontsize=11)
    return shade


def sensitivity(*kinds: str) -> Figure:
    """Ms over the range of the rule."""
    figure, axes = _panels(len(kinds), 0.4 + 2.6 * len(kinds), sharex=True, sharey=True, squeeze=False)
    rows = beyond.contest().query("role == 'grid'")
    chosen = [
        (f"{title}, {SPOKEN[kind]}", rows.query("rule == @rule and kind == @kind"))
        for kind in kinds
        for rule, title in (("ITAE-2", "ITAE-2"), ("Table 1", "proposed"))
    ]
    shade = _maps(axes.flat, chosen, "ms", [1, 1.4, 1.7, 2, 2.5, 3, 4, 6])
    _label(figure, axes, shade, "$M_s$")
    return figure


def _label(figure: Figure, axes: np.ndarray, shade: object, name: str) -> None:
    for ax in axes[-1]:
        ax.set_xlabel(r"$\theta/\tau$")
    for ax in axes[:, 0]:
        ax.set_ylabel("ξ")
    _as_drawn(figure.colorbar(shade, ax=axes, label=name, format="{x:g}"))  # type: ignore[arg-type]


def ratio(kind: str) -> Figure:
    """How near each rule is to the optimum."""
    figure, axes = _panels(2, 5.6, sharex=True, sharey=True)
    rows = beyond.contest().query("role == 'fit' and kind == @kind")
    chosen = [(rule, rows.query("rule == @rule")) for rule in beyond.CONTEST[kind]]
    shade = _maps(axes.flat, chosen, "itae", [1, 1.05, 1.2, 1.5, 2, 3, 5, 8])
    _label(figure, axes, shade, "ITAE over the least ITAE")
    return figure


def refit() -> Figure:
    """The factors for set points: Table 1, the refit, the best pair of each model."""
    r = np.geomspace(0.1, 2, 100)
    best = data("itae_optima.csv").query("kind == 'setpoint' and role == 'fit'")
    figure, axes = _panels(4, 8.4, sharex=True, sharey="col")
    for row, xi in zip(axes, (0.3, 0.7, 1.1, 2.0), strict=True):
        models, one = [unit(xi, x) for x in r], best.query("damping == @xi")
        for column, (ax, name) in enumerate(zip(row, ("f_d", "f_a"), strict=True)):
            for label, source in (("Table 1", itae.factors), ("refit", itae.setpoint_factors)):
                ax.plot(r, [source(model)[column] for model in models], label=label)
            ax.plot(one.ratio, one[name], "x", markersize=6, label="best for each model")
            _ratio_axis(ax)
            ax.set_ylabel((f"$f_d$, ξ = {xi:g}", "$f_a$")[column])
    for ax in axes[-1]:
        ax.set_xlabel(r"$\theta_m/\tau_m$")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=3)
    return figure


def zeros() -> Figure:
    """Poles of four models, and the zeros of the controllers of least ITAE."""
    figure, axes = _panels(2, 5.2, sharex=True, sharey=True)
    for ax, at in zip(axes.flat, ((0.3, 0.28), (0.9, 0.2), (1.5, 0.2), (2.0, 1.0)), strict=True):
        poles, places, _ = beyond.zeros()[at]
        ax.plot(poles.real, poles.imag, "x", markersize=10, label="poles of the model")
        ax.plot(places.real, places.imag, "o", fillstyle="none", markersize=8, label="zeros of the optimum")
        ax.set(xlim=(-4.2, 0.3), ylim=(-1.5, 1.5))
        ax.set_title("ξ = {:g}, θ/τ = {:g}".format(*at), fontsize=11)
    for ax in axes[-1]:
        ax.set_xlabel(r"real part times $\tau$")
    for ax in axes[:, 0]:
        ax.set_ylabel(r"imaginary part times $\tau$")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=2)
    return figure
