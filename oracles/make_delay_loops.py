"""Make delay_loops.json: high-precision step responses of linear loops with dead time.

The loop consists of process P = G(s) e^{-Ls}, controller C, output filter F and prefilter Fr. G, C, F, Fr are rational
and proper, and Q = C F G. u is the output of C F. A load adds to u at the process input, and noise adds to the
measurement. For unit steps at t = 0

    set point:  Y =  Fr Q e^{-Ls} S / s    U =  Fr C F S / s
    load:       Y =     G e^{-Ls} S / s    U =    -Q e^{-Ls} S / s
    noise:      Y =    -Q e^{-Ls} S / s    U =    -C F S / s

with S = 1 / (1 + Q e^{-Ls}) = sum_k (-Q)^k e^{-kLs}. At a time t only the terms with kL <= t count. So each value is a
*finite* sum of inverse transforms of rational functions at t - kL >= 0. A term with t - kL = 0 gives its initial value:
values are right-continuous. With L = 0 the closed loop itself is one rational function.

Method.  The inverse of a rational function is the sum of its residues: (1/2 pi i) times the integral of the function
times e^{st} over circles around its poles. The trapezoidal rule on a circle converges geometrically, needs no exact
poles, and tolerates multiple poles, as in high powers of Q. Stiff loops get one circle per magnitude of poles.

Checks. The script stops if one fails.
  * Nothing is shared with the program under test: no state space, no matrix exponential, no step-by-step solution, no
    approximation of the dead time.
  * Coefficients, dead time and times are the exact values of the stored doubles.
  * Nodes are doubled (and digits added) until all values agree to 1e-32 * max(1, |value|). Values are stored with 25
    significant digits (as 0 below 1e-30).
  * Every third time of each case is computed again by fixed Talbot on each term alone (every time without dead time,
    fewer times with hundreds of terms). The degree is raised until two degrees and the stored values agree to 1e-27.
  * Two cases are compared with closed forms in exact rational arithmetic.
Run: python oracles/make_delay_loops.py
"""

import math
from fractions import Fraction

from delay_loop_series import reference, stored
from mpmath import mpf, workdps
from problems import store

DIGITS = 25


def check_closed_forms(case, values):
    """Check set-point steps: integrator K/s e^{-s} with a gain, and the square wave 1/(1 + e^{-s})."""
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
    values, line = reference(case, DIGITS)
    if case["name"] in ("integrator_gain", "square_wave"):
        check_closed_forms(case, values)
    return stored(case, values, DIGITS), line


if __name__ == "__main__":
    store(__file__, DIGITS, solve)
