"""Tables and sentences of the page on all plants, with numbers and verdicts from the studies."""

from __future__ import annotations

from itertools import product

import numpy as np
import pandas as pd
from IPython.display import HTML, Markdown

import tables

ROLLOFF = (-np.inf, 1.0, 2.0, np.inf)  # limits of its classes: one lag has at most 1, two lags at most 2
FEW = 20  # number of plants on which a rule must work to be drawn


def percent(values: pd.Series) -> pd.Series:
    """Write shares in per cent."""
    return values.map("{:.0%}".format)


def acceleration() -> pd.DataFrame:
    """Describe when acceleration pays, and its saving of IAE, by the roll-off of the plant."""
    table = tables.pays().dropna(subset=["saves"])
    table["roll-off"] = pd.cut(
        table["rolloff"], ROLLOFF, right=False, labels=["below 1", "1 to 2", "2 or more"]
    )
    loud, quiet = (
        rows.groupby("roll-off", observed=True)["saves"]
        for rows in (table[table["terms"] == terms] for terms in ("loud", "quiet"))
    )
    verdict = np.select(
        [loud.quantile(0.1) >= tables.WORTH, loud.max() >= tables.WORTH],
        ["pays", "pays on some"],
        "does not pay",
    )
    found = {
        "acceleration": verdict,
        "plants": loud.size(),
        "saves, noise loud": percent(loud.median()),
        "least": percent(loud.min()),
        "most": percent(loud.max()),
        "saves, noise quiet": percent(quiet.median()),
    }
    return pd.DataFrame(found)


def law() -> Markdown:
    """Fit a straight line to the savings, and name the plants farthest from it."""
    table = tables.pays().query("terms == 'loud'").dropna(subset=["saves"])
    slope, start = np.polyfit(table["rolloff"], table["saves"], 1)
    off = table.assign(off=table["saves"] - start - slope * table["rolloff"])
    far = off.reindex(off["off"].abs().sort_values(ascending=False).index).head(4)
    named = ", ".join(f"{row.plant} ({100 * row.off:+.0f} points)" for row in far.itertuples())
    error = np.sqrt((off["off"] ** 2).mean())
    return Markdown(
        f"With loud noise, acceleration saves about **({100 * slope:.0f} × roll-off "
        f"{'−' if start < 0 else '+'} {abs(100 * start):.0f}) %** of the IAE. The root-mean-square error of this "
        f"formula over {len(off)} plants is {100 * error:.0f} points. The largest errors are: {named}."
    )


def kind(pid: float, pida: float) -> str:
    """Return the kind of controller to use, from the savings of PID over PI and of PIDA over PID."""
    return "PIDA" if pida >= tables.WORTH else "PID" if pid >= tables.WORTH else "PI"


def simplest() -> pd.DataFrame:
    """Return for each plant and both noise limits the kind to use: PIDA if it pays, else PID if it pays, else PI."""
    found = tables.optima().pivot_table(index=["plant", "noise_limit"], columns="order", values="iae")
    table = found[[0, 1, 2]].dropna()
    enough = [
        kind(pid, pida) for pid, pida in zip(1 - table[1] / table[0], 1 - table[2] / table[1], strict=True)
    ]
    out = table.assign(enough=enough)["enough"].reset_index()
    return out.merge(tables.plants()[["plant", "rolloff", "dead_time"]], on="plant")


def nearest() -> pd.DataFrame:
    """Return for each class of plants the rules nearest to the optimum of their kind, and to the optimum of all."""
    of_all = tables.nearest("loud", ["class"], "of_best")
    of_all["rule"] = [tables.with_kind(*pair) for pair in of_all[["rule", "kind"]].to_numpy()]
    of_all = of_all.assign(kind="all").set_index("kind", append=True)
    both = pd.concat([tables.nearest("loud", ["class", "kind"], "of_kind"), of_all])
    rows = pd.MultiIndex.from_product([tables.CLASSES, (*tables.KINDS, "all")], names=["class", "best of"])
    both = both[["rule", "median"]].reindex(rows)
    return pd.DataFrame(
        {
            "nearest rule": both["rule"].map(tables.written, na_action="ignore").fillna("none serves"),
            "IAE over the best": both["median"].map("{:.2f}".format).replace("nan", "–"),
        }
    )


def saved() -> pd.DataFrame:
    """Return for each class of plants the median savings of PIDA over PID and of PID over PI."""
    groups = tables.pays().groupby(["class", "terms"], observed=True)
    medians = groups[["pid", "saves"]].median().apply(percent).unstack()
    found = {
        f"{name} saves, noise {noise}": medians[step, noise]
        for (step, name), noise in product((("saves", "PIDA"), ("pid", "PID")), reversed(tables.NOISE))
    }
    return pd.DataFrame(found | {"plants": tables.plants().groupby("class", observed=True).size()})


def answer() -> HTML:
    """Return for each class of plants the kind to use with loud noise, and the rule nearest to the best of all."""
    medians = (
        tables.pays().query("terms == 'loud'").groupby("class", observed=True)[["pid", "saves"]].median()
    )
    rules = tables.nearest("loud", ["class"], "of_best").reindex(medians.index)
    table = pd.DataFrame(
        {
            "take": [kind(row.pid, row.saves) for row in medians.itertuples()],
            "nearest rule": [tables.with_kind(row.rule, row.kind) for row in rules.itertuples()],
            "its IAE over the optimum": rules["median"].map("{:.2f}".format),
        },
        index=medians.index.astype(str).rename(None),
    ).rename_axis(columns="class")
    return HTML(f'<div class="answer-table">{table.to_html(border=0)}</div>')


def model_error() -> pd.DataFrame:
    """Return Ms and IAE of the optima with model errors of 20 %, and count the rules with a smaller Ms."""
    best = tables.optima().query("terms == 'loud'").dropna(subset=["iae"])
    medians = {name: rows["ms_worst"].median() for name, rows in by_worst().items()}
    rows = {}
    for kind in tables.KINDS:
        table = best[best["kind"] == kind]
        known = table[np.isfinite(table["ms_worst"])]["ms_worst"]
        rules = [
            value < medians[f"optimal {kind}"]
            for name, value in medians.items()
            if tables.is_of(name, kind) and not name.startswith("optimal")
        ]
        rows[kind] = {
            "Ms, median": f"{known.median():.2f}",
            "Ms, worst tenth": f"{known.quantile(0.9):.2f}",
            "IAE grows, median": f"{(table['iae_worst'] / table['iae']).median() - 1:.0%}",
            "unstable": f"{np.isinf(table['ms_worst']).sum()} of {len(table)}",
            "rules with a smaller Ms": f"{sum(rules)} of {len(rules)}",
        }
    return pd.DataFrame(rows).T


def by_distance(terms: str) -> dict[str, pd.DataFrame]:
    """Return rules at equal terms and the optima of each kind, sorted by median IAE divided by the least IAE."""
    rules = tables.compared(terms).dropna(subset=["of_best"])
    rules = rules[rules.groupby(["rule", "kind"])["plant"].transform("size") >= FEW]
    least = tables.frontier().xs(terms, level="terms")
    best = least.div(least.min(axis=1), axis=0).stack().rename("of_best").reset_index()
    both = pd.concat([rules, best.assign(rule="optimal")])
    return ordered(both, "of_best")


def by_worst() -> dict[str, pd.DataFrame]:
    """Return rules and optima for loud noise, sorted by the median of the largest Ms over changed plants."""
    rules = tables.compared("loud").dropna(subset=["ms_worst"])
    rules = rules[rules.groupby(["rule", "kind"])["plant"].transform("size") >= FEW]
    best = tables.optima().query("terms == 'loud'").dropna(subset=["ms_worst"])
    return ordered(pd.concat([rules, best.assign(rule="optimal")]), "ms_worst")


def ordered(table: pd.DataFrame, value: str) -> dict[str, pd.DataFrame]:
    """Return groups of rows by rule and kind, the smallest median first."""
    groups = {tables.name(rows.iloc[0]): rows for _, rows in table.groupby(["rule", "kind"])}
    return dict(sorted(groups.items(), key=lambda pair: pair[1][value].median()))


def coverage() -> Markdown:
    """Say for how many of the 134 plants the studies have rules and optima, and how many designs failed."""
    everything = len(tables.plants())
    rules, best = tables.read("comparison")["plant"].nunique(), tables.optima()["plant"].nunique()
    rows = tables.read("comparison")
    own = rows[rows["terms"] == "own"]
    refused = int(own["ms"].isna().sum())
    return Markdown(
        f"The rules ran on {rules} of {everything} plants, with {own.groupby(['rule', 'kind']).ngroups} combinations "
        f"of rule and kind. Of {len(own)} designs, {refused} were refused by the rule or gave no stable loop. "
        f"The best controllers are known for {best} of {everything} plants."
    )
