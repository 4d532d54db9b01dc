"""The exact engine against the oracle of loops tuned by multiple real dominant poles, some stiff, some unstable."""

from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from engine_errors import SIGNALS, oracle, oracle_loop, worst_error

import pidalab
from pidalab.simulation.exact import unit_step_responses

ORACLE = oracle("mrdp_loops.json")
BURSTS = "mrdp_m4_n5_te0.05_delay1_p5"
each_case = pytest.mark.parametrize("case", ORACLE["cases"], ids=lambda case: case["name"])


@each_case
@pytest.mark.parametrize("points", [2, 14, 401], ids=lambda n: f"{n}points")
def test_engine(case, points):
    """1e-9, relative to the same scales as in test_exact, at every time, aligned with the dead time or not.

    One loop grows in bursts that a coarse grid misses. What it would show has no digits: that is refused.
    """
    if case["name"] == BURSTS and points < 401:
        with pytest.raises(ValueError, match="far larger ones; ask for more times"):
            worst_error(case, points)
        return
    error, where = worst_error(case, points)
    assert error <= 1e-9, where


@each_case
def test_design(case):
    """The rule still gives this loop, up to rounding; the unstable ones, and only they, have an envelope."""
    loop = pidalab.rules.mrdp.tune(pidalab.ipdt(**case["model"]), **case["design"]).loop()
    for name in ("process", "controller", "prefilter"):
        for ours, stored in zip(loop.blocks[name], oracle_loop(case).blocks[name], strict=True):
            np.testing.assert_allclose(ours, stored, rtol=1e-13)
    assert pidalab.is_stable(loop) == ("envelope" not in case)


@each_case
def test_closed_form(case):
    """Up to two dead times feedback has not reached the output: after a load step y = K (t - L) to 100 digits."""
    gain, delay = Fraction(case["model"]["gain"]), Fraction(case["delay"])
    for time, text in zip(map(Fraction, case["times"]), case["values"]["load"]["y"], strict=True):
        if time <= 2 * delay:
            assert abs(Fraction(text) - gain * max(0, time - delay)) <= Fraction(1, 10**100)


@each_case
def test_digits(case):
    """One value per time; after two dead times, where none ends early, all have 100 digits and more."""
    late = [time > 2 * case["delay"] for time in case["times"]]
    for row in (row for rows in case["values"].values() for row in rows.values()):
        values = [Decimal(text) for text in row]
        digits = [len(value.as_tuple().digits) for value, keep in zip(values, late, strict=True) if keep]
        assert min(digits) >= 100
    assert ORACLE["digits"] >= 100


@pytest.mark.parametrize(
    "case", [c for c in ORACLE["cases"] if "envelope" in c], ids=lambda case: case["name"]
)
def test_envelope(case):
    """The engine diverges as the envelope does, to 1e-9, also where the growth is in bursts between the times."""
    times, grid = np.array(case["times"]), case["delay"] * np.arange(161) / 8
    unit = np.abs(unit_step_responses(oracle_loop(case), grid, "rd"))
    seen = np.searchsorted(grid, times, side="right") - 1
    for k, source in enumerate(("setpoint", "load")):
        for signal, row in SIGNALS.items():
            values = np.abs(np.array(case["values"][source][signal], dtype=float))
            largest = np.maximum(np.maximum.accumulate(unit[k, row])[seen], np.maximum.accumulate(values))
            np.testing.assert_allclose(largest, case["envelope"][source][signal], rtol=1e-9, atol=1e-9)
