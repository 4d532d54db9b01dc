"""Make the figure of the first page, which shows the benefit of acceleration and its cost in noise.

The figure compares the PI, PID and PIDA that have the least IAE after a load step, all for one plant and with the same
maximum sensitivity. The reader sets the limit of the relative noise gain with a slider. Without JavaScript an image is
shown. The caption also gives the median reduction of the IAE by acceleration on the 134 plants of the study *Which
controller?*, for the same maximum sensitivity and two of the noise limits.
"""

import json
import re
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import pidalab
from pidalab import plots

BOOK = Path(__file__).resolve().parents[1] / "book"
sys.path.insert(0, str(BOOK / "across"))
import tables  # noqa: E402  # has the threshold and the medians of the study

PAGE = BOOK / "intro.md"
MS, NOISE, END, SHOWN = 1.4, 0.02, 25.0, 1.5
LIMITS = (0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0)  # of the relative noise gain
ORDERS = {"PI": 0, "PID": 1, "PIDA": 2}
PROCESS = pidalab.lags(3, delay=1.0)
MARKS = re.compile(r"<!-- landing -->.*?<!-- /landing -->", re.DOTALL)
ALT = (
    "Above, the output after a step of the load: the PIDA loop deviates least and returns first, "
    "then PID, then PI. Below, the control signal with measurement noise: PI is smooth, PID and PIDA are noisy."
)


def units() -> tuple[float, float]:
    """Return the ultimate gain of the plant and the sample time of the noise."""
    point = pidalab.rules.classical.ziegler_nichols_ultimate(PROCESS)
    return point.ultimate_gain, point.ultimate_period / 100


def medians() -> dict[str, list[float]]:
    """Return the median reduction of the IAE by acceleration in the study, in per cent."""
    saves = tables.pays().groupby("terms")["saves"].median()
    return {term: [limit, round(100 * saves[term], 1)] for term, limit in tables.NOISE.items()}


def found() -> dict:
    """Search for the optima. Return the data of the page."""
    gain, sample = units()
    state = {"ms": MS, "end": END, "sample": float(f"{sample:.6g}"), "noise": NOISE, "limits": LIMITS}
    for kind, order in ORDERS.items():
        state[kind] = [design(order, limit, gain, sample) for limit in LIMITS]
    return state


def design(order: int, limit: float, gain: float, sample: float) -> list[float]:
    """Return the IAE of the best controller, its gains, and its filter time."""
    best = pidalab.optimal.load(PROCESS, order, ms=MS, noise_gain=limit * gain, sample_time=sample)
    gains = best.controller.coefficients
    return [float(f"{value:.6g}") for value in (best.iae, *gains, best.controller.filter_time)]


def loops(state: dict, k: int) -> dict[str, pidalab.Loop]:
    """Return the loops at one limit of noise."""
    made = {}
    for kind, order in ORDERS.items():
        _, *gains, time = state[kind][k]
        made[kind] = pidalab.Loop(PROCESS, pidalab.HighOrderPID(gains, time, order + 1))
    return made


def draw(state: dict) -> plt.Figure:
    """Draw the output without noise, and below it the control signal with noise."""
    plots.use_book_style()
    t = state["sample"] / 5 * np.arange(round(5 * END / state["sample"]) + 1)
    noise = pidalab.uniform_noise(t, NOISE, seed=1, hold=state["sample"])
    figure, axes = plt.subplots(2, 1, figsize=(6.4, 4.8), sharex=True)
    for kind, loop in loops(state, LIMITS.index(SHOWN)).items():
        axes[0].plot(t, pidalab.load_response(loop, t).y, label=kind)
        u = pidalab.simulate(loop, t, load=1.0, noise=noise).u
        axes[1].plot(*plots.thin(t, u, 900), "-", lw=1.2, label=kind)
    axes[0].set_ylabel("output y")
    axes[1].set(ylabel="control u, with noise", xlabel="time after a step of the load")
    axes[0].legend()
    return figure


def caption(state: dict, many: dict[str, list[float]]) -> str:
    """Return the caption with the numbers of the designs."""

    def saved(limit: float) -> float:
        k = LIMITS.index(limit)
        return 100 * (1 - state["PIDA"][k][0] / state["PID"][k][0])

    def pays(share: float) -> str:
        least = 100 * tables.WORTH
        return "so acceleration pays" if share >= least else f"below the {least:.0f} % at which it pays"

    quiet, loud = (limit for limit, _ in many.values())
    return (
        f"The figure compares the best PI, PID and PIDA controllers for $e^{{-s}}/(s+1)^3$ after a step of the load. "
        f"All have the same robustness, $M_s = {MS}$, and none exceeds the noise limit. At a relative noise gain of "
        f"{quiet:g} acceleration saves {saved(quiet):.0f} % of the PID's IAE on this plant ({pays(saved(quiet))}), and "
        f"{many['quiet'][1]:.0f} % in the median of [134 plants](across/which-controller.ipynb). At a relative noise "
        f"gain of {loud:g} acceleration saves {saved(loud):.0f} % on this plant ({pays(saved(loud))}), and "
        f"{many['loud'][1]:.0f} % in the median."
    )


def markdown(state: dict, many: dict[str, list[float]]) -> str:
    """Return the part of the first page between its marks."""
    text = json.dumps(state | {"median": list(many.values())})
    images = "\n\n".join(
        f"```{{image}} _static/landing{end}.svg\n:alt: {ALT}\n:class: only-{theme}\n```"
        for theme, end in (("light", ""), ("dark", "-dark"))
    )
    script = f'<script type="application/json">{text}</script>'
    figure = f'<div class="pidalab-landing">\n{script}\n\n{images}\n\n</div>'
    return f"<!-- landing -->\n\n{figure}\n\n{caption(state, many)}\n\n<!-- /landing -->"


def stored() -> dict:
    """Return the stored data of the page."""
    script = r'pidalab-landing">\s*<script type="application/json">(.*?)</script>'
    return json.loads(re.search(script, PAGE.read_text(encoding="utf-8"))[1])


def main() -> None:
    """Write both images, the designs and the text. With `--search`, find the optima again."""
    sys.path.insert(0, str(BOOK / "_ext"))
    import figures_for_dark as twins

    state = found() if "--search" in sys.argv else stored()
    target = BOOK / "_static" / "landing.svg"
    figure = draw(state)
    figure.savefig(target, metadata={"Date": None, "Creator": None})
    light = twins.FONT.sub(twins.OF_THE_PAGE, target.read_text(encoding="utf-8"))
    target.write_text(light, encoding="utf-8")
    target.with_name("landing-dark.svg").write_text(twins.darkened(light), encoding="utf-8")
    text = MARKS.sub(lambda _: markdown(state, medians()), PAGE.read_text(encoding="utf-8"))
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
