"""How far a loop is from instability, and whether limits of its control signal can keep it from coming to rest.

Poles and margins have their names at the top of the library (`pidalab.is_stable`, `pidalab.margins`); the criteria of
absolute stability, and the largest gain from noise to control signal, have theirs here.
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
