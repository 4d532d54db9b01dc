"""A portrait on file: what is done stays done, when it is interrupted, when a worker is lost, when the power fails."""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from pidalab._check import Array
from pidalab.digital import DigitalController
from pidalab.process import Process

EVERY = 10.0  # seconds between two writings


class Kept:
    """Measures and missing sets of one portrait in a file; without a path, nothing is read or written."""

    def __init__(self, path: str | os.PathLike[str] | None, *what: Any) -> None:
        if path is not None and not isinstance(path, (str, os.PathLike)):
            raise TypeError(f"resume must be the path of a file, found {path!r}")
        self.path = None if path is None else Path(path)
        self.digest = digest(what) if self.path else ""
        self.written = time.monotonic()

    def load(self, raw: Array, missing: Any) -> None:
        """Take over what the file has, or raise if it is the file of something else."""
        if self.path is None:
            return
        if not self.path.parent.is_dir():
            raise ValueError(f"resume must be in a folder that exists, found {self.path}")
        if not self.path.exists():
            return
        try:
            with np.load(self.path, allow_pickle=False) as file:
                found = {name: file[name] for name in ("digest", "raw", "missing")}
        except (OSError, ValueError, KeyError, EOFError) as reason:
            raise ValueError(
                f"resume must be a file that portrait wrote, found {self.path}: {reason}"
            ) from reason
        if str(found["digest"]) != self.digest:
            raise ValueError(
                f"resume: {self.path} holds another portrait, of other sets, times, signals or limits, or of another "
                "process; take another name, or remove it"
            )
        raw[:], missing[:] = found["raw"], found["missing"]

    def save(self, raw: Array, missing: Any, now: bool = False) -> None:
        """Write the file, at once or if the last time was long ago; it is replaced as a whole."""
        if self.path is None or not (now or time.monotonic() - self.written > EVERY):
            return
        fresh = self.path.with_name(f"{self.path.name}.{os.getpid()}")
        with fresh.open("wb") as file:
            np.savez(file, digest=np.array(self.digest), raw=raw, missing=missing)
        os.replace(fresh, self.path)
        self.written = time.monotonic()


def digest(value: Any) -> str:
    """Return a fingerprint of numbers, arrays, processes, controllers and tuples of them."""
    sponge = hashlib.sha256()
    _feed(sponge, value)
    return sponge.hexdigest()


def _feed(sponge: Any, value: Any) -> None:
    if isinstance(value, np.ndarray) and value.dtype != object:
        value = np.ascontiguousarray(value)
        sponge.update(f"{value.dtype}{value.shape}".encode() + value.tobytes())
        return
    if isinstance(value, np.ndarray):
        value = [value.shape, *value.flat]
    elif isinstance(value, Process):
        value = [value.num, value.den, value.delay]
    elif isinstance(value, DigitalController):
        value = [(field.name, getattr(value, field.name)) for field in fields(value) if field.compare]
    elif isinstance(value, Mapping):
        value = sorted(value.items())
    if isinstance(value, (tuple, list)):
        sponge.update(f"[{len(value)}".encode())
        for one in value:
            _feed(sponge, one)
    else:
        sponge.update(f"{type(value).__name__}{value!r};".encode())
