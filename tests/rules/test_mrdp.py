"""Check multiple real dominant pole tuning: the defining equations, stability limits and the oracle."""

import mpmath
import numpy as np
import pytest
from engine_errors import SIGNALS, oracle, oracle_loop, worst_error

import pidalab
from pidalab.rules import mrdp
from pidalab.simulation.exact import unit_step_responses

UNIT = pidalab.ipdt(1.0, delay=1.0)


def taylor_constants(m):
    """Return p_o, K_o, tau_i and tau_1 ... from the Taylor polynomial of x^2 e^x at p_o, in 60 digits."""
    with mpmath.workdps(60):
        pole = mpmath.sqrt(m + 2) - (m + 2)
        ascending = [mpmath.mpf(0)]
        for k in range(m + 1, -1, -1):  # Horner in powers of (x - pole)
            value = mpmath.exp(pole) * (pole**2 + 2 * k * pole + k * (k - 1)) / mpmath.factorial(k)
            shifted = [mpmath.mpf(0), *ascending]
            ascending = [a - pole * b for a, b in zip(shifted, [*ascending, mpmath.mpf(0)], strict=True)]
            ascending[0] += value
        c = [-value for value in ascending[: m + 2]]
        return pole, c[1], c[1] / c[0], [value / c[1] for value in c[2:]]


@pytest.mark.parametrize("m", [0, 1, 2, 3, 7, 24])
def test_closed_form_is_the_taylor_polynomial(m):
    pole, gain, integral_time, derivative_times = taylor_constants(m)
    got = mrdp.constants(m)
    assert got.pole == pytest.approx(float(pole), rel=1e-14)
    assert got.gain == pytest.approx(float(gain), rel=2e-14)
    assert got.integral_time == pytest.approx(float(integral_time), rel=2e-14)
    assert got.derivative_times == pytest.approx([float(x) for x in derivative_times], rel=2e-14)


@pytest.mark.parametrize("m", range(6))
def test_pole_has_multiplicity_m_plus_3(m):
    """All derivatives of x^2 e^x + N(x) up to the order m + 2 vanish at the pole, and the next one does not."""
    unit = mrdp.constants(m)
    for k in range(m + 4):
        first = (unit.pole**2 + 2 * k * unit.pole + k * (k - 1)) * np.exp(unit.pole)
        second = np.polyval(np.polyder(unit.numerator, k), unit.pole)
        assert (abs(first + second) < 1e-13) == (k < m + 3)


@pytest.mark.parametrize(("m", "n"), [(m, n) for m in range(6) for n in (m + 1, m + 3)])
def test_filter_ratio_puts_both_poles_at_the_same_place(m, n):
    """The derivative of order m + 2 of s^2 (s + 1)^n vanishes at p_o T_f / T_e, and nowhere nearer to 0."""
    derivative = np.polyder(np.convolve([1.0, 0.0, 0.0], np.poly(-np.ones(n))), m + 2)
    pole = mrdp.filter_ratio(m, n) * mrdp.constants(m).pole
    assert -1 < pole < 0
    assert np.polyval(derivative, pole) / np.polyval(np.polyder(derivative), pole) == pytest.approx(
        0, abs=1e-9
    )
    assert np.all(np.polyval(derivative, np.linspace(0.999 * pole, 0.0, 200)) > 0)


@pytest.mark.parametrize(("m", "p"), [(m, p) for m in range(6) for p in range(1, m + 2)])
def test_prefilter_cancels_p_poles(m, p):
    design = mrdp.tune(pidalab.ipdt(0.3, delay=2.0), m, max(m, 1), te=0.7, cancelled=p)
    num, den = design.prefilter.num[0][0], design.prefilter.den[0][0]
    assert num / num[-1] == pytest.approx(np.poly([design.pole] * p) / (-design.pole) ** p, rel=1e-12)
    controller = design.controller.transfer_function().num[0][0]
    assert den / den[-1] == pytest.approx(controller / controller[-1], rel=1e-12)


@pytest.mark.parametrize(
    ("m", "n", "te", "p"), [(0, 0, 0.0, 1), (0, 2, 0.3, 1), (1, 1, 0.01, 2), (2, 4, 0.5, 2), (4, 6, 1.0, 5)]
)
def test_integral_of_the_error_does_not_depend_on_the_filter(m, n, te, p):
    design = mrdp.tune(UNIT, m, n, te, cancelled=p)
    run = pidalab.step_response(design.loop(), np.linspace(0, 60, 6001))
    assert run.ie() == pytest.approx(design.ie, rel=1e-8)
    assert run.iae() >= design.ie * (1 - 1e-9)


@pytest.mark.parametrize(("m", "n"), [(m, n) for m in (2, 3, 6) for n in (m, m + 2)])
def test_smallest_te_is_the_only_border(m, n):
    limit = mrdp.smallest_te(m, n)
    for factor in (0.9, 0.999, 1.001, 1.5, 100.0):
        assert pidalab.is_stable(mrdp.tune(UNIT, m, n, factor * limit).loop()) == (factor > 1)
    below, above = (
        pidalab.rightmost_poles(mrdp.tune(UNIT, m, n, x * limit).loop())[0].real for x in (0.999, 1.001)
    )
    assert below > 0 > above


@pytest.mark.parametrize(
    ("m", "n", "delay"),
    [(0, 1, 0.0), (4, 9, 0.0), (10, 10, 0.0), (0, 1, 1.0), (0, 6, 1.0), (1, 1, 1.0), (1, 6, 1.0)],
)
def test_pi_and_pid_and_models_without_dead_time_are_stable_with_any_filter(m, n, delay):
    for te in (1e-4, 1.0, 1e2):
        design = mrdp.tune(pidalab.ipdt(-2.0, delay=delay), m, n, te)
        assert pidalab.is_stable(design.loop())
        assert design.smallest_te == 0.0


# The exact engine against the oracle of loops tuned by multiple real dominant poles, some stiff, some unstable.

ORACLE = oracle("mrdp_loops.json")
BURSTS = "mrdp_m4_n5_te0.05_delay1_p5"
each_case = pytest.mark.parametrize("case", ORACLE["cases"], ids=lambda case: case["name"])


@each_case
@pytest.mark.parametrize("points", [2, 14, 401], ids=lambda n: f"{n}points")
def test_engine(case, points):
    """Errors are at most 1e-9 of the scales of test_exact, at times aligned with the dead time or not.

    One loop grows in bursts that a coarse grid misses. Its values would have no digits, so they are refused.
    """
    if case["name"] == BURSTS and points < 401:
        with pytest.raises(ValueError, match="request more times"):
            worst_error(case, points)
        return
    error, where = worst_error(case, points)
    assert error <= 1e-9, where


@each_case
def test_design(case):
    """The rule gives the stored loop up to rounding. Only unstable loops have an envelope."""
    loop = pidalab.rules.mrdp.tune(pidalab.ipdt(**case["model"]), **case["design"]).loop()
    for name in ("process", "controller", "prefilter"):
        for ours, stored in zip(loop.blocks[name], oracle_loop(case).blocks[name], strict=True):
            np.testing.assert_allclose(ours, stored, rtol=1e-13)
    assert pidalab.is_stable(loop) == ("envelope" not in case)


@pytest.mark.parametrize(
    "case", [c for c in ORACLE["cases"] if "envelope" in c], ids=lambda case: case["name"]
)
def test_envelope(case):
    """The largest values match the envelope to 1e-9, also between the stored times."""
    times, grid = np.array(case["times"]), case["delay"] * np.arange(161) / 8
    unit = np.abs(unit_step_responses(oracle_loop(case), grid, "rd"))
    seen = np.searchsorted(grid, times, side="right") - 1
    for k, source in enumerate(("setpoint", "load")):
        for signal, row in SIGNALS.items():
            values = np.abs(np.array(case["values"][source][signal], dtype=float))
            largest = np.maximum(np.maximum.accumulate(unit[k, row])[seen], np.maximum.accumulate(values))
            np.testing.assert_allclose(largest, case["envelope"][source][signal], rtol=1e-9, atol=1e-9)
