"""Two inversions of the finite delay series of make_delay_loops.py.

``on_circles`` integrates around the poles, ``by_talbot`` along fixed Talbot contours. Both return {signal: values}.
They share only the evaluation of the rational functions.
"""

import math
from fractions import Fraction
from functools import cache
from itertools import pairwise

import numpy as np
from mpmath import exp, mp, mpc, mpf, nstr, workdps

ENVELOPE_DIGITS = 25  # the envelope is stored as floats
SIGNALS = ("setpoint.y", "setpoint.u", "load.y", "load.u", "noise.y", "noise.u")
BLOCKS = ("process", "controller", "output_filter", "prefilter")


def coefficients(case, number=float):
    """Return [(num, den)] of G, C, F, Fr; an absent block is 1."""
    one = {"num": [1.0], "den": [1.0]}
    blocks = (case[name] or one for name in BLOCKS)
    return [([number(x) for x in b["num"]], [number(x) for x in b["den"]]) for b in blocks]


def horner(p, s):
    v = mpf(0)
    for c in p:
        v = v * s + c
    return v


def at(blocks, s):
    """Return G, C F, Fr at s (None: at infinity)."""
    if s is None:
        v = [n[0] / d[0] if len(n) == len(d) else mpf(0) for n, d in blocks]
        return v[0], v[1] * v[2], v[3]
    g, c, f, fr = (horner(num, s) / horner(den, s) for num, den in blocks)
    return g, c * f, fr


def six(g, cf, fr, q, now, late):
    """Return the six transforms times s; ``now`` and ``late`` stand for S and e^{-Ls} S."""
    ql = q * late
    return fr * ql, fr * cf * now, g * late, -ql, -ql, -cf * now


def last_term(t, delay):
    """Return the largest k with k L <= t, in exact arithmetic."""
    return math.floor(Fraction(t) / Fraction(delay)) if delay else 0


def clusters(case):
    """Return the poles of the terms as groups of increasing magnitude, each far from the next."""
    blocks = coefficients(case)
    poles = [0j] + [p for _, den in blocks for p in np.roots(den)]
    if not case["delay"]:  # without dead time, the closed loop is rational
        num, den = np.ones(1), np.ones(1)
        for n, d in blocks[:3]:
            num, den = np.polymul(num, n), np.polymul(den, d)
        poles = [0j, *np.roots(np.polyadd(num, den)), *np.roots(blocks[3][1])]
    poles = sorted(poles, key=abs)
    groups = [[poles[0]]]
    for p in poles[1:]:
        far = abs(p) > 50 * (abs(groups[-1][-1]) + 1)
        groups.append([p]) if far else groups[-1].append(p)
    return [np.array(g) for g in groups]


def peak(case, center, radius):
    """Estimate the largest log of |term * e^{st}| on the circle."""
    s = center + radius * np.exp(1j * np.pi * (np.arange(400) + 0.5) / 400)
    q = np.prod([np.polyval(n, s) / np.polyval(d, s) for n, d in coefficients(case)[:3]], axis=0)
    size, delay = np.log(np.abs(q)), case["delay"]
    ends = {(k, t - k * delay) for t in case["times"] for k in (0, last_term(t, delay))}
    return max(0.0, max((k * size + s.real * tau).max() for k, tau in ends))


def circles(case, digits):
    """Return the circles (centre, radius), a first number of nodes, and log10 of the largest integrand.

    The error of the trapezoidal rule is the integrand on a smaller or larger circle, times ratio_of_radii^points. Of a
    list of radii, the radius that needs fewest points is taken.
    """
    spans = []
    for group in clusters(case):
        center = (group.real.max() + group.real.min()) / 2
        spans.append((center, abs(group - center).max()))
    (center, extent), *rest = spans
    far = [(c, (abs(c) + e) / 2) for c, e in rest]  # halfway from the poles to the origin
    limit = min(((abs(c) - e) / 3 for c, e in rest), default=math.inf) - abs(center)
    radii = extent + 0.05 * 1.3 ** np.arange(40)
    radii = radii[radii < limit]
    goal = (digits + 10) * math.log(10)
    logs = np.array([peak(case, center, r) for r in radii])
    best = (math.inf,)
    for r, log in zip(radii[1:-1], logs[1:-1], strict=True):
        points = [(logs[m] + goal) / abs(np.log(radii[m] / r)) for m in (radii < r, radii > r)]
        best = min(best, (max(p.min() for p in points) / 2, log, r))
    nodes, log, radius = best
    log = max([log] + [peak(case, *circle) for circle in far])
    return [(center, radius), *far], int(nodes) + 30, log / math.log(10)


def on_circles(case, times, places, nodes):
    """Return {signal: values at times} by the trapezoidal rule with 2 * nodes points per circle."""
    blocks = coefficients(case, mpf)
    delay = mpf(case["delay"])
    last = [last_term(t, case["delay"]) for t in times]
    gaps = [mpf(b) - mpf(a) for a, b in pairwise([0.0, *times])]  # exact
    total = [[mpf(0)] * 6 for _ in times]
    for center, radius in places:
        for j in range(nodes):  # upper half circle; the lower half is the conjugate
            step = mpf(radius) * mp.expjpi((mpf(j) + 0.5) / nodes)
            s = mpf(center) + step
            g, cf, fr = at(blocks, s)
            q, lag, weight = cf * g, exp(-delay * s), step / (s * nodes)
            if delay:
                partial, x = [mpc(0), mpc(1)], -q * lag  # partial[k] = sum of k terms
                while len(partial) < max(last) + 2:
                    partial.append(partial[-1] * x + 1)
            over = {gap: exp(gap * s) for gap in {*gaps}}  # dense times have few different gaps
            e = weight
            for i, gap in enumerate(gaps):
                e *= over[gap]
                if delay:
                    now, late = e * partial[last[i] + 1], e * lag * partial[last[i]]
                else:
                    now = late = e / (1 + q)
                for m, value in enumerate(six(g, cf, fr, q, now, late)):
                    total[i][m] += value.real
    return {name: [row[m] for row in total] for m, name in enumerate(SIGNALS)}


def by_talbot(case, times, degree):
    """Return the same values by fixed Talbot inversion (Abate and Valko 2004), term by term."""
    blocks = coefficients(case, mpf)
    delay = mpf(case["delay"])
    rows = []
    for t in times:
        row = [mpf(0)] * 6
        for k in range(last_term(t, case["delay"]) + 1):
            tau = mpf(t) - k * delay
            for s, weight in talbot_nodes(tau, degree):
                g, cf, fr = at(blocks, s)
                q = cf * g
                if delay:
                    now, late = (-q) ** k, (-q) ** (k - 1) if k else 0
                else:
                    now = late = 1 / (1 + q)
                for m, value in enumerate(six(g, cf, fr, q, now, late)):
                    row[m] += mp.re(weight * value)
        rows.append(row)
    return {name: [row[m] for row in rows] for m, name in enumerate(SIGNALS)}


def talbot_nodes(tau, degree):
    """Return (s, weight) such that f(tau) = sum of Re(weight * s F(s)); s = None is infinity."""
    return [(z / tau, weight) for z, weight in talbot_contour(degree, mp.prec)] if tau else [(None, mpf(1))]


@cache
def talbot_contour(degree, precision):
    """Return (tau s, weight), which do not depend on tau. `precision` only separates entries of the cache."""
    r = mpf(2 * degree) / 5
    nodes = [(r, exp(r) / (2 * degree))]
    for j in range(1, degree):
        a = j * mp.pi / degree
        cot = mp.cot(a)
        z = r * a * mpc(cot, 1)
        sigma = a + (a * cot - 1) * cot
        nodes.append((z, exp(z) * mpc(1, sigma) * r / (degree * z)))
    return nodes


# --- checked values, for every oracle of loops with dead time ---


def difference(a, b):
    """Return the largest |a - b| / max(1, |b|) over all signals and times."""
    return max(abs(x - y) / max(1, abs(y)) for n in b for x, y in zip(a[n], b[n], strict=True))


def respond(case, times, digits):
    """Return the values at times, their change by the last doubling of the nodes, and the number of nodes."""
    places, nodes, size = circles(case, digits)
    precision, agree = int(size) + digits + 35, mpf(10) ** -(digits + 7)
    with workdps(precision):
        values = on_circles(case, times, places, nodes)
    for _ in range(4):
        before, nodes, precision = values, 2 * nodes, precision + 20
        with workdps(precision):
            values = on_circles(case, times, places, nodes)
            change = difference(before, values)
        if change < agree:
            return values, change, nodes
    raise ArithmeticError(f"{case['name']}: no convergence, {nstr(change, 3)}")


def check_talbot(case, values, digits):
    """Return the difference from Talbot's method at every third time, backwards from the last, for up to 500 terms."""
    times, delay = case["times"], case["delay"]
    picked, terms = [], 0
    for i in range(len(times) - 1, -1, -3 if delay else -1):
        terms += last_term(times[i], delay)
        if not picked or terms < 500:
            picked.append(i)
    ours = {name: [row[i] for i in picked] for name, row in values.items()}
    before = None
    for degree in (60, 100, 160, 260, 420, 680, 1100):
        if degree < 2 * digits:  # the method yields 0.6 digits per degree at best
            continue
        with workdps(degree + 60):
            new = by_talbot(case, [times[i] for i in picked], degree)
            gap = difference(new, ours)
            if before and max(gap, difference(before, new)) < mpf(10) ** -(digits + 2):
                return gap
            before = new
    raise ArithmeticError(f"{case['name']}: Talbot differs by {nstr(gap, 3)}")


def reference(case, digits):
    """Return checked values at the case's times, by signal, and a line of evidence."""
    values, change, nodes = respond(case, case["times"], digits)
    talbot = check_talbot(case, values, digits)
    seen = f"{nodes:5d} nodes, change by doubling {nstr(change, 2)}, Talbot differs {nstr(talbot, 2)}"
    return values, f"{case['name']:28s}{len(case['times']):3d} times, {seen}"


def running_maximum(case):
    """Return the running maximum of |value| at the case's times, taken over `times` and `envelope_times`."""
    grid = sorted({*case["times"], *case["envelope_times"]})
    dense, _, _ = respond(case, grid, ENVELOPE_DIGITS)
    pick = [grid.index(t) for t in case["times"]]
    size = {n: [abs(float(text(x, ENVELOPE_DIGITS))) for x in row] for n, row in dense.items()}
    return {n: np.maximum.accumulate(row)[pick] for n, row in size.items()}


def stored(case, values, digits, sources=("setpoint", "load", "noise")):
    """Return the case in the format of the file."""
    out = {key: content for key, content in case.items() if key != "envelope_times"}
    out["values"] = nest(values, sources, lambda v: text(v, digits))
    if "envelope_times" in case:
        out["envelope"] = nest(running_maximum(case), sources, float)
    return out


def nest(values, sources, convert):
    """Return {"setpoint": {"y": [...], "u": [...]}, "load": ..., ...} for the sources named."""
    out = {}
    for name, row in values.items():
        source, signal = name.split(".")
        if source in sources:
            out.setdefault(source, {})[signal] = [convert(v) for v in row]
    return out


def text(v, digits):
    return nstr(v, digits) if abs(v) > mpf(10) ** -(digits + 5) else "0.0"
