"""Tuning rules. Each rule returns a `Design` for a model, or raises an error if the model is outside its range."""

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
