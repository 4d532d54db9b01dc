"""Controllers in the forms of the papers, with filters.

The unfiltered gains of every controller (`pidalab.forms.IdealGains`) convert to the other forms. If a form does not
exist, an error explains why. Printing a controller shows all its forms.
"""

from pidalab.controllers.base import AutomaticReset, Controller, Fraction
from pidalab.controllers.parallel import PIDA, HighOrderPID, NonInteractivePIDA
from pidalab.controllers.series import SeriesPIDA

__all__ = [
    "PIDA",
    "AutomaticReset",
    "Controller",
    "Fraction",
    "HighOrderPID",
    "NonInteractivePIDA",
    "SeriesPIDA",
]
