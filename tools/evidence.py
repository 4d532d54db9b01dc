"""Fill the tables of the page *How we know* while the site is built, from the files that the evidence leaves behind.

A line ``<!-- evidence: name -->`` becomes the table of that name. Nothing of it is stored, so no figure grows old.
"""

import json
import re
from collections.abc import Callable, Iterable
from io import StringIO
from math import floor, log10
from pathlib import Path

import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "book" / "data"
ORACLES = ROOT / "tests" / "oracle"
MARK = re.compile(r"^<!-- evidence: (.+) -->$", flags=re.MULTILINE)
NUMBER = re.compile(r"[\d.]+(e[+-]\d+| %)?|no digit")
DATE = re.compile(r"\b(\d{4})-(\d\d)-(\d\d)\b")
LONG = re.compile(r"\d+\.\d{5,}")  # a number with more digits than a reader compares
OUTCOMES = {  # of mutants, with the heads of their columns
    "killed": "own tests",
    "killed elsewhere": "others",
    "killed later": "added since",
    "equivalent": "equivalent",
    "survived": "left",
}


def table(head: Iterable[str], lines: Iterable[Iterable[object]]) -> str:
    """Return a table in Markdown; columns of numbers and dashes stand to the right, and a date does not break."""
    lines = [[DATE.sub("\\1\u2011\\2\u2011\\3", str(cell)) for cell in line] for line in lines]
    columns = [[cell for cell in column if cell != "–"] for column in zip(*lines, strict=True)]
    rule = ["--:" if all(map(NUMBER.fullmatch, column)) else "---" for column in columns]
    return "\n".join("| " + " | ".join(line) + " |" for line in [head, rule, *lines])


def read(name: str) -> pd.DataFrame:
    """Read a table of texts; lines that begin with # say who made it."""
    lines = (DATA / f"{name}.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    text = "".join(line for line in lines if not line.startswith("#"))
    return pd.read_csv(StringIO(text), dtype=str, keep_default_na=False)


def faults() -> str:
    """Gross errors planted in the library: the first row or cell of each chapter that turned red."""
    found = read("faults")
    found["first red"] = found["first red"].str.replace(
        LONG, lambda each: f"{float(each[0]):.5g}", regex=True
    )
    wide = found.pivot_table("first red", "fault", "paper", "first", fill_value="–", sort=False)
    wide = wide[sorted(wide)]
    return table(["planted error", *wide], wide.itertuples(name=None))


def oracles() -> str:
    """Reference values by file; the list beside them says what they are."""
    readme = (ORACLES / "README.md").read_text("utf-8")
    content = dict(re.findall(r"^\| `(\S+)` \| (.+?) \|", readme, re.MULTILINE))
    lines = []
    for path in sorted(ORACLES.glob("*.json")):
        found = json.loads(path.read_text(encoding="utf-8"))
        digits = found.get("digits") or floor(-log10(found["agreement"]))
        lines.append((f"`{path.name}`", content[path.name], len(found["cases"]), digits))
    return table(["file", "what", "loops", "digits"], lines)


def engine() -> str:
    """Largest error of each method at its best setting, over the loops of the comparison that have digits."""
    rows = read("engine_comparison").query("error != ''").astype({"error": float})
    best = rows.groupby(["m", "n", "te", "method"], sort=False)["error"].min()
    worst = best.groupby("method", sort=False).max()
    shown = {method: f"{error:.0e}" if error < 1 else "no digit" for method, error in worst.items()}
    loops = best.groupby(["m", "n", "te"]).ngroups
    return table(["method", f"largest error over {loops} loops"], shown.items())


def optima() -> str:
    """How the optimiser compares with a search that shares nothing with it but the engine."""
    ratios = read("optimal_check")["ratio"].astype(float)
    found = [
        ("plants", ratios.size),
        ("the other search found a better controller", sum(ratios > 1)),
        ("largest ratio of the two errors", f"{ratios.max():.3f}"),
    ]
    return table(["second search for the optimum", ""], found)


def starts() -> str:
    """How the optimiser compares with its own descents from random places."""
    problems = read("random_starts")
    ratios, counts = (pd.to_numeric(problems[name]) for name in ("ratio", "starts"))
    found = [
        ("problems drawn at random", len(problems)),
        ("descents from random places", int(counts.sum())),
        ("problems where one ended more than 0.1 % lower", sum(ratios < 0.999)),
        ("least ratio to the optimum", f"{ratios.min():.4f}"),
    ]
    return table(["other starts of the same search", ""], found)


def _counted(by: str) -> pd.DataFrame:
    """What became of mutants, by a column; `differ` counts those that are not equivalent."""
    rows = read("mutants")
    rows["part"] = rows["module"].str.partition("/")[0].str.removesuffix(".py")
    rows.loc[rows["reason"] != "", "outcome"] = "equivalent"
    rows = rows[rows[by] != ""]
    counts = pd.crosstab(rows[by], rows["outcome"]).reindex(columns=list(OUTCOMES), fill_value=0)
    counts["tried"] = counts.sum(axis=1)
    counts["differ"] = counts["tried"] - counts["equivalent"]
    return counts


def _shares(row: pd.Series) -> list[str]:
    """Of the mutants that differ, what their own tests noticed, and what all did."""
    noticed = row["killed"], row["killed"] + row["killed elsewhere"]
    return [f"{100 * count / row['differ']:.0f} %" if row["differ"] else "" for count in noticed]


def mutants() -> str:
    """What became of the mutants of each part of the library."""
    counts = _counted("part")
    counts.loc["all"] = counts.sum()
    lines = [[part, row["tried"], *row[list(OUTCOMES)], *_shares(row)] for part, row in counts.iterrows()]
    return table(["part", "tried", *OUTCOMES.values(), "own share", "full share"], lines)


def samples() -> str:
    """What became of the mutants of each sample whose day is known."""
    shown = ["tried", "differ", "killed", "killed elsewhere"]
    lines = [[day, *row[shown], *_shares(row)] for day, row in _counted("drawn").iterrows()]
    return table(["drawn", "tried", "differ", "own tests", "others", "own share", "full share"], lines)


def processors() -> str:
    """What the tests of the library and the notebooks gave as other machines run them."""
    rows = read("processors").pivot_table(
        ["passed", "failed", "date"], "variant", "what", "first", fill_value="–", sort=False
    )
    shown = [(count, what) for what in ("tests", "notebooks") for count in ("passed", "failed")]
    rows = rows[rows["date", "notebooks"] != "–"][[*shown, ("date", "notebooks")]]
    return table(
        ["as if on", "tests passed", "failed", "cells passed", "failed", "date"], rows.itertuples(name=None)
    )


def versions() -> str:
    """What the tests of the library ran with."""
    lines = []
    for row in read("processors").itertuples():
        python, _, packages = row.variant.removeprefix("Python ").partition(", ")
        if packages:
            names, numbers = row.packages.split()[::2], row.packages.split()[1::2]
            lines.append([python, packages, *numbers, row.passed, row.failed, row.skipped])
    return table(["python", "set", *names, "passed", "failed", "skipped"], lines)


TABLES: dict[str, Callable[[], str]] = {
    made.__name__: made
    for made in (faults, mutants, samples, oracles, engine, optima, starts, processors, versions)
}


def filled(text: str) -> str:
    """Return the page with its tables.

    Raises
    ------
    KeyError
        If a mark names a table that does not exist.
    """
    return MARK.sub(lambda found: TABLES[found[1]](), text)


def fill(path: Path) -> None:
    """Fill a page in place."""
    path.write_text(filled(path.read_text(encoding="utf-8")), encoding="utf-8")
