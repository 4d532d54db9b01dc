"""One function for many things at once, on all processors, in the order of the things."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import Executor, ThreadPoolExecutor
from functools import partial
from typing import Any

from tqdm import tqdm

TASKS = 64  # about so many chunks go to the workers


def each(
    name: str,
    function: Callable[[Any], Any],
    things: Iterable[Any],
    executor: Executor | None,
    progress: bool,
) -> list[Any]:
    """Return function(thing) for every thing; an error names the first that failed.

    By default threads do it, one for each processor that this process may use: compiled code lets go of the
    interpreter. Another executor is left open.
    """
    try:
        things = list(things)
    except TypeError:
        raise TypeError(f"{name} must be a sequence, found {type(things).__name__}") from None
    if executor is None:
        with ThreadPoolExecutor(
            len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None
        ) as threads:
            return each(name, function, things, threads, progress)
    if not isinstance(executor, Executor):
        raise TypeError(
            f"executor must be a concurrent.futures.Executor or None, found {type(executor).__name__}"
        )
    size = -(-len(things) // TASKS) or 1
    starts = range(0, len(things), size)
    found: list[Any] = []
    with tqdm(total=len(things), disable=not progress) as bar:
        for part in executor.map(
            partial(_chunk, name, function), starts, [things[i : i + size] for i in starts]
        ):
            found.extend(part)
            bar.update(len(part))
    return found


def _chunk(name: str, function: Callable[[Any], Any], start: int, things: list[Any]) -> list[Any]:
    found = []
    for i, thing in enumerate(things, start=start):
        try:
            found.append(function(thing))
        except (TypeError, ValueError, ArithmeticError) as reason:
            raise type(reason)(f"{name}[{i}]: {reason}") from reason
    return found
