"""Margins of loops with a digital controller against the oracle: to 1e-9, as the engine; places of peaks to 1e-6."""

import numpy as np
import pytest
from engine_errors import oracle, sampled_oracle_loop

import pidalab

CASES = oracle("sampled_loops.json")["cases"]
STABLE = [case for case in CASES if case["values"]["stable"]]
PLACES = {"wgc": 1e-9, "wpc": 1e-9, "wms": 1e-6, "wmt": 1e-6}


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_stability(case):
    assert pidalab.is_stable(sampled_oracle_loop(case)) == case["values"]["stable"]


@pytest.mark.parametrize("case", STABLE, ids=lambda case: case["name"])
def test_margins(case):
    found, true = pidalab.margins(sampled_oracle_loop(case)), case["values"]["margins"]
    for name in ("gm", "gm_low", "pm", "dm", "ms", "mt"):
        assert getattr(found, name) == pytest.approx(float(true[name]), rel=1e-9), name
    for name, tolerance in PLACES.items():
        assert getattr(found, name) == pytest.approx(float(true[name]), rel=tolerance, nan_ok=True), name
    for name in ("gain_crossovers", "phase_crossovers"):
        np.testing.assert_allclose(getattr(found, name), np.array(true[name], float), rtol=1e-9)
