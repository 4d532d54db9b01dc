"""Kernels: functions that exist in plain Python and as machine code, which numba compiles and stores.

Importing numba takes longer than a short computation, and compiling takes up to a minute. A process therefore starts
with the plain forms. Their results differ from those of compiled code only by rounding. After a second in plain forms,
the process switches to compiled code if the code of all kernels is stored. Otherwise it starts another process that
compiles in the background. A call with large arguments waits for compiled code. Without numba every call uses the
plain form.

If ``PIDALAB_COMPILE=1``, a process waits for compiled code from its first call. With ``PIDALAB_COMPILE=0``, or numba's
own ``NUMBA_DISABLE_JIT=1``, only plain forms are used. Compiled code is stored in ``NUMBA_CACHE_DIR`` if that is set.
Otherwise it is stored in ``__pycache__`` of the package, or in the user's cache if the package is not writable.
"""

from __future__ import annotations

import logging
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable
from functools import cached_property, update_wrapper
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import CellType, FunctionType
from typing import Any

import numpy as np

LOG = logging.getLogger("pidalab")
PACKAGE = Path(__file__).parent
KERNELS = PACKAGE / "simulation"  # folder of all kernels
LARGE = 50_000  # a call waits for compiled code if its arguments contain more numbers than this
PLAIN_SECONDS = 1.0  # time in plain forms before each search for compiled code
# Time before a second attempt to compile. Each later wait is four times as long as the previous one.
RETRY_SECONDS = 600.0
MOST_ATTEMPTS = 6


class Kernel:
    """A function in plain and compiled form.

    The plain form calls the plain forms of other kernels. The compiled form calls their compiled forms.

    Parameters
    ----------
    function : callable
        Function that numba compiles.
    form : callable
        Plain form: the same function, or a version with array operations instead of loops.
    options : dict
        Further options of numba.
    """

    def __init__(
        self, function: Callable[..., Any], form: Callable[..., Any], options: dict[str, Any]
    ) -> None:
        self.function, self.form, self.options = function, form, options
        update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        """Call the compiled or the plain form, as `TIER` decides."""
        if TIER.compiles(arguments):
            return self.dispatcher(*arguments)
        return TIER.run(self.python_form, arguments)

    @cached_property
    def dispatcher(self) -> Any:
        """The compiled form."""
        import numba

        config: Any = numba.config
        # The option `fastmath` is not used, since it allows numba to fuse multiplications with additions. Simulations
        # must give the same bits as the C and Python programs that pidalab writes.
        options: Any = {"nogil": True, "error_model": "numpy", **self.options}
        if "inline" in options:
            return numba.njit(**self.options)(self.function)
        chosen, folder = config.CACHE_DIR, code_folder()
        config.CACHE_DIR = str(folder or chosen)
        try:
            return numba.njit(cache=True, **options)(self.function)
        except RuntimeError:  # numba found no folder that it can write to
            return numba.njit(**options)(self.function)
        finally:
            config.CACHE_DIR = chosen

    @cached_property
    def python_form(self) -> Callable[..., Any]:
        """The plain form, with the plain forms of the kernels that it calls."""
        names = dict(self.form.__globals__)
        cells = self.form.__closure__
        plain_function = FunctionType(
            self.form.__code__,
            names,
            self.form.__name__,
            self.form.__defaults__,
            cells and tuple(CellType(_python_form(cell.cell_contents)) for cell in cells),
        )
        self.__dict__["python_form"] = (
            plain_function  # set before the next line, since kernels may call each other
        )
        names.update({name: _python_form(value) for name, value in names.items()})
        return plain_function

    # numba reads the following attributes if compiled code calls this kernel.
    @property
    def _numba_type_(self) -> Any:
        return self.dispatcher._numba_type_

    @property
    def targetoptions(self) -> Any:
        """Options of numba, which also say whether callers inline the kernel."""
        return self.dispatcher.targetoptions

    @property
    def py_func(self) -> Callable[..., Any]:
        return self.function


def compiled(function: Callable[..., Any]) -> Any:
    """Turn a function into a kernel. Its compiled form releases the interpreter's lock.

    All kernels are in `pidalab.simulation`. If a source file there changes, all kernels are compiled again.
    """
    return Kernel(function, function, {})


def plain(form: Callable[..., Any]) -> Callable[[Callable[..., Any]], Any]:
    """Turn a function into a kernel whose plain form is `form`."""
    return lambda function: Kernel(function, form, {})


def inlined(function: Callable[..., Any]) -> Any:
    """Turn a function into a kernel that compiled callers inline."""
    return Kernel(function, function, {"inline": "always"})


def _python_form(value: Any) -> Any:
    return value.python_form if isinstance(value, Kernel) else value


class Tier:
    """Choice between plain and compiled forms for all calls of this process.

    Attributes
    ----------
    allowed : bool or None
        True if kernels may be compiled. None before the first call.
    ready : bool
        True if all calls use compiled code.
    spent : float
        Seconds spent in plain forms since the last search for compiled code.
    """

    def __init__(self) -> None:
        self.allowed: bool | None = None
        self.ready = False
        self.spent = 0.0

    def compiles(self, arguments: tuple[Any, ...]) -> bool:
        """Return True if a call should use compiled code.

        If no compiled code is stored after a second in plain forms, start to compile in the background.
        """
        if self.allowed is None:
            self.begin()
        if self.ready or not self.allowed:
            return self.ready
        large = sum(getattr(argument, "size", 1) for argument in arguments) > LARGE
        if large or self.spent > PLAIN_SECONDS:
            self.spent, self.ready = 0.0, is_complete() and self.imports()
            if not (self.ready or large):
                compile_in_background()
        return self.ready or (large and self.imports())

    def begin(self) -> None:
        """Find out whether the environment allows compiled code, and whether numba is installed."""
        wish = os.environ.get("PIDALAB_COMPILE", "")
        off = wish == "0" or os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
        try:
            self.allowed = not off and bool(version("numba"))
        except PackageNotFoundError:
            self.allowed = False
            LOG.info("pidalab: without numba, simulations are slower; results differ only by rounding")
        self.ready = self.allowed and wish == "1" and self.imports()

    def imports(self) -> bool:
        """Return True if numba can be imported. If not, use plain forms from now on."""
        try:
            import numba  # noqa: F401
        except ImportError:
            self.allowed = False
        if self.allowed and not is_complete():
            LOG.info("pidalab: compiling for this machine (up to a minute); later runs skip this")
        return bool(self.allowed)

    def run(self, form: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        """Call a plain form. Suppress NumPy's floating-point warnings during the call."""
        start = time.perf_counter()
        with np.errstate(all="ignore"):
            try:
                return form(*arguments)
            finally:
                self.spent += time.perf_counter() - start


TIER = Tier()


def _cache_folder() -> Path | None:
    """Return the folder that stores compiled code, or None if no folder is writable."""
    home = os.path.expanduser("~")  # stays "~" if the user has no home folder
    user = os.environ.get("LOCALAPPDATA") or os.environ.get("XDG_CACHE_HOME") or os.path.join(home, ".cache")
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    for folder in [Path(chosen)] if chosen else [PACKAGE / "__pycache__", Path(user, "pidalab")]:
        present = next(parent for parent in (folder, *folder.parents) if parent.exists() or not parent.name)
        if (folder.is_absolute() or chosen) and present.is_dir() and os.access(present, os.W_OK):
            return folder
    return None


def code_folder() -> Path | None:
    """Return the folder of compiled code, or None. The name depends on sources, Python, numba, machine and options."""
    cache = _cache_folder()
    if cache is None:
        return None
    options = sorted(
        (k, v) for k, v in os.environ.items() if k.startswith("NUMBA_") and k != "NUMBA_CACHE_DIR"
    )
    paths = [Path(__file__), *sorted(KERNELS.glob("*.py"))]
    states = [(path.name, path.stat().st_mtime, path.stat().st_size) for path in paths]
    key = (sys.version, version("numba"), platform.machine(), options, states)
    return cache / f"compiled-{sha256(repr(key).encode()).hexdigest()[:16]}"


def is_complete() -> bool:
    """Return True if compiled code of all kernels is stored."""
    folder = code_folder()
    return folder is not None and (folder / "complete").is_file()


def declare_complete() -> None:
    """Record that all kernels are compiled. Raise OSError if no code was stored."""
    folder = code_folder()
    if folder is None or not any(folder.rglob("*.nbi")):
        raise OSError(f"no compiled code of pidalab was stored in {folder or 'any folder'}")
    (folder / "complete").touch()
    for attempt in folder.glob("attempt-*"):
        attempt.unlink(missing_ok=True)


def compile_in_background() -> None:
    """Start a process that compiles all kernels, unless an attempt is running or has just failed.

    Each attempt creates a numbered file, which it removes on success. Only one process can create a file with a given
    number, so two processes never start the same attempt. If an attempt failed or was killed, its file delays the next
    attempt.
    """
    state = code_folder()
    if state is None or not sys.executable:
        return
    # On Windows the process is detached, in a new group and below normal priority. Elsewhere the process lowers its own
    # priority.
    apart: Any = {"creationflags": 0x00004208} if os.name == "nt" else {"start_new_session": True}
    closed: Any = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    # Start in the folder that contains the package. Put this folder last on the path, so that no file in it hides
    # another module.
    parent = str(PACKAGE.parent)
    script = f"import sys; sys.path.append({parent!r}); from pidalab.warm_up import main; main()"
    try:
        state.mkdir(parents=True, exist_ok=True)
        attempts = len(list(state.glob("attempt-*")))
        if attempts:
            age = time.time() - (state / f"attempt-{attempts}").stat().st_mtime
            if abs(age) < RETRY_SECONDS * 4 ** (attempts - 1) or attempts >= MOST_ATTEMPTS:
                return
        (state / f"attempt-{attempts + 1}").touch(exist_ok=False)
        subprocess.Popen(
            [sys.executable, "-P", "-c", script],
            cwd=parent,
            close_fds=True,
            env={**os.environ, "PIDALAB_COMPILE": "1"},
            **closed,
            **apart,
        )
    except OSError:  # another process was faster, or this process cannot write or start a process
        return
