"""The live figure of the chapter on huba2018."""

from typing import Any

import pidalab
from pidalab.rules import mrdp

from .designs import unit

FILTERS = {"filter, solid": 0.2, "filter, dashed": 0.04}  # T_e by the label of its knob


def hump() -> Any:
    """Show the hump of the loop gain come up to 1 as the filter gets shorter."""
    return pidalab.plots.live(
        "huba-ipdt",
        {f"Te = {te}": mrdp.tune(unit(), 2, 4, te).controller for te in FILTERS.values()},
        conditions={"end": 12},
        knobs=[
            {"key": "filterTime", "design": k, "label": label, "low": 0.005, "high": 0.2, "log": True}
            for k, label in enumerate(FILTERS)
        ],
        plots=["bode", "load"],
        numbers=["ms", "first", "hump"],
        caption="PIDA with a filter of fourth order, one long enough and one that begins too late: loop gain, and the "
        "output after a unit step of the load. A knob changes the filter; the gains stay as they were tuned.",
        lab=True,
    )
