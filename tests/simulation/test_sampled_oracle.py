"""Responses of loops with a digital controller against the oracle: to 1e-9 of max(1, the largest value so far)."""

import numpy as np
import pytest
from engine_errors import oracle, sampled_oracle_loop

import pidalab


@pytest.mark.parametrize("case", oracle("sampled_loops.json")["cases"], ids=lambda case: case["name"])
def test_responses(case):
    loop, t = sampled_oracle_loop(case), case["sample_time"] * np.arange(case["samples"])
    for source in ("setpoint", "load"):
        found = pidalab.simulate_sampled(loop, t, **{source: 1.0})
        for signal in ("y", "u"):
            if f"{source}.{signal}" in case["values"]:
                true = np.array(case["values"][f"{source}.{signal}"], float)
                error = np.abs(getattr(found, signal)[case["values"]["picked"]] - true)
                assert np.max(error / np.maximum.accumulate(np.maximum(1.0, np.abs(true)))) <= 1e-9


@pytest.mark.parametrize(
    "case",
    [case for case in oracle("sampled_loops.json")["cases"] if case["method"] == "zoh"],
    ids=lambda case: case["name"],
)
def test_a_continuous_controller_is_discretised_for_held_inputs(case):
    """It is the digital controller of the method zoh."""
    loop, t = sampled_oracle_loop(case, digital=False), case["sample_time"] * np.arange(case["samples"])
    found = pidalab.simulate_sampled(loop, t, setpoint=1.0)
    true = np.array(case["values"]["setpoint.y"], float)
    assert np.max(np.abs(found.y[case["values"]["picked"]] - true)) <= 1e-9
