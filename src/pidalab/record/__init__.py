"""A plant record: read, cleaned, and described before anyone fits a model to it."""

from pidalab.record.cleaned import Noise, Record
from pidalab.record.inputs import Step

__all__ = ["Noise", "Record", "Step"]
