"""The optimum against a bound that no PI controller can pass: within 1e-4, as the search keeps 2e-5 of a limit free."""

import pytest
from engine_errors import oracle

import pidalab


@pytest.mark.parametrize("case", oracle("optima.json")["cases"], ids=lambda case: case["name"])
def test_least_iae(case):
    process = pidalab.Process(case["process"]["num"], case["process"]["den"], case["delay"])
    found, least = pidalab.optimal.load(process, 0, ms=case["ms"]), float(case["values"]["iae_at_least"])
    assert found.controller.filter_time == pytest.approx(case["filter_time"], rel=1e-9)  # its edge
    assert least * (1 - 1e-9) <= found.iae <= least * (1 + 1e-4)
