"""What a search for an optimum is made of, for studies that look at its valleys, its starts and its noise.

A `Search` is one `Problem`, a process and an order in a unit of time, with its `DesignLimits`. `pidalab.optimal.load`
is what a design needs; these parts are for those who ask how it was found, and may change with the search.
"""

from __future__ import annotations

from pidalab.optimal._design import SAME_IAE, UNITS_TRIED
from pidalab.optimal._finish import finish
from pidalab.optimal._limits import DesignLimits
from pidalab.optimal._noise import SampledNoise
from pidalab.optimal._problem import Problem
from pidalab.optimal._solver import FINE, NEARLY, SPARE, Search
from pidalab.optimal._starts import at_once, relax
from pidalab.optimal._units import unit_of_time
from pidalab.process import Process

__all__ = [
    "FINE",
    "NEARLY",
    "SAME_IAE",
    "UNITS_TRIED",
    "DesignLimits",
    "Problem",
    "SampledNoise",
    "Search",
    "at_once",
    "finish",
    "relax",
    "search_in",
    "unit_of_time",
]


def search_in(
    process: Process, order: int, limits: DesignLimits, factor: float = 1.0, spare: float = SPARE
) -> Search:
    """Return a search in the unit of time that fits a process, times a factor.

    Parameters
    ----------
    process : Process
        With positive gain.
    order : int
        Highest derivative.
    limits : DesignLimits
        Requirements of the design.
    factor : float, optional
        Of the unit of time.
    spare : float, optional
        Share of a limit that is kept free, for peaks between the frequencies looked at.

    Returns
    -------
    Search

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.optimal.parts import DesignLimits, search_in
    >>> search_in(pidalab.lags(3, delay=1.0), 1, DesignLimits(1.6)).problem.gains
    3
    """
    unit = factor * unit_of_time(process, limits)
    return Search(Problem(process, order, (abs(complex(process(1j / unit))), unit)), limits, spare)
