"""Margins of many loops at once."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor

from pidalab._many import each
from pidalab.loop import Loop
from pidalab.robustness.margins import Margins, margins


def margins_many(
    loops: Sequence[Loop], executor: Executor | None = None, progress: bool = False
) -> list[Margins]:
    """Margins of many loops, on all processors.

    Parameters
    ----------
    loops : sequence of Loop
        The loops, stable or not.
    executor : concurrent.futures.Executor, optional
        Who computes: by default one thread for each processor that this process may use. It is left open.
    progress : bool, optional
        Whether to show a progress bar.

    Returns
    -------
    list of Margins
        As `margins` returns them, in the order of the loops.

    Raises
    ------
    TypeError, ValueError, ArithmeticError
        As `margins`, with the number of the loop.

    Examples
    --------
    >>> import pidalab
    >>> loops = [pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), gain) for gain in (0.3, 0.4, 0.5)]
    >>> [round(one.ms, 3) for one in pidalab.margins_many(loops)]
    [1.307, 1.438, 1.59]
    """
    return each("loops", margins, loops, executor, progress)
