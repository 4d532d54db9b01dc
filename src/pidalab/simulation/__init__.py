"""Simulation of loops: exact for linear loops with held inputs, sampled for digital and limited controllers.

Import the public functions from `pidalab`, for example `pidalab.simulate`.
"""
