r"""The optimisation behind `pidalab.optimal`: error and limits as smooth functions of the gains, with gradients.

The unknowns are the gains, made dimensionless with the gain and the time scale of the process, and the logarithm of the
filter time. With :math:`C = c/q`, q the filter, everything is
known at each frequency in closed form:

.. math:: L = P C, \qquad \frac{\partial L}{\partial K_k} = \frac{P s^k}{q}, \qquad
          \frac{\partial y}{\partial K_k} = - \frac{P s^k}{q}\, S\, y .

The responses come from their Laplace transforms on a line right of the axis by a fast Fourier transform: dead time
exact, the whole gradient for the cost of one more transform. The IAE is the exact integral of the error and twice the
area on the other side of zero, between samples along straight lines: its slope has no jumps, so that Newton's method
can end in its least value.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pidalab._check import Array
from pidalab.optimal._heights import HEIGHTS, top, turned, weights, with_turns
from pidalab.process import Process
from pidalab.roots import roots

SEARCH_SAMPLES = 2048  # of a response
DAMPING = 3.0  # real part of the line of the transform, times the horizon
REST = 1e-3  # share of the integral that the transform may miss

GAIN_UNITS = (0.1, 1.0)  # least and largest unit of a gain in a descent
WALL = 1e9  # in place of what is to be small, where a step has left the stable loops

Slope = Callable[[], Array]  # of a value, where a search needs it: along a line it looks at values alone


class Problem:
    """One process, one order: what a design is worth, and how near it is to its limits.

    Parameters
    ----------
    process : Process
        With positive gain.
    order : int
        Highest derivative.
    scale : tuple of float
        Gain and time that make the unknowns dimensionless.
    """

    def __init__(self, process: Process, order: int, scale: tuple[float, float]) -> None:
        self.process, self.order = process, order
        self.gain, self.time = scale
        # units of the gains K_-1 ... K_m
        self.units = self.time ** np.arange(-1.0, order + 1) / self.gain
        self._characteristic()
        self.gains, self.size = order + 2, order + 3

    def controller(self, x: Array) -> tuple[Array, float]:
        """Gains K_-1 ... K_m and filter time of a vector of unknowns."""
        return x[: self.gains] * self.units, self.time * float(np.exp(x[self.gains]))

    def unknowns(self, gains: Array, time: float) -> Array:
        """Vector of unknowns of gains K_-1, K_0, ..., of which the last may be missing, and a filter time."""
        found = np.zeros(self.size)
        found[: len(gains)] = gains / self.units[: len(gains)]
        found[-1] = np.log(time / self.time)
        return found

    def _actions(self, s: Any) -> Any:
        """s^-1 ... s^m at complex s, for unknowns without dimension and without the filter."""
        return self.units[:, None] * s ** np.arange(-1.0, self.order + 1)[:, None]

    def _filter(self, x: Array, s: Any) -> tuple[Any, Any]:
        """The filter at complex s, and one of its lags."""
        _, tf = self.controller(x)
        # products: numpy takes the powers of complex arrays by logarithms
        whole = lag = 1 / (1 + tf * s)
        for _ in range(self.order):
            whole = whole * lag
        return whole, lag

    def _controller(self, x: Array, s: Any, actions: Any) -> tuple[Any, Any]:
        """Controller at complex s, and its slopes by the gains and, when asked, by the logarithm of the filter time."""
        whole, lag = self._filter(x, s)
        by_gains = actions * whole
        controller = x[: self.gains] @ by_gains
        return controller, lambda: np.vstack([by_gains, (self.order + 1) * (lag - 1) * controller])

    def worth(self, horizon: float, samples: int = SEARCH_SAMPLES) -> Any:
        """Return the function that gives the IAE of a step of the load, and the function of its gradient.

        What comes after the horizon counts as IE.
        """
        s = DAMPING / horizon + 2j * np.pi / horizon * np.arange(samples // 2 + 1)
        step = horizon / samples
        growth = np.exp(DAMPING * np.arange(samples) / samples) / step
        plant, actions = self.process(s), self._actions(s)
        disturbed = plant / s
        both_signs = np.full(s.size, 2.0 / samples)  # a frequency stands for its negative too
        both_signs[[0, -1]] *= 0.5

        def value(x: Array) -> tuple[float, Slope]:
            whole, lag = self._filter(x, s)
            controller = (x[: self.gains] @ actions) * whole
            sensitivity = 1 / (1 + plant * controller)
            e = disturbed * sensitivity  # the error is -y; its sign does not matter
            error = np.fft.irfft(e, n=samples) * growth
            ie = 1 / (max(x[0], 1e-12) * self.units[0])
            other, by_error = _other_side(error)
            # a rest behind the horizon that would take the other side as a gain counts against it
            rest = min(ie - step * float(error.sum()) + REST * ie, 0.0) / (REST * ie)

            def slope() -> Array:
                # by Parseval the integral of weight times slope over time is one over frequency: one transform
                weight = np.conj(np.fft.rfft((2 * by_error - 2 * rest) * step * growth)) * both_signs
                weighted = -plant * sensitivity * e * weight
                by_time = (self.order + 1) * (((lag - 1) * controller) @ weighted)
                found = np.append(actions @ (weighted * whole), by_time).real
                found[0] -= (1 + 2 * rest * (1 + REST) - rest**2 * REST) * ie / max(x[0], 1e-12)
                return found / self.time

            return (ie + 2 * step * other + REST * ie * rest**2) / self.time, slope

        return value

    def _characteristic(self) -> None:
        r"""Prepare :math:`f = (s\,a + e^{-sL} b\,s\,C)/(s + \sigma)^{n+1}` on the axis, for a process b/a of order n.

        Its zeros are the poles of the loop, its own poles are stable: along the axis f turns by -pi for each unstable
        one.
        """
        process, sigma = self.process, 1 / self.time
        speeds = np.abs(roots(process.den)) * self.time
        slowest = float(np.min(speeds[speeds > 0], initial=1.0))
        around = np.append(0.0, np.geomspace(min(1e-3, max(0.01 * slowest, 1e-8)), 1e3, 600))
        around = with_turns(around, process.delay / self.time, 0.3 * np.arange(1.0, 400.0), end=np.inf)
        self.axis = s = 1j * around / self.time
        scale = (s + sigma) ** -len(process.den)
        self.own = s * np.polyval(process.den, s) * scale
        # with the s of the function the actions are K_-1 + K_0 s + ...
        fed_back = np.polyval(process.num, s) * np.exp(-s * process.delay) * scale
        self.fed_back = fed_back * self.units[:, None] * s ** np.arange(self.order + 2.0)[:, None]

    def unstable(self, x: Array) -> bool:
        """Whether the characteristic function turns along the axis as that of an unstable loop."""
        f = self.own + (x[: self.gains] @ self.fed_back) * self._filter(x, self.axis)[0]
        return abs(turned(np.append(f, self.process.den[0]))) > 0.5 * np.pi

    def limits(self, w: Array, most: dict[str, float], process: Process | None = None) -> Any:
        """Return the function of what is left to limits at frequencies w, and of its gradient.

        The limits are those of `HEIGHTS`, by name. With another process in place of the problem's own, if one is given.
        With r the square of a height over its limit it is 1/r - 1 of |S|, and (1 - r)/(1 + r) of the others.
        """
        s = 1j * w
        plant, actions = (process or self.process)(s), self._actions(s)
        kinds = [(kind, most[name] ** 2) for kind, name in enumerate(HEIGHTS) if name in most]

        def value(x: Array) -> tuple[Array, Slope]:
            controller, slopes = self._controller(x, s, actions)
            L = plant * controller
            size = np.abs(1 + L) ** 2
            shares = [np.abs(top(kind, controller, L)) ** 2 / (limit * size) for kind, limit in kinds]
            left = [(1 - r) / (1 + r if kind else r) for (kind, _), r in zip(kinds, shares, strict=True)]

            def slope() -> Array:
                by_all, found = slopes(), []
                for (kind, _), r in zip(kinds, shares, strict=True):
                    factor = -4 * r / (1 + r) ** 2 if kind else -2 / r
                    found.append(np.real(factor * weights(kind, L)[0] / controller * by_all))
                out = np.zeros((self.size, len(kinds) * w.size))
                out[: self.gains + 1] = np.hstack(found)
                return out.T

            return np.concatenate(left), slope

        return value


def _other_side(error: Array) -> tuple[float, Array]:
    """Sum over the steps of the mean of what is below zero along straight lines, and its slope by the samples."""
    at = np.flatnonzero((error[:-1] < 0) | (error[1:] < 0))
    a, b = error[at], error[at + 1]
    low, high = np.minimum(a, b), np.maximum(a, b)
    # the share of the step that is below zero, all of it where both ends are
    share = np.where(high > 0, low / np.where(high > 0, low - high, 1.0), 1.0)
    below = np.minimum(high, 0.0)
    by_low, by_high = -share + 0.5 * share**2, np.where(high > 0, -0.5 * share**2, -0.5)
    slope = np.zeros(error.size)
    slope[at] += np.where(a <= b, by_low, by_high)
    slope[at + 1] += np.where(a <= b, by_high, by_low)
    return float(-0.5 * (low * share + below).sum()), slope


class CachedValueAndSlope:
    """A function that gives a value and a function of its slope, for those who ask for one after the other."""

    def __init__(self, both: Any) -> None:
        self.both, self.place = both, b""

    def _at(self, x: Array) -> tuple[Any, Any]:
        if x.tobytes() != self.place:  # a tenth of the time that arrays take to be compared
            self.place, self.last = x.tobytes(), self.both(x.copy())
        return self.last

    def value(self, x: Array) -> Any:
        """Value at x."""
        return self._at(x)[0]

    def slope(self, x: Array) -> Any:
        """Slope at x."""
        return self._at(x)[1]()


class Scaled:
    """Unknowns as a descent sees them: the integral gain by its logarithm, the others in units of where it starts."""

    def __init__(self, start: Array, gains: int) -> None:
        self.unit = np.ones(start.size)
        self.unit[1:gains] = np.clip(start[1:gains], *GAIN_UNITS)

    def __call__(self, x: Array) -> Array:
        """From unknowns to what the descent sees."""
        z = x / self.unit
        z[0] = np.log(x[0])
        return z

    def back(self, z: Array) -> Array:
        """From what the descent sees to unknowns."""
        x = z * self.unit
        x[0] = np.exp(z[0])
        return x

    def slopes(self, x: Array, by_x: Array) -> Array:
        """From slopes by the unknowns to those by what the descent sees."""
        by_z = by_x * self.unit
        by_z[..., 0] = by_x[..., 0] * x[0]
        return by_z

    def functions(self, one: CachedValueAndSlope) -> tuple[Any, Any]:
        """Value and slope of a function, as functions of what the descent sees."""

        def slope(z: Array) -> Array:
            x = self.back(z)
            return self.slopes(x, one.slope(x))

        return lambda z: one.value(self.back(z)), slope
