"""The exact engine between dead times, with filters of ordinary and of extreme speed, against the oracle."""

import numpy as np
import pytest
from engine_errors import INPUTS, SIGNALS, oracle, oracle_loop, scale, worst_error

from pidalab.simulation.exact import unit_step_responses

CASES = oracle("between.json")["cases"]


@pytest.mark.parametrize("points", [2, 23, 1001], ids=lambda n: f"{n}points")
@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_each_time_ends_a_grid(case, points):
    error, where = worst_error(case, points)
    assert error <= 1e-9, where


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_in_the_middle_of_a_long_grid(case):
    """Each time is the 3001st of 10,001: the same loop, many runs of times and dead times after it."""
    for i, time in enumerate(case["times"]):
        t = np.linspace(0.0, time / 0.3, 10_001)
        try:
            unit = unit_step_responses(oracle_loop(case), t, "rdn")
        except ValueError as refused:
            if "range of numbers" not in str(refused):
                raise
            continue
        for k, name in enumerate(INPUTS):
            for signal, row in SIGNALS.items():
                error = abs(unit[k, row, 3000] - float(case["values"][name][signal][i]))
                assert error <= 1e-9 * scale(case, name, signal, i), (name, signal, time)


def test_the_oracle_holds_what_it_says():
    """At least thirty loops; no time is near a multiple of the dead time."""
    assert len(CASES) >= 30
    for case in CASES:
        share = np.mod(case["times"], case["delay"]) / case["delay"]
        assert np.all((share > 1e-6) & (share < 1 - 1e-6)), case["name"]
