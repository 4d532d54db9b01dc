"""Time and error of the exact engine beside python-control with a Padé approximation, in one run.

Errors are taken at the times of the high-precision oracle (tests/oracle), relative to max(1, |y|). Times are medians of
several runs; since machines differ, quote the ratios.
"""

from __future__ import annotations

import json
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import control
import numpy as np

import pidalab

ORACLE = Path(__file__).parents[1] / "tests" / "oracle" / "delay_loops.json"
POINTS = 10_001
REPEATS = 7


def median_time(task: Callable[[], object]) -> float:
    """Return the median duration in seconds after one run that does not count."""
    task()
    durations = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        task()
        durations.append(time.perf_counter() - start)
    return statistics.median(durations)


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


def exact_loop(case: dict) -> pidalab.Loop:
    """Return the same loop for the exact engine."""
    output_filter = case["output_filter"]
    return pidalab.Loop(
        pidalab.Process(case["process"]["num"], case["process"]["den"], case["delay"]),
        control.tf(case["controller"]["num"], case["controller"]["den"]),
        control.tf(output_filter["num"], output_filter["den"]) if output_filter else None,
    )


def error(t: np.ndarray, y: np.ndarray, case: dict) -> float:
    """Return the largest error at those oracle times that lie on the grid, relative to max(1, |y|)."""
    worst = 0.0
    for at, text in zip(case["times"], case["values"]["setpoint"]["y"], strict=True):
        i = round(at / t[-1] * (t.size - 1))
        if i < t.size and abs(t[i] - at) < 1e-12 * t[-1]:
            worst = max(worst, abs(y[i] - float(text)) / max(1.0, abs(float(text))))
    return worst


def main() -> None:
    """Print one table for each loop."""
    cases = {case["name"]: case for case in json.loads(ORACLE.read_text())["cases"]}
    for name in ("third_order_pida", "ten_states", "twelve_states"):
        case = cases[name]
        t = np.linspace(0, 20 * case["delay"], POINTS)
        loop, approximation = exact_loop(case), pade_loop(case, 10)
        own = median_time(lambda loop=loop, t=t: pidalab.step_response(loop, t))
        print(f"\n{name}: {case['note']}; {POINTS} points over 20 dead times")
        print(f"{'':34}{'time, ms':>10}{'ratio':>8}{'error':>10}")
        y = pidalab.step_response(loop, t).y
        print(f"{'pidalab, exact':34}{1e3 * own:10.1f}{1.0:8.1f}{error(t, y, case):10.0e}")
        peer = median_time(lambda a=approximation, t=t: control.step_response(a, t))
        y = control.step_response(approximation, t).outputs
        print(f"{'python-control, Padé order 10':34}{1e3 * peer:10.1f}{peer / own:8.1f}{error(t, y, case):10.0e}")


if __name__ == "__main__":
    main()
