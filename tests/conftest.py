"""What all tests share: which modules are imported by name, and what runs first."""

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
    str(ROOT / "tests" / folder) for folder in ("oracle", "lab", "digital", "site", "fuzz", "outputs")
]
# last, since one of the tools is called like Python's module site
sys.path += [str(ROOT / "tools")]

# one test in so many runs, drawn anew each time; workers are given the number that the draw begins from
DRAW = int(os.environ.get("DRAW", "1"))
os.environ.setdefault("DRAW_SEED", str(random.SystemRandom().randrange(10**6)))
# pages in a browser, notebooks, searches
LONG = ("tests/site/", "book/", "tests/plant/test_running_loop.py", "tests/optimal/")


@pytest.hookimpl(tryfirst=True)  # before kernels are started, which would make it, too
def pytest_configure(config):
    """Have machine code that is not there made once, by two processes: each worker would make most of it again."""
    if hasattr(config, "workerinput") or not config.getoption("numprocesses", None):
        return
    from pidalab._compiled import TIER, stamp

    TIER.begin()
    if not TIER.ready or stamp().is_file():
        return
    halves = [
        subprocess.Popen([sys.executable, "-c", f"from pidalab.warm_up import {part}; {part}()"])
        for part in ("respond", "sample")
    ]
    for half in halves:
        half.wait()
    subprocess.run([sys.executable, "-m", "pidalab.warm_up"], check=False)  # writes the stamp


def pytest_report_header():
    return (
        f"one test in {DRAW} is drawn: DRAW={DRAW} DRAW_SEED={os.environ['DRAW_SEED']}" if DRAW > 1 else None
    )


def drawn(item):
    """Whether a test is among those that are drawn: a notebook with all of its cells, or not at all."""
    one = item.nodeid.partition("::Cell")[0]
    return random.Random(f"{os.environ['DRAW_SEED']} {one}").randrange(DRAW) == 0


@pytest.hookimpl(tryfirst=True)  # before another plugin shuffles them
def pytest_collection_modifyitems(config, items):
    """Long files first: one that starts last keeps one processor busy and the others waiting."""
    if DRAW > 1:
        config.hook.pytest_deselected(items=[item for item in items if not drawn(item)])
        items[:] = [item for item in items if drawn(item)]
    items.sort(
        key=lambda item: next((k for k, path in enumerate(LONG) if item.nodeid.startswith(path)), len(LONG))
    )


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
    """End a run that left tests out with what they were and what they need."""
    yield
    skipped = terminalreporter.stats.get("skipped", [])
    if not skipped:
        return
    terminalreporter.write_sep("=", f"{len(skipped)} tests did not run", yellow=True)
    reasons = Counter((report.fspath, report.longrepr[2].removeprefix("Skipped: ")) for report in skipped)
    for reason in sorted({reason for _, reason in reasons}):
        where = [f"{path} ({n})" for (path, other), n in sorted(reasons.items()) if other == reason]
        terminalreporter.write_line(f"{reason}\n    {', '.join(where)}")
