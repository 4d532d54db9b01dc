"""The 134 processes with which Åström and Hägglund developed and tested their rules, in nine families.

Åström and Hägglund, Revisiting the Ziegler-Nichols step response method for PID control, J. Process Control 14 (2004)
635-650; Advanced PID Control, ISA 2006, section 7.3.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from pidalab.process import Process, fopdt, lags

P1 = (0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1, 1.3, 1.5, 2, 4, 6, 8, 10, 20, 50, 100, 200, 500, 1000)
P2 = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1, 1.3, 1.5, 2, 4, 6, 8, 10, 20, 50, 100, 200, 500)
P3 = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 2, 5, 10)
P4 = (3, 4, 5, 6, 7, 8)
P5 = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
P6 = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9, 1)
P7 = ((1, 2, 5, 10), (0.01, 0.02, 0.05, 0.1, 0.3, 0.5, 0.7, 0.9, 1))
P8 = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1)
P9 = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)


class Case(NamedTuple):
    """A process of the batch."""

    name: str
    family: str
    process: Process


def _product(times: tuple[float, ...], num: tuple[float, ...] = (1.0,), delay: float = 0.0) -> Process:
    """Return a process with dead time: num divided by the product of all 1 + T s. A time T of 0 is left out."""
    den = np.ones(1)
    for time in times:
        den = np.convolve(den, [time, 1.0]) if time else den
    return Process(list(num), den, delay)


def _integrating(delay: float) -> Process:
    lag = 1.0 - delay
    return Process([1.0], [lag, 1.0, 0.0] if lag > 0 else [1.0, 0.0], delay)


def batch() -> Iterator[Case]:
    """Yield all processes, family by family."""
    yield from (Case(f"P1 T={T:g}", "P1", fopdt(1.0, T, 1.0)) for T in P1)
    yield from (Case(f"P2 T={T:g}", "P2", lags(2, T, delay=1.0)) for T in P2)
    yield from (Case(f"P3 T={T:g}", "P3", _product((1.0, T, T))) for T in P3)
    yield from (Case(f"P4 n={n}", "P4", lags(n)) for n in P4)
    yield from (Case(f"P5 a={a:g}", "P5", _product((1.0, a, a**2, a**3))) for a in P5)
    yield from (Case(f"P6 L={L:g}", "P6", _integrating(L)) for L in P6)
    for T in P7[0]:
        yield from (Case(f"P7 T={T} L={L:g}", "P7", _product((T, 1.0 - L), delay=L)) for L in P7[1])
    yield from (Case(f"P8 a={a:g}", "P8", _product((1.0, 1.0, 1.0), num=(-a, 1.0))) for a in P8)
    for time in P9:
        den = np.convolve([1.0, 1.0], [time**2, 1.4 * time, 1.0])
        yield Case(f"P9 T={time:g}", "P9", Process([1.0], den))
