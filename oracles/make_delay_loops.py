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
The script fails if one of these checks fails.  Run: python oracles/make_delay_loops.py
"""

import math
from fractions import Fraction

from delay_loop_series import reference, stored
from mpmath import mpf, workdps
from problems import store

DIGITS = 25


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
            if abs(values["setpoint.y"][i] - mpf(y.numerator) / y.denominator) > mpf(10) ** -(DIGITS + 7):
                raise ArithmeticError(f"{case['name']}: closed form differs at t = {t}")


def solve(case):
    """Return the case with its values, and a line of evidence."""
    values, line = reference(case, DIGITS)
    if case["name"] in ("integrator_gain", "square_wave"):
        check_closed_forms(case, values)
    return stored(case, values, DIGITS), line


if __name__ == "__main__":
    store(__file__, DIGITS, solve)
