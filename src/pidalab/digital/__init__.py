"""Digital controllers: difference equations that run in Python, control simulated loops and can be written as code.

``controller.discretise`` creates a digital controller. This package does not depend on continuous controllers.
"""

from typing import TYPE_CHECKING, Any

from pidalab.digital.controller import DigitalController
from pidalab.digital.discretisation import discretise

if TYPE_CHECKING:
    from pidalab.plant.code.json_reader import from_json

__all__ = ["DigitalController", "discretise", "from_json"]


def __getattr__(name: str) -> Any:
    if name != "from_json":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from pidalab.plant.code.json_reader import from_json

    return from_json
