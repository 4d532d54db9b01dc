"""Make delayed_optima.json: PID and PIDA with the least IAE of plants with dead time, under limits of Ms and Mks.

The loop is that of make_limited_optima.py with a dead time L. Its response to a step of the load is not a finite sum of
exponentials, so the IAE comes from a method of steps in double precision.

Method. At an optimum, the gradient of the IAE by gains and filter time T is a sum of multiplier * (gradient of the
slack), one for each active limit at its peak. Newton's method solves these equations.
  * On each fraction of L, y and its slopes are power series, driven by the series of u one dead time before. With the
    closed loop G from load to y and the denominator q of the filter, the slope of Y = G/s by K_k is -s^k/q G Y. G Y is
    the response of the same loop to y as its load.
  * The IAE and its slopes are integrals of these series from zero to zero of y, until the response has decayed.
  * Limits and their slopes are those of make_limited_optima.py, in high precision.

Checks. The script stops if one fails.
  * Nothing is shared with the program under test: no transform, no search, no grid of frequencies, no exponential.
  * Half the step changes no value by more than 1e-10.
  * y agrees with the finite delay series of make_delay_loops.py at some times, and its integral is 1/K_-1.
  * The slopes of the IAE agree with differences of the IAE.
  * By make_margins.py, the loop with gains and T rounded to doubles is stable, and its Ms and Mks are the limits to
    1e-9.
  * The multipliers are positive, so a relaxed limit reduces the IAE. `prices` is -d ln(IAE)/d ln(limit).
  * Of 1000 controllers that differ by up to a fifth in each unknown, none that keeps the limits has a smaller IAE.
    A better optimum elsewhere is not excluded.
Run: python oracles/make_delayed_optima.py
"""

import math
from itertools import pairwise

import numpy as np
from delay_loop_series import reference
from make_limited_optima import Problem
from make_margins import AxisFunctions, all_margins, unstable_poles
from mpmath import diff, exp, fabs, mp, mpc, mpf
from numpy.polynomial.polynomial import polyint, polyval
from problems import poly, rational, store
from scipy.optimize import brentq

DIGITS, PRECISION = 10, 60
SHARE, TERMS = 6.0, 44  # largest step divided by the filter time, and number of terms of a series
LONGEST, FADED = 400.0, 1e-13  # longest time; a response has decayed below this share of its peak
AGREE, ROUGH = 1e-10, 1e-6  # agreement of all values with half the step, and of slopes with differences
AROUND, NEAREST, FARTHEST, ROOM = 1000, 1e-4, 0.2, 1e-5


class Late(Problem):
    """Plant with dead time, with its response by a method of steps."""

    def __init__(self, case):
        super().__init__(case)
        self.delay = float(case["delay"])
        num, den = (np.array(case["process"][k]) for k in ("num", "den"))
        self.num, self.den = np.append(np.zeros(den.size - num.size), num) / den[0], den / den[0]
        assert self.num[0] == 0

    def plant(self, w):
        return super().plant(w) * exp(-mpf(self.delay) * mpc(0, w))

    def system(self, x):
        """Return A, B, W and the output matrix of v' = A v + B w(t - L), w = W v + (load, 0).

        v holds the states of the loop, and of the same loop with y as its load. The outputs are y and its slopes by the
        unknowns.
        """
        gains, time, m = np.array(x[:-1]), x[-1], self.order
        n = self.den.size - 1
        size = n + m + 2
        plant, actions = np.zeros((size, size)), np.zeros((m + 2, size))
        plant[0, :n], plant[range(1, n), range(n - 1)] = -self.den[1:], 1.0
        y = np.append(self.num[1:], np.zeros(m + 2))
        plant[n + 1] = -y / time  # the first lag takes -y, the others the lag before, the integrator the last
        for j in range(m + 1):
            plant[n + 1 + j, n + 1 + j] = -1 / time
            plant[n + 1 + j, n + j] += 1 / time if j else 0.0
        plant[n, -1] = 1.0
        row = np.eye(m + 2)[-1]
        actions[0, n], actions[1, n:] = 1.0, row
        for k in range(2, m + 2):  # s times the output of a lag is (input - output)/T
            row = (np.append(row[1:], 0.0) - row) / time
            actions[k, n:] = row
        u = gains @ actions
        zero, none = np.zeros((size, size)), np.zeros((1, size))
        a = np.block(
            [[plant, zero, none.T], [zero, plant, none.T], [none, u / time, -np.ones((1, 1)) / time]]
        )
        b = np.zeros((2 * size + 1, 2))
        b[0, 0] = b[size, 1] = 1.0
        w = np.block([[u, none, 0.0], [y, u, 0.0]])
        by_time = np.append((m + 1) / time * np.append(none, -u), (m + 1) / time)
        out = np.vstack(
            [np.append(y, np.zeros(size + 1)), *(np.append(np.append(none, r), 0.0) for r in actions)]
        )
        return a, b, w, np.vstack([out, by_time])

    def pieces(self, x, share=SHARE):
        """Return the step h, and for each step the series of the outputs in powers of (time in the step)/h."""
        a, b, w, out = self.system(x)
        each = math.ceil(self.delay / (share * x[-1]))  # steps in a dead time
        h = self.delay / each
        now, late = np.zeros((TERMS, len(a), len(a))), np.zeros((TERMS, len(a), TERMS, 2))
        now[0] = np.eye(len(a))
        for j in range(TERMS - 1):
            now[j + 1] = h / (j + 1) * a @ now[j]
            late[j + 1] = h / (j + 1) * np.einsum("nm,mip->nip", a, late[j])
            late[j + 1, :, j] += h / (j + 1) * b
        late = late.reshape(TERMS, len(a), -1)
        state, past, found, top = np.zeros(len(a)), [], [], 0.0
        for k in range(int(LONGEST / h)):
            delayed = past[k - each] if k >= each else np.zeros((TERMS, 2))
            series = now @ state + late @ delayed.ravel()
            signal = series @ w.T
            signal[0, 0] += 1.0
            past.append(signal)
            found.append(series @ out.T)
            state = series.sum(axis=0)
            top = np.maximum(top, np.abs(found[-1][0]))
            if k > 4 * each and all((np.abs(one[0]) < FADED * top).all() for one in found[-2 * each :]):
                return h, found
        return h, None

    def iae(self, x, share=SHARE):
        """Return IAE, its slopes, and the integral of y."""
        h, found = self.pieces([float(v) for v in x], share)
        if found is None:
            return math.inf, None, None
        total, whole = np.zeros(self.size + 1), 0.0
        places = np.linspace(0.0, 1.0, 5)
        for series in found:
            y, areas = series[:, 0], polyint(series)
            whole += h * areas[:, 0].sum()
            values = polyval(places, y)
            ends = [0.0]
            for i in np.flatnonzero(values[1:] * values[:-1] < 0):
                ends.append(brentq(polyval, places[i], places[i + 1], args=(y,), xtol=1e-15))
            ends.append(1.0)
            for low, high in pairwise(ends):
                sign = np.sign(polyval(0.5 * (low + high), y))
                total += sign * h * (polyval(high, areas) - polyval(low, areas))
        return total[0], total[1:], whole


class Equations:
    """Optimality conditions, for unknowns, frequencies of the peaks and multipliers in one vector."""

    def __init__(self, problem, peaks):
        self.problem, self.peaks, self.size = problem, peaks, problem.size

    def rooms(self, x, frequencies):
        """Yield the slack of each limit at its peak, and its slopes by the unknowns and by the frequency."""
        x = [mpf(v) for v in x]
        for w, (_, noise) in zip(frequencies, self.peaks, strict=True):
            left, by_x = self.problem.room(x, mpf(w), noise)
            flat = diff(lambda at, noise=noise: self.problem.room(x, at, noise)[0], mpf(w))
            yield float(left), [float(s) for s in by_x], float(flat)

    def start(self, x):
        """Return the vector, with multipliers fitted by least squares."""
        x, frequencies = np.array(x), [w for w, _ in self.peaks]
        sides = np.array([by_x for _, by_x, _ in self.rooms(x, frequencies)])
        weights = np.linalg.lstsq(sides.T * x[:, None], self.problem.iae(x)[1] * x, rcond=None)[0]
        return np.concatenate([x, frequencies, weights])

    def __call__(self, v, share):
        x, frequencies, multipliers = self.split(v)
        left, sides, flat = (np.array(one) for one in zip(*self.rooms(x, frequencies), strict=True))
        return np.concatenate([(self.problem.iae(x, share)[1] - multipliers @ sides) * x, left, flat])

    def split(self, v):
        """Return unknowns, frequencies and multipliers."""
        return np.split(v, [self.size, self.size + len(self.peaks)])

    def slopes(self, v):
        """Return the slopes at the start by differences. They are accurate enough for all steps."""
        here, steps = self(v, SHARE), 1e-6 * np.abs(v)
        return np.array([(self(v + s, SHARE) - here) / s[i] for i, s in enumerate(np.diag(steps))]).T

    def solve(self, v, slopes, share):
        """Iterate until the values do not change."""
        for _ in range(20):
            move = np.linalg.solve(slopes, self(v, share))
            v = v - move
            if np.max(np.abs(move / v)) < 0.1 * AGREE:
                return v
        raise ArithmeticError(f"Newton's method does not end: {np.max(np.abs(move / v)):.1e}")


def block_of(problem, x):
    """Return the controller as a quotient."""
    lag = [[float(x[-1]), 1.0]] * (problem.order + 1)
    return rational([float(k) for k in reversed(x[:-1])], poly([1.0, 0.0], *lag))


def check(problem, case, x, value, slopes, whole):
    """Check response and slopes by other methods, and that no controller nearby is better."""
    assert abs(whole * x[0] - 1) < AGREE, whole * x[0]
    for k in range(problem.size):
        step = 1e-5 * x[k] * np.eye(problem.size)[k]
        differences = (problem.iae(x + step)[0] - problem.iae(x - step)[0]) / (2 * step[k])
        assert abs(differences - slopes[k]) * x[k] < ROUGH * value, (k, differences, slopes[k])
    h, found = problem.pieces(x)
    picked = [round(t * problem.delay / h) for t in (1.5, 2.25, 4.0, 7.5, 12.0)]
    other = {"name": case["name"], "process": case["process"], "controller": block_of(problem, x)}
    other |= {
        "output_filter": None,
        "prefilter": None,
        "delay": problem.delay,
        "times": [h * k for k in picked],
    }
    series = reference(other, 12)[0]["load.y"]
    assert max(abs(found[k][0, 0] - float(y)) for k, y in zip(picked, series, strict=True)) < AGREE
    chance, kept = np.random.default_rng(1), 0
    w = np.geomspace(1e-2, 1e3, 20_001)  # a peak between two of them is higher by less than ROOM
    for _ in range(AROUND):
        far = 10 ** chance.uniform(np.log10(NEAREST), np.log10(FARTHEST))
        near = x * (1 + far * chance.uniform(-1, 1, problem.size))
        if keeps(problem, near, w):
            kept += 1
            assert problem.iae(near)[0] > value * (1 - ROUGH), near
    assert kept > 30, kept
    return kept


def keeps(problem, x, w):
    """Return True if a controller keeps the limits at many frequencies."""
    s = 1j * w
    c = np.polyval(x[-2::-1], s) / s / (x[-1] * s + 1) ** (problem.order + 1)
    plant = np.polyval(problem.num, s) / np.polyval(problem.den, s) * np.exp(-s * problem.delay)
    back = np.abs(1 + plant * c)
    ms, mks = float(problem.ms), float(problem.mks)
    return (back * ms).min() > 1 + ROOM and (np.abs(c) / back).max() < mks * (1 - ROOM)


def solve(case):
    mp.dps = PRECISION
    problem = Late(case)
    begin = case.pop("start")
    *by_ms, by_mks = begin["frequencies"]
    peaks = [*((w, False) for w in by_ms), (by_mks, True)]
    equations = Equations(problem, peaks)
    v = equations.start([*begin["gains"], begin["time"]])
    slopes = equations.slopes(v)
    first = equations.solve(v, slopes, SHARE)
    second = equations.solve(first, slopes, 0.5 * SHARE)
    x, frequencies, multipliers = equations.split(second)
    value, slopes, whole = problem.iae(x, 0.5 * SHARE)
    gap = max(np.max(np.abs(first / second - 1)), abs(problem.iae(x)[0] / value - 1))
    assert gap < AGREE, gap
    assert (multipliers > 0).all(), multipliers
    kept = check(problem, case, x, value, slopes, whole)
    f = AxisFunctions(
        {"process": case["process"], "controller": block_of(problem, x), "output_filter": None}
        | {"delay": problem.delay}
    )
    assert unstable_poles(f) == 0
    margins = all_margins(f)
    assert fabs(margins["ms"] / problem.ms - 1) < 1e-9
    assert fabs(margins["mks"] / problem.mks - 1) < 1e-9
    line = (
        f"{case['name']:16s}IAE = {value:.12g}, half the step differs {gap:.1e}, better than {kept} around it"
    )
    # d(slack) = 2 d ln(limit), times |C|^2 for the limit of noise
    loud = [problem.controller([mpf(k) for k in x], mpf(w))[0] if noise else 1 for w, noise in peaks]
    room = np.array([float(2 * fabs(c) ** 2) for c in loud])
    prices = multipliers * room / value
    shown = {"iae": value, "gains": x[:-1], "time": x[-1], "frequencies": frequencies, "prices": prices}
    values = {key: text(found) for key, found in shown.items()}
    return case | {"values": values}, line


def text(value):
    """Return a number, or each of several, as text with the certain digits."""
    return [text(v) for v in value] if np.ndim(value) else f"{value:.{DIGITS}g}"


if __name__ == "__main__":
    store(__file__, DIGITS, solve)
