"""Time and error of the exact engine beside python-control with a Padé approximation, in one run.

Errors are taken at the times of the high-precision oracle (tests/oracle), relative to max(1, |y|). Times are medians of
several runs, CPU times of one thread; since machines differ, quote the ratios. `benchmarks.dead_time` and
`benchmarks.portraits` follow.
"""

from __future__ import annotations

import control
import numpy as np

import pidalab
from benchmarks import dead_time, portraits
from benchmarks.measure import case_loop, error, median_time, oracle_cases

POINTS = 10_001


def pade_loop(case: dict, order: int) -> control.StateSpace:
    """Close the loop with python-control, its dead time replaced by a Padé approximation."""
    blocks = [control.tf(case[name]["num"], case[name]["den"]) for name in ("process", "controller") if case[name]]
    if case["output_filter"]:
        blocks.append(control.tf(case["output_filter"]["num"], case["output_filter"]["den"]))
    blocks.append(control.tf(*control.pade(case["delay"], order)))
    chain = control.ss(blocks[0])
    for block in blocks[1:]:
        chain = chain * control.ss(block)
    return control.feedback(chain, 1)


def main() -> None:
    """Print one table for each loop."""
    cases = {case["name"]: case for case in oracle_cases("delay_loops.json")}
    for name in ("third_order_pida", "ten_states", "twelve_states"):
        case = cases[name]
        t = np.linspace(0, 20 * case["delay"], POINTS)
        loop, approximation = case_loop(case), pade_loop(case, 10)
        own = median_time(lambda loop=loop, t=t: pidalab.step_response(loop, t))
        print(f"\n{name}: {case['note']}; {POINTS} points over 20 dead times")
        print(f"{'':34}{'time, ms':>10}{'ratio':>8}{'error':>10}")
        y = pidalab.step_response(loop, t).y
        print(f"{'pidalab, exact':34}{1e3 * own:10.1f}{1.0:8.1f}{error(t, y, case):10.0e}")
        peer = median_time(lambda a=approximation, t=t: control.step_response(a, t))
        y = control.step_response(approximation, t).outputs
        print(f"{'python-control, Padé order 10':34}{1e3 * peer:10.1f}{peer / own:8.1f}{error(t, y, case):10.0e}")
    dead_time.main()
    portraits.main()


if __name__ == "__main__":
    main()
