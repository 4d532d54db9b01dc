"""Make the example record of the chapter vrancic2021: a step of a heater, simulated with a seed.

Run it from the root of the project; it writes book/data/step_record.csv. Nothing in the record was measured.
"""

import numpy as np

import pidalab

PLANT = pidalab.Process(
    [1.8], np.poly([-1 / 20, -1 / 8, -1 / 5]) * 800, delay=4.0
)  # 20 s, 8 s, 5 s; 1.8 K per %
SAMPLE, LENGTH, STEP_AT, NOISE, SEED = 0.2, 400.0, 20.0, 0.003, 1340
HEAD = """\
# Simulated, not measured: a heater steps from 30 % to 40 %, the temperature is read every 0.2 s.
# Written by studies/step_record.py; noise of standard deviation 0.003 degC, rounded to 0.001 degC.
"""


def main() -> None:
    """Simulate the record and write it."""
    t = SAMPLE * np.arange(round(LENGTH / SAMPLE) + 1)
    u = np.where(t < STEP_AT, 30.0, 40.0)
    run = pidalab.simulate(pidalab.Loop(PLANT, 0.0), t, load=u - 30.0)
    y = 52.3 + run.y + NOISE * np.random.default_rng(SEED).normal(size=t.size)
    with open("book/data/step_record.csv", "w", encoding="utf-8") as file:
        file.write(HEAD + "t,u,y\n")
        file.writelines(f"{a:g},{b:g},{c:.3f}\n" for a, b, c in zip(t, u, y, strict=True))


if __name__ == "__main__":
    main()
