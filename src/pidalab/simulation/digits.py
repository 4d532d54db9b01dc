"""Whether rounding has left a response its digits: one of a stiff loop is computed again in other units."""

from __future__ import annotations

from functools import lru_cache
from weakref import WeakKeyDictionary

import numpy as np

from pidalab import _check
from pidalab._check import Array
from pidalab.loop import Loop
from pidalab.simulation.ladder import norm_over, responses
from pidalab.simulation.realisation import Cut, cut_at_delay, fastest_pole

# Beyond this many time constants of the fastest state in a dead time, or in t, what it does may cancel.
CHECKED_FROM = 3e3
# of time and of u, for the second response, and for others where that leaves doubts
OTHER_UNITS = (1.3, 0.6, 2.2)
CHECKED = 64  # times at least at which the two are compared
DENSE = 10_000  # times at which it is asked how large a response is, before it is refused
AGREEMENT = 1e-10  # of both, relative to the largest value of a signal: nine digits are promised
CERTAIN = 1e-12  # the same, below which two are enough: they may err alike once in a while, but not as closely as that
# the same, relative to the largest value outside the flanks of kicks, and at requested times
BESIDE_KICKS = 1e-6
FLANK = 60.0  # time constants of the fastest state that a kick lasts
UNSEEN_FLANK = 1e5  # time constants after which a time, known to 1e-16, no longer tells its place in a flank


# loops, and the grids on which their responses were found to have their digits: that is asked once
AGREED: WeakKeyDictionary[Loop, set[tuple[str, int, float]]] = WeakKeyDictionary()


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
    cut, norm, may_cancel = _prepared(loop, inputs, n, step)
    if not may_cancel:
        return responses(cut, n, step, norm)
    # the times that are asked for may miss where digits are lost
    finer = -(-CHECKED // (n - 1))
    steps, step = (n - 1) * finer, step / finer
    found = responses(cut, steps + 1, step, norm)
    if not _check.all_finite(found):  # it overflowed, perhaps for a while: whoever asked says so
        numbers = np.isfinite(found).all(axis=(0, 1))
        found[:, :, np.argmin(numbers) :] = np.nan
    elif (inputs, steps, step) not in (agreed := AGREED.setdefault(loop, set())):
        _require_agreement(loop, inputs, cut, norm, found, step, finer)
        agreed.add((inputs, steps, step))
    return found[:, :, ::finer]


@lru_cache(maxsize=64)
def _prepared(loop: Loop, inputs: str, n: int, step: float) -> tuple[Cut, float, bool]:
    """Return the cut loop, its norm, and whether what its fastest state does may cancel."""
    cut = cut_at_delay(loop, inputs)
    norm = norm_over(cut, n, step)
    # without dead time the loop is closed, and its blocks may be faster than what is left of them
    speed = max(norm, 0.0 if cut.delay else fastest_pole(loop))
    return cut, norm, speed * min(cut.delay or np.inf, (n - 1) * step) > CHECKED_FROM


def _require_agreement(
    loop: Loop, inputs: str, cut: Cut, norm: float, found: Array, step: float, finer: int
) -> None:
    """Raise where responses in other units are not the same; one time in `finer` is requested."""
    steps = found.shape[2] - 1
    every = max(c for c in range(1, steps // CHECKED + 1) if steps % c == 0)
    size, all_seen = _sizes(cut, found, step, every), steps >= DENSE
    # either all times are requested, or all are compared
    shown = _sizes(cut, found[:, :, ::finer], step * finer, every) if finer > 1 else size
    uncertain, beside_shown = np.zeros((len(inputs), 3)), np.zeros((len(inputs), 3))
    for unit in OTHER_UNITS:
        apart = np.abs(found[:, :, ::every] - _again(loop, inputs, unit, steps // every + 1, step * every))
        apart = np.minimum(np.nan_to_num(apart, nan=np.inf), 1e300)
        share = np.max(apart / size, axis=2)
        if share.max() > AGREEMENT and not all_seen:  # what is asked for may miss the largest values
            more, all_seen = -(-DENSE // steps), True
            dense = responses(cut, steps * more + 1, step / more, norm)
            size = _sizes(cut, dense, step / more, every * more) if np.isfinite(dense).all() else size
            share = np.max(apart / size, axis=2)
        uncertain = np.maximum(uncertain, share)
        beside_shown = np.maximum(beside_shown, np.max(apart[:, :, ::finer] / shown, axis=2))
        if not CERTAIN <= uncertain.max() <= AGREEMENT:
            break
    # beside the largest values all may be well, and these lie between the requested times
    hidden = uncertain.max() <= AGREEMENT
    share, allowed = (beside_shown, BESIDE_KICKS) if hidden else (uncertain, AGREEMENT)
    if share.max() <= allowed:
        return
    where = " at the requested times" if hidden else ""
    remedy = "between them are far larger ones; ask for more times, or shorten t"
    if not hidden:
        fastest = 1 / np.max(_speeds(cut))
        remedy = (
            f"the fastest filter or lag of the loop has a time constant of {fastest:.3g}, too short beside the others; "
            "take a longer one, or leave it out"
        )
    _, signal = np.unravel_index(np.argmax(share), share.shape)
    raise ValueError(
        f"rounding leaves {min(1.0, share.max()):.1g} of the largest value of "
        f"{('y', 'the integral of y', 'u')[signal]}{where} uncertain, and {allowed:.0e} is allowed: {remedy}"
    )


def _again(loop: Loop, inputs: str, unit: float, n: int, step: float) -> Array:
    """Respond in other units."""
    cut = cut_at_delay(loop, inputs, unit)
    again = responses(cut, n, step / unit, 2.0 * norm_over(cut, n, step / unit))
    for i, key in enumerate(inputs):
        again[i] *= unit if key == "d" else 1.0  # a step of the load is counted as u is
        again[i, 2] /= unit
    return again


def _sizes(cut: Cut, found: Array, step: float, every: int) -> Array:
    """Return the size beside which a difference counts, for each signal at some of the times: (inputs, 3, times).

    That is the largest value up to a dead time later: a response that grows has its digits from the start, and one that
    begins with zeros need not have them there. Beside a kick of 1e13 nothing would count of what comes after it; so
    that is held, too, to fewer digits, once all that is stiff is over. Times in the flank of the fastest kick, just
    after a multiple of the dead time, do not count at all: a value there has the digits of its time, and the height is
    not on the grid.
    """
    t, speeds = step * np.arange(found.shape[2]), _speeds(cut)
    fastest = np.max(speeds)
    stiff = np.min(speeds[speeds * (cut.delay or t[-1]) > CHECKED_FROM], initial=fastest)
    since, early = np.mod(t, cut.delay) if cut.delay else t, (t > 0.0) & (t < UNSEEN_FLANK / fastest)
    compared, outside = (early | (since > FLANK / speed) for speed in (fastest, stiff))
    later = np.minimum(np.searchsorted(t, t[::every] + (cut.delay or t[-1] / CHECKED)), t.size - 1)
    found = np.abs(found)
    with_kicks, without = (
        np.maximum.accumulate(values, axis=2)[:, :, later] for values in (found, found * outside)
    )
    after = np.where(outside[::every], without * (BESIDE_KICKS / AGREEMENT), np.inf)
    return np.where(compared[::every], np.maximum(np.minimum(with_kicks, after), 1e-300), np.inf)


def _speeds(cut: Cut) -> Array:
    return np.maximum(np.abs(np.linalg.eigvals(cut.A)), 1e-300)
