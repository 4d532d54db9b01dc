"""Tune in other units and at the threshold of each doubt, and compute doubts by hand."""

import math
import re
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

import pidalab
from pidalab import Loop, Process, Record, fopdt, lags, tune
from pidalab.plant import tuning
from pidalab.plant.fitting import fit
from pidalab.plant.tuning import perturbed_plants, plants_within
from pidalab.rules import Design
from pidalab.rules.classical import simc

THIRD = lags(3, delay=1.0)
GAIN, TIME = -70.0, 60.0


def in_units(process, gain, time):
    """Return the same plant with output and time in other units."""
    num, den = (c * time ** np.arange(c.size - 1.0, -1.0, -1.0) for c in (process.num, process.den))
    return Process(gain * num, den, time * process.delay)


def numbers(text):
    """Return all numbers in the text of a doubt."""
    return [float(x) for x in re.findall(r"-?\d+\.?\d*(?:e[+-]?\d+)?", text)]


@pytest.fixture
def searched(monkeypatch):
    """Replace the search by one without active limits, and return the list of its requests."""
    asked = []

    def least_iae(process, order, requirements, start):
        asked.append(SimpleNamespace(process=process, order=order, **vars(requirements)))
        if math.isinf(process.gain()):
            controller = pidalab.PIDA(0.2, 200.0)
        else:  # the dead time is very short, and a high gain lets the loop settle within few dead times
            quick = 100 * process.delay < process.den[-2]
            controller = pidalab.PIDA((9.0 if quick else 0.3) / process.gain(), process.den[-2])
        return Design(process, controller, info={"active": ()})

    monkeypatch.setattr("pidalab.optimal.least_iae", least_iae)
    return asked


SETTLING = {"kind": "PID", "rule": "simc", "sample_time": 0.3, "spread": 0.1, "ms_worst": 9.0}


def test_design_is_independent_of_units():
    """A gain of -70 and minutes instead of seconds change no Ms and no doubt, and gains are converted."""
    process = lags(2, delay=0.5)
    own = tune(process, **SETTLING)
    other = tune(in_units(process, GAIN, TIME), **SETTLING | {"sample_time": TIME * SETTLING["sample_time"]})
    for name, unit in (("kp", GAIN), ("ki", GAIN * TIME), ("kd", GAIN / TIME)):
        expected = getattr(own.controller.gains(), name)
        assert getattr(other.controller.gains(), name) * unit == pytest.approx(expected, rel=1e-6)
    units = {"ms": 1, "mks": -GAIN, "iae": 1 / -GAIN / TIME, "ms_worst": 1, "ms_sampled": 1}
    for name, unit in units.items():
        assert other.info[name] * unit == pytest.approx(own.info[name], rel=1e-6), name
    words = [[re.sub(r"[\d.e+-]+", "#", doubt) for doubt in design.doubts] for design in (own, other)]
    assert words[0] == words[1]


@pytest.mark.parametrize("lag", [0.5, 8.0])
def test_default_limit_of_noise(searched, lag):
    """For an integrator with a lag, the limit is 10/|P| at 1/lag, where the lag turns the phase by 45 degrees."""
    for plant, asked in (
        (Process([0.25], [lag, 1.0, 0.0]), math.sqrt(2) / (0.25 * lag)),
        (fopdt(-4.0, lag, lag), 1 / 4),
    ):
        (said,) = tune(plant, "PI", ms_worst=9.0).info["notes"]
        assert numbers(said)[0] == pytest.approx(10 * asked, rel=0.01)
        assert searched[-1].mks == pytest.approx(10 * asked, rel=0.01)
        assert (searched[-1].noise_gain, searched[-1].sample_time) == (None, None)


def test_given_limits_reach_the_search(searched):
    design = tune(THIRD, "PID", noise_gain=3.0, sample_time=0.3, ms=1.7)
    (asked,) = searched
    assert (asked.order, asked.ms, asked.mks, asked.noise_gain, asked.sample_time) == (1, 1.7, None, 3.0, 0.3)
    assert asked.process.delay == pytest.approx(1.15)
    assert asked.family == ()  # the first search takes no other plants into account
    assert not any("noise" in doubt for doubt in design.doubts)


@pytest.mark.parametrize(("share", "left_out"), [(0.97, True), (1.03, False)])
@pytest.mark.parametrize("asked", [{}, {"sample_time": 6.0}, {"rule": "magnitude optimum"}], ids=str)
def test_negligible_dead_time_is_left_out(searched, asked, share, left_out):
    """The limit depends on the fastest frequency at which the loop acts.

    For a lag T this is sqrt(99)/T, where |P| is a tenth of its gain; else 1/sample time; else the crossover.
    """
    lag = 60.0
    if "rule" in asked:
        acts = pidalab.gain_crossovers(tune(Process([3.0], [lag, 1.0]), "PI", **asked).loop()).max()
    else:
        acts = 1 / asked["sample_time"] if asked else math.sqrt(99) / lag
    design = tune(fopdt(3.0, lag, share * 1e-3 / acts), "PI", **asked)
    assert (design.model.delay == 0.0) is left_out
    assert any("left out" in doubt for doubt in design.doubts) is left_out


def test_half_a_sample_and_filter_count_as_plant():
    own = tune(THIRD, "PID", rule="simc", sample_time=0.3).controller
    assert own == simc(lags(3, delay=1.15), "PID").controller
    lag = fopdt(2.0, 0.7, 0.0).rational_part()
    filtered = tune(fopdt(1.5, 4.0, 1.0), "PI", rule="simc", output_filter=lag)
    seen = Process([3.0], np.convolve([4.0, 1.0], [0.7, 1.0]), 1.0)
    assert filtered.controller.gains() == pytest.approx(simc(seen, "PI").controller.gains())


@pytest.mark.parametrize(
    "process", [Process([1.0, 2.0], [3.0, 4.0, 5.0], 0.5), pidalab.ipdt(0.5, 2.0)], ids=repr
)
def test_perturbed_plants_are_all_corners(process):
    s = 0.3j
    plain = Process(process.num, process.den)
    expected = [
        complex(g * plain(t * s) * np.exp(-d * process.delay * s))
        for g, t, d in product((0.8, 1.2), repeat=3)
    ]
    assert [complex(plant(s)) for plant in perturbed_plants(process, 0.2)] == pytest.approx(expected)
    assert plants_within(process, process, None) == []
    with pytest.raises(ValueError, match="spread must be below 1, found 1"):
        plants_within(process, process, 1.0)


def test_worst_of_the_spread():
    design = tune(THIRD, "PI", rule="simc", spread=0.15, ms_worst=9.0)
    loops = [Loop(plant, design.controller) for plant in perturbed_plants(THIRD, 0.15)]
    t = np.linspace(0.0, 150.0, 15001)
    worst = max(loops, key=lambda loop: pidalab.max_sensitivity(loop)[0])
    assert design.info["iae_worst"] == pytest.approx(pidalab.load_response(worst, t).iae(), rel=1e-3)
    assert design.ms_worst == pytest.approx(max(pidalab.max_sensitivity(loop)[0] for loop in loops))
    assert design.price == 1.0
    assert not any("price" in doubt for doubt in design.doubts)


@pytest.mark.parametrize(("price", "doubted"), [(1.49, False), (1.51, True)])
def test_high_price_is_doubted(monkeypatch, price, doubted):
    monkeypatch.setattr(tuning, "_by_rule", lambda *_: (simc(THIRD, "PI"), price))
    said = [doubt for doubt in tune(THIRD, "PI", rule="simc").doubts if "price" in doubt]
    assert len(said) == doubted
    if doubted:
        assert numbers(said[0])[0] == price


@pytest.mark.parametrize(("turn", "doubted"), [(0.49, False), (0.51, True)])
def test_long_sample_is_doubted(turn, doubted):
    loop = simc(THIRD, "PI").loop()
    crossover = pidalab.robustness.margins.gain_crossovers(loop).max()
    doubts = []
    tuning._doubt_sampling(loop, turn / crossover, doubts)
    assert len(doubts) == doubted
    if doubted:
        assert numbers(doubts[0])[-1] == pytest.approx(0.5 / crossover, rel=0.05)
        assert turn in numbers(doubts[0])


@pytest.mark.parametrize(("share", "doubted"), [(0.998, True), (1.002, False)])
def test_filter_faster_than_the_sample_is_doubted(share, doubted):
    doubts = []
    loop = Loop(THIRD, pidalab.PIDA(0.01, 3.0, 1.0, n=2.0))
    tuning._doubt_sampling(loop, 0.5 / share, doubts)
    assert [numbers(doubt)[0] for doubt in doubts if "filter" in doubt] == [0.5] * doubted


def record(before, after, noise=0.02):
    """Return the step response of a lag of 6."""
    t = np.arange(0.0, 60.0, 0.5)
    y = 2.0 * (after - before) * -np.expm1(-np.maximum(t - 11.0, 0.0) / 6.0)
    return Record(t, np.where(t < 10.0, before, after), y + np.random.default_rng(1).normal(0, noise, t.size))


def test_default_limit_of_noise_of_a_record(searched):
    fitted = fit(record(7.0, 5.0), "fopdt")
    said = numbers(tune(fitted, "PI", spread=0.05).info["notes"][0])
    assert said[0] == pytest.approx(0.01 * 2.0 / fitted.noise, rel=0.01)
    assert 2.0 in said
    assert searched[0].noise_gain == pytest.approx(0.01 * 2.0 / fitted.noise)
    assert searched[0].sample_time == 0.5  # of the record
    assert searched[0].mks is None


def test_derivative_beyond_known_dynamics_is_doubted():
    doubts = {}
    for kind in ("PI", "PID", "PIDA"):
        tuning._known_dynamics(fopdt(1.0, 1.0, 1.0), fopdt(1.0, 1.0, 1.0), kind, doubts.setdefault(kind, []))
    assert [len(said) for said in doubts.values()] == [0, 0, 1]
    assert numbers(doubts["PIDA"][0])[0] == 1


def test_unstable_loop_has_infinite_measures():
    found = tuning._iae_ms_mks(Loop(THIRD, pidalab.PIDA(9.0, 1.0)))
    assert found == {"iae": math.inf, "ms": math.inf, "mks": math.inf}
    rule = SimpleNamespace(name="simc", knows_ms=False)
    rule.tune = lambda *_: Design(THIRD, pidalab.PIDA(9.0, 1.0))
    evaluator, limits = tuning.LoopEvaluator(None, None), tuning.Requirements(ms=1.6)
    with pytest.raises(ValueError, match="'simc' is unstable with the model itself"):
        tuning._by_rule(rule, THIRD, "PI", evaluator, THIRD, limits, "help")


def test_rule_with_ms_keeps_both_limits():
    free = tune(THIRD, "PIDA", rule="haalman", ms=1.8)
    assert free.ms == pytest.approx(1.8, rel=2e-3)
    held = tune(THIRD, "PIDA", rule="haalman", ms=1.8, spread=0.2, ms_worst=1.9)
    assert held.ms_worst == pytest.approx(1.9, rel=2e-3)
    assert held.ms < free.ms
    assert held.price > 1.0
