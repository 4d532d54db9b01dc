"""What several sections of huba2018 share: its plants, orders, designs and responses, each computed once."""

import math
from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np
import pidalab
from pidalab.ledger import Ledger
from pidalab.rules import mrdp

ORDERS = range(5)  # derivative orders m of the tables
GRID = [(m, n) for m in ORDERS for n in range(max(m, 1), 7)]  # (m, n) of Table II
CANCELLED = [(m, p) for m in ORDERS for p in range(1, m + 2)]  # (m, p) of Table III
LIMITED = [(m, n) for m, n in GRID if m >= 2]  # (m, n) whose filter can be too short
GROWTH = {1.5: "q15", 2.0: "q2"}  # q of eq. (16), with the name of its rows
SHORTEST = 0.25  # T_e0 of eq. (16)
EXPERIMENTS = {"PID₄²": (2, 4, 0.2), "PID₆⁴": (4, 6, 0.8)}  # m, n, T_e in s of Figs 5 to 7
USED_DELAY = 5.0  # s, T_dm in the captions of Figs 5, 7 and 8
SAMPLE = 0.02  # s, T_s of the experiments
BANDWIDTH = 250 * math.pi  # rad per dead time: noise with 250 samples in a dead time


@cache
def unit() -> pidalab.Process:
    """Return the plant of all designs in units of its own gain and dead time."""
    return pidalab.ipdt(gain=1.0, delay=1.0)


@cache
def nominal() -> pidalab.Process:
    """Return the model behind the experiments, with the dead time of the captions."""
    return pidalab.ipdt(gain=0.01, delay=USED_DELAY)


@cache
def constants(m: int) -> mrdp.Constants:
    """Return the constants of Table I."""
    return mrdp.constants(m)


@cache
def servo_integral(m: int) -> float:
    """Integral of the error after a set-point step in units of T_d, eq. (15) with p = m + 1."""
    return (1 - mrdp.prefilter_weights(m, m + 1)[0]) * constants(m).integral_time


@cache
def load_integral(m: int) -> float:
    """Integral of the error after a load step in units of K_s T_d², T_i/K_c; the filter does not enter."""
    return constants(m).integral_time / constants(m).gain


@cache
def shortest_filter(m: int, n: int) -> float:
    """Limit of T_e/T_dm, to the six digits to which it is bisected."""
    return float(f"{mrdp.smallest_te(m, n):.6g}")


@cache
def experiment(name: str, process: pidalab.Process | None = None) -> pidalab.Loop:
    """Close the loop of a controller of Figs 5 to 7, tuned for the nominal plant."""
    m, n, te = EXPERIMENTS[name]
    return mrdp.tune(nominal(), m, n, te).loop(process)


@cache
def ruled(q: float, m: int, n: int) -> "pidalab.Design":
    """Return a design of Figs 2 and 3: T_e from eq. (16) on the unit plant."""
    return mrdp.tune(unit(), m, n, SHORTEST * q**m)


@cache
def ruled_step(q: float, m: int, n: int) -> pidalab.Response:
    """Return its set-point step."""
    return pidalab.step_response(ruled(q, m, n).loop(), np.linspace(0, 200, 10_001))


def noise_in_u(loop: pidalab.Loop, bandwidth: float = BANDWIDTH) -> float:
    """Standard deviation of u for white noise of unit deviation up to a bandwidth, from equal steps of frequency."""
    w = np.linspace(0.0, bandwidth, 10_001)[1:]
    return float(np.sqrt(np.mean(np.abs(loop.transfer("u", "n", 1j * w)) ** 2)))


def listed(values: Sequence[float], form: str = ".2f") -> str:
    """Write numbers one after the other, for a note."""
    return ", ".join(f"{value:{form}}" for value in values)


def span(values: Sequence[float], form: str = ".2g") -> str:
    """Write a range, for a note."""
    return f"{min(values):{form}} to {max(values):{form}}"


def check_all(book: Ledger, prefix: str, values: Mapping[str, float]) -> None:
    """Hand over numbers whose ids share a prefix."""
    book.check({f"{prefix}.{name}": value for name, value in values.items()})
