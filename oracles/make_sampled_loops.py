"""Make sampled_loops.json: margins, noise gain and responses of loops with a digital controller, to 30 digits.

The plant G(s) e^{-Ls} is between a hold and a sampler, the controller is K(z), and both are quotients of polynomials in
z. K is C(s) with s replaced (backward, tustin), or C(s) between a hold and a sampler (zoh).

Method.
  * Blocks between a hold and a sampler: the denominator is the characteristic polynomial of the matrix exponential of
    the companion matrix. The numerator is the product of the denominator and the pulse response, which comes from
    integrals of G(s)/s e^{st} over circles around all poles (see make_delay_loops.py).
  * Margins: on the unit circle functions are quotients of polynomials in y = 1 - cos(wh). The zeros of polynomials
    between 0 and 2 are isolated with proof, and found by Newton's method (quasipolynomials.py).
  * Noise gain: Parseval's integral by Astrom's recursion, which is exact.
  * Responses: the difference equations.

Checks. The script stops if one fails.
  * Nothing is shared with the program under test: no state space of its blocks, no grid, no argument principle, no
    sum over a simulation.
  * The denominator and the pulse response are computed independently. If they did not match, their product would not
    be a polynomial. Its terms beyond the degree of the numerator are computed, and are below 1e-45.
  * Stability is decided by the zeros of 1 + L, and again by the signs in Astrom's recursion.
  * The noise gain agrees to 1e-40 with the sum of the squares of the pulse response of u.
  * |L| = 1 and L < 0 hold at the crossovers. On a grid of 4000 frequencies no value is above the peak.
Run: python oracles/make_sampled_loops.py
"""

import math
from fractions import Fraction
from itertools import pairwise

from delay_loop_series import horner
from make_margins import CHECKED, DIGITS, text
from mpmath import acos, arg, exp, fabs, inf, matrix, mp, mpc, mpf, nan, nstr, pi, polyroots, sqrt
from problems import add, poly, store
from quasipolynomials import Quasi, add as ascending_sum, slope

PRECISION = 130
NODES = 400  # least number of nodes of a circle


def terms(kind, own):
    """Return C(s) as a list of terms num/den with coefficients in descending powers, exact."""
    own = {k: [mpf(x) for x in v] if isinstance(v, list) else mpf(v) for k, v in own.items()}
    one = [mpf(1)]
    if kind == "PIDA":
        kp, ti, td, ta = (own.get(k, mpf(0)) for k in ("kp", "ti", "td", "ta"))
        n, m = own.get("n", mpf(10)), own.get("m", mpf(10))
        out = [([kp], one)]
        out += [([kp], [ti, mpf(0)])] if ti < inf else []
        out += [([kp * td, mpf(0)], [td / n, mpf(1)])] if td else []
        out += [([kp * ta, mpf(0), mpf(0)], poly([ta / m, mpf(1)], [ta / m, mpf(1)]))] if ta else []
        return out
    order = int(own["filter_order"])
    filters = poly(*[[own["filter_time"], mpf(1)]] * order)
    if kind == "HighOrderPID":
        gains = own["gains"]
        return [(gains[::-1], poly(filters, [mpf(1), mpf(0)])) if gains[0] else (gains[:0:-1], filters)]
    if kind == "SeriesPIDA":
        num = poly([own["ka"], own["kd"], own["kp"]], [own["ti"], mpf(1)])
        return [(num, poly(filters, [own["ti"], mpf(0)]))]
    raise KeyError(kind)


def summed(fractions):
    num, den = [mpf(0)], [mpf(1)]
    for n, d in fractions:
        num, den = add(poly(num, d), poly(n, den)), poly(den, d)
    while num[0] == 0 and len(num) > 1:
        num = num[1:]
    return num, den


def substituted(num, den, h, method):
    """Return the fraction with s replaced by a quotient of polynomials in z."""
    up, down = (
        ([1 / h, -1 / h], [mpf(1), mpf(0)]) if method == "backward" else ([2 / h, -2 / h], [mpf(1), mpf(1)])
    )
    n = len(den) - 1

    def replaced(p):
        total = [mpf(0)]
        for k, c in enumerate(reversed(p)):
            total = add(total, [c * x for x in poly(*[up] * k, *[down] * (n - k))])
        return total

    return replaced(num), replaced(den)


def step_values(num, den, times):
    """Return the step response of num/den at times, by integrals over a circle around 0 and all poles."""
    radius = (
        2 * max((fabs(c / den[0]) ** (mpf(1) / k) for k, c in enumerate(den) if k and c), default=mpf(1)) + 1
    )
    longest = max(times, default=mpf(0))
    nodes = NODES + int(12 * radius * longest)
    total = [mpf(0)] * len(times)
    for j in range(nodes):
        s = 2 * radius * mp.expjpi((mpf(j) + mpf(0.5)) / nodes)
        value = horner(num, s) / horner(den, s) / nodes
        for i, t in enumerate(times):
            if t >= 0:
                total[i] += (value * exp(s * t)).real
    return total


def characteristic(m):
    """Return the characteristic polynomial of a matrix, by Faddeev and Leverrier."""
    n, out, power = m.rows, [mpf(1)], mp.eye(m.rows)
    for k in range(1, n + 1):
        product = m * power
        out.append(-sum(product[i, i] for i in range(n)) / k)
        power = product + out[-1] * mp.eye(n)
    return out


def held(num, den, h, late=0.0):
    """Return the fraction in z of num/den e^{-s late} between a hold and a sampler."""
    n, delay = len(den) - 1, mpf(late)
    whole = math.floor(Fraction(late) / Fraction(float(h)))
    companion = matrix(n, n)
    for i in range(n):
        companion[0, i] = -den[i + 1] / den[0]
        if i:
            companion[i, i - 1] = mpf(1)
    bottom = characteristic(mp.expm(companion * h)) if n else [mpf(1)]
    length = n + whole + 2
    values = step_values(num, den, [k * h - delay for k in range(length + 6)])
    pulses = [values[0], *(b - a for a, b in pairwise(values))]
    product = [sum(bottom[i] * pulses[k - i] for i in range(min(k, n) + 1)) for k in range(length + 6)]
    size = max(map(fabs, product))
    assert all(fabs(x) < mpf(10) ** -45 * size for x in product[length:]), "the two ways differ"
    # Multiply both by the same power of z, and remove common factors of z.
    top, below = product[:length], bottom + [mpf(0)] * (length - n - 1)
    while len(top) > n + 1 and fabs(top[-1]) < mpf(10) ** -45 * size:
        top, below = top[:-1], below[:-1]
    return [x if fabs(x) > mpf(10) ** -45 * size else mpf(0) for x in top], below


def on_circle(p, q):
    """Return the real part of p(z) q(1/z) on the unit circle, and the imaginary part / sin(wh), in powers of y."""
    n = max(len(p), len(q)) - 1
    p, q = ([mpf(0)] * (n + 1 - len(x)) + x for x in (p, q))
    p, q = p[::-1], q[::-1]
    by = {k: sum(p[i] * q[i - k] for i in range(n + 1) if 0 <= i - k <= n) for k in range(-n, n + 1)}
    x = [mpf(1), mpf(-1)]  # cos in ascending powers of y
    even, odd = [[mpf(1)], x], [[mpf(0)], [mpf(1)]]  # cos(k a), sin(k a)/sin(a)
    for kind in (even, odd):
        while len(kind) < n + 1:
            twice = poly([2 * c for c in x], kind[-1])
            kind.append(ascending_sum(twice, [-c for c in kind[-2]]))
    real, imaginary = [by[0]], [mpf(0)]
    for k in range(1, n + 1):
        real = ascending_sum(real, [(by[k] + by[-k]) * c for c in even[k]])
        imaginary = ascending_sum(imaginary, [(by[k] - by[-k]) * c for c in odd[k]])
    return real, imaginary


def cleaned(p):
    """Replace coefficients that are only rounding errors by 0."""
    size = max(map(fabs, p))
    return [x if fabs(x) > mpf(10) ** -75 * size else mpf(0) for x in p]


def zeros(p):
    """Return all zeros between 0 and 2 of a polynomial in ascending powers of y."""
    return Quasi.of_numbers(cleaned(p)).zeros(2)


def margins(num, den, h):
    """Return the entries of pidalab.Margins for L = num/den in z, by their names there."""

    def L(w):
        z = exp(mpc(0, w * h))
        return horner(num, z) / horner(den, z)

    def frequency(y):
        return acos(1 - y) / h

    top = pi / h
    nn, dd, (real, imaginary) = on_circle(num, num)[0], on_circle(den, den)[0], on_circle(num, den)
    below = ascending_sum(ascending_sum(nn, dd), [2 * x for x in real])
    crossings = [frequency(y) for y in zeros(ascending_sum(dd, [-x for x in nn]))]
    lags = [(arg(L(w)) + pi) % (2 * pi) for w in crossings]
    turns = [min(x, 2 * pi - x) for x in lags]
    assert all(fabs(fabs(L(w)) - 1) < mpf(10) ** -CHECKED for w in crossings)
    phase = [*(frequency(y) for y in zeros(imaginary)), top]
    phase = [w for w in phase if L(w).real < 0]
    assert all(fabs(L(w).imag) < mpf(10) ** -CHECKED * fabs(L(w)) for w in phase)
    crossed, sizes = phase, [fabs(L(w)) for w in phase]
    rest_den, rest_num = horner(den, mpf(1)), horner(num, mpf(1))
    if fabs(rest_den) > mpf(10) ** -75 * max(map(fabs, den)) and rest_num / rest_den < 0:
        phase, sizes = [mpf(0), *phase], [-rest_num / rest_den, *sizes]  # L is real at zero frequency too
    small, large = [x for x in sizes if x < 1], [x for x in sizes if x > 1]
    out = {
        "gm": 1 / max(small) if small else inf,
        "gm_low": 1 / min(large) if large else mpf(0),
        "pm": min(turns, default=inf) * 180 / pi,
        "dm": min((x / w for x, w in zip(lags, crossings, strict=True)), default=inf),
        "wgc": crossings[turns.index(min(turns))] if turns else nan,
        "wpc": phase[sizes.index(max(small))] if small else nan,
        "gain_crossovers": crossings,
        "phase_crossovers": crossed,
    }
    for name, over in (("ms", dd), ("mt", nn)):
        change = ascending_sum(poly(slope(over), below), [-x for x in poly(over, slope(below))])
        value = (lambda w: 1 / fabs(1 + L(w))) if name == "ms" else (lambda w: 1 / fabs(1 + 1 / L(w)))
        places = [*(frequency(y) for y in zeros(change)), top]
        best, where = max((value(w), w) for w in places)
        at_zero = next(sqrt(a / b) for a, b in zip(cleaned(over), cleaned(below), strict=False) if b)
        if at_zero >= best:
            best, where = at_zero, mpf(0)
        assert all(value(top * k / 4000) <= best * (1 + mpf(10) ** -CHECKED) for k in range(1, 4001)), name
        out |= {name: best, f"w{name}": where}
    return out


def mean_square(num, den):
    """Return the sum of the squares of the pulse response by Astrom's recursion, or None if num/den is unstable."""
    a = list(den)
    b = [mpf(0)] * (len(den) - len(num)) + list(num)
    first, total = a[0], mpf(0)
    while True:
        if a[0] <= 0:
            return None
        total += b[-1] ** 2 / a[0]
        if len(a) == 1:
            return total / first
        alpha, beta = a[-1] / a[0], b[-1] / a[0]
        back = a[::-1]
        b = [x - beta * y for x, y in zip(b, back, strict=True)][:-1]
        a = [x - alpha * y for x, y in zip(a, back, strict=True)][:-1]


def expanded(num, den, count):
    """Return the first terms of num/den in powers of 1/z."""
    num = [mpf(0)] * (len(den) - len(num)) + list(num)
    out = []
    for k in range(count):
        value = num[k] if k < len(num) else mpf(0)
        value -= sum(den[i] * out[k - i] for i in range(1, min(k, len(den) - 1) + 1))
        out.append(value / den[0])
    return out


def running(values):
    total, out = mpf(0), []
    for x in values:
        total += x
        out.append(total)
    return out


def solve(case):
    mp.dps = PRECISION
    h = mpf(case["sample_time"])
    num, den = ([mpf(x) for x in case["process"][k]] for k in ("num", "den"))
    g_num, g_den = held(num, den, h, case["delay"])
    c_num, c_den = summed(terms(case["controller"], case["arguments"]))
    k_num, k_den = (
        held(c_num, c_den, h) if case["method"] == "zoh" else substituted(c_num, c_den, h, case["method"])
    )
    l_num, l_den = poly(g_num, k_num), poly(g_den, k_den)
    closed = add(l_num, l_den)
    if closed[0] < 0:
        l_num, l_den, closed = ([-x for x in p] for p in (l_num, l_den, closed))
        k_num = [-x for x in k_num]
    largest = max(fabs(p) for p in polyroots(closed, maxsteps=3000, extraprec=3000))
    assert fabs(largest - 1) > mpf(10) ** -9
    u_num = poly(k_num, g_den)
    variance = mean_square(u_num, closed)
    assert (variance is not None) == (largest < 1)
    count = case["samples"]
    y = running(expanded(l_num, closed, count))
    u = running(expanded(u_num, closed, count))
    load = running(expanded(poly(g_num, k_den), closed, count))
    picked = list(range(0, count, case["every"]))
    values = {"setpoint.y": y, "setpoint.u": u, "load.y": load}
    found = {"stable": bool(largest < 1), "picked": picked}
    found |= {name: [text(row[i]) for i in picked] for name, row in values.items()}
    if largest < 1:
        length = int(100 / -float(mp.log10(largest))) + 50
        with mp.workdps(50):
            again = sum(x * x for x in expanded([+x for x in u_num], [+x for x in closed], length))
        assert fabs(again / variance - 1) < mpf(10) ** -CHECKED, nstr(again / variance - 1, 5)
        found |= {
            "noise_gain": text(sqrt(variance)),
            "margins": {k: text(v) for k, v in margins(l_num, l_den, h).items()},
        }
    line = f"{case['name']:24s}largest pole {nstr(largest, 6)}, noise gain {found.get('noise_gain')}"
    return case | {"values": found}, line


if __name__ == "__main__":
    store(__file__, DIGITS, solve)
