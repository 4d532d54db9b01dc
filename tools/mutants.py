"""Change the library in one small place, and see whether a test notices; the same for many places drawn at random.

cosmic-ray finds the places and makes the changes: another operator or comparison, a number one higher or lower, a loop
that never runs, a condition turned round. Every place has the same chance, however many changes it allows.
`tests/test_house.py` says which tests are those of a module; its doctests run with them. What these do not notice meets
all other tests and doctests of the library, quick ones first.

    python tools/mutants.py 70 --seed 1               # a sample
    python tools/mutants.py 20 --seed 1 simulation    # of modules whose path has this word
    python tools/mutants.py again                     # what survived so far, with the tests of today

Each mutant is a copy of the library with the machine code of its other folders; numba compiles that of the changed
folder anew, as the file has another time. The table book/data/mutants.csv keeps what came out: killed by its own tests,
killed elsewhere, or killed later, since a survivor got a test; and the day of its sample, from the day on when that was
kept. A survivor is equivalent once a person has written there
why no test can tell it from the library. Places that are no more leave the table.
"""

from __future__ import annotations

import argparse
import ast
import csv
import difflib
import importlib.util
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
from functools import cache, partial
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parents[1]
SRC, TESTS = ROOT / "src" / "pidalab", ROOT / "tests"
TABLE = ROOT / "book" / "data" / "mutants.csv"
COLUMNS = ("module", "function", "was", "becomes", "outcome", "drawn", "reason")
KILLED, ELSEWHERE = "killed", "killed elsewhere"  # by a test of its module; by another one
LATER, SURVIVED = "killed later", "survived"  # the former by a test that it asked for
WHAT_LOOPS_ARE = ("algebra", "areas", "forms", "loop", "plants", "process", "response", "roots", "statespace")
METHODS = ("identification", "optimal", "record", "reduction", "robustness", "rules", "simulation")
ROOMS = (*WHAT_LOOPS_ARE, *METHODS, "controllers", "digital", "ledger")
NO_JUDGES = {  # in tests/: what does not judge the numbers of a copy, and why
    "fuzz": "Hypothesis draws with the numbers it finds in the library's text, so any change draws other cases",
    "site": "looks at pages that another library built",
    "test_house.py": "reads the library's text",
    "test_mutants.py": "tries this tool",
    "test_public_names.py": "reads the library's text",
    "test_release.py": "looks at the project's files",
}
# an operator of bits on numbers, or `is` on values, falls over anywhere; a cache that is gone changes no result
WITHOUT = re.compile(
    r"Operator_(?!Bit)\w+_(Bit\w+|\w+Shift)$|Operator_(?!Is)\w+_Is(Not)?$|Operator_Is(Not)?_(?!Is)|Invert"
    r"|RemoveDecorator|NoOp"
)
QUIET = frozenset("()[]{},.:;=") | {":=", "->", "..."}  # tokens that no operator changes
OPTIONS = (
    "-q --no-header --tb=line -p no:cacheprovider -p no:nbval -p no:xdist -o addopts=--import-mode=importlib"
)
MEMORY = 8_000_000  # kilobytes that a run may fill; JavaScript, in the tests of the lab, reserves far more
PATIENCE, COMPILING = 10.0, 180.0  # times as long as the library; and seconds, as numba compiles
HANGING = 3600  # seconds by the clock

Row = dict[str, str]
Span = tuple[tuple[int, int], tuple[int, int]]  # lines and columns


@dataclass(frozen=True)
class Place:
    """Where a module can be changed: all changes of the same piece of its text."""

    module: Path  # below src/pidalab
    function: str
    start: tuple[int, int]
    changes: tuple[tuple[str, int], ...]  # operators of cosmic-ray, and which of their places this is


@dataclass(frozen=True)
class Mutant:
    """A changed module."""

    module: Path
    function: str
    was: str
    becomes: str
    text: str

    @property
    def key(self) -> tuple[str, ...]:
        """What names it in the table."""
        return str(self.module), self.function, self.was, self.becomes


def modules() -> list[Path]:
    """List the files that are changed."""
    found = (path.relative_to(SRC) for path in sorted(SRC.rglob("*.py")))
    return [
        path for path in found if path.parts[0].removesuffix(".py") in ROOMS and path.name != "__main__.py"
    ]


@cache
def house() -> dict[str, tuple[str, str]]:
    """Return the modules that are tested with another one, as the test of the house has them."""
    spec = importlib.util.spec_from_file_location("house", TESTS / "test_house.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.TESTED_WITH


def tests_of(module: Path) -> list[str]:
    """List the test files of a module: first those that mirror it; for the ledger then all of the ledger."""
    inner = module.parent if module.name == "__init__.py" else module.with_suffix("")
    other = house().get(str(inner), (str(inner.parent / f"test_{inner.name.removeprefix('_')}.py"),))[0]
    found = sorted((TESTS / other).parent.glob(f"{Path(other).stem}*.py"))
    if module.parts[0] == "ledger" or not found:
        found += sorted((TESTS / module.parts[0]).glob("test_*.py"))
    names = (path.relative_to(ROOT).as_posix() for path in found)
    return list(dict.fromkeys(names))


def judges() -> list[str]:
    """List the test files that judge what a copy of the library computes."""
    found = (path.relative_to(TESTS) for path in sorted(TESTS.rglob("test_*.py")))
    return [f"tests/{path.as_posix()}" for path in found if path.parts[0] not in NO_JUDGES]


def types_of(tree: ast.Module) -> Iterator[ast.expr]:
    """Find the types in a module, and the question whether to import them; nothing computes with them."""
    for node in ast.walk(tree):
        yield from filter(None, (getattr(node, "annotation", None), getattr(node, "returns", None)))
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            yield node.test


def places(module: Path) -> list[Place]:
    """Find where a module can be changed."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.ast.ast_query import ASTQuery
    from cosmic_ray.plugins import get_operator, operator_names

    text = (SRC / module).read_text(encoding="utf-8")
    types = [
        ((one.lineno, one.col_offset), (one.end_lineno, one.end_col_offset))
        for one in types_of(ast.parse(text))
    ]
    classes = {name: get_operator(name) for name in operator_names() if not WITHOUT.search(name)}
    operators = {name: kind() for name, kind in classes.items() if not kind.arguments()}
    seen = dict.fromkeys(operators, 0)
    found: dict[Span, list[tuple[str, int]]] = {}
    functions: dict[Span, str] = {}
    for node in ast_nodes(get_ast(text)):
        if node.type == "name" or getattr(node, "value", None) in QUIET:
            continue
        for name, operator in operators.items():
            for span in operator.mutation_positions(node):
                found.setdefault(span, []).append((name, seen[name]))
                functions[span] = ASTQuery(node).get_definition_name() or ""
                seen[name] += 1
    return [
        Place(module, functions[span], span[0], tuple(changes))
        for span, changes in found.items()
        if not any(first <= span[0] and span[1] <= last for first, last in types)
    ]


def changed(place: Place, change: tuple[str, int]) -> Mutant | None:
    """Make a change, unless it is none or no program."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    old = (SRC / place.module).read_text(encoding="utf-8")
    new = mutate_code(old, get_operator(change[0])(), change[1])
    try:
        if new is None or ast.dump(ast.parse(new)) == ast.dump(ast.parse(old)):
            return None
    except SyntaxError:
        return None
    lines = list(difflib.ndiff(old.splitlines(), new.splitlines()))
    was, becomes = (" ".join(" ".join(x[2:].split()) for x in lines if x.startswith(sign)) for sign in "-+")
    return Mutant(place.module, place.function, was, re.sub(r"(?<=[(\[]) ", "", becomes), new)


def sample(number: int, seed: int, word: str) -> list[Mutant]:
    """Draw places, and a change of each."""
    chance = random.Random(seed)
    every = [place for module in modules() if word in str(module) for place in places(module)]
    print(f"{len(every)} places", flush=True)
    found: list[Mutant] = []
    for place in chance.sample(every, len(every)):
        if len(found) == number:
            break
        mutant = changed(place, chance.choice(place.changes))
        if mutant is not None:
            found.append(mutant)
    return found


def survivors(word: str) -> list[Mutant]:
    """Make those again that the table calls survivors."""
    wanted = {key(row): row for row in rows() if row["outcome"] == SURVIVED and word in row["module"]}
    found: dict[tuple[str, ...], Mutant] = {}
    for module in sorted({row["module"] for row in wanted.values()}):
        texts = [row["was"] for row in wanted.values() if row["module"] == module]
        lines = (SRC / module).read_text(encoding="utf-8").splitlines()
        for place in places(Path(module)):
            line = " ".join(lines[place.start[0] - 1].split())
            if any(line in text or text in line for text in texts):
                made = (changed(place, change) for change in place.changes)
                found |= {one.key: one for one in made if one is not None and one.key in wanted}
    return list(found.values())


def run(source: Path, paths: list[str], patience: float, *more: str) -> int:
    """Run tests with a copy of the library, for so many seconds of a processor at most."""
    own = {"PYTHONPATH": str(source), "OPENBLAS_NUM_THREADS": "1", "MPLBACKEND": "Agg", "PYTHONHASHSEED": "0"}
    command = [sys.executable, "-m", "pytest", *OPTIONS.split(), *more, *paths]
    limits = f'ulimit -d {MEMORY} -t {round(patience)}; exec "$@"'
    with tempfile.TemporaryFile() as said:
        done = subprocess.run(
            ["bash", "-c", limits, "bash", *command],
            cwd=ROOT,
            env=os.environ | own,
            stdout=said,
            stderr=said,
            timeout=HANGING,
            check=False,
        )
        said.seek(0)
        text = said.read().decode()
    if done.returncode and not re.search(r"\d (failed|error)", text):  # stopped, or none of pytest's doing
        print(f"status {done.returncode}: {text[-2000:]}", flush=True)
    return done.returncode


def doctests(source: Path, module: Path) -> list[str]:
    """Return what makes pytest run the examples of a module of a copy, or of all."""
    return ["--doctest-modules", str(source / "pidalab" / module)]


def times(source: Path) -> dict[str, float]:
    """Run all that judges with the library as it is; seconds of each test file.

    Raises
    ------
    SystemExit
        If a test fails already.
    """
    report = source / "times.xml"
    seconds = dict.fromkeys(judges(), 0.0)
    if run(source, [*seconds, *doctests(source, Path())], 3600.0, f"--junitxml={report}") != 0:
        raise SystemExit("tests fail without any change, or took an hour")
    for case in ElementTree.parse(report).iter("testcase"):
        path = (case.get("classname") or "").replace(".", "/") + ".py"
        if path in seconds:
            seconds[path] += float(case.get("time") or 0)
    return seconds


def notices(source: Path, seconds: dict[str, float], paths: list[str], module: Path = Path()) -> bool:
    """Whether test files or examples of a module, or of all, fail with a copy or take far longer than they should."""
    patience = PATIENCE * sum(seconds[path] for path in paths) + COMPILING
    try:
        return run(source, [*paths, *doctests(source, module)], patience, "-x") != 0
    except subprocess.TimeoutExpired:
        return True


def judged(source: Path, seconds: dict[str, float], module: Path) -> str:
    """Say what notices the changed module of a copy: its own tests, else the others, quick ones first."""
    own = tests_of(module)
    if notices(source, seconds, own, module):
        return KILLED
    others = sorted({*seconds} - {*own}, key=lambda path: seconds[path])
    return ELSEWHERE if notices(source, seconds, others) else SURVIVED


def outcome(base: Path, seconds: dict[str, float], mutant: Mutant) -> str:
    """Try a mutant in a copy of its own."""
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder)
        shutil.copytree(base / "pidalab", source / "pidalab")
        (source / "pidalab" / mutant.module).write_text(mutant.text, encoding="utf-8")
        result = judged(source, seconds, mutant.module)
    print(
        f"{result} {time.monotonic() - begun:.0f} s  {mutant.module} {mutant.function}\n"
        f"  - {mutant.was}\n  + {mutant.becomes}",
        flush=True,
    )
    return result


def key(row: Row) -> tuple[str, ...]:
    """What names a row of the table."""
    return tuple(row[column] for column in COLUMNS[:4])


def rows() -> list[Row]:
    """Read the table."""
    if not TABLE.is_file():
        return []
    with TABLE.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def store(found: list[Row]) -> None:
    """Put rows in the place of older ones of the same change; what they were equivalent for stays with survivors."""
    old = {key(row): row for row in rows()}
    for row in found:
        before = old.get(key(row), {"outcome": "", "drawn": row["drawn"], "reason": ""})
        survived = row["outcome"] == SURVIVED
        later = not survived and before["outcome"] in (SURVIVED, LATER)
        new = {"outcome": LATER if later else row["outcome"], "reason": before["reason"] if survived else ""}
        old[key(row)] = row | new | {"drawn": before["drawn"]}
    kept = [row for row in old.values() if stands(row)]
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(sorted(kept, key=key))


def stands(row: Row) -> bool:
    """Whether the library still has the text that a row changes."""
    path = SRC / row["module"]
    return path.is_file() and row["was"] in " ".join(path.read_text(encoding="utf-8").split())


def main() -> int:
    """Try mutants; 1 if one survived that nobody has called equivalent."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("number", help="how many, or the word again")
    parser.add_argument("word", nargs="?", default="", help="part of the paths of modules; by default all")
    parser.add_argument("--seed", type=int, default=1, help="of the sample")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="mutants at the same time")
    given = parser.parse_intermixed_args()
    chosen = (
        survivors(given.word)
        if given.number == "again"
        else sample(int(given.number), given.seed, given.word)
    )
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(given.jobs) as pool:
        base = Path(folder)
        shutil.copytree(SRC, base / "pidalab")
        tried = partial(outcome, base, times(base))
        for mutant, result in zip(chosen, pool.map(tried, chosen), strict=True):
            store([dict(zip(COLUMNS, (*mutant.key, result, f"{date.today()}", ""), strict=True))])
    keys = {mutant.key for mutant in chosen}
    found = [row for row in rows() if key(row) in keys]
    alive = [row for row in found if row["outcome"] == SURVIVED and not row["reason"]]
    counts = Counter("equivalent" if row["reason"] else row["outcome"] for row in found)
    print(f"{len(found)} mutants: {', '.join(f'{count} {name}' for name, count in counts.items())}")
    return int(bool(alive))


if __name__ == "__main__":
    sys.exit(main())
