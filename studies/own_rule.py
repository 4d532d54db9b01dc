"""A rule from the optima: explicit gains and filter for PID and PIDA, fitted on half of the plants, judged on the rest.

In units of the ultimate gain Ku and period Pu each gain and the filter time is

    exp(a + b rolloff + c dead_time) * noise^d ,

with the roll-off of the plant at its ultimate frequency, the normalised dead time of its reaction curve and the noise
gain that is allowed, over Ku. The constants are those of least squares in the logarithms, over the optima of every
other plant of each family at Ms 1.4; nothing is chosen after the rest was seen. Two tables in book/data:
``own_rule_constants.csv`` and ``own_rule.csv``, which judges the rule as it comes and at equal terms. Half a minute.
"""

from __future__ import annotations

import csv
import math
import os
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the matrices are small

import numpy as np
from own_units import DATA, load_iae, written
from tqdm import tqdm

import pidalab
from pidalab import HighOrderPID, NoiseScale, Process, noise_scale
from pidalab.comparison import at_equal_terms
from pidalab.comparison.benchmarking import TABLES
from pidalab.comparison.judging import one_line
from pidalab.comparison.plants import batch
from pidalab.rules import Design

MS = 1.4
KINDS = {1: "PID", 2: "PIDA"}
CONSTANTS = ("a", "b", "c", "d")
JUDGED = (
    "plant",
    "half",
    "kind",
    "noise_limit",
    "ms",
    "noise_gain",
    "over_best",
    "over_best_at_equal_terms",
    "reason",
)


def read(name: str) -> list[dict[str, str]]:
    """Rows of a table."""
    path = TABLES / f"{name}.csv"
    with (path if path.exists() else DATA / path.name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def halves() -> dict[str, str]:
    """Every other plant of a family is fitted."""
    seen: dict[str, int] = {}
    out = {}
    for case in batch():
        seen[case.family] = seen.get(case.family, 0) + 1
        out[case.name] = "fitted" if seen[case.family] % 2 else "judged"
    return out


def features(plant: dict[str, str], noise: float) -> list[float]:
    """What the logarithm of a parameter is linear in."""
    return [1.0, float(plant["rolloff"]), float(plant["dead_time"]), math.log(noise)]


def parameters(order: int) -> list[str]:
    """Columns of the gains and the filter time."""
    return [*(f"k{k}" for k in range(-1, order + 1)), "filter_time"]


def fitted(
    rows: list[dict[str, str]], plants: dict[str, dict[str, str]], order: int
) -> dict[str, np.ndarray]:
    """Constants of each parameter."""
    found = {}
    for name in parameters(order):
        known = [row for row in rows if float(row[name]) > 0]
        left = np.array([features(plants[row["plant"]], float(row["noise_limit"])) for row in known])
        right = np.log([float(row[name]) for row in known])
        found[name] = np.linalg.lstsq(left, right, rcond=None)[0]
    return found


def controller(
    constants: dict[str, np.ndarray], plant: dict[str, str], noise: float, own: NoiseScale
) -> HighOrderPID:
    """The rule."""
    x = np.array(features(plant, noise))
    *gains, time = (math.exp(constants[name] @ x) for name in constants)
    scaled = [gain * own.gain * own.period**k for k, gain in enumerate(gains, start=-1)]
    return HighOrderPID(scaled, max(time * own.period, own.sample_time), len(gains) - 1)


def judged(process: Process, made: HighOrderPID, noise: float, best: float) -> dict[str, Any]:
    """The rule on one plant, as it comes and at equal terms, over the least IAE of its kind."""
    own = noise_scale(process)
    unit, loop = own.period / own.gain, pidalab.Loop(process, made)
    out: dict[str, Any] = {}
    try:
        if pidalab.is_stable(loop):
            out["ms"] = pidalab.max_sensitivity(loop)[0]
            out["noise_gain"] = pidalab.noise_gain(loop, own.sample_time) / own.gain
            out["over_best"] = load_iae(loop, own) / unit / best
        scaled = at_equal_terms(Design(process, made), process, MS, noise * own.gain, own.sample_time)
        out["over_best_at_equal_terms"] = load_iae(scaled.loop(), own) / unit / best
    except (ValueError, ArithmeticError) as refusal:
        out["reason"] = one_line(refusal)
    return out


def store(name: str, columns: tuple[str, ...], rows: list[dict[str, Any]]) -> None:
    """Write a table anew."""
    with (DATA / f"{name}.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows({key: written(value) for key, value in row.items()} for row in rows)


def main() -> None:
    """Fit, judge, store."""
    plants, half = {row["plant"]: row for row in read("processes")}, halves()
    processes = {case.name: case.process for case in batch()}
    constants, out = [], []
    for order, kind in KINDS.items():
        best = [row for row in read("optima") if row["iae"] and float(row["ms_limit"]) == MS]
        best = [row for row in best if int(row["order"]) == order]
        found = fitted([row for row in best if half[row["plant"]] == "fitted"], plants, order)
        constants += [
            {"kind": kind, "parameter": name} | dict(zip(CONSTANTS, value.tolist(), strict=True))
            for name, value in found.items()
        ]
        for row in tqdm(best, desc=kind):
            process, noise = processes[row["plant"]], float(row["noise_limit"])
            made = controller(found, plants[row["plant"]], noise, noise_scale(process))
            about = {"plant": row["plant"], "half": half[row["plant"]], "kind": kind, "noise_limit": noise}
            out.append(about | judged(process, made, noise, float(row["iae"])))
    store("own_rule_constants", ("kind", "parameter", *CONSTANTS), constants)
    store("own_rule", JUDGED, out)


if __name__ == "__main__":
    main()
