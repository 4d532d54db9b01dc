"""Describe the step of a digital controller as a list of statements.

This is the only description of the step. It is written as code in several languages, run as Python by ``step``, and
compiled for simulations (`pidalab.simulation.operations`). The order of the statements is: checks of the inputs,
prefilter, deadband, filter chains, tracking, integral, limits of rate and range, anti-windup.

The step is defined for any input (see `DigitalController.step` for invalid inputs). The control signal is always a
number within the limits. No valid input causes an overflow.

An expression is a string of names, numbers, ``+ - * ( ) < > <= >=``, ``and``, ``or`` and ``not``. All names come from
this module.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple

from pidalab.digital.filters import FilterChain, Prefilter
from pidalab.digital.parameters import LARGEST_PARAMETER, LARGEST_SIGNAL, Parameters

INPUTS = {"setpoint": "real", "measurement": "real", "manual": "bool", "manual_value": "real"} | {
    "tracking": "bool",
    "track_value": "real",
}
MORE = {"feedforward": "real", "retuned": "bool"}  # optional inputs
BOOLEANS = ("forced", "by_hand")
# These constants do not become variables in a tunable controller.
FIXED = re.compile(r"LOWEST|HIGHEST|LARGEST_.*|BIAS|Y_OFFSET|DEADBAND|PREFILTER.*|.*_WEIGHT")
UNIT_GAIN = re.compile(r"PART_\d+_(NEW|OLD)(_\d+)?|TRACKING_GAIN|BACK_CALCULATION_GAIN")  # gains from 0 to 1


class Note(NamedTuple):
    """A comment."""

    text: str


class Set(NamedTuple):
    """An assignment."""

    target: str
    value: str


class If(NamedTuple):
    """A condition with two branches."""

    condition: str
    then: Sequence[Statement]
    otherwise: Sequence[Statement] = ()


Statement = Note | Set | If
Vector = dict[str, list[bool | float]]  # test signals by name, with the values of all samples


class Program(NamedTuple):
    """The step of one controller, ready to be printed in a language.

    Attributes
    ----------
    constants : dict
        Constants by name.
    gains : dict
        Initial values of the gains that may change while the controller runs. These gains are also states.
    inputs : dict
        Types of the inputs by name: "real" or "bool".
    states : dict
        Initial values by name. `started` is true after the first sample.
    variables : dict
        Types of the variables that exist only within a step, by name: "real" or "bool".
    checks : list
        Statements that set `fault` if an input or a variable gain is invalid.
    skipped : list
        Statements for a sample with a fault.
    body : list
        Statements for any other sample.
    """

    constants: dict[str, float]
    gains: dict[str, float]
    inputs: dict[str, str]
    states: dict[str, float | bool]
    variables: dict[str, str]
    checks: list[Statement]
    skipped: list[Statement]
    body: list[Statement]

    @property
    def statements(self) -> list[Statement]:
        """All statements of a step."""
        return [*self.checks, If("fault", self.skipped, self.body)]


def targets(body: Sequence[Statement]) -> Iterator[str]:
    """Yield the names that statements assign to."""
    for statement in body:
        if isinstance(statement, Set):
            yield statement.target
        elif isinstance(statement, If):
            yield from targets([*statement.then, *statement.otherwise])


def constants(k: Parameters) -> dict[str, float]:
    """Return the constants that a controller needs, by name."""
    named: dict[str, float] = {} if k.prefilter is None else _prefilter_constants(k.prefilter)
    for i, path in enumerate(k.paths):
        named |= _path_constants(path, i)
    if k.integrates:
        named |= {f"INTEGRAL_{x}": value for x, value in zip(("NEW", "OLD"), k.growth, strict=True) if value}
        taken_back = k.back_calculation_gain if k.limited else 0.0
        named |= {"BACK_CALCULATION_GAIN": taken_back} if taken_back else {}
        named |= {"TRACKING_GAIN": k.tracking_gain}
    others = {"BIAS": k.bias, "Y_OFFSET": k.y_offset, "DEADBAND": k.deadband}
    named |= {name: value for name, value in others.items() if value}
    ends = {"LOWEST": k.limits[0], "HIGHEST": k.limits[1], "LARGEST_CHANGE": k.rate_limit * k.sample_time}
    named |= {name: value for name, value in ends.items() if math.isfinite(value)}
    named |= {"LARGEST_SIGNAL": LARGEST_SIGNAL}
    return named | ({"LARGEST_GAIN": LARGEST_PARAMETER} if k.tunable else {})


@lru_cache(maxsize=64)
def program(k: Parameters, block: bool = False) -> Program:
    """Return the step of a controller.

    If `block` is true, the controller has no paths. The caller then computes `summed`, which is otherwise the sum of
    the outputs of the paths. The program is cached and shared, so do not change it.
    """
    named = constants(k)
    gains = {name: x for name, x in named.items() if k.tunable and not FIXED.fullmatch(name)}
    asked = (k.feedforward, k.tunable)
    inputs = INPUTS | {name: MORE[name] for name, has in zip(MORE, asked, strict=True) if has}
    states: dict[str, float | bool] = {"started": False, "fault": False, "at_limit": False}
    offset = " - Y_OFFSET" if "Y_OFFSET" in named else ""
    body: list[Statement] = [
        Note("inputs" + (", relative to the working point" if offset else "")),
        Set("target", f"setpoint{offset}"),
        Set("measured", f"measurement{offset}"),
    ]
    if k.prefilter is not None:
        states |= dict.fromkeys(_prefilter_states(k.prefilter), 0.0)
        body += _prefilter_statements(k.prefilter, named)
    body += _error(named, compares=k.integrates and not k.from_signal)
    for i, path in enumerate(k.paths):
        states |= dict.fromkeys(_path_states(path, i), 0.0)
        body += _path_statements(path, i, named)
    body += [] if k.paths or block else [Set("summed", "0.0")]
    named |= {"feedforward": 0.0} if k.feedforward else {}  # an input that is added like the bias
    body += _tracking(k, named)
    if k.integrates:
        states |= {"follow": False, "integral_part": 0.0, "carry": 0.0}
        states |= {"old": 0.0} if _remembers(k) else {}
        body += _with_integral(k, named)
    else:
        body += [
            Note("manual or automatic mode"),
            If("manual", [Set("wanted", "manual_value")], [_wanted(named)]),
        ]
        body += _limited(named)
    body += [*_at_limit(k), Set("control", "limited"), Set("started", "true")]
    checks, skipped = _checks(inputs, gains), _skipped(k, named)
    names = sorted({*targets([*checks, *skipped, *body])} - {*states, "control"})
    fixed = {name: x for name, x in named.items() if name not in gains and name not in inputs}
    variables = {name: "bool" if name in BOOLEANS else "real" for name in names}
    return Program(
        fixed, gains, inputs, {**states, **gains, "control": k.bias}, variables, checks, skipped, body
    )


def _number(name: str, low: str = "-LARGEST_SIGNAL", high: str = "LARGEST_SIGNAL") -> str:
    """Return the condition that a signal is within bounds. The condition is false for NaN."""
    return f"{low} <= {name} and {name} <= {high}"


def _checks(inputs: dict[str, str], gains: dict[str, float]) -> list[Statement]:
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


def _skipped(k: Parameters, named: dict[str, float]) -> list[Statement]:
    """Return the statements for a skipped sample."""
    # The next valid sample continues from the present signal, as after manual mode.
    later: list[Statement] = [Set("follow", "true")] if k.integrates else []
    limited = [*_limited(named), *_at_limit(k), Set("control", "limited")]
    body: list[Statement] = [
        Note("manual mode also works in a skipped sample"),
        If("by_hand", [Set("wanted", "manual_value"), *limited, *later]),
    ]
    return body + ([If("retuned", later)] if k.tunable else [])


def _error(named: dict[str, float], compares: bool) -> list[Statement]:
    """Return the statements that compute the error and apply the deadband, if these are needed."""
    body: list[Statement] = [Set("error", "target - measured")] * (compares or "DEADBAND" in named)
    if "DEADBAND" in named:
        inside = If("error < -DEADBAND", [Set("error", "error + DEADBAND")], [Set("error", "0.0")])
        body += [
            Note("deadband: subtract the band from the error; an error within the band becomes 0"),
            If("error > DEADBAND", [Set("error", "error - DEADBAND")], [inside]),
            Set("measured", "target - error"),
        ]
    return body


def _tracking(k: Parameters, named: dict[str, float]) -> list[Statement]:
    """Return the statements for tracking of another signal that has acted on the plant."""
    inside: list[Statement] = []
    if k.integrates:
        inside.append(Set("integral_part", "integral_part + TRACKING_GAIN * (track_value - control)"))
    if k.from_signal and _remembers(k):
        inside.append(Set("old", f"track_value{_less_bias(named)} - integral_part"))
    return [
        Note("the signal that has acted on the plant since the last sample replaces the control signal"),
        If("tracking", [*inside, Set("control", "track_value")]),
    ]


def _with_integral(k: Parameters, named: dict[str, float]) -> list[Statement]:
    """Return the statements for modes, integral, limits and anti-windup."""
    source = "summed" if k.from_signal else "error"
    shares = (("INTEGRAL_NEW", source), ("INTEGRAL_OLD", "old"))
    growth = " + ".join(f"{name} * {signal}" for name, signal in shares if name in named)
    forced = [
        If("manual", [Set("wanted", "manual_value")], [Set("wanted", "control")]),
        *_limited(named),
        Note("the integral follows the control signal, so that automatic mode starts without a bump"),
        Set("integral_part", f"limited{_less_bias(named)} - summed"),
        Set("carry", "0.0"),
        Set("follow", "false"),
    ]
    automatic = [
        Note("the integral; carry stores its rounding error for the next sample"),
        Set("growth", growth),
        Set("added", "growth + carry"),
        Set("grown", "integral_part + added"),
        _wanted(named, "grown"),
        *_limited(named),
        *_kept(k, named),
    ]
    more = " or had new gains" * k.tunable
    body: list[Statement] = [
        Note(
            "if forced, the control signal is manual_value in manual mode, and keeps its value in automatic mode"
        ),
        Note(f"follow is true after a skipped sample that was in manual mode{more}"),
        Set("forced", "manual or follow"),
        *([If("retuned", [Set("forced", "true")])] if k.tunable else []),
        If("not started", [Set("forced", "true")]),
        If("forced", forced, automatic),
    ]
    if _remembers(k):
        body.append(Set("old", f"limited{_less_bias(named)} - integral_part" if k.from_signal else "error"))
    if k.anti_windup == "clamping ahead":
        # The present error enters the integral only in the next sample, so clamp the error now.
        body.append(If("(limited - wanted) * INTEGRAL_OLD * error < 0.0", [Set("old", "0.0")]))
    return body


def _kept(k: Parameters, named: dict[str, float]) -> list[Statement]:
    """Return the statements that update the integral, anti-windup included."""
    keep: list[Statement] = [Set("carry", "added - (grown - integral_part)"), Set("integral_part", "grown")]
    if "BACK_CALCULATION_GAIN" in named:
        correction = [
            Set("added", "BACK_CALCULATION_GAIN * (limited - wanted) + carry"),
            Set("integral_part", "grown + added"),
            Set("carry", "added - (integral_part - grown)"),
        ]
        keep += [
            Note("back-calculation: correct the integral in proportion to what the limit cut off"),
            If("limited < wanted or limited > wanted", correction),
        ]
    if k.anti_windup != "clamping" or not k.limited:
        return keep
    # Reduce the increment instead of stopping the integral, since a stopped integral could remain locked.
    grown_less = [Set("integral_part", "integral_part + room"), Set("carry", "0.0")]
    again = [_wanted(named, "integral_part"), *_limited(named)]
    clamped: list[Statement] = [
        Set("room", f"limited - ({_wanted(named, 'integral_part').value})"),
        If("room * growth > 0.0", grown_less, again),
    ]
    return [
        Note("clamping: reduce an increment of the integral that would drive the signal beyond the limit"),
        If("(limited - wanted) * growth < 0.0", clamped, keep),
    ]


def _remembers(k: Parameters) -> bool:
    """Return True if the integral needs a signal of the previous sample."""
    return k.growth[1] != 0.0


def _less_bias(named: dict[str, float]) -> str:
    return "".join(f" - {name}" for name in ("BIAS", "feedforward") if name in named)


def _wanted(named: dict[str, float], integral: str = "") -> Set:
    """Return the statement for the control signal before the limits."""
    first = "".join(f"{name} + " for name in ("BIAS", "feedforward") if name in named)
    return Set("wanted", first + "summed" + (f" + {integral}" if integral else ""))


def _limited(named: dict[str, float]) -> list[Statement]:
    """Return the statements that limit the signal in rate, then in range."""
    body: list[Statement] = [Set("limited", "wanted")]
    rules = (
        ("LARGEST_CHANGE", ">", "control + LARGEST_CHANGE"),
        ("LARGEST_CHANGE", "<", "control - LARGEST_CHANGE"),
        ("HIGHEST", ">", "HIGHEST"),
        ("LOWEST", "<", "LOWEST"),
    )
    return body + [
        If(f"limited {sign} {edge}", [Set("limited", edge)]) for name, sign, edge in rules if name in named
    ]


def _at_limit(k: Parameters) -> list[Statement]:
    """Return the statement that sets `at_limit`."""
    return [Set("at_limit", "limited < wanted or limited > wanted")] if k.limited else []


def part_name(i: int) -> str:
    """Return the name of the i-th filter chain in code. The first is part_1."""
    return f"part_{i + 1}"


def _share(path: FilterChain, i: int, kind: str, j: int) -> str:
    """Return the name of a coefficient of the j-th lag of the i-th chain. Equal lags share the coefficient."""
    return f"{part_name(i).upper()}_{kind}" + ("" if _equal(path) else f"_{j}")


def _path_constants(path: FilterChain, i: int) -> dict[str, float]:
    name = part_name(i).upper()
    named = {f"{name}_WEIGHT": path.weight} if path.weight not in (0.0, 1.0) else {}
    for kind, shares in (("NEW", path.new), ("OLD", path.old)):
        named |= {_share(path, i, kind, j): value for j, value in enumerate(shares, start=1) if value}
    return named | {f"{name}_GAIN_{m}": gain for m, gain in enumerate(path.gains) if gain}


def _prefilter_constants(prefilter: Prefilter) -> dict[str, float]:
    named: dict[str, float] = {}
    for i, row in enumerate(prefilter.move, start=1):
        named |= {f"PREFILTER_MOVE_{i}_{j}": x for j, x in enumerate(row, start=1) if x}
    return named | {f"PREFILTER_OUT_{i}": x for i, x in enumerate(prefilter.out, start=1) if x}


def _prefilter_states(prefilter: Prefilter) -> list[str]:
    """Return the names of the states of a prefilter. The first is the previous set point, if needed."""
    return [f"prefilter_{j}" for j in range(0 if prefilter.old else 1, len(prefilter.out) + 1)]


def _prefilter_statements(prefilter: Prefilter, named: dict[str, float]) -> list[Statement]:
    n = len(prefilter.out)
    shares = ((prefilter.new, "target"), (prefilter.old, "prefilter_0"))
    aim = " + ".join(x if value == 1.0 else f"{value!r} * {x}" for value, x in shares if value)
    body: list[Statement] = [
        Note("set-point prefilter: its states move towards the set point"),
        If("not started", [Set(x, "target") for x in _prefilter_states(prefilter)]),
        Set("aim", aim),
        *([Set("prefilter_0", "target")] if prefilter.old else []),
        *(Set(f"distance_{j}", f"prefilter_{j} - aim") for j in range(1, n + 1)),
    ]
    for i in range(1, n + 1):
        name, x = f"PREFILTER_MOVE_{i}_", f"prefilter_{i}"
        terms = [f"{name}{j} * distance_{j}" for j in range(1, n + 1) if f"{name}{j}" in named]
        body += [Set(x, f"{x} + ({' + '.join(terms)})")] if terms else []
    outs = [(f"PREFILTER_OUT_{i}", f"prefilter_{i}") for i in range(1, n + 1)]
    terms = [f"{gain} * ({x} - target)" for gain, x in outs if gain in named]
    return body + ([Set("target", f"target + ({' + '.join(terms)})")] if terms else [])


def _path_states(path: FilterChain, i: int) -> list[str]:
    """Return the names of the states of a chain: first its previous input, if needed, then its lags."""
    return (
        [f"{part_name(i)}_{j}" for j in range(0 if any(path.old) else 1, path.order + 1)]
        if path.order
        else []
    )


def _path_statements(path: FilterChain, i: int, named: dict[str, float]) -> list[Statement]:
    """Return the statements for a chain of lags, and for a weighted sum of differences between the lags."""
    name, n, upper = part_name(i), path.order, part_name(i).upper()
    aim = {1.0: "target", 0.0: "0.0"}.get(path.weight, f"{upper}_WEIGHT * target")
    lags = f": {n}{' equal' * (n > 1 and _equal(path))} lag{'s' if n > 1 else ''}" if n else ""
    body: list[Statement] = [
        Note(f"part {i + 1}, {path.name.replace('_', ' ')}{lags}"),
        Set("entering", f"{aim} - measured"),
    ]
    level = ["entering", *(f"{name}_{j}" for j in range(1, n + 1))]
    if n:
        body.append(If("not started", [Set(x, "entering") for x in _path_states(path, i)]))
    if any(path.new) and any(path.old):
        body += [Set("before", f"{name}_0")]
        for j in range(1, n + 1):
            x = f"{name}_{j}"
            new, old = (_share(path, i, kind, j) for kind in ("NEW", "OLD"))
            step = f"{x} + ({new} * ({level[j - 1]} - {x}) + {old} * (before - {x}))"
            body += [Set("after", step), Set("before", x), Set(x, "after")]
    elif any(path.new):
        for j in range(1, n + 1):
            x = f"{name}_{j}"
            body.append(Set(x, f"{x} + {_share(path, i, 'NEW', j)} * ({level[j - 1]} - {x})"))
    elif n:  # update the last lag first, since each lag needs the old state of the lag before it
        for j in range(n, 0, -1):
            x = f"{name}_{j}"
            body.append(Set(x, f"{x} + {_share(path, i, 'OLD', j)} * ({name}_{j - 1} - {x})"))
    body += [Set(f"{name}_0", "entering")] if any(path.old) else []
    # The gain with index m multiplies the m-th difference of the last m + 1 states.
    first = i == 0
    highest = max((m for m, gain in enumerate(path.gains) if gain), default=0)
    for m in range(highest + 1):
        for j in range(n, n - (highest - m) - 1 if m else n, -1):
            body.append(Set(f"difference_{j}", f"{level[j - 1]} - {level[j]}"))
        if m:
            level = [f"difference_{j}" if j >= n - (highest - m) else x for j, x in enumerate(level)]
        if f"{upper}_GAIN_{m}" in named:
            term = f"{upper}_GAIN_{m} * {level[n]}"
            body.append(Set("summed", term if first else f"summed + {term}"))
            first = False
    return body + ([Set("summed", "0.0")] if first else [])


def _equal(path: FilterChain) -> bool:
    return len({*path.new}) == len({*path.old}) == 1
