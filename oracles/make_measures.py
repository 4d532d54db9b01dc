"""Make measures.json: IE, IAE, ISE, ITAE, total variation, overshoot, rise and settling time to 25 digits.

The loops are as in make_delay_loops.py, after a unit step of the set point or of the load, from 0 to `end`.

Method.  On each step, a fraction of the dead time, the series of the past control signal is known, and all signals are
power series. Each series is cut off below 1e-45. The zeros of the error and of the slopes of y and u on each step are
isolated by bounds of the second derivative. Between zeros, |e| is integrated as a polynomial.

Checks. The script stops if one fails.
  * Nothing is shared with the program under test: no matrix exponential, no samples, no parabolas between them.
  * Everything is computed again with half the step, and agrees to 1e-30.
  * y and u at some times agree to 1e-25 with the finite series of make_delay_loops.py.

`rates` holds, for each measure, the expected error with samples at intervals h, without the power of h. `Response`
uses parabolas with exact area between samples for the error, and straight lines for u. The remainder of such a parabola
is e''' h^3 s(s - 1)(2s - 1)/12, 0 < s < 1. If h is small and the derivatives break only at samples, the errors are at
most

    IAE              h^4/192 sum |e'''|  over the sign changes of e
    ITAE             h^4/192 sum t |e'''| + h^4/720 integral |e'''|
    ISE              h^4/360 integral |e' e'''|
    overshoot        h^3/124 |e'''| at the highest place
    total variation  h^2/4 sum |x''| over the extrema
    crossing times   h^2/8 |e''/e'|

Run: python oracles/make_measures.py
"""

from itertools import pairwise

from delay_loop_series import reference
from mpmath import fabs, mp, mpf, nstr
from problems import poly, store
from quasipolynomials import shifted

DIGITS, PRECISION, CUT, AGREE = 25, 60, 45, 30
BAND, LOW, HIGH = mpf("0.02"), mpf("0.1"), mpf("0.9")


def realised(num, den):
    """Return the companion form (rows of A, b, c, d) of num/den, exact."""
    num, den = [mpf(x) for x in num], [mpf(x) for x in den]
    n = len(den) - 1
    num = [mpf(0)] * (n + 1 - len(num)) + num
    a, num, direct = [x / den[0] for x in den[1:]], [x / den[0] for x in num], num[0] / den[0]
    return n, a, [num[k + 1] - a[k] * direct for k in range(n)], direct


def pieces(case, source, step):
    """Return the series of (y, u) on all steps, in ascending powers of the time since the beginning of the step."""
    plant = realised(**case["process"])
    blocks = [case["controller"]] + ([case["output_filter"]] if case["output_filter"] else [])
    chain = [realised(**block) for block in blocks]
    count, late = round(case["end"] / step), round(case["delay"] / step)
    assert abs(late * step - case["delay"]) < 1e-14
    step = mpf(case["end"]) / count
    assert not (late == 0 and plant[3])
    r, d = (mpf(1), mpf(0)) if source == "setpoint" else (mpf(0), mpf(1))
    states, done = [[mpf(0)] * block[0] for block in (plant, *chain)], []
    for k in range(count):
        past = done[k - late][1] if late and k >= late else []
        delayed_load = d if k >= late else mpf(0)
        series = [[x] for x in map(list, states)]
        y, u, j, small = [], [], 0, 0
        while small < 4 and j < 400:
            now = [s[j] for s in series]
            constant = 1 if j == 0 else 0
            w = past[j] if late and j < len(past) else mpf(0)
            if late:
                w += delayed_load * constant
            _, _, c, direct = plant
            output = sum((p * q for p, q in zip(c, now[0], strict=True)), direct * w)
            signal = r * constant - output
            y.append(output)
            following = [None]
            for (_, a, c, direct), x in zip(chain, now[1:], strict=True):
                following.append(_rate(a, x, signal))
                signal = sum((p * q for p, q in zip(c, x, strict=True)), direct * signal)
            u.append(signal)
            if not late:
                w = signal + d * constant
            following[0] = _rate(plant[1], now[0], w)
            for s, rate in zip(series, following, strict=True):
                s.append([x / (j + 1) for x in rate])
            size = (
                max((fabs(x) for row in following for x in row), default=mpf(0)) + fabs(output) + fabs(signal)
            )
            j += 1
            small = small + 1 if size * step**j < mpf(10) ** -CUT else 0
        assert small == 4, f"{case['name']}: the series does not end"
        done.append((y, u))
        states = [
            [sum(s[i][m] * step**i for i in range(len(s))) for m in range(len(s[0]))] if s[0] else []
            for s in series
        ]
    return done, step


def _rate(a, x, signal):
    """Return the slopes of the states of a companion form."""
    return [signal - sum(p * q for p, q in zip(a, x, strict=True)), *x[:-1]] if x else []


def value(p, t):
    v = mpf(0)
    for c in reversed(p):
        v = v * t + c
    return v


def slope(p, times=1):
    for _ in range(times):
        p = [k * x for k, x in enumerate(p)][1:] or [mpf(0)]
    return p


def integral(p, a, b):
    primitive = [mpf(0), *(x / (k + 1) for k, x in enumerate(p))]
    return value(primitive, b) - value(primitive, a)


def zeros(p, step):
    """Return the zeros of a series inside a step, except 0. A series that is zero up to rounding has none.

    They are isolated with floats. An interval of centre m and radius r has no zero if |f(m)| > r |f'(m)| + r^2/2
    max|f''|. In the interval f is monotonic if |f'(m)| > r max|f''|. Both tests have a margin for rounding. Other
    intervals are halved.
    """
    p = [x * step**k for k, x in enumerate(p)]
    size = max(map(fabs, p))
    if size < mpf(10) ** -(CUT - 10):
        return []
    while fabs(p[0]) < mpf(10) ** -(CUT - 10) * size:
        p = p[1:]
    rough = [float(x / size) for x in p]
    while abs(rough[-1]) < 1e-20:
        rough.pop()
    todo, found = [(0.0, 1.0)], []
    while todo:
        a, b = todo.pop()
        m, r = (a + b) / 2, (b - a) / 2
        f = shifted(rough, m)
        most = sum(k * (k - 1) * abs(x) * r ** (k - 2) for k, x in enumerate(f) if k > 1)
        rate = f[1] if len(f) > 1 else 0.0
        if abs(f[0]) > r * abs(rate) + r * r / 2 * most + 1e-13:
            continue
        if abs(rate) > r * most + 1e-13:
            if (value(p, mpf(a)) > 0) != (value(p, mpf(b)) > 0):
                found.append(newton(p, mpf(a), mpf(b)))
            continue
        if r < 1e-9:
            raise ArithmeticError("two zeros too close to tell")
        todo += [(a, m), (m, b)]
    return sorted(step * x for x in found)


def newton(p, a, b):
    """Return the zero of a monotonic function, by Newton's method, or by bisection if a step leaves the bracket."""
    change, falls, x = slope(p), value(p, a) > 0, (a + b) / 2
    for _ in range(300):
        v = value(p, x)
        a, b = (x, b) if (v > 0) == falls else (a, x)
        new = x - v / value(change, x)
        new = new if a < new < b else (a + b) / 2
        if fabs(new - x) < mpf(10) ** -(CUT + 5):
            return new
        x = new
    raise ArithmeticError("no convergence")


def turning(parts, step):
    """Return the total variation from rest of a signal in pieces, and the sum of |x''| over its extrema."""
    total, bends, last = mpf(0), mpf(0), mpf(0)
    for p in parts:
        total += fabs(p[0] - last)
        places = zeros(slope(p), step)
        bends += sum(fabs(value(slope(p, 2), t)) for t in places)
        for a, b in pairwise([mpf(0), *places, step]):
            total += fabs(value(p, b) - value(p, a))
        last = value(p, step)
    return total, bends


def measured(case, source, step):
    """Return all measures after one step, their `rates`, the series and their step."""
    done, step = pieces(case, source, step)
    target = mpf(1) if source == "setpoint" else mpf(0)
    errors = [[target - y[0], *(-x for x in y[1:])] for y, _ in done]
    sums = dict.fromkeys(("ie", "iae", "ise", "itae"), mpf(0))
    rates = dict.fromkeys(("iae", "ise", "itae"), mpf(0))
    top, sharp = mpf(0), mpf(0)
    for k, e in enumerate(errors):
        start = k * step
        third = slope(e, 3)
        places = zeros(e, step)
        for a, b in pairwise([mpf(0), *places, step]):
            plain = integral(e, a, b)
            sums["ie"] += plain
            sums["iae"] += fabs(plain)
            sums["itae"] += fabs(start * plain + integral([mpf(0), *e], a, b))
        sums["ise"] += integral(poly(e, e), mpf(0), step)
        for t in places:
            rates["iae"] += fabs(value(third, t)) / 192
            rates["itae"] += (start + t) * fabs(value(third, t)) / 192
        for i in range(8):  # integrals that bound errors need few digits
            t = step * (i + mpf(0.5)) / 8
            rates["itae"] += step / 8 * fabs(value(third, t)) / 720
            rates["ise"] += step / 8 * fabs(value(third, t) * value(slope(e), t)) / 360
        for t in [mpf(0), *zeros(slope(e), step), step]:
            if target - value(e, t) > top:
                top, sharp = target - value(e, t), fabs(value(third, t)) / 124
    found = dict(sums)
    found["tv_u"], bends = turning([u for _, u in done], step)
    rates["tv_u"] = bends / 4
    found["tv_y"], bends = turning([y for y, _ in done], step)
    rates["tv_y"] = bends / 4
    if target:
        found["overshoot"], rates["overshoot"] = max(mpf(0), 100 * (top - 1)), 100 * sharp
        passages = [first_passage(errors, step, 1 - share) for share in (LOW, HIGH)]
        found["rise_time"] = passages[1][0] - passages[0][0]
        rates["rise_time"] = passages[0][1] + passages[1][1]
        found["settling_time"], rates["settling_time"] = last_passage(errors, step, BAND)
    return found, rates, done, step


def first_passage(errors, step, level):
    """Return the first time at which the error is at a level, and the rate of its error."""
    for k, e in enumerate(errors):
        places = zeros([e[0] - level, *e[1:]], step)
        if places:
            return k * step + places[0], fabs(value(slope(e, 2), places[0]) / value(slope(e), places[0])) / 8
    raise ArithmeticError("never reached")


def last_passage(errors, step, band):
    for k in range(len(errors) - 1, -1, -1):
        e, found = errors[k], []
        for level in (band, -band):
            found += zeros([e[0] - level, *e[1:]], step)
        if found:
            t = max(found)
            return k * step + t, fabs(value(slope(e, 2), t) / value(slope(e), t)) / 8
    raise ArithmeticError("never reached")


def compare_with_series(case, source, done, step):
    """Return the largest difference of y and u from the finite series at the beginnings of some steps."""
    count = len(done)
    picked = [k for k in (1, count // 7, count // 3) if k]
    other = case | {"times": [float(k * step) for k in picked], "prefilter": None}
    values, _ = reference(other, DIGITS)
    pairs = [
        (done[k][m][0], values[f"{source}.{signal}"][i])
        for i, k in enumerate(picked)
        for m, signal in enumerate("yu")
    ]
    return max(fabs(a - b) for a, b in pairs)


def solve(case):
    mp.dps = PRECISION
    out, gap, apart = {}, mpf(0), mpf(0)
    for source in ("setpoint", "load"):
        found, rates, done, step = measured(case, source, case["step"])
        again, *_ = measured(case, source, case["step"] / 2)
        gap = max(gap, *(fabs(again[name] - x) / max(1, fabs(x)) for name, x in found.items()))
        apart = max(apart, compare_with_series(case, source, done, step))
        out[source] = {
            "values": {name: nstr(x, DIGITS) for name, x in found.items()},
            "rates": {name: float(x) for name, x in rates.items()},
        }
    assert gap < mpf(10) ** -AGREE, nstr(gap, 5)
    assert apart < mpf(10) ** -DIGITS, nstr(apart, 5)
    line = f"{case['name']:20s} other steps differ by {nstr(gap, 2)}, the series by {nstr(apart, 2)}"
    return case | out, line


if __name__ == "__main__":
    store(__file__, DIGITS, solve)
