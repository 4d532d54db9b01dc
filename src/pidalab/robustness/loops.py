"""Loops as functions of frequency: in s with exact dead time, and from sample to sample in z."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pidalab.digital import DigitalController
from pidalab.loop import Loop, open_loop, require_loop, require_well_posed
from pidalab.process import static_gain
from pidalab.robustness.peaks_and_crossovers import Explorer, frequencies
from pidalab.robustness.sampled import sampled_plant
from pidalab.roots import roots


class Factors(NamedTuple):
    """L(s) = gain * prod(s - zeros) / prod(s - poles), and its dead time beside it."""

    gain: float
    zeros: Any
    poles: Any


def factors(loop: Loop) -> Factors:
    """Factor a loop block by block; nothing is cancelled.

    Raises
    ------
    ValueError
        For a gain beyond the range of numbers, and for roots that cannot be found.
    """
    open_loop(loop)  # complains about what is not a loop
    gain, zeros, poles = 1.0, [], []
    for name in ("process", "controller", "output_filter"):
        num, den = loop.blocks[name]
        gain *= float(num[0]) / float(den[0])
        zeros.append(roots(num))
        poles.append(roots(den))
    if not math.isfinite(gain):
        raise ValueError("the gain of the loop leaves the range of numbers (about 1e308)")
    return Factors(gain, np.concatenate(zeros), np.concatenate(poles))


def explore(loop: Loop) -> Explorer:
    """Look at a loop along the frequency axis; from sample to sample if its controller is digital."""
    require_loop(loop)
    return _in_s(loop) if loop.digital is None else _in_z(loop, loop.digital)


def _in_s(loop: Loop) -> Explorer:
    require_well_posed(loop)
    return from_factors(factors(loop), float(loop.process.delay), static_gain(*open_loop(loop)))


def from_factors(of: Factors, delay: float, at_zero: float = math.nan) -> Explorer:
    """Look at a continuous loop by its factors."""
    at_infinity = of.gain if of.zeros.size == of.poles.size else 0.0
    return Explorer(
        grid=frequencies(np.concatenate([of.zeros, of.poles]), delay),
        fraction=_fraction(of, delay),
        delay=delay,
        at_zero=at_zero,
        at_end=-abs(at_infinity) if delay else at_infinity,
        degree=of.poles.size,
    )


def _fraction(of: Factors, delay: float) -> Callable[[Any], tuple[Any, Any]]:
    """Numerator and denominator of L, factor by factor over |s| plus a speed: their products stay in range."""
    zeros, poles, speeds = of.zeros.tolist(), of.poles.tolist(), np.abs(of.poles)
    moving = speeds[speeds > 0]
    own = moving.min() if moving.size else 1 / delay if delay else 1.0
    scales = np.where(speeds > 0, speeds, own).tolist()

    def fraction(s: Any) -> tuple[Any, Any]:
        size = abs(s)
        num, den = of.gain * np.exp(-s * delay), 1.0 + 0.0 * s
        for i, pole in enumerate(poles):
            scale = 1 / (size + scales[i])
            den = den * ((s - pole) * scale)
            num = num * ((s - zeros[i]) * scale if i < len(zeros) else scale)
        return num, den

    return fraction


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
