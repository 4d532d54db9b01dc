"""Digital controllers: difference equations that run, and that a loop can be closed with.

They come from `discretise` of a controller. What is here knows gains, filters and samples, and no continuous class. The
code for other machines is the engineer's, `pidalab.plant.code`: the methods that write it, and `from_json`, which reads
it back, load it when they are called.
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
