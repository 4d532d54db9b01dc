"""Margins, peaks and crossovers against the oracle: to 1e-9, as the engine; where peaks lie, to 1e-6: they are flat."""

import numpy as np
import pytest
from engine_errors import oracle, oracle_loop

import pidalab
from pidalab._compiled import TIER
from pidalab.robustness import _scan, _summits
from pidalab.robustness._arrays import COMPLEMENTARY, DIFFERENCE, SENSITIVITY
from pidalab.robustness.loops import explore
from pidalab.robustness.peaks_and_crossovers import UNWEIGHTED

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


@pytest.mark.parametrize("case", STABLE, ids=lambda case: case["name"])
def test_peak_of_the_sensitivity_alone(case):
    assert pidalab.max_sensitivity(oracle_loop(case))[0] == pytest.approx(
        float(case["values"]["ms"]), rel=1e-9
    )


@pytest.mark.parametrize(
    "case", [case for case in CASES if case["unstable_poles"]], ids=lambda case: case["name"]
)
def test_an_unstable_loop_says_so(case):
    found = pidalab.margins(oracle_loop(case))
    assert (found.stable, found.unstable_poles) == (False, case["unstable_poles"])


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_both_forms_of_the_scans_agree(case):
    """In array operations and walked through point by point: the same crossovers, the same heights of peaks."""
    looked = explore(oracle_loop(case))
    looked.peak(SENSITIVITY)
    if not TIER.allowed:
        pytest.skip("nothing is compiled here: numba is not installed, or switched off")
    of, seen, ones = tuple(looked.of), tuple(looked.on_grid), tuple(UNWEIGHTED)
    pairs = [
        [
            form(*seen, 0.0, 0.0, of)[0]
            for form in (_scan.gain_crossings.python_form, _scan.gain_crossings.dispatcher)
        ],
        [
            form(*seen, 0.1, False, of)
            for form in (_scan.phase_crossings.python_form, _scan.phase_crossings.dispatcher)
        ],
    ]
    for kind in (SENSITIVITY, COMPLEMENTARY, DIFFERENCE):
        forms = (_summits.highest.python_form, _summits.highest.dispatcher)
        pairs.append([form(kind, *seen, np.zeros(0), 0.3, ones, of)[0] for form in forms])
    for plain, compiled in pairs:
        np.testing.assert_allclose(plain, compiled, rtol=1e-12)
