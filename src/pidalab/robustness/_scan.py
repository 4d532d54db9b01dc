r"""Crossovers and peaks of a loop that is given by its factors, in one walk along the axis each: compiled code.

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
    COARSE,
    COMPLEMENTARY,
    DETOUR,
    FINE,
    HUGE,
    MOST_POINTS,
    NEAR_POSITIVE_AXIS,
    NO_HIGHER,
    REAL,
    SENSITIVITY,
    TINIEST,
    TOUCHING,
)

MOST_STEPS = 120  # of Newton's method or of bisection, between two points
SAME_TOP = 1e-8  # share of its bracket by which the last step to a peak moves at most: the peak is flat
SAME_CROSSING = 4e-16  # share of a frequency, the same for a crossover


@compiled
def fraction(s, of):
    """Numerator and denominator of L, factor by factor over |s| plus a speed: their products stay in range."""
    gain, zeros, poles, speeds, delay = of
    size = abs(s)
    num, den = gain * np.exp(-s * delay), 1.0 + 0.0 * s
    for i in range(poles.size):
        scale = 1.0 / (size + speeds[i])
        den = den * ((s - poles[i]) * scale)
        num = num * ((s - zeros[i]) * scale if i < zeros.size else scale)
    return num, den


@compiled
def _inverse(z):
    """1/z; infinite or NaN where z is 0."""
    size = abs(z)
    return complex(z.real / size / size, -z.imag / size / size)


@compiled
def _slopes(s, of):
    """First and second derivative of ln L."""
    _, zeros, poles, _, delay = of
    first, second = complex(-delay, 0.0), 0.0j
    for zero in zeros:
        part = _inverse(s - zero)
        first += part
        second -= part * part
    for pole in poles:
        part = _inverse(s - pole)
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
    first, second = _slopes(s, of)
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
def _crossing(low, high, rises, lean, aside, of):
    """Where ln |L| is 0 between two points."""
    w = 0.5 * (low + high)
    for _ in range(MOST_STEPS):
        value, slope, _ = _gain(w, lean, aside, of)
        if (value > 0.0) == rises:
            high = w
        else:
            low = w
        after = w - value / slope
        if not low <= after <= high:
            after = 0.5 * (low + high)
        if abs(after - w) <= SAME_CROSSING * w:
            return after
        w = after
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
            found[count] = _crossing(place[i - 1], place[i], here > 0.0, lean, aside, of)
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
                found[count] = _crossing(first, top, sign < 0.0, lean, aside, of)
                found[count + 1] = _crossing(top, last, sign > 0.0, lean, aside, of)
                count += 2
    return found[:count], touched[:touching]


# --- phase crossovers -------------------------------------------------------------------------------------------------


@compiled
def _opposite(low, high, above, of):
    """Where L crosses the real axis between two points; `above` tells on which side of it the second one lies."""
    w = 0.5 * (low + high)
    for _ in range(MOST_STEPS):
        s = complex(0.0, w)
        num, den = fraction(s, of)
        product = num * np.conj(den)
        if (product.imag > 0.0) == above:
            high = w
        else:
            low = w
        first, _ = _slopes(s, of)
        after = w - np.arctan2(-product.imag, -product.real) / first.real
        if not low <= after <= high:
            after = 0.5 * (low + high)
        if abs(after - w) <= SAME_CROSSING * w:
            return after
        w = after
    return w


def _phase_crossings_in_arrays(w, num, den, floor, every, of):
    return _arrays.phase_crossings(lambda w: _arrays.fraction(1j * w, of), w, num, den, floor, every, of[4])


@plain(_phase_crossings_in_arrays)
def phase_crossings(w, num, den, floor, every, of):
    """As `_arrays.phase_crossings`; NaN alone where the dead time turns the phase too often."""
    delay, found, count, points = of[4], np.empty(64), 0, 0.0
    kept = TINIEST if every else floor
    started, w0, side0, ahead0, loud0 = False, 0.0, 0.0, False, False
    last = abs(num[0]) / abs(den[0])
    for i in range(w.size):
        size = abs(num[i]) / abs(den[i])
        parts = 1
        if i > 0 and delay > 0.0 and (size >= floor or last >= floor):
            turns = np.ceil((w[i] - w[i - 1]) * delay / COARSE)
            points += turns
            if not points <= MOST_POINTS:
                return np.full(1, np.nan)
            parts = max(1, int(turns))
        last = size
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
                at = _opposite(w0, here, product.imag > 0.0, of)
                n, d = fraction(complex(0.0, at), of)
                # the phase also jumps at poles and zeros on the axis
                if (n * np.conj(d)).real < 0.0 and abs(n) >= kept * abs(d) and abs(n) < HUGE * abs(d):
                    if count == found.size:
                        longer = np.empty(2 * count)
                        for j in range(count):
                            longer[j] = found[j]
                        found = longer
                    found[count] = at
                    count += 1
            started, w0, side0, ahead0, loud0 = True, here, product.imag, ahead, loud
    return found[:count]


# --- peaks ------------------------------------------------------------------------------------------------------------


@compiled
def _heights(kind, w, num, den, weight):
    """Height of a function of L at a point, that over |1 + L|, and the weight."""
    top = abs(den) if kind == SENSITIVITY else abs(num) if kind == COMPLEMENTARY else 0.5 * abs(den - num)
    factor = 1.0
    if weight[2].size > 0 or weight[0] != 1.0:
        n, d = fraction(complex(0.0, w), weight)
        factor = abs(n) / abs(d)
    return factor * top / abs(den + num), factor * top / abs(den), factor


@compiled
def _summit(kind, low, at, high, weight, of):
    """Highest value between two points, from one between them, and where it lies."""
    w, best, where = at, -1.0, at
    for _ in range(MOST_STEPS):
        s = complex(0.0, w)
        num, den = fraction(s, of)
        first, second = _slopes(s, of)
        inverse = _inverse(den + num)
        S, T = den * inverse, num * inverse
        both = T * S
        if kind == SENSITIVITY:
            slope, bend = -first * T, -second * T - first * first * both
        elif kind == COMPLEMENTARY:
            slope, bend = first * S, second * S - first * first * both
        else:
            back = _inverse(0.5 * (S - T))
            slope = -first * both * back
            bend = -(second * both + first * first * both * (S - T)) * back - slope * slope
        if weight[2].size > 0:
            own_first, own_second = _slopes(s, weight)
            slope, bend = slope + own_first, bend + own_second
        value = _heights(kind, w, num, den, weight)[0]
        if value > best:
            best, where = value, w
        # along the axis: ds = j dw
        rise, curve = -slope.imag, -bend.real
        if rise > 0.0:
            low = w
        else:
            high = w
        after = w - rise / curve
        if not (curve < 0.0 and low < after < high):
            after = 0.5 * (low + high)
        if abs(after - w) <= SAME_CROSSING * w:
            break
        if abs(after - w) <= SAME_TOP * (high - low) and value == best:
            return best, after
        w = after
    return best, where


def _highest_in_arrays(kind, w, num, den, least, weight, of):
    def factor(w):
        n, d = _arrays.fraction(1j * w, weight)
        return abs(n / d)

    return _arrays.highest(kind, lambda w: _arrays.fraction(1j * w, of), factor, w, num, den, of[4], least)


@plain(_highest_in_arrays)
def highest(kind, w, num, den, least, weight, of):
    """As `_arrays.highest`; NaN where the dead time turns the phase too often."""
    delay, size, points = of[4], w.size, 0.0
    best, where = least, np.nan
    value, over, factor = np.empty(size), np.empty(size), np.empty(size)
    for i in range(size):
        value[i], over[i], factor[i] = _heights(kind, w[i], num[i], den[i], weight)
        if value[i] > best:
            best, where = value[i], w[i]
    passed = 0  # points; the last one and the one before
    w1, h1, o1, c1 = 0.0, 0.0, 0.0, 0.0j
    w0, h0, o0, c0 = 0.0, 0.0, 0.0, 0.0j
    for i in range(size):
        parts = 1
        turns = 0.0 if i == 0 else np.ceil((w[i] - w[i - 1]) * delay / FINE)
        if turns > 1.0:
            a, b = abs(num[i - 1]) / abs(den[i - 1]), abs(num[i]) / abs(den[i])
            low, high = min(a, b), max(a, b)
            # between two points |1 + L| is at least the distance of |L| from 1, whatever the dead time turns
            apart = max(low * low / high - 1.0, 1.0 - high * high / low)
            n0, n1 = factor[i - 1], factor[i]
            if kind == COMPLEMENTARY:
                n0, n1 = n0 * a, n1 * b
            elif kind != SENSITIVITY:
                n0, n1 = 0.5 * n0 * (1.0 + a), 0.5 * n1 * (1.0 + b)
            top, bottom = max(n0, n1), min(n0, n1)
            bound = top * (top / bottom if bottom > 0.0 else 1.0) / apart
            if not (high == 0.0 or (apart > 0.0 and bound <= best * (1.0 + NO_HIGHER))):
                points += turns
                if not points <= MOST_POINTS:
                    return np.nan, np.nan
                parts = int(turns)
        for k in range(1, parts + 1):
            here, h, o, n, d = w[i], value[i], over[i], num[i], den[i]
            if k < parts:
                here = w[i - 1] + k * ((w[i] - w[i - 1]) / parts)
                n, d = fraction(complex(0.0, here), of)
                h, o, _ = _heights(kind, here, n, d, weight)
                if h > best:
                    best, where = h, here
            c = n * _inverse(d)
            # a hill at the last point; a difference of rounding makes none
            if passed > 1 and h1 >= max(h0, h) and h1 * (1.0 - REAL) > min(h0, h):
                # beside a point L comes no closer to -1 than its way to the next one allows
                closest = abs(1.0 + c1) - DETOUR * max(abs(c1 - c0), abs(c - c1))
                top, bottom = max(o0, o1, o), min(o0, o1, o)
                bound = top * (top / bottom if bottom > 0.0 else 1.0) / closest
                if not (closest > 0.0 and bound <= best * (1.0 + NO_HIGHER)):
                    peak, at = _summit(kind, w0, w1, here, weight, of)
                    if peak > best:
                        best, where = peak, at
            w0, h0, o0, c0 = w1, h1, o1, c1
            w1, h1, o1, c1 = here, h, o, c
            passed += 1
    return best, where
