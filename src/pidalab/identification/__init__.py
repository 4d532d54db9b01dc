"""From a plant record to a process model."""

from pidalab.identification.experiments import (
    ThreePointModel,
    binomial_filtered,
    ipdt_least_squares,
    ipdt_tangent,
    three_point,
)
from pidalab.identification.fitting import Fit, fit

__all__ = [
    "Fit",
    "ThreePointModel",
    "binomial_filtered",
    "fit",
    "ipdt_least_squares",
    "ipdt_tangent",
    "three_point",
]
