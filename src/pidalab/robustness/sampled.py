r"""Loops with a digital controller on the unit circle: exact for the plant with its dead time at the samples.

Across a sample interval h the input of the plant has one or two pieces in which it is constant (see `statespace`), so
that with :math:`x_{k+1} = \Phi x_k + \sum_j \Gamma_j v_{k-m_j}` the plant is, from sample to sample,

.. math:: G(z) = \sum_j c\,(z - \Phi)^{-1} \Gamma_j z^{-m_j} + d\,z^{-m_0},

and :math:`L(z) = G(z) K(z)` is all that stability and margins at the samples need. Nothing is approximated. What the
output does between two samples is not seen here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from pidalab._check import Array
from pidalab._search import succeeded
from pidalab.digital import DigitalController
from pidalab.loop import Loop
from pidalab.process import Process
from pidalab.roots import roots
from pidalab.statespace import held, pieces, realise

PER_DECADE = 150  # frequencies of the logarithmic grid
TURN = 0.1  # largest turn of the phase by the dead time between two frequencies, in rad
MOST = 400_000  # frequencies of a grid
LONGEST = 1e6  # samples of a dead time; of half a sample more nothing can be seen


class SampledPlant(NamedTuple):
    """A process between a hold and a sampler."""

    phi: Array
    gammas: list[tuple[Array, int]]  # influence of an input, and how many samples ago it was set
    c: Array
    d: float

    def __call__(self, z: Array) -> Any:
        """Evaluate G at points z, shape (n,)."""
        resolvent = np.linalg.solve(
            (z[:, None, None] * np.eye(self.c.size) - self.phi).transpose(0, 2, 1), self.c
        )
        held_by_lags = sum(resolvent @ gamma * z**-ago for gamma, ago in self.gammas)
        return held_by_lags + self.d * z ** -self.gammas[0][1]


class SampledLoop(NamedTuple):
    """A loop from sample to sample."""

    plant: SampledPlant
    unstable: Any  # poles of L on or outside the unit circle
    controller: DigitalController

    def L(self, w: Any) -> Any:
        """Evaluate the loop transfer function at frequencies in rad per time unit."""
        k = self.controller
        z = np.exp(1j * np.atleast_1d(w) * k.sample_time)
        value = self.plant(z) * k(z) * k.y_span / k.u_span
        return value if np.ndim(w) else value[0]


def sampled_plant(process: Process, h: float) -> SampledPlant:
    """Discretise a process for an input that is held, dead time exact."""
    A, b, c, d = realise(process.num, process.den)
    if process.delay > LONGEST * h:
        raise ValueError(
            f"the dead time must be at most {LONGEST:g} samples for the margins of a sampled loop, found "
            f"{process.delay:.4g} with a sample time of {h:.4g}: so fast a sampling costs nothing, take the continuous "
            "controller"
        )
    own = pieces(process.delay, h)
    if d and own[0].ago == 0:
        raise ValueError(
            "the plant answers within the sample (direct feedthrough without dead time): the controller would read "
            f"what it has not set yet; found {process!r}"
        )
    phi, gammas = np.eye(c.size), []
    for piece in reversed(own):
        transition, gamma = held(A, b, piece.time)
        gammas.append((phi @ gamma, piece.ago))
        phi = phi @ transition
    return SampledPlant(phi, gammas[::-1], c, d)


def sampled_loop(loop: Loop, k: DigitalController) -> SampledLoop:
    """Discretise the plant of a loop for its digital controller."""
    poles = np.exp(roots(loop.process.den).astype(complex) * k.sample_time)
    unstable = np.append(poles[np.abs(poles) > 1 - 1e-9], np.ones(int(k.integrates)))
    return SampledLoop(sampled_plant(loop.process, k.sample_time), unstable, k)


def _grid(loop: SampledLoop, process_den: Array, delay: float) -> Array:
    """Frequencies up to half the sampling frequency that follow L, and the turns of its dead time where it is loud."""
    top = math.pi / loop.controller.sample_time
    corners = np.abs(roots(process_den))
    lowest = min(float(np.min(corners[corners > 0], initial=top)), 1 / delay if delay else top, top)
    count = int(PER_DECADE * math.log10(top / lowest * 1e4)) + 1
    w = np.logspace(math.log10(lowest) - 4, math.log10(top), count)
    w[-1] = top
    # the dead time in steps of the grid, where |L| is large enough for its phase to matter
    turns = (delay + loop.controller.sample_time) * np.diff(w) / TURN
    loud = np.abs(loop.L(w)) > 0.1
    parts = np.where(loud[1:] | loud[:-1], np.minimum(np.ceil(turns), MOST), 1).astype(int)
    if parts.sum() > MOST:
        raise ValueError(
            f"sample_time must be larger, or the gain of the loop smaller: its dead time holds "
            f"{delay / loop.controller.sample_time:.3g} samples, and {parts.sum():.3g} frequencies are too many"
        )
    start, width = np.repeat(w[:-1], parts), np.repeat(np.diff(w) / parts, parts)
    within = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    return np.append(start + width * within, top)


def unstable_poles_sampled(loop: Loop, k: DigitalController) -> int:
    """Count the closed-loop poles on or outside the unit circle, by the argument principle."""
    sampled = sampled_loop(loop, k)
    w = _grid(sampled, loop.process.den, loop.process.delay)
    count = _count(sampled, w)
    if count is None:  # a pole on the circle, which is not stable; or one too near to tell
        return max(1, sampled.unstable.size)
    return count


def max_sensitivity_sampled(loop: Loop, k: DigitalController) -> float:
    """Return Ms of a loop at the samples, infinite where it is unstable."""
    if unstable_poles_sampled(loop, k):
        return math.inf
    sampled = sampled_loop(loop, k)
    w = _grid(sampled, loop.process.den, loop.process.delay)
    still = _static(loop.process, sampled, w[0])
    return _peak(lambda x: np.abs(1 / (1 + sampled.L(x))), w, 1 / abs(1 + still))[0]


def _count(loop: SampledLoop, w: Array) -> int | None:
    """Return the winding of 1 + L, with its unstable poles moved inside, from frequency 0 to half that of sampling."""

    def characteristic(w: Array) -> Array:
        z = np.exp(1j * w * loop.controller.sample_time)
        value = 1 + loop.L(w)
        for pole in loop.unstable:
            value = value * (z - pole) / (z - 0.5 * pole / abs(pole))
        return value

    f = characteristic(w)
    for _ in range(40):
        if np.min(np.abs(f)) < 1e-12 * np.max(np.abs(f)):
            return None
        turn = np.angle(f[1:] / f[:-1])
        wide = np.flatnonzero(np.abs(turn) > 0.8)
        if not wide.size:
            # f is real at both ends; conjugate frequencies double what is seen of the circle
            count = -(float(np.sum(turn)) + float(_to_axis(f[0]))) / np.pi
            return round(count) if abs(count - round(count)) < 0.05 else None
        middle = 0.5 * (w[wide] + w[wide + 1])
        w, f = np.insert(w, wide + 1, middle), np.insert(f, wide + 1, characteristic(middle))
    return None


def _to_axis(value: complex) -> float:
    """Return the angle from the nearer half of the real axis to a value."""
    angle = float(np.angle(value))
    return angle - round(angle / np.pi) * np.pi


def margins_sampled(loop: Loop, k: DigitalController) -> dict[str, Any]:
    """Return the entries of `Margins` at the samples; frequencies up to half the sampling frequency."""
    sampled = sampled_loop(loop, k)
    w = _grid(sampled, loop.process.den, loop.process.delay)
    value = sampled.L(w)
    wgc = _crossings(lambda x: np.log(np.abs(sampled.L(x))), w, np.log(np.abs(value)))
    # up to the last frequency, where L is real
    wpc = _crossings(
        lambda x: (sampled.L(x) / np.abs(sampled.L(x))).imag, w[:-1], (value / np.abs(value)).imag[:-1]
    )
    candidates = np.append(wpc, w[-1])
    there = sampled.L(candidates)
    real = (there.real < 0) & (np.abs(there.imag) < 1e-6 * np.abs(there))
    at, size = candidates[real], np.abs(there[real])
    lag = np.mod(np.angle(sampled.L(wgc)) + np.pi, 2 * np.pi) if wgc.size else np.zeros(0)
    rotation = np.minimum(lag, 2 * np.pi - lag)
    still = _static(loop.process, sampled, w[0])
    ms, wms = _peak(lambda x: np.abs(1 / (1 + sampled.L(x))), w, 1 / abs(1 + still))
    mt, wmt = _peak(lambda x: np.abs(1 / (1 + 1 / sampled.L(x))), w, 1 / abs(1 + 1 / still) if still else 0.0)
    # at zero frequency L is real too
    ends, size = np.append(0.0, at), np.append(max(-still, 0.0), size)
    small, large = np.where(size < 1, size, 0.0), size[size > 1]
    return {
        "stable": True,
        "gm": float(1 / small.max()) if small.any() else math.inf,
        "gm_low": float(1 / large.min()) if large.size else 0.0,
        "pm": float(np.degrees(rotation.min(initial=math.inf))),
        "dm": float(np.min(lag / wgc, initial=math.inf)),
        "ms": ms,
        "mt": mt,
        "wgc": float(wgc[np.argmin(rotation)]) if wgc.size else math.nan,
        "wpc": float(ends[np.argmax(small)]) if small.any() else math.nan,
        "wms": wms,
        "wmt": wmt,
        "gain_crossovers": wgc,
        "phase_crossovers": at,
    }


def _crossings(function: Callable[[Any], Any], w: Array, values: Array) -> Array:
    """Return the zeros of a function between the frequencies at which its sign changes."""
    i = np.flatnonzero(
        (np.sign(values[:-1]) * np.sign(values[1:]) < 0) & np.isfinite(values[:-1] + values[1:])
    )
    return np.array([brentq(function, w[j], w[j + 1], xtol=1e-15 * w[j + 1], rtol=1e-13) for j in i])


def _static(process: Process, sampled: SampledLoop, lowest: float) -> float:
    """Return L at zero frequency, infinite with an integrator; where one is cancelled, L at the lowest frequency."""
    integrators = int(sampled.controller.integrates) + int(process.den[-1] == 0)
    if integrators and process.num[-1] != 0:
        return math.inf
    return float(sampled.L(lowest if integrators else 0.0).real)


def _peak(function: Callable[[Any], Any], w: Array, at_zero: float) -> tuple[float, float]:
    """Return the largest value of a function over the frequencies, and where it lies."""
    heights = function(w)
    best = int(np.argmax(heights))
    if best == 0:
        return at_zero, 0.0
    if best == w.size - 1:
        return float(heights[best]), float(w[-1])
    around, fine = (w[best - 1], w[best + 1]), {"xatol": 1e-9 * w[best]}
    found = succeeded(
        minimize_scalar(lambda x: -float(function(x)), bounds=around, method="bounded", options=fine),
        "a peak of the sampled loop",
    )
    return max((float(heights[best]), float(w[best])), (-float(found.fun), float(found.x)))
