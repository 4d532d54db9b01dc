"""Change the library in one small place, and see whether a test notices; the same for many places drawn at random.

cosmic-ray finds the places and makes the changes: another operator or comparison, a number one higher or lower, a loop
that never runs, a condition turned round. Every place has the same chance, however many changes it allows. The tests of
the module's room run first, and its doctests; what they do not notice meets all other tests of the library.

    python tools/mutants.py 70 --seed 1

The same seed draws the same sample, as long as the library does not change. Some modules or folders can be drawn from
alone, and what the room does not notice can meet a few files instead of all others, which takes minutes each:

    python tools/mutants.py 24 --only simulation/ladder simulation/ring --others tests/test_compiled.py
    python tools/mutants.py 14 --only plant/safety --others --jobs 1

Each mutant is a copy of the library with the machine code of its other folders; numba compiles that of the changed
folder anew, as the file has another time. The table book/data/mutants.csv keeps what came out: killed by the tests of
its room, killed elsewhere, or killed later, since a survivor got a test; and the day of its sample. A survivor is
equivalent once a person has written there why no test can tell it from the library. Places that are no more leave the
table.
"""

from __future__ import annotations

import argparse
import ast
import csv
import difflib
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import date
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SRC, TESTS = ROOT / "src", ROOT / "tests"
TABLE = ROOT / "book" / "data" / "mutants.csv"
COLUMNS = ("module", "function", "was", "becomes", "outcome", "drawn", "reason")
KILLED, ELSEWHERE = "killed", "killed elsewhere"  # by a test of its room; by another one
LATER, SURVIVED = "killed later", "survived"  # the former by a test that it asked for
PACKAGES = ("pidalab", "paperledger")
ROOMS = (
    *("algebra", "areas", "forms", "loop", "plants", "process", "response", "roots", "search", "statespace"),
    *(
        "identification",
        "optimal",
        "reduction",
        "robustness",
        "rules",
        "simulation",
        "controllers",
        "digital",
    ),
    *("comparison", "paperledger"),
    *(
        "plant/record",
        "plant/fitting",
        "plant/safety",
        "plant/tuning",
        "plant/reporting",
        "plant/checking",
    ),
    *("plant/heater", "plant/cli", "plant/writing"),
)
NO_JUDGES = {  # in tests/: what does not judge the numbers of a copy, and why
    "fuzz": "Hypothesis draws with the numbers it finds in the library's text, so any change draws other cases",
    "outputs": "compares figures that are given",
    "site": "looks at pages that another library built",
    "test_faults.py": "plants errors of its own in the library as it is",
    "test_house.py": "reads the library's text",
    "test_mutants.py": "tries this tool",
    "test_processors.py": "imitates processors",
    "test_public_names.py": "reads the library's text",
    "test_release.py": "looks at the project's files",
}
# an operator of bits on numbers, or `is` on values, falls over anywhere; a cache that is gone changes no result
WITHOUT = re.compile(
    r"Operator_(?!Bit)\w+_(Bit\w+|\w+Shift)$|Operator_(?!Is)\w+_Is(Not)?$|Operator_Is(Not)?_(?!Is)|Invert"
    r"|RemoveDecorator|NoOp"
)
QUIET = frozenset("()[]{},.:;=") | {":=", "->", "..."}  # tokens that no operator changes
OPTIONS = "-x -q --no-header --tb=line -p no:cacheprovider -p no:nbval -p no:xdist -o addopts=--import-mode=importlib"
MEMORY = 8_000_000  # kilobytes that a run may fill; JavaScript, in the tests of the lab, reserves far more
PATIENCE, COMPILING = 10.0, 180.0  # times as long as the library; and seconds, as numba compiles

Row = dict[str, str]
Key = tuple[str, ...]
Change = tuple[str, int]  # an operator of cosmic-ray, and which of its places


@dataclass(frozen=True)
class Mutant:
    """A changed module."""

    module: Path  # below src/pidalab; of the account, below src
    function: str
    was: str
    becomes: str
    text: str

    @property
    def key(self) -> Key:
        """What names it in the table."""
        return str(self.module), self.function, self.was, self.becomes


def modules() -> list[Path]:
    """List the files that are changed."""
    found = (path.relative_to(SRC) for package in PACKAGES for path in sorted((SRC / package).rglob("*.py")))
    short = (one.relative_to("pidalab") if one.parts[0] == "pidalab" else one for one in found)
    return [one for one in short if room_of(one) in ROOMS and one.name != "__main__.py"]


def room_of(module: Path) -> str:
    """Return the part of the library that a module is in; inside the engineer's wing, the part of that."""
    return "/".join(module.parts[: 2 if module.parts[0] == "plant" else 1]).removesuffix(".py")


def place_of(module: Path) -> Path:
    """Return where a module lies in a folder of packages."""
    return module if module.parts[0] == "paperledger" else "pidalab" / module


def judges() -> list[str]:
    """List the test files that judge what a copy of the library computes."""
    found = (path.relative_to(TESTS) for path in sorted(TESTS.rglob("test_*.py")))
    return [f"tests/{path.as_posix()}" for path in found if path.parts[0] not in NO_JUDGES]


def tests_of(module: Path) -> list[str]:
    """List the test files of the room that a module is in."""
    folder, _, name = room_of(module).rpartition("/")
    return [
        path for path in judges() if re.match(rf"tests/{folder and f'{folder}/'}(test_)?{name}[/_.]", path)
    ]


def places(module: Path) -> Iterator[tuple[str, tuple[Change, ...]]]:
    """Find where a module can be changed: the function, and all changes of the same piece of its text."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.ast.ast_query import ASTQuery
    from cosmic_ray.plugins import get_operator, operator_names

    text = (SRC / place_of(module)).read_text(encoding="utf-8")
    types = [((x.lineno, x.col_offset), (x.end_lineno, x.end_col_offset)) for x in types_of(ast.parse(text))]
    classes = {name: get_operator(name) for name in operator_names() if not WITHOUT.search(name)}
    operators = {name: kind() for name, kind in classes.items() if not kind.arguments()}
    seen = dict.fromkeys(operators, 0)
    found: dict[tuple, tuple[str, list[Change]]] = {}
    for node in ast_nodes(get_ast(text)):
        if node.type == "name" or getattr(node, "value", None) in QUIET:
            continue
        for name, operator in operators.items():
            for start, end in operator.mutation_positions(node):
                if not any(first <= start and end <= last for first, last in types):
                    function = ASTQuery(node).get_definition_name() or ""
                    found.setdefault((start, end), (function, []))[1].append((name, seen[name]))
                seen[name] += 1
    return ((function, tuple(changes)) for function, changes in found.values())


def types_of(tree: ast.Module) -> Iterator[ast.expr]:
    """Find the types in a module, and the question whether to import them; nothing computes with them."""
    for node in ast.walk(tree):
        yield from filter(None, (getattr(node, "annotation", None), getattr(node, "returns", None)))
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            yield node.test


def changed(module: Path, function: str, change: Change) -> Mutant | None:
    """Make a change, unless it changes nothing or is not valid Python."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    old = (SRC / place_of(module)).read_text(encoding="utf-8")
    new = mutate_code(old, get_operator(change[0])(), change[1])
    try:
        if new is None or ast.dump(ast.parse(new)) == ast.dump(ast.parse(old)):
            return None
    except SyntaxError:
        return None
    lines = list(difflib.ndiff(old.splitlines(), new.splitlines()))
    was, becomes = (" ".join(" ".join(x[2:].split()) for x in lines if x.startswith(sign)) for sign in "-+")
    return Mutant(module, function, was, re.sub(r"(?<=[(\[]) ", "", becomes), new)


def chosen_modules(names: list[str]) -> list[Path]:
    """Choose among the files that are changed: all without names, else those that are, or lie in, what is named."""
    every = modules()
    inside = {
        name: [one for one in every if f"{one.with_suffix('')}/".startswith(f"{name}/")] for name in names
    }
    for name, found in inside.items():
        if not found:
            raise SystemExit(f"--only: no module or folder {name!r}, such as plant/safety or simulation/ring")
    return [one for one in every if not names or any(one in found for found in inside.values())]


def sample(number: int, seed: int, among: list[Path]) -> list[Mutant]:
    """Draw places of modules, and a change of each."""
    chance = random.Random(seed)
    every = [(module, *place) for module in among for place in places(module)]
    print(f"{len(every)} places", flush=True)
    drawn = (
        changed(module, name, chance.choice(some)) for module, name, some in chance.sample(every, len(every))
    )
    return [mutant for _, mutant in zip(range(number), filter(None, drawn), strict=False)]


def run(source: Path, paths: list[str], seconds: float) -> bool:
    """Whether tests and doctests pass with a copy of the library, in so many seconds of a processor at most."""
    own = {"PYTHONPATH": str(source), "OPENBLAS_NUM_THREADS": "1", "MPLBACKEND": "Agg", "PYTHONHASHSEED": "0"}
    command = [sys.executable, "-m", "pytest", *OPTIONS.split(), "--doctest-modules", *paths]
    limits = f'ulimit -d {MEMORY} -t {round(seconds)}; exec "$@"'
    command = ["bash", "-c", limits, "bash", *command]
    try:
        done = subprocess.run(
            command, cwd=ROOT, env=os.environ | own, capture_output=True, text=True, timeout=3600, check=False
        )
    except subprocess.TimeoutExpired:
        return False
    passed = done.returncode in (0, 5)  # 5: there was no test
    # stopped, or not by a test
    if not passed and not re.search(r"\d (failed|error)", done.stdout):
        print(f"status {done.returncode}: {done.stdout[-2000:]}{done.stderr[-2000:]}", flush=True)
    return passed


def outcome(base: Path, mutant: Mutant, seconds: float, later: list[str] | None = None) -> str:
    """Try a mutant in a copy of its own; what its room does not notice meets all other tests, or those given."""
    own = tests_of(mutant.module)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "copy"
        shutil.copytree(base, copy)
        changed_file = copy / place_of(mutant.module)
        changed_file.write_text(mutant.text, encoding="utf-8")
        if not run(copy, [*own, str(changed_file)], seconds):
            return KILLED
        others = [path for path in judges() if path not in own] + [str(copy)] if later is None else later
        return SURVIVED if not others or run(copy, others, seconds) else ELSEWHERE


def rows() -> dict[Key, Row]:
    """Read the table."""
    with TABLE.open(encoding="utf-8", newline="") as file:
        return {tuple(row[column] for column in COLUMNS[:4]): row for row in csv.DictReader(file)}


def store(key: Key, result: str) -> None:
    """Put a result in its row; the reason of one that still survives stays, and its first day."""
    table = rows()
    before = table.get(key, {"outcome": "", "drawn": f"{date.today()}", "reason": ""})
    if result != SURVIVED and before["outcome"] in (SURVIVED, LATER):
        result = LATER
    reason = before["reason"] if result == SURVIVED else ""
    table[key] = dict(zip(COLUMNS, (*key, result, before["drawn"], reason), strict=True))
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(row for _, row in sorted(table.items()) if exists(row))


def exists(row: Row) -> bool:
    """Whether the library still has the text that a row changes."""
    path = SRC / place_of(Path(row["module"]))
    return path.is_file() and row["was"] in " ".join(path.read_text(encoding="utf-8").split())


def main() -> int:
    """Try mutants; 1 if one survived that nobody has called equivalent."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("number", type=int, help="how many")
    parser.add_argument("--seed", type=int, default=1, help="of the sample")
    parser.add_argument(
        "--only", nargs="+", default=[], help="modules or folders to draw from", metavar="MODULE"
    )
    parser.add_argument(
        "--others", nargs="*", metavar="FILE", help="what the room does not notice meets these tests, or none"
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="mutants at a time")
    given = parser.parse_args()
    among = chosen_modules(given.only)
    chosen = sample(given.number, given.seed, among)
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(given.jobs) as pool:
        base = Path(folder)
        for package in PACKAGES:
            shutil.copytree(SRC / package, base / package)
        begun = time.monotonic()
        tests = [*judges(), str(base)]
        if given.others is not None:
            own = [path for module in among for path in tests_of(module)]
            tests = [*dict.fromkeys(own), *given.others, *(str(base / place_of(module)) for module in among)]
        if not run(base, tests, 3600.0):
            raise SystemExit("tests fail without any change, or took an hour")
        seconds = PATIENCE * (time.monotonic() - begun) + COMPILING
        print(f"{time.monotonic() - begun:.0f} s without any change", flush=True)
        results = pool.map(lambda x: outcome(base, x, seconds, given.others), chosen)
        for mutant, result in zip(chosen, results, strict=True):
            print(
                f"{result}  {mutant.module} {mutant.function}\n  - {mutant.was}\n  + {mutant.becomes}",
                flush=True,
            )
            store(mutant.key, result)
    keys = {mutant.key for mutant in chosen}
    found = [row for key, row in rows().items() if key in keys]
    counts = Counter("equivalent" if row["reason"] else row["outcome"] for row in found)
    print(f"{len(found)} mutants: {', '.join(f'{count} {name}' for name, count in counts.items())}")
    return int(counts[SURVIVED] > 0)


if __name__ == "__main__":
    sys.exit(main())
