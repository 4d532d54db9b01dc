"""Tables and figures of the page on speed, with all numbers from the files of `make bench`."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd
from IPython.display import Markdown

from pidalab import plots

DATA = Path(__file__).parents[1] / "data"
FILES = ("speed_comparison", "engine_comparison", "portrait_comparison")
OWN, PADE = "pidalab", "python-control, Padé 10"
STYLES = {  # mark, line and colour of each method
    OWN: ("*", "-", "#1f5fa8"),
    "python-control, Padé 3": ("v", ":", "#c8591a"),
    PADE: ("s", "--", "#c8591a"),
    "Runge–Kutta 4, numba": ("^", "-.", "#2a8f5b"),
    "JiTCDDE": ("D", ":", "#8a4fa3"),
}


def read(name: str) -> pd.DataFrame:
    """Return a table of the benchmark."""
    return pd.read_csv(DATA / f"{name}.csv", comment="#")


def rows(quantity: str) -> pd.DataFrame:
    """Return the rows of one quantity that have a time."""
    table = read(FILES[0])
    return table[table["quantity"].eq(quantity) & table["seconds"].notna()]


def machine() -> Markdown:
    """Return machine and packages from the first line of each table. Join lines that differ only in the load."""
    heads = (
        (DATA / f"{name}.csv").read_text(encoding="utf-8").partition("\n")[0]
        for name in FILES
    )
    told: dict[str, list[float]] = {}
    for head in heads:
        made, _, load = head.removeprefix("# ").partition(", load average ")
        told.setdefault(made, []).extend([float(load)] if load else [])
    busy = {
        made: f", load average {span(pd.Series(loads))}" if loads else ""
        for made, loads in told.items()
    }
    return Markdown("\n\n".join(f"{made}{load}." for made, load in busy.items()))


def number(x: float) -> str:
    """Write a ratio or a time with two digits."""
    return f"{x:.2g}" if x < 100 else f"{x:,.0f}"


def span(values: pd.Series) -> str:
    """Write the least and the largest of some values."""
    low, high = number(values.min()), number(values.max())
    return low if low == high else f"{low} to {high}"


def size(error: float) -> str:
    """Write an error as a power of ten, or say that no digit is right."""
    return f"{error:.0e}" if error < 1 else "no digit"


def nearer() -> pd.DataFrame:
    """Count responses by other methods that are more exact than pidalab's, and those that are faster."""
    table = rows("response")
    both = table.merge(
        table[table["method"] == OWN], on=["loop", "value"], suffixes=("", "_own")
    )
    others = both[both["method"] != OWN]
    found = {
        "responses": 1,
        "nearer to the reference": others["error"] < others["error_own"],
        "less time": others["seconds"] < others["seconds_own"],
    }
    return (
        others.assign(**found)
        .groupby("method", sort=False)[list(found)]
        .sum()
        .rename_axis(None)
    )


def responses() -> pd.DataFrame:
    """Return times as ratios and largest errors over the loops, by method and number of points."""
    table = rows("response")
    cells: dict[str, dict[str, str]] = {}
    for (method, points), some in table.groupby(["method", "value"], sort=False):
        time = (
            f"{span(1e3 * some['seconds'])} ms"
            if method == OWN
            else f"{span(some['ratio'])} ×"
        )
        cells.setdefault(f"{int(points):,} points", {})[method] = (
            f"{time}, {size(some['error'].max())}"
        )
    return pd.DataFrame(cells)


def faster() -> pd.DataFrame:
    """Describe the cases in which another method is faster than pidalab: number, time and error."""
    table = read(FILES[0])
    table = table[
        table["quantity"].isin(
            ["response", "margins", "horizon", "dead time", "order", "optimum"]
        )
    ]
    quick = table[table["ratio"].lt(1) & table["method"].ne(OWN)]
    found = {
        (method, quantity): {
            "cases": f"{len(some)} of {len(table.query('method == @method and quantity == @quantity'))}",
            "times as long": span(some["ratio"]),
            "largest error": size(some["error"].max()),
            "least error": size(some["error"].min()),
        }
        for (method, quantity), some in quick.groupby(
            ["method", "quantity"], sort=False
        )
    }
    return pd.DataFrame(found).T


def cost(quantity: str, xlabel: str, log: bool = True) -> None:
    """Draw time and error of every method over the varied quantity."""
    table = rows(quantity)
    figure, axes = plt.subplots(1, 2, figsize=(6.4, 3.6))
    for method, (mark, line, colour) in STYLES.items():
        some = table[table["method"] == method]
        style = {
            "marker": mark,
            "linestyle": line,
            "color": colour,
            "markersize": 5,
            "label": method,
        }
        axes[0].plot(some["value"], 1e3 * some["seconds"], **style)
        axes[1].plot(some["value"], some["error"], **style)
    for ax, ylabel in zip(axes, ("time, ms", "largest error"), strict=True):
        ax.set(
            xscale="log" if log else "linear",
            yscale="log",
            xlabel=xlabel,
            ylabel=ylabel,
        )
    plots.legend(figure, ncols=2)


def margins() -> pd.DataFrame:
    """Return margins by method, with time as a ratio and the largest error over the loops."""
    cells = {}
    for method, some in rows("margins").groupby("method", sort=False):
        cells[method] = {
            "loops": str(len(some)),
            "time, ms": span(1e3 * some["seconds"]),
            "times as long": span(some["ratio"]),
            "largest error": size(some["error"].max()),
        }
    return pd.DataFrame(cells).T


def optimum() -> pd.DataFrame:
    """Compare the solver with differential evolution, by plant and order."""
    table = rows("optimum")
    own, peer = (
        table[table["method"].eq(OWN) == one].reset_index(drop=True)
        for one in (True, False)
    )
    kinds = {0: "PI", 1: "PID", 2: "PIDA"}
    return pd.DataFrame(
        {
            "plant": own["loop"],
            "controller": own["value"].astype(int).map(kinds),
            "pidalab, s": own["seconds"].map(number),
            "evolution, s": peer["seconds"].map(number),
            "times as long": peer["ratio"].map(number),
            "IAE above pidalab's": peer["error"]
            .map("{:.1%}".format)
            .str.replace("%", " %"),
            "ended by": peer["note"]
            .fillna("equal IAE")
            .replace("time is up", "its time"),
        }
    ).set_index(["plant", "controller"])


def engines() -> pd.DataFrame:
    """Return error and time ratio of each method on four loops of huba2018, at its most exact setting for each loop."""
    table = read(FILES[1])
    best = table.loc[
        table.groupby(["m", "n", "te", "method"], sort=False)["error"].idxmin()
    ]
    cells = {}
    for method, some in best.groupby("method", sort=False):
        cells[method] = {
            "least error, best loop": size(some["error"].min()),
            "least error, worst loop": size(some["error"].max()),
            "times as long": span(some["ratio"]),
        }
    return pd.DataFrame(cells).T


def portraits() -> pd.DataFrame:
    """Compare a portrait of many limited loops with two other methods."""
    table = read(FILES[2])
    return pd.DataFrame(
        {
            "loops run": table["sets"].map("{:,}".format),
            "seconds for all": table["seconds_for_all"].map(number),
            "times as long": table["ratio"].map(number),
            "IAE differs by": table["iae_difference"].map(
                lambda error: f"{error:.0e}" if error else "0"
            ),
        }
    ).set_index(table["method"].rename(None))


def ten_million() -> Markdown:
    """Estimate the time of a portrait of ten million loops from the measured times."""
    table = read(FILES[2]).set_index("method")
    each = table["cpu_seconds"]["portrait"] / table["sets"]["portrait"]
    one, two = (
        table["seconds"][f"portrait, {n}"] for n in ("one worker", "two workers")
    )
    return Markdown(
        f"Two workers take {two / one:.2f} of the time of one. A portrait of ten million such loops would need about "
        f"{1e7 * each / 3600:.1f} hours of processor time, shared by all processors."
    )
