"""When pytest runs the notebooks, they wait for machine code, and figures are compared by what they draw."""

import os
import sys
from pathlib import Path

# pytest's importlib mode adds no path
sys.path.append(str(Path(__file__).parents[1] / "tests" / "outputs"))


def pytest_configure(config):
    """Compare outputs in our way."""
    if config.getoption("nbval"):
        os.environ.setdefault("PIDALAB_COMPILE", "1")
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        config.pluginmanager.import_plugin("comparing")
