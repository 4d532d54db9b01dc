"""Settings for pytest on notebooks: wait for compiled code, and compare figures by their content."""

import os
import sys
from pathlib import Path

# pytest's importlib mode adds no path
sys.path.append(str(Path(__file__).parents[1] / "tests" / "outputs"))


def pytest_configure(config):
    """Compare outputs by our comparison, and start a kernel again if it dies at once."""
    if config.getoption("nbval"):
        from nbval import kernel

        start = kernel.start_new_kernel

        def start_twice(**options):
            """Start a kernel. If it dies because another process has taken its TCP port, start a second one."""
            try:
                return start(**options)
            except RuntimeError:
                return start(**options)

        kernel.start_new_kernel = start_twice
        os.environ.setdefault("PIDALAB_COMPILE", "1")
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        config.pluginmanager.import_plugin("comparing")
