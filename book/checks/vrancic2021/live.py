"""The live figure of the chapter on vrancic2021."""

from typing import Any

import pidalab
from pidalab.rules import magnitude_optimum as mo

KINDS = {"PI": 0, "PID": 1, "PIDA": 2}


def flatness() -> Any:
    """Show |T| and the load response by order, tuned anew for each filter time."""
    process = pidalab.lags(3, delay=0.5)
    return pidalab.plots.live(
        "vrancic-3",
        {kind: mo.tune(process, m, m + 1, filter_time=0.1).controller for kind, m in KINDS.items()},
        rule="magnitude",
        knobs=[{"key": "filterTime", "label": "filter time", "low": 0.02, "high": 0.5, "log": True}],
        plots=["closed", "load"],
        numbers=["iae", "ms", "sigma"],
        caption="PI, PID and PIDA by the magnitude optimum for three lags with a dead time, tuned anew for each filter "
        "time: |T|, and the output after a unit step of the load.",
        lab=True,
    )
