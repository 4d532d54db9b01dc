r"""Crossovers of a loop that is given by its factors, in one walk along the axis each: compiled code.

With :math:`L = k \prod (s - z_i) / \prod (s - p_i)\; e^{-s h}` the derivatives of its logarithm are sums,

.. math:: \lambda = \frac{L'}{L} = \sum \frac{1}{s - z_i} - \sum \frac{1}{s - p_i} - h, \qquad
          \mu = \lambda' = -\sum \frac{1}{(s - z_i)^2} + \sum \frac{1}{(s - p_i)^2},

and those of S and T follow: :math:`S' = -\lambda T S = -T'`. Newton's method, kept between two points of the walk, then
needs three or four steps where a search that compares values needs forty. Without numba the array forms of
`pidalab.robustness._arrays` do the same.

Complex numbers are divided by hand: numba raises for a zero divisor, a pole on the axis, whatever it is told. What is
compared is written so that NaN counts as "look closer".
"""

from __future__ import annotations

import numpy as np

from pidalab._compiled import compiled, plain
from pidalab.robustness import _arrays
from pidalab.robustness._arrays import (
    COARSE_STEP,
    HUGE,
    MOST_POINTS,
    NEAR_POSITIVE_AXIS,
    REAL,
    TINIEST,
    TOUCHING,
)

# rad that the dead time must turn the phase by between two points, and the factors at most, for a count of the turns
CLEAR_TURN, FACTORS_TURN = 2.0, 0.3
MOST_STEPS = 120  # of Newton's method or of bisection, between two points
SAME_TOP = 1e-8  # share of its bracket by which the last step to a peak moves at most: the peak is flat
# share of the first bracket, and of the step before, by which a step to a crossover moves that is to be the last: those
# of Newton's method then shrink by their square
SMALLEST_STEP, QUICKER = 1e-10, 1e-2
SAME_CROSSING = 4e-16  # share of a frequency, the same for a crossover


@compiled
def fraction(s, of):
    """Numerator and denominator of L, factor by factor over |s| plus a speed: their products stay in range."""
    gain, zeros, poles, speeds, delay = of
    size, angle = abs(s), -s.imag * delay
    level = gain if s.real == 0.0 else gain * np.exp(-s.real * delay)
    num, den = complex(level * np.cos(angle), level * np.sin(angle)), 1.0 + 0.0j
    for i in range(poles.size):
        scale = 1.0 / (size + speeds[i])
        den = den * ((s - poles[i]) * scale)
        num = num * ((s - zeros[i]) * scale if i < zeros.size else scale)
    return num, den


@compiled
def inverse(z):
    """1/z; infinite or NaN where z is 0."""
    size = abs(z)
    return complex(z.real / size / size, -z.imag / size / size)


@compiled
def slopes(s, of):
    """First and second derivative of ln L."""
    _, zeros, poles, _, delay = of
    first, second = complex(-delay, 0.0), 0.0j
    for zero in zeros:
        part = inverse(s - zero)
        first += part
        second -= part * part
    for pole in poles:
        part = inverse(s - pole)
        first -= part
        second += part * part
    return first, second


def _along_in_arrays(w, lean, aside, of):
    return _arrays.fraction((1j - lean) * w - aside, of)


@plain(_along_in_arrays)
def along(w, lean, aside, of):
    """Numerator and denominator of L at s = jw - lean w - aside."""
    num, den = np.empty(w.size, dtype=np.complex128), np.empty(w.size, dtype=np.complex128)
    for i in range(w.size):
        num[i], den[i] = fraction(complex(-lean * w[i] - aside, w[i]), of)
    return num, den


# --- gain crossovers --------------------------------------------------------------------------------------------------


@compiled
def _gain(w, lean, aside, of):
    """ln |L|, and its first and second derivative by the frequency."""
    s, way = complex(-lean * w - aside, w), complex(-lean, 1.0)
    num, den = fraction(s, of)
    first, second = slopes(s, of)
    return np.log(abs(num) / abs(den)), (way * first).real, (way * way * second).real


@compiled
def _extremum(sign, low, at, high, lean, aside, of):
    """Where sign times ln |L| is least between two points, and ln |L| there."""
    w, value = at, 0.0
    for _ in range(MOST_STEPS):
        value, slope, bend = _gain(w, lean, aside, of)
        if sign * slope > 0.0:
            high = w
        else:
            low = w
        after = w - slope / bend
        if not (sign * bend > 0.0 and low < after < high):
            after = 0.5 * (low + high)
        if abs(after - w) <= SAME_TOP * (high - low) or abs(after - w) <= SAME_CROSSING * w:
            break
        w = after
    return w, value


@compiled
def _crossing(real, low, high, rises, lean, aside, of):
    """Where ln |L| is 0 between two points, or L real; `rises` tells that it, or Im L, is above 0 at the second."""
    w, wide, last = 0.5 * (low + high), high - low, np.inf
    for _ in range(MOST_STEPS):
        if real:
            s = complex(0.0, w)
            num, den = fraction(s, of)
            product = num * np.conj(den)
            # the angle of -L, which changes by Re(lambda) along the axis: nearly a straight line, where the imaginary
            # part of L swings with its size
            value, slope = np.arctan2(-product.imag, -product.real), slopes(s, of)[0].real
            positive = product.imag > 0.0
        else:
            value, slope, _ = _gain(w, lean, aside, of)
            positive = value > 0.0
        if positive == rises:
            high = w
        else:
            low = w
        after = w - value / slope
        if not low <= after <= high:
            after = 0.5 * (low + high)
        step = abs(after - w)
        if step <= SAME_CROSSING * w or (step <= SMALLEST_STEP * wide and step <= QUICKER * last):
            return after
        w, last = after, step
    return w


def _gain_crossings_in_arrays(w, num, den, lean, aside, of):
    return _arrays.gain_crossings(lambda w: _arrays.fraction((1j - lean) * w - aside, of), w, num, den)


@plain(_gain_crossings_in_arrays)
def gain_crossings(w, num, den, lean, aside, of):
    """As `_arrays.gain_crossings`, at s = jw - lean w - aside."""
    # what is seen: a gain of 1 all along has no crossover
    place, value, seen = np.empty(w.size), np.empty(w.size), 0
    for i in range(w.size):
        level = np.log(abs(num[i]) / abs(den[i]))
        if abs(level) >= REAL and abs(level) < np.inf:
            place[seen], value[seen] = w[i], level
            seen += 1
    found, touched, count, touching = np.empty(2 * w.size), np.empty(w.size), 0, 0
    for i in range(1, seen):
        before, here = value[i - 1], value[i]
        if before * here < 0.0:
            found[count] = _crossing(False, place[i - 1], place[i], here > 0.0, lean, aside, of)
            count += 1
        if i == seen - 1 or not abs(here) < TOUCHING:
            continue
        sign = 1.0 if here > 0.0 else -1.0
        if sign * here <= sign * before and sign * here < sign * value[i + 1]:
            top, least = _extremum(sign, place[i - 1], place[i], place[i + 1], lean, aside, of)
            touched[touching] = top
            touching += 1
            if sign * least < -REAL:  # two crossovers between points on one side of 1
                first = place[i - 1] if top < place[i] else place[i]
                last = place[i] if top < place[i] else place[i + 1]
                found[count] = _crossing(False, first, top, sign < 0.0, lean, aside, of)
                found[count + 1] = _crossing(False, top, last, sign > 0.0, lean, aside, of)
                count += 2
    return found[:count], touched[:touching]


# --- phase crossovers -------------------------------------------------------------------------------------------------


@compiled
def _turns(w0, n0, d0, w1, n1, d1, delay):
    """Angle of -L at a point, how far it turns to the next, and how often L crosses the negative axis on the way.

    That is known where the dead time turns the phase by more than the factors do: the number is -1 where it is not.
    """
    before, after = n0 * np.conj(d0), n1 * np.conj(d1)
    start, stop = np.arctan2(-before.imag, -before.real), np.arctan2(-after.imag, -after.real)
    turned = (w1 - w0) * delay
    # what the factors add: small between points of the grid, so that its principal value is it
    own = (after * np.conj(before)) * complex(np.cos(turned), np.sin(turned))
    added = np.arctan2(own.imag, own.real)
    if not (turned > CLEAR_TURN and abs(added) < FACTORS_TURN):
        return start, turned, -1
    whole = np.rint((turned - added - start + stop) / (2.0 * np.pi))
    return start, turned - added, int(whole) + (1 if start > 0.0 else 0) - (1 if stop > 0.0 else 0)


@compiled
def _append(found, count, w):
    """Add a frequency to those found, in a longer array where they fill theirs."""
    if count == found.size:
        longer = np.empty(2 * count)
        for j in range(count):
            longer[j] = found[j]
        found = longer
    found[count] = w
    return found


def _phase_crossings_in_arrays(w, num, den, floor, every, of):
    return _arrays.phase_crossings(lambda w: _arrays.fraction(1j * w, of), w, num, den, floor, every, of[4])


@plain(_phase_crossings_in_arrays)
def phase_crossings(w, num, den, floor, every, of):
    """As `_arrays.phase_crossings`; NaN alone where the dead time turns the phase too often."""
    delay, found, count, points = of[4], np.empty(64), 0, 0.0
    kept = TINIEST if every else floor
    started, w0, side0, ahead0, loud0 = False, 0.0, 0.0, False, False
    last = 0.0
    for i in range(w.size):
        size, before = abs(num[i]) / abs(den[i]), last
        last = size
        parts = 1
        if i > 0 and delay > 0.0 and (size >= floor or before >= floor):
            turns = np.ceil((w[i] - w[i - 1]) * delay / COARSE_STEP)
            points += turns
            if not points <= MOST_POINTS:
                return np.full(1, np.nan)
            parts = max(1, int(turns))
        product = num[i] * np.conj(den[i])
        clear = started and w0 == w[i - 1] and abs(product.imag) >= REAL * abs(product)
        if parts > 1 and clear and min(size, before) > kept and max(size, before) < HUGE:
            angle, turned, crossings = _turns(w0, num[i - 1], den[i - 1], w[i], num[i], den[i], delay)
            for k in range(crossings):
                # the phase is nearly a straight line
                share = (angle + 2.0 * np.pi * (k + (0 if angle > 0.0 else 1))) / turned
                guess, beside = w0 + share * (w[i] - w0), 1.0 / delay
                at = _crossing(True, guess - beside, guess + beside, True, 0.0, 0.0, of)
                found = _append(found, count, at)
                count += 1
            if crossings >= 0:
                ahead = product.real > NEAR_POSITIVE_AXIS * abs(product)
                started, w0, side0, ahead0, loud0 = True, w[i], product.imag, ahead, size >= kept
                continue
        for k in range(1, parts + 1):
            here, n, d = w[i], num[i], den[i]
            if k < parts:
                here = w[i - 1] + k * ((w[i] - w[i - 1]) / parts)
                n, d = fraction(complex(0.0, here), of)
            product = n * np.conj(d)
            if not abs(product.imag) >= REAL * abs(product):
                continue
            ahead = product.real > NEAR_POSITIVE_AXIS * abs(product)
            loud = abs(n) >= kept * abs(d)
            if started and side0 * product.imag < 0.0 and not (ahead0 and ahead) and (loud0 or loud):
                at = _crossing(True, w0, here, product.imag > 0.0, 0.0, 0.0, of)
                n, d = fraction(complex(0.0, at), of)
                # the phase also jumps at poles and zeros on the axis
                if (n * np.conj(d)).real < 0.0 and abs(n) >= kept * abs(d) and abs(n) < HUGE * abs(d):
                    found = _append(found, count, at)
                    count += 1
            started, w0, side0, ahead0, loud0 = True, here, product.imag, ahead, loud
    return found[:count]
