"""PIDA control: processes with dead time, loops simulated exactly, tuning rules, and a ledger of printed numbers.

Data flow down one corridor, and every chapter of the book walks it::

    step data -> identify -> Process -> rule -> controller -> Loop -> Response -> measures -> figure, ledger

Names are imported when they are first used, so that ``import pidalab`` is quick and each user waits for what it needs.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

# The same names as in HOMES, for editors and type checkers; `as` tells them that a name is handed on.
if TYPE_CHECKING:
    from pidalab import (
        areas as areas,
        digital as digital,
        heater as heater,
        identification as identification,
        ledger as ledger,
        optimal as optimal,
        plots as plots,
        reduction as reduction,
        robustness as robustness,
        rules as rules,
    )
    from pidalab.comparison import Comparison as Comparison, compare as compare
    from pidalab.controllers import (
        PIDA as PIDA,
        HighOrderPID as HighOrderPID,
        NonInteractivePIDA as NonInteractivePIDA,
        SeriesPIDA as SeriesPIDA,
    )
    from pidalab.loop import Loop as Loop
    from pidalab.plants import AsymmetricPlant as AsymmetricPlant
    from pidalab.process import Process as Process, fopdt as fopdt, ipdt as ipdt, lags as lags, sopdt as sopdt
    from pidalab.record import Record as Record
    from pidalab.reporting import Report as Report, report as report
    from pidalab.response import Response as Response
    from pidalab.robustness.gain import gain_for_ms as gain_for_ms
    from pidalab.robustness.many import margins_many as margins_many
    from pidalab.robustness.margins import (
        Margins as Margins,
        bandwidth as bandwidth,
        gain_crossovers as gain_crossovers,
        margins as margins,
        max_sensitivity as max_sensitivity,
        phase_crossovers as phase_crossovers,
    )
    from pidalab.robustness.poles import (
        is_stable as is_stable,
        rightmost_poles as rightmost_poles,
        unstable_poles as unstable_poles,
    )
    from pidalab.rules import Design as Design
    from pidalab.running_loop import Check as Check, check as check
    from pidalab.simulation.exact import (
        load_response as load_response,
        open_loop_step as open_loop_step,
        simulate as simulate,
        simulate_ensemble as simulate_ensemble,
        step_response as step_response,
    )
    from pidalab.simulation.many import simulate_many as simulate_many
    from pidalab.simulation.noise import noise_gain as noise_gain, uniform_noise as uniform_noise
    from pidalab.simulation.portrait import Portrait as Portrait, portrait as portrait
    from pidalab.simulation.sampled import simulate_sampled as simulate_sampled
    from pidalab.tuning import tune as tune

ROOMS = (
    "areas",
    "digital",
    "heater",
    "identification",
    "ledger",
    "optimal",
    "plots",
    "reduction",
    "robustness",
    "rules",
)
HOMES = {
    "comparison": ("Comparison", "compare"),
    "controllers": ("PIDA", "HighOrderPID", "NonInteractivePIDA", "SeriesPIDA"),
    "loop": ("Loop",),
    "plants": ("AsymmetricPlant",),
    "process": ("Process", "fopdt", "ipdt", "lags", "sopdt"),
    "record": ("Record",),
    "reporting": ("Report", "report"),
    "response": ("Response",),
    "robustness.gain": ("gain_for_ms",),
    "robustness.margins": (
        "Margins",
        "bandwidth",
        "gain_crossovers",
        "margins",
        "max_sensitivity",
        "phase_crossovers",
    ),
    "robustness.many": ("margins_many",),
    "robustness.poles": ("is_stable", "rightmost_poles", "unstable_poles"),
    "rules": ("Design",),
    "running_loop": ("Check", "check"),
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
