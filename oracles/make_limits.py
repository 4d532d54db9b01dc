"""Make limits.json: criteria of absolute stability, and a shortest filter, to 30 digits.

As in make_margins.py, zeros are isolated with proof.

  circle   The infimum of Re[1 + G]: the least of its limit at 0 and its values at zeros of its slope.
  Popov    With the multiplier x the function is 1 + Re G - x w Im G. Where Im G = 0 it does not depend on x, so no
           multiplier has a margin above 1 + Re G there. The script takes the multiplier that makes the slope 0 at such
           a frequency, and shows that the infimum is there. So this multiplier is the best.
  filter   The time constant of the filter of a PD controller at which a pair of poles reaches the axis, by Newton's
           method for frequency and time constant. By the method of Walton and Marshall, the loop is stable a millionth
           above this time constant, and unstable a millionth below it.

Closed forms are compared to 40 digits. The script fails if a check fails.
Run: python oracles/make_limits.py
"""

from fractions import Fraction

from make_margins import CHECKED, DIGITS, PRECISION, AxisFunctions, text, unstable_poles
from mpmath import cos, diff, fabs, findroot, inf, mp, mpf, pi
from problems import poly, rational, store
from quasipolynomials import Quasi, add, fraction, number, positive_beyond, scaled


def infimum(top, below, end):
    """Return the least value of top/below between 0 and end, including its limit at 0, and its place."""
    (k, x), (m, y) = top.leading(), Quasi(below).leading()
    best = (number(x) / number(y), mpf(0)) if k == m else (mpf(0), mpf(0)) if k > m else (inf, mpf(0))
    ratio = Quasi(below)
    for w in top.over(below).zeros(end):
        best = min(best, (top(w) / ratio(w), w))
    return best


def circle(f, ti):
    """Return the infimum of Re[1 + G]."""
    slow = [Fraction(1)] if ti is None else [Fraction(1), Fraction(0), Fraction(ti) ** 2]
    one = f.dd if ti is None else poly(f.dd, [Fraction(0), Fraction(0), Fraction(ti) ** 2])
    top, below = f.real * slow + Quasi(one, [0], [0], f.delay), poly(f.dd, slow)
    ratio = Quasi(below)
    seen = min(top(w) / ratio(w) for w in (mpf(10) ** (mpf(k) / 20) for k in range(-60, 60)))
    assert seen < mpf("0.98"), "the infimum may lie at infinity"
    end = f.quiet_beyond((1 - seen) / 2)
    while ti is not None and 1 / (1 + (number(Fraction(ti)) * end) ** 2) > (1 - seen) / 2:
        end *= 2
    best = infimum(top, below, end)
    assert best[0] <= seen + mpf(10) ** -CHECKED
    return best


def popov(f):
    """Return the largest margin over the multipliers, and the multiplier."""
    for w in sorted((f.phase_crossovers(f.quiet_beyond(mpf("0.02")))), key=lambda w: f.L(w).real):
        margin = 1 + f.L(w).real
        x = diff(lambda v: f.L(v).real, w) / (w * diff(lambda v: f.L(v).imag, w))
        if x < 0:
            continue
        theta = fraction(x)
        top = f.real + f.imaginary * [Fraction(0), -theta] + Quasi(f.dd, [0], [0], f.delay)
        # beyond `end` (1 + (x w)^2) |L|^2 < (1 - margin)^2
        gap = add(scaled(f.dd, (1 - fraction(margin)) ** 2), scaled(poly(f.nn, [1, 0, theta**2]), -1))
        end = mpf(1)
        while not positive_beyond(gap, end) and end < mpf(10) ** 12:
            end *= 2
        if end > 10**6:
            return None
        best, where = infimum(top, f.dd, end)
        if fabs(best - margin) < mpf(10) ** -CHECKED:
            assert fabs(where / w - 1) < mpf(10) ** -20
            return margin, w, x
    return None


def shortest_filter():
    """Return the T at the limit of stability of 1/(s+1) e^{-0.2s} with the controller 2 + 1.5 s/(T s + 1)."""
    plant, delay, kp, kd = rational([1.0], [1.0, 1.0]), 0.2, 2.0, 1.5

    def poles(t):
        controller = rational([kp * t + kd, kp], [t, 1.0])
        return unstable_poles(loop(controller))

    def loop(controller):
        return AxisFunctions(
            {"process": plant, "controller": controller, "output_filter": None, "delay": delay}
        )

    inside, outside = 0.5, 1e-3
    assert poles(inside) == 0 < poles(outside)
    while inside - outside > 1e-3:
        middle = (inside + outside) / 2
        inside, outside = (middle, outside) if poles(middle) == 0 else (inside, middle)

    def on_axis(w, t):
        s = mp.mpc(0, w)
        value = (s + 1) * (t * s + 1) + ((kp * t + kd) * s + kp) * mp.exp(-mpf(delay) * s)
        return value.real, value.imag

    start = loop(rational([kp * inside + kd, kp], [inside, 1.0])).phase_crossovers(mpf(100))[0]
    _, t = findroot(on_axis, (start, mpf(inside)))
    assert poles(float(t * (1 + mpf(10) ** -6))) == 0 < poles(float(t * (1 - mpf(10) ** -6)))
    return {"process": plant, "delay": delay, "kp": kp, "kd": kd, "longest": 0.5, "filter_time": text(t)}


def solve(case):
    mp.dps = PRECISION
    f = AxisFunctions(case)
    ti = case["arguments"]["ti"] if "arguments" in case else None
    margin, w = circle(f, ti)
    found = {"circle": text(margin), "frequency": text(w)}
    if case["name"] == "three_lags":  # 1 - K cos(pi/(n + 1))^(n + 1)
        assert fabs(margin - (1 - 3 * cos(pi / 4) ** 4)) < mpf(10) ** -CHECKED
    best = popov(f) if ti is None else None
    if best:
        found |= {"popov": text(best[0]), "popov_frequency": text(best[1]), "multiplier": text(best[2])}
        assert best[0] >= margin
    return case | {"values": found}, f"{case['name']:20s}{found}"


if __name__ == "__main__":
    mp.dps = PRECISION
    store(__file__, DIGITS, solve, filter=shortest_filter())
