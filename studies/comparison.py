"""Evaluate every rule of the library on the 134 processes of Åström and Hägglund, as published and at equal terms.

Equal terms are equal limits of Ms and noise.

The study writes three tables of the package, which `pidalab.benchmark` reads. It continues interrupted tables:

* ``processes.csv``: these plants and those of the frontier, with ultimate gain and period, normalised dead time and
  roll-off;
* ``comparison.csv``: a row for each plant, rule and terms, with the message if the rule does not apply;
* ``optima.csv``: the best PI, PID and PIDA of each plant at the same terms.

Run ``python studies/comparison.py rules optima --workers 2``, or without names for all three. On one core the rules
take a quarter of an hour and the optima half an hour.
"""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Callable
from functools import cache
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # threads do not help with small matrices

import numpy as np
from frontier import PLANTS, mapped
from own_units import COLUMNS, least_robust, optimum, resume

from pidalab import NoiseScale, Process, noise_scale
from pidalab.comparison import at_equal_terms, designs
from pidalab.comparison.benchmarking import EQUAL_MS, NOISE, judge
from pidalab.comparison.judging import one_line
from pidalab.comparison.plants import batch
from pidalab.requirements import Requirements
from pidalab.rules import Design
from pidalab.rules.models import StartingModels

FASTER = 2.0  # a second Ms, used only for the optima
PROCESS = (
    "plant",
    "family",
    "num",
    "den",
    "delay",
    "ultimate_gain",
    "ultimate_period",
    "dead_time",
    "rolloff",
)
MEASURES = (
    "iae_load",
    "iae_setpoint",
    "ms",
    "mks",
    "noise_gain",
    "tv",
    "delay_margin",
    "ms_worst",
    "iae_least_robust",
)
RULES = ("plant", "rule", "kind", "terms", *MEASURES, "factor", "filter_time", "reason")


def process_row(name: str, family: str, process: Process) -> list[dict[str, Any]]:
    """Return a plant and its properties."""
    own = noise_scale(process)
    w = 2 * math.pi / own.period
    size = [math.log(abs(process(1j * w * factor))) for factor in (0.999, 1.001)]
    model = StartingModels(process).reaction
    lag = math.inf if model.den[-1] == 0 else float(model.den[0] / model.den[-1])
    return [
        {
            "plant": name,
            "family": family,
            "num": " ".join(f"{c:.12g}" for c in process.num),
            "den": " ".join(f"{c:.12g}" for c in process.den),
            "delay": process.delay,
            "ultimate_gain": own.gain,
            "ultimate_period": own.period,
            "dead_time": model.delay / (model.delay + lag),
            "rolloff": (size[0] - size[1]) / math.log(1.001 / 0.999),
        }
    ]


def rule_rows(name: str, process: Process) -> list[dict[str, Any]]:
    """Return the rows of every rule on one plant, with results on changed plants."""
    own = noise_scale(process)
    rows: list[dict[str, Any]] = []
    for rule, kind, make in designs(
        process, Requirements(ms=EQUAL_MS, noise_gain=NOISE["loud"] * own.gain, sample_time=own.sample_time)
    ):
        if rule == "optimal":
            continue
        made = cache(make)
        for row in judge(rule, kind, made, process, own):
            rows.append({"plant": name} | row | off_the_model(row, made, process, own))
    return rows


def off_the_model(
    row: dict[str, Any], make: Callable[[], Design], process: Process, own: NoiseScale
) -> dict[str, Any]:
    """Return the worst values for changed plants, or nothing for the terms "quiet"."""
    if "ms" not in row or row["terms"] == "quiet":
        return {}
    try:
        design = make()
        if row["terms"] == "loud":
            design = at_equal_terms(design, process, EQUAL_MS, NOISE["loud"] * own.gain, own.sample_time)
        return least_robust(design.loop(process), process, own)
    except (ValueError, ArithmeticError) as refusal:
        return {
            "reason": "; ".join(filter(None, (row["reason"], f"plants that are off: {one_line(refusal)}")))
        }


def optima_rows(name: str, ms: float, process: Process) -> list[dict[str, Any]]:
    """Return the optima of each kind at all limits of noise."""
    return [optimum(name, process, order, ms, noise) for order in range(3) for noise in NOISE.values()]


def main(tables: list[str], workers: int | None) -> None:
    """Continue the tables."""
    cases = list(batch())[::-1]  # the first plants have short lags, take longest, and start last
    if "processes" in tables:
        plants = [(case.name, case.family, case.process) for case in cases[::-1]]
        plants += [(name, "frontier", process) for name, process in PLANTS.items()]
        plants += [(name, "map", process) for name, process in mapped().items()]
        resume("processes.csv", PROCESS, plants, ("plant",), process_row, workers)
    if "rules" in tables:
        resume(
            "comparison.csv",
            RULES,
            [(case.name, case.process) for case in cases],
            ("plant",),
            rule_rows,
            workers,
        )
    if "optima" in tables:
        tasks = [(case.name, ms, case.process) for ms in (EQUAL_MS, FASTER) for case in cases]
        resume("optima.csv", COLUMNS, tasks, ("plant", "ms_limit"), optima_rows, workers)


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("tables", nargs="*", default=["processes", "rules", "optima"])
    arguments.add_argument("--workers", type=int)
    np.seterr(all="ignore")
    main(**vars(arguments.parse_args()))
