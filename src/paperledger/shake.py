"""Change every number that a library returns by a few parts in 100,000, and check which rows of a ledger change.

If a page computes a number with the library, the number changes. If a person copied the number into the page, it stays.
So the number of a row that does not change was copied, unless the column ``made`` of the row gives another reason.

Notes
-----
State: in every module of the package, wrappers replace the public functions, methods and properties. A wrapper calls
the unchanged original. ``Shaker._inside`` is the number of active calls into the package.

Invariant: a wrapper changes its result only if ``_inside`` is 0, that is, if it is the outermost call. All calls inside
the outermost call are exact. So a search inside the library converges, and each number is changed only once.
Constructors and operators are exact, and so is every call inside them.

The relative change of a number x is ``SIZE * (4 + 2 sin(phase + log|x|))``, with a phase for each function. The
change is deterministic. It varies with x, so that the quotient of two results changes as well. Whole numbers, 0 and
infinities do not change.

Printed numbers, which a page reads from its ledger, are changed in the same way but a thousand times less. So a number
computed from printed numbers changes much less than a number computed with the library. A page that computes numbers of
the basis *computed* also runs with an exact library and changed printed numbers. In this run these numbers must not
change.
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

SIZE = 1e-5  # the relative change of a number is two to six times this
PRINTS = 1e-3  # change of a printed number, divided by the change of a result of the library
# A number with a smaller relative change was copied. A change below this limit is only rounding of the stored number.
COPIED = 1e-9
# A number with a smaller relative change was computed from printed numbers. If only printed numbers change, a row
# changes by 4e-8 or a few times as much. If the library changes, a row changes by at least 2e-6.
PRINTED = 1e-6
WORKERS = 2
Off = Callable[[Any, str], Any]
Runs = Mapping[str, "Run"]  # the keys are paths of pages
Handed = dict[str, tuple[Row, int]]  # for each id, a row and the number of the cell that passed it


@dataclass
class Shaker:
    """A package whose results are changed, and the names that stay exact.

    Parameters
    ----------
    package : str
        Name of the package.
    exact : frozenset of str, optional
        Names of functions that stay exact because they only assemble their arguments, such as
        ``demo.plant.make_plant``.
    fields : frozenset of str, optional
        Names of fields that do not change when their object is changed, such as times.
    whole : dict of str to function, optional
        For the name of a class, a function that changes an object of this class as a whole. The function is called with
        the object and a function ``off(number, name)``, which returns a changed number. By default each field of an
        object is changed separately.
    only_prints : bool, optional
        True for a run in which the library is exact and only the printed numbers change. `judge` then expects that
        numbers of the basis *computed* do not change.

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
        """Return a slightly changed result.

        Parameters
        ----------
        value : any
            A number, an array, a container of these, or an object of the package.
        key : str
            Name of the function that returned the value, which determines the phase of the change.

        Returns
        -------
        any
            A changed copy of the same type.
        """
        return self._walk(value, key, {})

    def _walk(self, value: Any, key: str, copies: dict[int, Any]) -> Any:
        if isinstance(value, str | bytes | bool | int | Enum | type | ModuleType | None):
            return value
        if isinstance(value, float | complex | np.inexact):
            size = float(np.abs(value))
            if not isfinite(size) or size == 0:
                return value
            kind: Any = type(value)
            return kind(value * (1 + self._part(key, log(size))))
        if id(value) in copies:
            return copies[id(value)][0]
        result = self._compound(value, key, copies)
        copies[id(value)] = result, value  # the reference to `value` prevents reuse of its id
        return result

    def _compound(self, value: Any, key: str, copies: dict[int, Any]) -> Any:
        if isinstance(value, np.ndarray):
            return self._array(value, key, copies)
        if isinstance(value, dict | MappingProxyType):
            return type(value)({name: self._walk(item, key, copies) for name, item in value.items()})
        if isinstance(value, tuple | list | set | frozenset):
            parts = [self._walk(item, key, copies) for item in value]
            return type(value)(*parts) if hasattr(value, "_fields") else type(value)(parts)
        if hasattr(value, "to_numpy") and hasattr(value, "iloc"):  # pandas
            numeric = value.map if hasattr(value, "map") else value.applymap
            return numeric(lambda item: self._walk(item, key, copies))
        if isinstance(value, FunctionType):
            return self.perturbed(value)
        if hasattr(value, "__wrapped__"):  # a compiled function
            return value
        if isgenerator(value):
            return (self._walk(item, key, {}) for item in value)
        package = type(value).__module__.partition(".")[0]
        if package == self.package and hasattr(value, "__dict__"):
            return self._object(value, key, copies)
        return value

    def _array(self, value: np.ndarray, key: str, copies: dict[int, Any]) -> np.ndarray:
        if value.dtype == object:
            flat = [self._walk(item, key, copies) for item in value.ravel()]
            return np.array(flat, object).reshape(value.shape)
        if value.dtype.kind not in "fc":
            return value
        size = np.abs(value)
        live = np.isfinite(value) & (size > 0)
        result = np.array(value)
        result[live] *= 1 + self._part(key, np.log(size[live]))
        return result

    def _object(self, value: Any, key: str, copies: dict[int, Any]) -> Any:
        for kind in type(value).__mro__:
            if whole := self.whole.get(kind.__name__):
                return whole(value, lambda item, name: self._walk(item, f"{key}.{name}", copies))
        result = object.__new__(type(value))
        copies[id(value)] = result, value
        for name, item in value.__dict__.items():
            if isinstance(getattr(type(value), name, None), property):
                continue  # a cached value is computed again from the changed fields
            kept = name in self.fields
            result.__dict__[name] = item if kept else self._walk(item, f"{key}.{name}", copies)
        return result

    def _part(self, key: str, place: Any) -> Any:
        """Return the relative change of a number x. `key` is the name of a function, and `place` is log|x|."""
        phase = crc32(key.encode()) % 6283 / 1000
        return SIZE * (4 + 2 * (np.sin if isinstance(place, np.ndarray) else sin)(phase + place))

    # ------------------------------------------------------------------------------------------------ wrappers

    def perturbed(
        self, function: Callable[..., Any], call: Callable[..., Any] | None = None
    ) -> Callable[..., Any]:
        """Wrap a function so that the result of an outermost call is changed.

        If `call` is given, it runs instead of `function`.
        """
        key, work = f"{function.__module__}.{function.__qualname__}", call or function
        exact = self.kept_exact(work)

        @wraps(function)
        def through(*args: Any, **options: Any) -> Any:
            if self._inside:
                return work(*args, **options)
            result = exact(*args, **options)
            return result if key in self.exact else self.off(result, key)

        return through

    def kept_exact(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Wrap a function so that all calls inside it are exact."""

        @wraps(function)
        def within(*args: Any, **options: Any) -> Any:
            self._inside += 1
            try:
                return function(*args, **options)
            finally:
                self._inside -= 1

        return within

    def wrap_package(self) -> None:
        """Import the whole package, and wrap everything that a page can call."""
        package = import_module(self.package)
        for info in walk_packages(getattr(package, "__path__", ()), f"{self.package}."):
            if not info.name.endswith(".__main__"):
                import_module(info.name)
        wrapped: dict[int, Any] = {}  # the keys are ids of the originals
        for module in [m for name, m in sys.modules.items() if name.partition(".")[0] == self.package]:
            for name, value in [*vars(module).items()]:
                home = getattr(value, "__module__", None) or ""
                if home.partition(".")[0] != self.package or "._" in home or name.startswith("_"):
                    continue
                if isinstance(value, type) and id(value) not in wrapped:
                    wrapped[id(value)] = value
                    self._wrap_class(value)
                elif isinstance(value, FunctionType) or hasattr(value, "cache_info"):
                    setattr(module, name, wrapped.setdefault(id(value), self.perturbed(value)))

    def _wrap_class(self, kind: type) -> None:
        """Wrap the public methods and properties of a class, and keep its constructor and operators exact."""
        for name, value in [*vars(kind).items()]:
            new: Any = None
            if name.startswith("_") and name != "__call__":
                written = isinstance(value, FunctionType) and value.__code__.co_filename != "<string>"
                new = self.kept_exact(value) if name.startswith("__") and written else None
            elif isinstance(value, FunctionType):
                new = self.perturbed(value)
            elif isinstance(value, classmethod | staticmethod):
                new = type(value)(self.perturbed(value.__func__))
            elif isinstance(value, property) and value.fget:
                new = property(self.perturbed(value.fget), value.fset, value.fdel, value.__doc__)
            elif isinstance(value, cached_property):
                new = property(self.perturbed(value.func, value.__get__))  # the object caches the exact value
            if new is not None:
                setattr(kind, name, new)


# ---------------------------------------------------------------------------------------------------- pages


@dataclass(frozen=True)
class Run:
    """Rows that one page passed to its ledgers in a run.

    Parameters
    ----------
    page : str
        Path of the page below the folder of the book, without suffix.
    handed : dict of str to tuple
        For each id, the row with the passed value, and the number of the cell.
    wrong : tuple of str
        Errors that stopped the page.

    Examples
    --------
    >>> Run("demo", {}).wrong
    ()
    """

    page: str
    handed: Handed
    wrong: tuple[str, ...] = ()


class _Print(str):
    """Printed number whose text is unchanged, and whose float is slightly changed."""

    shaken: float

    def __float__(self) -> float:
        return self.shaken


def _shaken_print(row: Row, shaker: Shaker) -> str:
    """Return the printed value of a row. Its float has a small change, which differs from row to row."""
    try:
        exact = float(read_number(row.printed))
    except LedgerError:  # a statement, or a row that `check` refuses
        return row.printed
    text = _Print(row.printed)
    text.shaken = exact + PRINTS * (shaker.off(exact, row.id) - exact)
    return text


def _name(path: Path, book: Path) -> str:
    return path.relative_to(book).with_suffix("").as_posix()


def run(path: Path, book: Path, shaker: Shaker) -> Run:
    """Run one page of a book with changed printed numbers."""
    name = _name(path, book)
    handed: Handed = {}
    number, wrong = 0, []
    with recording(partial(_shaken_print, shaker=shaker)) as opened:
        try:
            for number, _ in enumerate(execute(path), start=1):
                for ledger in opened:
                    handed |= {id: (row, number) for id, row in ledger.fresh.items() if id not in handed}
        except BaseException as error:  # a page may call exit
            first = (str(error).splitlines() or [""])[0]
            wrong.append(f"{name}: cell {number + 1} stops: {type(error).__name__}: {first[:200]}")
    plain = {id: (replace(row, printed=str(row.printed)), cell) for id, (row, cell) in handed.items()}
    return Run(name, plain, tuple(wrong))


# ---------------------------------------------------------------------------------------------------- judging


def distance(old: Row, new: Row) -> float:
    """Return the relative change of a number. For a statement, return the largest change of a side of its inequalities.

    >>> one = Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345")
    >>> f"{distance(one, replace(one, computed='1.309812999')):.1e}"
    '5.0e-07'
    """
    identity = old.is_statement and Relation.parse(old.relation).is_identity
    if identity and Evidence.parse(new.evidence).verdict == "holds" and float(_numbers(new)[0]) <= PRINTED:
        return 0.0  # the size of a rounding error may change
    return max(map(_apart, _numbers(old), _numbers(new)))


def _numbers(row: Row) -> list[str]:
    """Return the computed number of a row, or both sides of each inequality of a statement."""
    if not row.is_statement:
        return [row.computed]
    sides = [(inequality.left, inequality.right) for inequality in Evidence.parse(row.evidence).inequalities]
    return [side for pair in sides for side in pair]


def _apart(old: str, new: str) -> float:
    a, b = float(old), float(new)
    if a == b:
        return 0.0
    return float("inf") if isinf(a) or isinf(b) else abs(a - b) / max(abs(a), abs(b))


def _rounded(old: Row, new: Row) -> bool:
    """Return True if a number seems to be rounded by the page: it changed, but ends in zeros before and after."""
    return any(
        _apart(a, b) > PRINTED and a.endswith("000") and b.endswith("000") and "." in a
        for a, b in zip(_numbers(old), _numbers(new), strict=False)
    )


def _own_print(row: Row, new: Row, shaker: Shaker) -> bool:
    """Return True if the computed number of a row is only its printed number, with the small change of this run."""
    if row.is_statement:
        return False
    number, read = read_number(new.computed), float(_shaken_print(row, shaker))
    digits = number.adjusted() - exponent(number) + 1 if number else DIGITS
    return new.computed == write(read, -400, max(1, digits))


def _starts_clean(row: Row) -> bool:
    """Return True if printed numbers must not affect a row. A statement may depend on printed numbers."""
    return row.basis == "computed" and not row.is_statement


def judge(row: Row, new: Row, shaker: Shaker) -> str:
    """Return the error of a row in a changed run, or an empty text if the row is in order.

    Parameters
    ----------
    row : Row
        The stored row.
    new : Row
        The same row from a run with changed printed numbers. The library was also changed, unless `only_prints`.
    shaker : Shaker
        Shaker of that run.

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
    'moves by 3.1e-05 when only printed numbers change: the basis must be from-print or fitted'
    """
    far, stays, value = distance(row, new), making(row.made)[1], row.found.partition(" | ")[0]
    if shaker.only_prints:
        if not _starts_clean(row) or row.same(new):
            return ""
        return f"moves by {far:.1e} when only printed numbers change: the basis must be from-print or fitted"
    if _own_print(row, new, shaker):
        return "is its own printed number"
    # The changes of several printed numbers may nearly cancel, so the limit is smaller for the basis from-print.
    if far < (COPIED if row.basis != "from-print" else 1e-12):
        return "" if stays else f"stays at {value}"
    if stays == "count" and _rounded(row, new):  # the value moved to the next point of a grid
        return ""
    if stays:
        return f"moves by {far:.1e}, so remove {stays!r} from 'made'"
    if _rounded(row, new):
        return f"is rounded by the page, {value}"
    if far < PRINTED and row.basis != "from-print":
        return f"moves by only {far:.1e}, like the printed numbers: declare from-print, not {row.basis}"
    return ""


def judged(row: Row, runs: Runs, shaker: Shaker) -> str:
    """Return the error of a row with its page and cell, or an empty text if the row is in order."""
    if row.page not in runs or row.id not in runs[row.page].handed:
        return f"{row.id}: never handed over"
    new, cell = runs[row.page].handed[row.id]
    said = judge(row, new, shaker)
    return said and f"{row.id}: {said} ({row.page}, cell {cell})"


def report(rows: Sequence[Row], shaker: Shaker, runs: Runs, exact: Runs) -> list[str]:
    """Judge rows by the runs of their pages.

    Parameters
    ----------
    rows : sequence of Row
        Stored rows. Pages must give new values for all of them.
    shaker : Shaker
        Shaker of the runs.
    runs : mapping of str to Run
        Runs by page, with changed library and printed numbers.
    exact : mapping of str to Run
        Runs of some pages with an exact library and changed printed numbers.

    Returns
    -------
    list of str
        A line with the counts, then a line for each row that is refused.

    Examples
    --------
    >>> row = Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", page="demo")
    >>> new = replace(row, computed="1.309852345")
    >>> report([row], Shaker("demo"), {"demo": Run("demo", {row.id: (new, 1)})}, {})
    ['1 of 1 rows move, 0 need not move']
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
    head = f"{counts['move']} of {len(rows)} rows move, {counts['stay']} need not move"
    return [head + f", {len(wrong)} refused" * bool(wrong), *wrong]


def run_all(paths: Sequence[Path], book: Path, shaker: Shaker) -> dict[str, Run]:
    """Run pages in forked processes, at most `WORKERS` at a time. Return the run of each page."""
    fork, waiting = get_context("fork"), [*paths]
    running: dict[Any, tuple[str, Any]] = {}
    results: dict[str, Run] = {}
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
                results[name] = end.recv()
            except EOFError:  # the child ended without a result
                results[name] = Run(name, {}, (f"{name}: its process died",))
            child.join()
            off = "printed numbers" if shaker.only_prints else "library"
            progress = f"[{len(results)}/{len(paths)}] {name}, changed {off}"
            print("\n  ".join([progress, *results[name].wrong]), file=sys.stderr, flush=True)
    return results


def shake(
    shaker: Shaker, folder: Path | str | None, keys: Sequence[str], prepare: Callable[[], None] | None = None
) -> int:
    """Run all pages of some papers with a changed library. Print how many rows change, and which rows are refused.

    Parameters
    ----------
    shaker : Shaker
        The package to change. Its functions stay wrapped until the process ends.
    folder : path, optional
        Folder of the csv files. By default as in `Ledger.open`.
    keys : sequence of str
        Keys of papers. If empty, all papers are used.
    prepare : callable, optional
        Function to call once before the pages run, for example to compile code.

    Returns
    -------
    int
        1 if a row or a page is refused, otherwise 0.

    Raises
    ------
    LedgerError
        If the system cannot fork processes (for example Windows).
    """
    if not hasattr(os, "fork"):
        raise LedgerError("shake needs a system that can fork processes, such as Linux")
    place = find_folder(folder).resolve()
    book, chosen = place.parent, [*keys] or papers(place)
    all_rows = {paper: Ledger.open(paper, folder=place).rows.values() for paper in chosen}
    rows = {paper: [row for row in some if row.basis != "reading"] for paper, some in all_rows.items()}
    # Start long pages first, so that none runs alone at the end.
    paths = sorted({p for paper in chosen for p in pages(paper, place)}, key=lambda p: -p.stat().st_size)
    clean = {row.page for some in rows.values() for row in some if _starts_clean(row)}
    os.environ["MPLBACKEND"] = "Agg"
    import_module(shaker.package)
    if prepare:
        prepare()
    first = [path for path in paths if _name(path, book) in clean]
    exact = run_all(first, book, replace(shaker, only_prints=True))
    shaker.wrap_package()
    runs = run_all(paths, book, shaker)
    wrong = [*dict.fromkeys(line for each in (*exact.values(), *runs.values()) for line in each.wrong)]
    print(*(f"{line}\n" for line in wrong), sep="", end="")
    for paper in chosen:
        head, *refused = report(rows[paper], shaker, runs, exact)
        wrong += refused
        print("\n  ".join([f"{paper}: {head}", *refused]))
    return int(bool(wrong))
