"""Checks of the chapter on heo2023: one function for each section of its audit."""

from . import beyond, facts, figures, live
from .equations import example3, filters, form
from .errata import formulas, gains, readings, rounding, switches, text
from .examples import responses, table4, table5, table6
from .load3 import load_values
from .printed_itae import (
    dead_time,
    definition,
    glance,
    proposed_values,
    scheme,
    windows,
)
from .statements import by_hand, filter_constants, imc, parameters, prediction, stability
from .table1 import breaks, cost, domain, figure1_statements, half, optimised

SECTIONS = (
    table4,
    table5,
    table6,
    responses,
    definition,
    scheme,
    dead_time,
    proposed_values,
    load_values,
    domain,
    breaks,
    cost,
    half,
    figure1_statements,
    form,
    filters,
    example3,
    prediction,
    stability,
    parameters,
    filter_constants,
    imc,
    by_hand,
    gains,
    formulas,
    switches,
    text,
    optimised,
    readings,
)

__all__ = [
    "SECTIONS",
    "beyond",
    "facts",
    "figures",
    "glance",
    "live",
    "rounding",
    "windows",
    *(section.__name__ for section in SECTIONS),
]
