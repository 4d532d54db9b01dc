"""pidalab."""
from pidalab.process import Process, fopdt, sopdt, ipdt, lags
from pidalab.loop import Loop
from pidalab.response import Response
from pidalab.simulation import load_response, simulate, step_response
