"""Fill the tables of the page *How we know* while the site is built, from the files that the evidence leaves behind.

A line ``<!-- evidence: name -->`` becomes the table of that name. Nothing of it is stored, so no figure grows old.
"""

import csv
import json
import re
from collections import defaultdict
from collections.abc import Callable
from math import floor, log10
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "book" / "data"
ORACLES = ROOT / "tests" / "oracle"
MARK = re.compile(r"^<!-- evidence: (.+) -->$", flags=re.MULTILINE)

NUMBER = re.compile(r"[\d.]+(e[+-]\d+| %)?|no digit")

Line = list[str]


def table(head: Line, lines: list[Line]) -> str:
    """Return a table in Markdown; columns that end in a number stand to the right."""
    rule = ["--:" if NUMBER.fullmatch(cell) else "---" for cell in lines[-1]]
    return "\n".join("| " + " | ".join(line) + " |" for line in [head, rule, *lines])


def read(path: Path) -> list[dict[str, str]]:
    """Read a table with names of columns; lines that begin with # say who made it."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def faults() -> str:
    """Gross errors planted in the library: the first row or cell of each chapter that turned red."""
    first = {(row["fault"], row["paper"]): row["first red"] for row in read(DATA / "faults.csv")}
    papers = sorted({paper for _, paper in first})
    names = dict.fromkeys(fault for fault, _ in first)
    lines = [[name, *(first.get((name, paper), "–") for paper in papers)] for name in names]
    return table(["planted error", *papers], lines)


def oracles() -> str:
    """Reference values by file; what they are stands in the list beside them."""
    content = dict(
        re.findall(r"^\| `(\S+)` \| (.+?) \|", (ORACLES / "README.md").read_text("utf-8"), re.MULTILINE)
    )
    lines = []
    for path in sorted(ORACLES.glob("*.json")):
        found = json.loads(path.read_text(encoding="utf-8"))
        lines.append(
            [
                f"`{path.name}`",
                content[path.name],
                str(len(found["cases"])),
                str(found.get("digits") or floor(-log10(found["agreement"]))),
            ]
        )
    return table(["file", "what", "loops", "digits"], lines)


def engine() -> str:
    """Largest error of each method at its best setting, over the loops of the comparison that have digits."""
    worst: dict[str, float] = {}
    loops: dict[tuple[str, str, str], dict[str, float]] = defaultdict(dict)
    for row in read(DATA / "engine_comparison.csv"):
        if row["error"]:
            found = loops[row["m"], row["n"], row["te"]]
            found[row["method"]] = min(found.get(row["method"], float("inf")), float(row["error"]))
    for errors in loops.values():
        for method, error in errors.items():
            worst[method] = max(worst.get(method, 0.0), error)
    shown = {method: f"{error:.0e}" if error < 1 else "no digit" for method, error in worst.items()}
    return table(["method", f"largest error over {len(loops)} loops"], [[*pair] for pair in shown.items()])


def optima() -> str:
    """How the optimiser compares with a search that shares nothing with it but the engine."""
    ratios = [float(row["ratio"]) for row in read(DATA / "optimal_check.csv")]
    found = [
        ["plants", str(len(ratios))],
        ["the other search found a better controller", str(sum(ratio > 1 for ratio in ratios))],
        ["largest ratio of the two errors", f"{max(ratios):.3f}"],
    ]
    return table(["second search for the optimum", ""], found)


def starts() -> str:
    """How the optimiser compares with its own descents from random places."""
    problems = read(DATA / "random_starts.csv")
    others = [float(row["ratio"]) for row in problems if row["ratio"]]
    found = [
        ["problems drawn at random", str(len(problems))],
        ["descents from random places", str(sum(int(row["starts"] or 0) for row in problems))],
        ["problems where one ended more than 0.1 % lower", str(sum(other < 0.999 for other in others))],
        ["least ratio to the optimum", f"{min(others):.4f}"],
    ]
    return table(["other starts of the same search", ""], found)


def mutants() -> str:
    """What became of the mutants of each part of the library."""
    parts: dict[str, list[str]] = defaultdict(list)
    for row in read(DATA / "mutants.csv"):
        parts[row["module"].partition("/")[0].removesuffix(".py")].append(_outcome(row))
    parts = dict(sorted(parts.items())) | {"all": [outcome for found in parts.values() for outcome in found]}
    lines = []
    for part, outcomes in parts.items():
        names = ("killed", "killed elsewhere", "killed later", "equivalent", "survived")
        counts = [outcomes.count(name) for name in names]
        differ = len(outcomes) - outcomes.count("equivalent")
        shares = [f"{100 * sum(counts[:k]) / differ:.0f} %" if differ else "" for k in (1, 2)]
        lines.append([part, str(len(outcomes)), *map(str, counts), *shares])
    head = [
        "part",
        "tried",
        "own tests",
        "others",
        "added since",
        "equivalent",
        "left",
        "own share",
        "full share",
    ]
    return table(head, lines)


def _outcome(row: dict[str, str]) -> str:
    return "equivalent" if row["reason"] else row["outcome"]


def samples() -> str:
    """What became of the mutants of each sample whose day is known."""
    days: dict[str, list[str]] = defaultdict(list)
    for row in read(DATA / "mutants.csv"):
        if row["drawn"]:
            days[row["drawn"]].append(_outcome(row))
    lines = []
    for day, outcomes in sorted(days.items()):
        own, others = (outcomes.count(name) for name in ("killed", "killed elsewhere"))
        differ = len(outcomes) - outcomes.count("equivalent")
        shares = [f"{100 * count / differ:.0f} %" for count in (own, own + others)]
        lines.append([day, str(len(outcomes)), str(differ), str(own), str(others), *shares])
    return table(["drawn", "tried", "differ", "own tests", "others", "own share", "full share"], lines)


def processors() -> str:
    """What the tests of the library and the notebooks gave as other machines run them."""
    found: dict[str, dict[str, dict[str, str]]] = defaultdict(dict)
    for row in read(DATA / "processors.csv"):
        found[row["variant"]][row["what"]] = row
    lines = []
    for variant, by in found.items():
        if "notebooks" in by:
            kinds = [by.get(what, {}) for what in ("tests", "notebooks")]
            counts = [kind.get(key, "") for kind in kinds for key in ("passed", "failed")]
            lines.append([variant, *counts, by["notebooks"]["date"]])
    return table(["as if on", "tests passed", "failed", "cells passed", "failed", "date"], lines)


def versions() -> str:
    """What the tests of the library ran with."""
    lines = []
    for row in read(DATA / "processors.csv"):
        python, _, packages = row["variant"].removeprefix("Python ").partition(", ")
        if packages:
            numbers = row["packages"].split()[1::2]
            lines.append([python, packages, *numbers, *(row[key] for key in ("passed", "failed", "skipped"))])
    names = row["packages"].split()[::2]
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
