"""Modules of these folders are imported by name: pytest's importlib mode adds no path."""

import sys
from pathlib import Path

sys.path[:0] = [
    str(Path(__file__).parent / folder) for folder in ("oracle", "lab", "digital", "site", "fuzz")
]
