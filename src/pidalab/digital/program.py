"""The step of a digital controller as statements, specialised to what it has.

This is the one description of the step: languages print it, ``step`` runs what is printed as Python, and simulations
compile it (`pidalab.simulation.operations`). In this order: whether the signals are numbers; the prefilter; the
deadband; the chains of lags; what an external signal corrects; the growth of the integral; the limits of rate and
range; what these take back from the integral.

It is total: whatever the inputs are, the control signal is a number within the limits. A sample with a signal that is
no number, or beyond `LARGEST_SIGNAL`, is left out: states and control signal stay, and `fault` says so. Within that
size nothing overflows.
"""

from __future__ import annotations

import math
import re
from functools import lru_cache

from pidalab.digital import chains
from pidalab.digital.parameters import LARGEST_PARAMETER, LARGEST_SIGNAL, Parameters
from pidalab.digital.statements import If, Note, Program, Set, Statement, targets

INPUTS = {"setpoint": "real", "measurement": "real", "manual": "bool", "manual_value": "real"} | {
    "tracking": "bool",
    "track_value": "real",
}
MORE = {"feedforward": "real", "retuned": "bool"}  # inputs that a controller is asked to have
TRUTHS = ("forced", "by_hand")  # variables that are true or false
FIXED = re.compile(r"LOWEST|HIGHEST|LARGEST_.*|BIAS|Y_OFFSET|DEADBAND|PREFILTER.*|.*_WEIGHT")  # are no gains
UNIT_GAIN = re.compile(r"PART_\d+_(NEW|OLD)(_\d+)?|TRACKING_GAIN|BACK_CALCULATION_GAIN")  # gains from 0 to 1


def constants(k: Parameters) -> dict[str, float]:
    """Return the constants of a controller by name; those that nothing needs are left out."""
    found: dict[str, float] = {} if k.prefilter is None else chains.prefilter_constants(k.prefilter)
    for i, path in enumerate(k.paths):
        found |= chains.path_constants(path, i)
    if k.integrates:
        found |= {f"INTEGRAL_{x}": value for x, value in zip(("NEW", "OLD"), k.growth, strict=True) if value}
        taken_back = k.back_calculation_gain if k.limited else 0.0
        found |= {"BACK_CALCULATION_GAIN": taken_back} if taken_back else {}
        found |= {"TRACKING_GAIN": k.tracking_gain}
    others = {"BIAS": k.bias, "Y_OFFSET": k.y_offset, "DEADBAND": k.deadband}
    found |= {name: value for name, value in others.items() if value}
    ends = {"LOWEST": k.limits[0], "HIGHEST": k.limits[1], "LARGEST_CHANGE": k.rate_limit * k.sample_time}
    found |= {name: value for name, value in ends.items() if math.isfinite(value)}
    found |= {"LARGEST_SIGNAL": LARGEST_SIGNAL}
    return found | ({"LARGEST_GAIN": LARGEST_PARAMETER} if k.tunable else {})


@lru_cache(maxsize=64)
def program(k: Parameters, block: bool = False) -> Program:
    """Write the step of a controller as statements; `summed` is given where a block outside makes it of the error.

    What is returned is shared: do not change it.
    """
    found = constants(k)
    gains = {name: x for name, x in found.items() if k.tunable and not FIXED.fullmatch(name)}
    asked = (k.feedforward, k.tunable)
    inputs = INPUTS | {name: MORE[name] for name, has in zip(MORE, asked, strict=True) if has}
    states: dict[str, float | bool] = {"started": False, "fault": False, "at_limit": False}
    offset = " - Y_OFFSET" if "Y_OFFSET" in found else ""
    body: list[Statement] = [
        Note("inputs" + (", relative to the working point" if offset else "")),
        Set("target", f"setpoint{offset}"),
        Set("measured", f"measurement{offset}"),
    ]
    if k.prefilter is not None:
        states |= dict.fromkeys(chains.prefilter_states(k.prefilter), 0.0)
        body += chains.prefilter_statements(k.prefilter, found)
    body += _error(found, compares=k.integrates and not k.from_signal)
    for i, path in enumerate(k.paths):
        states |= dict.fromkeys(chains.path_states(path, i), 0.0)
        body += chains.path_statements(path, i, found)
    body += [] if k.paths or block else [Set("summed", "0.0")]
    found |= {"feedforward": 0.0} if k.feedforward else {}  # an input, which is added as the bias is
    body += _tracking(k, found)
    if k.integrates:
        states |= {"follow": False, "integral_part": 0.0, "carry": 0.0}
        states |= {"old": 0.0} if _remembers(k) else {}
        body += _with_integral(k, found)
    else:
        body += [
            Note("manual or automatic mode"),
            If("manual", [Set("wanted", "manual_value")], [_wanted(found)]),
        ]
        body += _limited(found)
    body += [*_at_limit(k), Set("control", "limited"), Set("started", "true")]
    checks, left_out = _numbers(inputs, gains), _left_out(k, found)
    names = sorted({*targets([*checks, *left_out, *body])} - {*states, "control"})
    fixed = {name: x for name, x in found.items() if name not in gains and name not in inputs}
    variables = {name: "bool" if name in TRUTHS else "real" for name in names}
    return Program(
        fixed, gains, inputs, {**states, **gains, "control": k.bias}, variables, checks, left_out, body
    )


def _number(name: str, low: str = "-LARGEST_SIGNAL", high: str = "LARGEST_SIGNAL") -> str:
    """Write that a signal is within bounds; of no number this is not true."""
    return f"{low} <= {name} and {name} <= {high}"


def _numbers(inputs: dict[str, str], gains: dict[str, float]) -> list[Statement]:
    """Statements that look whether a sample has all signals that it needs."""
    needed = [name for name in ("setpoint", "measurement", "feedforward") if name in inputs]
    bad = [f"not ({_number(name)})" for name in needed]
    bad.append(f"tracking and not ({_number('track_value')})")
    for name in gains:
        ends = ("0.0", "1.0") if UNIT_GAIN.fullmatch(name) else ("-LARGEST_GAIN", "LARGEST_GAIN")
        bad.append(f"not ({_number(name, *ends)})")
    return [
        Note("skip a sample with an input that is NaN, infinite or too large"),
        Set("fault", "false"),
        *(If(condition, [Set("fault", "true")]) for condition in bad),
        Set("by_hand", f"manual and {_number('manual_value')}"),
        If("manual and not by_hand", [Set("fault", "true")]),
    ]


def _left_out(k: Parameters, found: dict[str, float]) -> list[Statement]:
    """Statements for a sample that is left out: it holds, but for the hand of an operator."""
    # what follows then starts with the signal that there is, as after manual
    later: list[Statement] = [Set("follow", "true")] if k.integrates else []
    limited = [*_limited(found), *_at_limit(k), Set("control", "limited")]
    body: list[Statement] = [
        Note("manual mode works in a skipped sample, too"),
        If("by_hand", [Set("wanted", "manual_value"), *limited, *later]),
    ]
    return body + ([If("retuned", later)] if k.tunable else [])


def _error(found: dict[str, float], compares: bool) -> list[Statement]:
    """Statements that make the error with its deadband, where something needs it."""
    body: list[Statement] = [Set("error", "target - measured")] * (compares or "DEADBAND" in found)
    if "DEADBAND" in found:
        inside = If("error < -DEADBAND", [Set("error", "error + DEADBAND")], [Set("error", "0.0")])
        body += [
            Note("deadband: a smaller error counts as zero, a larger one from the edge of the band"),
            If("error > DEADBAND", [Set("error", "error - DEADBAND")], [inside]),
            Set("measured", "target - error"),
        ]
    return body


def _tracking(k: Parameters, found: dict[str, float]) -> list[Statement]:
    """Statements that take up a signal that acted in place of ours; at the first sample it starts from there."""
    inside: list[Statement] = []
    if k.integrates:
        inside.append(Set("integral_part", "integral_part + TRACKING_GAIN * (track_value - control)"))
    if k.from_signal and _remembers(k):
        inside.append(Set("old", f"track_value{_less_bias(found)} - integral_part"))
    return [
        Note("the signal that acted since the last sample in place of the control signal"),
        If("tracking", [*inside, Set("control", "track_value")]),
    ]


def _with_integral(k: Parameters, found: dict[str, float]) -> list[Statement]:
    """Statements of modes, integral, limits and anti-windup."""
    source = "summed" if k.from_signal else "error"
    shares = (("INTEGRAL_NEW", source), ("INTEGRAL_OLD", "old"))
    growth = " + ".join(f"{name} * {signal}" for name, signal in shares if name in found)
    forced = [
        If("manual", [Set("wanted", "manual_value")], [Set("wanted", "control")]),
        *_limited(found),
        Note("the integral tracks the signal, for a return without a bump"),
        Set("integral_part", f"limited{_less_bias(found)} - summed"),
        Set("carry", "0.0"),
        Set("follow", "false"),
    ]
    automatic = [
        Note("the integral; carry keeps what rounding loses"),
        Set("growth", growth),
        Set("added", "growth + carry"),
        Set("grown", "integral_part + added"),
        _wanted(found, "grown"),
        *_limited(found),
        *_kept(k, found),
    ]
    begins = f"manual mode, first sample, {'new gains, ' * k.tunable}first sample after a skipped one: keep the signal"
    body: list[Statement] = [
        Note(begins),
        Set("forced", "manual or follow"),
        *([If("retuned", [Set("forced", "true")])] if k.tunable else []),
        If("not started", [Set("forced", "true")]),
        If("forced", forced, automatic),
    ]
    if _remembers(k):
        body.append(Set("old", f"limited{_less_bias(found)} - integral_part" if k.from_signal else "error"))
    if k.anti_windup == "clamping ahead":
        # the same for what this sample's error adds, which comes with the next sample
        body.append(If("(limited - wanted) * INTEGRAL_OLD * error < 0.0", [Set("old", "0.0")]))
    return body


def _kept(k: Parameters, found: dict[str, float]) -> list[Statement]:
    """Statements that keep the integral, less what a limit takes from it."""
    keep: list[Statement] = [Set("carry", "added - (grown - integral_part)"), Set("integral_part", "grown")]
    if "BACK_CALCULATION_GAIN" in found:
        correction = [
            Set("added", "BACK_CALCULATION_GAIN * (limited - wanted) + carry"),
            Set("integral_part", "grown + added"),
            Set("carry", "added - (integral_part - grown)"),
        ]
        keep += [
            Note("back-calculation: correct the integral by a part of what the limit cut off"),
            If("limited < wanted or limited > wanted", correction),
        ]
    if k.anti_windup != "clamping" or not k.limited:
        return keep
    # a growth that is more than the room up to the limit takes that room; resting there without end would be a lock
    grown_less = [Set("integral_part", "integral_part + room"), Set("carry", "0.0")]
    again = [_wanted(found, "integral_part"), *_limited(found)]
    clamped: list[Statement] = [
        Set("room", f"limited - ({_wanted(found, 'integral_part').value})"),
        If("room * growth > 0.0", grown_less, again),
    ]
    return [
        Note("clamping: the integral stops at the limit, and holds while it would push further beyond"),
        If("(limited - wanted) * growth < 0.0", clamped, keep),
    ]


def _remembers(k: Parameters) -> bool:
    """Whether the integral needs a signal of one sample ago."""
    return k.growth[1] != 0.0


def _less_bias(found: dict[str, float]) -> str:
    return "".join(f" - {name}" for name in ("BIAS", "feedforward") if name in found)


def _wanted(found: dict[str, float], integral: str = "") -> Set:
    """Return the statement that sums up what the controller wants."""
    first = "".join(f"{name} + " for name in ("BIAS", "feedforward") if name in found)
    return Set("wanted", first + "summed" + (f" + {integral}" if integral else ""))


def _limited(found: dict[str, float]) -> list[Statement]:
    """Statements that limit the signal in rate, then in range."""
    body: list[Statement] = [Set("limited", "wanted")]
    rules = (
        ("LARGEST_CHANGE", ">", "control + LARGEST_CHANGE"),
        ("LARGEST_CHANGE", "<", "control - LARGEST_CHANGE"),
        ("HIGHEST", ">", "HIGHEST"),
        ("LOWEST", "<", "LOWEST"),
    )
    return body + [
        If(f"limited {sign} {edge}", [Set("limited", edge)]) for name, sign, edge in rules if name in found
    ]


def _at_limit(k: Parameters) -> list[Statement]:
    """Statement that says whether a limit cuts something off."""
    return [Set("at_limit", "limited < wanted or limited > wanted")] if k.limited else []
