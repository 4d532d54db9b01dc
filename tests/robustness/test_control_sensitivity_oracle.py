"""The largest gain from noise to the control signal against the oracle: to 1e-9, its place to 1e-6."""

import pytest
from engine_errors import oracle, oracle_loop

from pidalab.robustness import max_control_sensitivity

CASES = [case for case in oracle("margins.json")["cases"] if case["values"].get("mks")]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_peak_of_the_control_sensitivity(case):
    mks, at = max_control_sensitivity(oracle_loop(case))
    assert mks == pytest.approx(float(case["values"]["mks"]), rel=1e-9)
    assert at == pytest.approx(float(case["values"]["wmks"]), rel=1e-6)
