"""Tuning rules: each takes a model and returns a controller, or raises outside its range of validity."""

from pidalab.rules import automatic_reset, direct, haalman, itae, magnitude_optimum, mrdp

__all__ = ["automatic_reset", "direct", "haalman", "itae", "magnitude_optimum", "mrdp"]
