"""Feed random records and files to the library and the command line: an answer, or a one-line error."""

import re

import drawn
import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, strategies as st

import pidalab
from pidalab.plant.cli import main

SPOILS = ("nothing", "gaps", "nan", "twice", "backwards", "words", "short", "quantised", "still", "huge")


@st.composite
def tables(draw):
    """Draw a step test with up to three faults."""
    rng = np.random.default_rng(draw(st.integers(0, 2**31)))
    n = draw(st.integers(3, 300))
    t = np.cumsum(rng.uniform(0.5, 1.5, n))
    u = np.where(t > t[-1] * 0.2, 47.0, 40.0)
    y = 20 + 14 * np.maximum(1 - np.exp(-(t - t[-1] * 0.3) / (0.1 * t[-1])), 0) + rng.normal(0, 0.05, n)
    for spoil in draw(st.lists(st.sampled_from(SPOILS), max_size=3)):
        at = rng.integers(0, n, max(1, n // 10))
        if spoil == "gaps":
            t = t + np.where(np.arange(n) > n // 2, 3 * t[-1], 0)
        elif spoil == "nan":
            y[at] = np.nan
        elif spoil == "twice":
            t[at] = t[np.maximum(at - 1, 0)]
        elif spoil == "backwards":
            t = t[::-1]
        elif spoil == "quantised":
            y = np.round(y)
        elif spoil == "still":
            u = np.full(n, 40.0)
        elif spoil == "huge":
            y = np.minimum(y, 1e6) * 1e200
    return t, u, y


def lines_of(table, separator, words):
    rows = [["time", "valve", "level"], *([f"{x:.6g}" for x in row] for row in zip(*table, strict=True))]
    if words:
        rows[len(rows) // 2][2] = "Bad"
    return "\n".join(separator.join(row) for row in rows) + "\n"


@pytest.mark.filterwarnings("ignore::UserWarning")
@drawn.cases(12)
@given(tables())
def test_records_and_fits(table):
    try:
        record = pidalab.Record(*table)
        fit = pidalab.identification.fit(record, model="fopdt")
    except (TypeError, ValueError):
        return
    assert all(np.isfinite(value) for value in fit.parameters.values())


@drawn.cases(6, share=0.2)
@given(tables(), st.sampled_from(",;\t"), st.booleans())
def test_tune_command(tmp_path_factory, table, separator, words):
    path = tmp_path_factory.mktemp("fuzz") / "record.csv"
    path.write_text(lines_of(table, separator, words), encoding="utf-8")
    done = CliRunner().invoke(main, ["tune", str(path), "--kind", "PI", "--rule", "simc", "--model", "fopdt"])
    _in_one_line(done)


@drawn.cases(20)
@given(st.binary(max_size=400))
def test_any_file(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("fuzz") / "record.csv"
    path.write_bytes(content)
    done = CliRunner().invoke(main, ["tune", str(path)])
    _in_one_line(done)
    assert done.exit_code != 0


def _in_one_line(done):
    """Check that a command succeeded, or failed with one line of explanation."""
    assert done.exception is None or isinstance(done.exception, SystemExit), repr(done.exception)
    if done.exit_code:
        said = [line for line in done.stderr.splitlines() if line and not re.match("Usage|Try", line)]
        assert len(said) == 1, done.stderr
