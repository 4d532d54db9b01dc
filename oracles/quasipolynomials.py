"""Functions a(w) + b(w) cos(w L) + c(w) sin(w L) with polynomials a, b, c, and all of their zeros.

Polynomials are lists of exact fractions in ascending powers, so nothing is rounded before a function is evaluated.
``Quasi.zeros_between`` proves that no zero is missed.
"""

from fractions import Fraction

from mpmath import cos, fabs, mpf, sin
from problems import poly

TERMS = 40  # terms of the power series at 0 beyond the degree of the polynomials


def exact(polynomial):
    """Convert floats in descending powers to fractions in ascending powers."""
    return [Fraction(x) for x in reversed(polynomial)]


def add(*polynomials):
    return [
        sum((p[k] for p in polynomials if k < len(p)), Fraction(0)) for k in range(max(map(len, polynomials)))
    ]


def scaled(p, factor):
    return [factor * x for x in p]


def slope(p):
    return [k * x for k, x in enumerate(p)][1:] or [Fraction(0)]


def on_axis(p):
    """Return the real and imaginary part of p(jw)."""
    signs = (1, 1, -1, -1)
    real = [x * signs[k % 4] if k % 2 == 0 else Fraction(0) for k, x in enumerate(p)]
    imaginary = [x * signs[k % 4] if k % 2 else Fraction(0) for k, x in enumerate(p)]
    return real, imaginary


def squared(p):
    """Return |p(jw)|^2."""
    real, imaginary = on_axis(p)
    return add(poly(real, real), poly(imaginary, imaginary))


def fraction(x):
    """Return a number in high precision as a fraction."""
    sign, mantissa, power, _ = mpf(x)._mpf_
    return (-1) ** sign * Fraction(int(mantissa)) * Fraction(2) ** power


def number(x):
    return mpf(x.numerator) / x.denominator if isinstance(x, Fraction) else mpf(x)


def shifted(p, at):
    """Return the coefficients of p(at + x)."""
    out = [number(x) for x in p]
    for i in range(len(out)):
        for k in range(len(out) - 2, i - 1, -1):
            out[k] += at * out[k + 1]
    return out


def positive_beyond(p, start):
    """Return True if all coefficients of p(start + x) are positive, which proves p(w) > 0 for all w >= start."""
    p = list(p)
    while p and p[-1] == 0:
        p.pop()
    coefficients = shifted(p, mpf(start))
    largest = max(map(fabs, coefficients), default=mpf(0))
    return bool(p) and coefficients[0] > 0 and all(x > -(mpf(10) ** -60) * largest for x in coefficients)


class Quasi:
    """A function a(w) + b(w) cos(w L) + c(w) sin(w L)."""

    def __init__(self, a, b=(), c=(), delay=0):
        zero = [Fraction(0)]
        self.a, self.b, self.c, self.delay = (
            list(a) or zero,
            list(b) or zero,
            list(c) or zero,
            Fraction(delay),
        )
        self._numbers = [[number(x) for x in p] for p in (self.a, self.b, self.c)]

    @classmethod
    def of_numbers(cls, p):
        """Return an exact polynomial from ascending coefficients in high precision."""
        return cls([fraction(x) for x in p])

    def _with(self, work):
        return Quasi(work(self.a), work(self.b), work(self.c), self.delay)

    def __add__(self, other):
        assert self.delay == other.delay
        return Quasi(add(self.a, other.a), add(self.b, other.b), add(self.c, other.c), self.delay)

    def __mul__(self, polynomial):
        return self._with(lambda p: poly(p, polynomial))

    def slope(self):
        return Quasi(
            slope(self.a),
            add(slope(self.b), scaled(self.c, self.delay)),
            add(slope(self.c), scaled(self.b, -self.delay)),
            self.delay,
        )

    def over(self, den):
        """Return the numerator of the slope of this function divided by a polynomial."""
        return self.slope() * den + self * scaled(slope(den), -1)

    def under(self, num):
        """Return the numerator of the slope of a polynomial divided by this function."""
        return self * slope(num) + self.slope() * scaled(num, -1)

    def __call__(self, w):
        angle = w * number(self.delay)
        total = mpf(0)
        for p, factor in zip(self._numbers, (1, cos(angle), sin(angle)), strict=True):
            value = mpf(0)
            for x in reversed(p):
                value = value * w + x
            total += value * factor
        return total

    def bound(self, center, radius):
        """Return an upper bound of the magnitude for |w - center| <= radius."""
        total = mpf(0)
        for p in self._numbers:
            if any(p):
                power = mpf(1)
                for x in shifted(p, center):
                    total += fabs(x) * power
                    power *= radius
        return total

    def _terms(self):
        return TERMS + max(map(len, (self.a, self.b, self.c)))

    def series(self):
        """Return the power series at 0, exact."""
        out = self.a
        for p, odd in ((self.b, 0), (self.c, 1)):
            term, trigonometric = Fraction(1), []
            for k in range(self._terms()):
                trigonometric.append(term * (-1) ** (k // 2) if k % 2 == odd else Fraction(0))
                term *= self.delay / (k + 1)
            out = add(out, poly(p, trigonometric)[: self._terms()])
        return out

    def leading(self):
        """Return order and coefficient of the first term of the power series."""
        return next((k, x) for k, x in enumerate(self.series()) if x)

    def lowest(self):
        """Return a w below which only 0 can be a zero, since the first term of the series exceeds the sum of the
        others."""
        order, first = self.leading()
        series, w = self.series(), Fraction(1)
        while True:
            w /= 10
            rest = sum(abs(x) * w ** (k - order) for k, x in enumerate(series) if k > order)
            beyond = sum(abs(x) * w**k for p in (self.b, self.c) for k, x in enumerate(p))
            left_out = 2 * beyond * (self.delay * w) ** TERMS / w**order
            if 2 * self.delay * w < 1 and abs(first) > 2 * (rest + left_out):
                return number(w) * mpf("0.917")  # intervals do not end at round numbers, where zeros may lie

    def zeros(self, end):
        """Return all zeros between 0 and end, both excluded."""
        low, end, found = self.lowest(), mpf(end), []
        while low < end:
            found += self.zeros_between(low, min(2 * low, end))
            low *= 2
        return found

    def zeros_between(self, low, high):
        """Return all zeros between two numbers, which must not be zeros.

        An interval of centre m and radius r has no zero if |f(m)| > r |f'(m)| + r^2/2 max|f''|. It has at most one if
        |f'(m)| > r max|f''|, and the signs at the ends decide. Otherwise the interval is halved.
        """
        first, second = self.slope(), self.slope().slope()
        todo, found = [(low, high)], []
        while todo:
            a, b = todo.pop()
            m, r = (a + b) / 2, (b - a) / 2
            if r < mpf(10) ** -25 * high:
                raise ArithmeticError(f"zeros too close to tell at {m}")
            value, rate, most = self(m), first(m), second.bound(m, r)
            if fabs(value) > 1.001 * (r * fabs(rate) + r * r / 2 * most):
                continue
            if fabs(rate) > 1.001 * r * most:
                at_a, at_b = self(a), self(b)
                if at_a == 0 or at_b == 0:
                    raise ArithmeticError(f"a zero where two intervals meet, {a} or {b}")
                if (at_a > 0) != (at_b > 0):
                    found.append(self._between(a, b, at_a > 0, first))
                continue
            todo += [(a, m), (m, b)]
        return sorted(found)

    def _between(self, a, b, falls, first):
        """Return the zero of a monotonic function, by Newton's method, or by bisection if a step leaves the bracket."""
        w = (a + b) / 2
        for _ in range(400):
            value = self(w)
            if (value > 0) == falls:
                a = w
            else:
                b = w
            new = w - value / first(w)
            new = new if a < new < b else (a + b) / 2
            if fabs(new - w) < mpf(10) ** -70 * w:
                return new
            w = new
        raise ArithmeticError(f"no convergence between {a} and {b}")
