"""Compute the least IAE as a function of the limit of noise (the frontier), for PI, PID, PIDA and a higher derivative.

The study writes two tables in book/data, in the units of `own_units`. It continues interrupted tables:

* ``frontier.csv``: thirteen plants of all kinds, controllers of orders 0 to 3;
* ``acceleration_map.csv``: PID and PIDA on second-order plants of three dampings and on three equal lags, all
  with dead time.

Run ``python studies/frontier.py frontier map --workers 2``, or without names for both. ``--ms 2`` sets another Ms.
"""

from __future__ import annotations

import argparse
import os
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # threads do not help with small matrices

import numpy as np
from own_units import COLUMNS, optimum, resume

import pidalab
from pidalab import Process

MS = 1.4
NOISE = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2)  # limits of the relative noise gain
SPENT = (0.1, 0.3, 1.0, 3.0)  # limits for the map
PLANTS: dict[str, Process] = {
    "lag-dominated": pidalab.fopdt(1.0, 20.0, 1.0),
    "lag-dominated, two lags": Process([1.0], np.convolve([10.0, 1.0], [1.0, 1.0]), 0.2),
    "balanced, one lag": pidalab.fopdt(1.0, 1.0, 1.0),
    "balanced, two lags": pidalab.lags(2, delay=1.0),
    "balanced, three lags": pidalab.lags(3, delay=1.0),
    "delay-dominated": pidalab.fopdt(1.0, 0.2, 1.0),
    "integrating": pidalab.ipdt(1.0, delay=1.0),
    "integrating with a lag": Process([1.0], [1.0, 1.0, 0.0], 0.5),
    "four lags": pidalab.lags(4),
    "eight lags": pidalab.lags(8),
    "spread lags": Process([1.0], np.poly([-1.0, -2.0, -4.0, -8.0]) / 64.0),
    "oscillating": pidalab.sopdt(1.0, 1.0, 0.3, 0.5),
    "inverse response": Process([-1.0, 1.0], pidalab.lags(3).den),
}
DAMPINGS = (0.4, 1.0, 2.0)
DELAYS = (0.1, 0.25, 0.5, 1.0, 2.0, 5.0)  # divided by the time constant of the second-order plant


def over_noise(
    name: str, order: int, ms: float, process: Process, limits: tuple[float, ...]
) -> list[dict[str, Any]]:
    """Return the rows of one curve."""
    return [optimum(name, process, order, ms, noise) for noise in limits]


def mapped() -> dict[str, Process]:
    """Return the plants of the map."""
    pairs = {
        f"sopdt damping={damping:g} delay={delay:g}": pidalab.sopdt(1.0, 1.0, damping, delay)
        for damping in DAMPINGS
        for delay in DELAYS
    }
    delayed = {f"lags3 delay={delay:g}": pidalab.lags(3, delay=delay) for delay in DELAYS}
    return pairs | delayed


def main(tables: list[str], ms: float, workers: int | None) -> None:
    """Continue the tables."""
    key = ("plant", "order", "ms_limit")
    if "frontier" in tables:
        curves = [(name, order, ms, process, NOISE) for name, process in PLANTS.items() for order in range(4)]
        resume("frontier.csv", COLUMNS, curves, key, over_noise, workers)
    if "map" in tables:
        pairs = [(name, order, ms, process, SPENT) for name, process in mapped().items() for order in (1, 2)]
        resume("acceleration_map.csv", COLUMNS, pairs, key, over_noise, workers)


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("tables", nargs="*", default=["frontier", "map"])
    arguments.add_argument("--ms", type=float, default=MS)
    arguments.add_argument("--workers", type=int)
    np.seterr(all="ignore")
    main(**vars(arguments.parse_args()))
