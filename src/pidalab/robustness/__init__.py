"""Compute margins and poles of a loop, and its absolute stability with a limited control signal.

The functions for poles and margins are members of `pidalab`, such as `pidalab.margins`.
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
