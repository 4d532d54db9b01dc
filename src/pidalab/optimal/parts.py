"""What a search for an optimum is made of, for studies that look at its valleys, its starts and its noise.

A `Search` is one `Problem`, a process and an order in a unit of time, with its `Requirements`. `pidalab.optimal.load`
is what a design needs; these parts are for those who ask how it was found, and may change with the search.
"""

from __future__ import annotations

from pidalab.optimal._design import SAME_IAE, UNITS_TRIED
from pidalab.optimal._finish import finish
from pidalab.optimal._noise import SampledNoise
from pidalab.optimal._problem import Problem
from pidalab.optimal._solver import FINE, NEARLY, Search
from pidalab.optimal._starts import at_once, relax
from pidalab.optimal._units import search_in, unit_of_time

__all__ = [
    "FINE",
    "NEARLY",
    "SAME_IAE",
    "UNITS_TRIED",
    "Problem",
    "SampledNoise",
    "Search",
    "at_once",
    "finish",
    "relax",
    "search_in",
    "unit_of_time",
]
