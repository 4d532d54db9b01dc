"""Tuning rules: each takes a model and returns a controller, or raises outside its range of validity."""

from pidalab.rules import direct, haalman, itae, magnitude_optimum, mrdp

__all__ = ["direct", "haalman", "itae", "magnitude_optimum", "mrdp"]
