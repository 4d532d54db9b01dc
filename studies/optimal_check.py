"""`pidalab.optimal.load` beside a second, independent optimiser on twenty plants.

The second one shares nothing with the first but the exact engine: no gradients, no ladder, no transforms. It draws
hundreds of random starts, takes the simplex method a little way from each and to the end from the best ones, with a
price on limits that are missed, judged on a dense grid of frequencies. Its results are those of simulated loops.

Each plant is a row of book/data/optimal_check.csv, written as soon as it is done; what is there is not computed again.
Plants can be named: ``python studies/optimal_check.py lags3 ipdt``. One takes half a minute on a quiet core.
"""

from __future__ import annotations

import csv
import math
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the matrices are small

import numpy as np
from scipy.optimize import minimize
from tqdm import tqdm

import pidalab
from pidalab import HighOrderPID, Loop, Process

RESULTS = Path(__file__).parents[1] / "book" / "data" / "optimal_check.csv"
COLUMNS = ("plant", "order", "ms", "mks", "iae", "iae_second", "ratio", "starts", "evaluations")
ORDER, MS = 2, 1.4
STARTS, SHORT = 200, 60  # random starts, and evaluations of each
BEST, LONG = 8, 600  # those that are followed to the end, and evaluations of each
PRICE = 100.0  # of a missed limit, as a share of the IAE
PLANTS: dict[str, tuple[Process, float]] = {  # with the limit of |C S|
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
    """IAE of a load step, with a price on what a loop must not do; counts how often it is asked."""

    def __init__(self, process: Process, mks: float) -> None:
        self.process, self.mks, self.asked = process, mks, 0
        corners = np.abs(np.concatenate([np.roots(process.den), np.roots(process.num)]))
        self.time = float(process.delay + np.sum(1 / corners[corners > 0]))
        self.t = np.linspace(0.0, 40.0 * self.time, 1201)
        self.s = 1j * np.geomspace(1e-2, 1e4, 1500) / self.time
        self.gain = abs(process(1j / self.time))

    def loop(self, z: np.ndarray) -> Loop:
        """The loop of logarithms of gains and filter time, in units of the process."""
        units = self.time ** np.arange(-1.0, ORDER + 1) / self.gain
        return Loop(
            self.process,
            HighOrderPID((np.exp(z[:-1]) * units).tolist(), self.time * math.exp(z[-1]), ORDER + 1),
        )

    def __call__(self, z: np.ndarray) -> float:
        """The value to make small."""
        self.asked += 1
        if np.max(np.abs(z)) > 20.0:
            return 1e12
        loop = self.loop(z)
        sensitivity = loop.S(self.s)
        peak, loud = np.abs(sensitivity).max(), np.abs(loop.block("controller", self.s) * sensitivity).max()
        missed = max(0.0, peak / MS - 1) + max(0.0, loud / self.mks - 1)
        try:
            stable = pidalab.is_stable(loop)
        except ArithmeticError:  # it turns too often to be followed
            stable = False
        if not stable:
            return 1e6 * self.time / self.gain * (1 + missed)
        return pidalab.load_response(loop, self.t).iae() * (1 + PRICE * missed)


def second(process: Process, mks: float, seed: int) -> tuple[float, int]:
    """Least IAE that the second optimiser finds with all limits kept, and how often it looked."""
    judge, rng = Judge(process, mks), np.random.default_rng(seed)
    found = []
    low, high = np.log([0.01, 0.05, 0.01, 1e-4, 0.002]), np.log([2.0, 5.0, 3.0, 2.0, 0.5])
    for _ in range(STARTS):
        start = rng.uniform(low, high)
        run = minimize(judge, start, method="Nelder-Mead", options={"maxfev": SHORT, "adaptive": True})
        found.append((float(run.fun), run.x))
    least = math.inf
    for _, start in sorted(found, key=lambda pair: pair[0])[:BEST]:
        x = start
        for _ in range(2):  # a simplex that has shrunk is set up anew
            run = minimize(
                judge, x, method="Nelder-Mead", options={"maxfev": LONG // 2, "fatol": 1e-7, "adaptive": True}
            )
            x = run.x
        loop = judge.loop(x)
        if pidalab.is_stable(loop) and pidalab.max_sensitivity(loop)[0] <= MS * (1 + 1e-3):
            least = min(least, pidalab.load_response(loop, np.linspace(0.0, 200.0 * judge.time, 8001)).iae())
    return least, judge.asked


def main(names: list[str]) -> None:
    """Go through the plants that are not in the file yet."""
    unknown = [name for name in names if name not in PLANTS]
    if unknown:
        raise SystemExit(f"no such plant: {', '.join(unknown)}; there are {', '.join(PLANTS)}")
    done = set()
    if RESULTS.exists():
        with RESULTS.open() as file:
            done = {row["plant"] for row in csv.DictReader(file)}
    for name in tqdm([name for name in names or PLANTS if name not in done], unit="plant"):
        process, mks = PLANTS[name]
        own = pidalab.optimal.load(process, ORDER, ms=MS, mks=mks)
        least, asked = second(process, mks, seed=list(PLANTS).index(name))
        row = (
            name,
            ORDER,
            MS,
            mks,
            f"{own.iae:.6g}",
            f"{least:.6g}",
            f"{own.iae / least:.5f}",
            STARTS,
            asked,
        )
        with RESULTS.open("a", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            if not done and file.tell() == 0:
                writer.writerow(COLUMNS)
            writer.writerow(row)


if __name__ == "__main__":
    main(sys.argv[1:])
