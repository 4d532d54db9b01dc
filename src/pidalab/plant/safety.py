"""Designs that are safe in the loop that will run, with the model and with all plants of its spread."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from pidalab.loop import Loop
from pidalab.process import Process, rational
from pidalab.requirements import Requirements
from pidalab.rules import Design
from pidalab.simulation.exact import load_iae

TOO_DEAR = 3.0  # price of robustness in IAE that is refused
MET, STILL_KEPT = 1e-3, 1e-6  # shares of a limit: below it what meets it, and above it what still keeps it
MOST_CORRECTIONS = 20  # of what is asked for
LEAST_FACTOR, LARGEST_FACTOR = 0.5, 2.0  # of Ms less 1, in a correction

# Return a design that keeps requirements, found near another one, and the names of the limits that hold it back.
Designer = Callable[[Requirements, Design | None], tuple[Design, Sequence[str]]]


class LoopMs(NamedTuple):
    """Maximum sensitivity of a loop.

    Attributes
    ----------
    ms : float
        Infinite for an unstable loop.
    reason : str
        Why it is that of the continuous loop, where the sampled one has none; else empty.
    """

    ms: float
    reason: str = ""


@dataclass(frozen=True)
class LoopEvaluator:
    """Judges designs in the loop that will run.

    Parameters
    ----------
    sample_time : float or None
        Of backward differences; None for the continuous controller.
    output_filter : control.TransferFunction or None
        In series with the controller.
    """

    sample_time: float | None
    output_filter: Any
    _known: dict[tuple[int, int], tuple[LoopMs, Any]] = field(default_factory=dict, repr=False)

    def loop(self, design: Design, plant: Process) -> Loop:
        """Close the continuous loop."""
        return Loop(
            plant, design.controller, in_series(design.output_filter, self.output_filter), design.prefilter
        )

    def ms(self, design: Design, plant: Process) -> LoopMs:
        """Return Ms with a plant; that of the continuous loop where the sampled one has none, with the reason."""
        key = id(design), id(plant)
        if key not in self._known:  # kept with both, whose numbers are then not given again
            self._known[key] = self._ms(design, plant), (design, plant)
        return self._known[key][0]

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
        """Return the largest Ms over plants, in whatever order, 0 without any; and the first reason by the alphabet."""
        found = [self.ms(design, plant) for plant in plants]
        reasons = sorted({one.reason for one in found if one.reason})
        return LoopMs(max((one.ms for one in found), default=0.0), reasons[0] if reasons else "")


def ms_or_infinite(loop: Loop) -> float:
    """Return the maximum sensitivity, infinite for an unstable loop."""
    from pidalab.robustness.margins import max_sensitivity
    from pidalab.robustness.poles import is_stable

    return max_sensitivity(loop)[0] if is_stable(loop) else math.inf


def in_series(first: Any, second: Any) -> Any:
    """Return both filters as one, None for none."""
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
    """Correct the requirements of a design until the loop that runs keeps the given ones, to 0.1 % and from below.

    Parameters
    ----------
    make : callable
        Makes a design for requirements.
    sizes : callable
        Measures Ms of a design with the model, and the worst Ms over the family.
    limits : Requirements
        What the loop has to keep.
    start : Design, optional
        To begin near.

    Returns
    -------
    Design
        The last one that keeps the limits, where none meets them.

    Raises
    ------
    ValueError
        If none keeps the limits.
    """
    asked, kept, made = limits, None, start
    for _ in range(MOST_CORRECTIONS):
        made, active = make(asked, made)
        ms, worst = sizes(made)
        if ms <= limits.ms * (1 + STILL_KEPT) and worst <= limits.ms_worst * (1 + STILL_KEPT):
            kept = made
        before = asked
        asked = replace(
            asked,
            ms=_next(asked.ms, ms, limits.ms, "ms" in active),
            ms_worst=_next(asked.ms_worst, worst, limits.ms_worst, "ms_worst" in active),
        )
        if asked == before:
            return made
    if kept is None:
        raise ValueError(
            f"no controller was found whose loop keeps ms <= {limits.ms:g} and ms_worst <= {limits.ms_worst:g}: the "
            f"last one has {ms:.3g} and {worst:.3g}"
        )
    return kept


def _next(asked: float, found: float, limit: float, active: bool) -> float:
    """What to ask for next, the same where the limit is met, or kept and not what holds the design back."""
    if found <= limit * (1 + STILL_KEPT) and not (active and found < limit * (1 - MET)):
        return asked
    wanted = (limit * (1 - 0.5 * MET) - 1) / (found - 1)
    return 1 + (asked - 1) * min(max(wanted, LEAST_FACTOR), LARGEST_FACTOR)


def refusal(limits: Requirements, remedy: str, worst: float, more: str = "") -> ValueError:
    """Return the error that says why there is no design that is safe with the family."""
    found = f"worst Ms {worst:.3g}" if math.isfinite(worst) else "an unstable loop"
    return ValueError(
        f"the model is too uncertain for this controller: a plant of its spread gives {found}, where "
        f"ms_worst = {limits.ms_worst:g} is allowed{more}; {remedy}"
    )


def make_safe(
    make: Designer, evaluator: LoopEvaluator, process: Process, limits: Requirements, remedy: str
) -> tuple[Design, float]:
    """Return a design that is safe with all plants of the family, and its price.

    Parameters
    ----------
    make : callable
        Makes a design for requirements.
    evaluator : LoopEvaluator
        Judges it in the loop that will run.
    process : Process
        The model.
    limits : Requirements
        What the loop has to keep.
    remedy : str
        What would help where there is no such design, for the message.

    Returns
    -------
    design : Design
    price : float
        How many times its IAE is that of the design for the process alone.

    Raises
    ------
    ValueError
        If there is none, or none that is worth having.
    """

    def sizes(made: Design) -> tuple[float, float]:
        return evaluator.ms(made, process).ms, evaluator.worst(made, limits.family).ms

    alone = replace(limits, family=())
    plain = correct_request(make, lambda made: (evaluator.ms(made, process).ms, 0.0), alone)
    worst = evaluator.worst(plain, limits.family).ms
    if worst <= limits.ms_worst * (1 + STILL_KEPT):
        return plain, 1.0
    try:
        made = correct_request(make, sizes, limits, plain)
    except ValueError as failed:
        raise refusal(limits, remedy, worst, f" ({failed})") from None
    price = load_iae(evaluator.loop(made, process)) / load_iae(evaluator.loop(plain, process))
    if price > TOO_DEAR:
        raise refusal(limits, remedy, worst, f", and a design that is safe has {price:.1f} times the IAE")
    return made, price
