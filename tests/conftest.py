"""Set up all tests: imports, compiled kernels, the order of tests, and a random choice of long tests."""

import gc
import os
import random
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# Every process of the tests waits for the compiled code.
os.environ.setdefault("PIDALAB_COMPILE", "1")
# The importlib mode of pytest adds no path.
sys.path[:0] = [
    str(ROOT / "tests" / folder)
    for folder in ("oracle", "lab", "digital", "site", "fuzz", "outputs", "papers")
]
# The path of tools comes last, since tools/site.py has the name of a module of Python.
sys.path += [str(ROOT / "tools"), str(ROOT / "oracles")]

# Files of long tests, the longest first. They take three quarters of the time.
LONG = (
    "tests/site/",
    "tests/test_compiled.py",
    "tests/optimal/",
    "book/audit/",
    "tests/plant/test_",
    "tests/lab/",
    "tests/plant/fitting/",
    "tests/plant/code/test_w",
    "tests/digital/test_total.py",
    "tests/simulation/test_portrait.py",
    "tests/comparison/",
    "tests/fuzz/",
    "tests/outputs/",
    "tests/rules/test_direct.py",
    "tests/test_readme.py",
    "book/learn/when-it-pays.ipynb",  # its search takes half a minute
)
# A random selection of 1/DRAW of the long tests runs. The environment passes its seed to the workers.
DRAW = int(os.environ.get("DRAW", "1"))
os.environ.setdefault("DRAW_SEED", str(random.SystemRandom().randrange(10**6)))


@pytest.hookimpl(tryfirst=True)  # before kernels of notebooks start, which would compile, too
def pytest_configure(config):
    """Compile the kernels once. Otherwise each worker would compile most of them."""
    if hasattr(config, "workerinput") or not config.getoption("numprocesses", None):
        return
    from pidalab._compiled import TIER, is_complete

    TIER.begin()
    if not TIER.ready or is_complete():
        return
    subprocess.run([sys.executable, "-m", "pidalab.warm_up"], check=False)


def pytest_report_header():
    """Print the share of the long tests that runs, and how to repeat the random selection."""
    if DRAW > 1:
        again = f"DRAW={DRAW} DRAW_SEED={os.environ['DRAW_SEED']}"
        return f"of the long tests one in {DRAW} is drawn ({again} repeats it, DRAW=1 runs all)"
    return None


def place(item):
    """Return the position of a test's file in LONG, or the length of LONG."""
    return next((k for k, path in enumerate(LONG) if item.nodeid.startswith(path)), len(LONG))


def drawn(item):
    """Return True if a test runs. All cells of a notebook run, or none."""
    notebook_or_test = item.nodeid.partition("::Cell")[0]
    seed = f"{os.environ['DRAW_SEED']} {notebook_or_test}"
    return place(item) == len(LONG) or random.Random(seed).randrange(DRAW) == 0


@pytest.hookimpl(tryfirst=True)  # before another plugin shuffles them
def pytest_collection_modifyitems(config, items):
    """Choose the tests to run. Put long files first: if one starts last, it leaves the other workers idle."""
    if DRAW > 1:
        run = {item for item in items if drawn(item)}
        config.hook.pytest_deselected(items=[item for item in items if item not in run])
        items[:] = [item for item in items if item in run]
    items.sort(key=lambda item: (place(item), not item.nodeid.startswith("book/")))


def pytest_collection():
    """Switch the garbage collector off while tests are collected, which makes half a million lasting objects."""
    gc.disable()


def pytest_collection_finish():
    """Let the garbage collector run rarely and for new objects only, which saves a tenth of the time."""
    gc.freeze()
    gc.set_threshold(100_000, 20, 100)
    gc.enable()


@pytest.hookimpl(wrapper=True, tryfirst=True)  # after the output of all other plugins
def pytest_terminal_summary(terminalreporter):
    """List skipped tests at the end of a run, with the reason."""
    yield
    if DRAW > 1:
        terminalreporter.write_line(pytest_report_header())
    skipped = terminalreporter.stats.get("skipped", [])
    if not skipped:
        return
    terminalreporter.write_sep("=", f"{len(skipped)} tests did not run", yellow=True)
    reasons = Counter((report.fspath, report.longrepr[2].removeprefix("Skipped: ")) for report in skipped)
    for reason in sorted({reason for _, reason in reasons}):
        where = [f"{path} ({n})" for (path, other), n in sorted(reasons.items()) if other == reason]
        terminalreporter.write_line(f"{reason}\n    {', '.join(where)}")
