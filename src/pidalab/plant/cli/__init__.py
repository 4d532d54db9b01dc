"""The command line: from a plant record to controller code, and what a controller does to a plant."""

from pidalab.plant.cli import known, recorded
from pidalab.plant.cli.dialogue import main

__all__ = ["known", "main", "recorded"]
