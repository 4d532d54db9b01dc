# The public names of the wing and their homes; `pidalab` hands the most used of them on.
from . import heater as heater
from .checking import Check as Check, check as check
from .fitting import Fit as Fit, fit as fit
from .record import Record as Record
from .reporting import Report as Report, report as report
from .tuning import tune as tune
