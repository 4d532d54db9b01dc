"""Margins and poles of a loop, and its absolute stability with a limited control signal.

Poles and margins are at the top of the library, such as `pidalab.is_stable` and `pidalab.margins`. This package also
has the criteria of absolute stability and the largest gain from noise to control signal.
"""

from pidalab.robustness.limits import Criterion, LinearPart, circle, linear_part, popov, smallest_filter_time
from pidalab.robustness.margins import max_control_sensitivity

__all__ = [
    "Criterion",
    "LinearPart",
    "circle",
    "linear_part",
    "max_control_sensitivity",
    "popov",
    "smallest_filter_time",
]
