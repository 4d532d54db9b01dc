"""The noise gain of sampled loops against the oracle: to 1e-9, while 1e-12 of the squares may be left out."""

import pytest
from engine_errors import oracle, sampled_oracle_loop

import pidalab

CASES = [case for case in oracle("sampled_loops.json")["cases"] if case["values"]["stable"]]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_noise_gain(case):
    found = pidalab.noise_gain(sampled_oracle_loop(case), case["sample_time"])
    assert found == pytest.approx(float(case["values"]["noise_gain"]), rel=1e-9)


@pytest.mark.parametrize("case", [c for c in CASES if c["method"] == "zoh"], ids=lambda case: case["name"])
def test_noise_gain_of_a_continuous_controller(case):
    found = pidalab.noise_gain(sampled_oracle_loop(case, digital=False), case["sample_time"])
    assert found == pytest.approx(float(case["values"]["noise_gain"]), rel=1e-9)
