"""Join and summarise the tables of the studies for the pages across the papers.

All numbers are in units of a plant's ultimate gain and period (see ``studies/own_units.py`` and the README of the
tables).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pidalab.comparison import benchmarking

DATA = Path(__file__).parents[1] / "data"
KINDS = ("PI", "PID", "PIDA")
MS = 1.4  # maximum sensitivity at equal terms
NOISE = {"quiet": 0.3, "loud": 1.5}  # limit of the relative noise gain for each of the equal terms
WORTH = 0.1  # the next kind pays if it saves at least this share of the IAE, at equal Ms and noise
NEAR = 1.2  # a rule with at most this multiple of the least IAE is as good as the best for most purposes
SERVES = 0.75  # share of a class of plants on which a rule must work to be recommended
CLASSES = (
    "integrating",
    "lag-dominated",
    "balanced",
    "delay-dominated",
)  # the last three are thirds of the normalised dead time


def read(name: str) -> pd.DataFrame:
    """Return a table of a study."""
    if (benchmarking.TABLES / f"{name}.csv").exists():
        return benchmarking.stored(name)
    return pd.read_csv(DATA / f"{name}.csv", keep_default_na=True)


def plants() -> pd.DataFrame:
    """Return the 134 plants with their class."""
    table = read("processes").query("family not in ('frontier', 'map')")
    dead = table["dead_time"]
    names = np.select([dead == 0, dead < 1 / 3, dead < 2 / 3], CLASSES[:3], CLASSES[3])
    return table.assign(**{"class": pd.Categorical(names, CLASSES)})


def optima(ms: float = MS) -> pd.DataFrame:
    """Return the best controllers at one Ms, with columns for the names of kind and terms."""
    table = read("optima").query("ms_limit == @ms")
    terms = {noise: name for name, noise in NOISE.items()}
    kinds = dict(enumerate(KINDS))
    return table.assign(kind=table["order"].map(kinds), terms=table["noise_limit"].map(terms))


def frontier() -> pd.DataFrame:
    """Return the least IAE, with a row for each plant and terms (quiet or loud), and a column for each kind."""
    found = optima().pivot_table(index=["plant", "terms"], columns="kind", values="iae")
    return found[[kind for kind in KINDS if kind in found]]


def compared(terms: str) -> pd.DataFrame:
    """Return every rule at equal terms, with its IAE divided by the least IAE of its kind and of all kinds."""
    rules = read("comparison").query("terms == @terms")
    least = frontier().xs(terms, level="terms")
    of_kind = least.stack().rename("least_of_kind").reset_index()
    out = rules.merge(of_kind, on=["plant", "kind"], how="left")
    out = out.merge(least.min(axis=1).rename("least").reset_index(), on="plant", how="left")
    out = out.merge(plants()[["plant", "family", "class", "rolloff"]], on="plant")
    return out.assign(of_kind=out["iae_load"] / out["least_of_kind"], of_best=out["iae_load"] / out["least"])


SPELLED = {  # readable names of rules: the library's names are abbreviations, or end with load or setpoint
    "amigo": "AMIGO",
    "direct load": "direct search (load)",
    "direct setpoint": "direct search (set point)",
    "haalman": "Haalman",
    "imc": "IMC",
    "itae load": "ITAE (load)",
    "itae setpoint": "ITAE (set point)",
    "mrdp": "multiple pole",
    "simc": "SIMC",
}


def name(row: Any) -> str:
    """Return the name of a rule with its kind."""
    return with_kind(row.rule.replace("Ziegler-Nichols", "ZN").replace("automatic reset", "reset"), row.kind)


def written(rule: str) -> str:
    """Return the name of a rule for a reader, with its index below the line."""
    return SPELLED.get(rule, rule).replace("_1", "₁").replace("_2", "₂")


def spelled(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table of rules and kinds with the names for a reader."""
    return table.rename(index=written, level="rule")


def with_kind(rule: str, kind: str) -> str:
    """Return the name of a rule followed by its kind, unless the name already ends with the kind."""
    return written(rule) if is_of(rule, kind) else f"{written(rule)} {kind}"


def is_of(rule: str, kind: str) -> bool:
    """Return True if the name of a rule ends with a kind, which may have an index."""
    return rule.rstrip("_12₁₂").endswith(kind)


def served() -> pd.DataFrame:
    """Count for every rule the plants with a stable loop, an unstable loop, a refusal, and the common Ms reached."""
    own = read("comparison").query("terms == 'own'")
    fate = np.select(
        [own["ms"].notna() & (own["ms"] > 0), own["reason"].str.contains("unstable", na=False)],
        ["stable", "unstable loop"],
        "refused",
    )
    counted = own.assign(fate=fate).groupby(["rule", "kind"])["fate"].value_counts().unstack(fill_value=0)
    loud = compared("loud")
    reached = loud[loud["iae_load"].notna()].groupby(["rule", "kind"]).size().rename("reaches Ms")
    return spelled(counted.join(reached).fillna(0).astype(int))


def ranking(terms: str = "loud") -> pd.DataFrame:
    """Rank rules by the median of their IAE at equal terms, divided by the least IAE of all kinds."""
    table = compared(terms).dropna(subset=["of_best"])
    groups = table.groupby(["rule", "kind"])
    out = pd.DataFrame(
        {
            "plants": groups.size(),
            "of the best of its kind": groups["of_kind"].median(),
            "of the best of all": groups["of_best"].median(),
            "worst tenth beyond": groups["of_best"].quantile(0.9),
            f"within {NEAR - 1:.0%}": groups["of_kind"].apply(lambda x: (x <= NEAR).mean()),
        }
    )
    return spelled(out.sort_values("of the best of all"))


def own_settings() -> pd.DataFrame:
    """Return Ms and noise of rules with their authors' settings, and count loops that a wrong model makes unstable."""
    own = read("comparison").query("terms == 'own'").dropna(subset=["ms"])
    groups = own.groupby(["rule", "kind"])
    out = {
        "plants": groups.size(),
        "Ms": groups["ms"].median(),
        "Ms, 9 of 10 below": groups["ms"].quantile(0.9),
        "relative noise gain": groups["noise_gain"].median(),
        "unstable if wrong": groups["ms_worst"].apply(lambda x: np.isinf(x).sum()),
    }
    return spelled(pd.DataFrame(out))


def nearest(terms: str, among: list[str], distance: str) -> pd.DataFrame:
    """Return for each group by `among` the rule of smallest median `distance` that works on enough plants."""
    count = plants().groupby("class", observed=True).size()
    table = compared(terms).dropna(subset=[distance])
    groups = table.groupby(["class", "kind", "rule"], observed=True)[distance]
    found = pd.DataFrame(
        {"plants": groups.size(), "median": groups.median(), "worst": groups.max()}
    ).reset_index()
    found["of"] = found["class"].map(count).astype(int)
    found = found[found["plants"] >= SERVES * found["of"]].sort_values("median")
    return found.groupby(among, observed=True).first()


def pays() -> pd.DataFrame:
    """Return the saving by acceleration on every plant, for quiet and loud noise: 1 - (IAE of PIDA)/(IAE of PID)."""
    least = frontier().reset_index()
    return least.assign(saves=1 - least["PIDA"] / least["PID"], pid=1 - least["PID"] / least["PI"]).merge(
        plants(), on="plant"
    )
