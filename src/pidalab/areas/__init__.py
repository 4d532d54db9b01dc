"""Characteristic areas of a process: all that a tuning by the magnitude optimum asks of it (vrancic2021).

They come from a model (`from_process`), or from a record of its signals without one (`from_record`).
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
