"""Make designs that are safe in the real loop, with the model and with other plants within its uncertainty.

The *real loop* is the loop with the sample time and the output filter with which the controller will run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from pidalab.loop import Loop
from pidalab.process import Process, rational
from pidalab.requirements import Requirements
from pidalab.robustness.margins import ms_or_infinite
from pidalab.rules import Design
from pidalab.simulation.exact import load_iae

PRICE_LIMIT = 3.0  # largest accepted price of robustness, as defined at `make_safe`
MET = 1e-3  # an active limit is met if result >= limit * (1 - MET)
STILL_KEPT = 1e-6  # a limit is kept if result <= limit * (1 + STILL_KEPT)
MOST_CORRECTIONS = 20  # largest number of corrections of the requested Ms
LEAST_FACTOR, LARGEST_FACTOR = 0.5, 2.0  # least and largest factor of (requested Ms - 1) in one correction

# A designer is called with requirements, and with a design from which to start the search, or None. It returns a design
# that keeps the requirements, and the names of the active limits.
Designer = Callable[[Requirements, Design | None], tuple[Design, Sequence[str]]]


class LoopMs(NamedTuple):
    """Maximum sensitivity Ms of a loop, which is infinite if the loop is unstable.

    If Ms of a sampled loop cannot be computed, `ms` is the Ms of the continuous loop, and `reason` says why.
    """

    ms: float
    reason: str = ""


class LoopEvaluator:
    """Evaluate designs in the real loop.

    Parameters
    ----------
    sample_time : float or None
        Sample time of the controller, which is discretised by backward differences. None for a continuous controller.
    output_filter : control.TransferFunction or None
        Filter in series with the controller.
    """

    def __init__(self, sample_time: float | None, output_filter: Any = None) -> None:
        self.sample_time, self.output_filter = sample_time, output_filter
        self.ms = cache(self._ms)

    def loop(self, design: Design, plant: Process) -> Loop:
        """Return the continuous loop of a design and a plant."""
        filters = in_series(design.output_filter, self.output_filter)
        return Loop(plant, design.controller, filters, design.prefilter)

    def _ms(self, design: Design, plant: Process) -> LoopMs:
        loop, reason = self.loop(design, plant), ""
        if self.sample_time is not None:
            try:
                sampled = design.controller.discretise(self.sample_time, "backward", loop.output_filter)
                return LoopMs(ms_or_infinite(Loop(plant, sampled)))
            except (ValueError, ArithmeticError) as refusal:
                reason = f"Ms is that of the continuous loop: {refusal}"
        return LoopMs(ms_or_infinite(loop), reason)

    def worst(self, design: Design, plants: Sequence[Process]) -> LoopMs:
        """Return the largest Ms with any of the plants, or 0 if there are no plants."""
        # Of several reasons, keep the first in alphabetical order.
        loops = [self.ms(design, plant) for plant in plants]
        reasons = sorted({loop.reason for loop in loops if loop.reason})
        return LoopMs(max((loop.ms for loop in loops), default=0.0), reasons[0] if reasons else "")


def in_series(first: Any, second: Any) -> Any:
    """Return two filters in series. None stands for no filter."""
    if first is None or second is None:
        return second if first is None else first
    import control

    (a, b), (c, d) = rational("output_filter", first), rational("output_filter", second)
    return control.TransferFunction(np.convolve(a, c), np.convolve(b, d))


def correct_request(
    make: Designer,
    sizes: Callable[[Design], tuple[float, float]],
    limits: Requirements,
    start: Design | None = None,
) -> Design:
    """Correct the requested Ms until the real loop meets the limits to 0.1 % without exceeding them.

    Parameters
    ----------
    make : callable
        Function that makes a design for given requirements (see `Designer`).
    sizes : callable
        Function that returns two numbers for a design: Ms with the model, and the largest Ms with the other plants.
    limits : Requirements
        Limits of the real loop.
    start : Design, optional
        Design from which the search starts.

    Returns
    -------
    Design
        A design that keeps all limits and meets the active limits. If no such design is found, the last design that
        keeps all limits.

    Raises
    ------
    ValueError
        If no design keeps the limits.

    Notes
    -----
    The request is corrected if the real loop exceeds a limit, or if an active limit is not met. A correction multiplies
    (requested Ms - 1) by (limit - 1)/(result - 1), clipped to the range 0.5 to 2.
    """
    request, kept, design = limits, None, start
    for _ in range(MOST_CORRECTIONS):
        design, active = make(request, design)
        ms, worst = sizes(design)
        if ms <= limits.ms * (1 + STILL_KEPT) and worst <= limits.ms_worst * (1 + STILL_KEPT):
            kept = design
        new_ms = _next(request.ms, ms, limits.ms, "ms" in active)
        new_worst = _next(request.ms_worst, worst, limits.ms_worst, "ms_worst" in active)
        if (new_ms, new_worst) == (request.ms, request.ms_worst):
            return design
        request = replace(request, ms=new_ms, ms_worst=new_worst)
    if kept is None:
        raise ValueError(
            f"no controller was found whose loop keeps ms <= {limits.ms:g} and ms_worst <= {limits.ms_worst:g}: the "
            f"last controller has ms = {ms:.3g} and ms_worst = {worst:.3g}"
        )
    return kept


def _next(request: float, result: float, limit: float, active: bool) -> float:
    """Return the next requested Ms, as described in the Notes of `correct_request`."""
    if result <= limit * (1 + STILL_KEPT) and not (active and result < limit * (1 - MET)):
        return request
    factor = (limit * (1 - 0.5 * MET) - 1) / (result - 1)
    return 1 + (request - 1) * min(max(factor, LEAST_FACTOR), LARGEST_FACTOR)


def refusal(limits: Requirements, remedy: str, worst: float, more: str = "") -> ValueError:
    """Return the error for a model that is too uncertain."""
    result = f"an Ms of {worst:.3g}" if math.isfinite(worst) else "an unstable loop"
    return ValueError(
        f"the model is too uncertain for this controller: a plant within the uncertainty of the model gives {result}, "
        f"but at most ms_worst = {limits.ms_worst:g} is allowed{more}; {remedy}"
    )


def make_safe(
    make: Designer, evaluator: LoopEvaluator, process: Process, limits: Requirements, remedy: str
) -> tuple[Design, float]:
    """Return a design that is safe with all plants of `limits.family`, and its price.

    The price is the IAE of the safe design, divided by the IAE of the design for the process alone. If there is no safe
    design, or if the price is above 3, an error is raised that suggests the remedy.
    """

    def sizes(design: Design) -> tuple[float, float]:
        return evaluator.ms(design, process).ms, evaluator.worst(design, limits.family).ms

    alone = replace(limits, family=())
    plain = correct_request(make, lambda design: (evaluator.ms(design, process).ms, 0.0), alone)
    worst = evaluator.worst(plain, limits.family).ms
    if worst <= limits.ms_worst * (1 + STILL_KEPT):
        return plain, 1.0
    try:
        safe = correct_request(make, sizes, limits, plain)
    except ValueError as failed:
        raise refusal(limits, remedy, worst, f" ({failed})") from None
    price = load_iae(evaluator.loop(safe, process)) / load_iae(evaluator.loop(plain, process))
    if price > PRICE_LIMIT:
        raise refusal(limits, remedy, worst, f", and a safe design has {price:.1f} times the IAE")
    return safe, price
