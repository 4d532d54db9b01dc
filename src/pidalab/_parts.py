"""Work in parts, by whoever computes: this process, threads, processes, or the executor of a cluster."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor, as_completed
from typing import TypeVar

Part = TypeVar("Part")
Result = TypeVar("Result")


def require_executor(executor: object) -> None:
    """Refuse what is no executor."""
    if not isinstance(executor, Executor | None):
        raise TypeError(f"executor must be an Executor or None, found {type(executor).__name__}")


def done(
    work: Callable[[Part], Result], parts: Sequence[Part], executor: Executor | None, unit: str
) -> list[Result]:
    """Return the result of each part, in their order, with a bar of what is finished where somebody looks."""
    from tqdm import tqdm

    # no bar for what takes a second, or is read by no person
    bar = {"unit": unit, "disable": None, "delay": 1.0}
    if executor is None:
        return [work(part) for part in tqdm(parts, **bar)]
    runs = {executor.submit(work, part): k for k, part in enumerate(parts)}
    results = {runs[run]: run.result() for run in tqdm(as_completed(runs), total=len(runs), **bar)}
    return [results[k] for k in range(len(parts))]
