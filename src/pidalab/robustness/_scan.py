r"""The frequency response of a loop, followed along the axis: crossings, peaks and turns, in compiled code.

A loop is its factors: :math:`L(s) = k \prod (s - z_i) / \prod (s - p_i)\; e^{-s h}`. Its magnitude is smooth on a
logarithmic grid. Its phase also turns by the dead time, without end. So the grid is logarithmic, denser around lightly
damped roots, and its pieces are divided further where the dead time turns the phase quickly *and* L is large enough for
it to matter.
"""

from __future__ import annotations

import numpy as np

from pidalab._compiled import compiled
from pidalab.robustness._fraction import fraction

PER_DECADE = 120  # points of the logarithmic grid
MOST_POINTS = 10_000_000  # along the axis: more would take too long
COARSE = 1.0  # the same where only crossings of the real axis are looked for
TURNED = 0.8  # largest turn of the characteristic function between two points, in rad
ON_AXIS = 1e-9  # share of its terms below which the characteristic function has a zero on the contour
NEAR_AXIS = 0.5  # cosine of the angle to the positive axis below which the negative one may be crossed
REAL = 1e-12  # imaginary part, relative to the modulus, that is rounding
# functions of frequency; integers of numpy, since code would be compiled for each of Python's
GAIN, IMAGINARY, SENSITIVITY, COMPLEMENTARY, LOUD, QUIET = np.arange(6)


@compiled
def frequencies(zeros, poles, delay):
    """The grid: every decade in which something happens, four more on both sides, and what is narrower."""
    roots = np.empty(zeros.size + poles.size, dtype=np.complex128)
    for i in range(roots.size):
        roots[i] = zeros[i] if i < zeros.size else poles[i - zeros.size]
    low, high = np.inf, 0.0
    for root in roots:
        if root != 0.0:
            low, high = min(low, abs(root)), max(high, abs(root))
    if delay > 0.0:
        low, high = min(low, 1.0 / delay), max(high, 1.0 / delay)
    if high == 0.0:
        low = high = 1.0
    low, high = 1e-4 * low, 1e4 * high
    count = int(PER_DECADE * np.log10(high / low)) + 1
    # points around lightly damped roots, at the scale of their damping: in order, each moved down to its place
    close, at = np.empty(80 * roots.size), 0
    for root in roots:
        if root.imag > 0.0 and abs(root.real) < 0.2 * abs(root):
            width = max(abs(root.real), 1e-9 * abs(root))
            for k in range(80):
                side = 2.0 * (k % 2) - 1.0
                point = root.imag + side * width * 10.0 ** (-2.0 + 5.0 * (k // 2) / 39.0)
                if low < point < high:
                    i = at
                    while i > 0 and close[i - 1] > point:
                        close[i] = close[i - 1]
                        i -= 1
                    close[i] = point
                    at += 1
    # the grid, and these between its points
    w, size, used = np.empty(count + at), 0, 0
    for i in range(count):
        point = low * np.exp(np.log(high / low) * i / (count - 1))
        while used < at and close[used] <= point:
            if size == 0 or close[used] > w[size - 1]:
                w[size] = close[used]
                size += 1
            used += 1
        if size == 0 or point > w[size - 1]:
            w[size] = point
            size += 1
    return w[:size]


@compiled
def gains(w, gain, zeros, poles, reference):
    """|L| on the grid."""
    out = np.empty(w.size)
    for i in range(w.size):
        num, den = fraction(complex(0.0, w[i]), gain, zeros, poles, reference)
        out[i] = abs(num) / abs(den)
    return out


@compiled
def pieces(w, size, loud, delay, turn):
    """Into how many pieces each step of the grid is divided, and how many these are, if not too many."""
    out = np.ones(w.size - 1, dtype=np.intp)
    total = 0.0
    for i in range(out.size):
        if delay > 0.0 and max(size[i], size[i + 1]) >= loud:
            turns = np.ceil((w[i + 1] - w[i]) * delay / turn)
            total += turns
            if total > MOST_POINTS:
                break
            out[i] = max(1, int(turns))
    return out, total


@compiled
def _loop(w, gain, zeros, poles, reference, delay):
    num, den = fraction(complex(0.0, w), gain, zeros, poles, reference)
    return num * complex(np.cos(w * delay), -np.sin(w * delay)), den


@compiled
def _value(kind, x, gain, zeros, poles, reference, delay):
    """A function of frequency at e^x."""
    num, den = _loop(np.exp(x), gain, zeros, poles, reference, delay)
    if kind == IMAGINARY:
        product = num * np.conj(den)
        return product.imag / abs(product)
    if kind == SENSITIVITY:
        return -abs(den) / abs(den + num)
    if kind == COMPLEMENTARY:
        return -abs(num) / abs(den + num)
    excess = np.log(abs(num) / abs(den))
    return -excess if kind == LOUD else excess


@compiled
def _zero(kind, a, b, fa, fb, gain, zeros, poles, reference, delay):
    """Zero between a and b, where the signs differ: secant steps kept in a shrinking bracket (Illinois)."""
    side, last = 0, np.inf
    for i in range(200):
        x = (a * fb - b * fa) / (fb - fa)
        if i % 4 == 3 or not min(a, b) < x < max(a, b):
            x = 0.5 * (a + b)
        fx = _value(kind, x, gain, zeros, poles, reference, delay)
        if fx == 0.0 or min(abs(b - a), abs(x - last)) <= 4e-16 * max(1.0, abs(x)):
            return x
        last = x
        if (fx > 0.0) == (fb > 0.0):
            b, fb = x, fx
            if side == 1:
                fa *= 0.5
            side = 1
        else:
            a, fa = x, fx
            if side == -1:
                fb *= 0.5
            side = -1
    return 0.5 * (a + b)


@compiled
def _least(kind, a, middle, b, gain, zeros, poles, reference, delay):
    """Minimum between a and b: parabolas through the three best points, golden sections where these fail (Brent)."""
    x = w = v = middle
    fx = fw = fv = _value(kind, x, gain, zeros, poles, reference, delay)
    step = before = b - a
    tolerance = max(1e-9 * (b - a), 1e-15)
    for _ in range(100):
        center = 0.5 * (a + b)
        if abs(x - center) <= 2.0 * tolerance - 0.5 * (b - a):
            break
        r, q = (x - w) * (fx - fv), (x - v) * (fx - fw)
        p, q = (x - v) * q - (x - w) * r, 2.0 * (q - r)
        p, q = (-p, q) if q > 0.0 else (p, -q)
        if q != 0.0 and abs(p) < abs(0.5 * q * before) and q * (a - x) < p < q * (b - x):
            before, step = step, p / q
        else:
            before = (b if x < center else a) - x
            step = 0.381966 * before
        u = x + (step if abs(step) >= tolerance else np.copysign(tolerance, step))
        fu = _value(kind, u, gain, zeros, poles, reference, delay)
        if fu <= fx:
            if u < x:
                b = x
            else:
                a = x
            v, w, x, fv, fw, fx = w, x, u, fw, fx, fu
        else:
            if u < x:
                a = u
            else:
                b = u
            if fu <= fw or w == x:
                v, w, fv, fw = w, u, fw, fu
            elif fu <= fv or v in (x, w):
                v, fv = u, fu
    return x, fx


@compiled
def gain_crossings(w, size, gain, zeros, poles, reference):
    """Frequencies where |L| = 1, pairs included between which it only just passes 1."""
    found = [0.0 for _ in range(0)]
    before, at = np.log(size[0]), np.log(w[0])
    for i in range(1, w.size):
        value, x = np.log(size[i]), np.log(w[i])
        if abs(value) < REAL:  # rounding: a crossing shows farther on, and a gain of 1 all along has none
            continue
        # an extreme close to 1: the gain may cross it twice between two points
        if i + 1 < w.size and 0.0 < abs(value) < 0.1:
            sign = 1.0 if value > 0.0 else -1.0
            after = np.log(size[i + 1])
            if sign * before >= sign * value and sign * after > sign * value and sign * before > 0.0:
                kind = QUIET if value > 0.0 else LOUD
                top, least = _least(kind, at, x, np.log(w[i + 1]), gain, zeros, poles, reference, 0.0)
                if least < 0.0:
                    value, x = sign * least, top
        if before * value < 0.0 and np.isfinite(before) and np.isfinite(value):
            found.append(np.exp(_zero(GAIN, at, x, before, value, gain, zeros, poles, reference, 0.0)))
        before, at = value, x
    return np.array(found)


@compiled
def phase_crossings(w, parts, floor, gain, zeros, poles, reference, delay):
    """Frequencies where L is real and negative, of at least a size."""
    found = [0.0 for _ in range(0)]
    before, ahead, at = np.nan, True, w[0]
    for i in range(parts.size):
        for k in range(parts[i] + (1 if i == parts.size - 1 else 0)):
            point = w[i] + (w[i + 1] - w[i]) * k / parts[i]
            num, den = _loop(point, gain, zeros, poles, reference, delay)
            product = num * np.conj(den)
            value = product.imag / abs(product)
            if not abs(value) >= REAL:  # rounding of a real L, not a crossing
                continue
            # where L lies near the positive axis on both sides, it crosses that one
            positive = product.real > NEAR_AXIS * abs(product)
            if before * value < 0.0 and not (positive and ahead):
                x = _zero(
                    IMAGINARY, np.log(at), np.log(point), before, value, gain, zeros, poles, reference, delay
                )  # fmt: skip
                num, den = _loop(np.exp(x), gain, zeros, poles, reference, delay)
                crossing = num / den  # the phase also jumps at poles and zeros on the axis
                if crossing.real < 0.0 and max(floor, 1e-300) <= abs(crossing) < 1e9:
                    found.append(np.exp(x))
            before, ahead, at = value, positive, point
    return np.array(found)


@compiled
def peaks(w, parts, refine, gain, zeros, poles, reference, delay):
    """Largest |S| and |T| along the grid and where; refined between its points if asked for."""
    best, where = np.zeros(2), np.full(2, w[0])
    hills = [(0, 0.0, 0.0, 0.0, 0.0) for _ in range(0)]
    height, older = np.zeros((2, 2)), np.zeros(2)  # of the last two points: their values and frequencies
    seen, turned = 0, 0.0
    last = complex(0.0, 0.0)
    for i in range(parts.size):
        for k in range(parts[i] + (1 if i == parts.size - 1 else 0)):
            point = w[i] + (w[i + 1] - w[i]) * k / parts[i]
            num, den = _loop(point, gain, zeros, poles, reference, delay)
            closed = abs(den + num)
            value = num / den
            step = abs(value - last)
            for kind in range(2):
                now = abs(den if kind == 0 else num) / closed
                if now > best[kind]:
                    best[kind], where[kind] = now, point
                if refine and seen > 1 and height[kind, 1] > height[kind, 0] and height[kind, 1] > now:
                    # a maximum between points is out of reach if L cannot come close enough to -1 from there
                    top = 1.0 if kind == 0 else abs(last)
                    closest = abs(1.0 + last) - max(step, turned)
                    if closest * best[kind] <= 1.5 * top:
                        hills.append((kind, older[0], older[1], point, closest / top))
                height[kind, 0], height[kind, 1] = height[kind, 1], now
            older[0], older[1] = older[1], point
            turned, last, seen = step, value, seen + 1
    for kind, a, middle, b, reach in hills:
        if reach * best[kind] <= 1.5:
            x, least = _least(
                SENSITIVITY + kind, np.log(a), np.log(middle), np.log(b), gain, zeros, poles, reference, delay
            )  # fmt: skip
            if -least > best[kind]:
                best[kind], where[kind] = -least, np.exp(x)
    return best, where


@compiled
def _characteristic(w, lean, aside, gain, zeros, poles, reference, delay):
    """D + N e^{-sh} at s = jw - lean w - aside, and whether it is as good as 0."""
    s = complex(-lean * w - aside, w)
    num, den = fraction(s, gain, zeros, poles, reference)
    num *= np.exp(-s * delay)
    value = den + num
    return value, abs(value) <= ON_AXIS * (abs(den) + abs(num))


@compiled
def turns(w, parts, lean, aside, gain, zeros, poles, reference, delay):
    """Turn of the characteristic function from w = 0 on, in rad, and its value at the end; NaN if a root is on it."""
    before, on_it = _characteristic(0.0, lean, aside, gain, zeros, poles, reference, delay)
    total, at = 0.0, 0.0
    ahead = np.empty(70)  # points still to be reached, the nearest last
    for i in range(-1, parts.size):
        for k in range(1, (parts[i] if i >= 0 else 1) + 1):
            ahead[0] = w[0] if i < 0 else w[i] + (w[i + 1] - w[i]) * k / parts[i]
            count = 1
            while count > 0:
                value, near = _characteristic(
                    ahead[count - 1], lean, aside, gain, zeros, poles, reference, delay
                )
                if on_it or near:
                    return np.nan, value
                ratio = value * np.conj(before)
                turn = np.arctan2(ratio.imag, ratio.real)
                if abs(turn) <= TURNED:
                    total, at, before, count = total + turn, ahead[count - 1], value, count - 1
                elif count == 70 or np.isnan(turn):
                    return np.nan, value
                else:
                    ahead[count] = 0.5 * (at + ahead[count - 1])
                    count += 1
    return total, before
