"""pidalab."""
from pidalab.process import Process, fopdt, sopdt, ipdt, lags
from pidalab.controllers import PIDA, HighOrderPID, NonInteractivePIDA, SeriesPIDA
from pidalab.loop import Loop
from pidalab.response import Response
from pidalab.margins import Margins, gain_crossovers, is_stable, margins, max_sensitivity, phase_crossovers, unstable_poles
from pidalab.simulation import load_response, open_loop_step, simulate, simulate_ensemble, step_response, uniform_noise
from pidalab import identification, rules
