"""Measures of sampled responses against the oracle.

The errors are those that parabolas between samples are expected to make, and straight lines where only samples are
taken: make_measures.py derives them, and the file has their sizes. Twice that is allowed for steps that are not small,
and 1e-9 for the engine.
"""

import numpy as np
import pytest
from engine_errors import oracle, oracle_loop

import pidalab

POWERS = {
    "iae": 4,
    "ise": 4,
    "itae": 4,
    "overshoot": 3,
    "tv_u": 2,
    "tv_y": 2,
    "rise_time": 2,
    "settling_time": 2,
}
CASES = oracle("measures.json")["cases"]


def measures(response, step_of_setpoint):
    """All that the oracle has."""
    found = {name: getattr(response, name)() for name in ("ie", "iae", "ise", "itae")}
    found |= {"tv_u": response.tv("u"), "tv_y": response.tv("y")}
    if step_of_setpoint:
        found |= {name: getattr(response, name)() for name in ("overshoot", "rise_time", "settling_time")}
    return found


@pytest.mark.parametrize("finer", [16, 64])
@pytest.mark.parametrize("source", ["setpoint", "load"])
@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_measures(case, source, finer):
    """With two sample times: what falls with a power of the step is seen to fall."""
    h, own = case["step"] / finer, case[source]
    t = np.linspace(0.0, case["end"], round(case["end"] / h) + 1)
    simulate = pidalab.step_response if source == "setpoint" else pidalab.load_response
    found = measures(simulate(oracle_loop(case), t), source == "setpoint")
    assert found.keys() == own["values"].keys()
    for name, value in found.items():
        true = float(own["values"][name])
        allowed = 2 * own["rates"].get(name, 0.0) * h ** POWERS.get(name, 1)
        assert value == pytest.approx(true, rel=0.0, abs=allowed + 1e-9 * max(1.0, abs(true))), name
