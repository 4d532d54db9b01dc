"""Write the two example records: a step of a heater, and a step test as a historian stores it.

`book/data/step_record.csv` is the record of the chapter vrancic2021. `book/data/plant_record.csv` has semicolons and
decimal commas, a clock that does not start at 0, irregular samples, a gap, missing values, two samples of the same
time, noise and quantisation. Both records are simulated.
"""

from pathlib import Path

import numpy as np

import pidalab

DATA = Path(__file__).resolve().parents[1] / "book" / "data"
HEATER = pidalab.Process(
    [1.8], np.poly([-1 / 20, -1 / 8, -1 / 5]) * 800, delay=4.0
)  # 20 s, 8 s, 5 s; 1.8 K per %
SAMPLE, LENGTH, STEP_AT, NOISE, SEED = 0.2, 400.0, 20.0, 0.003, 1340
PLANT = pidalab.Process([2.3], np.polymul(np.polymul([20.0, 1.0], [6.0, 1.0]), [3.0, 1.0]), 8.0)
HEAD = """\
# Simulated, not measured: a heater steps from 30 % to 40 %, the temperature is read every 0.2 s.
# Written by studies/records.py; noise of standard deviation 0.003 degC, rounded to 0.001 degC.
"""


def step_record() -> str:
    """Return the record of the heater."""
    t = SAMPLE * np.arange(round(LENGTH / SAMPLE) + 1)
    u = np.where(t < STEP_AT, 30.0, 40.0)
    run = pidalab.simulate(pidalab.Loop(HEATER, 0.0), t, load=u - 30.0)
    y = 52.3 + run.y + NOISE * np.random.default_rng(SEED).normal(size=t.size)
    rows = (f"{a:g},{b:g},{c:.3f}\n" for a, b, c in zip(t, u, y, strict=True))
    return "".join([HEAD, "t,u,y\n", *rows])


def plant_record(seed: int = 0) -> str:
    """Return the file of the historian as text. `seed` sets the noise."""
    rng, fine = np.random.default_rng(seed), np.linspace(0.0, 400.0, 8001)
    t = 1000.0 + np.cumsum(rng.uniform(0.6, 1.4, 330))
    t = t[(t < 1150.0) | (t > 1162.0)]
    stepped = t[0] + 37.0
    rise = np.interp(t - stepped, fine, pidalab.open_loop_step(PLANT, fine).y, left=0.0)
    y = 310.0 + 7.0 * rise + rng.normal(0.0, 0.08, t.size)
    y = np.round(y / 0.05) * 0.05
    u = np.where(t < stepped, 40, 47)
    rows = [f"{a:.2f};{b};{c:.2f}" for a, b, c in zip(t, u, y, strict=True)]
    for missing in (50, 51, 200):
        rows[missing] = rows[missing].rpartition(";")[0] + ";"
    rows.insert(100, rows[99])
    return "\n".join(["time;valve;temperature", *rows]).replace(".", ",") + "\n"


if __name__ == "__main__":
    for record in (step_record, plant_record):
        (DATA / f"{record.__name__}.csv").write_text(record(), encoding="utf-8")
