"""Why there is no design: nothing stabilises the process, or nothing keeps the limits, and what came nearest."""

from __future__ import annotations

from pidalab._check import Array
from pidalab.optimal._problem import Problem
from pidalab.optimal._solver import Limits, Search
from pidalab.optimal._starts import stabilising
from pidalab.robustness.control import max_control_sensitivity
from pidalab.robustness.margins import max_sensitivity


def refusal(seen: list[Search], highest: int) -> str:
    """Say what prevents a design, from searches in several units of time none of which came to a design."""
    first = seen[0]
    order, limits = first.problem.order, first.limits
    wanted = ", ".join(f"{name} <= {value:g}" for name, value in limits.named().items())
    near = [(one.missed(one.nearest), _measured(one, one.nearest)) for one in seen if one.nearest is not None]
    if near:
        return (
            f"no stable controller of order {order} with non-negative gains was found that keeps {wanted}; the nearest "
            f"has {min(near)[1]}: allow more, or take another order"
        )
    others = [other for other in range(order + 1, highest + 1) if _some(first.problem, other)]
    hint = f"; order {others[0]} has some" if others else ""
    return (
        f"no stable controller of order {order} with non-negative gains was found, whatever its ms ({wanted} was asked "
        f"for){hint}"
    )


def _measured(one: Search, x: Array) -> str:
    """What the nearest controller makes of the quantities that are limited."""
    loop = one.loop(x)
    values = {
        "ms": lambda: max_sensitivity(loop)[0],
        "mks": lambda: max_control_sensitivity(loop)[0],
        "noise_gain": lambda: one.true_noise(x),
    }
    return ", ".join(f"{name} = {values[name]():.4g}" for name in one.limits.named())


def _some(problem: Problem, order: int) -> bool:
    """Whether a candidate of another order stabilises the process."""
    other = Problem(problem.process, order, (problem.gain, problem.time))
    return next(stabilising(Search(other, Limits(2.0, None, None, None))), None) is not None
