"""The live figure of the chapter on huba2024."""

from typing import Any

import pidalab

from . import loops

WAYS = {
    "no protection": "none",
    "clamping": "clamping",
    "conditioning": "conditioning",
    "automatic reset": "reset",
}


def protections() -> Any:
    """Show one linear controller at a limit, protected in four ways."""
    controller = pidalab.HighOrderPID(list(loops.designs()["PIDA_1"].controller.gains()), 0.2, 4)
    linear = pidalab.Loop(loops.plant(), controller)
    lowest = pidalab.load_response(linear, loops.clock(10.0, 0.01)).u.min()  # below it nothing is cut off
    shown = pidalab.plots.live(
        "huba-ipdt",
        dict.fromkeys(WAYS, controller),
        conditions={"limits": [-1.1, 0.1], "end": 50},
        knobs=[{"key": "limits.low", "label": "lowest u", "low": round(lowest, 2), "high": -1.02}],
        plots=["load", "effort"],
        numbers=["iae"],
        caption="A unit step of the load, PIDA₁: one linear controller, four kinds of protection. At rest u is −1: "
        "drag the limit towards it.",
        lab=True,
    )
    for design, way in zip(shown.state["designs"], WAYS.values(), strict=True):
        design["conditions"] = {"antiWindup": way}
    return shown
