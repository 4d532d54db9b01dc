"""Plant gross errors in the library, and show that every chapter that stands on the part notices.

Each fault changes a line of a copy of the library. A chapter stands on it if its checks call the function around that
line. The table ``tests/claims/faults.csv`` keeps, for each fault and chapter, how many rows turned red and one of them;
where a fault moves only numbers that stand in the notes of rows, which fail the account as well, it says so. A chapter
that notices nothing fails the run.

    python tools/faults.py                       # all faults, all papers that have checks
    python tools/faults.py "dead time" heo2023   # faults whose name has these words, some papers
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path

import disturb
from claims import LEDGERS, ROOT, TABLES, TIMEOUT
from tqdm import tqdm

TABLE = TABLES / "faults.csv"
COLUMNS = ("fault", "paper", "red rows", "one of them")


@dataclass(frozen=True)
class Fault:
    """A gross error: in `file` of the library, inside `function`, each `old` text becomes `new`."""

    name: str
    file: str
    function: str
    changes: tuple[tuple[str, str], ...]
    around: str = ""  # module of the function, where compiled code is changed that only it calls

    def plant(self, library: Path) -> None:
        """Change a copy of the library; each text has to be there exactly once."""
        path = library / self.file
        text = path.read_text(encoding="utf-8")
        for old, new in self.changes:
            if text.count(old) != 1:
                raise ValueError(f"{self.name}: {old!r} occurs {text.count(old)} times in {self.file}")
            text = text.replace(old, new)
        path.write_text(text, encoding="utf-8")


FAULTS = (
    Fault(
        "dead time of the exact engine 1 % too long",
        "simulation/ladder.py",
        "responses",
        (
            (
                "step, delay = step / cut.unit, delay / cut.unit",
                "step, delay = step / cut.unit, 1.01 * delay / cut.unit",
            ),
        ),
    ),
    Fault(
        "Ms and Mt on a grid of 40 points a decade",
        "robustness/margins.py",
        "_peaks",
        (
            (
                "    return [_with_ends(loop, k == 1, float(best[k]), float(where[k])) for k in range(kinds)]\n",
                "    w = np.geomspace(looked.w[0], looked.w[-1], 2 + int(40 * np.log10(looked.w[-1] / looked.w[0])))\n"
                "    best = [np.nanmax(np.abs(loop.S(1j * w))), np.nanmax(np.abs(loop.T(1j * w)))]\n"
                "    return [_with_ends(loop, k == 1, float(best[k]), float(where[k])) for k in range(kinds)]\n",
            ),
        ),
    ),
    Fault(
        "IAE and ITAE by rectangles",
        "response.py",
        "Response._absolute",
        (
            (
                "        curve, end, start = self._pieces(horizon)\n",
                "        curve, end, start = self._pieces(horizon)\n"
                "        return float(self.step * np.sum(np.abs(curve[0]) * end * (base + slope * start)))\n",
            ),
        ),
    ),
    Fault(
        "total variation without the first jump",
        "response.py",
        "Response.tv",
        (
            (
                "return float(np.sum(np.abs(np.diff(self._path(signal, start, end)))))",
                "return float(np.sum(np.abs(np.diff(self._path(signal, start, end)[1:]))))",
            ),
        ),
    ),
    Fault(
        "ITAE from the step, whatever its origin",
        "response.py",
        "Response.itae",
        (("return self._absolute(horizon, -origin, 1.0)", "return self._absolute(horizon, 0.0, 1.0)"),),
    ),
    Fault(
        "a sign of an MRDP constant",
        "rules/mrdp.py",
        "_coefficient",
        (("(head - j * (j - 1) * tail)", "(head + j * (j - 1) * tail)"),),
    ),
    Fault(
        "filter of order n - 1 in the areas",
        "areas/model.py",
        "with_binomial_filter",
        (("series.lagged(values, lag, order)", "series.lagged(values, lag, max(order - 1, 0))"),),
    ),
    Fault(
        "filter of order n - 1 in the controller",
        "controllers/parallel.py",
        "HighOrderPID.fraction",
        (
            (
                "binomial(self.filter_time, self.filter_order), [1.0, 0.0]",
                "binomial(self.filter_time, max(self.filter_order - 1, len(self.coefficients) - 2)), [1.0, 0.0]",
            ),
        ),
    ),
    Fault(
        "noise gain 3 % too small",
        "simulation/noise.py",
        "noise_gain",
        (("return largest * math.sqrt(total)", "return 0.97 * largest * math.sqrt(total)"),),
    ),
    Fault(
        "stable and unstable exchanged",
        "robustness/poles.py",
        "is_stable",
        (("return unstable_poles(loop) == 0", "return unstable_poles(loop) != 0"),),
    ),
    Fault(
        "the sampled loop holds its input a sample too long",
        "simulation/kernels.py",
        "simulate_sampled",
        (("        w = v[at - plant.ago[piece]]\n", "        w = v[max(at - plant.ago[piece] - 1, 0)]\n"),),
        "simulation.sampled",
    ),
    Fault(
        "levels of the three points as printed, not as used",
        "identification/experiments.py",
        "three_point",
        (("LEVELS = (0.05, 0.353, 0.853)", "LEVELS = (0.05, 0.35, 0.85)"),),
    ),
)


def stands_on(paper: str) -> dict[str, list[str]]:
    """Sections of a paper that call the function around a fault, by the name of the fault."""
    done = _run(["--calls", paper], ROOT / "src")
    if isinstance(done, str):
        raise SystemExit(f"{paper}: {done}")
    return done


def calls(paper: str) -> dict[str, list[str]]:
    """Run the checks of a paper in this process and list the sections in which each fault would be met."""
    called: set[str] = set()
    for fault in FAULTS:
        module = import_module(f"pidalab.{fault.around or fault.file.removesuffix('.py').replace('/', '.')}")
        owner, _, name = fault.function.rpartition(".")
        if owner:
            kind = getattr(module, owner)
            setattr(kind, name, disturb.after(getattr(kind, name), partial(_note, called, fault.name)))
        else:
            disturb.replaced([getattr(module, name)], partial(_note, called, fault.name), "pidalab")
    from pidalab.ledger import Ledger, checks
    from pidalab.ledger.book import recording

    found: dict[str, list[str]] = {fault.name: [] for fault in FAULTS}
    sections = checks(paper, LEDGERS).SECTIONS
    os.chdir(ROOT / "book")
    with recording():
        book = Ledger.open(paper, folder=LEDGERS)
    for section in sections:
        called.clear()
        section(book)
        for name in called:
            found[name].append(section.__name__)
    return found


def _note(called: set[str], name: str, value: object, _: int) -> object:
    called.add(name)
    return value


def _run(arguments: list[str], source: Path) -> dict | str:
    """Run this script, or `claims.py --look`, on a library, and return what it prints; a text says what went wrong."""
    script = __file__ if "--calls" in arguments else str(Path(__file__).with_name("claims.py"))
    fixed = {
        "PYTHONPATH": str(source),
        "OPENBLAS_NUM_THREADS": "1",
        "MPLBACKEND": "Agg",
        "PYTHONWARNINGS": "ignore",
    }
    command = [sys.executable, script, *arguments]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=TIMEOUT, env={**os.environ, **fixed}
        )
    except subprocess.TimeoutExpired:
        return f"longer than {TIMEOUT:g} s"
    if done.returncode:
        return done.stderr.strip().splitlines()[-1][:300]
    return json.loads(done.stdout.splitlines()[-1])


def noticed(fault: Fault, paper: str, sections: list[str]) -> tuple[str, str]:
    """Number of rows that a fault turns red in sections that meet it, and one of them; or why the run stops."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "src")
        shutil.copytree(ROOT / "src", source, ignore=shutil.ignore_patterns("*.egg-info"))
        fault.plant(source / "pidalab")
        outcome = _run(["--look", "", paper, *sections], source)
    if isinstance(outcome, str):
        return "0", f"stops: {outcome}"
    red = outcome["red"]
    stopped = [f"stops: {section}: {why}" for section, why in outcome["stopped"].items()]
    notes = [f"note of {id}" for id in outcome["reworded"]]
    return str(len(red)), (red or stopped or notes or [""])[0]


def _store(lines: list[tuple[str, str, str, str]]) -> None:
    """Put these lines in the place of older ones of the same fault and paper; drop faults that are no more."""
    names = [fault.name for fault in FAULTS]
    old: list[list[str]] = []
    if TABLE.is_file():
        with TABLE.open(encoding="utf-8", newline="") as file:
            old = [line for line in list(csv.reader(file))[1:] if line[0] in names]
    kept = {(line[0], line[1]): tuple(line) for line in [*old, *lines]}
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(sorted(kept.values(), key=lambda line: (names.index(line[0]), line[1])))


def main() -> int:
    """Plant faults; 0 if every chapter that stands on one notices."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "words", nargs="?", default="", help="part of the names of the faults; by default all"
    )
    parser.add_argument("papers", nargs="*", help="keys of papers; by default all that have checks")
    parser.add_argument(
        "--calls", metavar="PAPER", help="list the functions of the library that a paper calls"
    )
    given = parser.parse_args()
    if given.calls:
        print(json.dumps(calls(given.calls)))
        return 0
    from pidalab.ledger import papers
    from pidalab.ledger.shims import has_checks

    chosen = given.papers or [paper for paper in papers(LEDGERS) if has_checks(paper, LEDGERS)]
    grounds = {paper: stands_on(paper) for paper in chosen}
    faults = [fault for fault in FAULTS if given.words in fault.name]
    pairs = [(fault, paper) for fault in faults for paper in chosen if grounds[paper][fault.name]]
    lines = [
        (fault.name, paper, *noticed(fault, paper, grounds[paper][fault.name]))
        for fault, paper in tqdm(pairs, disable=None)
    ]
    _store(lines)
    silent = [f"{name}: {paper} notices nothing" for name, paper, _, what in lines if not what]
    print("\n".join(silent) or "every fault is noticed")
    return int(bool(silent))


if __name__ == "__main__":
    sys.exit(main())
