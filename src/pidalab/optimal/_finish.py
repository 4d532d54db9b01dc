"""From near an optimum to its end: a descent, the last steps, and a look at all frequencies and plants."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pidalab._check import Array
from pidalab.loop import Loop
from pidalab.optimal._polish import Polished, polish
from pidalab.optimal._solver import FINE, NEARLY, Search, settles
from pidalab.robustness.control_sensitivity import max_control_sensitivity
from pidalab.robustness.margins import max_complementary, max_difference, max_sensitivity

MAX_FINISHES = 12  # rounds, each with the worst frequency of the one before
VALLEY_GAP = 1e-2  # share by which the values of two valleys differ at least
UNPOLISHED = 1e-2  # what is left open of an end whose conditions were not reached
ALIKE = 0.01  # what two ends of the same valley differ by at most
BACK = 0.97  # factor that takes all gains back a little
WORST_PLANTS = 2  # plants of the family that join at a time
SHRINK, SHRINKS, ASTRAY = 0.85, 40, 0.5  # factor, steps at most, and by how much a limit may then be missed
# supremum of each of what may be limited at all frequencies, and where it lies
PEAKS: dict[str, Callable[[Loop], tuple[float, float]]] = {
    "ms": max_sensitivity,
    "mks": max_control_sensitivity,
    "mt": max_complementary,
    "inverse_disk": max_difference,
}


def finish(
    search: Search, x: Array, known: Sequence[Polished] = (), last_steps: bool = True
) -> Polished | None:
    """Descend and polish, if asked to; take in the worst frequencies until the limits hold at all of them.

    None where that leads nowhere, to an end that is known, or to one that is worse.
    """
    for _ in range(MAX_FINISHES):
        value, found, missed = search.descend(x, effort=FINE)
        if missed > NEARLY or not search.sound(found):
            # the descent went astray: again, from a little below
            x = np.append(BACK * x[: search.problem.gains], x[-1])
            continue
        if any(
            value > other.value * (1 + VALLEY_GAP) or np.allclose(found, other.x, ALIKE, ALIKE)
            for other in known
        ):
            return None
        x, end = found, polish(search, found) if last_steps else None
        if end is None:
            end = Polished(search.fine(x)[0], x, UNPOLISHED, np.zeros(0))
        for peak in end.w:  # for the descents that follow
            search.look_at(peak, nearly=True)
        if search.sound(end.x) and _keeps(search, end.x, search.true_noise(end.x)):
            if _safe(search, end.x):
                return end
            x = _shrunk(search, x)
    return None


def _safe(search: Search, x: Array) -> bool:
    """Whether all plants of the family keep their limit; where not, the worst two are seen from now on."""
    loop, found = search.loop(x), []
    for k, plant in enumerate(search.family):
        other = Loop(plant, loop.controller)
        ms, at = max_sensitivity(other)
        found.append((ms if settles(other) else np.inf, at, k))
    over = [one for one in sorted(found, reverse=True)[:WORST_PLANTS] if one[0] > search.limits.ms_worst]
    for _, at, k in over:
        search.see(k, at)
    return not over


def _shrunk(search: Search, x: Array) -> Array:
    """Take gains back until the loops with the plants that are seen are stable and near their limits."""
    x, gains = x.copy(), search.problem.gains
    for _ in range(SHRINKS):
        loops = (Loop(search.family[k], search.loop(x).controller) for k in search.active)
        if search.missed(x) <= ASTRAY and all(settles(loop) for loop in loops):
            break
        x[:gains] *= SHRINK
        x[0] *= SHRINK**0.5
    return x


def _keeps(search: Search, x: Array, noise: float) -> bool:
    """Whether all limits hold; where not, look there from now on."""
    loop, kept = search.loop(x), True
    for name, most in search.limits.peaks(0.0).items():
        height, at = PEAKS[name](loop)
        if height > most:
            kept = False
            search.look_at(at)
    if search.limits.noise_gain is not None and noise > search.limits.noise_gain:
        kept = False
        search.aim_below(noise)
    return kept
