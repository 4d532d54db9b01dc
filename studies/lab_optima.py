"""Find the optima from which the search of the lab starts, and optima for its test.

For each plant of the lab, book/_static/lab/optima.js contains the PI, PID and PIDA with the least IAE after a step of
the load, within the limits below. tests/lab/least_iae.csv contains the least IAE for 100 random plants, orders and
limits. The study takes ten minutes.
"""

import csv
import json
from pathlib import Path

import numpy as np
from py_mini_racer import MiniRacer

import pidalab
from pidalab import optimal

ROOT = Path(__file__).resolve().parents[1]
LAB = ROOT / "book" / "_static" / "lab"
RANDOM = 100  # number of plants for the test
MS, NOISE = 1.4, 1.5  # largest Ms and largest relative noise gain
HEAD = """/* Where the search of the lab starts: the least IAE that `pidalab.optimal.load` found for each plant of
   the lab with PI, PID and PIDA, with Ms at most {ms:g} and a relative noise gain of at most
   {noise:g}. A design is kp, ti, td, ta, as far as it has them, and its filter time.
   Written by studies/lab_optima.py. */
globalThis.pidalabOptima = """


def plants() -> dict[str, pidalab.Process]:
    """Return the plants of the lab."""
    context = MiniRacer()
    context.eval("\n".join((LAB / f"{name}.js").read_text(encoding="utf-8") for name in ("engine", "model")))
    found = json.loads(context.eval("JSON.stringify(pidalabModel.PLANTS)"))
    return {key: pidalab.Process(p["num"], p["den"], p["delay"]) for key, p in found.items()}


def least_iae(process: pidalab.Process, order: int, ms: float, noise: float) -> pidalab.rules.Design:
    """Return the optimum for a largest Ms and a largest relative noise gain."""
    scale = pidalab.noise_scale(process)
    return optimal.load(process, order, ms=ms, noise_gain=noise * scale.gain, sample_time=scale.sample_time)


def best(process: pidalab.Process, order: int) -> list[float]:
    """Return kp, ti, td and ta (as far as the order has them), and the filter time of an optimum."""
    controller = least_iae(process, order, MS, NOISE).controller
    ki, kp, *derivatives = controller.coefficients
    values = [kp, kp / ki, *(gain / kp for gain in derivatives), controller.filter_time]
    return [float(f"{value:.4g}") for value in values]


def random_plant(rng: np.random.Generator) -> tuple[str, list[float], list[float], float]:
    """Return structure, numerator, denominator and dead time of a plant, with four digits."""

    def times(count: int, low: float, high: float) -> np.ndarray:
        return 10 ** rng.uniform(low, high, count)

    gain = 10 ** rng.uniform(-1, 1)
    delay = 10 ** rng.uniform(-1, 0.7) if rng.random() < 0.85 else 0.0
    kinds = {
        "lags": lambda: ([gain], np.poly(-1 / times(int(rng.integers(2, 5)), -0.7, 0.7)), delay),
        "first order": lambda: ([gain], [10 ** rng.uniform(-0.5, 1), 1.0], max(delay, 0.1)),
        "oscillating": lambda: ([gain], [1.0, 2 * rng.uniform(0.1, 0.9), 1.0], delay or 0.3),
        "integrating": lambda: (
            [gain],
            np.append(np.poly(-1 / times(int(rng.integers(0, 3)), -0.7, 0.5)), 0.0),
            delay or 0.5,
        ),
        "inverse": lambda: ([-gain * rng.uniform(0.2, 1.5), gain], np.poly(-1 / times(3, -0.5, 0.5)), delay),
        "zero": lambda: ([gain * rng.uniform(0.3, 3), gain], np.poly(-1 / times(3, -0.5, 0.7)), delay),
    }
    name = list(kinds)[int(rng.integers(len(kinds)))]
    num, den, delay = kinds[name]()
    return name, *([float(f"{x:.4g}") for x in values] for values in (num, den)), float(f"{delay:.4g}")


def random_optima() -> list[list[object]]:
    """Return the rows of the plants, the limits and the least IAE."""
    rng, rows = np.random.default_rng(36), []
    for _ in range(RANDOM):
        name, num, den, delay = random_plant(rng)
        order = int(rng.integers(0, 3))
        ms, noise = float(rng.choice([1.3, 1.4, 1.6, 2.0])), float(rng.choice([0.3, 0.7, 1.5, 4.0]))
        process = pidalab.Process(num, den, delay)
        try:
            iae = least_iae(process, order, ms, noise).iae
        except ValueError:  # no controller of this order keeps both limits
            continue
        rows.append(
            [name, " ".join(map(str, num)), " ".join(map(str, den)), delay, order, ms, noise, f"{iae:.6g}"]
        )
    return rows


def main() -> None:
    """Find all optima and write the files."""
    designs = {key: [best(process, order) for order in range(3)] for key, process in plants().items()}
    lines = ",\n".join(f'  "{key}": {json.dumps(each)}' for key, each in designs.items())
    text = f"{HEAD.format(ms=MS, noise=NOISE)}{{ noise: {NOISE:g}, designs: {{\n{lines}\n}} }};\n"
    (LAB / "optima.js").write_text(text, encoding="utf-8")
    with (ROOT / "tests" / "lab" / "least_iae.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["plant", "num", "den", "delay", "order", "ms", "noise", "iae"])
        writer.writerows(random_optima())


if __name__ == "__main__":
    main()
