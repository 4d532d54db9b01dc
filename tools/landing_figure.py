"""Draw the figure of the first page and write its caption: what acceleration buys, and what it costs.

One plant; the PI, PID and PIDA controllers with the least IAE for a load at the same maximum sensitivity, whose largest
gain from measurement noise to the control signal is at most that of the limit. The caption's numbers are computed here.
"""

import importlib.util
import re
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import pidalab
from pidalab import plots

BOOK = Path(__file__).resolve().parents[1] / "book"
MS, MKS, NOISE = 1.4, 20.0, 0.01
KINDS = {"PI": 0, "PID": 1, "PIDA": 2}
MARKS = re.compile(r"<!-- landing -->.*?<!-- /landing -->", re.DOTALL)
ALT = (
    "Two panels over time. Above, the output after a step of the load: the PIDA loop deviates least and returns first, "
    "then PID, then PI. Below, the control signal with measurement noise: PI is smooth, PID and PIDA are noisy."
)


def designs(process: pidalab.Process) -> dict[str, pidalab.Design]:
    """Return the optima by kind; a PI needs no limit for noise."""
    return {
        kind: pidalab.optimal.load(process, order, ms=MS, mks=MKS if order else None)
        for kind, order in KINDS.items()
    }


def draw(made: dict[str, pidalab.Design]) -> plt.Figure:
    """Draw output without noise above, control signal with noise below."""
    plots.use_book_style()
    t = np.linspace(0.0, 25.0, 2501)
    noise = pidalab.uniform_noise(t, NOISE, seed=1, hold=0.05)
    figure, axes = plt.subplots(2, 1, figsize=(4.8, 3.9), sharex=True)
    for kind, design in made.items():
        axes[0].plot(t, pidalab.load_response(design.loop(), t).y, label=kind)
        axes[1].plot(*plots.thin(t, pidalab.simulate(design.loop(), t, load=1.0, noise=noise).u, 900), lw=1.2)
    axes[0].set_ylabel("output y")
    axes[1].set(ylabel="control u, with noise", xlabel="time after a step of the load")
    axes[0].legend()
    return figure


def caption(made: dict[str, pidalab.Design]) -> str:
    """Say in words what the figure shows, with the numbers of the designs."""
    iae, mks = ({kind: getattr(design, name) for kind, design in made.items()} for name in ("iae", "mks"))
    won = 100 * (1 - iae["PIDA"] / iae["PID"])
    return (
        f"The best PI, PID and PIDA controllers for $e^{{-s}}/(s+1)^3$ at the same robustness, $M_s = {MS}$. After a "
        f"step of the load the integral of the absolute error is {iae['PI']:.2f} with PI, {iae['PID']:.2f} with PID "
        f"and {iae['PIDA']:.2f} with PIDA: at the same limit for noise, a largest gain of {MKS:g} from measurement "
        f"noise to the control signal, acceleration takes away {won:.0f} % of what PID leaves. The price of both is "
        f"noise: the PI's gain is {mks['PI']:.1f}. Where less noise is allowed, less is won."
    )


def markdown(made: dict[str, pidalab.Design]) -> str:
    """Return the part of the first page between its marks."""
    images = "\n\n".join(
        f"```{{image}} _static/landing{end}.svg\n:alt: {ALT}\n:class: only-{theme} landing\n```"
        for theme, end in (("light", ""), ("dark", "-dark"))
    )
    return f"<!-- landing -->\n\n{images}\n\n{caption(made)}\n\n<!-- /landing -->"


def main() -> None:
    """Write both images and the words."""
    made = designs(pidalab.lags(3, delay=1.0))
    target = BOOK / "_static" / "landing.svg"
    draw(made).savefig(target, metadata={"Date": None, "Creator": None})
    spec = importlib.util.spec_from_file_location("figures_for_dark", BOOK / "_ext" / "figures_for_dark.py")
    twins = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(twins)
    dark = twins.darkened(target.read_text(encoding="utf-8"))
    target.with_name("landing-dark.svg").write_text(dark, encoding="utf-8")
    page = BOOK / "intro.md"
    page.write_text(MARKS.sub(lambda _: markdown(made), page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
