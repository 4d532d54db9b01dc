"""Tuning rules: each takes a model, and its `tune` returns a `Design`, or raises outside its range of validity."""

from pidalab.rules import automatic_reset, classical, direct, haalman, itae, magnitude_optimum, mrdp, registry
from pidalab.rules._design import Design

__all__ = [
    "Design",
    "automatic_reset",
    "classical",
    "direct",
    "haalman",
    "itae",
    "magnitude_optimum",
    "mrdp",
    "registry",
]
