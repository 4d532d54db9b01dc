"""Make delay_loops.json: high-precision step responses of linear loops with dead time.

The loop is process P = G(s) exp(-L s), controller C, output filter F, prefilter Fr, with
G, C, F, Fr rational and proper and Q = C F G; u is the output of C F, a load adds to u at
the process input and noise n adds to the measurement (y + n).  For unit steps at t = 0

    set point:  Y =  Fr Q e^{-Ls} S / s    U =  Fr C F S / s
    load:       Y =     G e^{-Ls} S / s    U =    -Q e^{-Ls} S / s
    noise:      Y =    -Q e^{-Ls} S / s    U =    -C F S / s

with S = 1 / (1 + Q e^{-Ls}) = sum_k (-Q)^k e^{-kLs}.  At a given t only the terms with
kL <= t count, so each value is a *finite* sum of inverse transforms of rational functions
taken at t - kL >= 0 (a term with t - kL = 0 gives its initial value: values are
right-continuous).  With L = 0 the closed loop itself is one rational function.

How the values are made.  The inverse of a rational function is the sum of its residues,
i.e. (1/2 pi i) times the integral of the function times e^{st} over circles that enclose
its poles.  The trapezoidal rule on a circle converges geometrically, needs no exact pole
locations, and is indifferent to (nearly) multiple poles, so high powers of Q are no harder
than Q itself.  Stiff loops get one circle per magnitude of poles.

Why they can be trusted.
  * No state space, no matrix exponential, no step-by-step solution, no approximation of
    the dead time: nothing is shared with the program under test.
  * Coefficients, dead time and times are the exact values of the stored doubles.
  * Nodes are doubled (and digits added) until all values agree to 1e-32 * max(1, |value|);
    the value stored is rounded to 25 significant digits (below 1e-30 it is stored as 0).
  * Every third time of each case (all without dead time, fewer where there are hundreds of
    terms) is computed again by fixed Talbot on each term alone, raising the degree until
    two degrees and the stored values agree to 1e-27.
  * Two cases are compared with closed forms in exact rational arithmetic.
The script fails if one of these checks fails.  Run: python tests/oracle/make_delay_loops.py
"""

import json
import math
import sys
import time
from fractions import Fraction
from multiprocessing import Pool
from pathlib import Path

import numpy as np
from mpmath import mpf, nstr, workdps

sys.path.insert(0, str(Path(__file__).parent))  # pytest's importlib mode does not add it

from delay_loop_cases import cases
from delay_loop_series import by_talbot, circles, last_term, on_circles

AGREE = mpf(10) ** -32  # between successive node numbers, relative to max(1, |value|)
AGREE_TALBOT = mpf(10) ** -27


def difference(a, b):
    """Largest |a - b| / max(1, |b|) over all signals and times."""
    return max(abs(x - y) / max(1, abs(y)) for n in b for x, y in zip(a[n], b[n], strict=True))


def respond(case, times):
    """Values at times, the last difference by doubling, and the nodes used."""
    places, nodes, size = circles(case)
    digits = int(size) + 60
    with workdps(digits):
        values = on_circles(case, times, places, nodes)
    for _ in range(4):
        before, nodes, digits = values, 2 * nodes, digits + 20
        with workdps(digits):
            values = on_circles(case, times, places, nodes)
            change = difference(before, values)
        if change < AGREE:
            return values, change, nodes
    raise ArithmeticError(f"{case['name']}: no convergence, {nstr(change, 3)}")


def check_talbot(case, values):
    """Difference from Talbot at every third time from the last, up to 500 terms in all."""
    times, delay = case["times"], case["delay"]
    picked, terms = [], 0
    for i in range(len(times) - 1, -1, -3 if delay else -1):
        terms += last_term(times[i], delay)
        if not picked or terms < 500:
            picked.append(i)
    ours = {name: [row[i] for i in picked] for name, row in values.items()}
    before = None
    for degree in (60, 100, 160, 260, 420):
        with workdps(degree + 60):
            new = by_talbot(case, [times[i] for i in picked], degree)
            gap = difference(new, ours)
            if before and max(gap, difference(before, new)) < AGREE_TALBOT:
                return gap
            before = new
    raise ArithmeticError(f"{case['name']}: Talbot differs by {nstr(gap, 3)}")


def check_closed_forms(case, values):
    """Set-point step: integrator K/s e^{-s} with a gain, and the square wave 1/(1 + e^{-s})."""
    for i, t in enumerate(map(Fraction, case["times"])):
        y, k = Fraction(0), 1
        while case["name"] == "integrator_gain" and k <= t:  # kappa = K * gain = 1/2
            y -= (-(t - k) / 2) ** k / math.factorial(k)
            k += 1
        if case["name"] == "square_wave":
            y = Fraction(math.floor(t) % 2)
        with workdps(60):
            if abs(values["setpoint.y"][i] - mpf(y.numerator) / y.denominator) > AGREE:
                raise ArithmeticError(f"{case['name']}: closed form differs at t = {t}")


def nest(values, convert):
    """{"setpoint": {"y": [...], "u": [...]}, "load": ..., "noise": ...}"""
    out = {}
    for name, row in values.items():
        source, signal = name.split(".")
        out.setdefault(source, {})[signal] = [convert(v) for v in row]
    return out


def text(v):
    return nstr(v, 25) if abs(v) > mpf(10) ** -30 else "0.0"


def solve(case):
    """The case with its values, and a line of evidence."""
    extra = case.pop("envelope_times", [])
    grid = sorted({*case["times"], *extra})
    dense, change, nodes = respond(case, grid)
    pick = [grid.index(t) for t in case["times"]]
    values = {n: [v[i] for i in pick] for n, v in dense.items()}
    talbot = check_talbot(case, values)
    if case["name"] in ("integrator_gain", "square_wave"):
        check_closed_forms(case, values)
    case["values"] = nest(values, text)
    if extra:  # running maximum of |value| over the dense grid
        top = {n: np.maximum.accumulate([abs(float(text(x))) for x in v]) for n, v in dense.items()}
        case["envelope"] = nest({n: v[pick] for n, v in top.items()}, float)
    seen = f"{nodes:5d} nodes, change by doubling {nstr(change, 2)}, Talbot differs {nstr(talbot, 2)}"
    return case, f"{case['name']:28s}{len(pick):3d} times, {seen}"


def main():
    start, stored = time.perf_counter(), []
    with Pool(2) as pool:
        for case, line in pool.imap(solve, cases()):
            stored.append(case)
            print(f"{time.perf_counter() - start:4.0f} s  {line}", flush=True)
    about = "Made by make_delay_loops.py, which says how; see README.md for the format."
    out = Path(__file__).with_name("delay_loops.json")
    out.write_text(json.dumps({"about": about, "digits": 25, "cases": stored}, indent=1) + "\n")
    count = sum(6 * len(c["times"]) for c in stored)
    print(f"{len(stored)} cases, {count} values -> {out.name}")


if __name__ == "__main__":
    main()
