"""Whether a sample time is one for a process, and in the unit of its record."""

from __future__ import annotations

import math

import numpy as np

from pidalab._check import Array
from pidalab.process import Process
from pidalab.roots import roots

# in one such sample a process that settles answers by 63 % or more, and little is left to control in the next; an
# integrator has no such time, and its other dynamics are at rest after ten times their longest one
LONGEST_SAMPLE, AT_REST = 1.0, 10.0
OTHER_UNIT = 100.0  # times faster or slower than the record: a sample time that may be in another unit


def require_sampling(process: Process, sample_time: float) -> None:
    """Refuse a sample time in which the process does all it ever does."""
    times = [1 / speed for speed in corner_frequencies(process)]
    poles = np.abs(roots(process.den))
    if np.isfinite(process.gain()):
        limit = LONGEST_SAMPLE * (float(np.sum(1 / poles)) + process.delay) if times else math.inf
        why = "all its lags and its dead time, after which it has answered by 63 % or more"
    else:
        limit = AT_REST * max(times, default=math.inf)
        why = f"{AT_REST:g} times its longest time (after which all but the integrator is at rest)"
    if sample_time > limit:
        raise ValueError(
            f"sample_time must be at most {limit:.4g} for this process, {why}, found {sample_time:g}"
        )


def doubt_unit(sample_time: float, recorded: float) -> list[str]:
    """Say where a sample time is so far from that of the record that it may be in another unit."""
    share = sample_time / recorded
    if 1 / OTHER_UNIT < share < OTHER_UNIT:
        return []
    return [
        f"the sample time of {sample_time:g} is {share:.3g} times that of the record, {recorded:.4g}: is it in the "
        "record's unit of time?"
    ]


def corner_frequencies(process: Process) -> Array:
    """Return the frequencies of poles and zeros, and that of the dead time."""
    found = np.abs(np.concatenate([roots(process.den), roots(process.num)]))
    return np.append(found[found > 0], [1 / process.delay] if process.delay else [])
