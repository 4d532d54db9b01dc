"""What a page hands over while the library is slightly off: does each row move, and if not, does it say why?"""

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import isinf
from multiprocessing import get_context
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

from paperledger.book import Ledger, recording
from paperledger.digits import DIGITS, LedgerError, exponent, read_number, write
from paperledger.making import Making
from paperledger.rows import Row, find_folder, papers
from paperledger.running import execute, pages
from paperledger.shaking import PRINTS, Shaker
from paperledger.statements import Evidence, Relation

COPIED = 1e-9  # relative: less is the rounding of a stored number
PRINTED = 1e-6  # prints move a row by 4e-8, perhaps a few times that; the library by 2e-6 at least
WORKERS = 2
Handed = dict[str, tuple[Row, int]]  # by id: the row, and the cell that handed it over


@dataclass(frozen=True)
class Run:
    """What one page handed over.

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
    """What a paper prints, as text exact, as a number slightly off."""

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
        before = dict(vars(Ledger))
        try:
            for number, _ in enumerate(execute(path), start=1):
                for one in opened:
                    handed |= {id: (row, number) for id, row in one.fresh.items() if id not in handed}
        except BaseException as error:  # a page may call exit
            first = (str(error).splitlines() or [""])[0]
            wrong.append(f"{name}: cell {number + 1} stops: {type(error).__name__}: {first[:200]}")
        changed = [key for key, value in before.items() if vars(Ledger).get(key) is not value]
        if changed or len(vars(Ledger)) != len(before):
            wrong.append(f"{name}: changes the ledger itself")
        if any(type(one) is not Ledger or not one.records for one in opened):
            wrong.append(f"{name}: changes what its ledger does")
    return Run(name, {id: (_plain(row), number) for id, (row, number) in handed.items()}, tuple(wrong))


def _plain(row: Row) -> Row:
    """The row without the print that is off; it travels between processes."""
    return replace(row, printed=str(row.printed))


# ---------------------------------------------------------------------------------------------------- judging


def distance(old: Row, new: Row) -> float:
    """Tell how far a row moved, relative; of a statement the side of its inequality that moved further.

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
    """Whether a number moved, and ends in zeros as before: no result of a computation does so twice."""
    pairs = [(old.computed, new.computed)]
    if old.is_statement:
        was, now = Evidence.parse(old.evidence), Evidence.parse(new.evidence)
        pairs = [(was.left, now.left), (was.right, now.right)]
    return any(
        _apart(a, b) > PRINTED and a.endswith("000") and b.endswith("000") and "." in a for a, b in pairs
    )


def _own_print(row: Row, new: Row, shaker: Shaker) -> bool:
    """Whether what was handed over is the row's own print, as the page could read it."""
    if row.is_statement:
        return False
    read = float(_with_print(row, shaker).printed)
    return new.computed == write(read, -400, max(1, _digits(new.computed)))


def _digits(text: str) -> int:
    number = read_number(text)
    return number.adjusted() - exponent(number) + 1 if number else DIGITS


def _starts_clean(row: Row) -> bool:
    """Whether nothing that is printed may go into a row; a statement may be about a printed number."""
    return row.basis == "computed" and not row.is_statement


def judge(row: Row, new: Row, shaker: Shaker) -> str:
    """Say what is wrong with a row that was handed over as another one; empty if nothing is.

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
    """What the rows of one paper did.

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
    """Say what is wrong with a row, and where; empty if nothing is."""
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
    """Run each page in a process of its own, which has inherited what is imported; a few at a time."""
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
    """Call a function in a process of its own, so that what it imports is not imported here."""
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


__all__ = ["Report", "Run", "distance", "judge", "report", "run", "shake", "shaken_prints"]
