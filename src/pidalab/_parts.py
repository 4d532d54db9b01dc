"""Parallel work on tasks, in this process, in threads, in other processes, or in the executor of a cluster."""

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
    """Return the results of all tasks in order, with a progress bar in a terminal or notebook."""
    from tqdm import tqdm

    # Show no bar for tasks of less than a second, or if there is no terminal.
    bar = {"unit": unit, "disable": None, "delay": 1.0}
    if executor is None:
        return [work(part) for part in tqdm(parts, **bar)]
    runs = {executor.submit(work, part): k for k, part in enumerate(parts)}
    results = {runs[run]: run.result() for run in tqdm(as_completed(runs), total=len(runs), **bar)}
    return [results[k] for k in range(len(parts))]
