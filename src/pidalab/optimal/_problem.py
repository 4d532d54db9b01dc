r"""The optimisation behind `pidalab.optimal`: error and limits as smooth functions of the gains, with gradients.

The unknowns are the gains, made dimensionless with the gain and the time scale of the process, and the logarithm of the
filter time; behind them, for the set point, those of the prefilter. With :math:`C = c/q`, q the filter, everything is
known at each frequency in closed form:

.. math:: L = P C, \qquad \frac{\partial L}{\partial K_k} = \frac{P s^k}{q}, \qquad
          \frac{\partial y}{\partial K_k} = - \frac{P s^k}{q}\, S\, y .

The responses come from their Laplace transforms on a line right of the axis by a fast Fourier transform: dead time
exact, gradients for the cost of one more transform each.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pidalab._check import Array
from pidalab.process import Process

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
        around = np.geomspace(1e-3, 1e3, 600)
        if process.delay:  # and where the dead time turns the phase
            around = np.sort(np.append(around, np.arange(1.0, 400.0) * 0.3 * self.time / process.delay))
        self.axis = 1j * around / self.time
        self.plant = process(self.axis)
        self.gains, self.size = order + 2, order + 3 + (2 if test == "setpoint" else 0)

    def controller(self, x: Array) -> tuple[Array, float]:
        """Gains K_-1 ... K_m and filter time of a vector of unknowns."""
        return x[: self.gains] * self.units, self.time * float(np.exp(x[self.gains]))

    def prefilter(self, x: Array) -> tuple[float, float]:
        """Weight and time constant of the prefilter (weight T s + 1)/(T s + 1)."""
        return float(x[-2]), self.time * float(np.exp(x[-1]))

    def _controller(self, x: Array, s: Any) -> tuple[Any, Any]:
        """Controller, and its slopes by the gains and the logarithm of the filter time, at complex s."""
        _, tf = self.controller(x)
        slopes = np.empty((self.gains + 1, s.size), dtype=complex)
        slopes[0] = 1 / (s * (1 + tf * s) ** (self.order + 1))
        for k in range(1, self.gains):
            slopes[k] = slopes[k - 1] * s
        slopes[:-1] *= self.units[:, None]
        controller = x[: self.gains] @ slopes[:-1]
        slopes[-1] = -controller * (self.order + 1) * tf * s / (1 + tf * s)
        return controller, slopes

    def worth(self, horizon: float) -> Any:
        """Return the function that gives the IAE of a step and its gradient; what comes after the horizon as IE."""
        frequency = 2 * np.pi / horizon * np.arange(SAMPLES // 2 + 1)
        s = DAMPING / horizon + 1j * frequency
        plant = self.process(s)
        t = horizon / SAMPLES * np.arange(SAMPLES)
        growth = np.exp(DAMPING / horizon * t) * SAMPLES / horizon
        known, fall = (
            (1 / (s + 1 / self.time), np.exp(-t / self.time)) if self.test == "setpoint" else (0.0, 0.0)
        )
        step = np.full(SAMPLES, horizon / SAMPLES)
        step[0] *= 0.5  # trapezoids

        def value(x: Array) -> tuple[float, Array]:
            controller, slopes = self._controller(x, s)
            sensitivity = 1 / (1 + plant * controller)
            if self.test == "load":  # the error is -y
                e = plant * sensitivity / s
                by_x = -plant * sensitivity * e * slopes
            else:
                weight, time = self.prefilter(x)
                under = 1 / (1 + time * s)
                closed = plant * controller * sensitivity
                front = (weight * time * s + 1) * under
                e = (1 - closed * front) / s
                by_x = np.empty((self.size, s.size), dtype=complex)
                by_x[:-2] = -plant * sensitivity**2 * slopes * front / s
                by_x[-2] = -closed * time * under
                by_x[-1] = -closed * (weight - 1) * time * under**2
            both = np.fft.irfft(np.vstack([e - known, by_x]), n=SAMPLES, axis=1) * growth
            error = both[0] + fall
            sign = np.sign(error)
            # the rest of the integral, from the static gain of the error
            ie, ie_slope = self._ie(x)
            rest = ie - float(error @ step)
            slope = both[1:] @ (step * sign) + np.sign(rest) * (ie_slope - both[1:] @ step)
            return (float(np.abs(error) @ step) + abs(rest)) / self.time, slope / self.time

        return value

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

    def turns(self, x: Array) -> float:
        """Turn of 1 + L along the axis: another one by 2 pi belongs to other unstable poles."""
        gains, tf = self.controller(x)
        controller = np.polyval(gains[::-1], self.axis) / (
            self.axis * (1 + tf * self.axis) ** (self.order + 1)
        )
        back = 1 + self.plant * controller
        return float(np.angle(back[1:] / back[:-1]).sum())

    def limits(self, w: Array, ms: float, mks: float | None) -> Any:
        """Return the function of what is left to the limits of |S| and |C S| at frequencies w, and its gradient."""
        s = 1j * w
        plant = self.process(s)

        def value(x: Array) -> tuple[Array, Array]:
            controller, slopes = self._controller(x, s)
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

    def noise(self, sample_time: float) -> Any:
        """Return the function of the variance of u per unit of held white noise, and its gradient.

        The controller is taken as continuous: what the sampled one makes of it is left to whoever asks.
        """
        h = sample_time
        w = np.concatenate(
            [np.geomspace(1e-4 / self.time, 0.1 / h, 300), np.linspace(0.1, 20 * np.pi, 400)[1:] / h]
        )
        weight = np.gradient(w) * np.sinc(w * h / (2 * np.pi)) ** 2 * h / np.pi
        s = 1j * w
        plant = self.process(s)

        def value(x: Array) -> tuple[float, Array]:
            controller, slopes = self._controller(x, s)
            sensitivity = 1 / (1 + plant * controller)
            u = controller * sensitivity
            slope = np.zeros(self.size)
            slope[: self.gains + 1] = (2 * np.real(np.conj(u) * sensitivity**2 * slopes)) @ weight
            return float(np.abs(u) ** 2 @ weight), slope

        return value
