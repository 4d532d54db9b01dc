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
The script fails if a check fails.  Run: python tests/oracle/make_mrdp_loops.py
"""

from pathlib import Path

from delay_loop_cases import loop, rational
from delay_loop_values import reference, stored, write

import pidalab

DIGITS = 110
UNIT, PAPER = {"gain": 1.0, "delay": 1.0}, {"gain": 0.01, "delay": 5.0}  # the latter as in huba2018
# In dead times, some aligned. Just after a multiple, as at 1.004, the fast filter alone acts; many of the responses
# that diverge do so in bursts a fraction of a dead time after the multiples, with little in between.
TIMES = [0, 0.3, 0.77, 1, 1.004, 1.37, 2, 2.05, 2.6, 3, 3.3, 4.7, 5, 6.21, 8, 9.2, 11.5, 13, 16.3, 20]
DENSE = [k / 8 for k in range(161)]

STABLE, UNSTABLE = False, True
DESIGNS = [  # model, m, n, te, cancelled, diverges
    (UNIT, 1, 2, 0.005, 2, STABLE),
    (UNIT, 1, 1, 0.02, 2, STABLE),
    (UNIT, 1, 6, 0.05, 2, STABLE),
    (UNIT, 2, 2, 0.06, 3, STABLE),
    (UNIT, 2, 3, 0.02, 3, UNSTABLE),
    (UNIT, 2, 4, 0.2, 3, STABLE),
    (UNIT, 3, 3, 0.2, 4, STABLE),
    (UNIT, 3, 4, 0.1, 4, UNSTABLE),
    (UNIT, 3, 4, 0.4, 2, STABLE),
    (UNIT, 3, 6, 0.5, 4, STABLE),
    (UNIT, 4, 4, 0.25, 5, UNSTABLE),
    (UNIT, 4, 5, 0.2, 5, UNSTABLE),
    (UNIT, 4, 5, 0.05, 5, UNSTABLE),
    (UNIT, 4, 6, 0.5, 5, STABLE),
    (PAPER, 2, 4, 0.2, 3, UNSTABLE),
]


def mrdp_case(model, m, n, te, cancelled, diverges):
    """The loop as the rule designs it; its doubles are the problem."""
    delay, design = model["delay"], {"m": m, "n": n, "te": te, "cancelled": cancelled}
    blocks = pidalab.rules.mrdp.tune(pidalab.ipdt(**model), **design).loop().blocks
    kind = "unstable" if diverges else "stable"
    return loop(
        f"mrdp_m{m}_n{n}_te{te}_delay{delay:g}_p{cancelled}",
        f"{model['gain']:g}/s e^{{-{delay:g}s}}, m = {m}, n = {n}, T_e = {te}, {cancelled} poles cancelled, {kind}",
        rational(*blocks["process"]),
        rational(*blocks["controller"]),
        delay,
        [x * delay for x in TIMES],
        prefilter=rational(*blocks["prefilter"]),
        model=model,
        design=design,
        **({"envelope_times": [x * delay for x in DENSE]} if diverges else {}),
    )


def solve(case):
    """The case with its values, and a line of evidence."""
    values, line = reference(case, DIGITS)
    return stored(case, values, DIGITS, sources=("setpoint", "load")), line


if __name__ == "__main__":
    cases = [mrdp_case(*design) for design in DESIGNS]
    write(Path(__file__).with_name("mrdp_loops.json"), __file__, solve, cases, DIGITS)
