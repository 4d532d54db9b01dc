"""Change every number that a library returns by a few parts in 100,000, and see which rows of a ledger change.

A page that takes a number from a paper or from a ledger still has the same number then. A page that takes it from the
library has another one. A row that does not change was copied, or its column ``made`` says why.

Notes
-----
State: `Shaker` counts in ``_inside`` how many calls into the package are open. Its doors replace every public function,
method and property of the package, wherever a module of the package holds it; they wrap the originals, whose code
stays.

Invariant: a door changes its result only where it opens the outermost call (``_inside`` is 0 before it and after it).
Everything within is exact: searches converge, and a number is changed once, not once for each function that it passes.
Constructors and operators are walls: exact themselves, and inside them every door is.

The change of a number x is a relative one, ``SIZE * (4 + 2 sin(phase + log|x|))``, where the phase depends on the door.
It is deterministic, between 2 and 6 times ``SIZE``, and not a common factor: quotients of two results change as well.
Whole numbers, 0 and infinities stay.

Prints are changed in the same way, by a thousand times less, when a page reads them as numbers. So the size of a change
shows where a number comes from: none (copied), as prints change (from print), or as the library does (computed). Pages
with rows that are called computed also run with changed prints and an exact library; these rows must not change then.
"""

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property, partial, wraps
from importlib import import_module
from inspect import isgenerator
from math import isfinite, isinf, log, sin
from multiprocessing import get_context
from multiprocessing.connection import wait
from pathlib import Path
from pkgutil import walk_packages
from types import FunctionType, MappingProxyType, ModuleType
from typing import Any
from zlib import crc32

import numpy as np

from paperledger.book import Ledger, recording
from paperledger.rows import Row, find_folder, making, papers
from paperledger.running import execute, pages
from paperledger.verdicts import DIGITS, Evidence, LedgerError, Relation, exponent, read_number, write

SIZE = 1e-5  # a number is off by two to six times this
PRINTS = 1e-3  # what a page reads in print is off by so much less
COPIED = 1e-9  # relative: less is the rounding of a stored number
PRINTED = 1e-6  # prints move a row by 4e-8, perhaps a few times that; the library by 2e-6 at least
WORKERS = 2
Off = Callable[[Any, str], Any]
Runs = Mapping[str, "Run"]  # by page
Handed = dict[str, tuple[Row, int]]  # by id: the row, and the cell that handed it over


@dataclass
class Shaker:
    """A package to shake, and what to leave exact.

    Parameters
    ----------
    package : str
        Name of the package whose public functions, methods and properties are the doors.
    exact : frozenset of str, optional
        Functions that only put together what they are given, such as ``demo.plant.make_plant``: off by nothing.
    fields : frozenset of str, optional
        Fields of objects that stay, such as times.
    whole : dict of str to function, optional
        By the name of a class of the package, how to shake an object of it as a whole: a function of the object and of
        `off`. By default all of its fields are shaken, each by itself.
    only_prints : bool, optional
        Leave the library exact, and shake what pages read in print: what is called computed has to stay.

    Examples
    --------
    >>> shaker = Shaker("demo")
    >>> f"{shaker.off(1.0, 'demo.gain') - 1:.1e}", f"{shaker.off(2.0, 'demo.gain') / 2 - 1:.1e}"
    ('2.5e-05', '2.0e-05')
    >>> shaker.off({"orders": [1, 2], "name": "PID"}, "demo.orders")
    {'orders': [1, 2], 'name': 'PID'}
    """

    package: str
    exact: frozenset[str] = frozenset()
    fields: frozenset[str] = frozenset()
    whole: Mapping[str, Callable[[Any, Off], Any]] = field(default_factory=dict)
    only_prints: bool = False
    _inside: int = 0

    # ------------------------------------------------------------------------------------------------ numbers

    def off(self, value: Any, key: str) -> Any:
        """Return a result slightly off; a number that is whole, 0 or infinite stays.

        Parameters
        ----------
        value : any
            A number, an array, a container of these, or an object of the package.
        key : str
            The door it leaves by.

        Returns
        -------
        any
            Of the same kind; what was given stays unchanged.
        """
        return self._walk(value, key, {})

    def _walk(self, value: Any, key: str, seen: dict[int, Any]) -> Any:
        if isinstance(value, str | bytes | bool | int | Enum | type | ModuleType | None):
            return value
        if isinstance(value, float | complex | np.inexact):
            size = float(np.abs(value))
            if not isfinite(size) or size == 0:
                return value
            kind: Any = type(value)
            return kind(value * (1 + self._part(key, log(size))))
        if id(value) in seen:
            return seen[id(value)][0]
        found = self._compound(value, key, seen)
        seen[id(value)] = found, value  # kept, so that nothing else gets its number while this goes on
        return found

    def _compound(self, value: Any, key: str, seen: dict[int, Any]) -> Any:
        if isinstance(value, np.ndarray):
            return self._array(value, key, seen)
        if isinstance(value, dict | MappingProxyType):
            return type(value)({name: self._walk(one, key, seen) for name, one in value.items()})
        if isinstance(value, tuple | list | set | frozenset):
            parts = [self._walk(one, key, seen) for one in value]
            return type(value)(*parts) if hasattr(value, "_fields") else type(value)(parts)
        if hasattr(value, "to_numpy") and hasattr(value, "iloc"):  # of pandas
            numeric = value.map if hasattr(value, "map") else value.applymap
            return numeric(lambda one: self._walk(one, key, seen))
        if isinstance(value, FunctionType):
            return self.door(value)
        if hasattr(value, "__wrapped__"):  # a compiled function
            return value
        if isgenerator(value):
            return (self._walk(one, key, {}) for one in value)
        package = type(value).__module__.partition(".")[0]
        if package == self.package and hasattr(value, "__dict__"):
            return self._object(value, key, seen)
        return value

    def _array(self, value: np.ndarray, key: str, seen: dict[int, Any]) -> np.ndarray:
        if value.dtype == object:
            flat = [self._walk(one, key, seen) for one in value.ravel()]
            return np.array(flat, object).reshape(value.shape)
        if value.dtype.kind not in "fc":
            return value
        size = np.abs(value)
        live = np.isfinite(value) & (size > 0)
        found = np.array(value)
        found[live] *= 1 + self._part(key, np.log(size[live]))
        return found

    def _object(self, value: Any, key: str, seen: dict[int, Any]) -> Any:
        for kind in type(value).__mro__:
            if whole := self.whole.get(kind.__name__):
                return whole(value, lambda one, name: self._walk(one, f"{key}.{name}", seen))
        found = object.__new__(type(value))
        seen[id(value)] = found, value
        for name, one in value.__dict__.items():
            if isinstance(getattr(type(value), name, None), property):
                continue  # a cached value, to be found anew
            kept = name in self.fields
            found.__dict__[name] = one if kept else self._walk(one, f"{key}.{name}", seen)
        return found

    def _part(self, key: str, place: Any) -> Any:
        """Return a relative perturbation, different for each function."""
        phase = crc32(key.encode()) % 6283 / 1000
        return SIZE * (4 + 2 * (np.sin if isinstance(place, np.ndarray) else sin)(phase + place))

    # ------------------------------------------------------------------------------------------------ doors

    def door(
        self, function: Callable[..., Any], call: Callable[..., Any] | None = None
    ) -> Callable[..., Any]:
        """Return a function whose result is changed if it is the outermost call; `call` may do the work for it."""
        key, work = f"{function.__module__}.{function.__qualname__}", call or function
        exact = self.wall(work)

        @wraps(function)
        def through(*args: Any, **options: Any) -> Any:
            if self._inside:
                return work(*args, **options)
            found = exact(*args, **options)
            return found if key in self.exact else self.off(found, key)

        return through

    def wall(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that is exact, and so are all calls within it: a constructor, an operator."""

        @wraps(function)
        def within(*args: Any, **options: Any) -> Any:
            self._inside += 1
            try:
                return function(*args, **options)
            finally:
                self._inside -= 1

        return within

    def put_doors(self) -> None:
        """Import the whole package, and put a door or a wall wherever a page can enter it."""
        package = import_module(self.package)
        for found in walk_packages(getattr(package, "__path__", ()), f"{self.package}."):
            if not found.name.endswith(".__main__"):
                import_module(found.name)
        doors: dict[int, Any] = {}  # by the original, which several modules may hold
        for module in [m for name, m in sys.modules.items() if name.partition(".")[0] == self.package]:
            for name, value in [*vars(module).items()]:
                home = getattr(value, "__module__", None) or ""
                if home.partition(".")[0] != self.package or "._" in home or name.startswith("_"):
                    continue
                if isinstance(value, type) and id(value) not in doors:
                    doors[id(value)] = value
                    self._put_doors_on(value)
                elif isinstance(value, FunctionType) or hasattr(value, "cache_info"):
                    setattr(module, name, doors.setdefault(id(value), self.door(value)))

    def _put_doors_on(self, kind: type) -> None:
        """Put doors on the public methods and properties of a class, and walls on its constructor and operators."""
        for name, value in [*vars(kind).items()]:
            new: Any = None
            if name.startswith("_") and name != "__call__":
                written = isinstance(value, FunctionType) and value.__code__.co_filename != "<string>"
                new = self.wall(value) if name.startswith("__") and written else None
            elif isinstance(value, FunctionType):
                new = self.door(value)
            elif isinstance(value, classmethod | staticmethod):
                new = type(value)(self.door(value.__func__))
            elif isinstance(value, property) and value.fget:
                new = property(self.door(value.fget), value.fset, value.fdel, value.__doc__)
            elif isinstance(value, cached_property):
                new = property(self.door(value.func, value.__get__))  # the object stores the exact value
            if new is not None:
                setattr(kind, name, new)


# ---------------------------------------------------------------------------------------------------- pages


@dataclass(frozen=True)
class Run:
    """The rows that one page handed over.

    Parameters
    ----------
    page : str
        Its path below the book, without suffix.
    handed : dict of str to tuple
        By id the row with what was handed over, and the number of the cell.
    wrong : tuple of str
        What stopped it, or what it did to the ledger; often nothing.

    Examples
    --------
    >>> Run("demo", {}).wrong
    ()
    """

    page: str
    handed: Handed
    wrong: tuple[str, ...] = ()


class _Print(str):
    """A printed number: exact as text, slightly off as a number."""

    shaken: float

    def __float__(self) -> float:
        return self.shaken


def _shaken_print(row: Row, shaker: Shaker) -> str:
    """Return the print of a row as a page reads it, off by an amount that differs from row to row."""
    try:
        exact = float(read_number(row.printed))
    except LedgerError:  # a statement, or a file that `check` refuses
        return row.printed
    text = _Print(row.printed)
    text.shaken = exact + PRINTS * (shaker.off(exact, row.id) - exact)
    return text


def _name(path: Path, book: Path) -> str:
    return path.relative_to(book).with_suffix("").as_posix()


def run(path: Path, book: Path, shaker: Shaker) -> Run:
    """Run one page of a book, with prints off; the library is what was imported."""
    name = _name(path, book)
    handed: Handed = {}
    number, wrong = 0, []
    with recording(partial(_shaken_print, shaker=shaker)) as opened:
        try:
            for number, _ in enumerate(execute(path), start=1):
                for one in opened:
                    handed |= {id: (row, number) for id, row in one.fresh.items() if id not in handed}
        except BaseException as error:  # a page may call exit
            first = (str(error).splitlines() or [""])[0]
            wrong.append(f"{name}: cell {number + 1} stops: {type(error).__name__}: {first[:200]}")
    plain = {id: (replace(row, printed=str(row.printed)), cell) for id, (row, cell) in handed.items()}
    return Run(name, plain, tuple(wrong))


# ---------------------------------------------------------------------------------------------------- judging


def distance(old: Row, new: Row) -> float:
    """Return the relative change of a row; for a statement that of the side that changed more.

    >>> one = Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345")
    >>> f"{distance(one, replace(one, computed='1.309812999')):.1e}"
    '5.0e-07'
    """
    identity = old.is_statement and Relation.parse(old.relation).is_identity
    if identity and Evidence.parse(new.evidence).verdict == "holds" and float(_numbers(new)[0]) <= PRINTED:
        return 0.0  # of a residual that is rounding only the decade is kept
    return max(map(_apart, _numbers(old), _numbers(new)))


def _numbers(row: Row) -> list[str]:
    """Return the computed number of a row, or the sides of the inequalities that decide a statement."""
    if not row.is_statement:
        return [row.computed]
    sides = [(one.left, one.right) for one in Evidence.parse(row.evidence).inequalities]
    return [side for pair in sides for side in pair]


def _apart(old: str, new: str) -> float:
    a, b = float(old), float(new)
    if a == b:
        return 0.0
    return float("inf") if isinf(a) or isinf(b) else abs(a - b) / max(abs(a), abs(b))


def _rounded(old: Row, new: Row) -> bool:
    """Return True if a number changed and still ends in zeros, so that it is rounded."""
    return any(
        _apart(a, b) > PRINTED and a.endswith("000") and b.endswith("000") and "." in a
        for a, b in zip(_numbers(old), _numbers(new), strict=False)
    )


def _own_print(row: Row, new: Row, shaker: Shaker) -> bool:
    """Return True if a row was handed its own print, as the page could read it."""
    if row.is_statement:
        return False
    number, read = read_number(new.computed), float(_shaken_print(row, shaker))
    digits = number.adjusted() - exponent(number) + 1 if number else DIGITS
    return new.computed == write(read, -400, max(1, digits))


def _starts_clean(row: Row) -> bool:
    """Return True if no printed number may enter a row. A statement may be about one."""
    return row.basis == "computed" and not row.is_statement


def judge(row: Row, new: Row, shaker: Shaker) -> str:
    """Return what is wrong with a row that was handed over under a shaken library; empty if nothing is.

    Parameters
    ----------
    row : Row
        As it is stored.
    new : Row
        As it was handed over while library and prints were off, or prints alone.
    shaker : Shaker
        It knows by how much each print was off.

    Returns
    -------
    str

    Examples
    --------
    >>> row = Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345")
    >>> judge(row, replace(row, computed="1.309852345"), Shaker("demo"))
    ''
    >>> judge(row, row, Shaker("demo"))
    'stays at 1.309812345'
    >>> judge(replace(row, made="page: gain"), row, Shaker("demo"))
    ''
    >>> judge(row, replace(row, computed="1.309852345"), Shaker("demo", only_prints=True))
    'moves by 3.1e-05 as prints alone are off: its basis is from-print or fitted'
    """
    far, stays, found = distance(row, new), making(row.made)[1], row.found.partition(" | ")[0]
    if shaker.only_prints:
        if not _starts_clean(row) or row.same(new):
            return ""
        return f"moves by {far:.1e} as prints alone are off: its basis is from-print or fitted"
    if _own_print(row, new, shaker):
        return "hands back its own print"
    # prints move each by another part, which may nearly cancel; then only the very same number is a copy
    if far < (COPIED if row.basis != "from-print" else 1e-12):
        return "" if stays else f"stays at {found}"
    if stays == "count" and _rounded(row, new):  # it went to the next place of its grid
        return ""
    if stays:
        return f"moves by {far:.1e}, so 'made' needs no {stays!r}"
    if _rounded(row, new):
        return f"is rounded, {found}"
    if far < PRINTED and row.basis != "from-print":
        return f"moves by {far:.1e}, as print does: its basis is from-print, not {row.basis}"
    return ""


def judged(row: Row, runs: Runs, shaker: Shaker) -> str:
    """Return what is wrong with a row, and where; empty if nothing is."""
    if row.page not in runs or row.id not in runs[row.page].handed:
        return f"{row.id}: never handed over"
    new, cell = runs[row.page].handed[row.id]
    said = judge(row, new, shaker)
    return said and f"{row.id}: {said} ({row.page}, cell {cell})"


def report(rows: Sequence[Row], shaker: Shaker, runs: Runs, exact: Runs) -> list[str]:
    """Judge rows by what their pages handed over; the first line counts, each other line is a row that is refused.

    Parameters
    ----------
    rows : sequence of Row
        The rows that some page has to hand over.
    shaker : Shaker
        What was shaken.
    runs, exact : mapping of str to Run
        The pages by name, run with library and prints off, and with an exact library and prints off.

    Returns
    -------
    list of str

    Examples
    --------
    >>> row = Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", page="demo")
    >>> new = replace(row, computed="1.309852345")
    >>> report([row], Shaker("demo"), {"demo": Run("demo", {row.id: (new, 1)})}, {})
    ['1 of 1 rows move, 0 say why they stay']
    """
    counts, wrong = {"move": 0, "stay": 0}, []
    for row in rows:
        said = judged(row, runs, shaker)
        if not said and row.page in exact:
            said = judged(row, exact, replace(shaker, only_prints=True))
        if said:
            wrong.append(said)
        else:
            counts["stay" if making(row.made)[1] else "move"] += 1
    head = f"{counts['move']} of {len(rows)} rows move, {counts['stay']} say why they stay"
    return [head + f", {len(wrong)} refused" * bool(wrong), *wrong]


def run_all(paths: Sequence[Path], book: Path, shaker: Shaker) -> dict[str, Run]:
    """Run each page in a forked process, which inherits the imports, a few at a time; return the runs by page."""
    fork, waiting = get_context("fork"), [*paths]
    running: dict[Any, tuple[str, Any]] = {}
    found: dict[str, Run] = {}
    while waiting or running:
        while waiting and len(running) < WORKERS:
            path = waiting.pop(0)
            here, there = fork.Pipe(duplex=False)
            child = fork.Process(target=lambda: there.send(run(path, book, shaker)))  # noqa: B023  # forked at once
            child.start()
            there.close()
            running[here] = _name(path, book), child
        ready: list[Any] = wait([*running])
        for end in ready:
            name, child = running.pop(end)
            try:
                found[name] = end.recv()
            except EOFError:  # the child ended without a result
                found[name] = Run(name, {}, (f"{name}: its process died",))
            child.join()
            off = "prints" if shaker.only_prints else "library"
            progress = f"[{len(found)}/{len(paths)}] {name}, {off} off"
            print("\n  ".join([progress, *found[name].wrong]), file=sys.stderr, flush=True)
    return found


def shake(
    shaker: Shaker, folder: Path | str | None, keys: Sequence[str], prepare: Callable[[], None] | None = None
) -> int:
    """Run all pages of some papers with a library that is off, print what moves; 0 if nothing is refused.

    Before that, pages with a number that is called computed run with an exact library and prints alone off: such a
    number stays then.

    Parameters
    ----------
    shaker : Shaker
        What to shake. Its package stays shaken in this process.
    folder : path, optional
        Folder of the csv files; by default as in `Ledger.open`.
    keys : sequence of str
        Papers; none for all.
    prepare : callable, optional
        What all pages need once, such as compiled code.

    Returns
    -------
    int
        0, or 1 where a row or a page is refused.

    Raises
    ------
    LedgerError
        Where processes cannot be forked, as on Windows.
    """
    if not hasattr(os, "fork"):
        raise LedgerError("to shake a library takes a system that can fork, such as Linux")
    place = find_folder(folder).resolve()
    book, chosen = place.parent, [*keys] or papers(place)
    all_rows = {paper: Ledger.open(paper, folder=place).rows.values() for paper in chosen}
    rows = {paper: [row for row in some if row.basis != "reading"] for paper, some in all_rows.items()}
    # the long ones first, so that none is left for the end
    paths = sorted({p for paper in chosen for p in pages(paper, place)}, key=lambda p: -p.stat().st_size)
    clean = {row.page for some in rows.values() for row in some if _starts_clean(row)}
    os.environ["MPLBACKEND"] = "Agg"
    import_module(shaker.package)
    if prepare:
        prepare()
    first = [path for path in paths if _name(path, book) in clean]
    exact = run_all(first, book, replace(shaker, only_prints=True))
    shaker.put_doors()
    runs = run_all(paths, book, shaker)
    wrong = [*dict.fromkeys(line for one in (*exact.values(), *runs.values()) for line in one.wrong)]
    print(*(f"{line}\n" for line in wrong), sep="", end="")
    for paper in chosen:
        head, *refused = report(rows[paper], shaker, runs, exact)
        wrong += refused
        print("\n  ".join([f"{paper}: {head}", *refused]))
    return int(bool(wrong))
