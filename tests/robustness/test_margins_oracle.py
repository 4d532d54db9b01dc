"""Margins, peaks and crossovers against the oracle: to 1e-9, as the engine; where peaks lie, to 1e-6: they are flat."""

import numpy as np
import pytest
from engine_errors import oracle, oracle_loop

import pidalab
from pidalab._compiled import TIER
from pidalab.robustness import walk
from pidalab.robustness.axis import COMPLEMENTARY, DIFFERENCE, SENSITIVITY
from pidalab.robustness.in_s import UNWEIGHTED, axis_in_s

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
def test_both_forms_of_the_walk_agree(case):
    """In array operations and walked through point by point: the same crossovers, the same heights of peaks."""
    axis = axis_in_s(oracle_loop(case))
    walk.along(axis.grid, 0.0, 0.0, tuple(axis.factors))  # decides whether there is compiled code
    if not TIER.allowed:
        pytest.skip("nothing is compiled here: numba is not installed, or switched off")
    factors, samples, one = tuple(axis.factors), tuple(axis.on_grid), tuple(UNWEIGHTED)
    calls = [
        (walk.gain_crossings, lambda form: form(*samples, 0.0, 0.0, factors)[0]),
        (walk.phase_crossings, lambda form: form(*samples, 0.1, False, factors)),
    ]
    for kind in (SENSITIVITY, COMPLEMENTARY, DIFFERENCE):
        calls.append(
            (walk.highest, lambda form, kind=kind: form(kind, *samples, np.zeros(0), 0.3, one, factors)[0])
        )
    for kernel, call in calls:
        np.testing.assert_allclose(call(kernel.python_form), call(kernel.dispatcher), rtol=1e-12)
