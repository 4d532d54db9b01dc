"""Make optima.json: the largest integral gain of a PI controller under a limit of Ms, to 30 digits.

After a step of the load |IE| = 1/ki, and IAE >= |IE|. So no PI controller within the limit has an IAE below 1/ki of the
largest allowed ki. A controller that attains this bound is the global optimum. The controller is
(kp + ki/s)/(T s + 1), where T is the shortest filter time that the search of the library allows.

Method.  At the largest ki, |1 + L| = 1/Ms at one frequency, and the slopes of |1 + L| by frequency and by kp are 0.
Newton's method solves the three equations with 60 digits.

Checks. The script stops if one fails.
  * Nothing is shared with the program under test: no response, no search, no gradient of an integral.
  * By make_margins.py, the loop with gains rounded to doubles is stable, and its Ms is the limit to 1e-12.
  * For 2001 values of kp, from 0 to four times the optimal kp, the limit at each of 20001 frequencies is a quadratic
    equation in ki, whose least root bounds ki. No kp has a larger ki, to 1e-4, the accuracy that these frequencies
    permit.
Run: python oracles/make_optima.py
"""

import numpy as np
from make_margins import AxisFunctions, all_margins, unstable_poles
from mpmath import diff, exp, fabs, findroot, mp, mpc, mpf, nstr
from problems import rational, store

DIGITS, PRECISION = 30, 60


def largest_gain(process, delay, ms, time, start):
    """Return kp, ki and the frequency that touches the limit."""
    num, den = ([mpf(x) for x in process[k]] for k in ("num", "den"))

    def distance(kp, ki, w):
        s = mpc(0, w)
        plant = mp.polyval(num, s) / mp.polyval(den, s) * exp(-mpf(delay) * s) / (mpf(time) * s + 1)
        return fabs(1 + plant * (kp + ki / s)) ** 2

    def equations(kp, ki, w):
        by_kp = diff(lambda x: distance(x, ki, w), kp)
        return distance(kp, ki, w) * mpf(ms) ** 2 - 1, by_kp, diff(lambda x: distance(kp, ki, x), w)

    return findroot(equations, start, tol=mpf(10) ** -80, maxsteps=50)


def bound(process, delay, ms, time, top):
    """Return the largest ki for many values of kp, by the quadratic equation at many frequencies."""
    w = np.geomspace(1e-3, 1e2, 20001)
    s = 1j * w
    plant = (
        np.polyval(process["num"], s) / np.polyval(process["den"], s) * np.exp(-delay * s) / (time * s + 1)
    )
    most = 0.0
    for kp in np.linspace(0.0, top, 2001):
        # |a + ki b|^2 = 1/Ms^2, and with ki = 0 the limit must be kept
        a, b = 1 + plant * kp, plant / s
        middle, square, rest = (np.conj(a) * b).real, np.abs(b) ** 2, np.abs(a) ** 2 - 1 / ms**2
        if rest.min() <= 0:
            continue
        inside = middle**2 - square * rest
        roots = (-middle - np.sqrt(np.maximum(inside, 0.0))) / square
        most = max(most, float(np.min(roots[(inside >= 0) & (roots > 0)], initial=np.inf)))
    return most


def solve(case):
    mp.dps = PRECISION
    begin = case.pop("start")
    process, delay, ms, time = (case[key] for key in ("process", "delay", "ms", "filter_time"))
    kp, ki, w = largest_gain(process, delay, ms, time, [begin[key] for key in ("kp", "ki", "frequency")])
    block = rational([float(kp), float(ki)], [time, 1.0, 0.0])
    f = AxisFunctions({"process": process, "controller": block, "output_filter": None, "delay": delay})
    assert unstable_poles(f) == 0
    assert fabs(all_margins(f)["ms"] / mpf(ms) - 1) < 1e-12
    most = bound(process, delay, ms, time, 4 * float(kp))
    assert most < float(ki) * (1 + 1e-4), (most, float(ki))
    values = {"kp": kp, "ki": ki, "frequency": w, "iae_at_least": 1 / ki}
    line = f"{case['name']:20s}ki = {nstr(ki, 15)}, from the other side {most:.8f}"
    return case | {"values": {key: nstr(x, DIGITS) for key, x in values.items()}}, line


if __name__ == "__main__":
    store(__file__, DIGITS, solve)
