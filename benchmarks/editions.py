"""This edition beside those before it: time and error of the same loops, in one run.

The library of an earlier edition is taken out of the repository into a temporary folder and answers in a process of its
own, for as long as all the others do; each question goes to all of them in turn, round after round, and of the rounds
the quickest counts. So what else the machine does meets all alike. The results go to book/data/editions.csv.

``python -m benchmarks.editions`` takes about four minutes on a quiet machine, two of them for compiling;
``python -m benchmarks.editions 1`` runs one round. Where a clone lacks the commit of an edition, its rows say so.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import pidalab
from benchmarks.measure import again, case_loop, duration, oracle_cases, write

ROOT = Path(__file__).parents[1]
EARLIER = {"third": "5e2e483", "second": "2ef65a6"}  # editions and their last commits
THIS = "this"
RESULTS = "editions"  # in book/data
COLUMNS = (
    "quantity",
    "edition",
    "loops",
    "count",
    "seconds",
    "best",
    "median",
    "worst",
    "worst_loop",
    "note",
)
ROUNDS = 3
LEAST = 0.02  # seconds of processor time in one round
DELAYS = 20  # horizon of a response
POINTS = (501, 10_001)
# the loops that the editions before were timed by, and the end of their responses
NAMED = {
    "lags3": (pidalab.Loop(pidalab.lags(3, delay=1.0), pidalab.PIDA(1.0, 3.0, 1.0, 0.3)), 20.0),
    "fopdt": (pidalab.Loop(pidalab.fopdt(1.0, 1.0, 0.3713), pidalab.PIDA(0.1, 0.9, 0.3, 0.02)), 20.0),
}
OF_THE_PAGE = ("third_order_pida", "ten_states", "twelve_states", "ipdt_pida_stable")
FAST = 1e7  # times that a filter is faster than the dead time, beyond which it is called extreme
Task = Callable[[], object]


class Timed(NamedTuple):
    """A loop, the end of its response, and where it is in an oracle, its case."""

    loop: pidalab.Loop
    end: float
    case: dict[str, Any] | None = None


def loops() -> dict[str, Timed]:
    """Return the loops by name: those of the editions before, of the page on speed, and of the oracle between times."""
    found = {name: Timed(*one) for name, one in NAMED.items()}
    for file, some in (("delay_loops.json", OF_THE_PAGE), ("between.json", None)):
        for case in oracle_cases(file):
            if some is None or case["name"] in some:
                found[case["name"]] = Timed(
                    case_loop(case), DELAYS * case["delay"], case if some is None else None
                )
    return found


def tasks(one: Timed) -> dict[str, Task]:
    """Return what is timed, by its name."""
    loop, found = one.loop, {}
    for points in POINTS:
        t = np.linspace(0.0, one.end, points)
        found[f"step, {points:,} points"] = lambda t=t: pidalab.step_response(loop, t)
        found[f"step, {points:,} points, new Loop"] = lambda t=t: pidalab.step_response(again(loop), t)
    for name, measure in (("margins", pidalab.margins), ("Ms", pidalab.max_sensitivity)):
        found[name] = lambda measure=measure: measure(loop)
        found[f"{name}, new Loop"] = lambda measure=measure: measure(again(loop))
    return found


def error(one: Timed) -> float:
    """Return the largest error of y and u at the times of the oracle, each the end of a grid of 1,001 points.

    It is relative to the largest value up to that time, and to 1 if that is larger.
    """
    worst = 0.0
    for i, time in enumerate(one.case["times"] if one.case else ()):
        t = np.linspace(0.0, time, 1001)
        for source, values in one.case["values"].items():
            found = pidalab.simulate(one.loop, t, **{source: 1.0})
            for signal in ("y", "u"):
                x = getattr(found, signal)
                off = abs(x[-1] - float(values[signal][i])) / max(1.0, float(np.max(np.abs(x))))
                worst = max(worst, off if np.isfinite(off) else np.inf)
    return worst


def serve() -> None:
    """Answer one question a line: the seconds of a task, or the error, of a loop; or why there is none."""
    made = loops()
    asked: dict[tuple[str, str], tuple[Task, int]] = {}
    for line in sys.stdin:
        quantity, name = json.loads(line)
        try:
            if quantity == "error":
                answer: Any = error(made[name])
            else:
                if (quantity, name) not in asked:  # the first runs do not count
                    task, runs = tasks(made[name])[quantity], 1
                    duration(task)
                    while duration(task, runs)[0] * runs < LEAST and runs < 10_000:
                        runs *= 2
                    asked[quantity, name] = task, runs
                answer = duration(*asked[quantity, name])[0]
        except Exception as reason:
            answer = str(reason).partition("\n")[0] or type(reason).__name__
        print(json.dumps(answer), flush=True)


class Edition:
    """A process in which the library of one edition answers."""

    def __init__(self, source: Path) -> None:
        path = os.pathsep.join(map(str, (source, ROOT)))
        self.process = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.editions", "serve"],
            cwd=ROOT,
            env=os.environ | {"PYTHONPATH": path, "PIDALAB_COMPILE": "1"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def ask(self, quantity: str, loop: str) -> Any:
        """Return a number, or a text that says why there is none."""
        assert self.process.stdin
        assert self.process.stdout
        self.process.stdin.write(json.dumps([quantity, loop]) + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def __enter__(self) -> Edition:
        return self

    def __exit__(self, *_: object) -> None:
        assert self.process.stdin
        self.process.stdin.close()
        self.process.wait()


def taken_out(commit: str, folder: Path) -> Path | None:
    """Write the library of a commit into a folder, and return where its source is; None where the clone lacks it."""
    found = subprocess.run(
        ["git", "archive", commit, "src"], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    if found.returncode:
        return None
    with tarfile.open(fileobj=BytesIO(found.stdout)) as archive:
        archive.extractall(folder, filter="data")
    return folder / "src"


def measured(editions: dict[str, Edition], rounds: int) -> dict[tuple[str, str, str], Any]:
    """Return by quantity, loop and edition the least of all rounds, or why there is none."""
    results: dict[tuple[str, str, str], Any] = {}
    for name, one in loops().items():
        for quantity in [*tasks(one), *(["error"] if one.case else [])]:
            for _ in range(1 if quantity == "error" else rounds):
                for edition, asked in editions.items():
                    key, answer = (quantity, name, edition), asked.ask(quantity, name)
                    before = results.setdefault(key, answer)
                    if isinstance(answer, float) and isinstance(before, float):
                        results[key] = min(answer, before)
                    elif isinstance(before, float):
                        results[key] = answer
        print(".", end="", flush=True)
    print()
    return results


def summed_up(results: dict[tuple[str, str, str], Any], editions: list[str]) -> Iterator[dict[str, Any]]:
    """Return the rows of the table: own time over that of each edition, over all loops and for those with a name."""
    made = loops()
    groups = {"all": list(made)} | {name: [name] for name in NAMED}
    for quantity in tasks(next(iter(made.values()))):
        for group, names in groups.items():
            for edition in EARLIER:
                row = dict.fromkeys(COLUMNS, "") | {
                    "quantity": quantity,
                    "edition": edition,
                    "loops": group,
                }
                if edition not in editions:
                    yield row | {"count": 0, "note": f"this clone lacks the commit {EARLIER[edition]}"}
                    continue
                ratios, seconds = {}, []
                for name in names:
                    own, other = results[quantity, name, THIS], results[quantity, name, edition]
                    if isinstance(own, float) and isinstance(other, float):
                        ratios[name] = own / other
                        seconds.append(own)
                yield row | {"count": len(ratios)} | _spread(ratios) | {"seconds": statistics.median(seconds)}
    cases = {name: one for name, one in made.items() if one.case}
    extreme = {name for name, one in cases.items() if _fastest(one.loop) * one.loop.process.delay > FAST}
    for group, names in (("ordinary filters", cases.keys() - extreme), ("extreme filters", extreme)):
        for edition in [*EARLIER, THIS]:
            row = dict.fromkeys(COLUMNS, "") | {"quantity": "error", "edition": edition, "loops": group}
            if edition not in editions:
                yield row | {"count": 0, "note": f"this clone lacks the commit {EARLIER[edition]}"}
                continue
            found = {name: results["error", name, edition] for name in names}
            errors = {name: x for name, x in found.items() if isinstance(x, float)}
            refused = len(found) - len(errors)
            yield (
                row
                | {"count": len(errors)}
                | _spread(errors)
                | {"note": f"{refused} refused" if refused else ""}
            )


def _fastest(loop: pidalab.Loop) -> float:
    return max(float(np.max(np.abs(np.roots(den)), initial=0.0)) for _, den in loop.blocks.values())


def _spread(values: dict[str, float]) -> dict[str, Any]:
    """Least, median and largest of some values, and which is the largest."""
    return {
        "best": min(values.values()),
        "median": statistics.median(values.values()),
        "worst": max(values.values()),
        "worst_loop": max(values, key=lambda name: values[name]),
    }


def show(rows: list[dict[str, Any]]) -> None:
    """Print the table."""
    print(f"{'':32}{'edition':10}{'loops':20}{'own, ms':>10}{'best':>9}{'median':>9}{'worst':>9}")
    for row in rows:
        numbers = "".join(f"{row[key]:9.2g}" for key in ("best", "median", "worst")) if row["count"] else ""
        own = f"{1e3 * row['seconds']:10.3f}" if row["seconds"] else f"{'':10}"
        loops = f"{row['count']} {row['loops']}"
        print(
            f"{row['quantity']:32}{row['edition']:10}{loops:20}{own}{numbers}  {row['worst_loop']} {row['note']}"
        )


def main(rounds: int = ROUNDS) -> None:
    """Measure, print and write."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        sources = {edition: taken_out(commit, folder / edition) for edition, commit in EARLIER.items()}
        sources[THIS] = Path(pidalab.__file__).parents[1]
        editions = {name: stack.enter_context(Edition(source)) for name, source in sources.items() if source}
        results = measured(editions, rounds)
    rows = list(summed_up(results, list(editions)))
    show(rows)
    write(RESULTS, COLUMNS, rows)


if __name__ == "__main__":
    if sys.argv[1:] == ["serve"]:
        serve()
    else:
        main(*map(int, sys.argv[1:]))
