"""Compare responses, poles, margins and noise gains of random loops with second methods."""

import math

import drawn
import numpy as np
import second
from hypothesis import assume, example, given, strategies as st

import pidalab

NEAR = 1e-3  # allowed difference from the series, relative to the largest value


def characteristic_turns(loop, gain=1.0, later=0.0):
    """Return True if the loop with another gain and a longer dead time is stable, by the second method."""
    p = loop.process
    count = second.unstable_poles(pidalab.Process(gain * p.num, p.den, p.delay + later), loop.controller)
    assume(count is not None)
    return count == 0


@drawn.cases(5)
@given(drawn.loops())
@example(pidalab.Loop(pidalab.fopdt(1.0, 0.1, 0.0), pidalab.HighOrderPID([10.54, 3.162], 0.03, 1)))
def test_responses(loop):
    fastest = float(np.max(pidalab.rightmost_poles(loop).real))
    end = 30 * max(loop.process.delay, 0.5)
    assume(fastest * end < 12)
    t, y = second.response(lambda s: loop.transfer("y", "d", s) / s, end, fastest)
    u = second.response(lambda s: loop.transfer("u", "d", s) / s, end, fastest)[1]
    times = np.linspace(0, end, 301)
    response = pidalab.load_response(loop, times)
    for values, expected in ((response.y, y), (response.u, u)):
        # The series smooths a kink over one step.
        allowed = NEAR * max(np.abs(expected).max(), 1e-12) + 0.5 * np.abs(np.diff(expected)).max()
        np.testing.assert_allclose(values, np.interp(times, t, expected), rtol=0, atol=allowed)


@drawn.cases(15)
@given(drawn.loops())
def test_unstable_poles(loop):
    count = second.unstable_poles(loop.process, loop.controller)
    assume(count is not None)
    assert pidalab.unstable_poles(loop) == count
    assert pidalab.is_stable(loop) == (count == 0)
    rightmost = float(np.max(pidalab.rightmost_poles(loop).real))
    assert rightmost > 0 if count else rightmost < 1e-9


@drawn.cases(6)
@given(drawn.loops())
def test_margins(loop):
    """A loop is stable just within its margins and unstable just beyond. No frequency has a sensitivity above Ms."""
    margins = pidalab.margins(loop)
    assert margins.stable == characteristic_turns(loop)
    if not margins.stable:
        assert margins.unstable_poles > 0
        assert math.isinf(margins.wms) or margins.ms >= abs(loop.S(1j * max(margins.wms, 1e-9))) * (1 - 1e-6)
        return
    inside, beyond = 1 - 1e-3, 1 + 1e-3
    if math.isfinite(margins.gm):
        assert characteristic_turns(loop, 1 + (margins.gm - 1) * inside)
        assert not characteristic_turns(loop, 1 + (margins.gm - 1) * beyond)
    if margins.gm_low > 0:
        assert not characteristic_turns(loop, margins.gm_low * inside)
        assert characteristic_turns(loop, margins.gm_low * beyond)
    if math.isfinite(margins.dm):
        assert characteristic_turns(loop, later=margins.dm * inside)
        assert not characteristic_turns(loop, later=margins.dm * beyond)
    w = np.geomspace(1e-5, 1e4, 20_000)
    assert np.abs(loop.S(1j * w)).max() <= margins.ms * (1 + 1e-9)
    assert np.abs(loop.T(1j * w)).max() <= margins.mt * (1 + 1e-9)
    for height, where, transfer in ((margins.ms, margins.wms, loop.S), (margins.mt, margins.wmt, loop.T)):
        if 0 < where < math.inf:
            assert math.isclose(abs(transfer(1j * where)), height, rel_tol=1e-6)


@drawn.cases(4)
@given(drawn.loops(drawn.stable), st.integers(0, 40), drawn.decades(-1.5, -0.5))
@example(pidalab.Loop(pidalab.fopdt(1.0, 1.0, 0.0), pidalab.HighOrderPID([0.0562, 1.0], 5.62, 3)), 0, 0.0316)
def test_noise_gain(loop, waits, sample_time):
    """Compare with the response of u to one held sample of noise, from the difference equation of the loop."""
    p = loop.process
    controller = loop.controller.discretise(sample_time)
    try:
        gain = pidalab.noise_gain(
            pidalab.Loop(pidalab.Process(p.num, p.den, waits * sample_time), controller), sample_time
        )
    except ValueError as refused:
        gain, said = None, str(refused)
    if gain is None:
        assert "stable" in said, said
        return
    digital = controller.transfer_function()
    u = second.sampled_pulse(p, waits, (digital.num[0][0], digital.den[0][0]), sample_time, 20_000)
    assume(abs(u[-1]) < 1e-9)
    assert math.isclose(gain, math.sqrt(np.sum(u**2)), rel_tol=1e-5)
