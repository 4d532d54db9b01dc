"""One step of a sampled controller: plain Python, which the simulation compiles, and which the written code repeats.

In this order: the prefilter; the deadband; the chains of lags; a fraction of any order; what an external signal
corrects; the growth of the integral; the limits of rate and range; what these take back from the integral.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.statespace import StateSpace

# places in the array of states; behind them the last set point and the states of a prefilter, for each path its last
# input and its lags, then those of the fraction, and room for differences
STARTED, INTEGRAL, CARRY, OLD, CONTROL, PATHS = range(6)


class Numbers(NamedTuple):
    """A sampled controller as numbers: all that a step needs besides its states.

    Attributes
    ----------
    prefilter_new, prefilter_old : float
        Shares of the set point now and one sample ago in what the states of a prefilter move towards.
    prefilter_move, prefilter_out : ndarray, shape (states, states) and (states,)
        How they move with their distances from it, and what these add to the set point; none without a prefilter.
    weight : ndarray, shape (paths,)
        Weight of the set point.
    new, old : ndarray, shape (paths, largest order)
        Shares g_0 and g_1 of the lags.
    order : ndarray of int, shape (paths,)
        Number of lags.
    gain : ndarray, shape (paths, largest order + 1)
        Gains on the last state and its differences.
    fraction : StateSpace
        What else acts on the error: a fraction of any order for a held input, as of a continuous controller.
    integrates : bool
        Whether there is integral action.
    from_signal : bool
        Automatic reset: the integral grows by what the paths make of the error. Otherwise it grows by the error.
    growth_new, growth_old : float
        By how much of its value now, and of that one sample ago.
    taken_back : float
        Back-calculation gain: share of u less its wanted value that is added to the integral.
    tracked : float
        Tracking gain: share of an external signal less u that is added to the integral.
    clamps : bool
        Whether the integral rests while it would drive the control signal further beyond a limit.
    clamps_next : bool
        The same for the growth by this sample's error, which comes with the next sample.
    low, high, rate : float
        Limits, and the largest change in a sample.
    deadband, bias, y_offset : float
        In the units of the signals.
    """

    prefilter_new: float
    prefilter_old: float
    prefilter_move: Array
    prefilter_out: Array
    weight: Array
    new: Array
    old: Array
    order: np.ndarray
    gain: Array
    fraction: StateSpace
    integrates: bool
    from_signal: bool
    growth_new: float
    growth_old: float
    taken_back: float
    tracked: float
    clamps: bool
    clamps_next: bool
    low: float
    high: float
    rate: float
    deadband: float
    bias: float
    y_offset: float


def fresh(numbers: Numbers, u: float) -> Array:
    """Return the states of a controller that will start with the control signal u."""
    before = numbers.prefilter_out.size
    size = PATHS + before + min(before, 1) + int(np.sum(numbers.order + 1)) + numbers.fraction.b.size
    states = np.zeros(size + room(numbers))
    states[CONTROL] = u
    return states


def rest(numbers: Numbers) -> Array:
    """Return the states of a controller at rest, all signals 0."""
    states = fresh(numbers, 0.0)
    states[STARTED] = 1.0
    return states


def room(n: Numbers) -> int:
    """Return how many numbers a step works with besides the states."""
    return max(n.new.shape[1] + 1, n.fraction.b.size)


def advance(n: Numbers, s: Array, r: float, y: float, manual: float, track: float) -> float:
    """Advance the states by one sample and return the control signal; nan stands for no `manual` and no `track`."""
    r, y = r - n.y_offset, y - n.y_offset
    starts = s[STARTED] == 0.0
    s[STARTED] = 1.0
    at, free = PATHS, s.size - room(n)

    # the prefilter: its states move towards the set point
    m = n.prefilter_out.size
    if m:
        if starts:
            s[at : at + m + 1] = r
        aim = n.prefilter_new * r + n.prefilter_old * s[at]
        s[at] = r
        for i in range(m):
            s[free + i] = s[at + 1 + i] - aim
        for i in range(m):
            moved = 0.0
            for j in range(m):
                moved += n.prefilter_move[i, j] * s[free + j]
            s[at + 1 + i] += moved
        added = 0.0
        for i in range(m):
            added += n.prefilter_out[i] * (s[at + 1 + i] - r)
        r += added
        at += m + 1

    error = r - y
    if n.deadband > 0.0:
        if error > n.deadband:
            error = error - n.deadband
        elif error < -n.deadband:
            error = error + n.deadband
        else:
            error = 0.0
        y = r - error

    # chains of lags, and the differences that end at their last states
    p = n.fraction.d * error
    for i in range(n.order.size):
        order = n.order[i]
        now = n.weight[i] * r - y
        if starts:
            s[at : at + order + 1] = now
        before = s[at]
        s[at] = s[free] = now
        for j in range(1, order + 1):
            x = s[at + j]
            now = x + (n.new[i, j - 1] * (now - x) + n.old[i, j - 1] * (before - x))
            before = x
            s[at + j] = s[free + j] = now
        for k in range(order + 1):
            p += n.gain[i, k] * s[free + order]
            for j in range(order, k, -1):
                s[free + j] = s[free + j - 1] - s[free + j]
        at += order + 1

    # the fraction
    for i in range(n.fraction.b.size):
        p += n.fraction.c[i] * s[at + i]
        moved = n.fraction.b[i] * error
        for j in range(n.fraction.b.size):
            moved += n.fraction.A[i, j] * s[at + j]
        s[free + i] = moved
    for i in range(n.fraction.b.size):
        s[at + i] = s[free + i]

    # an external signal that acted in place of ours since the last sample
    if track == track and not starts:
        if n.integrates:
            s[INTEGRAL] += n.tracked * (track - s[CONTROL])
        if n.from_signal:
            s[OLD] = track - n.bias - s[INTEGRAL]
        s[CONTROL] = track
    # without a bump: the first signal is the one that it starts with
    if starts and n.integrates and manual != manual:
        manual = s[CONTROL]

    old = error
    signal = p if n.from_signal else error
    growth = n.growth_new * signal + n.growth_old * s[OLD]
    if manual == manual:
        u = limited(n, s[CONTROL], manual)
        if n.integrates:
            s[INTEGRAL] = u - n.bias - p
            s[CARRY] = 0.0
    else:
        # what rounding takes from the integral is carried over to the next sample
        added = growth + s[CARRY]
        integral = s[INTEGRAL] + added
        wanted = n.bias + p + integral
        u = limited(n, s[CONTROL], wanted)
        if n.clamps_next and (u - wanted) * n.growth_old * error < 0.0:
            old = 0.0
        if n.clamps and (u - wanted) * growth < 0.0:
            u = limited(n, s[CONTROL], n.bias + p + s[INTEGRAL])
        elif n.integrates:
            s[CARRY] = added - (integral - s[INTEGRAL])
            s[INTEGRAL] = integral
            if n.taken_back > 0.0 and u != wanted:
                added = n.taken_back * (u - wanted) + s[CARRY]
                s[INTEGRAL] = integral + added
                s[CARRY] = added - (s[INTEGRAL] - integral)
    s[OLD] = u - n.bias - s[INTEGRAL] if n.from_signal else old
    s[CONTROL] = u
    return u


def limited(n: Numbers, last: float, wanted: float) -> float:
    """Limit a control signal in rate, and then in range."""
    u = wanted
    if u > last + n.rate:
        u = last + n.rate
    if u < last - n.rate:
        u = last - n.rate
    if u > n.high:
        u = n.high
    if u < n.low:
        u = n.low
    return u
