"""When pytest runs the notebooks, kernels start as the book starts them, and figures are compared by what they draw."""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
# pytest's importlib mode adds no path
sys.path += [str(ROOT / "tools"), str(ROOT / "tests" / "outputs")]


def pytest_configure(config):
    """Fork the kernels, and compare outputs in our way."""
    if config.getoption("nbval"):
        from kernels import fork_kernels

        fork_kernels()
        config.pluginmanager.import_plugin("comparing")
