"""Check that a model has the structure that a rule needs, and derive such models from a process."""

from __future__ import annotations

import math
import warnings
from functools import cached_property
from typing import NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.process import Process, fopdt, require_process
from pidalab.reduction import to_fopdt, to_sopdt
from pidalab.roots import roots


class SecondOrder(NamedTuple):
    """Parameters of a second-order model with dead time, within the range of a rule."""

    gain: float
    tau: float
    damping: float
    delay: float

    @property
    def ratio(self) -> float:
        return round(self.delay / self.tau, 12)  # without rounding, 0.3/3 would be below 0.1


def lags(model: Process, order: int) -> tuple[float, list[float]]:
    """Return gain and [a_order, …, a_1] of the stable model gain/(a_order s^order + … + a_1 s + 1), or raise."""
    require_process("model", model)
    fits = len(model.num) == 1 and len(model.den) == order + 1 and model.num[0] != 0
    if not fits or np.any(roots(model.den).real >= 0):
        poles = {1: "one stable pole (pidalab.fopdt)", 2: "two stable poles (pidalab.sopdt)"}
        raise ValueError(
            f"model must have a constant numerator (not 0) and {poles.get(order, f'{order} stable poles')}, "
            f"found {model!r}; reduce or fit a model of that order first, see pidalab.reduction"
        )
    return float(model.num[0] / model.den[-1]), (model.den[:-1] / model.den[-1]).tolist()


def require_delay(model: Process) -> None:
    """Raise if the model has no dead time."""
    if model.delay == 0:
        raise ValueError(f"model must have a dead time above 0: this rule divides by it; found {model!r}")


def lag_with_delay(model: Process) -> tuple[float, float, float]:
    """Return gain, lag and dead time of a first-order model with dead time, or raise."""
    gain, (lag,) = lags(model, 1)
    require_delay(model)
    return gain, lag, model.delay


def second_order(model: Process) -> SecondOrder:
    """Return the parameters of a second-order model, or raise if it is outside the range of `itae`."""
    gain, (a2, a1) = lags(model, 2)
    tau = math.sqrt(a2)
    damping = round(a1 / (2 * tau), 12)
    if not 0.3 <= damping <= 2:
        raise ValueError(f"damping of the model must be from 0.3 to 2, found {damping:.6g}")
    result = SecondOrder(gain, tau, damping, model.delay)
    if not 0.1 <= result.ratio <= 2:
        raise ValueError(f"delay/tau of the model must be from 0.1 to 2, found {result.ratio:.6g}")
    return result


def integrator(model: Process) -> tuple[float, float]:
    """Return velocity gain and dead time of an integrator, or raise."""
    require_process("model", model)
    if len(model.num) != 1 or len(model.den) != 2 or model.den[1] != 0 or model.num[0] == 0:
        raise ValueError(f"model must be an integrator with dead time (pidalab.ipdt), found {model!r}")
    return float(model.num[0] / model.den[0]), model.delay


class StartingModels:
    """Models of one process, each computed on first use. If a model does not exist, a ValueError says why."""

    def __init__(self, process: Process) -> None:
        self.process = process

    @cached_property
    def reaction(self) -> Process:
        """Lag with dead time, from the steepest tangent of the step response and the time at 63 % of the final value.

        If the process has an integrator, this model is `integrator`.
        """
        if not self._settles():
            return self.integrator
        if len(self.process.den) == 2 and len(self.process.num) == 1:
            return self.process
        t, y = self._response(self._undelayed)
        gain, delay = self.process.gain(), self.integrator.delay
        excess = y / gain - (1 - math.exp(-1))
        i = int(np.argmax(excess >= 0))
        # Interpolate between samples. A process with a jump may exceed 63 % in the first sample.
        reached = float(np.interp(0.0, excess[i - 1 : i + 1], t[i - 1 : i + 1])) if i else 0.0
        return fopdt(gain, reached + self.process.delay - delay, delay)

    @cached_property
    def first_order(self) -> Process:
        return self.process if len(self.process.den) == 2 else to_fopdt(self.process).process

    @cached_property
    def second_order(self) -> Process:
        return to_sopdt(self.process).process

    @cached_property
    def third_order(self) -> Process:
        from pidalab.areas import RecordWarning
        from pidalab.identification import three_point

        if not self._settles():
            raise ValueError("process must be stable: three_point needs a step response that settles")
        with warnings.catch_warnings():
            # Ignore the warning that a model does not match its record, since comparisons simulate the process itself.
            warnings.simplefilter("ignore", RecordWarning)
            return three_point(*self._response(self.process)).process

    @cached_property
    def integrator(self) -> Process:
        from pidalab.identification import ipdt_tangent

        itself = len(self.process.den) == 2 and self.process.den[-1] == 0
        if not itself and np.any(roots(self.process.den).real > 0):
            raise ValueError("process must be stable or integrating: the model comes from its step response")
        if itself:
            return self.process
        # The response is steepest at a time that depends mainly on the smaller lags. Therefore the simulated time does
        # not depend on the largest lag (or on the integrator).
        lags = np.sort(_lags(self.process))[: -1 if self._settles() else None]
        tangent = ipdt_tangent(*self._response(self._undelayed, 10 * float(np.sum(lags))))
        return Process(tangent.num, tangent.den, tangent.delay + self.process.delay)

    @cached_property
    def _undelayed(self) -> Process:
        """The process without its dead time, which would only shift the response and make the time grid coarser."""
        return Process(self.process.num, self.process.den)

    @staticmethod
    def _response(process: Process, end: float = 0.0) -> tuple[Array, Array]:
        from pidalab.simulation.exact import open_loop_step

        t = np.linspace(0.0, end or 15 * time_scale(process), 8001)
        return t, open_loop_step(process, t).y

    def _settles(self) -> bool:
        return bool(np.all(roots(self.process.den).real < 0))


def time_scale(process: Process) -> float:
    """Return the sum of time constants and dead time, or 1 if this sum is 0."""
    return float(np.sum(_lags(process))) + process.delay or 1.0


def _lags(process: Process) -> Array:
    """Return the time constants of the poles, without integrators."""
    poles = np.abs(roots(process.den).real)
    return 1 / poles[poles > 0]
