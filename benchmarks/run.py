"""Time and error of the exact engine beside python-control with a Padé approximation, in one run.

Errors are taken at the times of the high-precision oracle (tests/oracle), relative to max(1, |y|). Times are medians of
several runs, CPU times of one thread; since machines differ, quote the ratios. `benchmarks.dead_time` and
`benchmarks.portraits` follow.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import control
import numpy as np

import pidalab
from benchmarks import dead_time, portraits
from benchmarks.measure import case_loop, error, median_time, oracle_cases

POINTS = (501, 2_001, 10_001)
LOOPS = ("third_order_pida", "ten_states", "twelve_states")
MANY = 2_000


def pade_loop(case: dict, order: int) -> control.StateSpace:
    """Close the loop with python-control, its dead time replaced by a Padé approximation."""
    return control.feedback(pade_chain(case, order), 1)


def pade_chain(case: dict, order: int) -> control.StateSpace:
    """Open loop with python-control, its dead time replaced by a Padé approximation."""
    blocks = [
        control.tf(case[name]["num"], case[name]["den"]) for name in ("process", "controller") if case[name]
    ]
    if case["output_filter"]:
        blocks.append(control.tf(case["output_filter"]["num"], case["output_filter"]["den"]))
    blocks.append(control.tf(*control.pade(case["delay"], order)))
    chain = control.ss(blocks[0])
    for block in blocks[1:]:
        chain = chain * control.ss(block)
    return chain


def responses(case: dict) -> None:
    """Print times and errors of a step response, for several numbers of points."""
    loop, approximation = case_loop(case), pade_loop(case, 10)
    print(f"\n{case['name']}: {case['note']}; step response over 20 dead times")
    print(f"{'':34}{'points':>8}{'time, ms':>10}{'ratio':>8}{'error':>10}")
    for points in POINTS:
        t = np.linspace(0, 20 * case["delay"], points)
        own = median_time(lambda t=t: pidalab.step_response(loop, t))
        peer = median_time(lambda t=t: control.step_response(approximation, t))
        y, other = pidalab.step_response(loop, t).y, control.step_response(approximation, t).outputs
        for name, seconds, values in (
            ("pidalab, exact", own, y),
            ("python-control, Padé order 10", peer, other),
        ):
            print(
                f"{name:34}{points:8}{1e3 * seconds:10.2f}{seconds / own:8.1f}{error(t, values, case):10.0e}"
            )


def margins(case: dict) -> None:
    """Print times of the margins; those of python-control are gain and phase margin and the peak distance from -1."""
    loop, chain = case_loop(case), pade_chain(case, 10)
    own, peak = (median_time(lambda f=f: f(loop)) for f in (pidalab.margins, pidalab.max_sensitivity))
    peer = median_time(lambda: control.stability_margins(chain))
    print(f"{case['name']:34}{1e3 * own:12.2f}{1e3 * peak:12.2f}{1e3 * peer:16.2f}{peer / own:8.1f}")


def together(case: dict) -> None:
    """Print times for thousands of loops in one call, by the clock: all processors work."""
    process, t = case_loop(case).process, np.linspace(0, 20 * case["delay"], 2_001)
    gains = np.linspace(0.5, 1.3, MANY)
    loops = [pidalab.Loop(process, pidalab.PIDA(kp, 3.37, 0.938, 0.269)) for kp in gains]
    tasks: dict[str, Callable[[], object]] = {
        f"simulate_many, {t.size} points": lambda: pidalab.simulate_many(loops, t, load=1.0),
        "margins_many": lambda: pidalab.margins_many(loops),
    }
    for name, task in tasks.items():
        start = time.perf_counter()
        task()
        seconds = time.perf_counter() - start
        print(f"{name:34}{MANY:8} loops{seconds:8.2f} s on the clock{1e3 * seconds / MANY:8.3f} ms a loop")


def main() -> None:
    """Print one table for each question."""
    cases = {case["name"]: case for case in oracle_cases("delay_loops.json")}
    for name in LOOPS:
        responses(cases[name])
    print(f"\n{'margins':34}{'pidalab, ms':>12}{'Ms only':>12}{'Padé 10, ms':>16}{'ratio':>8}")
    for name in LOOPS:
        margins(cases[name])
    print()
    together(cases["third_order_pida"])
    dead_time.main()
    portraits.main()


if __name__ == "__main__":
    main()
