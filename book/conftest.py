"""When pytest runs the notebooks, their kernels are started as the book starts them."""

import sys
from pathlib import Path

sys.path.append(
    str(Path(__file__).parents[1] / "tools")
)  # pytest's importlib mode adds no path


def pytest_configure(config):
    """Fork the kernels."""
    if config.getoption("nbval"):
        from kernels import fork_kernels

        fork_kernels()
