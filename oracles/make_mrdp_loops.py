"""Make mrdp_loops.json: step responses of loops tuned by pidalab.rules.mrdp, right to 110 digits.

The loops are PID with derivatives up to order m behind a filter of order n, for an integrator with dead time, with
the prefilter that cancels m + 1 (or p) dominant poles.  The rule takes no care of stability, so some of them
diverge.  Series, inversion and checks are those of make_delay_loops.py with more digits:

  * nodes are doubled (and digits added) until all values agree to 1e-117 * max(1, |value|);
  * every third time is computed again by fixed Talbot on each term alone, raising the degree until two degrees and
    the stored values agree to 1e-112 * max(1, |value|).

The filter 1/(T_f s + 1)^n is multiplied out in double precision, so its pole is only nearly multiple.  Circles around
all of its poles do not notice, and by the same token the series need not know how the loop was designed: only the
coefficients come from the program under test.
The script fails if a check fails.  Run: python oracles/make_mrdp_loops.py
"""

from delay_loop_series import reference, stored
from problems import store

DIGITS = 110


def solve(case):
    """Return the case with its values, and a line of evidence."""
    values, line = reference(case, DIGITS)
    return stored(case, values, DIGITS, sources=("setpoint", "load")), line


if __name__ == "__main__":
    store(__file__, DIGITS, solve)
