"""Make designs that are safe in the loop that will run, with the model and with all plants of its spread."""

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

PRICE_LIMIT = 3.0  # price of robustness in IAE that is refused
# relative distances below and above a limit, for a design that meets or keeps it
MET, STILL_KEPT = 1e-3, 1e-6
MOST_CORRECTIONS = 20  # largest number of corrections of the requested Ms
LEAST_FACTOR, LARGEST_FACTOR = 0.5, 2.0  # factors of Ms - 1 in one correction

# Returns a design that keeps requirements, found near another one, and the names of its active limits.
Designer = Callable[[Requirements, Design | None], tuple[Design, Sequence[str]]]


class LoopMs(NamedTuple):
    """Maximum sensitivity of a loop, infinite if unstable.

    `reason` says why it is that of the continuous loop, if the sampled one has none.
    """

    ms: float
    reason: str = ""


class LoopEvaluator:
    """Evaluates designs in the loop that will run.

    Parameters
    ----------
    sample_time : float or None
        Sample time of backward differences; None for the continuous controller.
    output_filter : control.TransferFunction or None
        Filter in series with the controller.
    """

    def __init__(self, sample_time: float | None, output_filter: Any = None) -> None:
        self.sample_time, self.output_filter = sample_time, output_filter
        # Ms with a design and a plant, computed once for each pair
        self.ms = cache(self._ms)

    def loop(self, design: Design, plant: Process) -> Loop:
        """Close the continuous loop."""
        filters = in_series(design.output_filter, self.output_filter)
        return Loop(plant, design.controller, filters, design.prefilter)

    def _ms(self, design: Design, plant: Process) -> LoopMs:
        """Return Ms with a plant, or that of the continuous loop with the reason if the sampled one has none."""
        loop, reason = self.loop(design, plant), ""
        if self.sample_time is not None:
            try:
                sampled = design.controller.discretise(self.sample_time, "backward", loop.output_filter)
                return LoopMs(ms_or_infinite(Loop(plant, sampled)))
            except (ValueError, ArithmeticError) as refusal:
                reason = f"Ms is that of the continuous loop: {refusal}"
        return LoopMs(ms_or_infinite(loop), reason)

    def worst(self, design: Design, plants: Sequence[Process]) -> LoopMs:
        """Return the largest Ms over plants, 0 without any, and the alphabetically first reason."""
        loops = [self.ms(design, plant) for plant in plants]
        reasons = sorted({loop.reason for loop in loops if loop.reason})
        return LoopMs(max((loop.ms for loop in loops), default=0.0), reasons[0] if reasons else "")


def in_series(first: Any, second: Any) -> Any:
    """Return the series of two filters; None is no filter."""
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
    """Correct the request to the designer until the loop that runs meets the limits, to 0.1 % and from below.

    Parameters
    ----------
    make : callable
        Makes a design for requirements.
    sizes : callable
        Measures Ms of a design with the model, and the worst Ms over the family.
    limits : Requirements
        Limits of the loop that runs.
    start : Design, optional
        Start of the search.

    Returns
    -------
    Design
        If none meets the limits, the last one that keeps them.

    Raises
    ------
    ValueError
        If none keeps the limits.

    Notes
    -----
    A limit that the loop exceeds, or that is active and not met, changes the request: Ms - 1 is scaled by the ratio of
    limit and result, at most by 2 either way. The iteration ends when the request no longer changes.
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
            f"last one has {ms:.3g} and {worst:.3g}"
        )
    return kept


def _next(request: float, result: float, limit: float, active: bool) -> float:
    """Return the next request: the same if the limit is met, or if it is kept and not active."""
    if result <= limit * (1 + STILL_KEPT) and not (active and result < limit * (1 - MET)):
        return request
    factor = (limit * (1 - 0.5 * MET) - 1) / (result - 1)
    return 1 + (request - 1) * min(max(factor, LEAST_FACTOR), LARGEST_FACTOR)


def refusal(limits: Requirements, remedy: str, worst: float, more: str = "") -> ValueError:
    """Return the error for a family without a safe design."""
    result = f"worst Ms {worst:.3g}" if math.isfinite(worst) else "an unstable loop"
    return ValueError(
        f"the model is too uncertain for this controller: a plant of its spread gives {result}, where "
        f"ms_worst = {limits.ms_worst:g} is allowed{more}; {remedy}"
    )


def make_safe(
    make: Designer, evaluator: LoopEvaluator, process: Process, limits: Requirements, remedy: str
) -> tuple[Design, float]:
    """Return a design that is safe with all plants of the family, and its price.

    The price is its IAE over that of the design for the process alone. If there is no such design, or its price is
    above 3, the error contains the remedy.
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
