"""Check the series controllers of huba2024 by closed forms and by their multiple poles."""

import math

import mpmath
import numpy as np
import pytest

import pidalab
from pidalab.rules import automatic_reset as reset

UNIT = pidalab.ipdt(1.0, delay=1.0)


def numerator(setting):
    """Return the descending coefficients of (kp + kd x + ka x²)(1 + ti x)/ti."""
    return np.convolve([setting.ka, setting.kd, setting.kp], [setting.ti, 1.0]) / setting.ti


def test_closed_form_of_pi():
    """Equation (15), with c = e^{√2-2} (10√2 - 14, 2√2 - 2)."""
    root = math.sqrt(2)
    assert reset.PI.kp == pytest.approx(2 * (root - 1) * math.exp(root - 2), rel=1e-14)
    assert reset.PI.ti == pytest.approx(3 + 2 * root, rel=1e-13)


def test_closed_form_of_pid():
    root = math.sqrt(3)
    c = math.exp(root - 3) * np.array([root - 1, 12 * root - 18, 42 * root - 72])
    assert numerator(reset.PID)[1:] == pytest.approx(c, rel=1e-12)
    zeros = np.roots(c)
    assert reset.PID.ti == pytest.approx(-1 / zeros.min(), rel=1e-12)
    assert reset.PID.times[0] == pytest.approx(-1 / zeros.max(), rel=1e-12)


def test_closed_form_of_pida():
    """With x = y - 3 the numerator 8/3 + 8x + 3x² + x³/3 becomes y³ - 3y - 10, solved by Cardano."""
    assert numerator(reset.MRDP_PIDA) == pytest.approx(np.exp(-2) * np.array([1 / 3, 3, 8, 8 / 3]), rel=1e-13)
    y = sum((5 + sign * 2 * math.sqrt(6)) ** (1 / 3) for sign in (-1, 1))
    assert reset.MRDP_PIDA.ti == pytest.approx(1 / (3 - y), rel=1e-13)
    assert pytest.approx(1 / (3 + y / 2), rel=1e-13) == reset.TAU_2


def test_quintuple_pole():
    """All derivatives of eq. (13) up to the fourth vanish at -2/T_d, in 40 digits. The fifth does not."""
    design = reset.tune(pidalab.ipdt(0.5, delay=2.0), reset.MRDP_PIDA, n=2, filter_time=1.0, weight=0)
    with mpmath.workdps(40):

        def quasi(s):
            stabiliser = design.ka * s**2 + design.kd * s + design.kp
            return s**2 * design.ti * mpmath.exp(2 * s) + 0.5 * stabiliser * (1 + design.ti * s)

        derivatives = [mpmath.diff(quasi, -1, k) for k in range(6)]
    assert max(abs(x) for x in derivatives[:5]) < 1e-13
    assert derivatives[5] > 1


@pytest.mark.parametrize("setting", [reset.PI, reset.PID], ids=lambda setting: setting.name)
def test_rightmost_poles(setting):
    """With a very short filter the poles lie near -1/T_0. PIDA without a filter is of advanced type."""
    order = len(np.trim_zeros(numerator(setting), "f")) + 1
    design = reset.tune(UNIT, setting, n=1, filter_time=1e-4, weight=0)
    poles = pidalab.rightmost_poles(design.loop(), count=order)
    assert abs(np.mean(poles[:order]) + 1 / setting.lag) < 1e-2
    assert np.max(np.abs(poles + 1 / setting.lag)) < 3 * 1e-4 ** (
        1 / order
    )  # a k-fold pole moves with the k-th root


def test_equation_29():
    """The changed controller has the double zero twice in its stabiliser and reset together, and the old T_i."""
    for ratio in (0.7, 1.0, 1.5):
        setting = reset.double_zero(ratio)
        short, base = ratio * reset.TAU_2, reset.MRDP_PIDA
        expected = base.kp / base.ti * np.poly([-1 / short] * 2 + [-1 / base.ti]) * short**2 * base.ti
        assert numerator(setting) == pytest.approx(expected, rel=1e-12)


def test_prefilter_cancels_the_zeros():
    for setting in reset.SETTINGS.values():
        design = reset.tune(UNIT, setting, n=4, filter_time=0.2)
        zeros = np.sort_complex(np.roots(design.controller.transfer_function().num[0][0]))
        poles = np.sort_complex(np.roots(design.prefilter.den[0][0]))
        assert poles == pytest.approx(zeros, rel=1e-6)
        assert design.prefilter.num[0][0].tolist() == [design.prefilter.den[0][0][-1]]


def test_prefilter_that_cancels_a_pole():
    """Equation (22): b_1 = T_0 = T_d/2."""
    design = reset.tune(UNIT, reset.MRDP_PIDA, n=4, filter_time=0.2, cancelled=1)
    assert design.lead == pytest.approx(0.9)
    assert complex(design.prefilter(-1 / 0.9)) == pytest.approx(0, abs=1e-12)
    assert complex(design.prefilter(0.0)) == pytest.approx(1)
    t = np.linspace(0, 40, 4001)
    plain = pidalab.step_response(reset.tune(UNIT, reset.MRDP_PIDA, n=4, filter_time=0.2).loop(), t)
    assert pidalab.step_response(design.loop(), t).iae() < plain.iae() - 0.8


@pytest.mark.parametrize("setting", reset.SETTINGS.values(), ids=reset.SETTINGS)
def test_loops_are_stable_and_keep_their_filter(setting):
    """Check equations (10) and (11), and the filter as a part of the model (sec. 3.1)."""
    for weight in (1.0, 0.5):
        design = reset.tune(UNIT, setting, n=4, filter_time=0.2, weight=weight, limits=(-0.1, 0.1))
        assert (design.te, design.delay) == pytest.approx((0.8 * weight, 1.0 + 0.8 * weight))
        assert (design.controller.filter_time, design.controller.filter_order) == (0.2, 4)
        assert pidalab.is_stable(design.loop()) or weight < 1.0
        assert design.controller.limits == (-0.1, 0.1)
