"""The models that the rules start from, taken apart and checked."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pidalab.process import Process, require_process
from pidalab.roots import roots


class SecondOrder(NamedTuple):
    """Parameters of a second-order model with dead time inside the range of a rule."""

    gain: float
    tau: float
    damping: float
    delay: float

    @property
    def ratio(self) -> float:
        return round(self.delay / self.tau, 12)  # so that 0.3/3 is 0.1, and on its side of a break point


def lags(model: Process, order: int) -> tuple[float, list[float]]:
    """Return the gain and a_order, …, a_1 of gain/(a_order s^order + … + a_1 s + 1), stable, or raise."""
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
    """Raise for a model without dead time."""
    if model.delay == 0:
        raise ValueError(f"model must have a dead time above 0: this rule divides by it; found {model!r}")


def lag_with_delay(model: Process) -> tuple[float, float, float]:
    """Return gain, lag and dead time of a first-order model with dead time, or raise."""
    gain, (lag,) = lags(model, 1)
    require_delay(model)
    return gain, lag, model.delay


def second_order(model: Process) -> SecondOrder:
    """Return the parameters of a second-order model inside the range of the rule, or raise."""
    gain, (a2, a1) = lags(model, 2)
    tau = math.sqrt(a2)
    damping = round(a1 / (2 * tau), 12)
    if not 0.3 <= damping <= 2:
        raise ValueError(f"damping of the model must be from 0.3 to 2, found {damping:.6g}")
    result = SecondOrder(gain, tau, damping, model.delay)
    if not 0.1 <= result.ratio <= 2:
        raise ValueError(
            f"dead time / time constant of the model must be from 0.1 to 2, found {result.ratio:.6g}"
        )
    return result


def integrator(model: Process) -> tuple[float, float]:
    """Return velocity gain and dead time of an integrator, or raise."""
    require_process("model", model)
    if len(model.num) != 1 or len(model.den) != 2 or model.den[1] != 0 or model.num[0] == 0:
        raise ValueError(f"model must be an integrator with dead time (pidalab.ipdt), found {model!r}")
    return float(model.num[0] / model.den[0]), model.delay
