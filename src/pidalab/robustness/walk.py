r"""Crossovers and peaks of a loop that is given by its factors, each in one walk along the axis: compiled code.

With :math:`L = k \prod (s - z_i) / \prod (s - p_i)\; e^{-s h}` the derivatives of its logarithm are sums,

.. math:: \lambda = \frac{L'}{L} = \sum \frac{1}{s - z_i} - \sum \frac{1}{s - p_i} - h, \qquad
          \mu = \lambda' = -\sum \frac{1}{(s - z_i)^2} + \sum \frac{1}{(s - p_i)^2},

and those of S and T follow: :math:`S' = -\lambda T S = -T'`. Newton's method, kept between two points of the walk, then
needs three or four steps where a search that compares values needs forty. Without numba the array forms of
`pidalab.robustness.axis` do the same.

Complex numbers are divided by hand: numba raises for a zero divisor, a pole on the axis, whatever it is told. What is
compared is written so that NaN counts as "look closer".
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pidalab._compiled import compiled, plain
from pidalab.robustness import axis
from pidalab.robustness.axis import (
    COARSE_STEP,
    COMPLEMENTARY,
    DETOUR,
    FINE_STEP,
    HUGE,
    MOST_POINTS,
    NEAR_POSITIVE_AXIS,
    NO_HIGHER,
    PIECE,
    ROUNDING,
    SENSITIVITY,
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
def fraction(s, factors):
    """Numerator and denominator of L, factor by factor over |s| plus a speed: their products stay in range."""
    gain, zeros, poles, speeds, delay = factors
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
def slopes(s, factors):
    """First and second derivative of ln L."""
    _, zeros, poles, _, delay = factors
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


def fraction_in_arrays(s: Any, factors: Any) -> tuple[Any, Any]:
    """Numerator and denominator of L, as `fraction`, for arrays."""
    gain, zeros, poles, speeds, delay = factors
    size, num, den = abs(s), gain * np.exp(-s * delay), 1.0 + 0.0 * s
    for i, (pole, speed) in enumerate(zip(poles.tolist(), speeds.tolist(), strict=True)):
        scale = 1.0 / (size + speed)
        den = den * ((s - pole) * scale)
        num = num * ((s - complex(zeros[i])) * scale if i < zeros.size else scale)
    return num, den


@plain(
    lambda w, contour_slope, contour_shift, factors: fraction_in_arrays(
        (1j - contour_slope) * w - contour_shift, factors
    )
)
def along(w, contour_slope, contour_shift, factors):
    """Numerator and denominator of L at s = jw - contour_slope w - contour_shift."""
    num, den = np.empty(w.size, dtype=np.complex128), np.empty(w.size, dtype=np.complex128)
    for i in range(w.size):
        num[i], den[i] = fraction(complex(-contour_slope * w[i] - contour_shift, w[i]), factors)
    return num, den


# --- gain crossovers --------------------------------------------------------------------------------------------------


@compiled
def _gain(w, contour_slope, contour_shift, factors):
    """ln |L|, and its first and second derivative by the frequency."""
    s, way = complex(-contour_slope * w - contour_shift, w), complex(-contour_slope, 1.0)
    num, den = fraction(s, factors)
    first, second = slopes(s, factors)
    return np.log(abs(num) / abs(den)), (way * first).real, (way * way * second).real


@compiled
def _extremum(sign, low, at, high, contour_slope, contour_shift, factors):
    """Return where sign times ln |L| is least between two points, and ln |L| there."""
    w, value = at, 0.0
    for _ in range(MOST_STEPS):
        value, slope, bend = _gain(w, contour_slope, contour_shift, factors)
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
def _crossing(real, low, high, rises, contour_slope, contour_shift, factors):
    """Return where ln |L| is 0 between two points, or L real; `rises` if it, or Im L, is above 0 at the second."""
    w, wide, last = 0.5 * (low + high), high - low, np.inf
    for _ in range(MOST_STEPS):
        if real:
            s = complex(0.0, w)
            num, den = fraction(s, factors)
            product = num * np.conj(den)
            # the angle of -L, which changes by Re(lambda) along the axis: nearly a straight line, where the imaginary
            # part of L swings with its size
            value, slope = np.arctan2(-product.imag, -product.real), slopes(s, factors)[0].real
            positive = product.imag > 0.0
        else:
            value, slope, _ = _gain(w, contour_slope, contour_shift, factors)
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


@plain(
    lambda w, num, den, contour_slope, contour_shift, factors: axis.gain_crossings(
        lambda w: fraction_in_arrays((1j - contour_slope) * w - contour_shift, factors), w, num, den
    )
)
def gain_crossings(w, num, den, contour_slope, contour_shift, factors):
    """As `axis.gain_crossings`, at s = jw - contour_slope w - contour_shift."""
    # a gain of 1 along the whole axis has no crossover
    place, value, seen = np.empty(w.size), np.empty(w.size), 0
    for i in range(w.size):
        level = np.log(abs(num[i]) / abs(den[i]))
        if abs(level) >= ROUNDING and abs(level) < np.inf:
            place[seen], value[seen] = w[i], level
            seen += 1
    found, touched, count, touching = np.empty(2 * w.size), np.empty(w.size), 0, 0
    for i in range(1, seen):
        before, here = value[i - 1], value[i]
        if before * here < 0.0:
            found[count] = _crossing(
                False, place[i - 1], place[i], here > 0.0, contour_slope, contour_shift, factors
            )
            count += 1
        if i == seen - 1 or not abs(here) < TOUCHING:
            continue
        sign = 1.0 if here > 0.0 else -1.0
        if sign * here <= sign * before and sign * here < sign * value[i + 1]:
            top, least = _extremum(
                sign, place[i - 1], place[i], place[i + 1], contour_slope, contour_shift, factors
            )
            touched[touching] = top
            touching += 1
            if sign * least < -ROUNDING:  # two crossovers between points on one side of 1
                first = place[i - 1] if top < place[i] else place[i]
                last = place[i] if top < place[i] else place[i + 1]
                found[count] = _crossing(False, first, top, sign < 0.0, contour_slope, contour_shift, factors)
                found[count + 1] = _crossing(
                    False, top, last, sign > 0.0, contour_slope, contour_shift, factors
                )
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


@plain(
    lambda w, num, den, floor, every, factors: axis.phase_crossings(
        lambda w: fraction_in_arrays(1j * w, factors), w, num, den, floor, every, factors[4]
    )
)
def phase_crossings(w, num, den, floor, every, factors):
    """Return the phase crossovers, as `axis.phase_crossings`; NaN alone where the dead time turns too often.

    Notes
    -----
    The state is the last point that is not on the real axis: its frequency, its side of the axis, and whether L is near
    the positive axis or loud there. A change of side between it and the next point is a crossover, unless both lie near
    the positive axis. A step in which the dead time turns the phase by more than `COARSE_STEP` is divided where L is
    loud. If the dead time alone decides how L turns in such a step, the number of crossovers is known from both ends,
    and each is found from its own guess.
    """
    delay, found, count, points = factors[4], np.empty(64), 0, 0.0
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
        clear = started and w0 == w[i - 1] and abs(product.imag) >= ROUNDING * abs(product)
        if parts > 1 and clear and min(size, before) > kept and max(size, before) < HUGE:
            angle, turned, crossings = _turns(w0, num[i - 1], den[i - 1], w[i], num[i], den[i], delay)
            for k in range(crossings):
                # the phase is nearly a straight line
                share = (angle + 2.0 * np.pi * (k + (0 if angle > 0.0 else 1))) / turned
                guess, beside = w0 + share * (w[i] - w0), 1.0 / delay
                at = _crossing(True, guess - beside, guess + beside, True, 0.0, 0.0, factors)
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
                n, d = fraction(complex(0.0, here), factors)
            product = n * np.conj(d)
            if not abs(product.imag) >= ROUNDING * abs(product):
                continue
            ahead = product.real > NEAR_POSITIVE_AXIS * abs(product)
            loud = abs(n) >= kept * abs(d)
            if started and side0 * product.imag < 0.0 and not (ahead0 and ahead) and (loud0 or loud):
                at = _crossing(True, w0, here, product.imag > 0.0, 0.0, 0.0, factors)
                n, d = fraction(complex(0.0, at), factors)
                # the phase also jumps at poles and zeros on the axis
                if (n * np.conj(d)).real < 0.0 and abs(n) >= kept * abs(d) and abs(n) < HUGE * abs(d):
                    found = _append(found, count, at)
                    count += 1
            started, w0, side0, ahead0, loud0 = True, here, product.imag, ahead, loud
    return found[:count]


# --- peaks -----------------------------------------------------------------------------------------------------------


@compiled
def _weigh(w, weight):
    """Modulus of the weight at a frequency."""
    if weight[2].size == 0 and weight[0] == 1.0:
        return 1.0
    n, d = fraction(complex(0.0, w), weight)
    return abs(n) / abs(d)


@compiled
def _height(kind, num, den):
    """|S|, |T| or half of |S - T|."""
    top = abs(den) if kind == SENSITIVITY else abs(num) if kind == COMPLEMENTARY else 0.5 * abs(den - num)
    return top / abs(den + num)


@compiled
def _bound(kind, a, f0, b, f1):
    """Return a bound of a height between two points, from |L| and the weight there: infinite where |L| may be 1.

    There |1 + L| is at least the distance of |L| from 1, whatever the dead time turns.
    """
    if kind == COMPLEMENTARY:
        f0, f1 = f0 * a, f1 * b
    elif kind != SENSITIVITY:
        f0, f1 = 0.5 * f0 * (1.0 + a), 0.5 * f1 * (1.0 + b)
    low, high, least, most = min(a, b), max(a, b), min(f0, f1), max(f0, f1)
    apart = max(low * low / high - 1.0, 1.0 - high * high / low)
    bound = most * (most / least if least > 0.0 else 1.0) / apart
    return bound if apart > 0.0 and high > 0.0 else np.inf


@compiled
def _may_exceed(best, h0, h1, h2, n0, d0, n1, d1, n2, d2):
    """Return True if a value may exceed the best between three points, of which the middle one is the highest."""
    before, here, after = n0 * inverse(d0), n1 * inverse(d1), n2 * inverse(d2)
    # beside a point L comes no closer to -1 than its way to the next one allows
    closest = abs(1.0 + here) - DETOUR * max(abs(here - before), abs(after - here))
    over = h0 * abs(1.0 + before), h1 * abs(1.0 + here), h2 * abs(1.0 + after)
    top, bottom = max(over[0], over[1], over[2]), min(over[0], over[1], over[2])
    bound = top * (top / bottom if bottom > 0.0 else 1.0) / closest
    return not (closest > 0.0 and bound <= best * (1.0 + NO_HIGHER))


@compiled
def _summit(kind, low, at, high, weight, factors):
    """Highest value between two points, from one between them, and where it lies."""
    w, best, where = at, -1.0, at
    for _ in range(MOST_STEPS):
        s = complex(0.0, w)
        num, den = fraction(s, factors)
        first, second = slopes(s, factors)
        back = inverse(den + num)
        S, T = den * back, num * back
        both = T * S
        # from S' = -lambda T S = -T': of ln S, of ln T, and of ln (S - T), whose own slope is -2 lambda T S/(S - T)
        if kind == SENSITIVITY:
            slope, bend = -first * T, -second * T - first * first * both
        elif kind == COMPLEMENTARY:
            slope, bend = first * S, second * S - first * first * both
        else:
            over = inverse(0.5 * (S - T))
            slope = -first * both * over
            bend = -(second * both + first * first * both * (S - T)) * over - slope * slope
        if weight[2].size > 0:
            own_first, own_second = slopes(s, weight)
            slope, bend = slope + own_first, bend + own_second
        value = _height(kind, num, den) * _weigh(w, weight)
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


def _modulus(w: Any, factors: Any) -> Any:
    num, den = fraction_in_arrays(1j * w, factors)
    return abs(num / den)


@plain(
    lambda kind, w, num, den, probes, least, weight, factors: axis.highest(
        kind,
        lambda w: fraction_in_arrays(1j * w, factors),
        lambda w: _modulus(w, weight),
        w,
        num,
        den,
        factors[4],
        probes,
        least,
    )
)
def highest(kind, w, num, den, probes, least, weight, factors):
    """Return the highest peak, as `axis.highest`; NaN where the dead time turns the phase too often.

    Notes
    -----
    `best` is the highest value so far, at `where`. It starts from probes near gain crossovers, since a known high peak
    saves steps. A step of the grid is divided only if the bound between its ends exceeds `best`: first into
    pieces, then each piece until the dead time turns the phase by `FINE_STEP` from point to point. The last two points
    (indices 0 and 1) and the present one show a hill. It is climbed by Newton's method if it may exceed `best`.
    """
    delay, size, points = factors[4], w.size, 0.0
    best, where = least, np.nan
    for probe in probes:
        n, d = fraction(complex(0.0, probe), factors)
        h = _height(kind, n, d) * _weigh(probe, weight)
        if h > best:
            best, where = h, probe
    if not np.isnan(where):
        peak, at = _summit(kind, where - FINE_STEP / delay, where, where + FINE_STEP / delay, weight, factors)
        if peak > best:
            best, where = peak, at
    value, factor, level = np.empty(size), np.empty(size), np.empty(size)
    for i in range(size):
        factor[i] = _weigh(w[i], weight)
        level[i] = abs(num[i]) / abs(den[i]) if delay > 0.0 else 0.0
        value[i] = factor[i] * _height(kind, num[i], den[i])
        if value[i] > best:
            best, where = value[i], w[i]
    passed = 0  # points; the last one and the one before
    w1, h1, num1, den1 = 0.0, 0.0, 0.0j, 0.0j
    w0, h0, num0, den0 = 0.0, 0.0, 0.0j, 0.0j
    for i in range(size):
        # long steps are taken in pieces, of which few may hold a peak
        pieces, turned = 1, 0.0
        if i > 0:
            turned = (w[i] - w[i - 1]) * delay / FINE_STEP
            if turned > PIECE:
                bound = _bound(kind, level[i - 1], factor[i - 1], level[i], factor[i])
                pieces = int(np.ceil(turned / PIECE)) if bound > best else 1
        w_before, f_before, level_before = w1, 1.0 if i == 0 else factor[i - 1], level[max(i - 1, 0)]
        for j in range(1, pieces + 1):
            stop, f, n_stop, d_stop, h_stop, level_stop = w[i], factor[i], num[i], den[i], value[i], level[i]
            if j < pieces:
                stop = w[i - 1] + j * ((w[i] - w[i - 1]) / pieces)
                n_stop, d_stop = fraction(complex(0.0, stop), factors)
                f, level_stop = _weigh(stop, weight), abs(n_stop) / abs(d_stop)
                h_stop = f * _height(kind, n_stop, d_stop)
                if h_stop > best:
                    best, where = h_stop, stop
            parts = 1
            if turned > pieces:
                bound = _bound(kind, level_before, f_before, level_stop, f)
                if not bound <= best * (1.0 + NO_HIGHER):
                    parts = int(np.ceil(turned / pieces))
            points += parts
            if points > MOST_POINTS:
                return np.nan, np.nan
            for k in range(1, parts + 1):
                here, h, n, d = stop, h_stop, n_stop, d_stop
                if k < parts:
                    here = w_before + k * ((stop - w_before) / parts)
                    n, d = fraction(complex(0.0, here), factors)
                    h = _height(kind, n, d) * _weigh(here, weight)
                    if h > best:
                        best, where = h, here
                # a hill at the last point; a difference of rounding makes none
                hill = passed > 1 and h1 >= max(h0, h) and h1 * (1.0 - ROUNDING) > min(h0, h)
                if hill and _may_exceed(best, h0, h1, h, num0, den0, num1, den1, n, d):
                    peak, at = _summit(kind, w0, w1, here, weight, factors)
                    if peak > best:
                        best, where = peak, at
                w0, h0, num0, den0 = w1, h1, num1, den1
                w1, h1, num1, den1 = here, h, n, d
                passed += 1
            w_before, f_before, level_before = stop, f, level_stop
    return best, where
