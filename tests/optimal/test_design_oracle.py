"""The optimum against a bound that no PI controller can pass, and against optima of high precision.

The IAE of the search is that of straight lines between samples, so its least value is off by END at most, as the
optimum is level; the limits are kept to a billionth.
"""

import pytest
from engine_errors import oracle

import pidalab

END = 1e-6


@pytest.mark.parametrize("case", oracle("optima.json")["cases"], ids=lambda case: case["name"])
def test_least_iae(case):
    process = pidalab.Process(case["process"]["num"], case["process"]["den"], case["delay"])
    found, least = pidalab.optimal.load(process, 0, ms=case["ms"]), float(case["values"]["iae_at_least"])
    assert found.controller.filter_time == pytest.approx(case["filter_time"], rel=1e-9)  # its edge
    assert least * (1 - 1e-9) <= found.iae <= least * (1 + END)


@pytest.mark.parametrize("case", oracle("limited_optima.json")["cases"], ids=lambda case: case["name"])
def test_least_iae_under_limits_of_noise(case):
    process = pidalab.Process(case["process"]["num"], case["process"]["den"])
    found = pidalab.optimal.load(process, case["order"], ms=case["ms"], mks=case["mks"])
    assert found.iae == pytest.approx(float(case["values"]["iae"]), rel=END)


@pytest.mark.parametrize("case", oracle("delayed_optima.json")["cases"], ids=lambda case: case["name"])
def test_least_iae_with_dead_time(case):
    process = pidalab.Process(case["process"]["num"], case["process"]["den"], case["delay"])
    found = pidalab.optimal.load(process, case["order"], ms=case["ms"], mks=case["mks"])
    least = float(case["values"]["iae"])
    assert least * (1 - 1e-8) <= found.iae <= least * (1 + END)
