"""Measure responses and margins of a few loops, and the effect of horizon, dead time and order on time.

`responses`, `margins` and `scaling` return rows of the table that the book reads. The column `value` is the varied
quantity.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import reduce

import control
import mpmath
import numpy as np

import pidalab
from benchmarks import peers
from benchmarks.measure import again, case_loop, error, limit, median_time, oracle_cases
from pidalab.rules import classical

COLUMNS = ("quantity", "loop", "value", "method", "seconds", "ratio", "error", "note")
Rows = Iterator[dict]

METHODS: dict[str, tuple[Callable[..., peers.Task], object]] = {
    "pidalab": (peers.exact, None),
    "python-control, Padé 3": (peers.pade, 3),
    "python-control, Padé 10": (peers.pade, 10),
    "Runge–Kutta 4, numba": (peers.runge_kutta, None),
    "JiTCDDE": (peers.jitcdde, 1e-7),
}
DELAYS = 20  # horizon of a response, in dead times
EACH = (25, 100, 500)  # numbers of points in a dead time
LOOPS = ("third_order_pida", "ten_states", "twelve_states", "ipdt_pida_stable")
CAP = 30  # seconds of CPU time for one task
HORIZONS = (5, 10, 20, 50, 100, 200, 500)  # in dead times
DEAD_TIMES = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
ORDERS = (1, 2, 3, 4, 6, 8, 10, 12)
FILTER = 0.1  # time constant of the filter of second order
FINE = 16  # steps of the reference in one step of the comparison


def cases() -> dict[str, dict]:
    """Return the oracle's cases by name."""
    return {case["name"]: case for case in oracle_cases("delay_loops.json")}


def with_ratios(rows: list[dict]) -> list[dict]:
    """Add each time divided by the time of pidalab, the first row."""
    own = rows[0]["seconds"]
    return [row | {"ratio": row["seconds"] / own if row["seconds"] else ""} for row in rows]


def all_methods(
    loop: pidalab.Loop, horizon: float, each: int, judge: Callable[[np.ndarray, np.ndarray], float]
) -> list[dict]:
    """Return time and error of a set-point step by every method, on the same grid."""
    rows = []
    for name, (peer, setting) in METHODS.items():
        row = {"method": name, "seconds": "", "error": "", "note": ""}
        arguments = (each,) if peer is peers.runge_kutta else (setting, each)
        try:
            with limit(CAP), np.errstate(all="ignore"):
                task = peer(loop, horizon, *arguments)
                found = judge(*task())
                row |= {"seconds": median_time(task, 3), "error": found}
        except (ValueError, TimeoutError) as reason:
            row["note"] = str(reason)
        rows.append(row)
    return with_ratios(rows)


def responses() -> Rows:
    """Return rows of set-point steps of the loops in `LOOPS`, for several numbers of points."""
    for name in LOOPS:
        case = cases()[name]
        loop = case_loop(case)
        for each in EACH:
            found = all_methods(loop, DELAYS * case["delay"], each, lambda t, y, case=case: error(t, y, case))
            for row in found:
                yield {"quantity": "response", "loop": name, "value": DELAYS * each + 1} | row


def true_margins(loop: pidalab.Loop) -> np.ndarray:
    """Return gain margin, phase margin in degrees and Ms, computed with 30 digits.

    The search starts from pidalab's frequencies. Other tests check that no crossing is missed.
    """
    near = pidalab.margins(loop)
    with mpmath.workdps(30):
        blocks = [loop.blocks[name] for name in ("process", "controller", "output_filter")]

        def value(polynomial: np.ndarray, s: mpmath.mpc) -> mpmath.mpc:
            return reduce(lambda total, c: total * s + c, polynomial.tolist(), mpmath.mpc(0))

        def L(w: mpmath.mpf) -> mpmath.mpc:
            s = mpmath.mpc(0, w)
            ratios = (value(num, s) / value(den, s) for num, den in blocks)
            return mpmath.fprod(ratios) * mpmath.exp(-s * loop.process.delay)

        gm = -1 / L(mpmath.findroot(lambda w: L(w).imag, near.wpc)).real
        crossing = mpmath.findroot(lambda w: abs(L(w)) ** 2 - 1, near.wgc)
        pm = mpmath.degrees(mpmath.arg(-L(crossing)))
        peak = mpmath.findroot(lambda w: mpmath.diff(lambda x: abs(1 + L(x)) ** 2, w), near.wms)
        return np.array([gm, pm, 1 / abs(1 + L(peak))], dtype=float)


def margins() -> Rows:
    """Return rows of gain margin, phase margin and Ms."""
    for name in LOOPS:
        loop = case_loop(cases()[name])
        tasks: dict[str, Callable[[], object]] = {"pidalab": lambda loop=loop: pidalab.margins(again(loop))}
        for order in (3, 10):
            chain = peers.pade_chain(loop, order)
            tasks[f"python-control, Padé {order}"] = lambda chain=chain: control.stability_margins(chain)
        rows, true = [], true_margins(loop)
        for method, task in tasks.items():
            off = np.max(np.abs(three(method, task()) / true - 1))
            rows.append({"method": method, "seconds": median_time(task, 3), "error": float(off)})
        for row in with_ratios(rows):
            yield {"quantity": "margins", "loop": name, "value": "", "note": ""} | row


def three(method: str, found: object) -> np.ndarray:
    """Return gain margin, phase margin and Ms from the result of a method."""
    if method == "pidalab":
        return np.array([found.gm, found.pm, found.ms])
    gm, pm, distance = found[:3]
    return np.array([gm, pm, 1 / distance])


def family(order: int, delay: float) -> pidalab.Loop:
    """Return a loop of lags 1, 0.8, 0.64 …, dead time, and SIMC's PI controller with a filter of order 2."""
    lags = reduce(np.polymul, ([0.8**k, 1.0] for k in range(order)))
    plant = pidalab.Process([1.0], lags, delay)
    pi = classical.simc(plant, "PI").controller
    return pidalab.Loop(plant, pidalab.HighOrderPID([pi.kp / pi.ti, pi.kp], FILTER, 2))


def extrapolated(loop: pidalab.Loop, horizon: float, each: int) -> np.ndarray:
    """Return a reference response by Runge–Kutta with two fine steps and extrapolation."""
    coarse, fine = (peers.runge_kutta(loop, horizon, k * each)()[1][::k] for k in (FINE // 2, FINE))
    return fine + (fine - coarse) / 15


def scaling() -> Rows:
    """Return rows of responses with a longer horizon, with another dead time, and of a higher order."""
    plans = [("horizon", x, family(3, 1.0), float(x), 100) for x in HORIZONS]
    plans += [("dead time", x, family(3, x), 60.0, round(100 * x)) for x in DEAD_TIMES]
    plans += [("order", x, family(x, 1.0), 20.0, 100) for x in ORDERS]
    for quantity, value, loop, horizon, each in plans:
        true = extrapolated(loop, horizon, each)

        def judge(t: np.ndarray, y: np.ndarray, true: np.ndarray = true) -> float:
            worst = np.max(np.abs(y - true) / np.maximum(1, np.abs(true)))
            return float(worst) if math.isfinite(worst) else math.inf

        for row in all_methods(loop, horizon, each, judge):
            yield {"quantity": quantity, "loop": "SIMC PI", "value": value} | row
