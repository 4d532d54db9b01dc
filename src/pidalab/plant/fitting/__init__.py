"""From a record to a process model with its uncertainty, by least squares over all samples."""

from pidalab.plant.fitting.fitting import Fit, fit

__all__ = ["Fit", "fit"]
