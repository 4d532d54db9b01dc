"""Evaluate designs for several plants, and correct them until the sampled loops keep their limits."""

import math
from itertools import pairwise, permutations

import control
import numpy as np
import pytest

import pidalab
from pidalab.plant.safety import LoopEvaluator, LoopMs, correct_request, in_series, make_safe
from pidalab.requirements import Requirements
from pidalab.rules import Design
from pidalab.rules.classical import simc

GOOD = pidalab.fopdt(1.0, 2.0, 1.0)
LAGS = pidalab.lags(3, delay=1.0)
FEEDTHROUGH = pidalab.Process([2.0, 1.0], [1.0, 1.0])  # its sampled loop is algebraic
PI = Design(GOOD, pidalab.PIDA(0.5, 2.0))


def sampled_ms(plant, h=1.0):
    return pidalab.margins(pidalab.Loop(plant, PI.controller.discretise(h))).ms


def test_ms_is_that_of_the_sampled_loop():
    continuous, sampled = (LoopEvaluator(h, None).ms(PI, GOOD) for h in (None, 1.0))
    assert continuous == LoopMs(pytest.approx(pidalab.margins(PI.loop(GOOD)).ms))
    assert sampled == LoopMs(pytest.approx(sampled_ms(GOOD)))
    assert sampled.ms > 1.1 * continuous.ms


def test_output_filter_is_in_the_loop():
    lag = control.TransferFunction([1.0], [1.5, 1.0])
    evaluator = LoopEvaluator(None, lag)
    expected = pidalab.margins(pidalab.Loop(GOOD, PI.controller, lag)).ms
    assert evaluator.ms(PI, GOOD).ms == pytest.approx(expected)
    assert expected > 1.05 * LoopEvaluator(None, None).ms(PI, GOOD).ms
    both = in_series(lag, lag)
    assert np.allclose([both.num[0][0][0], *both.den[0][0]], [1.0, 2.25, 3.0, 1.0])
    assert in_series(lag, None) is lag
    assert in_series(None, lag) is lag
    assert in_series(None, None) is None


def test_unstable_loop_has_infinite_ms():
    fast = Design(GOOD, pidalab.PIDA(9.0, 2.0))
    for h in (None, 0.1):
        assert LoopEvaluator(h, None).ms(fast, GOOD) == LoopMs(math.inf)
        assert LoopEvaluator(h, None).worst(fast, [GOOD, pidalab.fopdt(0.1, 2.0, 1.0)]).ms == math.inf


def test_worst_ms_is_independent_of_the_order():
    """One plant has no sampled Ms. The other plants are judged by their sampled Ms."""
    evaluator = LoopEvaluator(1.0, None)
    alone = evaluator.ms(PI, FEEDTHROUGH)
    assert "Ms is that of the continuous loop" in alone.reason
    assert alone.ms == pytest.approx(pidalab.margins(PI.loop(FEEDTHROUGH)).ms)
    plants = [GOOD, FEEDTHROUGH, pidalab.fopdt(1.2, 2.0, 1.0)]
    found = {evaluator.worst(PI, order) for order in permutations(plants)}
    assert found == {LoopMs(sampled_ms(plants[2]), alone.reason)}
    # A refused plant leaves no trace.
    assert evaluator.ms(PI, GOOD) == LoopMs(pytest.approx(sampled_ms(GOOD)))
    assert evaluator.worst(PI, []) == LoopMs(0.0)


LIMITS = Requirements(ms=1.6, ms_worst=2.0)


class Machine:
    """Fake designer. For a requested m, Ms is 1 + 1.3 (m - 1), and the worst Ms is 1 + 1.5 (m - 1)."""

    def __init__(self, active=("ms", "ms_worst"), factors=(1.3, 1.5)):
        self.asked, self.active, self.factors = [], active, factors

    def __call__(self, asked, near):
        self.asked.append(asked)
        return asked, self.active

    def sizes(self, made):
        both = made.ms, made.ms_worst
        return tuple(1 + (ask - 1) * factor for ask, factor in zip(both, self.factors, strict=True))


def test_request_is_corrected_from_below():
    machine = Machine()
    made = correct_request(machine, machine.sizes, LIMITS)
    for size, limit in zip(machine.sizes(made), (1.6, 2.0), strict=True):
        assert limit * (1 - 1e-3) <= size <= limit * (1 + 1e-6)
    assert machine.asked[0] == LIMITS
    assert 2 <= len(machine.asked) <= 4


@pytest.mark.parametrize(("below", "designs"), [(1e-4, 1), (9e-4, 1), (1.1e-3, 2)])
@pytest.mark.parametrize("which", [0, 1])
def test_design_within_a_thousandth_is_the_last(which, below, designs):
    """Each design needs a search, so none follows a design that is this close to an active limit."""
    met = 1.6 * (1 - 5e-4), 2.0 * (1 - 5e-4)
    first = [limit * (1 - below) if k == which else met[k] for k, limit in enumerate((1.6, 2.0))]
    found, machine = iter([first, met]), Machine()
    assert correct_request(machine, lambda made: next(found), LIMITS) == machine.asked[-1]
    assert len(machine.asked) == designs


def test_inactive_limit_is_not_corrected():
    machine = Machine(active=("ms",), factors=(0.5, 0.1))
    made = correct_request(machine, machine.sizes, LIMITS)
    assert made.ms_worst == 2.0
    assert machine.sizes(made)[0] == pytest.approx(1.6, rel=1e-3)


def test_correction_is_at_most_a_factor_of_two():
    steep = Machine(factors=(100.0, 1.0))
    correct_request(steep, steep.sizes, LIMITS)
    asked = [one.ms - 1 for one in steep.asked]
    assert asked[1] == pytest.approx(0.3)
    assert all(0.5 * (1 - 1e-12) <= b / a <= 2 for a, b in pairwise(asked))
    flat = Machine(factors=(0.01, 1.0))
    correct_request(flat, flat.sizes, LIMITS)
    assert flat.asked[1].ms - 1 == pytest.approx(1.2)


def test_last_design_that_keeps_the_limits():
    one = Machine()
    one.sizes = lambda made: (1.5, 1.9)  # for any request
    assert correct_request(one, one.sizes, LIMITS) == one.asked[-1]
    assert len(one.asked) == 20
    calls = iter([(1.5, 1.9), *[(1.7, 1.9)] * 30])
    other = Machine()
    assert correct_request(other, lambda made: next(calls), LIMITS) == LIMITS
    with pytest.raises(ValueError, match=r"keeps ms <= 1\.6 and ms_worst <= 2: .* 1\.7 and ms_worst = 1\.9"):
        correct_request(Machine(), lambda made: (1.7, 1.9), LIMITS)


def closer(asked, near):
    """Design a PIDA for the smaller of two limits."""
    ms = min(asked.ms, asked.ms_worst) if asked.family else asked.ms
    return pidalab.rules.haalman.tune(LAGS, ms), ["ms", "ms_worst"]


@pytest.mark.parametrize("h", [None, 0.5])
def test_safe_design_keeps_both_limits(h):
    plants = [pidalab.lags(3, delay=1.4), pidalab.lags(3, delay=0.8)]
    evaluator = LoopEvaluator(h, None)
    easy, free = make_safe(closer, evaluator, LAGS, Requirements(ms=1.8, ms_worst=9.0, family=[]), "help")
    assert free == 1.0
    limits = Requirements(ms=1.8, ms_worst=1.9, family=plants)
    made, price = make_safe(closer, evaluator, LAGS, limits, "help")
    assert evaluator.worst(made, plants).ms == pytest.approx(1.9, rel=1.5e-3)
    assert evaluator.worst(made, plants).ms <= 1.9 * (1 + 1e-6)
    assert evaluator.ms(made, LAGS).ms < evaluator.ms(easy, LAGS).ms <= 1.8 * (1 + 1e-6)
    areas = [pidalab.load_response(one.loop(LAGS), np.linspace(0, 200, 4001)).iae() for one in (made, easy)]
    assert price == pytest.approx(areas[0] / areas[1], rel=1e-3)
    # A limit that the design already keeps needs no second search and changes nothing.
    wide, most = [], evaluator.worst(easy, plants).ms * (1 - 5e-7)

    def counted(asked, near):
        wide.append(asked)
        return closer(asked, near)

    limits = Requirements(ms=1.8, ms_worst=most, family=plants)
    same, free = make_safe(counted, evaluator, LAGS, limits, "help")
    assert (same.controller, free) == (easy.controller, 1.0)
    assert [asked.family for asked in wide] == [()] * len(wide)


@pytest.mark.parametrize(("dear", "taken"), [(3.0, True), (3.001, False)])
def test_price_is_at_most_three(dear, taken, monkeypatch):
    areas = iter([dear, 1.0])
    monkeypatch.setattr("pidalab.plant.safety.load_iae", lambda loop: next(areas))
    evaluator = LoopEvaluator(None, None)
    requirements = LAGS, Requirements(ms=1.8, ms_worst=1.9, family=[pidalab.lags(3, delay=1.4)]), "help"
    if taken:
        assert make_safe(closer, evaluator, *requirements)[1] == 3.0
        return
    with pytest.raises(ValueError, match=r"a safe design has 3\.0 times the IAE; help"):
        make_safe(closer, evaluator, *requirements)


def test_refusals():
    evaluator = LoopEvaluator(None, None)
    late = [pidalab.lags(3, delay=9.0)]
    with pytest.raises(ValueError, match=r"gives an unstable loop.*ms_worst = 1\.9 .*times the IAE; help"):
        make_safe(closer, evaluator, LAGS, Requirements(ms=1.8, ms_worst=1.9, family=late), "help")

    def stubborn(asked, near):
        return simc(LAGS, "PI"), ["ms"]

    worst = evaluator.worst(simc(LAGS, "PI"), [pidalab.lags(3, delay=1.5)]).ms
    requirements = LAGS, Requirements(ms=1.6, ms_worst=1.3, family=[pidalab.lags(3, delay=1.5)]), "help"
    with pytest.raises(ValueError, match=rf"gives an Ms of {worst:.3g}, .*\(no controller.*; help"):
        make_safe(stubborn, evaluator, *requirements)
