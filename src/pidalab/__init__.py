"""PIDA control: processes with dead time, loops simulated exactly, tuning rules, and a ledger of printed numbers.

Data flow down one corridor, and every chapter of the book walks it::

    step data -> identify -> Process -> rule -> controller -> Loop -> Response -> measures -> figure, ledger
"""

from importlib.metadata import version

from pidalab import areas, identification, ledger, plots, reduction, robustness, rules, twins
from pidalab.controllers import PIDA, HighOrderPID, NonInteractivePIDA, SeriesPIDA
from pidalab.loop import Loop
from pidalab.plants import AsymmetricPlant
from pidalab.process import Process, fopdt, ipdt, lags, sopdt
from pidalab.response import Response
from pidalab.robustness.margins import (
    Margins,
    gain_crossovers,
    margins,
    max_sensitivity,
    phase_crossovers,
)
from pidalab.robustness.poles import is_stable, rightmost_poles, unstable_poles
from pidalab.rules import Design
from pidalab.simulation import (
    load_response,
    noise_gain,
    open_loop_step,
    simulate,
    simulate_ensemble,
    simulate_sampled,
    step_response,
    uniform_noise,
)
from pidalab.simulation.portrait import Portrait, portrait

__version__ = version("pidalab")

__all__ = [
    "PIDA",
    "AsymmetricPlant",
    "Design",
    "HighOrderPID",
    "Loop",
    "Margins",
    "NonInteractivePIDA",
    "Portrait",
    "Process",
    "Response",
    "SeriesPIDA",
    "areas",
    "fopdt",
    "gain_crossovers",
    "identification",
    "ipdt",
    "is_stable",
    "lags",
    "ledger",
    "load_response",
    "margins",
    "max_sensitivity",
    "noise_gain",
    "open_loop_step",
    "phase_crossovers",
    "plots",
    "portrait",
    "reduction",
    "rightmost_poles",
    "robustness",
    "rules",
    "simulate",
    "simulate_ensemble",
    "simulate_sampled",
    "sopdt",
    "step_response",
    "twins",
    "uniform_noise",
    "unstable_poles",
]
