"""Compare every measure of a Response with closed forms and the oracle."""

import math
import pickle
import warnings

import control
import numpy as np
import pytest
from engine_errors import oracle, oracle_loop

import pidalab
from pidalab import Response


def record(t, y, r=1.0, **signals):
    return Response(**({"t": t, "r": r, "d": 0.0, "n": 0.0, "y": y, "u": 0.0} | signals))


def from_error(t, e, running):
    """Return a record of set point 0 whose error is e, with the exact running integral of the error."""
    return record(t, -e(t), r=0.0, area=-running(t))


T = np.linspace(0.0, 30.0, 1501)
DECAY = from_error(T, lambda t: np.exp(-t), lambda t: 1 - np.exp(-t))
SINE = from_error(
    T[:511], np.sin, lambda t: 1 - np.cos(t)
)  # to t = 10.2, crossings at multiples of pi inside samples


def integral_of_abs_sine(x):
    return 2 * math.floor(x / math.pi) + 1 - math.cos(x % math.pi)


@pytest.mark.parametrize("horizon", [0.013, 2.0, 3.1, 3.15, math.pi, 9.999, 10.2])
def test_sine_with_sign_changes_and_horizon_inside_samples(horizon):
    assert SINE.ie(horizon) == pytest.approx(1 - math.cos(horizon), abs=1e-6)
    assert SINE.iae(horizon) == pytest.approx(integral_of_abs_sine(horizon), abs=1e-6)
    assert SINE.ise(horizon) == pytest.approx(horizon / 2 - math.sin(2 * horizon) / 4, abs=1e-6)
    x = np.linspace(0.0, horizon, 400_001)
    assert SINE.itae(horizon, origin=-1.5) == pytest.approx(
        np.trapezoid((x + 1.5) * np.abs(np.sin(x)), x), abs=3e-6
    )


def test_parabolas_are_exact():
    """e = (t - 0.3)(t - 1.7): sign changes at 0.3 and 1.7, one sample per unit of time."""
    t = np.arange(3.0)
    parabola = from_error(t, lambda t: (t - 0.3) * (t - 1.7), lambda t: t**3 / 3 - t**2 + 0.51 * t)
    F = np.polynomial.Polynomial([0.0, 0.51, -1.0, 1 / 3])
    G = np.polynomial.Polynomial([0.0, 0.0, 0.51 / 2, -2 / 3, 1 / 4])
    assert parabola.iae() == pytest.approx(F(0.3) - (F(1.7) - F(0.3)) + F(2.0) - F(1.7), rel=1e-13)
    assert parabola.itae() == pytest.approx(G(0.3) - (G(1.7) - G(0.3)) + G(2.0) - G(1.7), rel=1e-13)
    square = (np.polynomial.Polynomial([0.51, -2.0, 1.0]) ** 2).integ()
    assert parabola.ise() == pytest.approx(square(2.0), rel=1e-13)
    assert parabola.ie(0.5) == pytest.approx(F(0.5), rel=1e-13)


def test_held_set_point_and_noise():
    """r and n are held, so that the error jumps at the samples."""
    held = record(np.arange(4.0), 0.0, r=[1.0, -2.0, 3.0, 100.0], n=[0.5, 0.5, -1.0, 7.0])
    assert (held.ie(), held.iae(), held.ise()) == pytest.approx((2.0, 6.0, 14.0))
    assert held.itae() == pytest.approx(0.5 * 1 + 1.5 * 2 + 2.5 * 3)
    measured = held.measured()  # e - n = 0.5, -2.5, 4
    assert (measured.ie(), measured.iae(), measured.ise()) == pytest.approx((2.0, 7.0, 0.25 + 6.25 + 16.0))
    np.testing.assert_allclose(measured.e, held.r - held.y - held.n)


def test_total_variation():
    u = record(np.arange(5.0), 0.0, u=[3.0, 1.0, 2.0, 2.0, -1.0])
    assert u.tv() == 3 + 2 + 1 + 0 + 3
    assert u.tv("u", 2.0) == 3 + 2 + 1
    assert u.tv("u", 2.0, final=0.0) == 3 + 2 + 1 + 2
    with pytest.raises(TypeError, match="positional"):
        u.tv("u", 0.0, 2.0)
    assert (u.peak("u"), record(np.arange(4.0), [0.0, -3.0, 2.0, 0.0]).peak()) == (3.0, -3.0)
    assert record(T[:511], np.sin(T[:511])).tv("y") == pytest.approx(
        integral_of_abs_sine(10.2 + math.pi / 2) - 1, abs=2e-3
    )


def huba_tv1(path):
    """Compute huba2024, eq. (24), by trying every sample as the extreme."""
    total = np.sum(np.abs(np.diff(path)))
    return min(total - abs(2 * x - path[0] - path[-1]) for x in path)


@pytest.mark.parametrize("seed", range(5))
def test_excess_over_one_pulse(seed):
    u = np.cumsum(np.random.default_rng(seed).normal(size=50))
    assert record(np.arange(50.0), 0.0, u=u).tv1() == pytest.approx(huba_tv1(np.append(0.0, u)), abs=1e-12)


@pytest.mark.parametrize("target", [2.0, -0.5])
def test_overshoot_between_samples(target):
    """The overshoot of a second-order response is exp(-pi z/sqrt(1 - z^2)). Its peak falls between coarse samples."""
    z, w = 0.5, math.sqrt(0.75)
    exact = 100 * math.exp(-math.pi * z / w)
    t = np.linspace(0.0, 20.0, 81)
    y = target * (1 - np.exp(-z * t) * (np.cos(w * t) + z / w * np.sin(w * t)))
    pole = -z + 1j * w
    area = target * (t - np.real((1 - 1j * z / w) * (np.exp(pole * t) - 1) / pole))
    assert record(t, y, r=target, area=area).overshoot() == pytest.approx(exact, abs=0.02)
    assert 100 * (np.max(y / target) - 1) < exact - 0.05  # the samples alone miss it
    assert record(t, target * (1 - np.exp(-t)), r=target).overshoot() == 0.0


@pytest.mark.parametrize("target", [3.0, -0.5])
def test_rise_time(target):
    assert record(T, target * (1 - np.exp(-T)), r=target).rise_time() == pytest.approx(math.log(9), abs=1e-4)
    wave = record(T, target * (1 - np.exp(-T) * np.cos(3 * T)), r=target)  # the first passage counts
    assert wave.rise_time(0.5, 0.99) < math.pi / 6


@pytest.mark.parametrize(
    ("y", "shares", "time"),
    [
        ([0.5, 1.0, 1.0], (0.2, 0.9), 0.8),  # the response starts above the lower share
        ([0.2, 0.1, 1.0], (0.2, 0.9), 17 / 9),  # it starts on the lower share
        ([0.0, 0.1, 0.9], (0.1, 0.9), 1.0),  # two samples lie on both shares
        ([2.0, 1.0, 1.0], (0.1, 0.9), 0.0),  # the response starts above both shares
    ],
)
def test_rise_time_of_few_samples(y, shares, time):
    assert record(np.arange(3.0), y).rise_time(*shares) == pytest.approx(time)


def test_settling_time():
    for y, r, band, time in (
        (1 - np.exp(-T), 1.0, 0.02, math.log(50)),
        (1 - np.exp(-T), 1.0, 0.05, math.log(20)),
        (-2 * (1 - np.exp(-T)), -2.0, 0.02, math.log(50)),
        (5 * np.exp(-T), 0.0, 0.02, math.log(50)),  # of the largest error
        (np.ones(T.size), 1.0, 0.02, 0.0),
    ):
        assert record(T, y, r=r).settling_time(band) == pytest.approx(time, abs=1e-4)
    # a straight line from +0.1 to -0.01 enters the band at 8/11 of the sample
    assert record(np.arange(3.0), [0.9, 1.01, 1.0]).settling_time(0.02) == pytest.approx(8 / 11)


@pytest.mark.parametrize("sign", [1, -1])
def test_between_by_hand(sign):
    y = sign * np.array([1.0, 1.0, 0.8, 2.0, 3.4, 2.95, 3.0, 3.0])
    u = sign * np.array([1.0, 5.0, 5.0, 4.0, 0.0, 2.0, 2.0, 2.0])
    r = record(0.5 * np.arange(8), y, r=sign * np.array([1.0] + [3.0] * 7), u=u)
    part = r.between(0.5, 3.5)
    np.testing.assert_allclose(part.t, 0.5 * np.arange(7))
    np.testing.assert_allclose(part.y, y[1:] - sign, atol=1e-15)
    np.testing.assert_allclose(part.u, u[1:] - sign, atol=1e-15)
    np.testing.assert_allclose(part.e, r.e[1:], atol=1e-15)
    assert part.overshoot() == pytest.approx(20.0, abs=3.0)  # the parabola through 2.4 is a little higher
    assert part.undershoot() == pytest.approx(10.0)
    assert part.tv() == pytest.approx(4 + 1 + 4 + 2)
    assert part.iae() == pytest.approx(r.iae(3.5) - r.iae(0.5), rel=1e-12)
    limits = (0.0, 5.0) if sign > 0 else (-5.0, 0.0)
    assert r.saturated(limits, 0.5, 3.5) == r.saturated(limits) == 1.5
    low, high = sorted([0.5 * sign, 3.5 * sign])  # a record may lie beyond limits that are asked about
    assert r.saturated((low, high)) == r.step * np.sum((r.u <= low) | (r.u >= high))


def test_between_ends_before_the_next_step():
    t = 0.03 * np.arange(6001)
    setpoint = np.where(t < 59.99, 1.0, np.where(t < 119.99, 3.0, -1.0))
    loop = pidalab.Loop(pidalab.lags(2, delay=0.5), pidalab.PIDA(1.0, 2.0))
    whole = pidalab.simulate(loop, t, setpoint)
    up, down = whole.between(60.0, 120.0), whole.between(120.0, 180.0)
    alone = pidalab.step_response(loop, t[:2001])
    for name, scale, part in (("iae", 2.0, up), ("iae", 4.0, down), ("tv", 2.0, up), ("tv", 4.0, down)):
        assert getattr(part, name)() == pytest.approx(scale * getattr(alone, name)(), rel=1e-6)
    assert up.r[-1] == 2.0
    assert up.overshoot() == pytest.approx(alone.overshoot(), abs=1e-4)
    assert down.settling_time() == pytest.approx(alone.settling_time(), abs=1e-4)


def test_measures_use_the_last_set_point():
    t, y = np.arange(20.0), np.array([0.0, -0.5, 1.0, 2.5, *[2.0] * 16])
    up, down = (record(t, y, r=np.where(t < 1, *levels)) for levels in ((0.0, 2.0), (2.0, 0.0)))
    assert (up.undershoot(), up.overshoot()) == pytest.approx((25.0, 25.0))
    assert record(t, y, r=np.where(t < 3, 0.0, 2.0)).undershoot() == pytest.approx(25.0)
    assert up.rise_time(0.1, 0.9) == pytest.approx((2.0 + 0.8 / 1.5) - (1.0 + 0.7 / 1.5))
    assert up.settling_time(0.02) == pytest.approx(3.0 + 0.46 / 0.5)
    for measure in (down.undershoot, down.overshoot, down.rise_time):
        with pytest.raises(ValueError, match="final value"):
            measure()


def test_error_against_a_filtered_set_point():
    """Proportional control of an integrator is a lag: y = 1 - e^{-t} against 1 - (1 + t) e^{-t}."""
    wanted = pidalab.open_loop_step(pidalab.lags(2), T)
    run = pidalab.step_response(pidalab.Loop(pidalab.ipdt(1.0, delay=0.0), 1.0), T).against(wanted)
    assert run.e == pytest.approx(-T * np.exp(-T), abs=1e-12)
    assert run.ise() == pytest.approx(
        0.25 * (1 - np.exp(-2 * T[-1]) * (1 + 2 * T[-1] + 2 * T[-1] ** 2)), rel=1e-8
    )
    with pytest.raises(ValueError, match="reference must have the same times"):
        run.against(pidalab.open_loop_step(pidalab.lags(2), T[:-1]))


MEASURES = (
    "overshoot",
    "undershoot",
    "peak",
    "peak_time",
    "rise_time",
    "tv",
    "tv1",
    "iae",
    "ie",
    "ise",
    "itae",
)


def random_loop(rng):
    """Draw a stable loop with lags, perhaps a zero, an integrator and a dead time, and a PI, PID or PIDA."""
    while True:
        times = np.exp(rng.uniform(math.log(0.02), math.log(5.0), rng.integers(1, 5)))
        den = np.poly(-1 / times) * np.prod(times)
        den = np.append(den, 0.0) if rng.random() < 0.25 else den
        num = [1.0] if rng.random() < 0.6 or times.size == 1 else [rng.uniform(-1.0, 3.0), 1.0]
        plant = pidalab.Process(num, den, float(rng.choice([0.0, 0.1, 1.0, 3.0]) * rng.uniform(0.3, 1.0)))
        total, order = times.sum() + plant.delay, int(rng.integers(0, 3))
        gains = [1.0, total * rng.uniform(0.3, 1.5)]
        gains += [total ** (k + 1) * rng.uniform(0.05, 0.3) ** k for k in range(1, order + 1)]
        controller = pidalab.HighOrderPID(
            gains, filter_time=total * 10 ** rng.uniform(-3, -1), filter_order=max(1, order)
        )
        try:
            factor = pidalab.gain_for_ms(pidalab.Loop(plant, controller), rng.uniform(1.3, 3.0))
        except (ValueError, ArithmeticError):
            continue
        return pidalab.Loop(plant, factor * controller), rng.uniform(10, 60) * total


BY_SIGNAL = [(name, signal) for name in ("tv", "tv1", "peak") for signal in "uy"]
ALONE = [name for name in (*MEASURES, "settling_time") if name not in ("tv", "tv1", "peak", "ie")]


def measured(run):
    """Return all measures of a run (None if refused), and which of them warn."""
    values = {}
    for name, *signal in [*BY_SIGNAL, *((name,) for name in ALONE)]:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                values[name, *signal] = getattr(run, name)(*signal), bool(caught)
            except ValueError:
                values[name, *signal] = None, True
    return values


def test_measures_of_a_coarse_grid_are_right_or_warn():
    """Measures of random loops at 501 points differ from those at 20,001 points by at most 0.1 %, or warn. Few warn."""
    seed = 0
    rng, judged, warned, wrong = np.random.default_rng(seed), 0, 0, []
    for k in range(40):
        loop, end = random_loop(rng)
        for simulate in (pidalab.step_response, pidalab.load_response):
            try:
                coarse, fine = (measured(simulate(loop, np.linspace(0.0, end, n))) for n in (501, 20_001))
            except ValueError:  # the engine says that digits are lost
                continue
            for name, (value, warns) in coarse.items():
                reference, doubtful = fine[name]
                if value is None or reference is None or doubtful:
                    continue
                judged, warned = judged + 1, warned + warns
                size = fine["tv", name[-1]][0] if name[0] == "tv1" else 0.0
                least = {"overshoot": 1.0, "undershoot": 1.0, "tv1": size}.get(name[0], 0.0)
                if abs(value - reference) > 1e-3 * max(abs(reference), least) and not warns:
                    wrong.append((k, simulate.__name__, name, value, reference))
    assert wrong == [], f"seed {seed}"
    assert judged > 600
    assert warned < 0.05 * judged


FAST = pidalab.Loop(
    pidalab.Process([7.30964599, 7.26611957, 1.67103293], [0.02, 1.0, 0.0, 0.0, 0.0], 0.01864),
    control.tf([0.45815312, 1.52717708, 1.0], [0.07635885, 1.52717708, 0.0]),
)


def test_measures_refine_their_grid():
    """The samples alone would give an overshoot of 9 % instead of 13.9 %, and a TV of 12.7 instead of 20.1."""
    run = pidalab.step_response(FAST, np.linspace(0.0, 60.088, 501))
    assert run.overshoot() == pytest.approx(13.883, abs=0.002)
    assert run.rise_time() == pytest.approx(0.0352, rel=1e-2)
    assert run.tv("u") == pytest.approx(20.12, rel=1e-3)
    assert run.ise() == pytest.approx(0.0533, rel=1e-3)
    for other in (
        run.between(0.0, 60.0),
        run.measured(),
        run.against(run.measured()),
        pickle.loads(pickle.dumps(run)),
    ):
        assert other.tv("u") == pytest.approx(20.12, rel=1e-3)


def test_records_without_a_loop_warn():
    """The exact area shows that samples are too far apart. Fine records and records without area do not warn."""
    run = pidalab.step_response(FAST, np.linspace(0.0, 60.088, 501))
    signals = {name: getattr(run, name) for name in ("t", "r", "d", "n", "y", "u")}
    with pytest.warns(RuntimeWarning, match=r"overshoot is uncertain by about .* take a smaller step"):
        Response(**signals, area=run.area).overshoot()
    fine = pidalab.step_response(FAST, np.linspace(0.0, 10.0, 20_001))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Response(**signals).overshoot()
        Response(**{name: getattr(fine, name) for name in (*signals, "area")}).overshoot()


LOUD = pidalab.Loop(pidalab.fopdt(2.0, 1.0, 0.1), pidalab.PIDA(20.0, 0.1, 0.05))
DIVERGED = pidalab.step_response(LOUD, np.linspace(0.0, 5.0, 501))
CUT_OFF = pidalab.step_response(
    pidalab.Loop(pidalab.lags(3, delay=0.2), pidalab.PIDA(1.0, 3.0)), np.linspace(0.0, 0.5, 51)
)


@pytest.mark.parametrize("measure", [*MEASURES, "settling_time"])
def test_a_response_that_diverges_or_is_cut_off_has_no_measure(measure):
    with pytest.raises(ValueError, match=r"does not diverge|band must contain"):
        getattr(DIVERGED, measure)()
    if measure in ("overshoot", "peak_time", "rise_time", "settling_time"):
        with pytest.raises(ValueError, match=r"t = 0\.5|simulate longer"):
            getattr(CUT_OFF, measure)()


def test_a_response_that_diverges_has_measures_up_to_a_horizon():
    assert DIVERGED.iae(0.1) == pytest.approx(0.1, rel=1e-6)
    assert DIVERGED.peak("u", 0.05) == pytest.approx(np.abs(DIVERGED.u[:6]).max())


@pytest.mark.parametrize(("last", "settled"), [(36, True), (37, False)])
def test_an_integral_to_infinity_needs_rest_in_the_last_tenth(last, settled):
    t = np.arange(41.0)
    loud = record(t, np.where(t <= last, -1.0, 0.0), r=0.0)
    for name in ("ie", "iae", "ise", "itae"):
        assert getattr(DECAY, name)(math.inf) == getattr(DECAY, name)()
        if settled:
            assert abs(getattr(loud, name)(math.inf)) > 30
        else:
            with pytest.raises(ValueError, match="horizon"):
                getattr(loud, name)(math.inf)


def test_a_late_load_is_not_divergence():
    t = np.linspace(0.0, 100.0, 1001)
    loop = pidalab.Loop(pidalab.fopdt(1.0, 1.0, 1.0), pidalab.PIDA(0.5, 1.0))
    late = pidalab.simulate(loop, t, load=np.where(t >= 92, 1.0, 0.0))
    early = pidalab.load_response(loop, t[:81])
    assert late.iae() == pytest.approx(early.iae(), rel=1e-9)
    assert (late.tv("u"), late.peak("y")) == pytest.approx((early.tv("u"), early.peak("y")), rel=1e-9)


# Measures of sampled responses against the oracle.
#
# The measures use parabolas between samples, or straight lines where only samples are known. The file contains the
# errors of this interpolation, from make_measures.py. Since steps are large, twice this error is
# allowed, plus 1e-9 for the engine.

POWERS = {
    "iae": 4,
    "ise": 4,
    "itae": 4,
    "overshoot": 3,
    "tv_u": 2,
    "tv_y": 2,
    "rise_time": 2,
    "settling_time": 2,
}
CASES = oracle("measures.json")["cases"]


def measures(response, step_of_setpoint):
    """Return all measures that the oracle has."""
    values = {name: getattr(response, name)() for name in ("ie", "iae", "ise", "itae")}
    values |= {"tv_u": response.tv("u"), "tv_y": response.tv("y")}
    if step_of_setpoint:
        values |= {name: getattr(response, name)() for name in ("overshoot", "rise_time", "settling_time")}
    return values


@pytest.mark.parametrize("finer", [16, 64])
@pytest.mark.parametrize("source", ["setpoint", "load"])
@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_measures(case, source, finer):
    """The errors decrease with a power of the sample time."""
    h, expected = case["step"] / finer, case[source]
    t = np.linspace(0.0, case["end"], round(case["end"] / h) + 1)
    simulate = pidalab.step_response if source == "setpoint" else pidalab.load_response
    values = measures(simulate(oracle_loop(case), t), source == "setpoint")
    assert values.keys() == expected["values"].keys()
    for name, value in values.items():
        true = float(expected["values"][name])
        allowed = 2 * expected["rates"].get(name, 0.0) * h ** POWERS.get(name, 1)
        assert value == pytest.approx(true, rel=0.0, abs=allowed + 1e-9 * max(1.0, abs(true))), name
