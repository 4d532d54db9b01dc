"""Wordings of all doubts, which are reservations about a record, a model, a design or a check."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

DOUBTS = {
    # doubts about a record
    "missing": "{count} of {total} samples had a missing value and were left out",
    "same time": "{count} sample(s) had the same time as another sample and were averaged",
    "counter": "the time is a counter that returns to 0 at {counter:.6g} ({count} time(s)): it was continued",
    "newest first": "the newest sample came first: the order was reversed",
    "not in order": "the times were not in order, first at {where}, and were sorted",
    "counted": "column {name!r} has sample numbers, not times: the times follow from period = {period:g}",
    "left out": "left out: {note}",
    "few before": "only {count} sample(s) before the input changes: the state of rest is uncertain",
    "drifting": "the output drifts by {drift:.3g} before the step: it was not at rest",
    "levels": "the output has only {count} levels, {apart:.3g} apart",
    "gaps": "the record has {count} gap(s); the longest begins at time {start:.4g} and lasts {longest:.3g} time units",
    "slow input": "the input takes more than {time:.3g} to go from {before:.6g} to {after:.6g}: the listed step is "
    "at the middle of this change, but a fit uses the recorded input",
    "at an end": "the input stays at {end:.6g}, its {word} value, for {count} samples: if that is a limit of the "
    "actuator, the record may contain the requested input instead of the limited input",
    "no step": "the input does not step from one steady level to another: {experiment}",
    "moving at the end": "the output still moves at the end: the plant integrates, or the record is too short",
    # doubts about a model
    "model error": "the model error is {error:.3g} ({share:.2g} % of the movement of the output), but the noise is "
    "only {noise:.3g}: the plant has other dynamics than the model, or something else moved the output",
    "initial state": "the record does not begin at rest: an initial state was fitted as well",
    "hold-out": "the hold-out data are predicted worse than the other data are fitted: NRMSE {holdout:.2f}",
    "closed loop": "the record is of a closed loop with slow disturbances: the uncertainties were multiplied by "
    "{times:.2g}",
    # doubts about a design
    "time unit": "the sample time of {sample_time:g} is {share:.3g} times that of the record, {recorded:.4g}: is it in "
    "the record's unit of time?",
    "short delay": "the dead time of {delay:.3g} is left out: at the frequencies of this loop it changes the phase by "
    "less than {phase:g} rad",
    "few poles": "the model has {known} pole(s), and a {kind} also acts on faster dynamics, which are unknown: fit a "
    "model of higher order, or choose a controller with fewer derivatives",
    "fast filter": "the filter is as fast as the sample time of {sample_time:g} allows: faster sampling would allow "
    "a faster filter",
    "noise unused": "the rule {rule!r} ignores noise: noise_gain was not used",
    "price": "price of robustness: the model is uncertain, so the design is robust, and its IAE is {price:.2f} times "
    "the IAE of a design for the model alone; {remedy}",
    "long sample": "the sample time of {sample_time:g} is long for this loop: at the crossover the phase turns by "
    "{turn:.2g} rad in a sample; a sample time of {better:.2g} or less would be better",
    "filter lost": "the controller has a filter of {filter_time:.3g}, faster than the sample time of {sample_time:g}: "
    "the code hardly filters the noise",
    "no limits": "{options} not given: the code does not know the limits of the actuator, and may wind up",
    # doubts about a relay experiment
    "relay phase": "the plant's phase at this period is {phase:.0f} degrees, not -180: the relay has hysteresis or a "
    "bias; the gain applies at this period, which is not the true ultimate period",
    # doubts about a check
    "log's sample time": "the controller is assumed to have the sample time of the log, {sample_time:.4g}",
    "unstable": "the loop with the model is unstable: the controller of the log must have had other gains or units",
    "other gains": "the given gains did not compute the log's u from its y: they explain {share:.0f} % of the movement "
    "of u between samples{better}",
    "slow disturbances": "slow disturbances cause about {share:.0f} % of the movement of u, since the controller "
    "reacts to them, and pull the model towards -1/(controller): the true Ms may lie outside the interval of Ms; a "
    "larger set-point change would help",
}


def doubt(name: str, /, **values: Any) -> str:
    """Return the wording of a doubt with its values filled in."""
    return DOUBTS[name].format(**values)


def with_doubts(text: str, doubts: Iterable[str]) -> str:
    """Append doubts to a text, each on its own line."""
    return "\n".join([text, *(f"doubt: {said}" for said in doubts)])
