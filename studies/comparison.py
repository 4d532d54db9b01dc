"""Every rule of the library on the 134 processes of Åström and Hägglund, as it comes and at equal terms.

Three tables in book/data, each resumed where it stopped:

* ``processes.csv``: the plants and those of the frontier, their ultimate gain and period, normalised dead time and
  roll-off;
* ``comparison.csv``: a row for each plant, rule and terms; a rule that does not apply is a row with its message;
* ``optima.csv``: the best PI, PID and PIDA of each plant at the same terms.

``python studies/comparison.py rules optima --workers 2``; without names all three. On one core the rules take a quarter
of an hour, the optima half an hour.
"""

from __future__ import annotations

import argparse
import math
import os
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the matrices are small

import numpy as np
from frontier import PLANTS, mapped
from own_units import COLUMNS, SAMPLES, Units, least_robust, one_line, optimum, resume, units
from processes import batch

from pidalab import Process
from pidalab.comparison import at_equal_terms, designs, first_horizon
from pidalab.comparison.judging import Row, measure_row
from pidalab.rules import Design
from pidalab.rules.registry import Limits
from pidalab.rules.starting_models import StartingModels

MS = 1.4
TERMS = {"quiet": 0.3, "loud": 1.5}  # noise gains in ultimate gains: about two and ten times what a PI makes
FASTER = 2.0  # another Ms, for the optima alone
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
    """A plant and what it is like."""
    own = units(process)
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
    """Every rule on one plant: its own design, then at equal terms."""
    own = units(process)
    rows, known, horizon = [], {}, first_horizon(process)
    for rule, kind, make in designs(process, Limits(MS, TERMS["loud"] * own.gain, own.sample_time)):
        if rule == "optimal":
            continue
        about = {"plant": name, "rule": rule, "kind": kind}
        row = measure_row(rule, kind, make, process, own.sample_time, horizon)
        rows.append(about | {"terms": "own"} | measures(row, process, own))
        if row.design is not None:
            # at equal terms two rules with the same proportions are the same controller
            same = proportions(row.design)
            if same not in known:
                known[same] = at_all_terms(row.design, process, own)
            rows += [about | scaled for scaled in known[same]]
    return rows


def proportions(design: Design) -> tuple[float, ...]:
    """Gains over the largest of them."""
    gains = np.trim_zeros(
        np.array(getattr(design.controller, "coefficients", None) or design.controller.gains()), "b"
    )
    return tuple(float(f"{gain:.9g}") for gain in gains / np.max(np.abs(gains)))


def at_all_terms(design: Design, process: Process, own: Units) -> list[dict[str, Any]]:
    """The proportions of a design at the Ms and the noise of all others, the loud terms first."""
    rows: list[dict[str, Any]] = []
    for terms, noise in sorted(TERMS.items(), key=lambda pair: -pair[1]):
        # a filter as short as the sample stays so where less noise is allowed and not made
        if rows and rows[-1].get("filter_time") == 1 / SAMPLES and rows[-1]["noise_gain"] <= noise:
            rows.append(rows[-1] | {"terms": terms})
        else:
            rows.append({"terms": terms} | fair(design, noise, process, own))
    return rows


def measures(row: Row, process: Process, own: Units, off: bool = True) -> dict[str, Any]:
    """What was measured, in the plant's units, perhaps with plants that are off; what could not be had stays away."""
    if not row.applies or row.design is None:
        return {"reason": row.reason}
    found = {
        "iae_load": row.iae_load * own.gain / own.period,
        "iae_setpoint": row.iae_setpoint / own.period,
        "ms": row.ms,
        "mks": row.mks / own.gain,
        "noise_gain": row.noise_gain / own.gain,
        "tv": row.tv,
        "delay_margin": row.delay_margin / own.period,
    }
    known = {key: value for key, value in found.items() if not math.isnan(value)}
    reasons = [row.reason]
    if off:
        try:
            known |= least_robust(row.design.loop(process), process, own)
        except (ValueError, ArithmeticError) as refusal:
            reasons.append(f"plants that are off: {one_line(refusal)}")
    return known | {"reason": "; ".join(filter(None, reasons))}


def fair(design: Design, noise: float, process: Process, own: Units) -> dict[str, Any]:
    """A design at equal terms, measured; its prefilter is gone, so that its set-point response says nothing."""
    try:
        made = at_equal_terms(design, process, MS, noise * own.gain, own.sample_time)
        row = measure_row("", "", lambda: made, process, own.sample_time, first_horizon(process))
        known = measures(row, process, own, off=noise == TERMS["loud"])
    except (ValueError, ArithmeticError) as refusal:
        return {"reason": one_line(refusal)}
    known.pop("iae_setpoint", None)
    return known | {"factor": made.factor, "filter_time": round(made.controller.filter_time / own.period, 12)}


def optima_rows(name: str, ms: float, process: Process) -> list[dict[str, Any]]:
    """The best of each kind at all terms."""
    return [optimum(name, process, order, ms, noise) for order in range(3) for noise in TERMS.values()]


def main(tables: list[str], workers: int | None) -> None:
    """Go on with the tables."""
    cases = list(batch())[::-1]  # those with hardly a lag take longest, and are the first of the batch
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
        tasks = [(case.name, ms, case.process) for ms in (MS, FASTER) for case in cases]
        resume("optima.csv", COLUMNS, tasks, ("plant", "ms_limit"), optima_rows, workers)


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("tables", nargs="*", default=["processes", "rules", "optima"])
    arguments.add_argument("--workers", type=int)
    np.seterr(all="ignore")
    main(**vars(arguments.parse_args()))
