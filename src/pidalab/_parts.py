"""Run tasks in this process, or in parallel with an executor of threads, processes or a cluster."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor, as_completed
from typing import TypeVar

Part = TypeVar("Part")
Result = TypeVar("Result")


def require_executor(executor: object) -> None:
    """Raise unless `executor` is None or an executor."""
    if not isinstance(executor, Executor | None):
        raise TypeError(f"executor must be an Executor or None, found {type(executor).__name__}")


def done(
    work: Callable[[Part], Result], parts: Sequence[Part], executor: Executor | None, unit: str
) -> list[Result]:
    """Return the results of all tasks in order, with a progress bar in a terminal."""
    from tqdm import tqdm

    # Show no bar in the first second, or without a terminal.
    bar = {"unit": unit, "disable": None, "delay": 1.0}
    if executor is None:
        return [work(part) for part in tqdm(parts, **bar)]
    runs = {executor.submit(work, part): k for k, part in enumerate(parts)}
    results = {runs[run]: run.result() for run in tqdm(as_completed(runs), total=len(runs), **bar)}
    return [results[k] for k in range(len(parts))]
