"""What was done to the input of a plant: its steps, and the name of the experiment."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.plant.record.cleaning import first_few

CREEP = 0.1  # share of the input's span by which a level may move and still be one
SHORTEST_LEVEL = 4  # samples that a level of the input takes at least
MANY = 12  # levels of the input, in steps of a hundredth of its span
FOLLOWS = 0.98  # share of the movement of the input that the output explains, from which it follows
FOLLOWER = "it follows the output, as in a loop at a constant set point"
MOVING = "it moves all the time, as in a closed loop or by a test signal"


class Step(NamedTuple):
    """A change of the input from one level to another.

    Attributes
    ----------
    time : float
        When, in the record's own time.
    before, after : float
        The levels, in the unit of u.
    """

    time: float
    before: float
    after: float


def find_steps(t: Array, u: Array, before: float) -> tuple[Step, ...]:
    """Changes of the input between levels that last; a ramp over a few samples is one change, at its middle."""
    # before the record the input was at rest for long enough to be a level
    t, u = np.append(np.full(SHORTEST_LEVEL, t[0]), t), np.append(np.full(SHORTEST_LEVEL, before), u)
    span = np.ptp(u)
    quiet = np.abs(np.diff(u)) <= 0.02 * span
    edges = np.flatnonzero(np.diff(np.concatenate([[0], quiet, [0]]).astype(int)))
    runs = [  # samples a to b are one level, unless the input creeps away from it
        (a, b)
        for a, b in zip(edges[::2], edges[1::2], strict=True)
        if b - a >= SHORTEST_LEVEL - 1 and np.ptp(np.quantile(u[a : b + 1], [0.02, 0.98])) <= CREEP * span
    ]
    if not runs or sum(b - max(a, SHORTEST_LEVEL) for a, b in runs if b > SHORTEST_LEVEL) < 0.7 * (
        t.size - SHORTEST_LEVEL - 1
    ):
        return ()
    levels = [float(np.median(u[a : b + 1])) for a, b in runs]
    found = []
    for (_, left), (right, _), low, high in zip(runs, runs[1:], levels, levels[1:], strict=False):
        if abs(high - low) > 0.05 * span:
            # a jump between two samples happens at the later one, from which the new value is held
            middle = 0.5 * (low + high)
            crossed = left + int(np.argmax(np.abs(u[left : right + 1] - low) >= np.abs(middle - low)))
            found.append(Step(float(t[crossed]), low, high))
    return tuple(found)


def name_experiment(steps: tuple[Step, ...], t: Array, u: Array, y: Array) -> str:
    """Name what was done to the input."""
    levels = np.unique(np.round((u - u.min()) / (np.ptp(u) or 1.0), 2))
    if levels.size == 2 and (len(steps) > 3 or not steps):
        return "a binary test signal (PRBS)"
    if len(steps) == 1:
        return "a step"
    if steps and levels.size < MANY:
        back = abs(steps[-1].after - steps[0].before) <= CREEP * np.ptp(u)
        return {2: "a pulse", 3: "a doublet"}.get(len(steps), "several steps") if back else "several steps"
    drift = np.vander((t - t[0]) / np.ptp(t), 2)
    rest = u - drift @ np.linalg.lstsq(drift, u, rcond=None)[0]
    if rest @ rest < 0.02 * np.sum((u - u.mean()) ** 2):
        return "a ramp"
    even = np.interp(np.linspace(t[0], t[-1], t.size), t, u - u.mean())
    power = np.abs(np.fft.rfft(even * np.hanning(t.size))) ** 2
    peak = int(np.argmax(power))
    if peak > 2 and power[peak - 2 : peak + 3].sum() > 0.9 * power.sum():
        return "a sine"
    # a controller at a constant set point: proportional and integral of the output, and nothing else. Where the
    # input is the cause, a later output explains it better
    integral = np.append(0.0, np.cumsum(np.diff(t) * 0.5 * (y[1:] + y[:-1] - 2 * y[0])))
    scaled = np.column_stack([y / np.ptp(y), integral / (np.ptp(integral) or 1.0)])

    def left(later: int) -> float:
        seen = t.size - later
        basis = np.column_stack([drift[:seen], scaled[later:]])
        return float(np.mean((u[:seen] - basis @ np.linalg.lstsq(basis, u[:seen], rcond=None)[0]) ** 2))

    lags = range(1, t.size // 4, t.size // 40 or 1)
    if left(0) < min((1 - FOLLOWS) * float(np.mean(rest**2)), *map(left, lags)):
        return FOLLOWER
    return "steps to many levels" if steps else MOVING


def described(steps: tuple[Step, ...]) -> str:
    """List the first steps in words."""
    return first_few([f"step from {s.before:.6g} to {s.after:.6g} at {s.time:.6g}" for s in steps]) or "none"
