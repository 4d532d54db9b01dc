"""The command line: write controller code from a plant record, and compare and simulate controllers."""

from pidalab.plant.cli import known, recorded
from pidalab.plant.cli.dialogue import main

__all__ = ["known", "main", "recorded"]
