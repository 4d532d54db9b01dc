"""Make limited_optima.json: PI, PID and PIDA with the least IAE under limits of Ms and Mks, to 30 digits.

The loop has no dead time, so that y after a step of the load is a sum of exponentials, and the IAE a sum over the zeros
of y. The controller is (K_-1/s + K_0 + ... + K_m s^m)/(T s + 1)^(m+1). T is unknown, or
given if the search of the library ends at its shortest filter.

Method. At an optimum, the gradient of the IAE by gains and T is a sum of multiplier * (gradient of the slack), one for
each active limit at its peak. Newton's method solves these equations with 60 digits. Poles come from polyroots, slopes
of poles and residues from closed forms.

Checks. The script stops if one fails.
  * Nothing is shared with the program under test: no transform, no search, no grid of frequencies.
  * By make_margins.py, the loop with gains and T rounded to doubles is stable, and its active limits are met to 1e-12.
  * The multipliers are positive, so a relaxed limit reduces the IAE.
  * The IAE agrees with a sum over samples, and its slopes with differences of the IAE.
  * Of 4000 controllers that differ by up to a fifth in each unknown, none that keeps the limits has a smaller IAE.
    A better optimum elsewhere is not excluded. If the program under test found it, the test would fail.
Run: python oracles/make_limited_optima.py
"""

import numpy as np
from make_margins import AxisFunctions, all_margins, unstable_poles
from mpmath import diff, exp, fabs, findroot, matrix, mp, mpc, mpf, nstr, polyroots, polyval
from problems import add, poly, rational, store

DIGITS, PRECISION, FADED = 30, 60, 150  # FADED: exponent at which a response has decayed
AROUND, NEAREST, FARTHEST = 4000, 1e-4, 0.2  # controllers tried; least and largest distance
ROOM, ROUGH = 1e-5, 1e-6  # unused part of a limit; accuracy of the IAE from samples


def slope(p):
    return [(len(p) - 1 - k) * x for k, x in enumerate(p[:-1])] or [mpf(0)]


class Problem:
    """A plant b/a and the order m of its controller. The unknowns are the gains, then T unless it is given."""

    def __init__(self, case):
        self.b, self.a = ([mpf(x) for x in case["process"][k]] for k in ("num", "den"))
        self.order, self.given = case["order"], case["filter_time"]
        self.ms, self.mks = mpf(case["ms"]), mpf(case["mks"])
        self.size = self.order + 2 + (self.given is None)

    def parts(self, x):
        """Return gains, T, the filter q and its slope by T."""
        time = x[self.order + 2] if self.given is None else mpf(self.given)
        lag, n = [time, mpf(1)], self.order + 1
        return x[: self.order + 2], time, poly(*[lag] * n), poly([mpf(n), mpf(0)], *[lag] * (n - 1))

    def controller(self, x, w):
        """Return C at jw, and its slopes by the unknowns."""
        gains, time, q, _ = self.parts(x)
        s = mpc(0, w)
        by_gains = [s ** (k - 1) / polyval(q, s) for k in range(len(gains))]
        value = sum(k * g for k, g in zip(gains, by_gains, strict=True))
        by_time = [] if self.given is not None else [-value * (self.order + 1) * s / (1 + time * s)]
        return value, by_gains + by_time

    def plant(self, w):
        """Return P at jw."""
        return polyval(self.b, mpc(0, w)) / polyval(self.a, mpc(0, w))

    def room(self, x, w, of_noise):
        """Return the slack of a limit at a frequency (negative if it is violated), and its slopes."""
        plant, (c, by_x) = self.plant(w), self.controller(x, w)
        back = 1 + plant * c
        turn = [2 * (back.conjugate() * plant * one).real for one in by_x]
        if not of_noise:
            return self.ms**2 * fabs(back) ** 2 - 1, [self.ms**2 * one for one in turn]
        own = [2 * (c.conjugate() * one).real for one in by_x]
        left = self.mks**2 * fabs(back) ** 2 - fabs(c) ** 2
        return left, [self.mks**2 * one - two for one, two in zip(turn, own, strict=True)]

    def transform(self, x):
        """Return the numerator and denominator of y after a step of the load, and their slopes by the unknowns."""
        gains, _, q, by_time = self.parts(x)
        num, s = poly(self.b, q), [mpf(1), mpf(0)]
        den = add(poly(self.a, s, q), poly(self.b, list(reversed(gains))))
        slopes = [([mpf(0)], poly(self.b, *[s] * k)) for k in range(len(gains))]
        if self.given is None:
            slopes.append((poly(self.b, by_time), poly(self.a, s, by_time)))
        return num, den, slopes

    def iae(self, x):
        """Return the IAE and its slopes."""
        num, den, slopes = self.transform(x)
        poles = polyroots(den, maxsteps=1000, extraprec=4 * mp.prec)
        assert all(p.real < 0 for p in poles)
        first = slope(den)
        size = [polyval(num, p) / polyval(first, p) for p in poles]
        areas = [r / p for r, p in zip(size, poles, strict=True)]
        moves = []  # slopes of poles and areas by the unknowns
        for by_num, by_den in slopes:
            way = [-polyval(by_den, p) / polyval(first, p) for p in poles]
            other = []
            for p, r, v in zip(poles, size, way, strict=True):
                up = polyval(by_num, p) + polyval(slope(num), p) * v
                down = polyval(slope(by_den), p) + polyval(slope(first), p) * v
                other.append(((up - r * down) / polyval(first, p) - r / p * v) / p)
            moves.append((way, other))
        ends = [mpf(0), *zeros(poles, size)]
        value, by_x, sign = mpf(0), [mpf(0)] * self.size, 0
        for i, t in enumerate(ends):  # the interval from one zero to the next
            waves = [exp(p * t) for p in poles]
            area = sum(k * e for k, e in zip(areas, waves, strict=True)).real
            after = sum(
                r * e for r, e in zip(size, (exp(p * middle(ends, i)) for p in poles), strict=True)
            ).real
            new = 1 if after > 0 else -1
            value += (sign - new) * area
            for k, (way, other) in enumerate(moves):
                step = sum(
                    (u + a * v * t) * e for u, a, v, e in zip(other, areas, way, waves, strict=True)
                ).real
                by_x[k] += (sign - new) * step
            sign = new
        return value, by_x


def middle(ends, i):
    """Return a time between a zero and the next."""
    return (ends[i] + ends[i + 1]) / 2 if i + 1 < len(ends) else ends[i] + mpf("1e-3")


def zeros(poles, size):
    """Return the zeros of a sum of exponentials after 0, until it has decayed."""
    slowest = max(p.real for p in poles)
    p, r = np.array([complex(x) for x in poles]), np.array([complex(x) for x in size])
    t = np.linspace(0.0, FADED / -float(slowest), 40_001)[1:]
    y = np.real(np.exp(np.outer(t, p - float(slowest))) @ r)  # without the slowest decay
    found = []
    for i in np.flatnonzero(np.sign(y[1:]) != np.sign(y[:-1])):
        z = mpf(t[i] + (t[i + 1] - t[i]) * y[i] / (y[i] - y[i + 1]))
        for _ in range(8):
            waves = [a * exp(b * z) for a, b in zip(size, poles, strict=True)]
            z -= sum(waves).real / sum(b * e for b, e in zip(poles, waves, strict=True)).real
        assert t[i] <= z <= t[i + 1]
        found.append(z)
    return found


def optimum(problem, start, peaks):
    """Return unknowns, frequencies and multipliers that solve the equations."""
    n, count = problem.size, len(peaks)

    def split(v):
        v = [*v]
        return v[:n], v[n : n + count], v[n + count :]

    def equations(*v):
        x, frequencies, multipliers = split(v)
        slopes = problem.iae(x)[1]
        rooms = [problem.room(x, w, noise) for w, (_, noise) in zip(frequencies, peaks, strict=True)]
        for multiplier, (_, by_x) in zip(multipliers, rooms, strict=True):
            slopes = [a - multiplier * b for a, b in zip(slopes, by_x, strict=True)]
        flat = [
            diff(lambda w, noise=noise: problem.room(x, w, noise)[0], at)
            for at, (_, noise) in zip(frequencies, peaks, strict=True)
        ]
        return [*slopes, *(room for room, _ in rooms), *flat]

    # multipliers that fit the start
    x = [mpf(v) for v in start]
    sides = matrix([problem.room(x, mpf(w), noise)[1] for w, noise in peaks]).T
    weights = mp.lu_solve(sides, matrix(problem.iae(x)[1]))
    first = [*x, *(mpf(w) for w, _ in peaks), *weights]
    return split(findroot(equations, first, tol=mpf(10) ** -90, maxsteps=40))


def check(problem, x, value, slopes):
    """Check the IAE by another method, its slopes by differences, and that no controller nearby is better."""
    found = rough(problem, [float(v) for v in x])
    assert abs(found / float(value) - 1) < ROUGH, (found, float(value))
    for k in range(problem.size):
        step = x[k] * mpf(10) ** -15
        moved = [[*x[:k], x[k] + way * step, *x[k + 1 :]] for way in (1, -1)]
        differences = (problem.iae(moved[0])[0] - problem.iae(moved[1])[0]) / (2 * step)
        assert fabs(differences - slopes[k]) < mpf(10) ** -20 * max(fabs(s) for s in slopes)
    chance, kept = np.random.default_rng(1), 0
    w = np.geomspace(1e-2, 1e3, 12_001)  # a peak between two of them is higher by less than ROOM
    for _ in range(AROUND):
        far = 10 ** chance.uniform(np.log10(NEAREST), np.log10(FARTHEST))
        other = [
            float(v) * (1 + far * u) for v, u in zip(x, chance.uniform(-1, 1, problem.size), strict=True)
        ]
        if keeps(problem, other, w):
            kept += 1
            assert rough(problem, other) > float(value) * (1 - ROUGH), other
    assert kept > 100, kept
    return kept


def doubles(problem, x):
    num, den, _ = problem.transform([mpf(v) for v in x])
    return np.array([float(v) for v in num]), np.array([float(v) for v in den])


def rough(problem, x):
    """Return the IAE by samples."""
    num, den = doubles(problem, x)
    poles = np.roots(den)
    if poles.real.max() >= 0:
        return np.inf
    size = np.polyval(num, poles) / np.polyval(np.polyder(den), poles)
    t = np.linspace(0.0, 20 / -poles.real.max(), 100_001)
    y = np.abs(np.real(np.exp(np.outer(t, poles)) @ size))
    return float(np.sum((y[1:] + y[:-1]) / 2) * t[1])


def keeps(problem, x, w):
    """Return True if a controller keeps the limits at many frequencies, and is stable."""
    gains, time, *_ = problem.parts([mpf(v) for v in x])
    s = 1j * w
    c = np.polyval([float(k) for k in reversed(gains)], s) / s / (float(time) * s + 1) ** (problem.order + 1)
    plant = np.polyval([float(v) for v in problem.b], s) / np.polyval([float(v) for v in problem.a], s)
    back = np.abs(1 + plant * c)
    highest = float(problem.mks) * (1 - ROOM)
    if (back * float(problem.ms)).min() < 1 + ROOM or (np.abs(c) / back).max() > highest:
        return False
    return np.roots(doubles(problem, x)[1]).real.max() < 0


def solve(case):
    mp.dps = PRECISION
    problem = Problem(case)
    begin = case.pop("start")
    start = begin["gains"] + ([begin["time"]] if problem.given is None else [])
    *by_ms, by_mks = begin["frequencies"]
    peaks = [*((w, False) for w in by_ms), (by_mks, True)]
    x, frequencies, multipliers = optimum(problem, start, peaks)
    assert all(m > 0 for m in multipliers), multipliers
    value, slopes = problem.iae(x)
    kept = check(problem, x, value, slopes)
    gains, time, q, _ = problem.parts(x)
    block = rational([float(k) for k in reversed(gains)], [float(v) for v in poly(q, [mpf(1), mpf(0)])])
    f = AxisFunctions({"process": case["process"], "controller": block, "output_filter": None, "delay": 0.0})
    assert unstable_poles(f) == 0
    margins = all_margins(f)
    assert not by_ms or fabs(margins["ms"] / problem.ms - 1) < 1e-12
    assert margins["ms"] < problem.ms * (1 + mpf(10) ** -12)
    assert fabs(margins["mks"] / problem.mks - 1) < 1e-12
    line = f"{case['name']:16s}IAE = {nstr(value, 15)}, better than {kept} around it"
    values = {
        "iae": nstr(value, DIGITS),
        "gains": [nstr(k, DIGITS) for k in gains],
        "time": nstr(time, DIGITS),
    }
    values |= {"frequencies": [nstr(w, DIGITS) for w in frequencies]}
    return case | {"values": values}, line


if __name__ == "__main__":
    store(__file__, DIGITS, solve)
