"""PIDA control: processes with dead time, loops simulated exactly, tuning rules, and a ledger of printed numbers.

Data flow down one corridor, and every chapter of the book walks it::

    step data -> identify -> Process -> rule -> controller -> Loop -> Response -> measures -> figure, ledger

Names are imported when they are first used, so that ``import pidalab`` is quick and each user waits for what it needs.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # the same names as in HOMES, for editors and type checkers
    from pidalab import (
        areas,
        digital,
        identification,
        ledger,
        optimal,
        plots,
        reduction,
        robustness,
        rules,
        twins,
    )
    from pidalab.comparison import Comparison, compare
    from pidalab.controllers import PIDA, HighOrderPID, NonInteractivePIDA, SeriesPIDA
    from pidalab.loop import Loop
    from pidalab.plants import AsymmetricPlant
    from pidalab.process import Process, fopdt, ipdt, lags, sopdt
    from pidalab.record import Record
    from pidalab.response import Response
    from pidalab.robustness.many import margins_many
    from pidalab.robustness.margins import (
        Margins,
        gain_crossovers,
        margins,
        max_sensitivity,
        phase_crossovers,
    )
    from pidalab.robustness.poles import is_stable, rightmost_poles, unstable_poles
    from pidalab.rules import Design
    from pidalab.simulation.exact import (
        load_response,
        open_loop_step,
        simulate,
        simulate_ensemble,
        step_response,
    )
    from pidalab.simulation.many import simulate_many
    from pidalab.simulation.noise import noise_gain, uniform_noise
    from pidalab.simulation.portrait import Portrait, portrait
    from pidalab.simulation.sampled import simulate_sampled
    from pidalab.tuning import tune

ROOMS = (
    "areas",
    "digital",
    "identification",
    "ledger",
    "optimal",
    "plots",
    "reduction",
    "robustness",
    "rules",
    "twins",
)
HOMES = {
    "comparison": ("Comparison", "compare"),
    "controllers": ("PIDA", "HighOrderPID", "NonInteractivePIDA", "SeriesPIDA"),
    "loop": ("Loop",),
    "plants": ("AsymmetricPlant",),
    "process": ("Process", "fopdt", "ipdt", "lags", "sopdt"),
    "record": ("Record",),
    "response": ("Response",),
    "robustness.margins": ("Margins", "gain_crossovers", "margins", "max_sensitivity", "phase_crossovers"),
    "robustness.many": ("margins_many",),
    "robustness.poles": ("is_stable", "rightmost_poles", "unstable_poles"),
    "rules": ("Design",),
    "simulation.exact": ("load_response", "open_loop_step", "simulate", "simulate_ensemble", "step_response"),
    "simulation.many": ("simulate_many",),
    "simulation.noise": ("noise_gain", "uniform_noise"),
    "simulation.portrait": ("Portrait", "portrait"),
    "simulation.sampled": ("simulate_sampled",),
    "tuning": ("tune",),
}
HOME = {name: module for module, names in HOMES.items() for name in names}

__all__ = [*ROOMS, *HOME]


def __getattr__(name: str) -> Any:
    """Import a name from where it lives, once."""
    if name in HOME:
        value = getattr(import_module(f"pidalab.{HOME[name]}"), name)
    elif name in ROOMS:
        value = import_module(f"pidalab.{name}")
    elif name == "__version__":
        value = import_module("importlib.metadata").version("pidalab")
    else:
        raise AttributeError(f"module 'pidalab' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
