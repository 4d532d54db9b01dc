"""Validate rows and their file."""

from dataclasses import replace

import pytest
from demo_ledger import KP, ROWS, S1

from paperledger import LedgerError, load_all, read_rows, write_rows
from paperledger.__main__ import main

REASON = "a reason of five words"


@pytest.mark.parametrize(
    ("row", "change", "message"),
    [
        (KP, {"id": "demo.T1.kp"}, "lower case and dotted"),
        (KP, {"id": "other.kp"}, "does not start with demo."),
        (KP, {"printed": "12 %"}, "'12 %' is not a plain number"),
        (KP, {"computed": "holds"}, "'holds' is not a plain number"),
        (KP, {"verdict": "good"}, "has the verdict good, but .* gives reproduced"),
        (KP, {"verdict": "approximate"}, "verdict approximate, but .* gives reproduced"),  # no tolerance
        (KP, {"note": "tolerance 6 %"}, "the tolerance .* is wider than 5 % of 1.31"),
        (KP, {"note": "tolerance 1 %"}, "has the verdict reproduced, but .* gives approximate"),
        (KP, {"verdict": "misprint", "computed": "1.900000000"}, "misprint needs a note"),
        (KP, {"evidence": "1 < 2"}, "the row has a number, but 'evidence' is not empty"),
        (KP, {"basis": "guess"}, "unknown basis 'guess'; one of computed, fitted, from-print, reading"),
        (KP, {"basis": "fitted"}, "if the basis is fitted"),
        (KP, {"made": "fit: 1 setting from 4 numbers: T_F, from Table 1"}, "if the basis is fitted"),
        (KP, {"made": "by hand"}, "'made' must be .* found 'by hand'"),
        (KP, {"made": "fit: 0 settings from 4 numbers: T_F"}, "'made' must be .* found 'fit: 0"),
        (KP, {"made": "fit: T_F"}, "'made' must be .* found 'fit: T_F'"),
        (KP, {"basis": "reading"}, "the basis is reading, but 'computed' is not empty"),
        (
            KP,
            {"basis": "reading", "computed": "", "note": REASON},
            "the basis is reading, but 'page' is not empty",
        ),
        (KP, {"basis": "reading", "computed": "", "note": REASON}, "the verdict cannot be reproduced"),
        (KP, {"basis": "reading", "computed": "", "verdict": "misprint"}, "misprint needs a note"),
        (S1, {"evidence": ""}, "'evidence' is empty"),  # a verdict needs evidence
        (S1, {"relation": ""}, "'relation' is empty"),
        (S1, {"relation": "A faster than B"}, "relation 'A faster than B' does not read like"),
        (S1, {"relation": "residual <= 1e-8 | rounding"}, "needs a note that says why"),
        (S1, {"relation": "residual <= 0.5 | rounding", "note": REASON}, "above 1e-06"),
        (
            S1,
            {"relation": "A <= B", "evidence": "1.400 <= 1.400"},
            "both sides are 1.400, so nothing was compared",
        ),
        (S1, {"verdict": "fails"}, "has the verdict fails, but 3.1.* gives holds"),
        (S1, {"verdict": "misprint", "note": REASON}, "misprint is declared, but .* gives"),
        (S1, {"evidence": "so it is"}, "is no inequality such as"),
    ],
)
def test_validation(project, row, change, message):
    row = replace(row, **change)
    write_rows(project / "book" / "ledger" / "demo.csv", [row])
    with pytest.raises(LedgerError, match=message) as caught:
        load_all()
    assert row.id in str(caught.value)


def test_an_id_that_was_removed_is_never_used_again(project):
    path = project / "book" / "ledger" / "removed.csv"
    path.write_text("id,reason\ndemo.t1.kp,one fact counted twice\n", encoding="utf-8")
    with pytest.raises(LedgerError, match=r"demo\.t1\.kp: was removed"):
        load_all()


def test_half_a_unit_of_the_print():
    assert [replace(KP, printed=text).half_unit for text in ("1.30", "8", "1.2e2")] == [0.005, 0.5, 5.0]
    with pytest.raises(LedgerError, match=r"demo\.s1: 'A < B"):
        _ = S1.half_unit


HEAD = "id,where,quantity,printed,computed,verdict,basis,page,made,relation,evidence,note\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected the columns id, where, .* found ''$"),
        (f"{HEAD}demo.a,b\n", "expected 12 entries on one line, .* found .'demo.a', 'b'"),
        (f"{HEAD}a,,,,,,,,,,,\na,,,,,,,,,,,\n", "more than one row for a"),
        (f'{HEAD}a,,,,,,,,,,,"x\ny"\n', "expected 12 entries on one line"),
        (f'{HEAD}a,,,,,,,,,,,"x', "unexpected end of data"),
    ],
)
def test_unreadable_files(tmp_path, text, message):
    path = tmp_path / "demo.csv"
    path.write_text(text, encoding="utf-8")
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


LINE = "demo.kp,Table 1,gain,1.31,1.309812345,reproduced,computed,demo,,,,"
STATEMENT = "demo.s1,sec. 2,statement,at most 10,holds,holds,computed,demo,,{},{},"
HOSTILE = {
    "UTF-16": lambda head: f"{head}{LINE}\n".encode("utf-16"),
    "Latin-1": lambda head: f"{head}{LINE}\n".replace("gain", "Verstärkung").encode("latin-1"),
    "NUL": lambda head: f"{head}{LINE}\n".replace("gain", "ga\0in").encode(),
    "right to left": lambda head: f"{head}{LINE}\n".replace("gain", "\u202egain").encode(),
    "long entry": lambda head: f"{head}{LINE}\n".replace("gain", "x" * 200_000).encode(),
    "open quote": lambda head: f"{head}{LINE}\n".replace("gain", '"gain').encode(),
    "tiny": lambda head: f"{head}{LINE}\n".replace("1.31,", "1e-99999999,").encode(),
    "huge computed": lambda head: f"{head}{LINE}\n".replace("1.309812345", "1e999999999").encode(),
    "many digits": lambda head: f"{head}{LINE}\n".replace("1.31,", "9" * 5000 + ",").encode(),
    "division by 0": lambda head: f"{head}{STATEMENT.format('<=', '10.82 <= 1/0 * 10')}\n".encode(),
    "factor of a relation": lambda head: (
        f"{head}{STATEMENT.format('a <= 1/0 * b', '1 <= 1/0 * 2')}\n".encode()
    ),
    "count": lambda head: f"{head}{LINE[:-4]},fit: {'9' * 5000} settings from 3 numbers: x,,,\n".encode(),
}


@pytest.mark.parametrize("hostile", HOSTILE.values(), ids=HOSTILE)
def test_hostile_files_are_refused_with_a_message(project, capsys, hostile):
    path = project / "book" / "ledger" / "demo.csv"
    head = path.read_text(encoding="utf-8").partition("\n")[0] + "\n"
    (project / "README.md").write_text("<!-- score -->\n<!-- /score -->\n", encoding="utf-8")
    path.write_bytes(hostile(head))
    for command in (["check"], ["manifest"], ["readme", "README.md"]):
        assert main(command) == 1
        said = capsys.readouterr()
        assert said.err.startswith("demo.")
        assert all(character.isprintable() or character == "\n" for character in said.err + said.out)
    path.write_text(f"{head}{LINE}\n", encoding="utf-8")
    assert main(["check"]) == 0
    assert main(["update", "("]) == 1


def test_a_full_disk_leaves_the_old_ledger(project, monkeypatch):
    folder = project / "book" / "ledger"
    before = {path.name: path.read_bytes() for path in folder.iterdir()}

    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_rows(folder / "demo.csv", ROWS[:1])
    assert main(["manifest"]) == 1
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
