"""The live figure of the chapter on haalman2024."""

from typing import Any

import pidalab
from pidalab.rules import haalman

LEVELS = {"Ms, solid": 1.4, "Ms, dashed": 2.0}  # by the label of its knob


def circles(model: pidalab.Process) -> Any:
    """Show the knob Ms on the model: the Nyquist curve meets its circle."""
    controllers = {}
    for ms in LEVELS.values():
        gains = list(haalman.pida(model, ms, m=10).gains())
        controllers[f"Ms {ms}"] = pidalab.HighOrderPID(gains, filter_time=0.05, filter_order=3)
    shown = pidalab.plots.live(
        model,
        controllers,
        rule="gain",
        conditions={"end": 25},
        knobs=[
            {"key": "ms", "design": k, "label": label, "low": 1.1, "high": 3, "step": 0.01}
            for k, label in enumerate(LEVELS)
        ],
        plots=["nyquist", "load"],
        numbers=["ms", "gm", "pm", "iae"],
        caption="The knob: PIDA loops on the model for two values of Ms, and a unit step of the load. "
        "Each curve touches the circle of radius 1/Ms around −1. One filter on all terms stands for N, M and F.",
        lab=True,
    )
    for design, ms in zip(shown.state["designs"], LEVELS.values(), strict=True):
        design["ms"] = ms
    return shown
