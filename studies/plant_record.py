"""Write book/data/plant_record.csv: a step test as a historian stores it, of a plant that is known.

Semicolons and decimal commas, a clock that does not start at 0, irregular samples, a gap, missing values, a doublet,
noise and quantisation. The valve goes from 40 to 47 per cent after 37 seconds.
"""

from pathlib import Path

import numpy as np

import pidalab

FILE = Path(__file__).resolve().parents[1] / "book" / "data" / "plant_record.csv"
TRUE = pidalab.Process([2.3], np.polymul(np.polymul([20.0, 1.0], [6.0, 1.0]), [3.0, 1.0]), 8.0)


def text(seed: int = 0) -> str:
    """Return the file, with other samples and other noise for each seed."""
    rng, fine = np.random.default_rng(seed), np.linspace(0.0, 400.0, 8001)
    t = 1000.0 + np.cumsum(rng.uniform(0.6, 1.4, 330))
    t = t[(t < 1150.0) | (t > 1162.0)]
    stepped = t[0] + 37.0
    rise = np.interp(t - stepped, fine, pidalab.open_loop_step(TRUE, fine).y, left=0.0)
    y = 310.0 + 7.0 * rise + rng.normal(0.0, 0.08, t.size)
    y = np.round(y / 0.05) * 0.05
    u = np.where(t < stepped, 40, 47)
    rows = [f"{a:.2f};{b};{c:.2f}" for a, b, c in zip(t, u, y, strict=True)]
    for missing in (50, 51, 200):
        rows[missing] = rows[missing].rpartition(";")[0] + ";"
    rows.insert(100, rows[99])
    return "\n".join(["time;valve;temperature", *rows]).replace(".", ",") + "\n"


if __name__ == "__main__":
    FILE.write_text(text(), encoding="utf-8")
