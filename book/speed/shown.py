"""Tables, figures and sentences of the page on speed: all numbers come from the files that `make bench` writes."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd
from IPython.display import Markdown

DATA = Path(__file__).parents[1] / "data"
FILES = ("speed_comparison", "engine_comparison", "portrait_comparison", "lab_comparison")
OWN, PADE = "pidalab", "python-control, Padé 10"
STYLES = {  # mark, line and colour of each method
    OWN: ("*", "-", "#1f5fa8"),
    "python-control, Padé 3": ("v", ":", "#c8591a"),
    PADE: ("s", "--", "#c8591a"),
    "Runge–Kutta 4, numba": ("^", "-.", "#2a8f5b"),
    "JiTCDDE": ("D", ":", "#8a4fa3"),
    "lab's engine": ("o", "--", "#7a6a1c"),
}


def read(name: str) -> pd.DataFrame:
    """A table of the benchmark."""
    return pd.read_csv(DATA / f"{name}.csv", comment="#")


def rows(quantity: str) -> pd.DataFrame:
    """Rows of one quantity that have a time."""
    table = read(FILES[0])
    return table[table["quantity"].eq(quantity) & table["seconds"].notna()]


def machine() -> Markdown:
    """What the tables were made with, from the line above each of them; said once where only the load differs."""
    heads = ((DATA / f"{name}.csv").read_text(encoding="utf-8").partition("\n")[0] for name in FILES)
    told: dict[str, list[float]] = {}
    for head in heads:
        made, _, load = head.removeprefix("# ").partition(", load average ")
        told.setdefault(made, []).extend([float(load)] if load else [])
    busy = {made: f", load average {span(pd.Series(loads))}" if loads else "" for made, loads in told.items()}
    return Markdown("\n\n".join(f"{made}{load}." for made, load in busy.items()))


def number(x: float) -> str:
    """A ratio or a time with two digits."""
    return f"{x:.2g}" if x < 100 else f"{x:,.0f}"


def span(values: pd.Series) -> str:
    """The least and the largest of some values."""
    low, high = number(values.min()), number(values.max())
    return low if low == high else f"{low} to {high}"


def size(error: float) -> str:
    """An error as a power of ten, or that no digit is right."""
    return f"{error:.0e}" if error < 1 else "no digit"


def headline() -> Markdown:
    """Responses beside the Padé approximation, and who was nearer to the truth, in sentences."""
    table, lines = rows("response"), []
    for points, some in table.groupby("value"):
        own, peer = (some[some["method"] == name] for name in (OWN, PADE))
        lines.append(
            f"* {int(points):,} points over twenty dead times: python-control with a Padé approximation of order 10 "
            f"takes **{span(peer['ratio'])}** times as long as pidalab, with errors of {size(peer['error'].min())} to "
            f"{size(peer['error'].max())} where pidalab's are at most {size(own['error'].max())}."
        )
    beaten = table.merge(table[table["method"] == OWN], on=["loop", "value"], suffixes=("", "_own"))
    nearer = beaten[(beaten["method"] != OWN) & (beaten["error"] < beaten["error_own"])]
    quick = beaten[beaten["seconds"] < beaten["seconds_own"]]
    others = ", ".join(quick["method"].unique()) or "nobody"
    lines.append(
        f"* Of {len(table[table['method'] != OWN])} responses by other methods {len(nearer) or 'none'} came nearer "
        f"to the reference than pidalab's, and {len(quick) or 'none'} took less time ({others})."
    )
    return Markdown("\n".join(lines))


def responses() -> pd.DataFrame:
    """Times as ratios and largest errors over the loops, by method and number of points."""
    table = rows("response")
    cells: dict[str, dict[str, str]] = {}
    for (method, points), some in table.groupby(["method", "value"], sort=False):
        time = f"{span(1e3 * some['seconds'])} ms" if method == OWN else f"{span(some['ratio'])} ×"
        cells.setdefault(f"{int(points):,} points", {})[method] = f"{time}, {size(some['error'].max())}"
    return pd.DataFrame(cells)


def fixed() -> Markdown:
    """What a response costs whatever its number of points, from the least and the largest number."""
    means = rows("response").groupby(["method", "value"])["seconds"].mean().unstack()
    few, many = means.columns.min(), means.columns.max()

    def grows(method: str) -> str:
        return number(means.loc[method, many] / means.loc[method, few])

    stays = number(1e3 * means.loc[OWN, few])
    return Markdown(
        f"From {int(few):,} to {int(many):,} points the time grows by a factor of {grows(OWN)} for pidalab and of "
        f"{grows(PADE)} for the Padé approximation. Few points still cost {stays} ms, most of it for the loop itself: "
        "its realisation, its states at the multiples of the dead time, the checks of what was asked. That is why the "
        "ratio is smallest there."
    )


def faster() -> pd.DataFrame:
    """Where another method took less time than pidalab: how often, how long, how exact."""
    table = read(FILES[0])
    table = table[table["quantity"].isin(["response", "margins", "horizon", "dead time", "order", "optimum"])]
    quick = table[table["ratio"].lt(1) & table["method"].ne(OWN)]
    found = {
        (method, quantity): {
            "cases": f"{len(some)} of {len(table.query('method == @method and quantity == @quantity'))}",
            "times as long": span(some["ratio"]),
            "largest error": size(some["error"].max()),
            "least error": size(some["error"].min()),
        }
        for (method, quantity), some in quick.groupby(["method", "quantity"], sort=False)
    }
    return pd.DataFrame(found).T


def cost(quantity: str, xlabel: str, log: bool = True) -> None:
    """Time and error of every method over what the quantity varies."""
    table = rows(quantity)
    figure, axes = plt.subplots(1, 2, figsize=(6.4, 3.6))
    for method, (mark, line, colour) in STYLES.items():
        some = table[table["method"] == method]
        style = {"marker": mark, "linestyle": line, "color": colour, "markersize": 5, "label": method}
        axes[0].plot(some["value"], 1e3 * some["seconds"], **style)
        axes[1].plot(some["value"], some["error"], **style)
    for ax, ylabel in zip(axes, ("time, ms", "largest error"), strict=True):
        ax.set(xscale="log" if log else "linear", yscale="log", xlabel=xlabel, ylabel=ylabel)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=2)


def margins() -> pd.DataFrame:
    """Margins by method: time as a ratio and the largest error over the loops."""
    cells = {}
    for method, some in rows("margins").groupby("method", sort=False):
        cells[method] = {
            "loops": str(len(some)),
            "time, ms": span(1e3 * some["seconds"]),
            "times as long": span(some["ratio"]),
            "largest error": size(some["error"].max()),
        }
    return pd.DataFrame(cells).T


def together() -> pd.DataFrame:
    """Many loops in one call and one by one, by the clock."""
    both = pd.concat([rows(f"many {name}") for name in ("responses", "margins")])
    both = both.assign(
        what=both["quantity"].str.removeprefix("many ")
        + " of "
        + both["value"].astype(int).map("{:,}".format)
        + " loops"
    )
    both["shown"] = both["seconds"].map(number) + " s, " + both["note"]
    return both.pivot(index="what", columns="method", values="shown")[["one call", "one by one"]]


def optimum() -> pd.DataFrame:
    """The solver beside differential evolution, by plant and order."""
    table = rows("optimum")
    own, peer = (table[table["method"].eq(OWN) == one].reset_index(drop=True) for one in (True, False))
    kinds = {0: "PI", 1: "PID", 2: "PIDA"}
    return pd.DataFrame(
        {
            "plant": own["loop"],
            "controller": own["value"].astype(int).map(kinds),
            "pidalab, s": own["seconds"].map(number),
            "evolution, s": peer["seconds"].map(number),
            "times as long": peer["ratio"].map(number),
            "IAE above pidalab's": peer["error"].map("{:.1%}".format).str.replace("%", " %"),
            "ended by": peer["note"].fillna("equal IAE").replace("time is up", "its time"),
        }
    ).set_index(["plant", "controller"])


def engines() -> pd.DataFrame:
    """Each method at its most exact setting on four loops of huba2018: error, and time as a ratio."""
    table = read(FILES[1])
    best = table.loc[table.groupby(["m", "n", "te", "method"], sort=False)["error"].idxmin()]
    cells = {}
    for method, some in best.groupby("method", sort=False):
        cells[method] = {
            "least error, best loop": size(some["error"].min()),
            "least error, worst loop": size(some["error"].max()),
            "times as long": span(some["ratio"]),
        }
    return pd.DataFrame(cells).T


def portraits() -> pd.DataFrame:
    """A portrait of many limited loops beside two other ways."""
    table = read(FILES[2])
    return pd.DataFrame(
        {
            "loops run": table["sets"].map("{:,}".format),
            "seconds for all": table["seconds_for_all"].map(number),
            "times as long": table["ratio"].map(number),
            "IAE differs by": table["iae_difference"].map(lambda error: f"{error:.0e}" if error else "0"),
        }
    ).set_index(table["method"].rename(None))


BUDGET = 0.05  # seconds: what follows a hand sooner than that seems to follow at once


def _of_lab() -> tuple[pd.DataFrame, int]:
    """Seconds of the changes in the lab by designs and by how far the page was slowed down, and the farthest."""
    table = read(FILES[3])
    wide = table.pivot(index="change", columns=["slowed", "designs"], values="seconds")
    return wide.loc[table["change"].unique()], int(table["slowed"].max())


def _designs(count: int) -> str:
    return f"{count} designs" if count > 1 else f"{count} design"


def lab() -> pd.DataFrame:
    """What each kind of change costs, with one design and with several."""
    wide, _ = _of_lab()
    columns = [f"{_designs(n)}{f', slowed {k} times' if k > 1 else ''}, ms" for k, n in wide.columns]
    return (1e3 * wide).map(number).set_axis(columns, axis=1)


def within_reach() -> Markdown:
    """How many changes stay within the budget, and the longest, in sentences."""
    wide, slowed = _of_lab()
    lines = []
    for rate in (1, slowed):
        some = wide[rate].stack()
        where, designs = some.idxmax()
        lines.append(
            f"* {f'Slowed {rate} times' if rate > 1 else 'As the machine is'}, {int((some < BUDGET).sum())} of "
            f"{len(some)} changes take less than {1e3 * BUDGET:.0f} ms; the longest, {where} with "
            f"{_designs(designs)}, takes {1e3 * some.max():.0f} ms."
        )
    browser = read(FILES[3])["browser"].iloc[0]
    return Markdown("\n".join([*lines, f"* The browser is Chromium {browser}."]))
