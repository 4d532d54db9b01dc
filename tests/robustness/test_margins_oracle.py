"""Margins, peaks and crossovers against the oracle: to 1e-9, as the engine; where peaks lie, to 1e-6: they are flat."""

import numpy as np
import pytest
from engine_errors import oracle, oracle_loop

import pidalab

CASES = oracle("margins.json")["cases"]
HEIGHTS = ("gm", "gm_low", "pm", "dm", "ms", "mt")
PLACES = {"wgc": 1e-9, "wpc": 1e-9, "wms": 1e-6, "wmt": 1e-6}
STABLE = [case for case in CASES if not case["unstable_poles"]]


@pytest.mark.parametrize("case", STABLE, ids=lambda case: case["name"])
def test_margins(case):
    found, true = pidalab.margins(oracle_loop(case)), case["values"]
    assert found.stable
    for name in HEIGHTS:
        assert getattr(found, name) == pytest.approx(float(true[name]), rel=1e-9), name
    for name, tolerance in PLACES.items():
        assert getattr(found, name) == pytest.approx(float(true[name]), rel=tolerance, nan_ok=True), name


@pytest.mark.parametrize("case", STABLE, ids=lambda case: case["name"])
def test_crossovers(case):
    """All of them, and no other."""
    found = pidalab.margins(oracle_loop(case))
    for name in {"gain_crossovers", "phase_crossovers"} & set(case["values"]):
        np.testing.assert_allclose(getattr(found, name), np.array(case["values"][name], float), rtol=1e-9)
