# The public names of the package and their modules. `pidalab` re-exports the most used names.
from . import heater as heater
from .checking import Check as Check, check as check
from .fitting import Fit as Fit, fit as fit
from .record import Record as Record
from .reporting import Report as Report, report as report
from .tuning import tune as tune
