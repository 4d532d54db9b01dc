"""Show that every claim can fail: disturb what the checks of a paper stand on, and see which rows turn red.

A row turns red when its value or its evidence drifts beyond tolerance; a note alone does not count. The table
``tests/claims/<paper>.csv`` keeps the first disturbance that did it. A row that stands on computation and that nothing
turns red fails the run: it is no claim, and is deleted or becomes a reading.

    python tools/claims.py                     # all papers that have checks
    python tools/claims.py heo2023 --show      # and where a section stops under a disturbance
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import disturb
from tqdm import tqdm

ROOT = Path(__file__).parents[1]
LEDGERS = ROOT / "book" / "ledger"
TABLES = ROOT / "tests" / "claims"
COLUMNS = ("id", "section", "turned red by")
SLIGHT, STRONG = (
    0.02,
    12.0,
)  # times the disturbance: where a check would stop, and where a count has to change
BEFORE: dict[str, Callable[[], None]] = {  # in the order in which they are tried
    "processes": disturb.processes,
    "printed inputs": disturb.printed,
    "results of the library": disturb.results,
    "methods of the library": disturb.methods,
    "constants of the library": disturb.constants,
    "responses": disturb.responses,
    "controllers": disturb.controllers,
    "stored tables": disturb.tables,
    "processes, slightly": partial(disturb.processes, SLIGHT),
    "responses, slightly": partial(disturb.responses, SLIGHT),
    "processes, strongly": partial(disturb.processes, STRONG),
    "responses, strongly": partial(disturb.responses, STRONG),
    "controllers, strongly": partial(disturb.controllers, STRONG / 2),
    "printed inputs, strongly": partial(disturb.printed, STRONG),
    "results of the library, strongly": partial(disturb.results, STRONG),
    "methods of the library, strongly": partial(disturb.methods, STRONG),
    "controllers, very strongly": partial(disturb.controllers, 30.0),
    "a lag more": disturb.another_lag,
    "constants of the library, strongly": partial(disturb.constants, STRONG),
    "decisions of the library": disturb.decisions,
}
AFTER: dict[str, Callable[[], None]] = {
    "elementary functions": disturb.elementary,
    "searches": partial(disturb.elementary, disturb.SEARCHES),
    "decisions that the page asks for": disturb.seen_decisions,
    "formulas of the page": disturb.formulas,
    "formulas of the page, strongly": partial(disturb.formulas, STRONG),
    "decisions of the page": disturb.verdicts,
}
TIMEOUT = 900.0  # seconds for one run of a paper


def look(paper: str, disturbance: str, wanted: list[str]) -> dict[str, Any]:
    """Run sections of a paper under a disturbance, in this process, and say which rows turned red."""
    BEFORE.get(disturbance, lambda: None)()
    from pidalab.ledger import Ledger, checks
    from pidalab.ledger.book import recording, same

    module = checks(paper, LEDGERS)
    AFTER.get(disturbance, lambda: None)()
    os.chdir(ROOT / "book")
    with recording():
        book = Ledger.open(paper, folder=LEDGERS)
    owners: dict[str, list[str]] = {}
    stopped: dict[str, str] = {}
    for section in module.SECTIONS:
        if wanted and section.__name__ not in wanted:
            continue
        before = set(book.fresh)
        try:
            section(book)
        except Exception as error:  # a disturbed section may stop: what it handed over until then counts
            stopped[section.__name__] = f"{type(error).__name__}: {error}"[:200]
        if "matplotlib.pyplot" in sys.modules:
            sys.modules["matplotlib.pyplot"].close("all")
        owners[section.__name__] = [id for id in book.fresh if id not in before]
    red = [id for id, fresh in book.fresh.items() if not same(book.rows[id], fresh)]
    reworded: list[str] = []
    return {"red": red, "reworded": reworded, "owners": owners, "stopped": stopped}


def looked(paper: str, disturbance: str, wanted: list[str]) -> dict[str, Any]:
    """Run `look` in a process of its own, so that disturbances and caches end with it."""
    command = [sys.executable, __file__, "--look", disturbance, paper, *wanted]
    threads = {"OPENBLAS_NUM_THREADS": "1", "MPLBACKEND": "Agg", "PYTHONWARNINGS": "ignore"}
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=TIMEOUT, env={**os.environ, **threads}
        )
    except subprocess.TimeoutExpired:
        return {"red": [], "reworded": [], "owners": {}, "stopped": {"": f"longer than {TIMEOUT:g} s"}}
    if done.returncode:
        return {
            "red": [],
            "reworded": [],
            "owners": {},
            "stopped": {"": done.stderr.strip().splitlines()[-1][:300]},
        }
    return json.loads(done.stdout.splitlines()[-1])


def stored(paper: str) -> dict[str, tuple[str, str]]:
    """Read the table of a paper."""
    path = TABLES / f"{paper}.csv"
    if not path.is_file():
        return {}
    with path.open(encoding="utf-8", newline="") as file:
        return {line["id"]: (line["section"], line["turned red by"]) for line in csv.DictReader(file)}


def examine(paper: str, show: bool, more: bool) -> list[str]:
    """Write the table of a paper; return what is wrong, one line each."""
    from pidalab.ledger import Ledger

    clean = looked(paper, "", [])
    problems = [f"{paper}: {section} stops: {why}" for section, why in clean["stopped"].items()]
    problems += [f"{id}: red without a disturbance" for id in clean["red"]]
    if problems:
        return problems
    rows = Ledger.open(paper, folder=LEDGERS).rows
    left = {
        id: section for section, ids in clean["owners"].items() for id in ids if rows[id].basis != "reading"
    }
    turned = {id: how for id, how in stored(paper).items() if more and left.get(id) == how[0]}
    left = {id: section for id, section in left.items() if id not in turned}
    for disturbance in tqdm([*BEFORE, *AFTER], desc=paper, disable=None):
        if not left:
            break
        outcome = looked(paper, disturbance, sorted({*left.values()}))
        if show:
            for section, why in outcome["stopped"].items():
                print(f"{paper}, {disturbance}: {section} stops: {why}")
            print(f"{paper}, {disturbance}: {len({*outcome['red']} & {*left})} rows turn red")
        for id in outcome["red"]:
            if section := left.pop(id, None):
                turned[id] = (section, disturbance)
    write(paper, {id: turned[id] for id in rows if id in turned})
    return [f"{id}: nothing turns it red (section {section})" for id, section in left.items()]


def write(paper: str, turned: dict[str, tuple[str, str]]) -> None:
    """Write the table of a paper."""
    TABLES.mkdir(exist_ok=True)
    with (TABLES / f"{paper}.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows((id, *how) for id, how in turned.items())


def main() -> int:
    """Examine papers; 0 if every claim can fail."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("papers", nargs="*", help="keys of papers; by default all that have checks")
    parser.add_argument("--show", action="store_true", help="say what stops")
    parser.add_argument("--more", action="store_true", help="only rows that the stored table does not have")
    parser.add_argument("--look", metavar="DISTURBANCE", help="one run of a paper: its key, then sections")
    given = parser.parse_args()
    if given.look is not None:
        paper, *wanted = given.papers
        print(json.dumps(look(paper, given.look, wanted)))
        return 0
    from pidalab.ledger import papers
    from pidalab.ledger.shims import has_checks

    chosen = given.papers or [paper for paper in papers(LEDGERS) if has_checks(paper, LEDGERS)]
    problems = [problem for paper in chosen for problem in examine(paper, given.show, given.more)]
    print("\n".join(problems) or "every claim can fail")
    return int(bool(problems))


if __name__ == "__main__":
    sys.exit(main())
