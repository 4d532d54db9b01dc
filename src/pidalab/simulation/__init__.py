"""Simulation of loops: exact for linear loops with dead time."""

from pidalab.simulation.exact import load_response, simulate, step_response

__all__ = ["load_response", "simulate", "step_response"]
