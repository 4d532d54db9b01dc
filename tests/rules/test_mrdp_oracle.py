"""The exact engine against the oracle of loops tuned by multiple real dominant poles, some stiff, some unstable."""

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
