"""Nothing cheats in silence: what checks, notebooks and ledgers must not do, and that each way is seen."""

import configparser
import json
from dataclasses import replace
from pathlib import Path

import pytest
from demo_ledger import KP, ROWS, S1
from honesty import checks_file, masked, notebook

from pidalab.ledger import read_rows, write_rows
from pidalab.ledger.digits import read_number
from pidalab.ledger.files import papers
from pidalab.ledger.manifest import differences, freeze
from pidalab.ledger.verdicts import tolerance

ROOT = Path(__file__).parents[2]
LEDGERS = ROOT / "book" / "ledger"
CHECKS = sorted((ROOT / "book" / "checks").rglob("*.py"))
AUDITS = sorted((ROOT / "book" / "audit").glob("*.ipynb"))
OTHERS = sorted({*(ROOT / "book").rglob("*.ipynb")} - {*AUDITS})
WIDE: dict[str, str] = {
    # id of a row whose tolerance exceeds 5 %: why
}


def named(paths):
    return [pytest.param(path, id=str(path.relative_to(ROOT / "book"))) for path in paths]


def patterns():
    settings = configparser.ConfigParser(interpolation=None)
    settings.read(ROOT / "tests" / "nbval.cfg", encoding="utf-8")
    return [settings[name]["regex"] for name in settings.sections()]


# ------------------------------------------------------------------------------------------------ the book as it is


@pytest.mark.parametrize("path", named(CHECKS))
def test_checks_compute_what_they_hand_over(path):
    assert checks_file(path, str(path.relative_to(ROOT / "book" / "checks"))) == []


@pytest.mark.parametrize("path", named(AUDITS))
def test_audits_open_one_ledger_and_close_it(path):
    assert notebook(path, audit=True) == []


@pytest.mark.parametrize("path", named(OTHERS))
def test_chapters_hand_over_nothing(path):
    assert notebook(path, audit=False) == []


@pytest.mark.parametrize("path", named([*AUDITS, *OTHERS]))
def test_the_sanitiser_touches_figures_only(path):
    assert masked(path, patterns()) == []


def wide_tolerances(folder):
    """List the ids whose tolerance is more than 5 % of the print."""
    found = []
    for paper in papers(folder):
        for row in read_rows(folder / f"{paper}.csv"):
            if row.is_number:
                printed = read_number(row.printed)
                width = tolerance(row.note, printed)
                if width is not None and width > abs(printed) / 20:
                    found.append(row.id)
    return found


def test_no_tolerance_above_five_percent():
    assert [id for id in wide_tolerances(LEDGERS) if id not in WIDE] == []


def test_the_claims_are_those_of_the_manifest():
    """`python -m pidalab.ledger manifest` freezes a reviewed change."""
    assert differences(LEDGERS) == []


def test_every_paper_has_checks_and_an_audit():
    assert [path.stem for path in AUDITS] == papers(LEDGERS)
    assert {path.relative_to(ROOT / "book" / "checks").parts[0].removesuffix(".py") for path in CHECKS} == {
        *papers(LEDGERS)
    }


# ------------------------------------------------------------------------------------------------ each cheat is seen


@pytest.mark.parametrize(
    ("body", "finding"),
    [
        ('book.check("kp", 1.31)', "typed in"),
        ('book.check("kp", -abs(1.31))', "typed in"),
        ('kp = 1.31\n    book.check("kp", kp)', "typed in"),
        ('book.check("kp", GAIN)', "typed in"),
        ('book.check({"kp": GAINS["kp"], "ti": solve()})', "typed in"),
        ('book.check({"kp": solve(), "ti": 2.88})', "typed in"),
        ("for id, value in GAINS.items():\n        book.check(id, value)", "typed in"),
        ("book.check(GAINS)", "typed in"),
        ('book.check("kp", np.float64(1.31))', "typed in"),
        ('book.check("kp", book.printed("kp"))', "hands back what is printed"),
        ('book.check("kp", float(book.printed("other")))', "hands back what is printed"),
        ('kp = book.printed("kp")\n    book.check("kp", kp)', "hands back what is printed"),
        ('book.check("kp", book.printed("kp") * 1.0001)', "from its own print"),
        ('book.check("kp", solve() * 0 + book.printed("kp"))', "from its own print"),
        ('book.statement("s", 1, "<", 2)', "compares what is typed in"),
        ('a, b = 1, 2\n    book.statement("s", a, "<", b)', "compares what is typed in"),
        ('book.statement("s", solve() < 3, "==", 1)', "truth value"),
        ('book.statement("s", round(solve()), "<=", 10)', "rounds"),
        ('x = solve()\n    book.statement("s", x, "<=", x)', "with itself"),
        ('book.identity("s", 0.0)', "typed in"),
        ("for id, row in book.rows.items():\n        book.check(id, row.computed)", "reads .rows"),
        ('book.check("kp", float(book.row("kp").computed))', "reads .computed"),
        ('book.entries["demo.kp"] = solve()', "reads .entries"),
        ('try:\n        book.check("kp", solve())\n    except ValueError:\n        pass', "swallowed"),
        ('with suppress(ValueError):\n        book.check("kp", solve())', "swallowed"),
        ("book.check = print", "changes the ledger"),
        ('setattr(book, "check", print)', "calls setattr"),
        ("from pidalab.ledger import read_rows", "imports read_rows"),
        ("from pidalab.ledger.running import record", "imports record"),
        ('open("../ledger/demo.csv")', "names a file of the ledger"),
        ("book.close()", "opens or closes"),
        ("other = book\n    other.check('kp', 1.31)", "is called book"),
        ("def part(other: Ledger):\n        other.check('kp', 1.31)", "is called book"),
    ],
)
def test_a_cheating_check_is_seen(tmp_path, body, finding):
    path = tmp_path / "demo.py"
    path.write_text(f'GAIN = 1.31\nGAINS = {{"kp": 1.31, "ti": 2.88}}\n\ndef section(book):\n    {body}\n')
    found = checks_file(path, "demo.py")
    assert len(found) >= 1
    assert finding in found[0]


@pytest.mark.parametrize(
    "body",
    [
        'book.check("kp", solve())',
        'kp = solve().kp\n    book.check("kp", kp, note=f"{kp:.3f}")',
        'book.check("ti", book.printed("kp") / book.printed("ki"))',
        "for id, order in ORDERS.items():\n        book.check(id, solve(order))",
        'book.check({f"kp{n}": value for n, value in enumerate(solve())})',
        "book.check(gains(book))",
        'book.statement("s", solve(), "<=", 10)',
        'book.statement("s", *every({n: (solve(n), 3) for n in ORDERS}, "<"))',
        'book.identity("s", max(abs(solve() - 3.0), abs(solve(2))), 1e-9)',
        'book.note("s", "A survey, not a computation.")',
        'with plt.style.context("book"):\n        book.check("kp", solve())',
        "frame.check(1); np.testing.check(2)",
    ],
)
def test_an_honest_check_passes(tmp_path, body):
    path = tmp_path / "demo.py"
    path.write_text(f'ORDERS = {{"kp": 1, "ti": 2}}\n\ndef section(book):\n    {body}\n')
    assert checks_file(path, "demo.py") == []


def write_notebook(path, *sources, tags=()):
    cells = [
        {"cell_type": "code", "source": source, "metadata": {"tags": [*tags]}, "outputs": []}
        for source in sources
    ]
    path.write_text(json.dumps({"cells": cells}))
    return path


OPEN, CALL, CLOSE = 'book = Ledger.open("demo")', "checks.gains(book)", "book.close()"


@pytest.mark.parametrize(
    ("sources", "finding"),
    [
        ((OPEN, CALL), "does not end with book.close()"),
        ((OPEN, CALL, CLOSE, CALL), "does not end with book.close()"),
        ((OPEN, CALL, OPEN, CLOSE), "opens 2 ledgers"),
        ((OPEN, 'book.check("kp", 1.31)', CLOSE), "hands over .check itself"),
        ((OPEN, f"try:\n    {CALL}\n    book.close()\nexcept ValueError: pass"), "swallowed"),
        ((OPEN, f"# NBVAL_IGNORE_OUTPUT\n{CALL}", CLOSE), "marker NBVAL_IGNORE_OUTPUT"),
        ((OPEN, "Ledger.close = print", CLOSE), "changes the ledger"),
        ((OPEN, "book.rows", CLOSE), "reads .rows"),
    ],
)
def test_a_cheating_audit_is_seen(tmp_path, sources, finding):
    found = notebook(write_notebook(tmp_path / "demo.ipynb", *sources), audit=True)
    assert any(finding in line for line in found)


def test_tags_that_hide_are_seen(tmp_path):
    path = write_notebook(tmp_path / "demo.ipynb", OPEN, CALL, CLOSE, tags=["raises-exception"])
    assert len(notebook(path, audit=True)) == 3
    assert notebook(write_notebook(path, OPEN, CALL, CLOSE, tags=["hide-input"]), audit=True) == []
    assert notebook(write_notebook(path, "%matplotlib inline", OPEN, "book.table('x')"), audit=False) == []


def test_plain_text_under_the_sanitiser_is_seen(tmp_path):
    path = tmp_path / "demo.ipynb"
    outputs = [
        {"data": {"image/svg+xml": "<path d='M 1.3777 2.0'/>", "text/plain": "M 1.3777 2.0"}},
        {"text": "1.31"},
    ]
    path.write_text(json.dumps({"cells": [{"cell_type": "code", "source": "", "outputs": outputs}]}))
    assert len(masked(path, patterns())) == 1


@pytest.mark.parametrize(
    ("rows", "finding"),
    [
        ([replace(KP, printed="1.3"), *ROWS[1:]], "demo.t1.kp: printed '1.31' -> '1.3'"),
        ([replace(KP, printed="1.32"), *ROWS[1:]], "demo.t1.kp: printed '1.31' -> '1.32'"),
        (ROWS[1:], "demo.t1.kp: is gone"),
        ([*ROWS, replace(KP, id="demo.t1.kp2")], "demo.t1.kp2: is new"),
        (
            [replace(KP, quantity="statement", printed="a gain"), *ROWS[1:]],
            "demo.t1.kp: kind 'number' -> 'statement'",
        ),
        ([replace(KP, basis="reading"), *ROWS[1:]], "demo.t1.kp: basis 'computed' -> 'reading'"),
        ([replace(KP, verdict="misprint"), *ROWS[1:]], "demo.t1.kp: declared '' -> 'misprint'"),
        (
            [*ROWS[:7], replace(S1, printed="A <= B"), *ROWS[8:]],
            "demo.s1: printed 'A < B & PIDA is faster' -> 'A <= B'",
        ),
    ],
)
def test_the_manifest_shows_what_was_changed(tmp_path, rows, finding):
    write_rows(tmp_path / "demo.csv", ROWS)
    assert freeze(tmp_path)
    assert not freeze(tmp_path)
    assert differences(tmp_path) == []
    write_rows(tmp_path / "demo.csv", rows)
    assert finding in differences(tmp_path)


@pytest.mark.parametrize("note", ["tolerance 5.1 %", "tolerance 0.07", "tolerance 900 %"])
def test_a_wide_tolerance_is_seen(tmp_path, note):
    write_rows(
        tmp_path / "demo.csv", [replace(KP, note=note), replace(KP, id="demo.b", note="tolerance 5 %")]
    )
    assert wide_tolerances(tmp_path) == ["demo.t1.kp"]
