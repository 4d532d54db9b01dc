"""The models that rules start from, read off a process: reaction curve, reductions, an integrator with dead time."""

from __future__ import annotations

import math
import warnings
from functools import cached_property

import numpy as np

from pidalab._check import Array
from pidalab.process import Process, fopdt
from pidalab.reduction import to_fopdt, to_sopdt
from pidalab.roots import roots


class StartingModels:
    """Models of one process, each made when a rule asks for it; raises ValueError then if it cannot be made."""

    def __init__(self, process: Process) -> None:
        self.process = process

    @cached_property
    def reaction(self) -> Process:
        """Dead time from the steepest tangent, lag up to 63 % of the step response; an integrator stays one."""
        if not self._settles():
            return self.integrator
        if len(self.process.den) == 2 and len(self.process.num) == 1:
            return self.process
        t, y = self._response(self._undelayed)
        gain, delay = self.process.gain(), self.integrator.delay
        left = y / gain - (1 - math.exp(-1))
        i = int(np.argmax(left >= 0))
        # between the samples along a straight line; a process that jumps may be there at once
        reached = float(np.interp(0.0, left[i - 1 : i + 1], t[i - 1 : i + 1])) if i else 0.0
        return fopdt(gain, reached + self.process.delay - delay, delay)

    @cached_property
    def first_order(self) -> Process:
        # first order or an integrator is its own model
        return self.process if len(self.process.den) == 2 else to_fopdt(self.process).process

    @cached_property
    def second_order(self) -> Process:
        return to_sopdt(self.process).process

    @cached_property
    def third_order(self) -> Process:
        from pidalab.areas import RecordWarning
        from pidalab.identification import three_point

        if not self._settles():
            raise ValueError("process must be stable: three_point reads a step response that settles")
        with warnings.catch_warnings():
            # the process is known, so the measures of the loop with it show what the model loses
            warnings.simplefilter("ignore", RecordWarning)
            return three_point(*self._response(self.process)).process

    @cached_property
    def integrator(self) -> Process:
        from pidalab.identification import ipdt_tangent

        itself = len(self.process.den) == 2 and self.process.den[-1] == 0
        if not itself and np.any(roots(self.process.den).real > 0):
            raise ValueError("process must not be unstable: the integrator is read off its step response")
        if itself:
            return self.process
        # the largest lag hardly matters to the slope at the beginning
        lags = np.sort(_lags(self.process))[: -1 if self._settles() else None]
        tangent = ipdt_tangent(*self._response(self._undelayed, 10 * float(np.sum(lags))))
        return Process(tangent.num, tangent.den, tangent.delay + self.process.delay)

    @cached_property
    def _undelayed(self) -> Process:
        """The process without its dead time, which only shifts what is read off: short lags need a fine grid."""
        return Process(self.process.num, self.process.den)

    @staticmethod
    def _response(process: Process, end: float = 0.0) -> tuple[Array, Array]:
        from pidalab.simulation.exact import open_loop_step

        t = np.linspace(0.0, end or 15 * time_scale(process), 8001)
        return t, open_loop_step(process, t).y

    def _settles(self) -> bool:
        return bool(np.all(roots(self.process.den).real < 0))


def time_scale(process: Process) -> float:
    """Time constants and dead time together."""
    return float(np.sum(_lags(process))) + process.delay or 1.0


def _lags(process: Process) -> Array:
    """Time constants of the poles, in any order; an integrator has none."""
    poles = np.abs(roots(process.den).real)
    return 1 / poles[poles > 0]
