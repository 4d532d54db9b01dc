"""Numbers that others printed: enough of them, each answered anew, each verdict as it is stored, and no empty one."""

import copy

import foreign_tables
import numpy as np
import pytest

import pidalab

DATA = foreign_tables.read()
NUMBERS, SOURCES = 200, 8  # that are read, at least


@pytest.fixture(scope="module")
def found():
    return foreign_tables.rows(DATA)


def test_every_verdict_is_the_one_that_follows(found):
    wrong = [
        f"{row.source}, {row.where}, {row.answer}: printed {row.printed}, computed {row.computed:.10g}: "
        f"{row.verdict}, not {row.stored}"
        for row in found
        if row.verdict != row.stored
    ]
    assert not wrong, "\n".join(wrong)


def test_there_are_enough_of_them(found):
    read = [row for row in found if row.counts]
    assert len(read) >= NUMBERS
    assert len({row.source for row in read}) >= SOURCES
    assert {row.source for row in found} == set(DATA["sources"])
    assert sum(row.verdict in foreign_tables.AGREEING for row in read) >= 0.9 * len(read)


def test_what_differs_has_a_reason(found):
    for row in found:
        assert (row.verdict in ("differs", "fails")) == bool(row.note), row
        assert not row.note or len(row.note.split()) >= 5


def test_a_source_says_where_it_was_read():
    for name, source in DATA["sources"].items():
        assert set(source) == {"title", "address", "text"}, name
        assert source["text"] in ("read", "recalled")
        if source["text"] == "read":
            assert "." in source["address"].split("/")[0], f"{name}: no address of a host"


def test_every_table_says_all_that_it_has_to():
    needed = {"source", "where", "question", "printed"}
    allowed = needed | {"plant", "gain", "controller", "sample", "tolerance", "verdicts", "note", "horizon"}
    allowed |= {"rule", "kind", "options", "task"}
    seen = set()
    for table in DATA["table"]:
        assert needed <= set(table) <= allowed, table["where"]
        assert set(table.get("verdicts", {})) <= set(table["printed"])
        assert set(table.get("verdicts", {}).values()) <= set(foreign_tables.VERDICTS)
        for answer, printed in table["printed"].items():
            assert isinstance(printed, str)
            key = table["source"], table["where"], answer
            assert key not in seen, f"twice: {key}"
            seen.add(key)


def one(**changed):
    """The first row of a table that asks for the margins of 2/(s + 1)^3, with some of it changed."""
    table = {
        "source": "pkg-control",
        "where": "here",
        "question": "margins",
        "plant": "three-lags",
        "gain": 2,
    }
    return foreign_tables.rows(DATA | {"table": [copy.deepcopy(table) | changed]})[0]


@pytest.mark.parametrize(
    ("printed", "tolerance", "verdict"),
    [
        ("4.00", None, "reproduced"),
        ("4.01", None, "last-digit"),
        ("4.02", None, "differs"),
        ("4.02", "0.03", "within tolerance"),
        ("4.02", "1e-2 of it", "within tolerance"),
        ("4.02", "1e-3 of it", "differs"),
        (">= 3.9", None, "holds"),
        (">= 4.1", None, "fails"),
    ],
)
def test_verdicts(printed, tolerance, verdict):
    """The gain margin of 2/(s + 1)^3 is 4."""
    given = {} if tolerance is None else {"tolerance": tolerance}
    assert one(printed={"gm": printed}, **given).verdict == verdict


@pytest.mark.parametrize(
    ("gain", "verdict"), [("0.98", "rounded input"), ("0.9", "differs"), (0.98, "differs")]
)
def test_gains_that_were_rounded(gain, verdict):
    """4.06 belongs to a gain of 0.985, which 0.98 may stand for and 0.9 not."""
    assert one(printed={"gm": "4.06"}, controller={"num": [gain], "den": [1]}).verdict == verdict


def test_nothing_of_the_file_is_code():
    """A question and a rule are words of a list."""
    with pytest.raises(KeyError):
        one(printed={"gm": "4"}, question="__import__")
    with pytest.raises(KeyError):
        one(printed={"kp": "4"}, question="reaction_rule", rule="eval", kind="PI")


def test_a_loop_with_dead_time():
    """Of ControlSystems.jl: 2 exp(-s)/s with unit feedback, a polynomial from dead time to dead time."""
    t = np.linspace(0.0, 3.0, 301)
    y = pidalab.step_response(pidalab.Loop(pidalab.ipdt(2.0, delay=1.0), 1.0), t).y
    expected = 2 * np.maximum(t - 1, 0) - 2 * np.maximum(t - 2, 0) ** 2
    assert y == pytest.approx(expected, abs=1e-12)
