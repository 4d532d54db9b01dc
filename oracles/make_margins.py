"""Make margins.json: margins, peaks, crossovers, limits of stability and numbers of unstable poles, to 30 digits.

The loop is that of make_delay_loops.py, with L(s) = N/D e^{-Ls}. On the axis everything is a quotient of functions
a + b cos(wL) + c sin(wL) with polynomials a, b, c whose coefficients are exact:

    gain crossovers     |N|^2 = |D|^2
    phase crossovers    Im[N D* e^{-jwL}] = 0, real part below 0
    peaks               zeros of the slopes of |S|^2, |T|^2, |C S|^2, with the denominator |D + N e^{-jwL}|^2

Method.  All zeros between 0 and a frequency W are isolated (quasipolynomials.py) and found by Newton's method with 90
digits. Frequencies above W have no effect. Each margin is the least or largest of the candidates. The method of Walton
and Marshall decides stability. It counts the unstable poles without dead time. While the dead time grows from 0 to L,
poles cross the axis only at gain crossovers, at known dead times. The sign of the slope of |D|^2 - |N|^2 gives their
direction.

Checks. The script stops if one fails.
  * Nothing is shared with the program under test: no grid, no tracking of a phase, no argument principle, no minimiser.
  * Coefficients and dead time are the exact values of the stored doubles.
  * Bounds of the second derivative prove that no zero is missed. Polynomials whose coefficients around W are all
    positive prove that no zero beyond W counts.
  * Every value is substituted, to 40 digits: |L| = 1 and arg L = 180 degrees at the crossovers, and poles on the axis
    for the gain and the dead time at the margin. On a grid of 400 frequencies nothing is higher than a peak.
  * Closed forms, where they exist, are compared to 40 digits.
Run: python oracles/make_margins.py
"""

from mpmath import arg, atan, exp, fabs, inf, isinf, isnan, mp, mpc, mpf, nan, nstr, pi, polyroots, sqrt
from problems import poly, store
from quasipolynomials import Quasi, add, exact, number, on_axis, positive_beyond, scaled, squared

DIGITS, PRECISION, CHECKED = 30, 90, 40
MOST_TURNS = 500  # largest phase of the dead time, in rad, up to which |C S| is computed
QUIETEST = mpf("0.1")  # phase crossovers are listed where |L| is at least this
POLES = [
    (0.3, 0.0),
    (3.0, 0.0),
    (30.0, 0.0),
    (1.0, 0.9),
    (1.0, 7.3),
]  # factors of gain and additions to the dead time


class Elsewhere(Exception):
    """Raised if the highest value may be at infinite frequency, or at too high a frequency."""


def at(p, w):
    """Return p(jw)."""
    return sum(number(x) * mpc(0, w) ** k for k, x in enumerate(p))


class AxisFunctions:
    """A loop on the imaginary axis."""

    def __init__(self, case):
        blocks = [
            case[name] or {"num": [1.0], "den": [1.0]} for name in ("process", "controller", "output_filter")
        ]
        (gn, gd), (cn, cd), (fn, fd) = ((exact(b["num"]), exact(b["den"])) for b in blocks)
        self.c_num, self.c_den, self.g_den = poly(cn, fn), poly(cd, fd), gd
        self.num, self.den = poly(gn, self.c_num), poly(gd, self.c_den)
        self.delay = case["delay"]
        (nr, ni), (dr, di) = on_axis(self.num), on_axis(self.den)
        real = add(poly(nr, dr), poly(ni, di))  # real part of N D*, without the dead time
        imaginary = add(poly(ni, dr), scaled(poly(nr, di), -1))
        self.nn, self.dd = squared(self.num), squared(self.den)
        self.real = Quasi([0], real, imaginary, self.delay)
        self.imaginary = Quasi([0], imaginary, scaled(real, -1), self.delay)
        self.below = Quasi(add(self.nn, self.dd), [0], [0], self.delay) + self.real * [2]
        self.flat_exact = self.num[-1] / self.den[-1] if len(self.num) == len(self.den) else self.num[0] * 0
        self.flat = number(self.flat_exact)  # L at infinite frequency, without the dead time

    def L(self, w, factor=1, extra=0):
        late = exp(-(number(self.real.delay) + extra) * mpc(0, w))
        return factor * at(self.num, w) / at(self.den, w) * late

    def C(self, w):
        return at(self.c_num, w) / at(self.c_den, w)

    def quiet_beyond(self, most):
        """Return a frequency W beyond which |L| < most."""
        square = mpf(most) ** 2
        gap = add([square * number(x) for x in self.dd], [-number(x) for x in self.nn])
        w = mpf(2) ** -20
        while not positive_beyond(gap, w):
            w *= 2
            if w > mpf(10) ** 30:
                raise ArithmeticError(f"|L| never stays below {nstr(most, 5)}")
        return w

    def gain_crossovers(self):
        difference = add(self.dd, scaled(self.nn, -1))
        end = mpf(1)
        while not positive_beyond(difference, end) and not positive_beyond(scaled(difference, -1), end):
            end *= 2
        return Quasi(difference).zeros(end)

    def phase_crossovers(self, end):
        """Return the phase crossovers below `end`, or all of them if there is no dead time."""
        if not self.delay:
            real = self.imaginary.b
            while not positive_beyond(real, end) and not positive_beyond(scaled(real, -1), end):
                end *= 2
        return [w for w in self.imaginary.zeros(end) if self.real(w) < 0]


def at_zero(num, below):
    """Limit of sqrt(num/below) at frequency 0."""
    (k, x), (m, y) = Quasi(num).leading(), below.leading()
    return mpf(0) if k > m else sqrt(number(x) / number(y)) if k == m else inf


def peak(f, num, value, floor, quiet):
    """Return the largest of the values at 0 and where the slope is 0, and its place.

    `floor` is the value at infinity. `quiet(seen)` returns a frequency beyond which all values are below `seen`.
    """
    first = at_zero(num, f.below)
    seen = max(first, *(value(mpf(10) ** (mpf(k) / 40)) for k in range(-160, 240)))
    if seen <= floor * mpf("1.02"):
        raise Elsewhere
    best = (first, mpf(0))
    for w in f.below.under(num).zeros(quiet(seen)):
        best = max(best, (value(w), w))
    assert best[0] >= seen * (1 - mpf(10) ** -CHECKED), (nstr(best[0], 20), nstr(seen, 20))
    return best


def unstable_poles(f, factor=1.0, extra=0.0):
    """Return the number of unstable poles, by the method of Walton and Marshall."""
    num, delay = scaled(f.num, exact([factor])[0]), number(f.real.delay) + mpf(extra)
    total = add(num, f.den)
    poles = polyroots([number(x) for x in reversed(total)], maxsteps=2000, extraprec=2000)
    count = sum(p.real > 0 for p in poles)
    assert all(fabs(p.real) > mpf(10) ** -CHECKED * fabs(p) for p in poles)
    difference = add(f.dd, scaled(squared(num), -1))
    end = mpf(1)
    while not positive_beyond(difference, end) and not positive_beyond(scaled(difference, -1), end):
        end *= 2
    gap = Quasi(difference)
    slope = gap.slope()
    for w in gap.zeros(end):
        first = (arg(at(num, w) / at(f.den, w)) + pi) % (2 * pi) / w  # dead time that puts a pole on the axis
        crossings = 0
        while first + crossings * 2 * pi / w < delay:
            crossings += 1
        count += 2 * crossings * (1 if slope(w) > 0 else -1)
    return int(count)


def all_margins(f):
    """Return the entries of pidalab.Margins, by their names there."""
    crossings = f.gain_crossovers()
    for w in crossings:
        assert fabs(fabs(f.L(w)) - 1) < mpf(10) ** -CHECKED
    lags = [(arg(f.L(w)) + pi) % (2 * pi) for w in crossings]
    turns = [min(x, 2 * pi - x) for x in lags]
    out = {
        "pm": min(turns, default=inf) * 180 / pi,
        "wgc": crossings[turns.index(min(turns))] if turns else nan,
        "dm": min((x / w for x, w in zip(lags, crossings, strict=True)), default=inf),
        "gain_crossovers": crossings,
    }
    flat, late = fabs(f.flat), f.delay > 0
    if flat and not late:
        raise ArithmeticError("a direct feedthrough without dead time is not among the cases")
    rising = flat and positive_beyond(add(scaled(f.dd, f.flat_exact**2), scaled(f.nn, -1)), mpf(2) ** -40)
    if rising:  # |L| < |L(inf)| everywhere, and L has every phase at high frequency
        assert flat < 1
        out |= {"gm": 1 / flat, "gm_low": mpf(0), "wpc": inf, "candidates": []}
        out |= {"ms": 1 / (1 - flat), "mt": flat / (1 - flat), "wms": inf, "wmt": inf}
        out["mks"], out["wmks"] = None, None  # not decided here: the supremum may lie at infinity
        return out
    most, phase, small = QUIETEST if flat < QUIETEST else (1 + flat) / 2, None, []
    while phase is None or (late and max(small, default=0) < most):
        # Extend the range to where |L| is below the largest |L| found, or nearer to |L(inf)|.
        if phase is not None:
            most = max(small, default=flat + (most - flat) / 10)
        phase = f.phase_crossovers(f.quiet_beyond(most))
        sizes = [fabs(f.L(w)) for w in phase]
        small = [x for x in sizes if x < 1]
    for w in phase:
        assert fabs(arg(-f.L(w))) < mpf(10) ** -CHECKED
    (order, first), (other, second) = Quasi(f.num).leading(), Quasi(f.den).leading()
    still = number(first / second) if order == other else mpf(0)  # L(0), where it is finite
    if still < 0:
        phase, sizes = [mpf(0), *phase], [-still, *sizes]
    small, large = [x for x in sizes if x < 1], [x for x in sizes if x > 1]
    out |= {
        "gm": 1 / max(small) if small else inf,
        "wpc": phase[sizes.index(max(small))] if small else nan,
        "gm_low": 1 / min(large) if large else mpf(0),
        "candidates": phase,
    }
    if not late or most == QUIETEST:
        out["phase_crossovers"] = [
            w for w, x in zip(phase, sizes, strict=True) if w and (x >= QUIETEST or not late)
        ]
    out["ms"], out["wms"] = peak(
        f, f.dd, lambda w: 1 / fabs(1 + f.L(w)), 1 / (1 - flat), lambda top: f.quiet_beyond(1 - 1 / top)
    )
    out["mt"], out["wmt"] = peak(
        f,
        f.nn,
        lambda w: 1 / fabs(1 + 1 / f.L(w)),
        flat / (1 - flat),
        lambda top: f.quiet_beyond(top / (1 + top)),
    )
    out["mks"], out["wmks"] = control_peak(f, flat)
    return out


def control_peak(f, flat):
    """Return the largest |C S|, if it is not approached at infinite frequency."""
    last = number(f.c_num[-1] / f.c_den[-1]) if len(f.c_num) == len(f.c_den) else mpf(0)
    c_num, c_den = squared(f.c_num), squared(f.c_den)

    def quiet(top):
        for q in (mpf("0.5"), mpf("0.1"), mpf("0.01"), mpf("1e-4"), mpf("1e-8")):
            share = (top * (1 - q)) ** 2
            if flat < q and fabs(last) < top * (1 - q):
                w = f.quiet_beyond(q)
                gap = add([share * number(x) for x in c_den], [-number(x) for x in c_num])
                while not positive_beyond(gap, w):
                    w *= 2
                if w * f.delay < MOST_TURNS:
                    return w
        raise Elsewhere

    num = poly(c_num, squared(f.g_den))
    floor = fabs(last) / (1 - flat)
    try:
        return peak(f, num, lambda w: fabs(f.C(w) / (1 + f.L(w))), floor, quiet)
    except Elsewhere:
        return None, None


def closed_forms(name, found):
    """Check values that are known in closed form."""
    known = {}
    if name == "integrator_gain":
        known = {"gm": pi, "wpc": pi / 2, "wgc": mpf("0.5"), "pm": 90 - mpf("0.5") * 180 / pi, "dm": pi - 1}
    if name == "delay_and_integrator":
        k = mpf(0.15)
        known = {
            "gm": pi / (4 * k),
            "wpc": pi / 4,
            "wgc": k,
            "pm": 90 - 2 * k * 180 / pi,
            "dm": pi / (2 * k) - 2,
        }
    if name == "unstable_gain":
        k, late = mpf(2.5), mpf(0.2)
        w = sqrt(k * k - 1)
        known = {"wgc": w, "pm": (atan(w) - w * late) * 180 / pi, "dm": atan(w) / w - late, "gm_low": 1 / k}
    if name == "neutral_rising":
        known = {"gm": 1 / (2 * mpf(0.4)), "ms": 1 / (1 - 2 * mpf(0.4))}
    for key, value in known.items():
        assert fabs(found[key] / value - 1) < mpf(10) ** -CHECKED, (name, key)
    return len(known)


def check_limits(f, found):
    """Check that the gain, or the dead time, at its margin gives a pole on the axis, and that stability changes
    there."""
    less, poles = 1 - mpf(10) ** -9, []
    for factor in (found["gm"], found["gm_low"]):
        if mpf(0) < factor < inf and 0 < found["wpc"] < inf:
            poles.append(min((1 + f.L(w, factor) for w in found["candidates"]), key=fabs))
            assert unstable_poles(f, float(factor * less if factor > 1 else factor / less)) == 0
            assert unstable_poles(f, float(factor / less if factor > 1 else factor * less)) > 0
    if 0 < found["dm"] < inf:
        poles.append(min((1 + f.L(w, 1, found["dm"]) for w in found["gain_crossovers"]), key=fabs))
        assert unstable_poles(f, 1.0, float(found["dm"] * less)) == 0
        assert unstable_poles(f, 1.0, float(found["dm"] / less)) > 0
    assert all(fabs(p) < mpf(10) ** -CHECKED for p in poles)


def text(x):
    if x is None:
        return None
    if isinstance(x, list):
        return [text(v) for v in x]
    return "inf" if isinf(x) else "nan" if isnan(x) else nstr(x, DIGITS)


def solve(case):
    mp.dps = PRECISION
    f = AxisFunctions(case)
    count = unstable_poles(f)
    poles = [
        {"factor": factor, "extra": extra, "count": unstable_poles(f, factor, extra)}
        for factor, extra in POLES
        if fabs(f.flat) * factor < 1
    ]
    found, known = {}, 0
    if count == 0:
        found = all_margins(f)
        known = closed_forms(case["name"], found)
        check_limits(f, found)
        del found["candidates"]
    line = f"{case['name']:24s}{count} unstable poles, Ms {text(found.get('ms'))}, {known} closed forms"
    return case | {
        "unstable_poles": count,
        "poles": poles,
        "values": {k: text(v) for k, v in found.items()},
    }, line


if __name__ == "__main__":
    store(__file__, DIGITS, solve)
