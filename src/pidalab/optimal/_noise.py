r"""What the sampled loop makes of white noise, as a smooth function of the gains and the filter time.

The controller is discretised for held inputs, as `pidalab.noise_gain` runs it. It is a sum of lags behind a hold, whose
responses from sample to sample follow from one another: with :math:`a = e^{-\rho}`, :math:`\rho = h/T_F`,

.. math:: (z - a)\, X_i = P(i, \rho) + a \sum_{j<i} \frac{\rho^{i-j}}{(i-j)!} X_j,

where :math:`X_i` belongs to :math:`1/(1 + T_F s)^i` and P is the incomplete gamma function. Every action behind the
filter, and its slope by the filter time, is a sum of these. By Parseval the variance of u is the mean of
:math:`|C/(1 + G C)|^2` over the unit circle; the dead time is exact.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pidalab._check import Array
from pidalab.optimal._heights import turned, with_turns
from pidalab.optimal._problem import Problem, Slope
from pidalab.robustness.sampled import sampled_plant
from pidalab.roots import roots


class SampledNoise:
    """The variance of u per unit of that of white noise, and its gradient.

    Parameters
    ----------
    problem : Problem
        Whose unknowns count.
    sample_time : float
        Of controller and noise; no filter may be faster.
    density : int, optional
        How many times as many frequencies; 1 is good for four digits.
    """

    def __init__(self, problem: Problem, sample_time: float, density: int = 1) -> None:
        self.problem, self.h = problem, sample_time
        self.w = _frequencies(problem.time, problem.process.delay, sample_time, density)
        self.z = np.exp(1j * self.w * sample_time)
        self.plant = sampled_plant(problem.process, sample_time)(self.z)
        poles = np.append(np.exp(roots(problem.process.den).astype(complex) * sample_time), 1.0)
        outside = poles[np.abs(poles) > 1 - 1e-9][:, None]
        self.moved = np.prod((self.z - outside) / (self.z - 0.5 * outside / np.abs(outside)), axis=0)
        self.integrator = sample_time / (self.z - 1)
        self._expand()
        # trapezoids over the upper half of the circle
        steps = np.diff(self.w)
        self.weight = 0.5 * (np.append(steps, 0.0) + np.append(self.w[0], steps)) * sample_time / np.pi

    def __call__(self, x: Array) -> tuple[float, Slope]:
        """Variance at a vector of unknowns, and the function of its gradient."""
        controller, controller_slopes = self._controller(x)
        sensitivity = 1 / (1 + self.plant * controller)
        u = controller * sensitivity

        def slope() -> Array:
            found, slopes = np.zeros(x.size), controller_slopes()
            by_controller = np.conj(u) * sensitivity**2 * self.weight
            found[: slopes.shape[0]] = 2 * np.real(slopes @ by_controller)
            return found

        return float(np.abs(u) ** 2 @ self.weight), slope

    def gain(self, x: Array) -> float:
        """Noise gain, infinite where the sampled loop is unstable."""
        return math.inf if self.unstable(x) else math.sqrt(self(x)[0])

    def unstable(self, x: Array) -> bool:
        """Whether 1 + L, with its unstable poles moved inside, turns around the circle as that of an unstable loop."""
        f = (1 + self.plant * self._controller(x)[0]) * self.moved
        # the function is real at both ends
        return abs(turned(np.append(f[0].real, f))) > 0.5 * np.pi

    def _expand(self) -> None:
        """Write the actions behind the filter, T^k s^k/(1 + T s)^n, and their slopes by the logarithm of T, in lags.

        With :math:`Ts = (1 + Ts) - 1` they are sums of lags with the coefficients of :math:`(1 - 1/(1 + Ts))^k`.
        """
        n = self.problem.order + 1
        self.actions, self.by_time = np.zeros((n + 1, n + 2)), np.zeros((n + 1, n + 2))
        self.actions[0, 1 : n + 1] = -1.0  # K_-1: what the filter makes of 1/s, less 1/s itself
        self.by_time[0, n + 1] = -n
        for k in range(n):
            for j in range(k + 1):
                self.actions[k + 1, n - k + j] = math.comb(k, j) * (-1) ** j
            for j in range(k + 2):
                self.by_time[k + 1, n - k + j] = -n * math.comb(k + 1, j) * (-1) ** j

    def _controller(self, x: Array) -> tuple[Array, Callable[[], Array]]:
        """Sampled controller at the frequencies, and what makes its slopes by gains and log of the filter time."""
        n, (gains, time) = self.problem.order + 1, self.problem.controller(x)
        powers = time ** np.arange(1.0, -n, -1.0)
        lags = self._lags(time, n + 1).view(float)  # real numbers times pairs of them
        controller = (((gains * powers) @ self.actions) @ lags).view(complex)
        controller += gains[0] * self.integrator

        def slopes() -> Array:
            found = np.empty((n + 2, lags.shape[1]))
            np.matmul((self.problem.units * powers)[:, None] * self.actions, lags, out=found[:-1])
            np.matmul((gains * powers) @ self.by_time, lags, out=found[-1])
            found = found.view(complex)
            found[0] += self.problem.units[0] * self.integrator
            return found

        return controller, slopes

    def _lags(self, time: float, most: int) -> Array:
        """Responses of 0, 1, ..., most equal lags behind a hold, from sample to sample."""
        from scipy.special import gammainc

        rho = self.h / time
        a = math.exp(-rho)
        inverse = 1 / (self.z - a)
        own = gammainc(np.arange(1.0, most + 1), rho)
        from_one = [a * rho**k / math.factorial(k) for k in range(most)]
        chain = np.ones((most + 1, self.z.size), dtype=complex)
        for i in range(1, most + 1):
            total = own[i - 1] + sum(from_one[i - j] * chain[j] for j in range(1, i))
            np.multiply(total, inverse, out=chain[i])
        return chain


def _frequencies(time: float, delay: float, h: float, density: int) -> Array:
    """Frequencies up to half that of sampling: by decades, evenly, and where the dead time turns the phase."""
    top = np.pi / h
    lowest = min(1e-4 / time, 1e-3 / h)
    w = np.append(np.geomspace(lowest, top, 400 * density), np.linspace(0.01 * top, top, 250 * density))
    return np.unique(with_turns(w, delay, 0.3 / density * np.arange(1.0, 200.0 * density)))
