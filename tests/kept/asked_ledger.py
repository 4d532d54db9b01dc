"""Questions about the ledger: how prints are read, judged and shown."""

import contextlib
import io
import itertools
import math
import os
import tempfile
from pathlib import Path

from kept import refused

from pidalab.ledger import (
    CONVENTIONS,
    Entry,
    Evidence,
    Ledger,
    Row,
    digits,
    display,
    pages,
    read_rows,
    score_markdown,
    scores,
    tables,
    verdicts,
    write_rows,
)
from pidalab.ledger.conventions import factor, gap, share, two_digits

PRINTS = (
    "1.31",
    "0.50",
    "12",
    "-0.040",
    "1.4e-3",
    "3",
    "1000",
    "0.0",
    "2.",
    "n/a",
    "1,5",
    "< 0.3",
    "1.5 %",
    "12 000",
)
VALUES = (
    "1.309812345",
    "1.3149999",
    "1.315",
    "0.505",
    "0.4949",
    "12.49",
    "-0.0405",
    "0.001449",
    "0.14",
    "1e9",
    "x",
    "",
)
NOTES = (
    "",
    "noise: tolerance 5 %",
    "read off a figure: tolerance 0.02",
    "eq. (3) gives 0.12 s instead",
    "short",
)
SIDES = (0.0, 1.0, 1.04, 1.05, 1.1, 1.12, 1.25, 2.0, 2.01, -1.0, 0.1, 0.02, 1e-9, 3, float("inf"))


def ledger():
    """Numbers, statements, rows and their tables."""
    asked = {}
    for printed in PRINTS:
        asked[f"print: {printed}"] = lambda p=printed: [
            refused(lambda call=call: call(p)) for call in (digits.is_number, digits.read_number)
        ]
        for value in VALUES:
            asked[f"verdict: {printed}, {value}"] = lambda p=printed, v=value: [
                *(refused(lambda n=note: verdicts.derive(p, v, n)) for note in NOTES),
                refused(lambda: verdicts.units_off(p, v)),
                refused(lambda: digits.show(p, v)),
                refused(lambda: digits.store(float(v), p)),
                refused(lambda: digits.agrees(float(v), v)),
            ]
    for name, relation in itertools.product((None, *CONVENTIONS), ("<", "<=", "==", "within", ">", ">=")):
        asked[f"relation: {name}, {relation}"] = lambda n=name, r=relation: [
            _judged(n, a, r, b) for a, b in itertools.product(SIDES, (1.0, 1.05, -1.0, 1e-9, 2.0))
        ]
    asked["measures"] = lambda: [
        (factor(a, b), gap(a, b), share(a, b), two_digits(a)) for a in SIDES[:-1] for b in SIDES[:-1]
    ]
    for verdict, basis, note in itertools.product(
        (
            "reproduced",
            "last-digit",
            "approximate",
            "misprint",
            "as-read",
            "differs",
            "not-computable",
            "holds",
            "",
        ),
        ("computed", "from-print", "reading"),
        (NOTES[0], NOTES[3]),
    ):
        rows = [
            Row("demo.a.kp", "Table 1", "gain", "1.31", "1.309812345", verdict, basis, "", note),
            Row("demo.b.kp", "Table 1", "gain (s)", "0.3", "0.8000000000", verdict, basis, "", note),
            Row("demo.c", "sec. 2", "statement", "A < B & so on", "holds", verdict, basis, "3.1 < 4.2", note),
        ]
        asked[f"rows: {verdict}, {basis}, {note}"] = lambda rows=rows: [_row(row) for row in rows]
        asked[f"tables: {verdict}, {basis}, {note}"] = lambda rows=rows: (
            refused(lambda: tables.claims(rows).html),
            refused(lambda: tables.claims(rows).text),
            refused(lambda: scores.score_line("demo", scores.score(rows))),
            refused(lambda: scores.bar("demo", scores.score(rows))),
        )
    asked["markup"] = lambda: [
        display.markup(text) for text in ("T_f", "a < b & c", "m^2", "K_s e^{-Ls}", "alpha_d")
    ]
    return asked


def _judged(name, left, relation, right):
    def evidence():
        found = Evidence.of(left, relation, right, convention=name)
        return str(found), found.verdict, found.shown(), found.nearness()

    return refused(evidence)


def _row(row):
    return [
        refused(call) for call in (row.derived, row.difference, row.shown, row.disagreement, row.problems)
    ]


ROWS = [
    Row("demo.t1.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced"),
    Row("demo.t1.ti", "Table 1", "integral time (s)", "2.88", "2.868000000", "last-digit"),
    Row(
        "demo.t1.td",
        "Table 1",
        "time (s)",
        "0.50",
        "0.5100000000",
        "approximate",
        note="noise: tolerance 5 %",
    ),
    Row(
        "demo.t1.ta", "Table 1", "T_a", "12", "0.1200000000", "misprint", note="eq. (3) gives 0.12 s instead"
    ),
    Row(
        "demo.t1.tf",
        "Table 1",
        "filter",
        "0.3",
        "0.8000000000",
        "as-read",
        "from-print",
        note="a 3 may be an 8",
    ),
    Row(
        "demo.t2.iae",
        "Table 2",
        "IAE",
        "n/a",
        "",
        "not-computable",
        "reading",
        note="the seed was never published",
    ),
    Row("demo.s1", "sec. 3", "statement", "A < B & PIDA is faster", "holds", "holds", evidence="3.1 < 4.2"),
    Row("demo.s2", "sec. 3", "statement", "the loop is stable", "fails", "fails", evidence="2 == 0 | poles"),
]


@contextlib.contextmanager
def _project():
    """A project with one ledger, in a folder of its own."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "book" / "ledger"
        folder.mkdir(parents=True)
        write_rows(folder / "demo.csv", ROWS)
        (folder.parent / "references.bib").write_text(
            "@article{demo,\n  title = {The {PIDA} -- a demo},\n}\n", encoding="utf-8"
        )
        os.chdir(name)
        try:
            yield folder
        finally:
            os.chdir(before)


FILE = "id,where,quantity,printed,computed,verdict,basis,evidence,note\n" + "".join(
    f"demo.{name},Table 1,gain,1.3,1.309812345,reproduced,computed,,\n" for name in "ab"
)


def _from_file(path, text):
    path.write_text(text, encoding="utf-8")
    return [repr(row) for row in read_rows(path)]


def _of_pages(call):
    with _project() as folder, contextlib.redirect_stdout(io.StringIO()) as said:
        found = call(folder)
        return found, said.getvalue().replace(str(folder), "")


def _handed(change):
    """Hand a ledger its numbers, some of them changed, and close it."""
    book = Ledger(Path("demo.csv"), ROWS)
    said = []
    for call in (
        lambda: book.check("t1.kp", 1.309812345 + change),
        lambda: book.check({"t1.ti": 2.868 * (1 + change), "t1.td": 0.51}),
        lambda: book.check("t1.ta", 0.12, note="eq. (3) gives 0.12 s instead"),
        lambda: book.check("t1.tf", 0.8),
        lambda: book.check("t1.xx", 1.0),
        lambda: book.statement("s1", 3.1 + change, "<", 4.2),
        lambda: book.statement("s2", 2, "==", 0, left_name="poles"),
        lambda: book.note("t2.iae", "other"),
        lambda: book.check("t1.kp", math.nan),
        lambda: book.identity("s1", change, 1e-6),
        lambda: book.table("t1").text,
        lambda: book.row("t1.kp"),
        lambda: book.printed("t1.kp"),
        lambda: book.missing(),
        lambda: book.problems(),
        lambda: book.score(),
        lambda: book.scorebar().text,
        lambda: book.full("t1.kp"),
        lambda: book.close(),
    ):
        try:
            with contextlib.redirect_stdout(io.StringIO()) as printed:
                found = call()
            said += [found, printed.getvalue()]
        except (ValueError, TypeError, KeyError) as refusal:
            said.append(f"{type(refusal).__name__}: {refusal}")
    return said


def pages_of_a_ledger():
    """A ledger, handed over with and without changes, and the pages of its project."""
    asked = {
        f"handed: {change}": lambda change=change: _handed(change)
        for change in (0.0, 1e-12, 1e-10, 1e-6, 0.01, -3.0)
    }
    for name in ("errata", "every_row", "scoreboard"):
        for form in ("text", "html"):
            asked[f"{name}: {form}"] = lambda name=name, form=form: _of_pages(
                lambda folder: getattr(getattr(pages, name)(folder), form)
            )
    asked["score"] = lambda: _of_pages(lambda folder: score_markdown(folder))
    for i, text in enumerate(
        (
            "",
            "id\n",
            FILE,
            FILE.replace("demo.b", "demo.a"),
            FILE.replace("1.3", "1.3,4"),
            FILE + "x\n",
            FILE.replace("id,", "name,"),
            FILE.replace("reproduced", "good"),
        )
    ):
        asked[f"file, {i}"] = lambda text=text: _of_pages(
            lambda folder: _from_file(folder / "other.csv", text)
        )
    asked["conventions"] = lambda: (pages.convention_table().html, pages.convention_table().text)
    asked["entries"] = lambda: [
        repr(Entry(1.5)),
        repr(Entry(evidence=Evidence.of(1.0, "<", 2.0, names=("a", "b")))),
    ]
    for left, relation, right, names in (
        (1.0, "<", 2.0, ("a", "")),
        (3, "==", 3, ("", "b")),
        (1e-12, "<=", 1e-9, ("", "")),
        (0.1, "within", 0.1000001, ("x", "y")),
    ):
        asked[f"evidence: {left} {relation} {right}"] = lambda a=left, r=relation, b=right, n=names: (
            lambda e: (
                str(e),
                e.shown(),
                e.is_rounding,
                e.is_coarse,
                e.numbers,
                e.nearness(),
                e.same(Evidence.of(a * (1 + 1e-12), r, b)),
            )
        )(Evidence.of(a, r, b, names=n))
    for residual, tolerance in ((1e-13, 1e-9), (2e-10, 1e-9), (1e-8, 1e-9), (0.0, 1e-9), (1e-3, 1e-2)):
        asked[f"identity: {residual}, {tolerance}"] = lambda a=residual, b=tolerance: (
            lambda e: (str(e), e.verdict, e.is_rounding, e.is_coarse, e.shown(), e.nearness())
        )(Evidence.identity(a, b))
    return asked
