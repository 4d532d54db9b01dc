"""Other units change nothing, whatever the loop."""

import math

import drawn
import numpy as np
from hypothesis import assume, given

import pidalab
from pidalab import HighOrderPID, Loop, Process

scales = drawn.decades(-4, 4)


def slower(process, times):
    """The process with its time in a unit `times` shorter: everything takes that many units more."""
    powers = {n: times ** np.arange(n - 1, -1, -1.0) for n in (process.num.size, process.den.size)}
    num, den = (p * powers[p.size] for p in (process.num, process.den))
    return Process(num, den, process.delay * times)


def slowed(controller, times):
    """A controller whose gains go with the same change of unit."""
    powers = times ** np.arange(-1.0, len(controller.coefficients) - 1)
    return HighOrderPID(
        (np.asarray(controller.coefficients) * powers).tolist(),
        controller.filter_time * times,
        controller.filter_order,
    )


@drawn.cases(12)
@given(drawn.loops(), scales)
def test_another_unit_of_time_changes_no_response_and_no_margin(loop, times):
    other = Loop(slower(loop.process, times), slowed(loop.controller, times))
    assert pidalab.is_stable(other) == pidalab.is_stable(loop)
    first, second = pidalab.margins(loop), pidalab.margins(other)
    for name in ("gm", "pm", "ms", "mt"):
        assert math.isclose(getattr(first, name), getattr(second, name), rel_tol=1e-5) or not first.stable
    t = np.linspace(0, 20 * max(loop.process.delay, 0.5), 101)
    assume(first.stable)
    here, there = pidalab.load_response(loop, t).y, pidalab.load_response(other, times * t).y
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-7 * max(np.abs(here).max(), 1e-9))


@drawn.cases(12)
@given(drawn.loops(), scales)
def test_another_unit_of_the_output_changes_no_margin(loop, size):
    p, c = loop.process, loop.controller
    gains = (np.asarray(c.coefficients) / size).tolist()
    other = Loop(Process(size * p.num, p.den, p.delay), HighOrderPID(gains, c.filter_time, c.filter_order))
    first, second = pidalab.margins(loop), pidalab.margins(other)
    assert first.stable == second.stable
    for name in ("gm", "pm", "dm", "ms", "mt"):
        assert math.isclose(getattr(first, name), getattr(second, name), rel_tol=1e-5) or not first.stable
