"""Functions in two forms: plain Python, which answers at once, and machine code, which numba makes and keeps.

Making the machine code takes longer than most first answers. So a process that finds none uses the plain forms, which
give the same digits within rounding, and starts another process that makes it. The code is used as soon as it is there,
or is waited for where a call is so large that waiting pays. Without numba all is plain.

``PIDALAB_COMPILE=1`` in the environment makes every process wait for the code, as tests, notebooks and benchmarks do;
``PIDALAB_COMPILE=0``, or numba's own ``NUMBA_DISABLE_JIT=1``, keeps to the plain forms. Code and stamp are kept beside
the source, or in the user's cache where that cannot be written to, or in ``NUMBA_CACHE_DIR``.
"""

from __future__ import annotations

import logging
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable
from functools import cache, cached_property, update_wrapper
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import CellType, FunctionType
from typing import Any

import numpy as np

LOG = logging.getLogger("pidalab")
PACKAGE = Path(__file__).parent
LARGE = 50_000  # numbers in the arguments of a call beyond which its machine code is waited for
SOON = 1.0  # seconds of plain work after which it is asked again whether the machine code is there
STALE = 600.0  # seconds after which another process may begin anew what one has begun and not ended


class Function:
    """A function in both forms; compiled functions that call it see the compiled one, plain ones the plain one.

    Parameters
    ----------
    function : callable
        What numba compiles.
    form : callable
        Its plain form: the same function, or another with array operations in place of loops.
    options : dict
        Numba's, beside its cache.
    """

    def __init__(
        self, function: Callable[..., Any], form: Callable[..., Any], options: dict[str, Any]
    ) -> None:
        self.function, self.form, self.options = function, form, options
        update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        """Call the form that answers first."""
        if TIER.compiles(arguments):
            return self.dispatcher(*arguments)
        return TIER.run(self.twin, arguments)

    @cached_property
    def dispatcher(self) -> Any:
        """The compiled form, whose machine code is kept, and made anew when a file of its folder has changed."""
        import numba

        _announce()
        # no fused multiply-add: what is written out as C or Python is to give the same bits
        options: Any = {"nogil": True, "error_model": "numpy", **self.options}
        if "inline" in options:
            return numba.njit(**self.options)(self.function)
        try:
            found = numba.njit(cache=True, **options)(self.function)
        except RuntimeError:  # numba found no place for its cache
            return numba.njit(**options)(self.function)
        kept = found._cache._cache_file
        kept._source_stamp = (kept._source_stamp, _changed(Path(self.function.__code__.co_filename).parent))
        return found

    @cached_property
    def twin(self) -> Callable[..., Any]:
        """The plain form, which calls the plain forms of others."""
        names = dict(self.form.__globals__)
        cells = self.form.__closure__
        made = FunctionType(
            self.form.__code__,
            names,
            self.form.__name__,
            self.form.__defaults__,
            cells and tuple(CellType(_plain_form(cell.cell_contents)) for cell in cells),
        )
        self.__dict__["twin"] = made  # before the others: functions may call each other
        names.update({name: _plain_form(value) for name, value in names.items()})
        return made

    # what numba asks of a function that compiled code calls
    @property
    def _numba_type_(self) -> Any:
        return self.dispatcher._numba_type_

    @property
    def targetoptions(self) -> Any:
        """Numba's options, which say whether it is made a part of its callers."""
        return self.dispatcher.targetoptions

    @property
    def py_func(self) -> Callable[..., Any]:
        """What numba compiles."""
        return self.function


def compiled(function: Callable[..., Any]) -> Any:
    """Give a function its two forms; the compiled one runs without the interpreter's lock.

    A compiled function calls only those of its own folder.
    """
    return Function(function, function, {})


def plain(form: Callable[..., Any]) -> Callable[[Callable[..., Any]], Any]:
    """Give a compiled function another plain form, with array operations in place of loops."""
    return lambda function: Function(function, form, {})


def inlined(function: Callable[..., Any]) -> Any:
    """Make a function a part of the compiled functions that call it."""
    return Function(function, function, {"inline": "always"})


def _plain_form(value: Any) -> Any:
    return value.twin if isinstance(value, Function) else value


class Tier:
    """Which form the calls of this process take.

    Attributes
    ----------
    ready : bool or None
        Whether calls go to machine code; None before the first one.
    """

    def __init__(self) -> None:
        self.ready: bool | None = None
        self.allowed = False  # to compile at all
        self.depth = 0  # of plain calls
        self.asked, self.spent = 0.0, 0.0

    def compiles(self, arguments: tuple[Any, ...]) -> bool:
        """Whether a call goes to machine code, which is made if it is not there."""
        if self.ready is None:
            self.begin()
        if self.ready or not self.allowed:
            return bool(self.ready)
        large = sum(getattr(one, "size", 1) for one in arguments) > LARGE
        if self.spent > SOON or large:
            self.spent, self.ready = 0.0, stamp().is_file() and self.imports()
        return bool(self.ready) or (large and self.imports())

    def begin(self) -> None:
        """Look for machine code, and have it made if there is none."""
        wish = os.environ.get("PIDALAB_COMPILE", "")
        off = wish == "0" or os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
        try:
            self.allowed = not off and bool(version("numba"))
        except PackageNotFoundError:
            LOG.info("pidalab: numba is not installed; the same digits within rounding, slower")
        self.ready = self.allowed and (wish == "1" or stamp().is_file()) and self.imports()
        if self.allowed and not self.ready:
            have_made()

    def imports(self) -> bool:
        """Whether numba can be imported; once it cannot, all stays plain."""
        try:
            import numba  # noqa: F401
        except ImportError:
            self.allowed = False
        return self.allowed

    def run(self, twin: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        """Call a plain form, which divides by zero as numpy does, in silence."""
        begun = time.perf_counter()
        with np.errstate(all="ignore"):
            try:
                return twin(*arguments)
            finally:
                self.spent += time.perf_counter() - begun


TIER = Tier()


@cache
def stamp() -> Path:
    """Name of the file that says that all machine code is there, for these sources, this Python, numba and machine."""
    sources = _stats(sorted(PACKAGE.rglob("*.py")))
    wishes = sorted(
        (k, v) for k, v in os.environ.items() if k.startswith("NUMBA_") and k != "NUMBA_CACHE_DIR"
    )
    key = (sys.version, version("numba"), platform.machine(), platform.processor(), wishes, sources)
    return _folder() / f"compiled-{sha256(repr(key).encode()).hexdigest()[:16]}"


def _folder() -> Path:
    """Where machine code is kept, by the rules that numba follows."""
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(chosen)
    beside = PACKAGE / "__pycache__"
    if os.access(beside if beside.is_dir() else PACKAGE, os.W_OK):
        return beside
    home = os.environ.get("LOCALAPPDATA") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "pidalab"


def have_made() -> None:
    """Start a process that makes all machine code and then writes the stamp, unless one is at it."""
    lock = stamp().with_suffix(".lock")
    try:
        lock.parent.mkdir(parents=True, exist_ok=True)
        if lock.is_file() and time.time() - lock.stat().st_mtime > STALE:
            lock.unlink()
        lock.touch(exist_ok=False)
        # on Windows detached, and a group of its own
        alone: Any = {"creationflags": 0x00000208} if os.name == "nt" else {"start_new_session": True}
        quiet: Any = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
        subprocess.Popen(
            [sys.executable, "-m", "pidalab.warm_up"],
            close_fds=True,
            env={**os.environ, "PIDALAB_COMPILE": "1", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            **quiet,
            **alone,
        )
    except OSError:  # somebody else is at it, or nothing can be written
        return


@cache
def _changed(folder: Path) -> tuple[tuple[str, float, int], ...]:
    """Names, times and sizes of a folder's source files; numba itself looks at one file alone."""
    return _stats([Path(__file__), *sorted(folder.glob("*.py"))])


def _stats(paths: list[Path]) -> tuple[tuple[str, float, int], ...]:
    return tuple((path.name, path.stat().st_mtime, path.stat().st_size) for path in paths)


@cache
def _announce() -> None:
    """Let numba tell the log, once in a process, that code of this library is being compiled."""
    from numba.core import event

    class Announcer(event.Listener):
        said = False

        def on_start(self, event: event.Event) -> None:
            function = event.data["dispatcher"].py_func
            if not self.said and function.__module__.startswith("pidalab."):
                self.said = True
                LOG.info("pidalab: compiling for this machine; later runs find it done (up to a minute)")

        def on_end(self, event: event.Event) -> None:
            """Say nothing."""

    event.register("numba:compile", Announcer())  # type: ignore[no-untyped-call]
