"""Settings for pytest on notebooks: wait for compiled code, and compare figures by their content."""

import os
import sys
from pathlib import Path

# pytest's importlib mode adds no path
sys.path.append(str(Path(__file__).parents[1] / "tests" / "outputs"))


def pytest_configure(config):
    """Compare outputs by our comparison."""
    if config.getoption("nbval"):
        os.environ.setdefault("PIDALAB_COMPILE", "1")
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        config.pluginmanager.import_plugin("comparing")
