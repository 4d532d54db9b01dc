"""Digital controllers: difference equations that run, that a loop can be closed with, and that write their own code.

They come from `discretise` of a controller. What is here knows gains, filters and samples, and no continuous class.
"""

from pidalab.digital.controller import DigitalController
from pidalab.digital.discretisation import discretise
from pidalab.digital.json_reader import from_json

__all__ = ["DigitalController", "discretise", "from_json"]
