"""What the methods make of a controller: substitutions, held inputs, and what they refuse."""

import math
import warnings

import control
import numpy as np
import pytest
from cases import CASES
from mpmath import mp

import pidalab
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
    """What a held input makes of a controller behind equal lags, in high precision: the exponential of its chains."""
    with mp.workdps(30):
        return [complex(held_at(controller, h, time, order, z)) for z in Z]


def held_at(controller, h, time, order, z):
    total = mp.mpf(0)
    for part in controller.parts():
        lags = [mp.mpf(part.filter_time)] * part.filter_order + [mp.mpf(time)] * order
        n = len(lags)
        # states: integral of the last lag, the lags, the input
        generator = mp.zeros(n + 2)
        generator[0, n or 1] = 1
        for j, lag in enumerate(lags, start=1):
            generator[j, j], generator[j, j - 1 if j > 1 else n + 1] = -1 / lag, 1 / lag
        transition = mp.expm(generator * mp.mpf(h))
        phi, gamma = transition[: n + 1, : n + 1], transition[: n + 1, n + 1]
        rest = mp.lu_solve(mp.mpc(z) * mp.eye(n + 1) - phi, gamma)
        powers = [mp.mpf(1), *(rest[j] for j in range(1, n + 1))]  # of the chain, then s times it, and so on
        total += part.gains[0] * rest[0]
        for gain in part.gains[1:]:
            total += gain * powers[-1]
            last = lags[n - len(powers) + 1 :] if len(powers) > 1 else []
            powers = [
                (before - after) / lag for before, after, lag in zip(powers, powers[1:], last, strict=False)
            ] or [mp.mpf(0)]
    return total


@pytest.mark.parametrize("name", CONTROLLERS)
def test_parts_are_the_controller(name):
    s, total = np.array([0.1j, 1.0 + 2.0j, 30.0j]), 0.0
    for part in CONTROLLERS[name].parts():
        gains = sum(gain * s ** (k - 1.0) for k, gain in enumerate(part.gains))
        total = total + gains / (1 + part.filter_time * s) ** part.filter_order
    np.testing.assert_allclose(total, CONTROLLERS[name](s), rtol=1e-12)


@pytest.mark.parametrize("way", ["reset", "clamping"])
@pytest.mark.parametrize("name", CONTROLLERS)
def test_substitutions(name, way):
    for method, s in (("backward", (1 - 1 / Z) / H), ("tustin", 2 / H * (Z - 1) / (Z + 1))):
        if name == "filtered I" and way == "reset":
            continue  # no integral time to go by
        k = CONTROLLERS[name].discretise(H, method, anti_windup=way)
        np.testing.assert_allclose(k(Z), CONTROLLERS[name](s), rtol=1e-9)
        np.testing.assert_allclose(k.transfer_function()(Z), k(Z), rtol=1e-6)


def test_a_controller_with_derivative_and_without_proportional_action_is_clamped():
    assert HighOrderPID([1.0, 0.0, 0.5], 0.1, 2).discretise(H).anti_windup == "clamping"


@pytest.mark.parametrize("name", CONTROLLERS)
@pytest.mark.parametrize("h", [0.07, 1e-4])
def test_held_input(name, h):
    k = CONTROLLERS[name].discretise(h, "zoh", anti_windup="clamping")
    np.testing.assert_allclose(k(Z), held(CONTROLLERS[name], h), rtol=1e-7 if h < 0.01 else 1e-9)


def test_reset_behind_a_held_input():
    """(1 + lag of the signal, one sample late) times the stabilising controller."""
    own = CONTROLLERS["series"]
    stabiliser = HighOrderPID([0.0, own.kp, own.kd, own.ka], own.filter_time, own.filter_order)
    a = math.exp(-H / own.ti)
    expected = np.array(held(stabiliser, H)) * (1 + (1 - a) / (Z - 1))
    np.testing.assert_allclose(own.discretise(H, "zoh")(Z), expected, rtol=1e-9)


def test_backward_differences_are_stable_at_any_sample_time():
    for controller in CONTROLLERS.values():
        for h in (1e-3, 1.0, 1e3):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of long samples
                k = controller.discretise(h, anti_windup="clamping")
            shares = [pair for path in k.paths for pair in zip(path.new, path.old, strict=True)]
            assert all(0 <= 1 - new - old < 1 for new, old in shares)
            assert 0 <= k.back_calculation_gain < 1


PID = PIDA(1.0, 2.0, 0.5)


@pytest.mark.parametrize(
    ("controller", "arguments", "error", "message"),
    [
        (PID, {"sample_time": 0.0}, ValueError, "sample_time must be above 0, found 0"),
        (PID, {"method": "euler"}, ValueError, "method must be 'backward', 'tustin' or 'zoh', found 'euler'"),
        (PID, {"method": "tustin", "sample_time": 0.11}, ValueError, r"at most 0\.1 .* found 0\.11: .*constant 0\.05"),
        (PID, {"method": "zoh", "sample_time": 0.06}, ValueError, r"at most 0\.05 .* take method='backward'"),
        (SeriesPIDA(1, 1, 0, 1, 0.1, 1), {"method": "zoh", "sample_time": 0.2}, ValueError, "filter of the stabiliser"),
        (PID, {"tracking_time": 1.0}, ValueError, "tracking_time"),
        (PID, {"tracking_time": 0.0, "anti_windup": "back-calculation"}, ValueError, "tracking_time must be above 0"),
        (HighOrderPID([1.0, -2.0], 0.1, 1), {}, ValueError, "kp/ki above 0, found -2; take 'clamping'"),
        (PID, {"limits": (1.0, 0.0)}, ValueError, "limits must be"),
        (PID, {"limits": (1.0, 2.0)}, ValueError, r"bias must be within the limits \(1, 2\), found 0"),
        (PID, {"rate_limit": np.zeros(3)}, TypeError, "rate_limit must be a real number"),
        (PID, {"rate_limit": 0.0}, ValueError, "rate_limit must be above 0"),
        (PID, {"deadband": -1.0}, ValueError, "deadband must be at least 0"),
        (PIDA(1.0, math.inf, 0.5), {"b": 0.0, "c": 0.0}, ValueError, "b = 0 with c = 0"),
        (PID, {"b": math.nan}, ValueError, "b must be finite"),
        (PID, {"bias": "0"}, TypeError, "bias must be a real number"),
        (PID, {"filter": 1.0}, TypeError, "unexpected keyword argument 'filter'"),
    ],
    ids=["sample", "method", "tustin", "zoh", "series", "tracking", "time", "sign", "limits", "bias", "rates",
         "rate", "deadband", "no set point", "nan", "text", "unknown"],
)  # fmt: skip
def test_discretise_complains(controller, arguments, error, message):
    with pytest.raises(error, match=message):
        controller.discretise(**({"sample_time": 0.01} | arguments))


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
def test_sample_times_that_are_none(controller, h, message):
    with pytest.warns(UserWarning, match=message):
        controller.discretise(h)
    controller.discretise(h / 100)


def test_integral_time_of_a_sum():
    """Back-calculation takes the root of integral and derivative time, the reset the integral time."""
    h, ti, td = 0.1, 2.0, 0.5
    taken = {
        way: PID.discretise(h, anti_windup=way).back_calculation_gain
        for way in ("reset", "back-calculation", None)
    }
    assert taken["reset"] == pytest.approx(h / (ti + h))
    assert taken["back-calculation"] == pytest.approx(h / (math.sqrt(ti * td) + h))
    assert taken[None] == 0.0
    assert (
        pidalab.PIDA(1.0, 2.0).discretise(h, anti_windup="back-calculation").back_calculation_gain
        == taken["reset"]
    )


FILTERS = {  # time constants apart from those of the parts, equal to one of them; one lag and two
    "pi": OutputFilter(0.2, 1, math.nan),
    "pida": OutputFilter(0.4, 2, math.nan),
    "non-interactive": OutputFilter(0.1, 2, math.nan),
    "high order": OutputFilter(1.2, 2, math.nan),
    "filtered I": OutputFilter(0.3, 1, math.nan),
    "series": OutputFilter(0.6, 1, math.nan),
}


@pytest.mark.parametrize("name", FILTERS)
def test_an_output_filter_becomes_a_part(name):
    C, F = CONTROLLERS[name], FILTERS[name]
    for method, s in (("backward", (1 - 1 / Z) / H), ("tustin", 2 / H * (Z - 1) / (Z + 1))):
        k = C.discretise(H, method, F, anti_windup="clamping")
        np.testing.assert_allclose(k(Z), C(s) / (F.time * s + 1) ** F.order, rtol=1e-9, atol=1e-12)
    # what a weight c of 0 leaves of the set point has no derivative in it
    split = C.discretise(H, "backward", F, anti_windup="clamping", c=0.0)
    assert {path.weight for path in split.paths} <= {0.0, 1.0}
    np.testing.assert_allclose(split(Z), C.discretise(H, "backward", F, anti_windup="clamping")(Z), rtol=1e-9)


def test_set_point_of_a_filtered_pida_without_derivatives_of_it():
    """With c = 0 a step of the set point passes the filtered PI, whatever the derivatives are split into."""
    F = OutputFilter(0.4, 2, math.nan)
    whole = CONTROLLERS["pida"].discretise(H, "backward", F, c=0.0, b=0.5)
    plain = CONTROLLERS["pi"].discretise(H, "backward", F, b=0.5)
    for k in (whole, plain):
        k.reset(r=0.0, y=0.0)
    steps = [[k.step(r=1.0, y=0.0) for _ in range(40)] for k in (whole, plain)]
    np.testing.assert_allclose(*steps, rtol=1e-9)


def test_filtered_design_with_held_inputs_is_sampled_as_the_continuous_one():
    """simulate_sampled discretises controller and output filter together, for held inputs: zoh does the same."""
    design = pidalab.rules.haalman.tune(pidalab.lags(3, delay=1.0), ms=1.6)
    h = 0.02
    t = h * np.arange(500)
    expected = pidalab.simulate_sampled(design.loop(), t, setpoint=1.0)
    found = pidalab.simulate_sampled(pidalab.Loop(design.model, design.discretise(h, "zoh")), t, setpoint=1.0)
    np.testing.assert_allclose(found.u, expected.u, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("time", [0.18, 0.18 * (1 + 1e-12), 0.18001, 0.19, 0.0901, 0.4, 2.0])
def test_an_output_filter_near_a_part_of_the_controller(time, order):
    """The parts have filters of 0.18 and 0.09: near, in between and far, nothing cancels."""
    C, F = PIDA(1.3, 3.3, 0.9, 0.27, 5, 3), OutputFilter(time, order, math.nan)
    for method, s in (("backward", (1 - 1 / Z) / H), ("tustin", 2 / H * (Z - 1) / (Z + 1))):
        k = C.discretise(H, method, F, anti_windup="clamping")
        np.testing.assert_allclose(k(Z), C(s) / (time * s + 1) ** order, rtol=1e-12)
    expected = held(C, H, time, order)
    np.testing.assert_allclose(C.discretise(H, "zoh", F, anti_windup="clamping")(Z), expected, rtol=1e-12)


def test_a_reset_behind_an_output_filter_stays_one():
    """The integral is the lag of the limited signal, and the filter belongs to the stabilising controller."""
    own, F = CONTROLLERS["series"], OutputFilter(0.6, 1, math.nan)
    k = own.discretise(H, output_filter=F)
    s = (1 - 1 / Z) / H
    assert k.from_signal
    np.testing.assert_allclose(k(Z), own(s) / (0.6 * s + 1), rtol=1e-12)


@pytest.mark.parametrize(
    ("output_filter", "message"),
    [
        (control.tf([1.0], [1.0, 0.5, 1.0]), r"equal lags of gain 1, .* found \[1\] / \[1, 0.5, 1\]"),
        (control.tf([2.0], [1.0, 1.0]), "equal lags of gain 1"),
        (control.tf([1.0], [1.0, 0.0]), "equal lags of gain 1"),
        (control.tf([0.1, 1.0], [1.0, 1.0]), "equal lags of gain 1"),
        (control.tf([1.0], [-1.0, 1.0]), "equal lags of gain 1"),
        (control.tf([1.0], [1.0, -2.0, 1.0]), "equal lags of gain 1"),
        (control.tf([1.0, 3.0], [0.25, 1.0, 1.0]), "equal lags of gain 1"),
    ],
)
def test_output_filters_that_become_no_part(output_filter, message):
    with pytest.raises(ValueError, match=message):
        CONTROLLERS["pida"].discretise(H, "backward", output_filter)


def test_a_gain_of_one_is_no_filter():
    assert CONTROLLERS["pida"].discretise(H, "backward", 1.0).paths == CONTROLLERS["pida"].discretise(H).paths


def test_parts_of_another_kind_are_refused():
    with pytest.raises(TypeError, match=r"parts must be"):
        pidalab.digital.discretise([1.0], 0.1)


@pytest.mark.parametrize("name", CASES)
def test_a_transfer_function_has_the_poles_of_its_lags_and_of_the_integral(name):
    """And no others, that would cancel: each counts where stability is judged."""
    k = CASES[name]
    lags = [1 - new - old for path in k.paths for new, old in zip(path.new, path.old, strict=True)]
    expected = np.poly(lags + [1.0] * k.integrates)
    np.testing.assert_allclose(k.transfer_function().den[0][0], expected, rtol=1e-9, atol=1e-12)
