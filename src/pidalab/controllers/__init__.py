"""Controllers in the forms of the papers, with filters.

Every controller can return its unfiltered gains (`pidalab.forms.IdealGains`). The gains convert to the other forms. If
a form does not exist, an error explains why. Printing a controller shows all its forms. Filters convert only between
forms of the same structure.
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
