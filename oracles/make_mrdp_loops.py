"""Make mrdp_loops.json: step responses of loops tuned by pidalab.rules.mrdp, right to 110 digits.

The plant is an integrator with dead time. The controller is a PID with derivatives up to order m and a filter of order
n, with the prefilter that cancels m + 1 (or p) dominant poles. Some loops diverge, since the rule does not consider
stability. Series, inversion and checks are those of make_delay_loops.py with more digits:

  * nodes are doubled (and digits added) until all values agree to 1e-117 * max(1, |value|);
  * every third time is computed again by fixed Talbot on each term alone. The degree is raised until two degrees and
    the stored values agree to 1e-112 * max(1, |value|).

The filter 1/(T_f s + 1)^n is multiplied out in double precision, so its pole is only nearly multiple. Circles
around all its poles are not affected. Only the coefficients come from the program under test.
The script fails if a check fails.  Run: python oracles/make_mrdp_loops.py
"""

from delay_loop_series import reference, stored
from problems import store

DIGITS = 110


def solve(case):
    values, line = reference(case, DIGITS)
    return stored(case, values, DIGITS, sources=("setpoint", "load")), line


if __name__ == "__main__":
    store(__file__, DIGITS, solve)
