"""Characteristic areas of a process, from which the magnitude optimum computes a controller (vrancic2021).

`from_process` computes areas from a model, and `from_record` from measured signals.
"""

from pidalab.areas.measured import MeasuredAreas, RecordWarning, from_record
from pidalab.areas.model import exact, from_process, with_binomial_filter, with_filter

__all__ = [
    "MeasuredAreas",
    "RecordWarning",
    "exact",
    "from_process",
    "from_record",
    "with_binomial_filter",
    "with_filter",
]
