"""A plant record: read, cleaned, and described before anyone fits a model to it."""

from pidalab.record.cleaned import Noise, Record, Step

__all__ = ["Noise", "Record", "Step"]
