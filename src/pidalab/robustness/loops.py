"""Loops as functions of frequency: in s with exact dead time, and from sample to sample in z."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from pidalab._check import Array
from pidalab.digital import DigitalController
from pidalab.loop import Loop, open_loop, require_loop, require_well_posed
from pidalab.process import static_gain
from pidalab.robustness._arrays import fraction as fraction_of_factors, frequencies
from pidalab.robustness._scan import along
from pidalab.robustness.factored import FactoredExplorer
from pidalab.robustness.peaks_and_crossovers import Explorer, LoopFactors, Seen
from pidalab.robustness.sampled import sampled_plant
from pidalab.roots import roots

FAR_PER_DECADE = 12  # points of the grid far from all corners
CLEAR = 10.0  # |L|, or one over it, up to which the grid goes on


def factors(loop: Loop) -> LoopFactors:
    """Factor a loop block by block; nothing is cancelled.

    Raises
    ------
    ValueError
        For a gain beyond the range of numbers, and for roots that cannot be found.
    """
    of = factors_of(loop, "process", "controller", "output_filter")
    return of._replace(delay=float(loop.process.delay))


def factors_of(loop: Loop, *names: str) -> LoopFactors:
    """Factor some blocks of a loop, without the dead time."""
    open_loop(loop)  # complains about what is not a loop
    gain, zeros, poles = 1.0, [], []
    for name in names:
        num, den = loop.blocks[name]
        gain *= float(num[0]) / float(den[0])
        zeros.append(roots(num))
        poles.append(roots(den))
    if not math.isfinite(gain):
        raise ValueError("the gain of the loop leaves the range of numbers (about 1e308)")
    return together(gain, np.concatenate(zeros), np.concatenate(poles))


def together(gain: float, zeros: Any, poles: Any, delay: float = 0.0) -> LoopFactors:
    """Put the factors of a loop together, with a speed for each pole: its own, or the slowest where that is 0."""
    speeds = np.abs(poles)
    moving = [speed for speed in speeds.tolist() if speed > 0]
    speeds[speeds == 0] = min(moving) if moving else 1 / delay if delay else 1.0
    return LoopFactors(gain, zeros.astype(complex), poles.astype(complex), speeds, delay)


def explore(loop: Loop) -> Explorer:
    """Look at a loop along the frequency axis; from sample to sample if its controller is digital."""
    require_loop(loop)
    return explore_in_s(loop) if loop.digital is None else _in_z(loop, loop.digital)


@lru_cache(maxsize=64)
def explore_in_s(loop: Loop) -> FactoredExplorer:
    """Look at a continuous loop along the frequency axis, with its factors; what was seen of the last loops is kept."""
    require_well_posed(loop)
    return from_factors(factors(loop), static_gain(*open_loop(loop)))


def from_factors(of: LoopFactors, at_zero: float = math.nan) -> FactoredExplorer:
    """Look at a continuous loop by its factors."""
    at_infinity = of.gain if of.zeros.size == of.poles.size else 0.0
    w = frequencies(np.concatenate([of.zeros, of.poles]), of.delay)
    num, den = along(w, 0.0, 0.0, tuple(of))
    more = _towards_far_crossovers(of, w, num, den)
    if more:
        w = np.concatenate([more[0], w, more[1]])
        num, den = along(w, 0.0, 0.0, tuple(of))
    return FactoredExplorer(
        grid=w,
        fraction=lambda s: fraction_of_factors(s, of),
        delay=of.delay,
        at_zero=at_zero,
        at_end=-abs(at_infinity) if of.delay else at_infinity,
        of=of,
        on_grid=Seen(w, num, den),
    )


def _towards_far_crossovers(of: LoopFactors, w: Array, num: Any, den: Any) -> list[Array]:
    """Return more of the grid at both ends, up to where |L|, a power of the frequency there, has crossed 1."""
    at_zero = of.poles.tolist().count(0) - of.zeros.tolist().count(0)
    at_infinity = of.poles.size - of.zeros.size
    parts = []
    for side, k, power in ((-1, 0, at_zero), (1, -1, at_infinity)):
        end, part, size = float(w[k]), np.zeros(0), abs(complex(num[k])) / (abs(complex(den[k])) or math.nan)
        beyond = CLEAR if side * power < 0 else 1 / CLEAR  # |L| on its way to infinity, or to 0
        if power and size > 0 and (size < beyond) == (beyond > 1):
            far = math.exp(math.log(end) + math.log(size / beyond) / power)
            if 0 < far < math.inf:
                count = 2 + int(FAR_PER_DECADE * abs(math.log10(far / end)))
                part = np.geomspace(end, far, count)[1:][::side]
        parts.append(part)
    return parts if any(part.size for part in parts) else []


def _in_z(loop: Loop, k: DigitalController) -> Explorer:
    h, process = k.sample_time, loop.process
    plant = sampled_plant(process, h)
    poles = roots(process.den)
    z_poles = np.append(np.exp(poles * h), np.ones(int(k.integrates)))
    unstable = z_poles[np.abs(z_poles) > 1 - 1e-9].tolist()

    def fraction(s: Any) -> tuple[Any, Any]:
        """L, and what moves its unstable poles into the unit circle."""
        z, moved = np.exp(s * h), 1.0
        for pole in unstable:
            moved = moved * ((z - pole) / (z - 0.5 * pole / abs(pole)))
        return plant(z) * k(z) * moved, moved + 0.0 * z

    found = Explorer(
        frequencies(poles, process.delay, math.pi / h), fraction, process.delay + h, 0.0, 0.0, math.pi / h
    )
    integrates = k.integrates or process.den[-1] == 0
    # an integrator makes L infinite at zero frequency, unless the plant's zero there cancels it
    lowest = found.grid[0] if integrates else 0.0
    at_zero = math.inf if integrates and process.num[-1] != 0 else float(found.L(lowest).real)
    return replace(found, at_zero=at_zero, at_end=float(found.L(found.end).real))
