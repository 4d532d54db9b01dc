r"""Reduce any stable process to a model of first or second order with dead time (heo2023).

Both reductions keep the static gain. They also keep the phase at the ultimate frequency :math:`\omega_u`, which is the
frequency at which the phase of :math:`G(j\omega)/G(0)` first falls below :math:`-\pi`. The paper names its source for
the reduction but does not describe the method. The method used here reproduces all 24 parameters of Tables 4 to 6. The
second-order fit uses ten frequencies with equal weights. With other weights, or with 9 or 11 frequencies, the
second-order models differ from the tables in the third decimal.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from pidalab import _check
from pidalab._check import Array
from pidalab.loop import Loop
from pidalab.process import Process, fopdt, require_process, sopdt
from pidalab.robustness.in_z import axis_of
from pidalab.roots import roots

LEAST_LAG = 1e-9  # smaller values of tau wu (first order) or (tau wu)^4 (second order) are rounding errors


class FirstOrderModel(NamedTuple):
    """Parameters of a first-order model with dead time, and the ultimate frequency `wu` in rad per time unit."""

    gain: float
    tau: float
    delay: float
    wu: float

    @property
    def process(self) -> Process:
        """The model as a process."""
        return fopdt(self.gain, self.tau, self.delay)


class SecondOrderModel(NamedTuple):
    """Parameters of a second-order model with dead time, and the ultimate frequency `wu` in rad per time unit."""

    gain: float
    tau: float
    damping: float
    delay: float
    wu: float

    @property
    def process(self) -> Process:
        """The model as a process."""
        return sopdt(self.gain, self.tau, self.damping, self.delay)


def ultimate_frequency(process: Process) -> float:
    r"""Compute the lowest frequency at which the phase of :math:`G(j\omega)/G(0)` falls below :math:`-\pi`.

    If the process has an integrator, :math:`G(0)` is the static gain without the integrator, and the phase starts at
    :math:`-\pi/2`.

    Parameters
    ----------
    process : Process
        Process that is stable or has one integrator. Its static gain must not be 0. There must be no zero on the
        imaginary axis below the ultimate frequency, because the phase jumps at such a zero.

    Returns
    -------
    float
        Frequency in rad per time unit.

    Raises
    ------
    TypeError, ValueError
        If `process` is not a `Process`, is unstable, or has more than one integrator, a static gain of 0 or no ultimate
        frequency. A process without dead time has an ultimate frequency if its lags and zeros turn the phase by more
        than 180°, as three lags do.

    Examples
    --------
    >>> import math, pidalab
    >>> print(f"{pidalab.reduction.ultimate_frequency(pidalab.lags(5)):.6f} {math.tan(math.pi / 5):.6f}")
    0.726543 0.726543
    """
    require_process("process", process)
    # An integrator shifts the phase by -pi/2 at all frequencies. The remaining process has a static gain.
    settling = np.trim_zeros(process.den, "b")
    integrators = process.den.size - settling.size
    if integrators > 1:
        raise ValueError(f"process must have at most one integrator, found {integrators} in {process!r}")
    turned = 0.5 * np.pi * integrators
    unit = _unit(Process(process.num, settling, process.delay))
    zeros = roots(unit.num)

    axis = axis_of(Loop(unit, 1.0))

    def phase(w: Array) -> Array:
        w = np.atleast_1d(w)
        # `turned_phase`, a sum over all roots, gives the number of full turns. The more accurate angle gives the rest.
        exact = np.angle(axis.L(w))
        return exact + 2 * np.pi * np.round((turned_phase(unit, w) - exact) / (2 * np.pi)) - turned

    on_axis = np.abs(zeros[np.abs(zeros.real) <= 1e-9 * np.abs(zeros)])
    w = axis.follow(0.1)
    w = w[w < on_axis.min(initial=math.inf)]
    past = np.flatnonzero(phase(w) < -np.pi)
    if not past.size or past[0] == 0:
        reason = f"the phase jumps at the zero at {on_axis.min():.6g}j" if on_axis.size else "it never does"
        raise ValueError(f"process must have a phase that falls below -pi: {reason}; found {process!r}")
    low, high = w[past[0] - 1], w[past[0]]
    return float(brentq(lambda x: phase(x)[0] + np.pi, low, high, xtol=1e-14 * low, rtol=1e-14))


def turned_phase(process: Process, w: Array) -> Array:
    """Compute the continuous phase, relative to the phase at frequency 0.

    Poles and zeros on the imaginary axis are treated as if they were in the left half-plane.

    Parameters
    ----------
    process : Process
        Any process. Poles and zeros at 0 are ignored.
    w : ndarray, shape (n,)
        Frequencies in rad per time unit.

    Returns
    -------
    ndarray, shape (n,)
        Phase in rad.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> pidalab.reduction.turned_phase(pidalab.lags(3, delay=1.0), np.array([0.0, 1.0])).round(4).tolist()
    [0.0, -3.3562]
    """
    total = -process.delay * w
    for sign, factors in ((1, roots(process.num)), (-1, roots(process.den))):
        away = factors[factors != 0]
        away = np.where(away.real == 0, away - 1e-9 * np.abs(away), away)
        # Each factor stays in one half-plane, so its angle is continuous.
        total = total + sign * np.angle(1 - 1j * w[:, None] / away).sum(axis=1)
    return np.asarray(total)


def to_fopdt(process: Process) -> FirstOrderModel:
    r"""Find the first-order model with dead time that equals a process at frequency 0 and at the ultimate frequency.

    The parameters follow from the ultimate frequency :math:`\omega_u` and :math:`m = |G(j\omega_u)/G(0)|`:

    .. math:: \tau = \frac{\sqrt{1/m^2 - 1}}{\omega_u}, \qquad
              \theta = \frac{\pi - \arctan(\tau \omega_u)}{\omega_u}.

    ============  ==================
    heo2023       here
    ============  ==================
    τ             `tau`
    θ             `delay`
    ============  ==================

    Parameters
    ----------
    process : Process
        Stable process of any order, with any dead time and any static gain except 0.

    Returns
    -------
    FirstOrderModel
        Parameters of the model. The attribute ``process`` gives the model as a `Process`.

    Raises
    ------
    TypeError, ValueError
        As for `ultimate_frequency`. Also if the process is integrating, or if its magnitude at the ultimate frequency
        is not below the magnitude of its static gain.

    References
    ----------
    heo2023, Tables 4, 5 and 6, rows IMC.

    Examples
    --------
    >>> import pidalab
    >>> model = pidalab.reduction.to_fopdt(pidalab.lags(3, delay=0.2))
    >>> print(f"tau = {model.tau:.3f}, delay = {model.delay:.3f}")
    tau = 3.589, delay = 1.254
    """
    wu = ultimate_frequency(process)
    magnitude = float(abs(_unit(process)(1j * wu)))
    x = math.sqrt(max(1 / magnitude**2 - 1, 0.0))
    if x <= LEAST_LAG:
        raise ValueError(
            "process has no first-order model: |G(j wu)/G(0)| must be below 1, "
            f"found {magnitude:.6g} at wu = {wu:.6g}"
        )
    return FirstOrderModel(process.gain(), x / wu, (math.pi - math.atan(x)) / wu, wu)


def to_sopdt(process: Process, points: int = 10) -> SecondOrderModel:
    r"""Reduce a process to a second-order model with dead time, by least squares up to the ultimate frequency.

    The function :math:`g(\omega) = |G(j\omega)/G(0)|^2` is computed at equally spaced frequencies from 0 to
    :math:`\omega_u` (both included). The numbers :math:`a` and :math:`b` solve the first equation below at these
    frequencies by least squares. The other two equations then give the time constant τ and the damping ζ:

    .. math:: g(\omega)\,(1 + a\,\omega^2 + b\,\omega^4) = 1, \qquad
              b = \tau^4, \quad a = 4\tau^2\zeta^2 - 2\tau^2.

    The dead time is chosen so that the model has the phase :math:`-\pi` at :math:`\omega_u`. The dead time is never
    negative, because a second-order lag turns the phase by at most :math:`\pi`. A process that is already a
    second-order model with dead time is returned unchanged, for any damping.

    ============  ==================
    heo2023       here
    ============  ==================
    τ             `tau`
    ξ             `damping`
    θ             `delay`
    ============  ==================

    Parameters
    ----------
    process : Process
        Stable process of any order, with any dead time and any static gain except 0.
    points : int, optional
        Number of frequencies, at least 3. The default 10 gives the models of the paper.

    Returns
    -------
    SecondOrderModel
        Parameters of the model. The attribute ``process`` gives the model as a `Process`.

    Raises
    ------
    TypeError, ValueError
        As for `ultimate_frequency`. Also if the process is integrating, there are fewer than 3 points, or the fit gives
        no real time constant or damping.

    References
    ----------
    heo2023, Tables 4, 5 and 6, rows ITAE-2 and Proposed.

    Examples
    --------
    >>> import pidalab
    >>> model = pidalab.reduction.to_sopdt(pidalab.lags(3, delay=0.2))
    >>> print(f"tau = {model.tau:.3f}, damping = {model.damping:.3f}, delay = {model.delay:.3f}")
    tau = 1.490, damping = 0.876, delay = 0.585
    """
    points = _check.integer("points", points, at_least=3, at_most=1_000_000)
    wu = ultimate_frequency(process)
    x = np.linspace(0.0, 1.0, points)
    g = np.abs(_unit(process)(1j * wu * x)) ** 2
    a, b = (float(c) for c in np.linalg.lstsq(np.column_stack([g * x**2, g * x**4]), 1 - g, rcond=None)[0])
    if b <= LEAST_LAG * max(1.0, a):
        raise ValueError(
            f"process has no second-order model: (tau wu)^4 must be above 0, found {b:.4g}; try to_fopdt"
        )
    square = (a + 2 * math.sqrt(b)) / (4 * math.sqrt(b))
    if square < 0:
        raise ValueError(
            f"process has no second-order model: damping^2 must be at least 0, found {square:.4g}"
        )
    tau, damping = b**0.25, math.sqrt(square)
    lag = math.atan2(2 * damping * tau, 1 - tau**2)  # phase lag at wu
    return SecondOrderModel(process.gain(), tau / wu, damping, (math.pi - lag) / wu, wu)


def _unit(process: Process) -> Process:
    """Divide a process by its static gain. Raise if the process is not stable or has no static gain."""
    require_process("process", process)
    poles = roots(process.den)
    if np.any(poles.real >= 0):
        kind = "integrating" if np.any(poles == 0) else "unstable"
        raise ValueError(f"process must be stable, found an {kind} one: {process!r}")
    if process.gain() == 0:
        raise ValueError(f"process must have a static gain other than 0, found {process!r}")
    return Process(process.num / process.gain(), process.den, process.delay)
