"""Simulation of loops: exact for linear loops with held inputs, and sampled for digital, limited controllers.

What users call has its name at the top of the library, such as `pidalab.simulate`.
"""
