"""Change every number that a library returns by a few parts in 100,000, and see which rows of a ledger change.

A page that takes a number from a paper, or from a ledger, still has the same number then. A page that takes it from the
library has another one. `Shaker` changes the modules of a package while they are imported; their files stay.

Only the result of the outermost call is changed. Calls within the package are exact, so that searches converge, and so
is compiled code. The change is not a common factor: quotients of two results change as well.

A row that does not change was copied, or its column ``made`` says why.
"""

import ast
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import wraps
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from inspect import isgenerator
from math import isfinite, isinf, log, sin
from multiprocessing import get_context
from multiprocessing.connection import wait
from pathlib import Path
from types import FunctionType, MappingProxyType, ModuleType
from typing import Any
from zlib import crc32

import numpy as np

from paperledger.book import Ledger, recording
from paperledger.digits import DIGITS, LedgerError, exponent, read_number, write
from paperledger.rows import Making, Row, find_folder, papers
from paperledger.running import execute, pages
from paperledger.statements import Evidence, Relation

SIZE = 1e-5  # a number is off by two to six times this
PRINTS = 1e-3  # what a page reads in print is off by so much less
CACHED = "cached_property"
SHOWN = ("__call__",)  # of the names with underscores these are doors
LEFT = ("setter", "deleter", "overload", "contextmanager")  # decorators of what is no door
Off = Callable[[Any, str], Any]
COPIED = 1e-9  # relative: less is the rounding of a stored number
PRINTED = 1e-6  # prints move a row by 4e-8, perhaps a few times that; the library by 2e-6 at least
WORKERS = 2
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
    compiled : frozenset of str, optional
        Decorators of functions that are compiled, which stay as they are.
    left : frozenset of str, optional
        Names of classes of the package whose objects stay as they are, such as compiled functions.
    size : float, optional
        How much.
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
    compiled: frozenset[str] = frozenset()
    left: frozenset[str] = frozenset()
    size: float = SIZE
    only_prints: bool = False
    used: set[str] = field(default_factory=set)
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
        if isinstance(value, dict):
            return type(value)((name, self._walk(one, key, seen)) for name, one in value.items())
        if isinstance(value, MappingProxyType):
            return MappingProxyType({name: self._walk(one, key, seen) for name, one in value.items()})
        if isinstance(value, tuple | list | set | frozenset):
            parts = [self._walk(one, key, seen) for one in value]
            return type(value)(*parts) if hasattr(value, "_fields") else type(value)(parts)
        if hasattr(value, "to_numpy") and hasattr(value, "iloc"):  # of pandas
            numeric = value.map if hasattr(value, "map") else value.applymap
            return numeric(lambda one: self._walk(one, key, seen))
        if isinstance(value, FunctionType):
            return self.door(value)
        if isgenerator(value):
            return (self._walk(one, key, {}) for one in value)
        package = type(value).__module__.partition(".")[0]
        if package == self.package and hasattr(value, "__dict__") and type(value).__name__ not in self.left:
            return self._object(value, key, seen)
        return value

    def _array(self, value: np.ndarray, key: str, seen: dict[int, Any]) -> np.ndarray:
        if value.dtype == object:
            return np.array([self._walk(one, key, seen) for one in value.ravel()], object).reshape(
                value.shape
            )
        if value.dtype.kind not in "fc":
            return value
        size = np.abs(value)
        live = np.isfinite(value) & (size > 0)
        found = np.array(value)
        found[live] *= 1 + self._part(key, np.log(size[live]))
        found.setflags(write=value.flags.writeable)
        return found

    def _object(self, value: Any, key: str, seen: dict[int, Any]) -> Any:
        for kind in type(value).__mro__:
            if kind.__name__ in self.whole:
                return self.whole[kind.__name__](
                    value, lambda one, name: self._walk(one, f"{key}.{name}", seen)
                )
        found = object.__new__(type(value))
        seen[id(value)] = found, value
        for name, one in value.__dict__.items():
            if isinstance(getattr(type(value), name, None), _CachedDoor):
                continue  # to be found anew
            kept = name in self.fields
            found.__dict__[name] = one if kept else self._walk(one, f"{key}.{name}", seen)
        return found

    def _part(self, key: str, place: Any) -> Any:
        """Return a relative perturbation, different for each function."""
        phase = crc32(key.encode()) % 6283 / 1000
        return self.size * (4 + 2 * (np.sin if isinstance(place, np.ndarray) else sin)(phase + place))

    # ------------------------------------------------------------------------------------------------ doors

    def door(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function whose result is changed if it is the outermost call."""
        key = f"{function.__module__}.{function.__qualname__}"

        @wraps(function)
        def through(*args: Any, **options: Any) -> Any:
            return self._leave(key, lambda: function(*args, **options))

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

    def _leave(self, key: str, call: Callable[[], Any]) -> Any:
        if self._inside:
            return call()
        if key in self.exact:
            return self.wall(call)()
        self.used.add(key)
        self._inside += 1
        try:
            found = call()
        finally:
            self._inside -= 1
        return self.off(found, key)

    @contextmanager
    def shaking(self) -> Iterator[None]:
        """Import the package with doors; it must not have been imported before."""
        if self.package in sys.modules:
            raise ImportError(f"{self.package} was imported before it could be shaken")
        finder = _Finder(self)
        sys.meta_path.insert(0, finder)
        try:
            yield
        finally:
            sys.meta_path.remove(finder)


class _CachedDoor:
    """A cached property that stores the exact value and returns a changed one outside the package."""

    def __init__(self, shaker: Shaker, function: Callable[[Any], Any]) -> None:
        self.shaker, self.function, self.name = shaker, function, function.__name__
        self.__doc__ = function.__doc__

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        if instance is None:
            return self

        def exact() -> Any:
            if self.name not in instance.__dict__:
                instance.__dict__[self.name] = self.function(instance)
            return instance.__dict__[self.name]

        return self.shaker._leave(f"{self.function.__module__}.{self.function.__qualname__}", exact)

    def __set__(self, instance: Any, value: Any) -> None:
        instance.__dict__[self.name] = value


class _Doors(ast.NodeTransformer):
    """Put a door on each public function, method and property of a module; functions in functions are private."""

    def __init__(self, shaker: Shaker) -> None:
        self.compiled, self.left = shaker.compiled, shaker.left

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        return node if node.name in self.left else self.generic_visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        words = [ast.unparse(one) for one in node.decorator_list]
        heads = {word.partition("(")[0].rpartition(".")[2] for word in words}
        if heads & {*self.compiled, *LEFT}:
            return node
        if node.name.startswith("__") and node.name not in SHOWN and not words:
            node.decorator_list = [ast.Name("__wall__", ast.Load())]
        elif node.name.startswith("_") and node.name not in SHOWN:
            return node
        elif CACHED in heads:
            node.decorator_list = [ast.Name("__cached_door__", ast.Load())]
        else:  # outside of a cache, else inside of all
            place = 0 if any("cache" in head for head in heads) else len(words)
            node.decorator_list.insert(place, ast.Name("__door__", ast.Load()))
        return ast.fix_missing_locations(node)


class _Loader(SourceFileLoader):
    """Load a module with doors, without writing byte code."""

    shaker: Shaker

    def get_code(self, fullname: str) -> Any:
        path = self.get_filename(fullname)
        tree = ast.parse(self.get_data(path))
        if not any(part.startswith("_") for part in fullname.split(".")):  # else it is nobody's door
            tree = _Doors(self.shaker).visit(tree)
        return compile(tree, path, "exec", dont_inherit=True)

    def exec_module(self, module: ModuleType) -> None:
        shaker = self.shaker
        module.__dict__["__door__"] = shaker.door
        module.__dict__["__wall__"] = shaker.wall
        module.__dict__["__cached_door__"] = lambda function: _CachedDoor(shaker, function)
        shaker._inside += 1  # what the package gives to itself while it is imported
        try:
            super().exec_module(module)
        finally:
            shaker._inside -= 1
            for name in ("__door__", "__wall__", "__cached_door__"):  # no page sees that it is shaken
                del module.__dict__[name]


class _Finder(MetaPathFinder):
    def __init__(self, shaker: Shaker) -> None:
        self.shaker = shaker

    def find_spec(self, fullname: str, path: Any, target: Any = None) -> ModuleSpec | None:
        if fullname.partition(".")[0] != self.shaker.package:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _Loader(spec.loader.name, spec.loader.path)
            spec.loader.shaker = self.shaker
        return spec


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


@contextmanager
def shaken_prints(shaker: Shaker) -> Iterator[None]:
    """Let pages read printed numbers that are slightly off, each by another part.

    >>> with shaken_prints(Shaker("demo")):
    ...     book = Ledger(Path("demo.csv"), [Row("demo.kp", "Table 1", "gain", "2.0")])
    ...     f"{book.printed('kp') / 2 - 1:.0e}", book.row("kp").printed
    ('4e-08', '2.0')
    """
    init, printed = Ledger.__init__, Ledger.printed

    def opened(book: Ledger, path: Path, rows: Sequence[Row], *rest: Any) -> None:
        init(book, path, [_with_print(row, shaker) for row in rows], *rest)

    def read(book: Ledger, id: str) -> float:
        exact, row = printed(book, id), book.row(id)
        return float(row.printed) if isinstance(row.printed, _Print) else exact

    known: Any = Ledger
    known.__init__, known.printed = opened, read
    try:
        yield
    finally:
        known.__init__, known.printed = init, printed


def _with_print(row: Row, shaker: Shaker) -> Row:
    if row.is_statement:
        return row
    try:
        exact = float(read_number(row.printed))
    except LedgerError:  # the file is wrong, and `check` says so
        return row
    text = _Print(row.printed)
    text.shaken = exact + PRINTS * (shaker.off(exact, row.id) - exact)
    return replace(row, printed=text)


def _name(path: Path, book: Path) -> str:
    return path.relative_to(book).with_suffix("").as_posix()


def run(path: Path, book: Path, shaker: Shaker) -> Run:
    """Run one page of a book, with prints off; the library is what was imported."""
    name = _name(path, book)
    handed: Handed = {}
    number, wrong = 0, []
    with recording() as opened, shaken_prints(shaker):
        before = _account()
        try:
            for number, _ in enumerate(execute(path), start=1):
                for one in opened:
                    handed |= {id: (row, number) for id, row in one.fresh.items() if id not in handed}
        except BaseException as error:  # a page may call exit
            first = (str(error).splitlines() or [""])[0]
            wrong.append(f"{name}: cell {number + 1} stops: {type(error).__name__}: {first[:200]}")
        after = _account()
        if len(after) < len(before) or any(after.get(key) is not value for key, value in before.items()):
            wrong.append(f"{name}: changes the ledger itself")
        if any(type(one) is not Ledger or not one.records for one in opened):
            wrong.append(f"{name}: changes what its ledger does")
    return Run(name, {id: (_plain(row), number) for id, (row, number) in handed.items()}, tuple(wrong))


def _account() -> dict[tuple[str, str], Any]:
    """Return every function and class of this package, and every method of its classes."""
    modules = [(name, one) for name, one in sys.modules.items() if name.partition(".")[0] == "paperledger"]
    found = {(name, key): value for name, one in modules for key, value in vars(one).items()}
    classes = [value for value in found.values() if isinstance(value, type)]
    methods = {(one.__qualname__, key): value for one in classes for key, value in vars(one).items()}
    return {key: value for key, value in (found | methods).items() if callable(value)}


def _plain(row: Row) -> Row:
    """Return the row with its print as plain text, to send it between processes."""
    return replace(row, printed=str(row.printed))


# ---------------------------------------------------------------------------------------------------- judging


def distance(old: Row, new: Row) -> float:
    """Return the relative change of a row; for a statement that of the side that changed more.

    >>> one = Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345")
    >>> f"{distance(one, replace(one, computed='1.309812999')):.1e}"
    '5.0e-07'
    """
    if not old.is_statement:
        return _apart(old.computed, new.computed)
    was, now = Evidence.parse(old.evidence), Evidence.parse(new.evidence)
    if was.but or now.but:
        pairs = zip(was.inequalities, now.inequalities, strict=False)
        return max(
            _apart(a, b) for one, two in pairs for a, b in ((one.left, two.left), (one.right, two.right))
        )
    if Relation.parse(old.relation).is_identity:  # of a residual that is rounding only the decade is kept
        return _apart(was.left, now.left) if now.verdict == "fails" or float(now.left) > PRINTED else 0.0
    return max(_apart(was.left, now.left), _apart(was.right, now.right))


def _apart(old: str, new: str) -> float:
    a, b = float(old), float(new)
    if a == b:
        return 0.0
    return float("inf") if isinf(a) or isinf(b) else abs(a - b) / max(abs(a), abs(b))


def _rounded(old: Row, new: Row) -> bool:
    """Return True if a number changed and still ends in zeros, so that it is rounded."""
    pairs = [(old.computed, new.computed)]
    if old.is_statement:
        was, now = Evidence.parse(old.evidence), Evidence.parse(new.evidence)
        pairs = [(was.left, now.left), (was.right, now.right)]
    return any(
        _apart(a, b) > PRINTED and a.endswith("000") and b.endswith("000") and "." in a for a, b in pairs
    )


def _own_print(row: Row, new: Row, shaker: Shaker) -> bool:
    """Return True if a row was handed its own print, as the page could read it."""
    if row.is_statement:
        return False
    read = float(_with_print(row, shaker).printed)
    return new.computed == write(read, -400, max(1, _digits(new.computed)))


def _digits(text: str) -> int:
    number = read_number(text)
    return number.adjusted() - exponent(number) + 1 if number else DIGITS


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
    far, made, found = distance(row, new), Making.parse(row.made), row.found.partition(" | ")[0]
    if shaker.only_prints:
        if not _starts_clean(row) or row.same(new):
            return ""
        return f"moves by {far:.1e} as prints alone are off: its basis is from-print or fitted"
    if _own_print(row, new, shaker):
        return "hands back its own print"
    # prints move each by another part, which may nearly cancel; then only the very same number is a copy
    if far < (COPIED if row.basis != "from-print" else 1e-12):
        return "" if made.stays else f"stays at {found}"
    if made.stays == "count" and _rounded(row, new):  # it went to the next place of its grid
        return ""
    if made.stays:
        return f"moves by {far:.1e}, so 'made' needs no {made.stays!r}"
    if _rounded(row, new):
        return f"is rounded, {found}"
    if far < PRINTED and row.basis != "from-print":
        return f"moves by {far:.1e}, as print does: its basis is from-print, not {row.basis}"
    return ""


@dataclass(frozen=True)
class Report:
    """The outcome for the rows of one paper.

    Parameters
    ----------
    paper : str
        Its key.
    move, stay : int
        How many rows moved; how many say why they do not.
    wrong : list of str
        One line for each row or page that is refused.

    Examples
    --------
    >>> print(Report("demo", 118, 3, ["demo.kp: stays at 1.3 (cell 9)"]))
    demo: 118 of 122 rows move, 3 say why they stay, 1 refused
      demo.kp: stays at 1.3 (cell 9)
    """

    paper: str
    move: int
    stay: int
    wrong: list[str]
    rows: int = 0

    def __str__(self) -> str:
        total = self.rows or self.move + self.stay + len(self.wrong)
        head = f"{self.paper}: {self.move} of {total} rows move, {self.stay} say why they stay"
        return "\n  ".join([f"{head}, {len(self.wrong)} refused" if self.wrong else head, *self.wrong])


def _computed(paper: str, folder: Path) -> list[Row]:
    """Rows that some page has to hand over."""
    return [row for row in Ledger.open(paper, folder=folder).rows.values() if row.basis != "reading"]


def judged(row: Row, run: Run | None, shaker: Shaker) -> str:
    """Return what is wrong with a row, and where; empty if nothing is."""
    if run is None or row.id not in run.handed:
        return f"{row.id}: never handed over"
    new, cell = run.handed[row.id]
    said = judge(row, new, shaker)
    return said and f"{row.id}: {said} ({row.page}, cell {cell})"


def report(
    paper: str, folder: Path, shaker: Shaker, runs: Iterable[Run], exact: Iterable[Run] = ()
) -> Report:
    """Judge the rows of a paper by what its pages handed over, and by what with an exact library and prints off."""
    by_page, by_exact = ({one.page: one for one in some} for some in (runs, exact))
    rows, alone = _computed(paper, folder), replace(shaker, only_prints=True)
    move, stay = 0, 0
    wrong = [*dict.fromkeys(line for one in (*by_exact.values(), *by_page.values()) for line in one.wrong)]
    for row in rows:
        said = judged(row, by_page.get(row.page), shaker)
        if not said and row.page in by_exact:
            said = judged(row, by_exact[row.page], alone)
        if said:
            wrong.append(said)
        elif Making.parse(row.made).stays:
            stay += 1
        else:
            move += 1
    return Report(paper, move, stay, wrong, len(rows))


def _all_runs(
    paths: Sequence[Path], book: Path, shaker: Shaker, told: Callable[[Run, str], None]
) -> list[Run]:
    """Run each page in a forked process, which inherits the imports; a few at a time."""
    fork, waiting = get_context("fork"), [*enumerate(paths)]
    running: dict[Any, tuple[int, Any]] = {}
    found: dict[int, Run] = {}
    while waiting or running:
        while waiting and len(running) < WORKERS:
            number, path = waiting.pop(0)
            here, there = fork.Pipe(duplex=False)
            child = fork.Process(
                target=lambda path, end: end.send(run(path, book, shaker)), args=(path, there)
            )
            child.start()
            there.close()
            running[here] = number, child
        ready: list[Any] = wait([*running])
        for end in ready:
            number, child = running.pop(end)
            try:
                found[number] = end.recv()
            except EOFError:  # it died without a word
                name = _name(paths[number], book)
                found[number] = Run(name, {}, (f"{name}: its process died",))
            child.join()
            told(found[number], f"[{len(found)}/{len(paths)}]")
    return [found[number] for number in range(len(paths))]


def _elsewhere(function: Callable[[], list[Run]]) -> list[Run]:
    """Call a function in another process, so that its imports do not reach this one."""
    fork = get_context("fork")
    here, there = fork.Pipe(duplex=False)
    child = fork.Process(target=lambda: there.send(function()))
    child.start()
    there.close()
    try:
        return here.recv()
    except EOFError:  # it has said why
        raise LedgerError("the run with an exact library ended early") from None
    finally:
        child.join()


def shake(
    shaker: Shaker, folder: Path | str | None, keys: Sequence[str], prepare: Callable[[], None] | None = None
) -> int:
    """Run all pages of some papers with a library that is off, print what moves; 0 if nothing is refused.

    Before that, pages with a number that is called computed run with an exact library and prints alone off: such a
    number stays then.

    Parameters
    ----------
    shaker : Shaker
        What to shake; its package must not be imported yet.
    folder : path, optional
        Folder of the csv files; by default as in `Ledger.open`.
    keys : sequence of str
        Papers; none for all.
    prepare : callable, optional
        What imports the package, and what else all pages import, once.

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
        raise LedgerError(
            "to shake a library takes a system that can fork, such as Linux: each page inherits it"
        )
    place = (Path(folder) if folder is not None else find_folder()).resolve()
    chosen = [*keys] or papers(place)
    found = {paper: pages(paper, place) for paper in chosen}
    # the long ones first, so that none is left for the end
    paths = sorted({path for some in found.values() for path in some}, key=lambda path: -path.stat().st_size)
    owed = [row for paper in chosen for row in _computed(paper, place)]
    alone = replace(shaker, only_prints=True)

    def handed(paths: Sequence[Path], shaker: Shaker, what: str) -> list[Run]:
        def told(run: Run, counted: str) -> None:
            rows = (judged(row, run, shaker) for row in owed if row.page == run.page)
            wrong = [*run.wrong, *filter(None, rows)]
            print("\n  ".join([f"{counted} {run.page}, {what} off", *wrong]), file=sys.stderr, flush=True)

        if prepare:
            prepare()
        return _all_runs(paths, place.parent, shaker, told)

    os.environ["MPLBACKEND"] = "Agg"
    clean = {row.page for row in owed if _starts_clean(row)}
    first = [path for path in paths if _name(path, place.parent) in clean]
    exact = dict(zip(first, _elsewhere(lambda: handed(first, alone, "prints")), strict=True))
    with shaker.shaking():
        runs = dict(zip(paths, handed(paths, shaker, "library"), strict=True))
    reports = []
    for paper in chosen:
        mine, before = ([some[path] for path in found[paper] if path in some] for some in (runs, exact))
        reports.append(report(paper, place, shaker, mine, before))
    print(*reports, sep="\n")
    return int(any(one.wrong for one in reports))
