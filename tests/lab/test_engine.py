"""Compare the lab's engine with the library, for several hundred random loops, some unstable."""

import math

import numpy as np
import pytest
from engine import Engine, asked

import pidalab
from pidalab.robustness import max_control_sensitivity
from pidalab.rules import automatic_reset

LOOPS = 300
POINTS = 301


@pytest.fixture(scope="module")
def engine():
    return Engine()


def random_process(rng):
    """Draw a lag, oscillating, integrating, inverse-response or unstable process, most with dead time."""
    delay = 10 ** rng.uniform(-1.5, 1) if rng.random() < 0.85 else 0.0
    gain = rng.uniform(0.3, 3)
    kinds = (
        lambda: pidalab.lags(int(rng.integers(1, 6)), 10 ** rng.uniform(-0.5, 0.5), gain, delay),
        lambda: pidalab.sopdt(gain, 1.0, rng.uniform(0.1, 1.5), delay),
        lambda: pidalab.ipdt(gain, delay),
        lambda: pidalab.Process(
            [-rng.uniform(0.1, 1.5) * gain, gain], np.poly(-(10 ** rng.uniform(-0.5, 1, 3))), delay
        ),
        lambda: pidalab.Process([gain], [1.0, -rng.uniform(0.05, 0.5)], min(delay, 1.0)),
        lambda: pidalab.Process(
            [gain], np.polymul([1, 0], np.poly(-(10 ** rng.uniform(-0.5, 1.5, 2)))), delay
        ),
        lambda: pidalab.fopdt(gain, 10 ** rng.uniform(-1, 1), delay),
    )
    return kinds[rng.integers(len(kinds))]()


def random_controller(rng, scale):
    """Draw a PI, PID or PIDA, some just proper, with a filter from a thousandth to a third of the process's time."""
    kp, m = 10 ** rng.uniform(-1.5, 0.7), int(rng.integers(0, 3))
    ki = kp / (scale * 10 ** rng.uniform(-0.3, 0.8)) if rng.random() < 0.9 else 0.0
    kd, ka = kp * scale * 10 ** rng.uniform(-1.5, 0), kp * (scale * 10 ** rng.uniform(-1.5, -0.3)) ** 2
    n = m + int(rng.integers(0, 3))
    return pidalab.HighOrderPID(
        [ki, kp, kd, ka][: m + 2], scale * 10 ** rng.uniform(-3, -0.5) if n else 0.0, n
    )


def random_loops(count, seed=20):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        process = random_process(rng)
        scale = max(process.delay, 1.0)
        step = [(1.0, 0.0), (0.0, 1.0), (1.0, -0.5)][rng.integers(3)]
        yield pidalab.Loop(process, random_controller(rng, scale)), (scale + 2) * rng.uniform(5, 25), step


def distance(values, true):
    """Return the largest deviation, relative to the largest value."""
    return np.abs(np.array(values) - true).max() / np.abs(true).max()


def test_responses_and_margins_of_random_loops(engine):
    stable, refused = 0, 0
    for loop, end, (setpoint, load) in random_loops(LOOPS):
        case = asked(loop.process, loop.controller)
        said = repr(loop)
        verdict = pidalab.is_stable(loop)
        stable += verdict
        margins = engine.margins(**case)
        assert margins["stable"] is verdict, said
        if verdict:
            true = pidalab.margins(loop)
            for name in ("ms", "gm", "pm", "dm"):
                assert margins[name] == pytest.approx(getattr(true, name), rel=1e-4), (name, said)
        else:
            end = min(end, 10 * loop.process.delay or 1.0)  # before the response overflows
        try:
            true = pidalab.simulate(loop, np.linspace(0.0, end, POINTS), setpoint=setpoint, load=load)
        except ValueError as refusal:  # a growing response may lose too many digits
            if verdict or "rounding makes" not in str(refusal):
                raise
            refused += 1
            continue
        run = engine.simulate(**case, end=end, points=POINTS, setpoint=setpoint, load=load)
        assert max(distance(run["y"], true.y), distance(run["u"], true.u)) < 1e-4, said
    assert 0.4 * LOOPS < stable < 0.95 * LOOPS
    assert refused <= 0.02 * LOOPS


def test_mks_is_that_of_the_library(engine):
    largest_at_rest = pidalab.Loop(
        pidalab.Process([-3.6, 2.5], [1.0, 15.7, 81.0, 138.0], 0.49),
        pidalab.HighOrderPID([0.036, 0.089, 0.078], 0.0033, 1),
    )
    for loop in (largest_at_rest, *(loop for loop, _, _ in random_loops(60, seed=21))):
        if pidalab.is_stable(loop):
            mks = engine.margins(**asked(loop.process, loop.controller))["mks"]
            assert mks == pytest.approx(max_control_sensitivity(loop)[0], rel=1e-4), repr(loop)


def test_closed_form_of_an_integrator_with_dead_time(engine):
    """K/s e^{-s} with a gain of 1/2 has a piecewise polynomial response: 0 for t < 1, then (t-1)/2, then …"""
    loop = asked(pidalab.ipdt(1.0, delay=1.0), pidalab.HighOrderPID([0.0, 0.5], 0.0, 0))
    run = engine.simulate(**loop, end=3.0, points=301, setpoint=1.0)
    t = np.linspace(0.0, 3.0, 301)
    y = np.where(t < 1, 0.0, (t - 1) / 2) - np.where(t < 2, 0.0, (t - 2) ** 2 / 8)
    assert np.abs(np.array(run["y"]) - y).max() < 1e-12
    margins = engine.margins(**loop)
    assert margins["gm"] == pytest.approx(math.pi, rel=1e-12)
    assert margins["dm"] == pytest.approx(math.pi - 1, rel=1e-12)


def off(engine, true, process, controller, limits=None, **more):
    """Return the largest deviation of a sampled run of the engine from a run of the library."""
    case = asked(process, controller, end=true.t[-1], sampleTime=true.step, setpoint=1.0, load=true.d[-1])
    case["controller"]["limits"] = limits
    run = engine.simulateSampled(**case, **more)
    return max(distance(run["y"], true.y), distance(run["u"], true.u))


@pytest.mark.parametrize("way", [None, "clamping", "conditioning"])
def test_digital_controller_with_limits_and_noise(engine, way):
    process, controller = pidalab.lags(3, delay=0.777), pidalab.HighOrderPID([0.5, 1.5, 1.0, 0.3], 0.1, 3)
    t = 0.05 * np.arange(601)
    noise, limits = pidalab.uniform_noise(t, 0.02, seed=1), (-0.2, 1.3)
    true = pidalab.simulate_sampled(
        pidalab.Loop(process, controller), t, 1.0, load=-0.3, noise=noise, limits=limits, anti_windup=way
    )
    assert true.u.max() == limits[1]
    more = {"noise": noise.tolist(), "antiWindup": way or "none"}
    assert off(engine, true, process, controller, limits, **more) < 1e-9


def test_automatic_reset(engine):
    """The fastest real zero gives the reset time. It may be the double zero of PIDA_1, also with rounded gains."""
    process, t, limits = pidalab.ipdt(1.0, delay=1.0), 0.02 * np.arange(1501), (-0.1, 0.1)
    series = automatic_reset.tune(process, automatic_reset.PIDA_1, n=4, filter_time=0.2).controller
    held, backward = (
        pidalab.simulate_sampled(pidalab.Loop(process, controller), t, 1.0, limits=limits)
        for controller in (series, series.discretise(0.02, limits=limits))
    )
    exact = pidalab.HighOrderPID(list(series.gains()), series.filter_time, series.filter_order)
    rounded = pidalab.HighOrderPID(
        [round(k, 5) for k in series.gains()], series.filter_time, series.filter_order
    )
    for true, controller, method, close in (
        (held, exact, "held", 1e-6),
        (held, rounded, "held", 0.01),
        (backward, exact, "backward", 1e-6),
    ):
        assert off(engine, true, process, controller, limits, antiWindup="reset", method=method) < close
    with pytest.raises(ValueError, match="real zero"):
        off(engine, held, process, pidalab.HighOrderPID([0.0, 1.0], 0.0, 0), antiWindup="reset")


@pytest.mark.parametrize(
    ("way", "names"),
    [
        ("none", {"anti_windup": None}),
        ("clamping", {"anti_windup": "clamping"}),
        ("conditioning", {"anti_windup": "reset"}),
        ("conditioning", {"anti_windup": "back-calculation", "tracking_time": 0.7}),
    ],
    ids=repr,
)
@pytest.mark.parametrize("h", [0.05, 0.4])
def test_backward_differences(engine, h, way, names):
    """A sample time of several filter times is included."""
    process, controller = pidalab.lags(3, delay=0.777), pidalab.HighOrderPID([0.3, 0.9, 0.7, 0.2], 0.1, 3)
    t, limits = h * np.arange(round(30 / h) + 1), (-0.2, 1.1)
    digital = controller.discretise(h, limits=limits, **names)
    true = pidalab.simulate_sampled(pidalab.Loop(process, digital), t, 1.0, load=-0.3)
    assert true.u.max() == 1.1
    more = {"method": "backward", "antiWindup": way, "trackingTime": names.get("tracking_time")}
    assert off(engine, true, process, controller, limits, **more) < 1e-9


@pytest.mark.parametrize("delay", [0.137, 0.2, 0.777])
@pytest.mark.parametrize(("num", "den"), [([0.5, 1.0], [1.0, 1.0]), ([1.0], [1.0])], ids=["lead", "static"])
def test_a_sampled_plant_with_direct_feedthrough(engine, num, den, delay):
    """The dead time is not a multiple of the sample time, 0.2."""
    process, controller = pidalab.Process(num, den, delay), pidalab.HighOrderPID([0.2, 0.3], 0.0, 0)
    # Without a filter the methods differ by a sample of the integral.
    for method, ours in (("backward", controller.discretise(0.2)), ("held", controller)):
        true = pidalab.simulate_sampled(pidalab.Loop(process, ours), 0.2 * np.arange(101), 1.0, load=-0.3)
        assert off(engine, true, process, controller, method=method) < 1e-9


@pytest.mark.parametrize("gains", [[0.0486, 0.0641, 0.0115, 7e-5], [0.5, 0.3, 0.2, 0.001]], ids=["a", "b"])
def test_gain_margin_of_a_loop_whose_gain_stays_finite(engine, gains):
    """Every phase occurs at high frequency. This does not hide a larger crossover."""
    process = pidalab.Process([1.0], [1.0], delay=0.37)
    controller = pidalab.HighOrderPID(gains, 0.28, 2)
    margins = engine.margins(**asked(process, controller))
    true = pidalab.margins(pidalab.Loop(process, controller))
    assert margins["gm"] == pytest.approx(true.gm, rel=1e-6)


def test_limits_hold_and_wide_limits_change_nothing(engine):
    case = asked(pidalab.lags(2, delay=0.5), pidalab.HighOrderPID([0.8, 1.5, 0.6], 0.1, 1))
    free = engine.simulate(**case, end=20.0, points=201, setpoint=1.0)
    case["controller"]["limits"] = (-100.0, 100.0)
    assert engine.simulate(**case, end=20.0, points=201, setpoint=1.0) == free
    case["controller"]["limits"] = (0.0, 1.5)
    tight = engine.simulate(**case, end=20.0, points=201, setpoint=1.0)
    assert max(tight["u"]) == 1.5 < max(free["u"])
    assert tight["y"][-1] == pytest.approx(1.0, abs=0.01)


def test_cache_tells_loops_apart(engine):
    """A fresh engine and an engine that has cached another loop give the same answer."""
    case = asked(pidalab.lags(2, delay=0.5), pidalab.HighOrderPID([0.5, 1.0, 0.3, 0.05], 0.1, 2))
    changed = [
        ("process", {key: value}) for key, value in (("num", [1.1]), ("den", [1, 2.1, 1]), ("delay", 0.6))
    ]
    gains = [
        [k * (1.1 if i == j else 1) for j, k in enumerate(case["controller"]["gains"])] for i in range(4)
    ]
    changed += [("controller", {"gains": each}) for each in gains]
    changed += [("controller", {"filterTime": 0.11}), ("controller", {"filterOrder": 3})]
    run = {"end": 10.0, "points": 11, "setpoint": 1.0}
    before = engine.margins(**case), engine.simulate(**case, **run)["y"]
    for key, change in changed:
        other = {**case, key: {**case[key], **change}}
        answers = engine.margins(**other), engine.simulate(**other, **run)["y"]
        assert answers == ((fresh := Engine()).margins(**other), fresh.simulate(**other, **run)["y"]), change
        assert answers != before, change


@pytest.mark.parametrize("delay", [0.0, 1.0])
def test_a_peak_between_two_points_is_resolved_and_limited(engine, delay):
    """The filter time is 0.02 and the points are 0.1 apart, so the peak is over before the first point."""
    process, controller = pidalab.lags(3, delay=delay), pidalab.HighOrderPID([0.36, 0.73, 0.8], 0.02, 2)
    case = asked(process, controller, end=40.0, points=401, setpoint=1.0)
    fine = engine.simulate(**case)["fine"]
    peak = pidalab.step_response(pidalab.Loop(process, controller), np.linspace(0.0, 1.0, 10_001)).u.max()
    assert max(fine["u"]) == pytest.approx(peak, rel=1e-3)
    assert np.all(np.diff(fine["t"]) > 0)
    case["controller"]["limits"] = (-1.0, 3.0)
    assert max(engine.simulate(**case)["fine"]["u"]) == 3.0 < peak


TOO_SHORT = "controller.filterTime .* is too short for this plant.* the shortest allowed one is about"


@pytest.mark.parametrize("delay", [0.0, 0.9, 4.7])
@pytest.mark.parametrize("order", [2, 3, 4])
@pytest.mark.parametrize("lags", [3, 4])
def test_a_fast_filter_is_simulated_or_refused(engine, lags, order, delay):
    """The plant's time constants are 1; the lab's slider ends at 0.001."""
    process, t = pidalab.lags(lags, delay=delay), np.linspace(0.0, 20.0, 401)

    def run(time):
        controller = pidalab.HighOrderPID([0.25, 0.6, 0.3, 0.1], time, order)
        return controller, engine.simulate(**asked(process, controller), end=20.0, points=401, setpoint=1.0)

    for time in (0.1, 0.01, 1e-3, 1e-4, 3e-5):
        controller, response = run(time)
        true = pidalab.step_response(pidalab.Loop(process, controller), t)
        assert max(distance(response["y"], true.y), distance(response["u"], true.u)) < 1e-6, time
    for time in (1e-6, 1e-7, 1e-9, 1e-12):
        with pytest.raises(ValueError, match=TOO_SHORT) as refused:
            run(time)
        run(2 * float(str(refused.value).rsplit(" ", 1)[-1]))  # the message names a filter time that works


BAD = [
    ({"process": {"num": [1.0], "den": [0.0], "delay": 0.0}}, "process.den must not be 0"),
    ({"process": {"num": [1.0, 0.0, 0.0], "den": [1.0, 1.0], "delay": 0.0}}, "process must be proper"),
    (
        {"process": {"num": [1.0], "den": [1.0, 1.0], "delay": -1.0}},
        "process.delay must be a finite number of at least 0",
    ),
    (
        {"controller": {"gains": [1.0, 1.0, 1.0, 0.0], "filterTime": 0.0, "filterOrder": 1}},
        "needs a filter of order 1",
    ),
    ({"controller": {"gains": [1.0, 1.0], "limits": [1.0, 0.0]}}, "controller.limits must be"),
    (
        {
            "setpoint": 1.0,
            "controller": {"gains": [1.0, 1.0], "filterTime": 1e-5, "filterOrder": 1, "limits": [-0.5, 0.5]},
        },
        "between limits a filter of 0.00001 takes 4000000 steps to 10; take a longer one",
    ),
    ({"points": 1}, "points must be a finite number of at least 2"),
    ({"end": 0.0}, "end must be above 0"),
]


@pytest.mark.parametrize(("change", "message"), BAD)
def test_bad_input_is_named(engine, change, message):
    case = asked(pidalab.fopdt(1.0, 1.0, 0.5), pidalab.HighOrderPID([0.5, 1.0], 0.0, 0), end=10.0, points=11)
    with pytest.raises(ValueError, match=message):
        engine.simulate(**{**case, **change})
