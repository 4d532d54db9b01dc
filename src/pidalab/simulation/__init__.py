"""Simulation of loops: exact for linear loops with held inputs, sampled for digital and limited controllers.

The public functions are at the top of the library, such as `pidalab.simulate`.
"""
