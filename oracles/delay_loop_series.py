"""Two inversions of the finite delay series described in make_delay_loops.py.

``on_circles`` integrates around the poles, ``by_talbot`` along fixed Talbot contours; both
return {signal: values}.  They share only the evaluation of the rational functions.
"""

import math
from fractions import Fraction
from functools import cache
from itertools import pairwise

import numpy as np
from mpmath import exp, mp, mpc, mpf

SIGNALS = ("setpoint.y", "setpoint.u", "load.y", "load.u", "noise.y", "noise.u")
BLOCKS = ("process", "controller", "output_filter", "prefilter")


def coefficients(case, number=float):
    """[(num, den)] of G, C, F, Fr; an absent block is 1."""
    one = {"num": [1.0], "den": [1.0]}
    blocks = (case[name] or one for name in BLOCKS)
    return [([number(x) for x in b["num"]], [number(x) for x in b["den"]]) for b in blocks]


def horner(p, s):
    v = mpf(0)
    for c in p:
        v = v * s + c
    return v


def at(blocks, s):
    """G, C F, Fr at s (None: at infinity)."""
    if s is None:
        v = [n[0] / d[0] if len(n) == len(d) else mpf(0) for n, d in blocks]
        return v[0], v[1] * v[2], v[3]
    g, c, f, fr = (horner(num, s) / horner(den, s) for num, den in blocks)
    return g, c * f, fr


def six(g, cf, fr, q, now, late):
    """The six transforms times s; ``now`` and ``late`` stand for S and e^{-Ls} S."""
    ql = q * late
    return fr * ql, fr * cf * now, g * late, -ql, -ql, -cf * now


def last_term(t, delay):
    """Largest k with k L <= t, in exact arithmetic."""
    return math.floor(Fraction(t) / Fraction(delay)) if delay else 0


def clusters(case):
    """Poles of the terms as groups of increasing magnitude, each far from the next."""
    blocks = coefficients(case)
    poles = [0j] + [p for _, den in blocks for p in np.roots(den)]
    if not case["delay"]:  # closed loop in place of the open-loop terms
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
    """Estimate of the largest log of a term times e^{st} on the circle."""
    s = center + radius * np.exp(1j * np.pi * (np.arange(400) + 0.5) / 400)
    q = np.prod([np.polyval(n, s) / np.polyval(d, s) for n, d in coefficients(case)[:3]], axis=0)
    size, delay = np.log(np.abs(q)), case["delay"]
    ends = {(k, t - k * delay) for t in case["times"] for k in (0, last_term(t, delay))}
    return max(0.0, max((k * size + s.real * tau).max() for k, tau in ends))


def circles(case, digits):
    """Circles (centre, radius), a first node number, log10 of the largest integrand.

    The trapezoidal rule errs by the integrand on a smaller or larger circle times the ratio of
    the radii to the power of the number of points: the radius taken is the cheapest of a list.
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
    """{signal: values at times} by the trapezoidal rule with 2 * nodes points per circle."""
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
    """The same values by fixed Talbot inversion (Abate and Valko 2004), term by term."""
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
    """(s, weight) such that f(tau) = sum of Re(weight * s F(s)); s = None is infinity."""
    return [(z / tau, weight) for z, weight in talbot_contour(degree, mp.prec)] if tau else [(None, mpf(1))]


@cache
def talbot_contour(degree, precision):
    """(tau s, weight), which do not depend on tau, to the current precision (in bits)."""
    r = mpf(2 * degree) / 5
    nodes = [(r, exp(r) / (2 * degree))]
    for j in range(1, degree):
        a = j * mp.pi / degree
        cot = mp.cot(a)
        z = r * a * mpc(cot, 1)
        sigma = a + (a * cot - 1) * cot
        nodes.append((z, exp(z) * mpc(1, sigma) * r / (degree * z)))
    return nodes
