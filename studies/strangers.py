"""Tune on step tests of random plants whose shapes no model of the library has. Evaluate the designs on the plants.

These aims were set before the first run. Refused records count only for the last aim.

* no loop is unstable;
* the true sampled Ms is at most 2.0 for 97 % of the designs, and at most the reported worst Ms for 95 %;
* the reported worst Ms is always finite;
* at most 15 % of the records are refused.

Run ``python studies/strangers.py --seed 1`` from the root of the project. It writes book/data/strangers.csv. It
continues an interrupted table, and starts again if the seed changes. It takes a quarter of an hour on one core.
"""

from __future__ import annotations

import argparse
import csv
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

import pidalab
from pidalab import Loop, Process

OUT = Path("book/data/strangers.csv")
SHAPES = ("unequal lags", "zero left", "zero right", "light damping", "long dead time", "integrator")
KINDS = ("PI", "PID", "PIDA")
FAULTS = ("none", "none", "drift", "sticking valve", "changing gain")
DRAWN = ("seed", "number", "shape", "fault", "kind", "noise")
FOUND = ("model", "ms_true", "ms_worst", "price", "refusal")
STUCK = 0.15  # largest error of a sticking valve, as a share of the step
CHANGE = 0.3  # relative change of the gain from the beginning to the end of the step
DRIFT = 0.05  # largest drift over the record, as a share of the response


def plant(shape: str, rng: np.random.Generator) -> tuple[Process, float]:
    """Draw a plant of a shape, with a gain of 1. Return the plant and the sum of its times."""
    times = np.exp(rng.uniform(np.log(0.1), 0.0, size=rng.integers(2, 6)))
    delay = times.sum() * rng.uniform(0.05, 0.5)
    num, den = np.ones(1), np.prod(times) * np.poly(-1 / times)
    if shape == "zero left":
        num = np.array([times.max() * rng.uniform(0.2, 1.5), 1.0])
    elif shape == "zero right":
        num = np.array([-times.max() * rng.uniform(0.1, 1.0), 1.0])
    elif shape == "light damping":
        tau = times.sum()
        den = np.convolve([tau**2, 2 * rng.uniform(0.15, 0.6) * tau, 1.0], [times.min(), 1.0])
    elif shape == "long dead time":
        delay = times.sum() * rng.uniform(1.0, 4.0)
    elif shape == "integrator":
        den = np.append(den, 0.0)
    scale = 10.0 ** rng.uniform(0.0, 2.0)
    scaled = [side * scale ** np.arange(side.size - 1.0, -1.0, -1.0) for side in (num, den)]
    gain = scale if shape == "integrator" else 1.0
    return Process(scaled[0] * gain, scaled[1], delay * scale), (times.sum() + delay) * scale


def experiment(
    process: Process, total: float, fault: str, rng: np.random.Generator
) -> tuple[Any, list[Process]]:
    """Simulate a step, a pulse or two steps. Return the record, its noise, and the plant at both ends of the step."""
    h = total / rng.uniform(15.0, 40.0)
    integrates = process.den[-1] == 0
    rest, step = total * rng.uniform(0.5, 2.0), 10.0 ** rng.uniform(-1.0, 2.0)
    held = total * rng.uniform(2.0, 4.0) if integrates else total * rng.uniform(4.0, 8.0)
    t = h * np.arange(round((rest + 2 * held) / h))
    second = 0.0 if integrates else rng.choice([0.0, 0.5, 1.0])  # a pulse, two steps or one long step
    u = np.select([t < rest, t < rest + held], [0.0, 1.0], second)
    moved = u.copy()
    if fault == "sticking valve":  # the valve follows only beyond its play
        play = rng.uniform(0.05, STUCK)
        for k in range(1, t.size):
            moved[k] = np.clip(moved[k - 1], u[k] - play, u[k] + play)
    gain = 10.0 ** rng.uniform(-1.0, 1.0) * rng.choice([-1.0, 1.0])
    slopes = [1.0]
    if fault == "changing gain":
        moved = moved + 0.5 * CHANGE * moved**2
        slopes = [1.0, 1.0 + CHANGE]
    y = pidalab.simulate(Loop(process, 0.0), t, load=moved).y
    answer = float(np.ptp(y))
    y = y + answer * (rng.uniform(0.0, DRIFT) * rng.choice([-1, 1]) * t / t[-1] if fault == "drift" else 0.0)
    noise = 10.0 ** rng.uniform(-3.0, -1.5)
    y = y + noise * answer * rng.normal(size=t.size)
    quantum = answer * rng.choice([0.0, 0.002, 0.01])
    y = np.round(y / quantum) * quantum if quantum else y
    record = pidalab.Record(t, 40.0 + step * u, 20.0 + gain * step * y)
    return (record, noise), [
        Process(process.num * gain * slope, process.den, process.delay) for slope in slopes
    ]


def ms(loop: Loop) -> float:
    """Return Ms of the sampled loop. It is infinite if the loop is unstable."""
    return pidalab.max_sensitivity(loop)[0] if pidalab.is_stable(loop) else np.inf


def judged(seed: int, number: int) -> dict[str, Any]:
    """Tune on the record of a plant. Return the row of the table."""
    rng = np.random.default_rng([seed, number])
    shape, kind = SHAPES[number % len(SHAPES)], KINDS[number // len(SHAPES) % len(KINDS)]
    fault = FAULTS[int(rng.integers(len(FAULTS)))]
    process, total = plant(shape, rng)
    (record, noise), plants = experiment(process, total, fault, rng)
    row = dict(zip(DRAWN, (seed, number, shape, fault, kind, f"{noise:.2g}"), strict=True))
    try:
        fit = pidalab.identification.fit(record)
        row["model"] = fit.model
        design = pidalab.tune(fit, kind, sample_time=record.sampling)
    except ValueError as refusal:
        return row | {"refusal": " ".join(str(refusal).split())}
    code = design.controller.discretise(record.sampling, "backward", design.output_filter)
    true = max(ms(Loop(true_plant, code)) for true_plant in plants)
    return row | {
        "ms_true": f"{true:.3f}",
        "ms_worst": f"{design.ms_worst:.3f}",
        "price": f"{design.price:.2f}",
    }


def main() -> None:
    """Evaluate the plants that are not in the table yet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--count", type=int, default=200)
    given = parser.parse_args()
    rows = list(csv.DictReader(OUT.open(encoding="utf-8"))) if OUT.exists() else []
    rows = [row for row in rows if row["seed"] == str(given.seed)]
    missing = range(len(rows), given.count)
    with OUT.open("w", encoding="utf-8", newline="") as file, ProcessPoolExecutor(2) as pool:
        table = csv.DictWriter(file, DRAWN + FOUND, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
        file.flush()
        for row in pool.map(judged, [given.seed] * len(missing), missing):
            table.writerow(row)
            file.flush()


if __name__ == "__main__":
    main()
