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

from typing import Any

import numpy as np

from pidalab._check import Array
from pidalab.process import Process
from pidalab.roots import roots

SAMPLES = 2048  # of a response
DAMPING = 3.0  # real part of the line of the transform, times the horizon


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
        """Controller, and its slopes by the gains and the logarithm of the filter time, at complex s."""
        whole, lag = self._filter(x, s)
        slopes = np.empty((self.gains + 1, s.size), dtype=complex)
        np.multiply(actions, whole, out=slopes[:-1])
        controller = x[: self.gains] @ slopes[:-1]
        slopes[-1] = (self.order + 1) * (lag - 1) * controller
        return controller, slopes

    def worth(self, horizon: float) -> Any:
        """Return the function that gives the IAE of a step and its gradient; what comes after the horizon as IE."""
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

        def value(x: Array) -> tuple[float, Array]:
            e, slopes = transform(x)
            error = np.fft.irfft(e - known, n=SAMPLES) * growth + fall
            sign = np.sign(error)
            # the rest of the integral, from the static gain of the error
            ie, ie_slope = self._ie(x)
            rest = ie - float(error @ step)
            # by Parseval the integral of sign times slope over time is one over frequency: one transform for all
            sign_of_rest = np.sign(rest)
            weight = np.fft.rfft((sign - sign_of_rest) * step * growth)
            slope = slopes(both_signs * np.conj(weight)) + sign_of_rest * ie_slope
            return (float(np.abs(error) @ step) + abs(rest)) / self.time, slope / self.time

        return value

    def _error(self, s: Any) -> Any:
        """Return the function that gives the transform of the error at s, and its slopes summed with weights."""
        plant, actions = self.process(s), self._actions(s)
        disturbed = plant / s

        def transform(x: Array) -> tuple[Array, Any]:
            whole, lag = self._filter(x, s)
            controller = (x[: self.gains] @ actions) * whole
            sensitivity = 1 / (1 + plant * controller)
            if self.test == "load":  # the error is -y
                e = disturbed * sensitivity
                by_controller, by_prefilter = -plant * sensitivity * e, []
            else:
                weight, time = self.prefilter(x)
                under = 1 / (1 + time * s)
                closed = plant * controller * sensitivity
                front = (weight * time * s + 1) * under
                e = (1 - closed * front) / s
                by_controller = -disturbed * sensitivity**2 * front
                by_prefilter = [-closed * time * under, -closed * (weight - 1) * time * under**2]

            def slopes(weights: Array) -> Array:
                weighted = by_controller * weights
                by_time = (self.order + 1) * (((lag - 1) * controller) @ weighted)
                sums = actions @ (weighted * whole), [by_time], [one @ weights for one in by_prefilter]
                return np.concatenate(sums).real

            return e, slopes

        return transform

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
        """Return the function of what is left to the limits of |S| and |C S| at frequencies w, and its gradient."""
        s = 1j * w
        plant, actions = self.process(s), self._actions(s)

        def value(x: Array) -> tuple[Array, Array]:
            controller, slopes = self._controller(x, s, actions)
            back = 1 + plant * controller
            size, turn = np.abs(back) ** 2, 2 * np.real(np.conj(back) * plant * slopes)
            left, slope = [ms**2 * size - 1], [ms**2 * turn]
            if mks is not None:
                # |C|^2 <= mks^2 |1 + L|^2, over the size of the two
                own = np.abs(controller) ** 2
                total = 1 / (own + mks**2 * size)
                a, b = 2 * np.real(np.conj(controller) * slopes), mks**2 * turn
                left.append((mks**2 * size - own) * total)
                slope.append((b - a) * total - (mks**2 * size - own) * total**2 * (a + b))
            out = np.concatenate(left), np.zeros((self.size, len(left) * w.size))
            out[1][: self.gains + 1] = np.hstack(slope)
            return out[0], out[1].T

        return value
