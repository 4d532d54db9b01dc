"""Fill the tables of the page *How we know* from data files while the site is built.

A line ``<!-- evidence: name -->`` is replaced by the table of this name.
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


def table(head: Iterable[str], lines: Iterable[Iterable[object]]) -> str:
    """Return a Markdown table. Columns of numbers and dashes are aligned right."""
    lines = [[str(cell) for cell in line] for line in lines]
    columns = [[cell for cell in column if cell != "–"] for column in zip(*lines, strict=True)]
    rule = ["--:" if all(map(NUMBER.fullmatch, column)) else "---" for column in columns]
    return "\n".join("| " + " | ".join(line) + " |" for line in [head, rule, *lines])


def read(name: str) -> pd.DataFrame:
    """Read a table as text, without the lines that begin with #."""
    lines = (DATA / f"{name}.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    text = "".join(line for line in lines if not line.startswith("#"))
    return pd.read_csv(StringIO(text), dtype=str, keep_default_na=False)


def oracles() -> str:
    """List the files of reference values."""
    readme = (ROOT / "oracles" / "README.md").read_text("utf-8")
    content = dict(re.findall(r"^\| `(\S+)` \| (.+?) \|", readme, re.MULTILINE))
    lines = []
    for path in sorted(ORACLES.glob("*.json")):
        found = json.loads(path.read_text(encoding="utf-8"))
        digits = found.get("digits") or floor(-log10(found["agreement"]))
        lines.append((f"`{path.name}`", content[path.name], len(found["cases"]), digits))
    return table(["file", "what", "loops", "digits"], lines)


def engine() -> str:
    """List the largest error of each method over all loops, with the best setting for each loop."""
    rows = read("engine_comparison").query("error != ''").astype({"error": float})
    best = rows.groupby(["m", "n", "te", "method"], sort=False)["error"].min()
    worst = best.groupby("method", sort=False).max()
    shown = {method: f"{error:.0e}" if error < 1 else "no digit" for method, error in worst.items()}
    loops = best.groupby(["m", "n", "te"]).ngroups
    return table(["method", f"largest error over {loops} loops"], shown.items())


def optima() -> str:
    """Compare the optimiser with an independent search."""
    ratios = read("optimal_check")["ratio"].astype(float)
    found = [
        ("plants", ratios.size),
        ("plants where the second search found a better controller", sum(ratios > 1)),
        ("largest ratio", f"{ratios.max():.3f}"),
    ]
    return table(["second search for the optimum", ""], found)


TABLES: dict[str, Callable[[], str]] = {made.__name__: made for made in (oracles, engine, optima)}


def filled(text: str) -> str:
    """Return the page with all marks replaced by tables.

    Raises
    ------
    KeyError
        If a mark names a table that does not exist.
    """
    return MARK.sub(lambda found: TABLES[found[1]](), text)


def fill(path: Path) -> None:
    """Fill a page in place."""
    path.write_text(filled(path.read_text(encoding="utf-8")), encoding="utf-8")
