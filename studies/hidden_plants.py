"""Find the best controllers of the hidden plants, and write the file that the page reads. This takes two minutes.

The file is scrambled against accidental reading. This is no protection.
"""

import json
from pathlib import Path

import numpy as np

import pidalab
from pidalab import optimal

FILE = Path(__file__).resolve().parents[1] / "book" / "_static" / "lab" / "hidden-data.js"
MS, NOISE = 1.6, 1.0  # the limits of the page
KEY = b"step first, then look"


def lags(gain: float, *times: float, delay: float, zero: float = 0.0) -> pidalab.Process:
    """Return a plant of real lags and a zero."""
    den = np.ones(1)
    for time in times:
        den = np.convolve(den, [time, 1.0])
    return pidalab.Process([gain * zero, gain] if zero else [gain], den, delay)


PLANTS = {
    "furnace zone": lags(1.8, 240.0, 60.0, 15.0, delay=20.0),
    "flow loop": lags(0.7, 1.3, 0.4, delay=0.6),
    "heat exchanger": lags(-2.4, 32.0, 21.0, 9.0, delay=12.0),
    "tank level": pidalab.Process([0.04], [8.0, 1.0, 0.0], 3.0),
    "distillation tray": lags(0.35, 7.0, 6.0, 5.0, 4.0, delay=2.0),
    "conveyor": lags(1.2, 2.0, 1.0, delay=14.0),
    "boiler drum": lags(0.9, 12.0, 8.0, 4.0, delay=1.0, zero=-5.0),
    "soft drive": pidalab.Process([3.0], np.convolve([0.09, 0.24, 1.0], [0.1, 1.0]), 0.05),
    "pH": lags(5.5, 40.0, 4.0, 4.0, delay=6.0),
    "greenhouse": lags(0.6, 900.0, 300.0, 100.0, delay=60.0),
}


def written(process: pidalab.Process) -> dict[str, object]:
    """Return the plant, its best controller within the limits, and the error with this controller."""
    scale = pidalab.noise_scale(process)
    best = optimal.load(process, 2, ms=MS, noise_gain=NOISE * scale.gain, sample_time=scale.sample_time)
    ki, kp, kd, ka = (float(f"{gain:.6g}") for gain in best.controller.coefficients)
    return {
        "num": process.num.tolist(),
        "den": process.den.tolist(),
        "delay": process.delay,
        "end": float(f"{6 * scale.period:.2g}"),
        "best": {"gains": [ki, kp, kd, ka], "filterTime": float(f"{best.controller.filter_time:.6g}")},
        "iae": float(f"{best.iae:.6g}"),
    }


def scrambled(plant: dict[str, object]) -> str:
    """Scramble the data of a plant."""
    data = json.dumps(plant).encode()
    return bytes(byte ^ KEY[k % len(KEY)] for k, byte in enumerate(data)).hex()


def main() -> None:
    """Write the file."""
    rows = ",\n".join(f'  "{name}": "{scrambled(written(process))}"' for name, process in PLANTS.items())
    head = "/* The hidden plants, scrambled. Written by studies/hidden_plants.py. */\n"
    FILE.write_text(f"{head}globalThis.pidalabHiddenData = {{\n{rows}\n}};\n", encoding="utf-8")


if __name__ == "__main__":
    main()
