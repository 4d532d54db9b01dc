"""Check random loops in other units."""

import math

import drawn
import numpy as np
from hypothesis import assume, given

import pidalab
from pidalab import HighOrderPID, Loop, Process

scales = drawn.decades(-4, 4)


def slower(process, times):
    """Return the process with a unit of time that is shorter by the factor `times`."""
    powers = {n: times ** np.arange(n - 1, -1, -1.0) for n in (process.num.size, process.den.size)}
    num, den = (p * powers[p.size] for p in (process.num, process.den))
    return Process(num, den, process.delay * times)


def slowed(controller, times):
    """Return the controller after the same change of unit."""
    powers = times ** np.arange(-1.0, len(controller.coefficients) - 1)
    return HighOrderPID(
        (np.asarray(controller.coefficients) * powers).tolist(),
        controller.filter_time * times,
        controller.filter_order,
    )


@drawn.cases(15)
@given(drawn.loops(), scales, scales)
def test_other_units_change_no_response_and_no_margin(loop, times, size):
    """The units of time and output are smaller by the factors `times` and `size`."""
    process, controller = slower(loop.process, times), slowed(loop.controller, times)
    gains = (np.asarray(controller.coefficients) / size).tolist()
    other = Loop(
        Process(size * process.num, process.den, process.delay),
        HighOrderPID(gains, controller.filter_time, controller.filter_order),
    )
    first, second = pidalab.margins(loop), pidalab.margins(other)
    assert pidalab.is_stable(other) == pidalab.is_stable(loop) == first.stable == second.stable
    assume(first.stable)
    for name, unit in (("gm", 1), ("pm", 1), ("dm", times), ("ms", 1), ("mt", 1)):
        assert math.isclose(unit * getattr(first, name), getattr(second, name), rel_tol=1e-5)
    t = np.linspace(0, 20 * max(loop.process.delay, 0.5), 101)
    here, there = pidalab.load_response(loop, t).y, pidalab.load_response(other, times * t).y
    np.testing.assert_allclose(there, size * here, rtol=0, atol=1e-7 * size * max(np.abs(here).max(), 1e-9))
