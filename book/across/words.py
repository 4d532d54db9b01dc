"""Sentences of the pages across the papers, with their numbers and their verbs from the tables."""

from __future__ import annotations

import numpy as np
import pandas as pd
from IPython.display import Markdown

import tables

STEEP, FLAT = 2.0, 1.0  # roll-off: as of two lags and more, as of one lag and less
FEW = 20  # plants that a rule must serve to have a line in a figure
GOOD = 0.9  # share of the plants on which a rule of our own must be within a tenth of the frontier
WORTH = 0.1  # share of the IAE that acceleration must save to be worth its parameter


def share(x: float) -> str:
    """A share in per cent."""
    return f"{x:.0%}"


def bins(table: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Plants by their roll-off."""
    order = table["rolloff"]
    return {
        f"of {STEEP:g} or more": table[order >= STEEP],
        f"between {FLAT:g} and {STEEP:g}": table[(order >= FLAT) & (order < STEEP)],
        f"below {FLAT:g}": table[order < FLAT],
    }


def acceleration() -> Markdown:
    """When acceleration pays, by the roll-off of the plant."""
    table = tables.pays().dropna(subset=["saves"])
    lines = []
    for where, rows in bins(table).items():
        loud, quiet = (rows[rows["terms"] == term]["saves"] for term in ("loud", "quiet"))
        verdict = (
            "pays"
            if loud.quantile(0.1) >= WORTH
            else "pays on some"
            if (loud >= WORTH).any()
            else "does not pay"
        )
        lines.append(
            f"* Roll-off {where} ({loud.size} plants): acceleration **{verdict}**. It saves {share(loud.median())} of "
            f"the IAE in the median where noise may be loud (from {share(loud.min())} to {share(loud.max())}), and "
            f"{share(quiet.median())} where it must be quiet."
        )
    return Markdown("\n".join(lines))


def law() -> Markdown:
    """A straight line through the savings, and the plants farthest from it."""
    table = tables.pays().query("terms == 'loud'").dropna(subset=["saves"])
    slope, start = np.polyfit(table["rolloff"], table["saves"], 1)
    off = table.assign(off=table["saves"] - start - slope * table["rolloff"])
    far = off.reindex(off["off"].abs().sort_values(ascending=False).index).head(4)
    named = ", ".join(f"{row.plant} ({100 * row.off:+.0f} points)" for row in far.itertuples())
    error = np.sqrt((off["off"] ** 2).mean())
    return Markdown(
        f"Where noise may be loud, acceleration saves about **{100 * slope:.0f} % of the IAE for each order of "
        f"roll-off**, {'less' if start < 0 else 'and'} {abs(100 * start):.0f} points. This line is off by "
        f"{100 * error:.0f} points in the root mean square over {len(off)} plants. Farthest from it: {named}."
    )


def simplest() -> pd.DataFrame:
    """For every plant and limit of noise the simplest kind within 20 % of the best of all."""
    wide = [
        table.pivot_table(index=["plant", "noise_limit"], columns="order", values="iae")
        for table in (tables.optima(), tables.read("frontier").query("ms_limit == @tables.MS"))
    ]
    table = pd.concat(wide)[[0, 1, 2]].dropna()
    near = table.le(tables.NEAR * table.min(axis=1), axis=0)
    enough = near.idxmax(axis=1).map(dict(enumerate(tables.KINDS)))
    out = enough.rename("enough").reset_index()
    return out.merge(tables.read("processes")[["plant", "rolloff", "dead_time"]], on="plant")


def answer() -> Markdown:
    """The answer on one page: for each class of plants the rules nearest to the frontier, and what each step buys."""
    best, of_all = tables.best_rules("loud"), tables.best_of_all("loud")
    saved = tables.pays().groupby(["class", "terms"], observed=True)[["pid", "saves"]].median()
    counts = tables.plants().groupby("class", observed=True).size()
    lines = []
    for plants in tables.CLASSES:
        rules = "; ".join(_nearest(best, (plants, kind), kind) for kind in tables.KINDS)
        quiet, loud = saved.loc[(plants, "quiet")], saved.loc[(plants, "loud")]
        lines.append(
            f"* **{plants.capitalize()}** ({counts[plants]} plants). Nearest to the best of their kind: {rules}. "
            f"Nearest to the best of all: {tables.with_kind(*of_all.loc[plants][['rule', 'kind']])} "
            f"({of_all.loc[plants]['median']:.2f}). PID saves {share(quiet['pid'])} of the IAE of the best PI where "
            f"noise must be quiet and {share(loud['pid'])} where it may be loud, PIDA another "
            f"{share(quiet['saves'])} and {share(loud['saves'])} of what is left."
        )
    return Markdown("\n".join(lines))


def _nearest(best: pd.DataFrame, key: tuple[str, str], kind: str) -> str:
    """One rule with its distance."""
    if key not in best.index:
        return f"{kind}, none serves"
    return f"{kind}, {tables.written(best.loc[key]['rule'])} ({best.loc[key]['median']:.2f})"


def wrong(kind: str, table: pd.DataFrame) -> str:
    """Worst Ms and growth of the IAE over the eight plants that are off."""
    lost = table["iae_worst"] / table["iae"]
    unstable = int(np.isinf(table["ms_worst"]).sum())
    known = table[np.isfinite(table["ms_worst"])]
    return (
        f"* {kind}: Ms grows from {tables.MS:g} to {known['ms_worst'].median():.2f} in the median and "
        f"{known['ms_worst'].quantile(0.9):.2f} in the worst tenth; the IAE is {lost.median() - 1:.0%} larger in the "
        f"median. Unstable: {unstable} of {len(table)} designs."
    )


def model_error(terms: str = "loud") -> Markdown:
    """What is lost when gain, time and dead time are each off by a fifth, for the optima and beside the rules."""
    best = tables.optima().query("terms == @terms").dropna(subset=["iae"])
    lines = [wrong(kind, best[best["kind"] == kind]) for kind in tables.KINDS]
    return Markdown("\n".join(lines))


def beside_rules() -> Markdown:
    """Whether the optima are more, or less, at the mercy of the model than the rules at the same nominal Ms."""
    medians = {name: rows["ms_worst"].median() for name, rows in by_worst().items()}
    parts = []
    for kind in tables.KINDS:
        own = medians[f"optimal {kind}"]
        rules = [
            value
            for name, value in medians.items()
            if tables.is_of(name, kind) and not name.startswith("optimal")
        ]
        below = sum(value < own for value in rules)
        parts.append(f"{kind} {own:.2f} (smaller for {below} of {len(rules)} rules)")
    return Markdown(
        "Median of the largest Ms for the optima, and how many rules stay below: " + ", ".join(parts) + "."
    )


def by_distance(terms: str) -> dict[str, pd.DataFrame]:
    """Rules at equal terms by the median of their distance to the frontier, and the optima of each kind."""
    rules = tables.compared(terms).dropna(subset=["of_best"])
    rules = rules[rules.groupby(["rule", "kind"])["plant"].transform("size") >= FEW]
    least = tables.frontier().xs(terms, level="terms")
    best = least.div(least.min(axis=1), axis=0).stack().rename("of_best").reset_index()
    both = pd.concat([rules, best.assign(rule="optimal")])
    return ordered(both, "of_best")


def by_worst() -> dict[str, pd.DataFrame]:
    """Rules and optima at loud equal terms by the median of the largest Ms over the plants that are off."""
    rules = tables.compared("loud").dropna(subset=["ms_worst"])
    rules = rules[rules.groupby(["rule", "kind"])["plant"].transform("size") >= FEW]
    best = tables.optima().query("terms == 'loud'").dropna(subset=["ms_worst"])
    return ordered(pd.concat([rules, best.assign(rule="optimal")]), "ms_worst")


def ordered(table: pd.DataFrame, value: str) -> dict[str, pd.DataFrame]:
    """Groups of rows by rule and kind, the smallest median first."""
    groups = {tables.name(rows.iloc[0]): rows for _, rows in table.groupby(["rule", "kind"])}
    return dict(sorted(groups.items(), key=lambda pair: pair[1][value].median()))


def own_rule() -> Markdown:
    """Whether a simple rule came within a tenth of the frontier, on plants that it was not fitted to."""
    lines = []
    judged = tables.read("own_rule").query("half == 'judged'")
    for kind, rows in judged.groupby("kind"):
        near = rows["over_best_at_equal_terms"]
        inside = (near <= 1 + WORTH).mean()
        rivals = tables.compared("loud").query("kind == @kind").dropna(subset=["of_kind"])
        medians = rivals.groupby("rule")["of_kind"].median().sort_values()
        verdict = (
            "good enough for a rule" if inside >= GOOD else "**not** good enough for a rule of the library"
        )
        kept = rows["ms"].between(1.3, 1.5).mean()
        lines.append(
            f"* {kind}: at equal terms within a tenth of the frontier on {share(inside)} of {len(rows)} judged "
            f"designs (median {near.median():.2f}, nine of ten below {near.quantile(0.9):.2f}); as it comes, Ms is "
            f"within 0.1 of {tables.MS:g} on {share(kept)}. The best published rule of this kind has the median "
            f"{medians.iloc[0]:.2f} ({medians.index[0]}). With nine of ten as the bar that is {verdict}."
        )
    return Markdown("\n".join(lines))


def coverage() -> Markdown:
    """How much of the studies is there: all of the 134 plants, or as many as have run."""
    everything = len(tables.plants())
    rules, best = tables.read("comparison")["plant"].nunique(), tables.optima()["plant"].nunique()
    rows = tables.read("comparison")
    own = rows[rows["terms"] == "own"]
    refused = int(own["ms"].isna().sum())
    return Markdown(
        f"Rules: {rules} of {everything} plants, {own.groupby(['rule', 'kind']).ngroups} rules and kinds, {len(own)} "
        f"pairs, of which {refused} gave no stable loop or were refused by the rule. "
        f"Optima: {best} of {everything} plants."
    )
