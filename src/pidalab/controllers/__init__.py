"""Controllers in the forms of the papers, with filters.

Every controller gives its unfiltered gains (`pidalab.forms.IdealGains`), which convert from form to form or say why
they cannot, and prints itself in all forms. Filters carry over only between forms that share their structure.
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
