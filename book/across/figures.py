"""Draw the figures of the pages across the papers from tables."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from pidalab import plots
from pidalab.style import LOOKS

import tables

MARKS = {"PI": "o", "PID": "s", "PIDA": "D", "m = 3": "^"}
HATCHES = {"PI": "", "PID": "//", "PIDA": "xx"}


def spans(groups: dict[str, pd.DataFrame], value: str, xlabel: str, log: bool = True) -> None:
    """Draw each group of rows as a line from its 10 % to its 90 % quantile. The mark at the median shows the kind."""
    labels = list(groups)
    figure, ax = plt.subplots(figsize=(6.4, 0.9 + 0.25 * len(labels)))
    for place, rows in enumerate(groups.values()):
        kind, values = rows["kind"].iloc[0], rows[value].replace(np.inf, np.nan).dropna()
        low, middle, high = values.quantile([0.1, 0.5, 0.9])
        ax.plot([low, high], [place, place], color=LOOKS[kind]["color"], linestyle="-", linewidth=1.5)
        ax.plot(middle, place, MARKS[kind], label=kind)
    ax.set_yticks(range(len(labels)), labels)
    ax.set(xlabel=xlabel, xscale="log" if log else "linear")
    ax.invert_yaxis()
    if log:
        plain(ax)
    plots.legend(figure)


def plain(ax: Axes) -> None:
    """Label a short logarithmic axis with plain numbers instead of powers of ten."""
    low, high = ax.get_xlim()
    between = (0.7, 1.5, 3) if high < 30 * low else ()  # on a longer axis they would overlap
    ticks = sorted([0.5, 1, 2, 5, 10, 20, 50, 100, 1000, *between])
    if high < 2 * low:
        ticks = [k / 10 for k in range(5, 100)]
    ticks = [tick for tick in ticks if low <= tick <= high]
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks], minor=False)
    ax.set_xticks([], minor=True)


def over_rolloff(table: pd.DataFrame, terms: tuple[str, ...] = ("quiet", "loud")) -> None:
    """Draw the saving by acceleration over the roll-off of the plant where its phase is -180 degrees."""
    _, ax = plt.subplots(figsize=(6.4, 3.6))
    for term, mark in zip(terms, ("o", "D"), strict=True):
        rows = table[table["terms"] == term]
        ax.plot(
            rows["rolloff"],
            100 * rows["saves"],
            mark,
            markersize=4,
            label=f"{term}, {tables.NOISE[term]:g}",
            alpha=0.8,
        )
    ax.set(
        xlabel="roll-off of the plant at its ultimate frequency (order)",
        ylabel="IAE saved by acceleration (%)",
    )
    ax.legend(title="relative noise gain")


def savings(table: pd.DataFrame, names: list[str], worth: float) -> None:
    """Draw the saving of least IAE by a further derivative over the noise limit, in a panel for each plant."""
    rows = -(-len(names) // 2)
    figure, axes = plt.subplots(
        rows, 2, figsize=(6.4, 0.5 + 1.9 * rows), sharex=True, sharey=True, squeeze=False
    )
    for ax, name in zip(axes.flat, names, strict=True):
        iae = table[table["plant"] == name].pivot_table(index="noise_limit", columns="order", values="iae")
        for order, kind in ((2, "PIDA"), (3, "m = 3")):
            ax.plot(iae.index, 100 - 100 * iae[order] / iae[order - 1], label=kind)
        ax.axhline(100 * worth, color="#808080", linestyle=":")
        ax.set(xscale="log", ylim=(-3, 38))
        ax.set_xticks([0.1, 0.3, 1, 3], ["0.1", "0.3", "1", "3"], minor=False)
        ax.set_xticks([], minor=True)
        ax.set_title(name)
    figure.supxlabel("allowed relative noise gain")
    figure.supylabel("IAE saved by one derivative more (%)")
    plots.legend(figure, ncols=2)


def heat(tables: dict[str, pd.DataFrame], rows: str) -> None:
    """Draw the saving of IAE by acceleration, in a panel for each family, with the noise limit to the right."""
    count = -(-len(tables) // 2)
    figure, axes = plt.subplots(count, 2, figsize=(6.4, 0.6 + 2.3 * count), squeeze=False)
    for ax, (title, table) in zip(axes.flat, tables.items(), strict=False):
        share = 100 * table.to_numpy()
        image = ax.imshow(share, cmap="Blues", vmin=0, vmax=45, aspect="auto", origin="lower")
        for (i, j), value in np.ndenumerate(share):
            if np.isfinite(value):
                ax.text(
                    j,
                    i,
                    f"{round(value)}",
                    ha="center",
                    va="center",
                    color="k" if value < 28 else "w",
                    gid="as-drawn",
                )
        ax.set_xticks(range(table.shape[1]), [f"{x:g}" for x in table.columns])
        ax.set_yticks(range(table.shape[0]), [f"{y:g}" for y in table.index])
        ax.set_title(title)
        ax.grid(visible=False)
    for ax in axes.flat[len(tables) :]:
        ax.set_visible(False)
    figure.supxlabel("allowed relative noise gain")
    figure.supylabel(rows)
    figure.colorbar(image, ax=axes, label="IAE saved (%)", shrink=0.7)


def chart(table: pd.DataFrame) -> None:
    """Draw the number of plants for each kind of controller over their roll-off, for quiet and loud noise."""
    edges = np.arange(0.0, 2.51, 0.25)
    figure, axes = plt.subplots(2, 1, figsize=(6.4, 4.6), sharex=True, sharey=True)
    for ax, (terms, limit) in zip(axes, tables.NOISE.items(), strict=True):
        rows = table[table["noise_limit"] == limit]
        below = np.zeros(edges.size - 1)
        for kind, hatch in HATCHES.items():
            if kind not in set(table["enough"]):
                continue
            values = rows.loc[rows["enough"] == kind, "rolloff"].clip(edges[0], edges[-1] - 1e-9)
            count, _ = np.histogram(values, edges)
            look = {"color": LOOKS[kind]["color"], "hatch": hatch, "edgecolor": "#ffffff", "linewidth": 0.5}
            ax.bar(edges[:-1], count, np.diff(edges), below, align="edge", label=kind, **look)
            below += count
        ax.set_title(f"{terms} noise: a relative noise gain of {limit:g}")
        ax.set_ylabel("plants")
        ax.grid(axis="x", visible=False)
    axes[1].set_xlabel("roll-off of the plant at its ultimate frequency (order)")
    plots.legend(figure, title="take")
