"""Sentences and tables of the page on the frontier, from the tables of its study."""

from __future__ import annotations

import numpy as np
import pandas as pd
from IPython.display import Markdown

import tables

SHOWN = (
    "lag-dominated",
    "lag-dominated, two lags",
    "balanced, one lag",
    "balanced, three lags",
    "integrating with a lag",
    "eight lags",
)
KINDS = ("PI", "PID", "PIDA", "m = 3")
LESS_ROBUST = 2.0  # the other limit of Ms for which the study has a frontier


def curves(ms: float = tables.MS) -> pd.DataFrame:
    """Return the rows of the frontier with the limit `ms` of Ms."""
    return tables.read("frontier").query("ms_limit == @ms")


def acceleration_map() -> pd.DataFrame:
    """Return the rows of the map with the same limit of Ms as the frontier."""
    return tables.read("acceleration_map").query("ms_limit == @tables.MS")


def by_order(table: pd.DataFrame) -> pd.DataFrame:
    """Return the least IAE of each plant and noise, with a column for each order."""
    return table.pivot_table(index=["plant", "noise_limit"], columns="order", values="iae")


def coverage() -> Markdown:
    """Say how many plants and designs the study has, and for which cases it found no controller."""
    table = curves()
    none = table[table["iae"].isna()]
    named = ", ".join(f"{row.plant}, {KINDS[row.order]} at {row.noise_limit:g}" for row in none.itertuples())
    lost = f" No controller keeps the limits for: {named}." if named else ""
    return Markdown(
        f"The study has {table['plant'].nunique()} plants and {len(table)} designs, with "
        f"{table['noise_limit'].nunique()} noise limits." + lost
    )


def steps() -> pd.DataFrame:
    """Return per plant the saving by each kind at the largest noise limit, and the least limit where it is a tenth."""
    wide = by_order(curves())
    rows = {}
    for plant, table in wide.groupby(level="plant", sort=False):
        row = {}
        for order in (1, 2, 3):
            saves = (1 - table[order] / table[order - 1]).droplevel("plant")
            enough = saves[saves >= tables.WORTH]
            row[f"{KINDS[order]} saves"] = f"{saves.iloc[-1]:.0%}"
            always = enough.size == saves.size
            first = "all noise" if always else f"noise {enough.index[0]:g}" if enough.size else "never"
            row[f"a tenth from {KINDS[order]}"] = first
        rows[plant] = row
    return pd.DataFrame(rows).T


def savings(ms: float = tables.MS) -> pd.DataFrame:
    """Return the saving by each further derivative, and the number of plants on which it reaches a tenth."""
    wide, rows = by_order(curves(ms)), {}
    for order in (1, 2, 3):
        saves = (1 - wide[order] / wide[order - 1]).dropna()
        most, (plant, noise) = saves.groupby(level="plant").max(), saves.idxmax()
        rows[KINDS[order]] = {
            "saves, median": f"{saves.median():.0%}",
            "at most": f"{saves.max():.0%}: {plant}, noise {noise:g}",
            "a tenth on": f"{(most >= tables.WORTH).sum()} of {most.size} plants",
        }
    return pd.DataFrame(rows).T


def bought() -> pd.DataFrame:
    """Return the median reduction of the least IAE by the larger limit of Ms, over plants and noise limits."""
    smaller = (1 - by_order(curves(LESS_ROBUST)) / by_order(curves())).median()
    return pd.DataFrame([smaller.map("{:.0%}".format).to_list()], ["IAE smaller by"], KINDS)


def mapped() -> dict[str, pd.DataFrame]:
    """Return the savings by acceleration in a table for each family, with dead times as rows and noise as columns."""
    wide = by_order(acceleration_map())
    saves = (1 - wide[2] / wide[1]).rename("saves").reset_index()
    parts = saves["plant"].str.extract(r"^(?P<family>.*?) ?delay=(?P<delay>[0-9.]+)$")
    saves = saves.join(parts).dropna(subset=["delay"])
    saves["delay"] = saves["delay"].astype(float)
    names = {"lags3": "three equal lags"}
    out = {}
    for family, rows in saves.groupby("family"):
        title = names.get(family, family.replace("sopdt damping=", "two poles, damping "))
        out[title] = rows.pivot_table(index="delay", columns="noise_limit", values="saves")
    return out


def law() -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Return a fit of the saving by acceleration, the plants farthest from it, and exceptions to the rules of thumb."""
    wide = by_order(pd.concat([curves(), acceleration_map()]))
    saves = (1 - wide[2] / wide[1]).dropna().rename("saves").reset_index()
    saves = saves.merge(tables.read("processes")[["plant", "rolloff", "dead_time"]], on="plant")
    order = saves["rolloff"]
    left = np.column_stack([np.ones(order.size), order, order * np.log(saves["noise_limit"])])
    start, a, b = np.linalg.lstsq(left, saves["saves"], rcond=None)[0]
    saves["off"] = saves["saves"] - left @ (start, a, b)
    fit = {
        "without roll-off": f"{start:.0%}",
        "for each order": f"{a:.0%}",
        "for each order and doubling of noise": f"{b * np.log(2):.1%}",
        "standard deviation": f"{100 * saves['off'].std():.0f} points",
        "pairs of designs": len(saves),
    }
    far = saves.sort_values("off", key=abs, ascending=False).drop_duplicates("plant").head(4)
    far = far.assign(off=(100 * far["off"]).map("{:+.0f} points".format))
    pays = saves.groupby("plant").agg(rolloff=("rolloff", "first"), most=("saves", "max"))
    little = (pays["rolloff"] < 1) & (pays["most"] >= tables.WORTH)
    steep = (pays["rolloff"] >= 2) & (pays["most"] < tables.WORTH)
    exceptions = pays[little | steep].sort_values("rolloff").round({"rolloff": 3, "most": 2})
    return (
        pd.DataFrame([fit], ["acceleration saves"]),
        far.set_index("plant")[["noise_limit", "off"]].rename(
            columns={"noise_limit": "relative noise gain", "off": "error of the fit"}
        ),
        exceptions.rename(columns={"rolloff": "roll-off", "most": "saves at most"}),
    )
