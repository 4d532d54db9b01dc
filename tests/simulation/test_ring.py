"""The exact engine over dead times: its plain form with every index tested, and how far it follows a loop."""

import math
from types import FunctionType

import numpy as np
import pytest
from engine_errors import oracle, oracle_loop

import pidalab
from pidalab._compiled import Kernel
from pidalab.simulation import ladder
from pidalab.simulation.realisation import cut_at_delay


def as_loops(value, made):
    """Return what numba compiles as Python, which tests each index, and so all that it calls."""
    if not isinstance(value, Kernel):
        return value
    if id(value) not in made:
        names = dict(value.function.__globals__)
        code, defaults = value.function.__code__, value.function.__defaults__
        made[id(value)] = FunctionType(code, names, value.__name__, defaults)
        names.update({name: as_loops(one, made) for name, one in names.items()})
    return made[id(value)]


FEW = [case for case in oracle("delay_loops.json")["cases"] if case["delay"]][::4]


@pytest.mark.parametrize("form", ["arrays", "loops"])
@pytest.mark.parametrize("case", FEW, ids=lambda case: case["name"])
def test_both_plain_forms_give_the_response(case, form):
    """In array operations and element by element: what the engine gives, which the oracle tests."""
    cut = cut_at_delay(oracle_loop(case), "rd")
    step, n = case["delay"] / 3.7, 23
    arguments = (cut, step, n, ladder._intervals(cut, n, step), ladder.norm_over(cut, n, step))
    run = ladder._responses.python_form if form == "arrays" else as_loops(ladder._responses, {})
    found, _, status = run(*arguments)
    expected = ladder.responses(cut, n, step, arguments[-1])
    assert status == ladder.DONE
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-12 * np.abs(expected).max())


CUT = cut_at_delay(pidalab.Loop(pidalab.fopdt(1.0, 1.0, 0.5), pidalab.PIDA(0.5, 2.0)), "r")


@pytest.mark.parametrize(
    ("status", "numbers"),
    [
        (ladder.TOO_MANY, ("spans 4.2 dead times",)),
        (ladder.TOO_DEEP, ("what happened 77 dead times ago", "over 1333 dead times and not over 4")),
        (ladder.TOO_LARGE, ("leaves the range of numbers",)),
    ],
)
def test_what_cannot_be_followed_is_refused_with_its_numbers(monkeypatch, status, numbers):
    """Eight times in steps of 0.3 are 4.2 dead times of 0.5."""
    assert CUT.x0.shape[0] == 4
    monkeypatch.setattr(ladder, "_responses", lambda *_: (None, 77, status))
    with pytest.raises(ValueError) as refused:  # noqa: PT011  # its numbers follow
        ladder.responses(CUT, 8, 0.3, 4.0)
    for number in numbers:
        assert number.replace("1333", "1000") in str(refused.value)
    assert isinstance(refused.value, ladder.ManyDeadTimes) is (status == ladder.TOO_MANY)


@pytest.mark.parametrize(
    ("n", "step", "td"),
    [(60, 0.03, 0.0), (30, 0.31, 0.0), (25, 0.03, 0.1)],
    ids=["inside_dead_times", "across_them", "to_the_first_time"],
)
def test_work_is_followed_to_the_last_multiplication_that_is_allowed(n, step, td):
    """All multiplications of stacks, or of states at the multiples of the dead time, are counted as they are made."""
    cut = cut_at_delay(pidalab.Loop(pidalab.fopdt(1.0, 1.0, 0.5), pidalab.PIDA(0.5, 2.0, td, n=100)), "rd")
    given = (cut, step, n, ladder._intervals(cut, n, step), ladder.norm_over(cut, n, step))
    run, made = as_loops(ladder._responses, {}), {"inside": 0, "across": 0}
    names = run.__globals__
    advanced, transition, climb = names["advanced"], names["transition"], names["ladder"]

    def counting(stack, order, rung, keep):
        made["inside"] += stack.size * rung.shape[1]
        return advanced(stack, order, rung, keep)

    def sizing(*arguments):
        whole = transition(*arguments)
        made["across"] = given[-2] * cut.x0.shape[1] * whole.size
        return whole

    def climbing(*arguments):
        # the highest rung is the longest that fits into a dead time: what is carried on by it is not longer
        top = arguments[-2]
        assert 0.5 * cut.delay < step * 2.0**top <= cut.delay
        return climb(*arguments)

    names.update(advanced=counting, transition=sizing, ladder=climbing)
    found, _, status = run(*given)
    assert status == ladder.DONE
    np.testing.assert_allclose(found, ladder.responses(cut, n, step, given[-1]), rtol=1e-12, atol=1e-13)
    most = max(made.values())
    for allowed, then in ((most, ladder.DONE), (most - 1, ladder.TOO_MANY)):
        names["MAX_WORK"] = allowed
        assert run(*given)[2] == then


@pytest.mark.parametrize(
    ("loop", "step", "allowed"),
    [
        (pidalab.Loop(pidalab.fopdt(1.0, 1.0, 0.3713), pidalab.PIDA(0.1, 0.9, 0.3, 0.02)), 0.3713, 30),
        (pidalab.Loop(pidalab.fopdt(1.0, 1.0, 0.5), pidalab.PIDA(0.5, 2.0)), 0.51 * 0.5, 17),
    ],
    ids=["farther_inside_a_dead_time", "farther_across_it"],
)
def test_what_is_remembered_is_followed_over_as_many_dead_times_as_allowed(monkeypatch, loop, step, allowed):
    """Inside a dead time the first loop remembers more than 60 others, across one 28; the second one 15 and 17."""
    cut = cut_at_delay(loop, "r")

    def respond(intervals):
        n = math.ceil(intervals * cut.delay / step) + 1
        assert ladder._intervals(cut, n, step) == intervals
        return ladder.responses(cut, n, step, ladder.norm_over(cut, n, step))

    monkeypatch.setattr(ladder, "_responses", ladder._responses.python_form)
    without_limit = respond(allowed)
    for names in (vars(ladder), ladder._responses.__globals__):
        monkeypatch.setitem(names, "MAX_STACK", allowed * cut.x0.shape[0])
    np.testing.assert_array_equal(respond(allowed), without_limit)
    with pytest.raises(ValueError, match=rf"over {allowed} dead times and not over {allowed + 1}; shorten t"):
        respond(allowed + 1)
