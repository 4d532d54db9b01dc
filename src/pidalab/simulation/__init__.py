"""Simulation of loops: exact for linear loops with dead time and held inputs."""

from pidalab.simulation.exact import load_response, open_loop_step, simulate, simulate_ensemble, step_response
from pidalab.simulation.noise import uniform_noise

__all__ = ["load_response", "open_loop_step", "simulate", "simulate_ensemble", "step_response", "uniform_noise"]
