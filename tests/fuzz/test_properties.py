"""What must hold whatever the loop: other units change nothing, and what is converted comes back."""

import math

import drawn
import numpy as np
from hypothesis import assume, given, strategies as st

import pidalab
from pidalab import HighOrderPID, Loop, Process
from pidalab.rules import classical, direct, haalman, itae, magnitude_optimum

scales = drawn.decades(-4, 4)
RULES = {
    "haalman PIDA": (
        haalman.tune,
        st.builds(pidalab.lags, st.just(3), drawn.decades(-0.5, 0.5), drawn.gains, drawn.delays),
    ),
    "SIMC": (
        classical.simc,
        st.builds(pidalab.sopdt, drawn.gains, drawn.decades(-0.5, 0.5), st.floats(1, 3), drawn.delays),
    ),
    "AMIGO": (
        classical.amigo,
        st.builds(pidalab.fopdt, drawn.gains, drawn.decades(-0.5, 0.5), drawn.decades(-1, 0.5)),
    ),
    "direct": (
        direct.tune,
        st.builds(
            pidalab.sopdt, drawn.gains, drawn.decades(-0.5, 0.5), st.floats(0.5, 1), drawn.decades(-1, 0)
        ),
    ),
    "ITAE": (
        itae.tune,
        st.builds(
            pidalab.sopdt, drawn.gains, drawn.decades(-0.5, 0.5), st.floats(0.5, 1), drawn.decades(-1, 0)
        ),
    ),
}


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


@drawn.cases(25)
@given(st.sampled_from(sorted(RULES)), st.data(), scales)
def test_a_rule_knows_no_unit(name, data, times):
    """The same design in another unit of time, or refused in both."""
    tune, models = RULES[name]
    model = data.draw(models)
    found = []
    for one in (model, slower(model, times)):
        try:
            found.append(tune(one).controller.gains())
        except ValueError:
            found.append(None)
    if None in found:
        assert found == [None, None]
        return
    first, second = map(np.asarray, found)
    np.testing.assert_allclose(second, first * times ** np.arange(-1.0, 3.0), rtol=1e-6)


@drawn.cases(10)
@given(st.integers(1, 5), drawn.decades(-0.5, 0.5), drawn.delays, st.integers(0, 2))
def test_the_magnitude_optimum_is_flat(order, lag, delay, m):
    """|T| of the unfiltered loop departs from 1 only with a power of w that its m + 2 gains cannot cancel."""
    process = pidalab.lags(order, lag, 1.0, delay)
    try:
        gains = magnitude_optimum.tune(process, m, m, 0.0).controller
    except (ValueError, ArithmeticError):
        return
    w = 5e-2 / (order * lag + delay)
    s = 1j * np.array([w, 2 * w])
    open_loop = process(s) * np.polyval(np.asarray(gains.coefficients)[::-1], s) / s
    off = np.abs(np.abs(open_loop / (1 + open_loop)) ** 2 - 1)
    assert off[1] >= off[0] * 2 ** (2 * (m + 2)) or off[1] < 1e-11
