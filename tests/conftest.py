"""Shared by all tests: modules that are imported by name, and the order of tests."""

import gc
import os
import random
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# every process of the tests uses the compiled forms, and waits for them
os.environ.setdefault("PIDALAB_COMPILE", "1")
# pytest's importlib mode adds no path
sys.path[:0] = [
    str(ROOT / "tests" / folder)
    for folder in ("oracle", "lab", "digital", "site", "fuzz", "outputs", "papers")
]
# last, since one of the tools is called like Python's module site
sys.path += [str(ROOT / "tools"), str(ROOT / "oracles")]

# Long tests, the longest first: pages in a browser, searches, fits, commands, code for others, audits. They take three
# quarters of the time.
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
)
# Of these, one test in so many is drawn, anew each time; workers are given the number that the draw begins from.
DRAW = int(os.environ.get("DRAW", "1"))
os.environ.setdefault("DRAW_SEED", str(random.SystemRandom().randrange(10**6)))


@pytest.hookimpl(tryfirst=True)  # before kernels are started, which would make it, too
def pytest_configure(config):
    """Compile the kernels once, if they are not compiled: each worker would compile most of them again."""
    if hasattr(config, "workerinput") or not config.getoption("numprocesses", None):
        return
    from pidalab._compiled import TIER, is_complete

    TIER.begin()
    if not TIER.ready or is_complete():
        return
    subprocess.run([sys.executable, "-m", "pidalab.warm_up"], check=False)


def pytest_report_header():
    """Say what is left out, and how to repeat it."""
    if DRAW > 1:
        again = f"DRAW={DRAW} DRAW_SEED={os.environ['DRAW_SEED']}"
        return f"of the long tests one in {DRAW} is drawn ({again} repeats it, DRAW=1 runs all)"
    return None


def place(item):
    """Return the place of a test among the long ones, or after them."""
    return next((k for k, path in enumerate(LONG) if item.nodeid.startswith(path)), len(LONG))


def drawn(item):
    """Return True if a test runs: a long one if it is drawn, a notebook with all of its cells or not at all."""
    one = item.nodeid.partition("::Cell")[0]
    seed = f"{os.environ['DRAW_SEED']} {one}"
    return place(item) == len(LONG) or random.Random(seed).randrange(DRAW) == 0


@pytest.hookimpl(tryfirst=True)  # before another plugin shuffles them
def pytest_collection_modifyitems(config, items):
    """Long files first: one that starts last keeps one processor busy and the others waiting."""
    if DRAW > 1:
        run = {item for item in items if drawn(item)}
        config.hook.pytest_deselected(items=[item for item in items if item not in run])
        items[:] = [item for item in items if item in run]
    items.sort(key=lambda item: (place(item), not item.nodeid.startswith("book/")))


def pytest_collection():
    """Collect without looking for garbage: half a million objects are made, and all of them stay."""
    gc.disable()


def pytest_collection_finish():
    """Look for garbage from now on, but not among these, and seldom: it takes a tenth of the time."""
    gc.freeze()
    gc.set_threshold(100_000, 20, 100)
    gc.enable()


@pytest.hookimpl(wrapper=True, tryfirst=True)  # after what every other plugin has to say
def pytest_terminal_summary(terminalreporter):
    """End a run that left tests out with which they were, and what they need."""
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
