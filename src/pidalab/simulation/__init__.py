"""Simulation of loops: exact for linear loops with held inputs, and sampled for digital, limited controllers."""

from pidalab.simulation.exact import load_response, open_loop_step, simulate, simulate_ensemble, step_response
from pidalab.simulation.noise import noise_gain, uniform_noise
from pidalab.simulation.sampled import simulate_sampled

__all__ = [
    "load_response",
    "noise_gain",
    "open_loop_step",
    "simulate",
    "simulate_ensemble",
    "simulate_sampled",
    "step_response",
    "uniform_noise",
]
