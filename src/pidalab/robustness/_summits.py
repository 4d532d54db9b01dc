"""The highest peak of a loop that is given by its factors, in one walk along the axis: compiled code, see `_scan`."""

from __future__ import annotations

import numpy as np

from pidalab._compiled import compiled, plain
from pidalab.robustness import _arrays
from pidalab.robustness._arrays import (
    COMPLEMENTARY,
    DETOUR,
    FINE_STEP,
    MOST_POINTS,
    NO_HIGHER,
    PIECE,
    REAL,
    SENSITIVITY,
)
from pidalab.robustness._scan import MOST_STEPS, SAME_CROSSING, SAME_TOP, fraction, inverse, slopes


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
    """What a height does not exceed between two points, from |L| and the weight there: infinite where |L| may be 1.

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
    """Whether between three points, the middle one of which is the highest, a value may exceed the best."""
    before, here, after = n0 * inverse(d0), n1 * inverse(d1), n2 * inverse(d2)
    # beside a point L comes no closer to -1 than its way to the next one allows
    closest = abs(1.0 + here) - DETOUR * max(abs(here - before), abs(after - here))
    over = h0 * abs(1.0 + before), h1 * abs(1.0 + here), h2 * abs(1.0 + after)
    top, bottom = max(over[0], over[1], over[2]), min(over[0], over[1], over[2])
    bound = top * (top / bottom if bottom > 0.0 else 1.0) / closest
    return not (closest > 0.0 and bound <= best * (1.0 + NO_HIGHER))


@compiled
def _summit(kind, low, at, high, weight, of):
    """Highest value between two points, from one between them, and where it lies."""
    w, best, where = at, -1.0, at
    for _ in range(MOST_STEPS):
        s = complex(0.0, w)
        num, den = fraction(s, of)
        first, second = slopes(s, of)
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


def _highest_in_arrays(kind, w, num, den, probes, least, weight, of):
    def factor(w):
        n, d = _arrays.fraction(1j * w, weight)
        return abs(n / d)

    return _arrays.highest(
        kind, lambda w: _arrays.fraction(1j * w, of), factor, w, num, den, of[4], probes, least
    )


@plain(_highest_in_arrays)
def highest(kind, w, num, den, probes, least, weight, of):
    """As `_arrays.highest`; NaN where the dead time turns the phase too often."""
    delay, size, points = of[4], w.size, 0.0
    best, where = least, np.nan
    for probe in probes:
        n, d = fraction(complex(0.0, probe), of)
        h = _height(kind, n, d) * _weigh(probe, weight)
        if h > best:
            best, where = h, probe
    if not np.isnan(where):
        peak, at = _summit(kind, where - FINE_STEP / delay, where, where + FINE_STEP / delay, weight, of)
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
                n_stop, d_stop = fraction(complex(0.0, stop), of)
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
                    n, d = fraction(complex(0.0, here), of)
                    h = _height(kind, n, d) * _weigh(here, weight)
                    if h > best:
                        best, where = h, here
                # a hill at the last point; a difference of rounding makes none
                hill = passed > 1 and h1 >= max(h0, h) and h1 * (1.0 - REAL) > min(h0, h)
                if hill and _may_exceed(best, h0, h1, h, num0, den0, num1, den1, n, d):
                    peak, at = _summit(kind, w0, w1, here, weight, of)
                    if peak > best:
                        best, where = peak, at
                w0, h0, num0, den0 = w1, h1, num1, den1
                w1, h1, num1, den1 = here, h, n, d
                passed += 1
            w_before, f_before, level_before = stop, f, level_stop
    return best, where
