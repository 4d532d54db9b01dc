"""Whether rounding has left a response its digits: one of a stiff loop is computed again in other units."""

from __future__ import annotations

import numpy as np

from pidalab._check import Array
from pidalab.loop import Loop
from pidalab.simulation.ladder import norm_over, responses
from pidalab.simulation.realisation import Cut, cut_at_delay, fastest_pole

# Beyond this many time constants of the fastest state in a dead time, or in t, what it does may cancel.
CHECKED_FROM = 3e3
OTHER_UNITS = (
    1.3,
    0.6,
    2.2,
)  # of time and of u, for the second response, and for others where that leaves doubts
CHECKED = 64  # times at least at which the two are compared
DENSE = 10_000  # times at which it is asked how large a response is, before it is refused
AGREEMENT = 1e-10  # of both, relative to the largest value of a signal: nine digits are promised
CERTAIN = 1e-12  # the same, below which two are enough: they may err alike once in a while, but not as closely as that
AFTER_KICKS = 1e-6  # the same, relative to the largest value outside the flanks of kicks
FLANK = 60.0  # time constants of the fastest state that a kick lasts
UNSEEN_FLANK = 1e5  # time constants after which a time, known to 1e-16, no longer tells its place in a flank


def checked_responses(loop: Loop, inputs: str, n: int, step: float) -> Array:
    """Values of y, its running integral and u at n times from 0, for a unit step on each input: (inputs, 3, n).

    What cancels on the way depends on the loop, so no bound on its speeds tells how many digits are lost. In units that
    are no powers of 2 every coefficient, state and rung rounds anew, and the ladder begins one rung lower: two
    responses that agree to ten digits did not lose seven of sixteen.

    Raises
    ------
    ValueError
        Where they do not agree, and as `pidalab.simulation.ladder.responses`.
    """
    cut = cut_at_delay(loop, inputs)
    norm = norm_over(cut, n, step)
    # without dead time the loop is closed, and its blocks may be faster than what is left of them
    speed = max(norm, 0.0 if cut.delay else fastest_pole(loop))
    if not speed * min(cut.delay or np.inf, (n - 1) * step) > CHECKED_FROM:
        return responses(cut, n, step, norm)
    # the times that are asked for may miss where digits are lost
    finer = -(-CHECKED // (n - 1))
    steps, step = (n - 1) * finer, step / finer
    found = responses(cut, steps + 1, step, norm)
    numbers = np.isfinite(found).all(axis=(0, 1))
    if not numbers.all():  # it overflowed, perhaps for a while: whoever asked says so
        found[:, :, np.argmin(numbers) :] = np.nan
        return found[:, :, ::finer]
    every = max(c for c in range(1, steps // CHECKED + 1) if steps % c == 0)
    uncertain = np.zeros((len(inputs), 3))
    for unit in OTHER_UNITS:
        apart = np.abs(found[:, :, ::every] - _again(loop, inputs, unit, steps // every + 1, step * every))
        share = _uncertain(cut, apart, step, found)
        if share.max() > AGREEMENT and steps < DENSE:  # what is asked for may miss the largest values
            more = -(-DENSE // steps)
            dense = responses(cut, steps * more + 1, step / more, norm)
            share = _uncertain(cut, apart, step / more, dense) if np.isfinite(dense).all() else share
        uncertain = np.maximum(uncertain, share)
        if not CERTAIN <= uncertain.max() <= AGREEMENT:
            break
    if uncertain.max() > AGREEMENT:
        _, signal = np.unravel_index(np.argmax(uncertain), uncertain.shape)
        raise ValueError(
            f"rounding leaves {min(1.0, uncertain.max()):.1g} of the largest value of "
            f"{('y', 'the integral of y', 'u')[signal]} uncertain, and {AGREEMENT:.0e} is allowed: the fastest "
            f"filter or lag of the loop has a time constant of {1 / _fastest(cut):.3g}, too short beside the others; "
            "take a longer one, or leave it out"
        )
    return found[:, :, ::finer]


def _again(loop: Loop, inputs: str, unit: float, n: int, step: float) -> Array:
    """Respond in other units."""
    cut = cut_at_delay(loop, inputs, unit)
    again = responses(cut, n, step / unit, 2.0 * norm_over(cut, n, step / unit))
    for i, key in enumerate(inputs):
        again[i] *= unit if key == "d" else 1.0  # a step of the load is counted as u is
        again[i, 2] /= unit
    return again


def _uncertain(cut: Cut, apart: Array, step: float, found: Array) -> Array:
    """Return the largest share of each signal by which two responses are apart: (inputs, 3).

    They are apart at some of the times at which one was found. A difference counts beside the largest value up to a
    dead time later: a response that grows has its digits from the start, and one that begins with zeros need not have
    them there. Beside a kick of 1e13 nothing would count of what comes after it; so that is held, too, to fewer digits,
    once all that is stiff is over. Times in the flank of the fastest kick, just after a multiple of the dead time, are
    not compared: a value there has the digits of its time, and the height is not on the grid.
    """
    t, speeds = step * np.arange(found.shape[2]), np.abs(np.linalg.eigvals(cut.A))
    fastest = max(float(np.max(speeds)), 1e-300)
    stiff = np.min(speeds[speeds * (cut.delay or t[-1]) > CHECKED_FROM], initial=fastest)
    since, early = np.mod(t, cut.delay) if cut.delay else t, (t > 0.0) & (t < UNSEEN_FLANK / fastest)
    compared, outside = (early | (since > FLANK / speed) for speed in (fastest, stiff))
    every = (t.size - 1) // (apart.shape[2] - 1)
    later = np.searchsorted(t, t[::every] + (cut.delay or t[-1] / CHECKED))
    with_kicks, without = (
        np.maximum.accumulate(np.abs(found) * times, axis=2)[:, :, np.minimum(later, t.size - 1)]
        for times in (1.0, outside)
    )
    after = np.where(outside[::every], without * (AFTER_KICKS / AGREEMENT), np.inf)
    size = np.minimum(with_kicks, after)
    apart = np.where(compared[::every], np.nan_to_num(apart, nan=np.inf), 0.0)
    share = np.minimum(apart, 1e300) / np.where(apart > 0.0, np.maximum(size, 1e-300), 1.0)
    return np.max(share, axis=2)


def _fastest(cut: Cut) -> float:
    return max(float(np.max(np.abs(np.linalg.eigvals(cut.A)))), 1e-300)
