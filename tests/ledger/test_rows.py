"""What can be wrong with a row, and the file that holds the rows."""

from dataclasses import FrozenInstanceError, fields, replace

import pytest
from demo_ledger import KP, ROWS, S1

from pidalab.ledger import CONVENTIONS, LedgerError, load_all, read_rows, write_rows
from pidalab.ledger.display import Cell, Display

REASON = "a reason of five words"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"id": "demo.T1.kp"}, "lower case and dotted"),
        ({"id": "demo"}, "does not start with demo."),
        ({"id": "other.kp"}, "does not start with demo."),
        ({"where": ""}, "'where' is empty"),
        ({"quantity": " "}, "'quantity' is empty"),
        ({"printed": ""}, "'printed' is empty"),
        ({"printed": "12 %"}, "'12 %' is not a plain number"),
        ({"computed": "about 1"}, "'about 1' is not a plain number"),
        ({"computed": ""}, "'computed' is empty"),
        ({"verdict": "good"}, "unknown verdict 'good'; one of reproduced, "),
        ({"verdict": ""}, "file says nothing, .* gives reproduced"),
        ({"verdict": "approximate"}, "approximate needs a tolerance"),
        ({"verdict": "approximate", "note": "tolerance 1 %, tolerance 2 %"}, "more than one tolerance"),
        (
            {"verdict": "approximate", "computed": "1.400000000", "note": "tolerance 1 %"},
            "gives no agreement",
        ),
        ({"note": "tolerance 1 %"}, "file says reproduced, .* gives approximate"),
        ({"verdict": "misprint", "computed": "1.900000000"}, "misprint needs a note"),
        ({"verdict": "as-read", "computed": "1.900000000"}, "as-read needs a note"),
        ({"verdict": "differs", "computed": "1.900000000", "note": " "}, "differs needs a note"),
        ({"verdict": "holds", "computed": "holds"}, "a number is not judged as a statement"),
        ({"evidence": "1 < 2"}, "a number has no evidence"),
        ({"quantity": "statement"}, "a printed number is no statement"),
        ({"relation": "A < B"}, "a number has no relation"),
        ({"page": ""}, "'page' is empty"),
        ({"computed": "1.3098"}, "fewer digits than ten, and no note says why"),
        (
            {"computed": "1.3", "note": "digits lost"},
            "stored no finer than printed, so that drift stays hidden",
        ),
        ({"computed": "1e9", "verdict": "differs", "note": REASON}, "stored no finer than printed"),
        ({"basis": "guess"}, "unknown basis 'guess'; one of computed, from-print, reading"),
        ({"basis": "reading"}, "settled by reading, but 'computed' is not empty"),
        ({"basis": "reading", "computed": "", "note": REASON}, "settled by reading, but 'page' is not empty"),
        ({"basis": "reading", "computed": "", "note": REASON}, "settled by reading cannot be reproduced"),
        ({"basis": "reading", "computed": "", "verdict": "misprint"}, "settled by reading needs a note"),
        ({"verdict": "not-computable", "computed": "", "note": REASON}, "so its basis is reading"),
    ],
)
def test_validation(project, change, message):
    check_validation(project, replace(KP, **change), message)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"evidence": ""}, "no evidence"),
        ({"relation": ""}, "no relation"),
        ({"relation": "A faster than B"}, "relation 'A faster than B' is none such as"),
        ({"relation": "A <= B"}, "is not what the relation A <= B asks for"),
        ({"relation": "A < B | much"}, "is not what the relation A < B . much asks for"),
        (
            {"relation": "residual <= 1e-8 | rounding", "evidence": "1e-9 <= 1e-8"},
            "needs a note that says why",
        ),
        ({"computed": ""}, "'computed' is empty"),
        ({"computed": "fails", "verdict": "fails"}, "computed says fails, the evidence 3.1.* does not"),
        ({"verdict": "fails"}, "file says fails, 3.1.* gives holds"),
        ({"verdict": "misprint", "note": REASON}, "declared misprint starts to agree"),
        ({"evidence": "3.1 < 4.2"}, "fewer digits than ten, and no note says why"),
        ({"evidence": "so it is"}, "is no inequality such as"),
        (
            {"basis": "reading", "computed": "", "note": REASON},
            "settled by reading, but 'evidence' is not empty",
        ),
    ],
)
def test_validation_of_a_statement(project, change, message):
    check_validation(project, replace(S1, **change), message)


def check_validation(project, row, message):
    write_rows(project / "book" / "ledger" / "demo.csv", [row])
    with pytest.raises(LedgerError, match=message) as caught:
        load_all()
    assert row.id in str(caught.value)


def test_half_a_unit_of_the_print():
    assert [replace(KP, printed=text).half_unit for text in ("1.30", "8", "1.2e2")] == [0.005, 0.5, 5.0]
    with pytest.raises(LedgerError, match=r"demo\.s1: 'A < B"):
        _ = S1.half_unit


def test_validation_lists_everything(project):
    write_rows(project / "book" / "ledger" / "other.csv", ROWS[:2])
    write_rows(project / "book" / "ledger" / "demo.csv", [replace(KP, verdict="good", where="")])
    with pytest.raises(LedgerError) as caught:
        load_all()
    assert len(str(caught.value).splitlines()) == 4


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected the columns id, where, .* found $"),
        ("id,where\n", "expected the columns id, where, "),
        (
            "id,where,quantity,printed,computed,verdict,basis,page,relation,evidence,note\ndemo.a,b\n",
            "expected 11 entries, found 2 in 'demo.a,b'",
        ),
        (
            "id,where,quantity,printed,computed,verdict,basis,page,relation,evidence,note\na,,,,,,,,,,\na,,,,,,,,,,\n",
            "more than one row for a",
        ),
        (
            'id,where,quantity,printed,computed,verdict,basis,page,relation,evidence,note\na,,,,,,,,,,"x\ny"\n',
            "line break inside an entry of a",
        ),
        (
            'id,where,quantity,printed,computed,verdict,basis,page,relation,evidence,note\na,,,,,,,,,,"x',
            "unexpected end of data",
        ),
    ],
)
def test_unreadable_files(tmp_path, text, message):
    path = tmp_path / "demo.csv"
    path.write_text(text)
    with pytest.raises(LedgerError, match=message):
        read_rows(path)


def test_file_round_trip(tmp_path):
    path = tmp_path / "demo.csv"
    odd = replace(KP, note='comma, "quote", κ ≤ 2, a\\b, NA', where="nan")
    write_rows(path, [odd, *ROWS[1:]])
    once = path.read_bytes()
    assert read_rows(path) == [odd, *ROWS[1:]]
    write_rows(path, read_rows(path))
    assert path.read_bytes() == once
    assert b"\r" not in once


@pytest.mark.parametrize(
    "one",
    [KP, CONVENTIONS["much"], Cell("a", "b"), Display("a", "b")],
    ids=lambda one: type(one).__name__,
)
def test_what_a_ledger_is_made_of_does_not_change(one):
    for part in fields(one):
        with pytest.raises(FrozenInstanceError):
            setattr(one, part.name, getattr(one, part.name))
