"""The live figure of the chapter on heo2023."""

from typing import Any

import numpy as np
import pidalab
from pidalab.rules import itae

PLANT = pidalab.lags(3, delay=0.2)  # of Example 1
GAINS = {"PID": 3, "PIDA": 4}


def limits() -> Any:
    """Show what a limit of the control signal, and a slower filter, make of set-point steps in Example 1."""
    model = pidalab.reduction.to_sopdt(PLANT).process
    controllers = {}
    for kind, count in GAINS.items():
        gains = list(itae.tune(model, "setpoint", kind).controller.gains())[:count]
        controllers[kind] = pidalab.HighOrderPID(gains, filter_time=0.05, filter_order=count - 1)
    loop, t = pidalab.Loop(PLANT, controllers["PIDA"]), np.linspace(0, 1, 2001)
    most = 10 * float(np.ceil(pidalab.step_response(loop, t).u.max() / 10))  # no limit from there on
    return pidalab.plots.live(
        "heo-1",
        controllers,
        conditions={"limits": [-most / 10, most / 10], "antiWindup": "clamping"},
        knobs=[
            {"key": "limits", "label": "limit of u", "low": most / 50, "high": most, "log": True},
            {"key": "filterTime", "label": "filter time", "low": 0.02, "high": 0.5, "log": True},
        ],
        plots=["setpoint", "control"],
        numbers=["iaeSetpoint", "peak", "ms", "sigma"],
        caption="Example 1, steps of the set point without a filter for it: PID and PIDA by the paper's rules, each "
        "with one filter on all its terms, and with clamping at the limit of u. Raise the limit until nothing is cut "
        "off: which of the two needs more of it? Or slow the filter.",
        lab=True,
    )
