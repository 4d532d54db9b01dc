"""Compare `pidalab.optimal.load` with a second, independent optimiser on twenty plants.

The second optimiser shares only the exact simulation with `pidalab.optimal.load`. It uses no gradients, no grid of
filter times and no transforms. The range of filter times is divided into bands. In each band, differential evolution
evaluates hundreds of controllers, with limits on a dense grid of frequencies and the error of the simulated loop. The
simplex method then refines the best controller of each band, with a free filter time.

Each plant is a row of book/data/optimal_check.csv. Existing rows are not computed again. A plant takes a minute on an
idle core. Plants may be named: ``python studies/optimal_check.py lags3 ipdt``. With ``own`` as the only name, only
`pidalab.optimal.load` is run again on all plants of the table.
"""

from __future__ import annotations

import csv
import math
import os
import sys
import warnings
from itertools import pairwise
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # threads do not help with small matrices

import numpy as np
from scipy.optimize import NonlinearConstraint, differential_evolution, minimize
from tqdm import tqdm

import pidalab
from pidalab import HighOrderPID, Loop, Process

RESULTS = Path(__file__).parents[1] / "book" / "data" / "optimal_check.csv"
COLUMNS = ("plant", "order", "ms", "mks", "iae", "iae_second", "ratio", "bands", "evaluations")
ORDER, MS = 2, 1.4
BANDS = np.log([0.002, 0.01, 0.03, 0.08, 0.2, 0.6])  # edges of bands of filter times, in units of the process
LOW, HIGH = (
    np.log([0.005, 0.02, 1e-3, 1e-5]),
    np.log([5.0, 20.0, 10.0, 5.0]),
)  # gains, in units of the process
MEMBERS, GENERATIONS = 8, 40  # of each differential evolution: members per unknown, generations
SIMPLEX = 600  # evaluations of the refinement from the best controller of each band
PENALTY = 100.0  # relative increase of the IAE per relative violation of a limit
PLANTS: dict[str, tuple[Process, float]] = {  # each process has its limit of |C S|
    "lags2": (pidalab.lags(2, delay=0.5), 20.0),
    "lags3": (pidalab.lags(3, delay=1.0), 20.0),
    "lags3_quiet": (pidalab.lags(3, delay=1.0), 5.0),
    "lags4": (pidalab.lags(4), 20.0),
    "lags8": (pidalab.lags(8), 10.0),
    "fopdt_balanced": (pidalab.fopdt(1.0, 1.0, 1.0), 10.0),
    "fopdt_delay": (pidalab.fopdt(1.0, 0.2, 1.0), 5.0),
    "fopdt_lag": (pidalab.fopdt(1.0, 20.0, 1.0), 100.0),
    "sopdt_damped": (pidalab.sopdt(1.0, 1.0, 1.5, 0.5), 20.0),
    "sopdt_light": (pidalab.sopdt(1.0, 1.0, 0.4, 0.5), 20.0),
    "ipdt": (pidalab.ipdt(1.0, 1.0), 5.0),
    "integrating_lag": (Process([1.0], [1.0, 1.0, 0.0], 0.5), 10.0),
    "two_lags_slow": (Process([1.0], np.convolve([10.0, 1.0], [1.0, 1.0]), 0.5), 50.0),
    "inverse": (Process([-0.5, 1.0], pidalab.lags(3).den), 10.0),
    "inverse_strong": (Process([-1.1, 1.0], pidalab.lags(3).den), 5.0),
    "spread": (Process([1.0], np.poly([-1.0, -2.0, -4.0, -8.0]) / 64.0), 30.0),
    "p4_6": (pidalab.lags(6), 10.0),
    "p9": (Process([1.0], np.convolve([1.0, 1.0], [0.25, 0.7, 1.0])), 30.0),
    "lead": (Process([0.5, 1.0], pidalab.lags(3).den, 0.5), 10.0),
    "pure_delay_like": (pidalab.lags(2, lag=0.1, delay=1.0), 4.0),
}


class Judge:
    """IAE of a load step, with a penalty for violated limits and a count of evaluations."""

    def __init__(self, process: Process, mks: float, order: int = ORDER) -> None:
        self.process, self.mks, self.order, self.asked = process, mks, order, 0
        corners = np.abs(np.concatenate([np.roots(process.den), np.roots(process.num)]))
        self.time = float(process.delay + np.sum(1 / corners[corners > 0]))
        self.t = np.linspace(0.0, 40.0 * self.time, 1201)
        self.s = 1j * np.geomspace(1e-2, 1e4, 1500) / self.time
        self.gain = abs(process(1j / self.time))

    def loop(self, z: np.ndarray) -> Loop:
        """Return the loop for logarithms of gains and filter time, in units of the process."""
        units = self.time ** np.arange(-1.0, self.order + 1) / self.gain
        return Loop(
            self.process,
            HighOrderPID((np.exp(z[:-1]) * units).tolist(), self.time * math.exp(z[-1]), self.order + 1),
        )

    def peaks(self, z: np.ndarray) -> np.ndarray:
        """Return the peaks of |S| and |C S| divided by their limits, or 2 for an unstable loop within both limits."""
        self.asked += 1
        loop = self.loop(z)
        sensitivity = loop.S(self.s)
        loud = np.abs(loop.block("controller", self.s) * sensitivity).max()
        found = np.array([np.abs(sensitivity).max() / MS, loud / self.mks])
        return found if found.max() > 1 or self.stable(loop) else np.full(2, 2.0)

    @staticmethod
    def stable(loop: Loop) -> bool:
        """Return True if a loop is stable. Return False also if its phase turns too often to be tracked."""
        try:
            return pidalab.is_stable(loop)
        except ArithmeticError:
            return False

    def error(self, z: np.ndarray) -> float:
        """Return the IAE of a step of the load."""
        return pidalab.load_response(self.loop(z), self.t).iae()

    def priced(self, z: np.ndarray) -> float:
        """Return the IAE with a penalty for violated limits, for the simplex method."""
        if np.max(np.abs(z)) > 20.0:
            return 1e12
        missed = float(np.maximum(self.peaks(z) - 1, 0.0).sum())
        if not self.stable(self.loop(z)):
            return 1e6 * self.time / self.gain * (1 + missed)
        return self.error(z) * (1 + PENALTY * missed)


def second(process: Process, mks: float, seed: int) -> tuple[float, int]:
    """Return the least IAE of the second optimiser within all limits, and its number of evaluations."""
    judge, least = Judge(process, mks), math.inf
    kept = NonlinearConstraint(judge.peaks, 0.0, 1.0)
    for band, (low, high) in enumerate(pairwise(BANDS)):
        bounds = [*zip(LOW, HIGH, strict=True), (low, high)]
        with warnings.catch_warnings(action="ignore", category=UserWarning):  # if no member keeps the limits
            x = differential_evolution(
                judge.error, bounds, constraints=kept, popsize=MEMBERS, maxiter=GENERATIONS, init="sobol",
                polish=False, tol=0.0, rng=10 * seed + band,
            ).x  # fmt: skip
        for _ in range(2):  # restart, since the simplex may have shrunk too early
            options = {"maxfev": SIMPLEX // 2, "fatol": 1e-7, "adaptive": True}
            x = minimize(judge.priced, x, method="Nelder-Mead", options=options).x
        loop = judge.loop(x)
        if judge.stable(loop) and pidalab.max_sensitivity(loop)[0] <= MS * (1 + 1e-3):
            least = min(least, pidalab.load_response(loop, np.linspace(0.0, 200.0 * judge.time, 8001)).iae())
    return least, judge.asked


def rows() -> list[dict]:
    """Read the rows that are already in the table."""
    if not RESULTS.exists():
        return []
    with RESULTS.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def store(found: list[dict]) -> None:
    """Write the table in the order of the plants, with the last row for each plant."""
    last = {row["plant"]: row for row in found}
    found = [last[name] for name in PLANTS if name in last]
    with RESULTS.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(found)


def own(name: str) -> float:
    """Return the least IAE that `pidalab.optimal.load` finds for a plant."""
    process, mks = PLANTS[name]
    return float(pidalab.optimal.load(process, ORDER, ms=MS, mks=mks).iae)


def compared(line: dict, iae: float, least: float) -> dict:
    """Return a line of the table with the results of both optimisers."""
    return line | {"iae": f"{iae:.6g}", "iae_second": f"{least:.6g}", "ratio": f"{iae / least:.5f}"}


def main(names: list[str]) -> None:
    """Compute the plants that are not in the file yet."""
    if names == ["own"]:
        old = tqdm(rows(), unit="plant")
        store([compared(o, own(o["plant"]), float(o["iae_second"])) for o in old])
        return
    unknown = [name for name in names if name not in PLANTS]
    if unknown:
        raise SystemExit(f"no such plant: {', '.join(unknown)}; there are {', '.join(PLANTS)}")
    done = {one["plant"] for one in rows()}
    for name in tqdm([name for name in names or PLANTS if name not in done], unit="plant"):
        least, asked = second(*PLANTS[name], seed=list(PLANTS).index(name))
        blank = dict(
            zip(COLUMNS, (name, ORDER, MS, PLANTS[name][1], "", "", "", len(BANDS) - 1, asked), strict=True)
        )
        store([*rows(), compared(blank, own(name), least)])


if __name__ == "__main__":
    main(sys.argv[1:])
