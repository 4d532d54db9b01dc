"""A plant record: read, cleaned, and described before anyone fits a model to it."""

from pidalab.plant.record.cleaned import Noise, Record
from pidalab.plant.record.inputs import Step

__all__ = ["Noise", "Record", "Step"]
