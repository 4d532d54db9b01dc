r"""The optimisation behind `pidalab.optimal`: error and limits as smooth functions of the gains, with gradients.

The unknowns are the gains, made dimensionless with the gain and the time scale of the process, and the logarithm of the
filter time; behind them, for the set point, those of the prefilter. With :math:`C = c/q`, q the filter, everything is
known at each frequency in closed form:

.. math:: L = P C, \qquad \frac{\partial L}{\partial K_k} = \frac{P s^k}{q}, \qquad
          \frac{\partial y}{\partial K_k} = - \frac{P s^k}{q}\, S\, y .

The responses come from their Laplace transforms on a line right of the axis by a fast Fourier transform: dead time
exact, the whole gradient for the cost of one more transform.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pidalab._check import Array
from pidalab.process import Process
from pidalab.roots import roots

SAMPLES = 2048  # of a response
DAMPING = 3.0  # real part of the line of the transform, times the horizon

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
    test : {"load", "setpoint"}
        Which step counts.
    """

    def __init__(self, process: Process, order: int, scale: tuple[float, float], test: str) -> None:
        self.process, self.order, self.test = process, order, test
        self.gain, self.time = scale
        # units of the gains K_-1 ... K_m
        self.units = self.time ** np.arange(-1.0, order + 1) / self.gain
        self._characteristic()
        self.gains, self.size = order + 2, order + 3 + (2 if test == "setpoint" else 0)

    def controller(self, x: Array) -> tuple[Array, float]:
        """Gains K_-1 ... K_m and filter time of a vector of unknowns."""
        return x[: self.gains] * self.units, self.time * float(np.exp(x[self.gains]))

    def prefilter(self, x: Array) -> tuple[float, float]:
        """Weight and time constant of the prefilter (weight T s + 1)/(T s + 1)."""
        return float(x[-2]), self.time * float(np.exp(x[-1]))

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

    def worth(self, horizon: float) -> Any:
        """Return the function that gives the IAE of a step, and the function of its gradient.

        What comes after the horizon counts as IE.
        """
        s = DAMPING / horizon + 2j * np.pi / horizon * np.arange(SAMPLES // 2 + 1)
        t = horizon / SAMPLES * np.arange(SAMPLES)
        growth = np.exp(DAMPING / horizon * t) * SAMPLES / horizon
        transform = self._error(s)
        known, fall = (
            (1 / (s + 1 / self.time), np.exp(-t / self.time)) if self.test == "setpoint" else (0.0, 0.0)
        )
        step = np.full(SAMPLES, horizon / SAMPLES)
        step[0] *= 0.5  # trapezoids
        both_signs = np.full(s.size, 2.0 / SAMPLES)  # a frequency stands for its negative too
        both_signs[[0, -1]] *= 0.5

        def value(x: Array) -> tuple[float, Slope]:
            e, slopes = transform(x)
            error = np.fft.irfft(e - known, n=SAMPLES) * growth + fall
            # the rest of the integral, from the static gain of the error
            ie, ie_slope = self._ie(x)
            rest = ie - float(error @ step)

            def slope() -> Array:
                # by Parseval the integral of sign times slope over time is one over frequency: one transform for all
                sign_of_rest = np.sign(rest)
                weight = np.fft.rfft((np.sign(error) - sign_of_rest) * step * growth)
                return (slopes(both_signs * np.conj(weight)) + sign_of_rest * ie_slope) / self.time

            return (float(np.abs(error) @ step) + abs(rest)) / self.time, slope

        return value

    def _error(self, s: Any) -> Any:
        """Return the function that gives the transform of the error at s, and its slopes summed with weights."""
        plant, actions = self.process(s), self._actions(s)
        of_step = (self._of_load if self.test == "load" else self._of_setpoint)(s, plant)

        def transform(x: Array) -> tuple[Array, Any]:
            whole, lag = self._filter(x, s)
            controller = (x[: self.gains] @ actions) * whole
            e, by_all = of_step(x, controller, 1 / (1 + plant * controller))

            def slopes(weights: Array) -> Array:
                by_controller, by_prefilter = by_all()
                weighted = by_controller * weights
                by_time = (self.order + 1) * (((lag - 1) * controller) @ weighted)
                sums = actions @ (weighted * whole), [by_time], [one @ weights for one in by_prefilter]
                return np.concatenate(sums).real

            return e, slopes

        return transform

    def _of_load(self, s: Any, plant: Any) -> Any:
        """Error after a step of the load, -y, and its slopes by the controller and by no prefilter."""
        disturbed = plant / s

        def error(x: Array, controller: Array, sensitivity: Array) -> tuple[Array, Any]:
            e = disturbed * sensitivity
            return e, lambda: (-plant * sensitivity * e, [])

        return error

    def _of_setpoint(self, s: Any, plant: Any) -> Any:
        """Error after a step of the set point, and its slopes by controller, weight and lag of the prefilter."""
        disturbed = plant / s

        def error(x: Array, controller: Array, sensitivity: Array) -> tuple[Array, Any]:
            weight, time = self.prefilter(x)
            under = 1 / (1 + time * s)
            closed = plant * controller * sensitivity
            front = (weight * time * s + 1) * under

            def by_all() -> tuple[Array, list[Array]]:
                by_prefilter = [-closed * time * under, -closed * (weight - 1) * time * under**2]
                return -disturbed * sensitivity**2 * front, by_prefilter

            return (1 - closed * front) / s, by_all

        return error

    def _ie(self, x: Array) -> tuple[float, Array]:
        """Integral of the error, and its slopes."""
        slope = np.zeros(self.size)
        ki = max(x[0], 1e-12) * self.units[0]
        slope[0] = -self.units[0] / ki**2
        if self.test == "load":
            return 1 / ki, slope
        weight, time = self.prefilter(x)
        at_zero = 1 / self.process.gain()  # 0 for an integrator
        slope *= at_zero
        slope[-2], slope[-1] = -time, (1 - weight) * time
        return at_zero / ki + (1 - weight) * time, slope

    def _characteristic(self) -> None:
        r"""Prepare :math:`f = (s\,a + e^{-sL} b\,s\,C)/(s + \sigma)^{n+1}` on the axis, for a process b/a of order n.

        Its zeros are the poles of the loop, its own poles are stable: along the axis f turns by -pi for each unstable
        one.
        """
        process, sigma = self.process, 1 / self.time
        speeds = np.abs(roots(process.den)) * self.time
        slowest = float(np.min(speeds[speeds > 0], initial=1.0))
        around = np.append(0.0, np.geomspace(min(1e-3, max(0.01 * slowest, 1e-8)), 1e3, 600))
        if process.delay:  # and where the dead time turns the phase
            around = np.sort(np.append(around, np.arange(1.0, 400.0) * 0.3 * self.time / process.delay))
        self.axis = s = 1j * around / self.time
        scale = (s + sigma) ** -len(process.den)
        self.own = s * np.polyval(process.den, s) * scale
        # with the s of the function the actions are K_-1 + K_0 s + ...
        fed_back = np.polyval(process.num, s) * np.exp(-s * process.delay) * scale
        self.fed_back = fed_back * self.units[:, None] * s ** np.arange(self.order + 2.0)[:, None]

    def unstable(self, x: Array) -> bool:
        """Whether the characteristic function turns along the axis as that of an unstable loop."""
        f = self.own + (x[: self.gains] @ self.fed_back) * self._filter(x, self.axis)[0]
        return (
            abs(float(np.angle(f[1:] / f[:-1]).sum() + np.angle(self.process.den[0] / f[-1]))) > 0.5 * np.pi
        )

    def limits(self, w: Array, ms: float, mks: float | None) -> Any:
        """Return the function of what is left to the limits of |S| and |C S| at frequencies w, and of its gradient."""
        s = 1j * w
        plant, actions = self.process(s), self._actions(s)

        def value(x: Array) -> tuple[Array, Slope]:
            controller, slopes = self._controller(x, s, actions)
            back = 1 + plant * controller
            size = np.abs(back) ** 2
            left = [ms**2 * size - 1]
            if mks is not None:
                # |C|^2 <= mks^2 |1 + L|^2, over the size of the two
                own = np.abs(controller) ** 2
                total = 1 / (own + mks**2 * size)
                left.append((mks**2 * size - own) * total)

            def slope() -> Array:
                by_all = slopes()
                turn = 2 * np.real(np.conj(back) * plant * by_all)
                found = [ms**2 * turn]
                if mks is not None:
                    a, b = 2 * np.real(np.conj(controller) * by_all), mks**2 * turn
                    found.append((b - a) * total - (mks**2 * size - own) * total**2 * (a + b))
                out = np.zeros((self.size, len(left) * w.size))
                out[: self.gains + 1] = np.hstack(found)
                return out.T

            return np.concatenate(left), slope

        return value
