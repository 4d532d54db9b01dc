"""Measure durations and errors, limit the time of a task, and write the tables that the book reads.

If the tests have a high-precision oracle for a loop, errors are computed from its values.
"""

from __future__ import annotations

import csv
import json
import math
import os
import platform
import re
import signal
import statistics
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import TypeVar

import control
import numpy as np

import pidalab

T = TypeVar("T")

ORACLES = Path(__file__).parents[1] / "tests" / "oracle"
DATA = Path(__file__).parents[1] / "book" / "data"
PACKAGES = ("pidalab", "numpy", "scipy", "numba", "control", "jitcdde", "ddeint")


def oracle_cases(name: str) -> list[dict]:
    """Return the cases of one oracle file."""
    return json.loads((ORACLES / name).read_text(encoding="utf-8"))["cases"]


def case_loop(case: dict) -> pidalab.Loop:
    """Return the loop of a case, with exactly the coefficients in the file."""

    def block(name: str) -> control.TransferFunction | None:
        return control.tf(case[name]["num"], case[name]["den"]) if case[name] else None

    process = pidalab.Process(case["process"]["num"], case["process"]["den"], case["delay"])
    return pidalab.Loop(process, block("controller") or 1.0, block("output_filter"), block("prefilter"))


def again(loop: pidalab.Loop) -> pidalab.Loop:
    """Return a new loop of the same blocks, without cached results."""
    return pidalab.Loop(loop.process, loop.controller, loop.output_filter, loop.prefilter)


def duration(task: Callable[[], T], runs: int = 1) -> tuple[float, T]:
    """Return the CPU time of a run in seconds, and its result."""
    start = time.process_time()
    for _ in range(runs):
        result = task()
    return (time.process_time() - start) / runs, result


def median_time(task: Callable[[], object], repeats: int = 5) -> float:
    """Return the median duration after warm-up runs.

    Each repetition consists of runs for a tenth of a second, since some clocks tick only every few milliseconds.
    """
    runs = 1
    while (once := duration(task, runs)[0]) * runs < 0.02:
        runs *= 4
    runs = math.ceil(0.1 / once)
    return statistics.median(duration(task, runs)[0] for _ in range(repeats))


def clocked(task: Callable[[], T], repeats: int = 3) -> tuple[float, float, T]:
    """Return elapsed time and CPU time of all threads for the fastest of several runs, and the result.

    Use this function for tasks on all processors.
    """
    runs = []
    for _ in range(repeats):
        clock, cpu = time.perf_counter(), time.process_time()
        result = task()
        runs.append((time.perf_counter() - clock, time.process_time() - cpu))
    return *min(runs), result


@contextmanager
def limit(seconds: int) -> Iterator[None]:
    """Raise TimeoutError when the block has taken this CPU time."""
    over = f"stopped after {seconds} s"
    fired = False

    def stop(*_: object) -> None:
        nonlocal fired
        fired = True
        raise TimeoutError(over)

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    except Exception as reason:
        if fired:  # compiled code may have replaced the exception by another
            raise TimeoutError(over) from reason
        raise
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def error(t: np.ndarray, y: np.ndarray, case: dict) -> float:
    """Return the largest error at the times of the oracle that lie on the uniform grid t.

    The error is relative to max(1, |y|). For a response that grows, |y| is its largest value so far. If y is NaN, the
    error is infinite.
    """
    exact = np.array([float(text) for text in case["values"]["setpoint"]["y"]])
    times = np.array(case["times"])
    scale = np.maximum(1.0, np.abs(exact))
    if "envelope" in case:
        scale = np.maximum(scale, case["envelope"]["setpoint"]["y"])
    i = np.minimum(np.rint(times / t[-1] * (t.size - 1)).astype(int), t.size - 1)
    on_grid = np.abs(t[i] - times) < 1e-12 * t[-1]
    worst = np.max(np.abs(y[i] - exact)[on_grid] / scale[on_grid])
    return float(worst) if np.isfinite(worst) else np.inf


def machine() -> str:
    """Describe Python, the packages, the processors, and the load of the machine."""
    told = Path("/proc/cpuinfo")  # other systems have no such file
    found = re.search(
        r"^model name\s*: (.*)$",
        told.read_text(encoding="utf-8") if told.exists() else "",
        flags=re.MULTILINE,
    )
    processor = found[1] if found else platform.processor() or platform.machine()
    speed = (
        re.search(r"^cpu MHz\s*: (.*)$", told.read_text(encoding="utf-8"), flags=re.MULTILINE)
        if found
        else None
    )
    clock = f" at {float(speed[1]) / 1e3:.1f} GHz" if speed else ""
    used = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    busy = f", load average {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return f"Python {platform.python_version()}, {used}; {os.cpu_count()} processors {processor}{clock}{busy}"


def write(name: str, columns: Iterable[str], rows: Iterable[dict]) -> None:
    """Write a table that the book reads, with three digits for each number and a comment that names the machine."""
    with (DATA / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
        file.write(f"# Made by `make bench` with {machine()}\n")
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({key: f"{x:.3g}" if isinstance(x, float) else x for key, x in row.items()})
