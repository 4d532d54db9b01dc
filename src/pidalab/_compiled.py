"""Functions that numba compiles where it is installed, and that run as plain Python where it is not.

The machine code is kept between runs, and a line on stderr announces that it has to be made anew.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import cache, wraps
from pathlib import Path
from typing import Any

import numpy as np

LOG = logging.getLogger("pidalab")

numba: Any
try:
    import numba
    from numba.core import event
except ImportError:
    numba = None
    LOG.warning("pidalab: numba is not installed; the same digits within rounding, slower")


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function when it is first called, without the interpreter's lock.

    The machine code is kept beside the source, or in the user's cache where that cannot be written to (or in
    ``NUMBA_CACHE_DIR``). Where nothing can be written, each process compiles for itself. A compiled function calls only
    those of its own folder, and is compiled anew when a file there, or this one, has changed. Without numba it is the
    function itself, which divides by zero as numpy does, in silence.
    """
    if numba is None:
        return _in_silence(function)
    # no fused multiply-add: what is written out as C or Python is to give the same bits
    options: Any = {"nogil": True, "error_model": "numpy"}
    try:
        dispatcher = numba.njit(cache=True, **options)(function)
    except RuntimeError:  # numba found no place for its cache
        return numba.njit(**options)(function)
    kept = dispatcher._cache._cache_file
    kept._source_stamp = (kept._source_stamp, _changed(Path(function.__code__.co_filename).parent))
    return dispatcher


def inlined(function: Callable[..., Any]) -> Any:
    """Make a function a part of the compiled functions that call it."""
    return function if numba is None else numba.njit(inline="always")(function)


def plain(form: Callable[..., Any]) -> Callable[[Callable[..., Any]], Any]:
    """Give a compiled function another form for plain Python, with array operations in place of loops."""
    return lambda function: compiled(form if numba is None else function)


def _in_silence(function: Callable[..., Any]) -> Any:
    @wraps(function)
    def silent(*arguments: Any) -> Any:
        with np.errstate(all="ignore"):
            return function(*arguments)

    return silent


@cache
def _changed(folder: Path) -> tuple[tuple[str, float, int], ...]:
    """Names, times and sizes of a folder's source files; numba itself looks at one file alone."""
    stats = ((path.name, path.stat()) for path in [Path(__file__), *sorted(folder.glob("*.py"))])
    return tuple((name, stat.st_mtime, stat.st_size) for name, stat in stats)


if numba is not None:

    class _Announcer(event.Listener):
        """Says once in a process that code of this library is being compiled."""

        said = False

        def on_start(self, event: event.Event) -> None:
            """Speak before the first compilation."""
            function = event.data["dispatcher"].py_func
            if not self.said and function.__module__.startswith("pidalab."):
                self.said = True
                LOG.warning("pidalab: compiling for this machine; later runs find it done (up to a minute)")

        def on_end(self, event: event.Event) -> None:
            """Say nothing."""

    event.register("numba:compile", _Announcer())  # type: ignore[no-untyped-call]
