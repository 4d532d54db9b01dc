"""Checks of haalman2024: one function for each section of its audit."""

from collections.abc import Callable

from pidalab.ledger import Ledger

from . import live
from .beyond import captions, equal_ms, other_responses, others, price
from .controllers import coarse_grids, crossovers, gains, other_ways, times, which_loop
from .errors import amplitude, horizons, iae, readings
from .filters import cancellation, output_filter, sensitivity
from .model import formulas, levels, second_order, three_points
from .statements import comparisons, effort, eight_loops, kick_figure, kicks, paper_figure
from .work import CASES, work

SECTIONS: tuple[Callable[[Ledger], object], ...] = (
    three_points,
    levels,
    formulas,
    second_order,
    times,
    gains,
    coarse_grids,
    which_loop,
    other_ways,
    crossovers,
    iae,
    horizons,
    readings,
    amplitude,
    comparisons,
    effort,
    kicks,
    output_filter,
    sensitivity,
    cancellation,
    equal_ms,
    price,
    others,
    other_responses,
    captions,
)
