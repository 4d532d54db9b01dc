"""Draw the figure of the README: PIDA against PID on Example 1 of haalman2024, Ms = 2."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import pidalab
from pidalab import plots
from pidalab.rules import haalman

TARGET = Path(__file__).resolve().parents[1] / "book" / "_static" / "responses.svg"


def main() -> None:
    """Write the figure on white, so that it can be read in dark mode too."""
    plots.use_book_style()
    book = pidalab.ledger.Ledger.open("haalman2024", TARGET.parents[1] / "ledger")
    t, process = np.linspace(0, 20, 2001), pidalab.lags(4)
    model = pidalab.identification.three_point(t, pidalab.open_loop_step(process, t).y).process
    a2, a1, delay = (book.printed(f"ex1.sopdt.{key}") for key in ("a2", "a1", "delay"))
    second = pidalab.Process([1.0], [a2, a1, 1.0], delay)
    designs = {"PIDA": (model, haalman.pida(model, 2.0)), "PID": (second, haalman.pid(second, 2.0))}
    noise, clean, noisy = pidalab.uniform_noise(t, 0.1, seed=0), {}, {}
    for label, (design_model, C) in designs.items():
        loop = pidalab.Loop(process, C, haalman.output_filter(design_model, C).transfer_function())
        for runs, n in ((clean, 0.0), (noisy, noise)):
            runs[label] = {
                "setpoint": pidalab.simulate(loop, t, setpoint=1.0, noise=n),
                "load": pidalab.simulate(loop, t, load=1.0, noise=n),
            }
    plots.comparison(clean, noisy, until=20, u_until=4)
    plt.savefig(TARGET, facecolor="white", metadata={"Date": None, "Creator": None})


if __name__ == "__main__":
    main()
