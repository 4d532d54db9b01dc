"""Compute numbers that other sources print."""

import foreign_tables
import numpy as np
import pytest

import pidalab


def test_printed_numbers_have_their_stored_verdicts():
    rows = foreign_tables.rows()
    assert sum(row.verdict in foreign_tables.AGREEING for row in rows) >= 0.9 * len(rows) > 180
    wrong = [row for row in rows if row.verdict != row.stored]
    assert not wrong, "\n".join(map(str, wrong))


def test_a_loop_with_dead_time():
    """The example of ControlSystems.jl is 2 exp(-s)/s. Its response is a polynomial within each dead time."""
    t = np.linspace(0.0, 3.0, 301)
    y = pidalab.step_response(pidalab.Loop(pidalab.ipdt(2.0, delay=1.0), 1.0), t).y
    expected = 2 * np.maximum(t - 1, 0) - 2 * np.maximum(t - 2, 0) ** 2
    assert y == pytest.approx(expected, abs=1e-12)
