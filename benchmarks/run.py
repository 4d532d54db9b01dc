"""Compare times and errors of pidalab with those of other libraries, and write tables to book/data.

Times are medians of several runs, and CPU times of one thread unless a row is about all processors. Since machines
differ, quote the ratios. ``python -m benchmarks.run`` takes about six minutes on an idle machine.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterable, Iterator

import numpy as np
from scipy.optimize import NonlinearConstraint, OptimizeResult, differential_evolution

import pidalab
from benchmarks import dead_time, loops, portraits
from benchmarks.measure import median_time, write
from studies.optimal_check import BANDS, HIGH, LOW, MEMBERS, MS, PLANTS, Judge

RESULTS = "speed_comparison"  # name of the table in book/data


# The optimal controller is compared with SciPy's differential evolution, which uses pidalab's responses and poles.
NAMES = ("lags3", "fopdt_balanced", "ipdt")
ORDERS = (0, 1, 2)
EQUAL = 1.01
CAP = 30.0  # seconds of CPU time for one search
SEED = 1


def evolution(judge: Judge, goal: float) -> tuple[float, float]:
    """Return CPU time and least IAE of a search that ends at the goal or at a time limit."""
    bounds = [*zip(LOW[: judge.order + 2], HIGH[: judge.order + 2], strict=True), (BANDS[0], BANDS[-1])]
    kept, best = NonlinearConstraint(judge.peaks, 0.0, 1.0), np.inf
    start = time.process_time()

    def done(intermediate_result: OptimizeResult) -> None:
        nonlocal best
        if judge.peaks(intermediate_result.x).max() <= 1:
            best = min(best, judge.error(intermediate_result.x))
        if best <= goal or time.process_time() - start > CAP:
            raise StopIteration

    with warnings.catch_warnings(action="ignore", category=UserWarning):  # if no member keeps the limits yet
        differential_evolution(
            judge.error, bounds, constraints=kept, popsize=MEMBERS, maxiter=10**6, init="sobol",
            polish=False, tol=0.0, rng=SEED, callback=done,
        )  # fmt: skip
    return time.process_time() - start, best


def optima() -> Iterator[dict]:
    """Yield time and IAE of both methods. The error of differential evolution is the relative excess of its IAE."""
    for name in NAMES:
        process, mks = PLANTS[name]
        for order in ORDERS:
            judge = Judge(process, mks, order)
            own = median_time(lambda m=order, p=process, k=mks: pidalab.optimal.load(p, m, ms=MS, mks=k), 3)
            design = pidalab.optimal.load(process, order, ms=MS, mks=mks)
            iae = pidalab.load_response(design.loop(process), judge.t).iae()
            seconds, best = evolution(judge, EQUAL * iae)
            same = {"quantity": "optimum", "loop": name, "value": order}
            yield same | {"method": "pidalab", "seconds": own, "ratio": 1.0, "error": 0.0, "note": ""}
            yield same | {
                "method": "differential evolution",
                "seconds": seconds,
                "ratio": seconds / own,
                "error": best / iae - 1,
                "note": "" if best <= EQUAL * iae else "time is up",
            }


def shown(rows: Iterable[dict]) -> Iterator[dict]:
    """Print rows and return them."""
    last = None
    for row in rows:
        if (head := (row["quantity"], row["loop"], row["value"])) != last:
            last = head
            print(f"\n{head[0]}: {head[1]} {head[2]}")
        numbers = f"{'':31}"
        if row["seconds"]:
            numbers = f"{1e3 * row['seconds']:12.2f} ms{row['ratio']:8.2f}{row['error']:8.0e}"
        print(f"    {row['method']:24}{numbers}  {row['note']}", flush=True)
        yield row


def main() -> None:
    """Run all comparisons, print the results and write them."""
    parts = (loops.responses, loops.margins, loops.scaling, optima)
    write(RESULTS, loops.COLUMNS, [row for part in parts for row in shown(part())])
    dead_time.main()
    portraits.main()


if __name__ == "__main__":
    main()
