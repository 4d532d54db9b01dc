r"""Compute the IAE and the slack of limits for `pidalab.optimal`, with gradients.

The unknowns are the dimensionless gains and the logarithm of the filter time. The IAE and the slack are smooth
functions of the unknowns. Let q be the denominator of the filter, and y the response to a load step. At each frequency,
the derivatives have closed forms:

.. math:: L = P C, \qquad \frac{\partial L}{\partial K_k} = \frac{P s^k}{q}, \qquad
          \frac{\partial y}{\partial K_k} = - \frac{P s^k}{q}\, S\, y .

A fast Fourier transform computes the responses from their Laplace transforms on a line to the right of the imaginary
axis, with exact dead time. The set point is 0, so the IAE is the integral of \|y\|. The integral of y is known
exactly: it is :math:`1/K_{-1}`, which is positive. The IAE is this integral plus twice the area where y is negative.
This area is computed with straight lines between samples. So its gradient is continuous, as Newton's method requires.

The quantities that can be limited at all frequencies are \|S\|, \|C S\|, \|T\| and \|S - T\|/2. They are called
heights. Each height is the modulus of t/(1 + L), with t = 1, C, L or (1 - L)/2. Let ln C change by c, and ln P by p.
Then the logarithm of the height changes by :math:`\operatorname{Re}(a c + b p)`, with

=================  =========  ==========  =========  =====================
height             \|S\|      \|C S\|     \|T\|      half of \|S - T\|
=================  =========  ==========  =========  =====================
a                  -T         S           S          -2 L/(1 - L²)
b                  -T         -T          S          -2 L/(1 - L²)
=================  =========  ==========  =========  =====================

A change of the gains does not change P, so p = 0. A change of the frequency changes both C and P.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from pidalab._check import Array
from pidalab.process import Process
from pidalab.reduction import turned_phase
from pidalab.requirements import Requirements
from pidalab.robustness.in_z import sampled_plant
from pidalab.roots import roots

SEARCH_SAMPLES = 2048  # number of samples of a response
DAMPING = 3.0  # the inverse transform runs along Re s = DAMPING / horizon
# A penalty applies if the integral of y over the horizon exceeds the exact integral of y by more than this fraction.
REST = 1e-3

GAIN_UNITS = (0.1, 1.0)  # least and largest scale factor of a gain in a descent
BARRIER = 1e9  # value of the objective for an unstable loop

# A line search needs only values, so slopes are functions that are called on request.
Slope = Callable[[], Array]
PEAKS = ("ms", "mks", "mt", "inverse_disk")  # the supremum of |S - T|/2 is the inverse of the disk margin
MS, MKS, MT, INVERSE_DISK = range(4)  # the kind of a height is its index in PEAKS


def numerator(kind: int, controller: Any, L: Any) -> Any:
    """Return the numerator t of a height |t/(1 + L)|."""
    return (1.0, controller, L)[kind] if kind != INVERSE_DISK else 0.5 * (1 - L)


def weights(kind: int, L: Any) -> tuple[Any, Any]:
    """Return the weights a and b of changes of ln C and ln P (see the table at the top of this module)."""
    if kind == INVERSE_DISK:
        both = -2 * L / (1 - L * L)
        return both, both
    S = 1 / (1 + L)
    T = L * S
    return -T if kind == MS else S, S if kind == MT else -T


def turned(f: Any) -> float:
    """Return the change of the angle of a function in rad, from its values at closely spaced points."""
    return float(np.angle(f[1:] / f[:-1]).sum())


def with_turns(w: Any, delay: float, angles: Any, end: float | None = None) -> Any:
    """Add to w the frequencies below `end` at which a dead time turns the phase by `angles` in rad, and sort.

    By default `end` is the last frequency of w.
    """
    turns = angles / delay if delay else np.zeros(0)
    return np.sort(np.append(w, turns[turns < (w[-1] if end is None else end)]))


class Problem:
    """IAE and slack of the limits for one process and one order.

    Parameters
    ----------
    process : Process
        Process with positive gain.
    order : int
        Highest derivative of the controller.
    scale : tuple of float
        Gain and time that make the unknowns dimensionless.
    """

    def __init__(self, process: Process, order: int, scale: tuple[float, float]) -> None:
        self.process, self.order = process, order
        self.gain, self.time = scale
        # Units of the gains K_-1 ... K_m.
        self.units = self.time ** np.arange(-1.0, order + 1) / self.gain
        self._characteristic()
        self.gains, self.size = order + 2, order + 3

    def controller(self, x: Array) -> tuple[Array, float]:
        """Return the gains K_-1 ... K_m and the filter time of a vector of unknowns."""
        return x[: self.gains] * self.units, self.time * float(np.exp(x[self.gains]))

    def unknowns(self, gains: Array, time: float) -> Array:
        """Return the unknowns for gains K_-1, K_0, ... and a filter time. Gains that are not given are 0."""
        x = np.zeros(self.size)
        x[: len(gains)] = gains / self.units[: len(gains)]
        x[-1] = np.log(time / self.time)
        return x

    def _actions(self, s: Any) -> Any:
        """Return s^-1 ... s^m at complex s, each multiplied by the unit of its gain, without the filter."""
        return self.units[:, None] * s ** np.arange(-1.0, self.order + 1)[:, None]

    def _filter(self, x: Array, s: Any) -> tuple[Any, Any]:
        """Return the filter 1/(1 + T_F s)^(m + 1) at complex s, and 1/(1 + T_F s)."""
        _, tf = self.controller(x)
        # Use products, since numpy computes powers of complex arrays by logarithms.
        filtered = lag = 1 / (1 + tf * s)
        for _ in range(self.order):
            filtered = filtered * lag
        return filtered, lag

    def _controller(self, x: Array, s: Any, actions: Any) -> tuple[Any, Any]:
        """Return the controller at complex s, and a function that returns its gradient with respect to the unknowns."""
        filtered, lag = self._filter(x, s)
        by_gains = actions * filtered
        controller = x[: self.gains] @ by_gains
        return controller, lambda: np.vstack([by_gains, (self.order + 1) * (lag - 1) * controller])

    def iae(self, horizon: float, samples: int = SEARCH_SAMPLES) -> Any:
        """Return a function that computes the IAE of a load step and its gradient from the unknowns.

        The IAE is divided by the unit of time of the problem. After the horizon, y is assumed not to be negative.
        """
        s = DAMPING / horizon + 2j * np.pi / horizon * np.arange(samples // 2 + 1)
        step = horizon / samples
        growth = np.exp(DAMPING * np.arange(samples) / samples) / step
        plant, actions = self.process(s), self._actions(s)
        disturbed = plant / s
        both_signs = np.full(s.size, 2.0 / samples)  # each frequency also represents its negative
        both_signs[[0, -1]] *= 0.5

        def value(x: Array) -> tuple[float, Slope]:
            filtered, lag = self._filter(x, s)
            controller = (x[: self.gains] @ actions) * filtered
            sensitivity = 1 / (1 + plant * controller)
            e = disturbed * sensitivity  # this is y = -error, which has the same IAE
            error = np.fft.irfft(e, n=samples) * growth
            ie = 1 / (max(x[0], 1e-12) * self.units[0])
            other, by_error = _other_side(error)
            # The integral of y beyond the horizon should be positive. Penalise a negative integral.
            excess = min(ie - step * float(error.sum()) + REST * ie, 0.0) / (REST * ie)

            def slope() -> Array:
                # A part of the gradient is the integral of weight * (derivatives of y) over time. By Parseval's
                # theorem, this part is also an integral over frequency. So only the weight has to be transformed.
                weight = np.conj(np.fft.rfft((2 * by_error - 2 * excess) * step * growth)) * both_signs
                weighted = -plant * sensitivity * e * weight
                by_time = (self.order + 1) * (((lag - 1) * controller) @ weighted)
                gradient = np.append(actions @ (weighted * filtered), by_time).real
                gradient[0] -= (1 + 2 * excess * (1 + REST) - excess**2 * REST) * ie / max(x[0], 1e-12)
                return gradient / self.time

            return (ie + 2 * step * other + REST * ie * excess**2) / self.time, slope

        return value

    def _characteristic(self) -> None:
        r"""Prepare :math:`f = (s\,a + e^{-sL} b\,s\,C)/(s + \sigma)^{n+1}` for s = jω, for a process b/a of order n.

        L is the dead time. The zeros of f are the poles of the loop, and the poles of f are stable. So from ω = 0 to
        infinity, the angle of f changes by -pi for each unstable pole of the loop.
        """
        process, sigma = self.process, 1 / self.time
        speeds = np.abs(roots(process.den)) * self.time
        slowest = float(np.min(speeds[speeds > 0], initial=1.0))
        around = np.append(0.0, np.geomspace(min(1e-3, max(0.01 * slowest, 1e-8)), 1e3, 600))
        around = with_turns(around, process.delay / self.time, 0.3 * np.arange(1.0, 400.0), end=np.inf)
        self.axis = s = 1j * around / self.time
        scale = (s + sigma) ** -len(process.den)
        self.own = s * np.polyval(process.den, s) * scale
        # f contains s C in place of C, so the powers of s start at 0.
        fed_back = np.polyval(process.num, s) * np.exp(-s * process.delay) * scale
        self.fed_back = fed_back * self.units[:, None] * s ** np.arange(self.order + 2.0)[:, None]

    def unstable(self, x: Array) -> bool:
        """Return True if the loop is unstable, judged from the characteristic function on a grid of frequencies."""
        f = self.own + (x[: self.gains] @ self.fed_back) * self._filter(x, self.axis)[0]
        return abs(turned(np.append(f, self.process.den[0]))) > 0.5 * np.pi

    def slack(self, w: Array, most: dict[str, float], process: Process | None = None) -> Any:
        """Return a function that computes the slack of limits at frequencies w, and its gradient, from the unknowns.

        `most` contains the limits by their names in `PEAKS`. A given `process` replaces the process of the problem.
        With r = (height / limit)^2, the slack is 1/r - 1 for |S|, and (1 - r)/(1 + r) for the other heights.
        """
        s = 1j * w
        plant, actions = (process or self.process)(s), self._actions(s)
        kinds = [(kind, most[name] ** 2) for kind, name in enumerate(PEAKS) if name in most]

        def value(x: Array) -> tuple[Array, Slope]:
            controller, slopes = self._controller(x, s, actions)
            L = plant * controller
            size = np.abs(1 + L) ** 2
            shares = [np.abs(numerator(kind, controller, L)) ** 2 / (limit * size) for kind, limit in kinds]
            slack = [(1 - r) / (1 + r if kind else r) for (kind, _), r in zip(kinds, shares, strict=True)]

            def slope() -> Array:
                by_all, rows = slopes(), []
                for (kind, _), r in zip(kinds, shares, strict=True):
                    factor = -4 * r / (1 + r) ** 2 if kind else -2 / r
                    rows.append(np.real(factor * weights(kind, L)[0] / controller * by_all))
                out = np.zeros((self.size, len(kinds) * w.size))
                out[: self.gains + 1] = np.hstack(rows)
                return out.T

            return np.concatenate(slack), slope

        return value


def _other_side(error: Array) -> tuple[float, Array]:
    """Return the area where a sampled response is negative, for a time step of 1, and the gradient of this area."""
    at = np.flatnonzero((error[:-1] < 0) | (error[1:] < 0))
    a, b = error[at], error[at + 1]
    low, high = np.minimum(a, b), np.maximum(a, b)
    # `share` is the fraction of each step in which the line is below zero.
    share = np.where(high > 0, low / np.where(high > 0, low - high, 1.0), 1.0)
    below = np.minimum(high, 0.0)
    by_low, by_high = -share + 0.5 * share**2, np.where(high > 0, -0.5 * share**2, -0.5)
    slope = np.zeros(error.size)
    slope[at] += np.where(a <= b, by_low, by_high)
    slope[at + 1] += np.where(a <= b, by_high, by_low)
    return float(-0.5 * (low * share + below).sum()), slope


class CachedValueAndSlope:
    """A function with value and slope, which caches the results at its last point."""

    def __init__(self, both: Any) -> None:
        self.both, self.place = both, b""

    def _at(self, x: Array) -> tuple[Any, Any]:
        if x.tobytes() != self.place:  # comparing bytes is faster than comparing arrays
            self.place, self.last = x.tobytes(), self.both(x.copy())
        return self.last

    def value(self, x: Array) -> Any:
        """Return the value at x."""
        return self._at(x)[0]

    def slope(self, x: Array) -> Any:
        """Return the slope at x."""
        return self._at(x)[1]()


class Scaled:
    """Change of variables: the integral gain becomes its logarithm, and scale factors divide the other gains."""

    def __init__(self, start: Array, gains: int) -> None:
        self.unit = np.ones(start.size)
        self.unit[1:gains] = np.clip(start[1:gains], *GAIN_UNITS)

    def __call__(self, x: Array) -> Array:
        """Scale the unknowns."""
        z = x / self.unit
        z[0] = np.log(x[0])
        return z

    def back(self, z: Array) -> Array:
        """Undo the scaling of the unknowns."""
        x = z * self.unit
        x[0] = np.exp(z[0])
        return x

    def slopes(self, x: Array, by_x: Array) -> Array:
        """Convert derivatives with respect to the unknowns to derivatives with respect to the scaled unknowns."""
        by_z = by_x * self.unit
        by_z[..., 0] = by_x[..., 0] * x[0]
        return by_z

    def functions(self, function: CachedValueAndSlope) -> tuple[Any, Any]:
        """Return value and slope of a function, as functions of the scaled unknowns."""

        def slope(z: Array) -> Array:
            x = self.back(z)
            return self.slopes(x, function.slope(x))

        return lambda z: function.value(self.back(z)), slope


# --- noise ------------------------------------------------------------------------------------------------------------


class SampledNoise:
    r"""Square of the noise gain of the sampled loop, and its gradient.

    Parameters
    ----------
    problem : Problem
        Problem that defines the unknowns.
    sample_time : float
        Sample time of controller and noise. The filter time must be at least this time.
    density : int, optional
        Factor of the number of frequencies. With 1, four digits of the result are correct.

    Notes
    -----
    The controller is discretised for held inputs, as in `pidalab.noise_gain`. The filtered terms of the controller and
    their derivatives with respect to the filter time are sums of the lags :math:`1/(1 + T_F s)^i`. Let h be the sample
    time, :math:`\rho = h/T_F` and :math:`a = e^{-\rho}`. The transfer functions :math:`X_i` of these lags after a hold
    satisfy the recursion

    .. math:: (z - a)\, X_i = P(i, \rho) + a \sum_{j<i} \frac{\rho^{i-j}}{(i-j)!} X_j,

    where P is the regularised lower incomplete gamma function. Let G be the sampled plant. For white noise of variance
    1, the variance of u is the mean of :math:`|C/(1 + G C)|^2` over the unit circle (Parseval's theorem).
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
        # Weights of the trapezoidal rule on the upper half of the circle.
        steps = np.diff(self.w)
        self.weight = 0.5 * (np.append(steps, 0.0) + np.append(self.w[0], steps)) * sample_time / np.pi

    def __call__(self, x: Array) -> tuple[float, Slope]:
        """Return the variance at a vector of unknowns, and a function that returns its gradient."""
        controller, controller_slopes = self._controller(x)
        sensitivity = 1 / (1 + self.plant * controller)
        u = controller * sensitivity

        def slope() -> Array:
            gradient, slopes = np.zeros(x.size), controller_slopes()
            by_controller = np.conj(u) * sensitivity**2 * self.weight
            gradient[: slopes.shape[0]] = 2 * np.real(slopes @ by_controller)
            return gradient

        return float(np.abs(u) ** 2 @ self.weight), slope

    def gain(self, x: Array) -> float:
        """Return the noise gain, or infinity if the sampled loop is unstable."""
        return math.inf if self.unstable(x) else math.sqrt(self(x)[0])

    def unstable(self, x: Array) -> bool:
        """Return True if the sampled loop is unstable, by the argument principle for 1 + L.

        The poles of L outside or on the unit circle are first moved inside it.
        """
        f = (1 + self.plant * self._controller(x)[0]) * self.moved
        # The function is real at both ends of the half circle.
        return abs(turned(np.append(f[0].real, f))) > 0.5 * np.pi

    def _expand(self) -> None:
        """Expand the filtered terms, T^k s^k/(1 + T s)^n, and their slopes with respect to log T, as sums of lags.

        With the lag :math:`x = 1/(1 + Ts)`, a filtered term is :math:`(1 - x)^k x^{n-k}`, a polynomial in x.
        """
        n = self.problem.order + 1
        self.actions, self.by_time = np.zeros((n + 1, n + 2)), np.zeros((n + 1, n + 2))
        # Row 0 is (filtered integral) - 1/s, since `_controller` adds 1/s.
        self.actions[0, 1 : n + 1] = -1.0
        self.by_time[0, n + 1] = -n
        for k in range(n):
            for j in range(k + 1):
                self.actions[k + 1, n - k + j] = math.comb(k, j) * (-1) ** j
            for j in range(k + 2):
                self.by_time[k + 1, n - k + j] = -n * math.comb(k + 1, j) * (-1) ** j

    def _controller(self, x: Array) -> tuple[Array, Callable[[], Array]]:
        """Return the sampled controller at the frequencies, and a function that returns its slopes."""
        n, (gains, time) = self.problem.order + 1, self.problem.controller(x)
        powers = time ** np.arange(1.0, -n, -1.0)
        # Real products are faster, so treat each complex number as two real numbers.
        lags = self._lags(time, n + 1).view(float)
        controller = (((gains * powers) @ self.actions) @ lags).view(complex)
        controller += gains[0] * self.integrator

        def slopes() -> Array:
            rows = np.empty((n + 2, lags.shape[1]))
            np.matmul((self.problem.units * powers)[:, None] * self.actions, lags, out=rows[:-1])
            np.matmul((gains * powers) @ self.by_time, lags, out=rows[-1])
            rows = rows.view(complex)
            rows[0] += self.problem.units[0] * self.integrator
            return rows

        return controller, slopes

    def _lags(self, time: float, most: int) -> Array:
        """Return the transfer functions of 0, 1, ..., most equal lags after a hold."""
        from scipy.special import gammainc

        rho = self.h / time
        a = math.exp(-rho)
        inverse = 1 / (self.z - a)
        direct = gammainc(np.arange(1.0, most + 1), rho)
        from_one = [a * rho**k / math.factorial(k) for k in range(most)]
        chain = np.ones((most + 1, self.z.size), dtype=complex)
        for i in range(1, most + 1):
            total = direct[i - 1] + sum(from_one[i - j] * chain[j] for j in range(1, i))
            np.multiply(total, inverse, out=chain[i])
        return chain


def _frequencies(time: float, delay: float, h: float, density: int) -> Array:
    """Return frequencies up to half the sampling frequency, dense enough for the phase of the dead time."""
    top = np.pi / h
    lowest = min(1e-4 / time, 1e-3 / h)
    w = np.append(np.geomspace(lowest, top, 400 * density), np.linspace(0.01 * top, top, 250 * density))
    return np.unique(with_turns(w, delay, 0.3 / density * np.arange(1.0, 200.0 * density)))


# --- unit of time -----------------------------------------------------------------------------------------------------


# The unit of time is 1/w_u. At the frequency w_u, the phase of the process falls to CORNER (in rad). With several
# integrators, w_u is the frequency at which the phase falls to (phase of the integrators) - INTEGRATORS_TURN.
CORNER = -0.75 * math.pi
INTEGRATORS_TURN = 0.25 * math.pi
# A limit on noise determines the unit only if w_u is above NOISE_SLOWDOWN times the result of `_loudest`.
NOISE_SLOWDOWN = 8.0
QUIET_SHARE = 0.1  # for pure integrators, the assumed proportional gain divided by the noise limit


def unit_of_time(process: Process, limits: Requirements) -> float:
    """Return a unit of time in which the gains and times of a robust loop around the process are near 1."""
    poles = roots(process.den)
    integrators = int(np.sum(poles == 0))
    speeds = np.abs(np.concatenate([poles, roots(process.num)]))
    speeds = speeds[speeds > 0]
    corners = np.append(speeds, 1 / process.delay) if process.delay else speeds
    if not corners.size:
        return _by_noise(process, integrators, limits)
    growing = np.max(poles.real, initial=0.0)
    if growing > 0:  # the speed of the loop is between the growth rate and the fastest possible reaction
        return 1 / math.sqrt(growing * float(corners.max()))
    w = np.geomspace(1e-3 * corners.min(), 1e3 * corners.max(), 4000)
    at_rest = -0.5 * np.pi * integrators
    turned = at_rest + turned_phase(process, w) < min(CORNER, at_rest - INTEGRATORS_TURN)
    fastest = float(w[np.argmax(turned)]) if turned.any() else float(corners.max())
    loudest = _loudest(process, limits, w)
    return 1 / (loudest if fastest > NOISE_SLOWDOWN * loudest else fastest)


def _loudest(process: Process, limits: Requirements, w: Array) -> float:
    """Return the highest frequency of `w` at which the limits on noise permit control.

    Control needs |C S| near 1/|P|. If the limits permit control at no frequency, return infinity.
    """
    asked = 1 / np.abs(process(1j * w))
    able = np.ones(w.size, dtype=bool)
    if limits.mks is not None:
        able &= asked <= limits.mks
    if limits.noise_gain is not None and limits.sample_time is not None:
        # The power of sampled white noise is uniform up to the frequency pi / sample_time.
        power = np.cumsum(asked**2 * np.gradient(w)) * limits.sample_time / np.pi
        able &= power <= limits.noise_gain**2
    return float(w[able].max()) if able.any() else math.inf


def _by_noise(process: Process, integrators: int, limits: Requirements) -> float:
    """Return the unit of time for pure integrators, for which only noise limits the speed of a loop."""
    loudest = limits.mks or limits.noise_gain
    if not integrators or loudest is None:
        raise ValueError(
            "process must have a lag or a dead time, or be an integrator with a limit on noise (mks or noise_gain)"
        )
    gain = abs(float(process.num[-1] / process.den[0]))
    return float((gain * QUIET_SHARE * loudest) ** (-1 / integrators))
