"""pidalab."""
from pidalab.process import Process, fopdt, sopdt, ipdt, lags
from pidalab.controllers import PIDA, HighOrderPID, NonInteractivePIDA, SeriesPIDA
from pidalab.loop import Loop
from pidalab.response import Response
from pidalab.simulation import load_response, simulate, step_response
from pidalab.margins import Margins, gain_crossovers, is_stable, margins, max_sensitivity, phase_crossovers, unstable_poles
