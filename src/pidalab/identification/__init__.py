"""Identify a process model from a plant record, by three points, a tangent or a ramp.

`fit`, which uses all samples of a record, is imported from `pidalab.plant` on first use.
"""

from typing import TYPE_CHECKING, Any

from pidalab.identification.experiments import (
    ThreePointModel,
    binomial_filtered,
    ipdt_least_squares,
    ipdt_tangent,
    three_point,
)

if TYPE_CHECKING:
    from pidalab.plant.fitting import Fit, fit

__all__ = [
    "Fit",
    "ThreePointModel",
    "binomial_filtered",
    "fit",
    "ipdt_least_squares",
    "ipdt_tangent",
    "three_point",
]


def __getattr__(name: str) -> Any:
    if name not in ("Fit", "fit"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from pidalab.plant import fitting

    return getattr(fitting, name)
