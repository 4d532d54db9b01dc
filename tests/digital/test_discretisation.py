"""Check each method of discretisation."""

import math
from itertools import product

import numpy as np
import pytest
from cases import CASES
from mpmath import mp

from pidalab import PIDA, HighOrderPID, NonInteractivePIDA, SeriesPIDA
from pidalab.rules.haalman import OutputFilter

CONTROLLERS = {
    "pi": PIDA(1.3, 3.3),
    "pd": PIDA(1.3, math.inf, 0.9),
    "pida": PIDA(1.3, 3.3, 0.9, 0.27, 5, 3),
    "non-interactive": NonInteractivePIDA(1.0, 2.0, 0.5, 1.0, 0.2, 0.1),
    "high order": HighOrderPID([0.4, 1.3, 1.0, 0.3], 0.3, 5),
    "filtered I": HighOrderPID([0.4, 0.0], 0.3, 2),
    "series": SeriesPIDA(0.5, 0.4, 0.05, 0.9, 0.2, 4),
    "series P": SeriesPIDA(0.5, 0.0, 0.0, 0.9, 0.2, 0),
}
Z = np.exp(1j * np.array([1e-4, 0.01, 0.3, 1.0, 3.0])) * np.array([1.0, 1.0, 1.0, 1.05, 0.9])
H = 0.07


def held(controller, h, time=1.0, order=0):
    """Return values at Z of a controller with equal lags, discretised for a held input in high precision."""
    with mp.workdps(30):
        return [complex(held_at(controller, h, time, order, z)) for z in Z]


def held_at(controller, h, time, order, z):
    total = mp.mpf(0)
    for part in controller.parts():
        lags = [mp.mpf(part.filter_time)] * part.filter_order + [mp.mpf(time)] * order
        n = len(lags)
        # The states are the integral of the last lag, the lags, and the input.
        generator = mp.zeros(n + 2)
        generator[0, n or 1] = 1
        for j, lag in enumerate(lags, start=1):
            generator[j, j], generator[j, j - 1 if j > 1 else n + 1] = -1 / lag, 1 / lag
        transition = mp.expm(generator * mp.mpf(h))
        phi, gamma = transition[: n + 1, : n + 1], transition[: n + 1, n + 1]
        states = mp.lu_solve(mp.mpc(z) * mp.eye(n + 1) - phi, gamma)
        # the chain, then s times the chain, and so on
        powers = [mp.mpf(1), *(states[j] for j in range(1, n + 1))]
        total += part.gains[0] * states[0]
        for gain in part.gains[1:]:
            total += gain * powers[-1]
            last = lags[n - len(powers) + 1 :] if len(powers) > 1 else []
            powers = [
                (before - after) / lag for before, after, lag in zip(powers, powers[1:], last, strict=False)
            ] or [mp.mpf(0)]
    return total


@pytest.mark.parametrize("way", ["reset", "clamping"])
@pytest.mark.parametrize("name", CONTROLLERS)
def test_substitutions(name, way):
    for method, s in (("backward", (1 - 1 / Z) / H), ("tustin", 2 / H * (Z - 1) / (Z + 1))):
        if name == "filtered I" and way == "reset":
            continue  # the reset needs kp
        k = CONTROLLERS[name].discretise(H, method, anti_windup=way)
        np.testing.assert_allclose(k(Z), CONTROLLERS[name](s), rtol=1e-9)
        np.testing.assert_allclose(k.transfer_function()(Z), k(Z), rtol=1e-6)


@pytest.mark.parametrize("name", CONTROLLERS)
@pytest.mark.parametrize("h", [0.07, 1e-4])
def test_held_input(name, h):
    k = CONTROLLERS[name].discretise(h, "zoh", anti_windup="clamping")
    np.testing.assert_allclose(k(Z), held(CONTROLLERS[name], h), rtol=1e-7 if h < 0.01 else 1e-9)


def test_reset_behind_a_held_input():
    """The series is (1 + lag of the signal, one sample late) times the stabilising series."""
    series = CONTROLLERS["series"]
    gains = [0.0, series.kp, series.kd, series.ka]
    stabiliser = HighOrderPID(gains, series.filter_time, series.filter_order)
    a = math.exp(-H / series.ti)
    expected = np.array(held(stabiliser, H)) * (1 + (1 - a) / (Z - 1))
    np.testing.assert_allclose(series.discretise(H, "zoh")(Z), expected, rtol=1e-9)


PID = PIDA(1.0, 2.0, 0.5)


@pytest.mark.parametrize(
    ("controller", "h", "message"),
    [
        (
            PIDA(2.0, 1.0),
            60.0,
            r"sample_time should be at most the integral time kp/ki, 1, found 60",
        ),
        (PIDA(1.0, math.inf, 0.5), 0.6, "at most the derivative time kd/kp, 0.5"),
        (SeriesPIDA(1.0, 0.0, 0.0, 3.0, 0.1, 0), 3.1, "at most the integral time kp/ki, 3"),
    ],
)
def test_long_sample_times_warn(controller, h, message):
    with pytest.warns(UserWarning, match=message):
        controller.discretise(h)
    controller.discretise(h / 100)


def test_gain_of_back_calculation():
    """Back-calculation uses sqrt(ti td), the reset uses the integral time."""
    h, ti, td = 0.1, 2.0, 0.5

    def gain(way, controller=PID):
        return controller.discretise(h, anti_windup=way).back_calculation_gain

    assert gain("reset") == pytest.approx(h / (ti + h))
    assert gain("back-calculation") == pytest.approx(h / (math.sqrt(ti * td) + h))
    assert gain(None) == 0.0
    assert gain("back-calculation", PIDA(1.0, 2.0)) == gain("reset")
    assert (
        HighOrderPID([1.0, 0.0, 0.5], 0.1, 2).discretise(H).anti_windup == "clamping"
    )  # no proportional action


def test_set_point_of_a_filtered_pida_without_derivatives_of_it():
    """With c = 0 only the filtered PI acts on a step of the set point."""
    F = OutputFilter(0.4, 2, math.nan)
    whole = CONTROLLERS["pida"].discretise(H, "backward", F, c=0.0, b=0.5)
    plain = CONTROLLERS["pi"].discretise(H, "backward", F, b=0.5)
    for k in (whole, plain):
        k.reset(r=0.0, y=0.0)
    steps = [[k.step(r=1.0, y=0.0) for _ in range(40)] for k in (whole, plain)]
    np.testing.assert_allclose(*steps, rtol=1e-9)


FILTERED = [
    # The filters of the parts are 0.18 and 0.09. The times are close to these, in between and far away.
    *product(["pida"], [0.18, 0.18 * (1 + 1e-12), 0.18001, 0.19, 0.0901, 0.4, 2.0], [1, 2, 3]),
    ("pi", 0.2, 1),
    ("non-interactive", 0.1, 2),
    ("high order", 1.2, 2),
    ("filtered I", 0.3, 1),
    ("series", 0.6, 1),
]


@pytest.mark.parametrize(("name", "time", "order"), FILTERED)
def test_an_output_filter_loses_no_digits(name, time, order):
    C, F = CONTROLLERS[name], OutputFilter(time, order, math.nan)
    for method, s in (("tustin", 2 / H * (Z - 1) / (Z + 1)), ("backward", (1 - 1 / Z) / H)):
        k = C.discretise(H, method, F, anti_windup="clamping")
        np.testing.assert_allclose(
            k(Z), C(s) / (time * s + 1) ** order, rtol=1e-12, atol=1e-15 * (name != "pida")
        )
    if name == "pida":
        expected = held(C, H, time, order)
        np.testing.assert_allclose(C.discretise(H, "zoh", F, anti_windup="clamping")(Z), expected, rtol=1e-12)
    # With a weight c of 0 no part has a derivative of the set point.
    split = C.discretise(H, "backward", F, anti_windup="clamping", c=0.0)
    assert {path.weight for path in split.paths} <= {0.0, 1.0}
    np.testing.assert_allclose(split(Z), k(Z), rtol=1e-9)


@pytest.mark.parametrize("name", CASES)
def test_transfer_function_has_no_cancelling_poles(name):
    """It has only the poles of the lags and of the integral, since other poles would count as poles of the loop."""
    k = CASES[name]
    lags = [1 - new - old for path in k.paths for new, old in zip(path.new, path.old, strict=True)]
    expected = np.poly(lags + [1.0] * k.integrates)
    np.testing.assert_allclose(k.transfer_function().den[0][0], expected, rtol=1e-9, atol=1e-12)
