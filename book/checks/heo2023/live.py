"""The live figure of the chapter on heo2023."""

from typing import Any

import pidalab
from pidalab.rules import itae

GAINS = {"PID": 3, "PIDA": 4}


def limits() -> Any:
    """Show what a limit of the control signal, and a slower filter, make of set-point steps in Example 1."""
    model = pidalab.reduction.to_sopdt(pidalab.lags(3, delay=0.2)).process
    controllers = {}
    for kind, count in GAINS.items():
        gains = list(itae.tune(model, "setpoint", kind).controller.gains())[:count]
        controllers[kind] = pidalab.HighOrderPID(gains, filter_time=0.05, filter_order=count - 1)
    return pidalab.plots.live(
        "heo-1",
        controllers,
        conditions={"limits": [-100, 100], "antiWindup": "clamping"},
        knobs=[
            {"key": "limits", "label": "limit of u", "low": 2, "high": 200, "log": True},
            {"key": "filterTime", "label": "filter time", "low": 0.02, "high": 0.5, "log": True},
        ],
        plots=["setpoint", "control"],
        numbers=["iaeSetpoint", "peak", "ms", "sigma"],
        caption="Example 1, steps of the set point without a filter for it: PID and PIDA by the paper's rules, each "
        "with one filter on all its terms, and with clamping at the limit of u. Lower the limit, or slow the filter.",
        lab=True,
    )
