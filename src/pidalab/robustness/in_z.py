r"""Evaluate a sampled loop along the unit circle, with exact dead time.

Within a sample interval h, the delayed input of the plant is constant, or constant in each of two pieces (see
`statespace`). In piece j the input is the sample :math:`v_{k-m_j}`, which is :math:`m_j` samples old. So the state is
:math:`x_{k+1} = \Phi x_k + \sum_j \Gamma_j v_{k-m_j}`, and the transfer function from sample to sample is

.. math:: G(z) = \sum_j c\,(z - \Phi)^{-1} \Gamma_j z^{-m_j} + d\,z^{-m_0},

where c is the output vector and d the direct feedthrough. With the controller K(z), the loop transfer function is
:math:`L(z) = G(z) K(z)`. L determines stability and margins at the samples without approximation. The output between
samples is not considered.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import schur

from pidalab.digital import DigitalController
from pidalab.loop import Loop, require_loop
from pidalab.process import Process
from pidalab.robustness.axis import (
    COARSE_STEP,
    ON_CONTOUR,
    Axis,
    Samples,
    frequencies,
    most_between,
    round_to_count,
)
from pidalab.robustness.in_s import axis_in_s
from pidalab.roots import roots
from pidalab.statespace import ALIGNED, held, pieces, realise

LARGEST_TURN = 0.8  # largest change of the angle of the characteristic function between two points, in rad
HALVINGS = 70  # largest number of times that a step is halved
LONGEST_DELAY = 1e6  # largest dead time in samples; above it, rounding hides the fraction of a sample


def require_later_answer(plant: Any, direct: float, h: float) -> None:
    """Raise an error if the output of a plant at a sample depends on the input at the same sample."""
    if direct and plant.delay < h * ALIGNED:
        raise ValueError(
            f"plant must have a dead time or no direct feedthrough in a sampled loop, found {plant!r}"
        )


class SampledPlant(NamedTuple):
    """A process between a hold and a sampler, in coordinates in which the transition matrix is triangular."""

    transition: Any  # (n, n), upper triangular
    # For each piece of a sample interval: effect of the input (n,), and delay of this input in samples.
    inputs: list[tuple[Any, int]]
    output: Any  # (n,)
    direct: float

    def __call__(self, z: Any) -> Any:
        """Evaluate G at points z, of any shape."""
        rows: list[Any] = []  # elements of output (z - transition)^-1
        for j in range(self.output.size):
            before = sum(
                (row * t for row, t in zip(rows, self.transition[:j, j], strict=True)), self.output[j]
            )
            rows.append(before / (z - self.transition[j, j]))
        value = self.direct * z ** -self.inputs[0][1]
        for gamma, lag in self.inputs:
            value = value + sum(row * g for row, g in zip(rows, gamma, strict=True)) * z**-lag
        return value


def sampled_plant(process: Process, h: float) -> SampledPlant:
    """Discretise a process with a held input and its exact dead time."""
    A, b, c, d = realise(process.num, process.den)
    if process.delay > LONGEST_DELAY * h:
        raise ValueError(
            f"delay must be at most {LONGEST_DELAY:g} samples in a sampled loop, found {process.delay:.4g} with a "
            f"sample time of {h:.4g}; use the continuous controller"
        )
    parts = pieces(process.delay, h)
    require_later_answer(process, d, h)
    phi, inputs = np.eye(c.size), []
    for piece in reversed(parts):
        transition, gamma = held(A, b, piece.time)
        inputs.append((phi @ gamma, piece.lag_samples))
        phi = phi @ transition
    triangular, basis = schur(phi, output="complex") if c.size else (phi, phi)
    return SampledPlant(
        triangular, [(basis.conj().T @ gamma, lag) for gamma, lag in reversed(inputs)], c @ basis, d
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class AxisInZ(Axis):
    """A sampled loop along the upper half of the unit circle, z = e^(jωh).

    Attributes
    ----------
    transfer : callable
        Function that returns numerator and denominator of L at s on or near the imaginary axis. The unstable poles of L
        are zeros of the denominator. Numerator and denominator have poles only inside the unit circle.
    """

    transfer: Callable[[Any], tuple[Any, Any]]

    def at(self, w: Any) -> Samples:
        return Samples(w, *self.transfer(1j * w))

    def encirclements(self, contour_slope: float, contour_shift: float) -> int | None:
        """Count zeros of the characteristic function outside a contour. Return None if a zero lies on the contour.

        The contour is z = e^(s h) with s = jω - contour_slope * ω - contour_shift. It is the unit circle if slope and
        shift are 0, and otherwise a spiral.

        Notes
        -----
        The characteristic function is N + D for L = N/D. If |L| stays below 1 between two points of the grid, the
        change of angle(N + D) follows from angle(D) and angle(1 + L) at both points. If |L| stays above 1, this change
        follows from angle(N) and angle(1 + 1/L). The first rule applies only if angle(D) changes by at most
        `LARGEST_TURN`, and the second rule only if angle(N), without the turn by the dead time, changes by at most
        `LARGEST_TURN`. All other steps are halved until angle(N + D) changes by at most `LARGEST_TURN`.
        """

        def characteristic(w: Any) -> Any:
            num, den = self.transfer(1j * w - (contour_slope * w + contour_shift))
            value = den + num
            return np.where(np.abs(value) > ON_CONTOUR * (np.abs(den) + np.abs(num)), value, np.nan)

        w = self.grid
        with np.errstate(all="ignore"):
            num, den = self.transfer(1j * w - (contour_slope * w + contour_shift))
            f = characteristic(w)
            first, last = f[0], f[-1]
            if np.any(np.isnan(f)):
                return None
            L, size = num / den, np.abs(num) / np.abs(den)
            quiet, loud = (
                most_between(*pair) < 1 for pair in ((size[:-1], size[1:]), (1 / size[:-1], 1 / size[1:]))
            )
            turned = num * np.exp(1j * w * self.delay)
            by_den, by_num = (np.angle(part[1:] * np.conj(part[:-1])) for part in (den, turned))
            known = (quiet & (np.abs(by_den) <= LARGEST_TURN)) | (loud & (np.abs(by_num) <= LARGEST_TURN))
            in_quiet = by_den + np.diff(np.angle(1 + L))
            in_loud = by_num - np.diff(w) * self.delay + np.diff(np.angle(1 + 1 / L))
            total = float(np.where(quiet, in_quiet, in_loud)[known].sum())
            w = self.points(~known, COARSE_STEP)
            inside = ~known[np.searchsorted(self.grid, w[1:]) - 1]
            f = characteristic(w)
            a, b, fa, fb = w[:-1][inside], w[1:][inside], f[:-1][inside], f[1:][inside]
            for _ in range(HALVINGS):
                turn = np.angle(fb * np.conj(fa))
                if np.any(np.isnan(turn)):
                    return None
                wide = np.abs(turn) > LARGEST_TURN
                total += float(turn[~wide].sum())
                if not wide.any():
                    break
                a, b, fa, fb = a[wide], b[wide], fa[wide], fb[wide]
                middle = 0.5 * (a + b)
                fm = characteristic(middle)
                a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
                fa, fb = np.concatenate([fa, fm]), np.concatenate([fm, fb])
            else:
                return None
        # The characteristic function is real at ω = 0 and ω = end. Add the changes of the angle between these ends and
        # the ends of the grid.
        total += float(np.angle(first / first.real)) - float(np.angle(last / last.real))
        return round_to_count(-total / np.pi)


def _axis_in_z(loop: Loop, controller: DigitalController) -> AxisInZ:
    h, process = controller.sample_time, loop.process
    plant = sampled_plant(process, h)
    poles = roots(process.den)
    z_poles = np.append(np.exp(poles * h), np.ones(int(controller.integrates)))
    unstable = z_poles[np.abs(z_poles) > 1 - 1e-9].tolist()

    def transfer(s: Any) -> tuple[Any, Any]:
        z, moved = np.exp(s * h), 1.0
        for pole in unstable:
            moved = moved * ((z - pole) / (z - 0.5 * pole / abs(pole)))
        return plant(z) * controller(z) * moved, moved + 0.0 * z

    def L(w: float) -> float:
        num, den = transfer(1j * w)
        return float((num / den).real)

    grid, end = frequencies(poles, process.delay, math.pi / h), math.pi / h
    integrates = controller.integrates or process.den[-1] == 0
    # If no zero of the plant cancels the integrator, L is infinite at zero frequency.
    at_zero = math.inf if integrates and process.num[-1] != 0 else L(grid[0] if integrates else 0.0)
    on_grid = Samples(grid, *transfer(1j * grid))
    return AxisInZ(grid, on_grid, process.delay + h, at_zero, L(end), end, transfer=transfer)


def axis_of(loop: Loop) -> Axis:
    """Return a loop as an `AxisInS`, or as an `AxisInZ` if its controller is digital.

    Raises
    ------
    TypeError, ValueError
        If the argument is not a `Loop`, if the loop is ill-posed, or if the dead time exceeds 1e6 samples.
    """
    require_loop(loop)
    return axis_in_s(loop) if loop.digital is None else _axis_in_z(loop, loop.digital)
