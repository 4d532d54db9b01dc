"""Clean the columns of a record, find probable sensor errors, and find the steps of the input."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from pidalab import _check
from pidalab._check import Array
from pidalab.plant.doubts import doubt

# Least number of samples in a record or a run. With fewer samples, the tests for outliers and feedback are skipped.
FEWEST = 20
# The time may be a counter that restarts, such as the seconds of a minute. To continue the counter, its period is added
# at each restart. A counter is assumed only if the samples before and after each restart are then at most this number
# of median intervals apart.
LONGEST_WRAP = 10
# A new run may begin where the time goes back by more than this number of median intervals. Where it goes back by less,
# the samples are only out of order.
OVERLAP = 3
# Values at which counters restart.
COUNTERS = np.sort([60.0, 3600.0, 86400.0, *10.0 ** np.arange(3, 13), 2.0**16, 2.0**32])
# A standstill of the output is reported only if it is longer than max(STILL, STILL_SHARE * number of samples) samples.
STILL, STILL_SHARE = 15, 0.05
# Before a standstill, the output moves by A in the last BEFORE sampling intervals, and by B in the last JUST_BEFORE.
BEFORE, JUST_BEFORE = 10, 3
SLOWED = 0.1  # if B / A is at most this, the plant itself came to rest
# A standstill is reported only if A exceeds both MANY_STEPS rounding steps and LITTLE times the span of the output.
MANY_STEPS, LITTLE = 2.5, 0.005
# An input is a clock if it differs from a straight line in time by less than STRAIGHT times its span. It is a copy of
# the output if it differs from a linear function of the output by less than COPY times its span.
STRAIGHT, COPY = 0.01, 1e-4
DISORDER = 0.05  # largest accepted share of samples whose time is below a preceding time
LISTED = 4  # a message lists at most this number of entries, and counts the others

Places = NDArray[np.intp]  # indices of samples


def column(name: str, value: Any) -> Array:
    """Convert a column to an array of floats, with NaN for missing values."""
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(f"{name} must be an array of real numbers, found {type(value).__name__}") from None
    if array.ndim != 1:
        raise ValueError(f"{name} must be one-dimensional, found shape {array.shape}")
    _check.squarable(name, array)
    return array


def cleaned(
    t: Array, u: Array, y: Array, where: Sequence[str], ramp: bool, doubts: list[str]
) -> tuple[Array, Array, Array, float, Places]:
    """Leave out missing values, sort by time, and merge samples of the same time.

    Of samples with the same time, the outputs are averaged and the last input is used. Return times, inputs, outputs,
    the input of the earliest sample, and the index of the first sample at each time.
    """
    finite = [np.isfinite(column) for column in (t, u, y)]
    usable = np.all(finite, axis=0)
    if usable.sum() < FEWEST:
        each = ", ".join(f"{name} has {known.sum()}" for name, known in zip("tuy", finite, strict=True))
        raise ValueError(
            f"a record needs {FEWEST} usable samples or more, found {usable.sum()} of {t.size} ({each}): sample "
            "faster, or record for longer"
        )
    if not usable.all():
        doubts.append(doubt("missing", count=(~usable).sum(), total=t.size))
    places = np.flatnonzero(usable)
    u, y = u[usable], y[usable]
    t = _clock(t[usable], [where[int(k)] for k in places], doubts)
    refuse_no_input(t, u, y, ramp)
    order = np.argsort(t, kind="stable")
    times, first, count = np.unique(t[order], return_index=True, return_counts=True)
    if times.size < FEWEST:
        raise ValueError(f"a record needs {FEWEST} different times or more, found {times.size}")
    if times.size < t.size:
        doubts.append(doubt("same time", count=t.size - times.size))
    mean = np.add.reduceat(y[order], first) / count
    held = u[order][first + count - 1]
    if np.ptp(mean) == 0:
        raise ValueError(f"y never changes: it is {mean[0]:g} in every sample, so no model can be fitted")
    return times, held, mean, float(u[order][0]), places[order][first]


def _clock(t: Array, where: Sequence[str], doubts: list[str]) -> Array:
    """Continue a counter that restarts. Raise if the record contains several runs or `t` is not a time axis."""
    steps = np.diff(t)
    back = steps < 0
    if not back.any():
        return t
    if np.all(steps <= 0):
        doubts.append(doubt("newest first"))
        return t
    counter = float(COUNTERS[min(np.searchsorted(COUNTERS, t.max(), side="right"), COUNTERS.size - 1)])
    usual = float(np.median(np.abs(steps)))
    if t.min() >= 0 and np.all(np.abs(steps[back] + counter) <= LONGEST_WRAP * usual):
        doubts.append(doubt("counter", count=back.sum(), counter=counter))
        return t + counter * np.append(0, np.cumsum(back))
    starts = run_starts(t)
    if len(starts) > 1:
        k = starts[1]
        raise ValueError(
            f"the times go back at {where[k]}, from {t[k - 1]:.6g} to {t[k]:.6g}: the file holds {len(starts)} runs, "
            f"or its clock was set back; choose a run with run = 1 to {len(starts)} (--run), or split the file"
        )
    k = int(np.argmax(back)) + 1
    if float(np.mean(t < np.maximum.accumulate(t))) > DISORDER:
        raise ValueError(
            f"t is not a time axis: its values go back in {back.sum()} of {t.size} samples, first at {where[k]}, from "
            f"{t[k - 1]:.6g} to {t[k]:.6g}; name the column of the times (--time)"
        )
    doubts.append(doubt("not in order", where=where[k]))
    return t


def run_starts(t: Array) -> list[int]:
    """Return the index of the first sample of each run.

    A run has at least `FEWEST` samples, and begins where the time goes back by more than `OVERLAP` median intervals.
    """
    edges = [0, *(np.flatnonzero(np.diff(t) < 0) + 1).tolist(), t.size]
    rising = np.diff(t)[np.diff(t) > 0]
    usual = float(np.median(rising)) if rising.size else 0.0
    starts = [0]
    for begin, end in pairwise(edges[1:]):
        long = min(end - begin, begin - starts[-1]) >= FEWEST
        if long and t[begin] < t[begin - 1] - OVERLAP * usual:
            starts.append(begin)
    return starts


def refuse_no_input(t: Array, u: Array, y: Array, ramp: bool) -> None:
    """Raise if the input is a copy of the output or, unless `ramp` allows ramps, a clock or a counter."""
    if np.ptp(u) == 0 or np.ptp(y) == 0 or np.ptp(t) == 0:
        return
    remedy = "name the column of the plant's input (--u); without the input no model can be fitted"
    order = np.argsort(t, kind="stable")
    moved = np.diff(u[order])
    if not ramp and (np.all(moved > 0) or np.all(moved < 0)):
        for name, axis in (("the time", t[order]), ("the number of the sample", np.arange(t.size))):
            line = np.polynomial.Polynomial.fit(axis, u[order], 1)
            if np.max(np.abs(u[order] - line(axis))) < STRAIGHT * np.ptp(u):
                raise ValueError(
                    f"u rises or falls evenly with {name} throughout, as a clock or a counter "
                    f"does: {remedy}. If u is a ramp, give the input before the ramp (--u-before)"
                )
    line = np.polynomial.Polynomial.fit(y, u, 1)
    if np.max(np.abs(u - line(y))) < COPY * np.ptp(u):
        raise ValueError(f"u is a copy of y, or computed from it sample by sample: {remedy}")


def far_off(y: Array) -> Places:
    """Return the samples that lie far from the median of their neighbours."""
    known = np.flatnonzero(np.isfinite(y))
    if known.size < FEWEST:
        return known[:0]
    # Mirror the output at its ends, so that the first and the last sample have neighbours on both sides.
    away = np.abs(y[known] - median_filter(y[known], 9, mode="mirror"))
    low, high = np.quantile(y[known], [0.02, 0.98])
    return known[away > max(8 * float(np.quantile(away, 0.95)), 0.2 * float(high - low))]


def standing_still(y: Array) -> list[tuple[int, int]]:
    """Return the first and the last sample of each interval in which a moving output suddenly stands still.

    An interval is left out if the output slows down before it, or if the output moves so slowly that only the rounded
    value stands still.
    """
    known = np.flatnonzero(np.isfinite(y))
    if known.size < FEWEST:
        return []
    y = y[known]
    moved = np.flatnonzero(np.diff(y)) + 1
    levels = np.unique(y)
    rounded = float(np.median(np.diff(levels))) if 3 * levels.size < 2 * y.size and levels.size > 1 else 0.0
    runs = []
    for first, after in zip(moved, np.append(moved[1:], y.size), strict=True):
        if after - first <= max(STILL, STILL_SHARE * y.size) or first < BEFORE:
            continue
        way, last = (float(np.ptp(y[first - count : first + 1])) for count in (BEFORE, JUST_BEFORE))
        # Near an extremum of a slow oscillation, a rounded output keeps each value for several samples and then changes
        # by one rounding step. Ignore such intervals.
        crept = max(last, float(np.max(np.abs(np.diff(y[first - BEFORE : first + 1]))))) < 1.5 * rounded
        enough = max(MANY_STEPS * rounded, LITTLE * float(np.ptp(levels)))
        if way > enough and last > SLOWED * way and not crept:
            runs.append((int(known[first]), int(known[after - 1])))
    return runs


def outlier_note(y: Array, where: Sequence[str]) -> str:
    """List outputs that are probably errors of the sensor, if any."""
    notes = []
    if (wild := far_off(y)).size:
        notes.append(f"far from its neighbours: {_first_few([f'{where[k]} (y = {y[k]:.6g})' for k in wild])}")
    if still := standing_still(y):
        runs = _first_few([f"{where[a]} to {where[b].split()[-1]} (y = {y[a]:.6g})" for a, b in still])
        notes.append(
            f"the output stands still to the last digit in {runs}: the sensor is lost or at the end of its range, or "
            "the plant has stopped"
        )
    return "; ".join(notes)


def drop_outliers(y: Array, where: Sequence[str]) -> list[str]:
    """Replace outputs that are probably errors of the sensor by NaN. Return a doubt that lists them, if any."""
    note, still = outlier_note(y, where), standing_still(y)
    y[far_off(y)] = np.nan
    for first, last in still:
        y[first : last + 1] = np.nan
    return [doubt("left out", note=note)] if note else []


def _first_few(entries: Sequence[str]) -> str:
    further = f" and {len(entries) - LISTED} more" if len(entries) > LISTED else ""
    return ", ".join(entries[:LISTED]) + further


CREEP = 0.1  # largest movement of the input within a level, as a share of the span of the input
SHORTEST_LEVEL = 4  # least number of samples in a level of the input
MANY = 12  # if u has this many levels or more (rounded to 1 % of its span), it has no separate steps
FOLLOWS = 0.98  # u follows y if y and its integral explain more than this share of the variance of u
FOLLOWER = "it follows the output, as in a loop at a constant set point"
MANY_LEVELS = "steps to many levels"
MOVING = "it moves all the time, as in a closed loop or by a test signal"


class Step(NamedTuple):
    """A change of the input from one level to another.

    Attributes
    ----------
    time : float
        Time of the change in the record.
    before, after : float
        Levels of the input before and after the change, in the unit of u.
    """

    time: float
    before: float
    after: float


def find_steps(t: Array, u: Array, before: float) -> tuple[Step, ...]:
    """Find the changes of the input between steady levels. A ramp of a few samples is one change at its middle."""
    # Let the input before the record count as a level.
    t, u = np.append(np.full(SHORTEST_LEVEL, t[0]), t), np.append(np.full(SHORTEST_LEVEL, before), u)
    span = np.ptp(u)
    quiet = np.abs(np.diff(u)) <= 0.02 * span
    edges = np.flatnonzero(np.diff(np.concatenate([[0], quiet, [0]]).astype(int)))
    runs = [  # samples a to b are one level if u moves by at most CREEP * span
        (a, b)
        for a, b in edges.reshape(-1, 2)
        if b - a >= SHORTEST_LEVEL - 1 and np.ptp(np.quantile(u[a : b + 1], [0.02, 0.98])) <= CREEP * span
    ]
    resting = sum(b - max(a, SHORTEST_LEVEL) for a, b in runs if b > SHORTEST_LEVEL)
    if not runs or resting < 0.7 * (t.size - SHORTEST_LEVEL - 1):
        return ()
    levels = [float(np.median(u[a : b + 1])) for a, b in runs]
    steps = []
    for (_, left), (right, _), low, high in zip(runs, runs[1:], levels, levels[1:], strict=False):
        if abs(high - low) > 0.05 * span:
            # The input is held from each sample to the next, so it jumps at the sample with the new value.
            crossed = left + int(np.argmax(np.abs(u[left : right + 1] - low) >= 0.5 * np.abs(high - low)))
            steps.append(Step(float(t[crossed]), low, high))
    return tuple(steps)


def name_experiment(steps: tuple[Step, ...], t: Array, u: Array, y: Array) -> str:
    """Return the kind of experiment in words."""
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
    # At a constant set point, a controller computes the input from the present output and its integral. In open loop,
    # the output follows the input, so later outputs explain the input better than present outputs.
    integral = np.append(0.0, np.cumsum(np.diff(t) * 0.5 * (y[1:] + y[:-1] - 2 * y[0])))
    scaled = np.column_stack([y / np.ptp(y), integral / (np.ptp(integral) or 1.0)])

    def residual(later: int) -> float:
        count = t.size - later
        basis = np.column_stack([drift[:count], scaled[later:]])
        return float(np.mean((u[:count] - basis @ np.linalg.lstsq(basis, u[:count], rcond=None)[0]) ** 2))

    lags = range(1, t.size // 4, t.size // 40 or 1)
    if residual(0) < min((1 - FOLLOWS) * float(np.mean(rest**2)), *map(residual, lags)):
        return FOLLOWER
    return MANY_LEVELS if steps else MOVING


def list_steps(steps: tuple[Step, ...]) -> str:
    """Describe the first steps, and count the others."""
    return _first_few([f"step from {s.before:.6g} to {s.after:.6g} at {s.time:.6g}" for s in steps]) or "none"
