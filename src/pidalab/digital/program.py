"""The step of a digital controller as statements, specialised to what it has.

This is the one description of the step: languages print it, ``step`` runs what is printed as Python, and simulations
compile it (`pidalab.simulation.operations`). In this order: the prefilter; the deadband; the chains of lags; what an
external signal corrects; the growth of the integral; the limits of rate and range; what these take back from the
integral.

A statement is a `Note`, a `Set` or an `If`. Expressions are strings of names, numbers, ``+ - * ( ) < >``, ``and``,
``or`` and ``not``, which every language has.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from pidalab.digital.paths import Path
from pidalab.digital.prefilter import Prefilter

if TYPE_CHECKING:
    from pidalab.digital.controller import DigitalController

INPUTS = {"setpoint": "real", "measurement": "real", "manual": "bool", "manual_value": "real"} | {
    "tracking": "bool",
    "track_value": "real",
}
MORE = {"feedforward": "real", "retuned": "bool"}  # inputs that a controller is asked to have
FIXED = re.compile(r"LOWEST|HIGHEST|LARGEST_.*|BIAS|Y_OFFSET|DEADBAND|PREFILTER.*|.*_WEIGHT")  # are no gains


class Note(NamedTuple):
    """A comment."""

    text: str


class Set(NamedTuple):
    """An assignment."""

    target: str
    value: str


class If(NamedTuple):
    """A choice."""

    condition: str
    then: Sequence[Statement]
    otherwise: Sequence[Statement] = ()


Statement = Note | Set | If
Vector = dict[str, list[bool | float]]  # of a test: a value for each sample, by the name of the signal


class Program(NamedTuple):
    """What a language prints.

    Attributes
    ----------
    constants : dict
        Values by name.
    gains : dict
        Initial values by name of what may be changed while it runs; they are among the states.
    inputs : dict
        Kinds of the inputs, "real" or "bool", by name.
    states : dict
        Initial values by name; the truth value `started` says whether the first sample is past.
    variables : list of str
        What lives within a step; `forced` is a truth value.
    body : list
        Statements.
    """

    constants: dict[str, float]
    gains: dict[str, float]
    inputs: dict[str, str]
    states: dict[str, float | bool]
    variables: list[str]
    body: list[Statement]


def constants(k: DigitalController) -> dict[str, float]:
    """Return the constants of a controller by name; those that nothing needs are left out."""
    found: dict[str, float] = {}
    if k.prefilter is not None:
        for i, row in enumerate(k.prefilter.move, start=1):
            found |= {f"PREFILTER_MOVE_{i}_{j}": x for j, x in enumerate(row, start=1) if x}
        found |= {f"PREFILTER_OUT_{i}": x for i, x in enumerate(k.prefilter.out, start=1) if x}
    for path in k.paths:
        name = path.name.upper()
        if path.weight not in (0.0, 1.0):
            found[f"{name}_WEIGHT"] = path.weight
        for kind, shares in (("NEW", path.new), ("OLD", path.old)):
            found |= {_share(path, kind, j): share for j, share in enumerate(shares, start=1) if share}
        found |= {f"{name}_GAIN_{i}": gain for i, gain in enumerate(path.gains) if gain}
    if k.integrates:
        found |= {f"INTEGRAL_{x}": share for x, share in zip(("NEW", "OLD"), k.growth, strict=True) if share}
        found |= {"TAKEN_BACK": k.taken_back} if k.taken_back and k.limited else {}
        found |= {"TRACKED": k.tracked}
    others = {"BIAS": k.bias, "Y_OFFSET": k.y_offset, "DEADBAND": k.deadband}
    found |= {name: value for name, value in others.items() if value}
    ends = {"LOWEST": k.limits[0], "HIGHEST": k.limits[1], "LARGEST_CHANGE": k.rate_limit * k.sample_time}
    return found | {name: value for name, value in ends.items() if math.isfinite(value)}


def program(k: DigitalController, block: bool = False) -> Program:
    """Write the step of a controller as statements; `action` is given where a block outside makes it of the error."""
    found = constants(k)
    gains = {name: x for name, x in found.items() if k.tunable and not FIXED.fullmatch(name)}
    states: dict[str, float | bool] = {"started": False}
    offset = " - Y_OFFSET" if "Y_OFFSET" in found else ""
    body: list[Statement] = [
        Note("signals" + (", from the working point" if offset else "")),
        Set("reference", f"setpoint{offset}"),
        Set("measured", f"measurement{offset}"),
    ]
    if k.prefilter is not None:
        states |= dict.fromkeys(_kept(k.prefilter), 0.0)
        body += _before(k.prefilter, found)
    body += _error(found, compares=k.integrates and not k.from_signal)
    for path in k.paths:
        states |= dict.fromkeys(_chain(path), 0.0)
        body += _path(path, found, first=path is k.paths[0])
    body += [] if k.paths or block else [Set("action", "0.0")]
    found |= {"feedforward": 0.0} if k.feedforward else {}  # an input, which is added as the bias is
    body += _tracking(k, found)
    if k.integrates:
        states |= {"integral": 0.0, "carry": 0.0} | ({"old": 0.0} if _remembers(k) else {})
        body += _with_integral(k, found)
    else:
        body += [Note("manual or automatic"), If("manual", [Set("wanted", "manual_value")], [_wanted(found)])]
        body += _limited(found)
    body += [Set("control", "limited"), Set("started", "true")]
    variables = sorted(_targets(body) - {*states, "control"})
    asked = (k.feedforward, k.tunable)
    inputs = INPUTS | {name: MORE[name] for name, has in zip(MORE, asked, strict=True) if has}
    fixed = {name: x for name, x in found.items() if name not in gains and name not in inputs}
    return Program(fixed, gains, inputs, {**states, **gains, "control": k.bias}, variables, body)


def _kept(prefilter: Prefilter) -> list[str]:
    """Names of the states of a prefilter: the last set point, where it is needed, and those that move."""
    return [f"prefilter_{j}" for j in range(0 if prefilter.old else 1, len(prefilter.out) + 1)]


def _before(prefilter: Prefilter, found: dict[str, float]) -> list[Statement]:
    """Statements that filter the set point."""
    n = len(prefilter.out)
    shares = ((prefilter.new, "reference"), (prefilter.old, "prefilter_0"))
    aim = " + ".join(x if share == 1.0 else f"{share!r} * {x}" for share, x in shares if share)
    body: list[Statement] = [
        Note("prefilter: its states move towards the set point"),
        If("not started", [Set(x, "reference") for x in _kept(prefilter)]),
        Set("aim", aim),
        *([Set("prefilter_0", "reference")] if prefilter.old else []),
        *(Set(f"distance_{j}", f"prefilter_{j} - aim") for j in range(1, n + 1)),
    ]
    for i in range(1, n + 1):
        name, x = f"PREFILTER_MOVE_{i}_", f"prefilter_{i}"
        terms = [f"{name}{j} * distance_{j}" for j in range(1, n + 1) if f"{name}{j}" in found]
        body += [Set(x, f"{x} + ({' + '.join(terms)})")] if terms else []
    terms = [
        f"PREFILTER_OUT_{i} * (prefilter_{i} - reference)"
        for i in range(1, n + 1)
        if f"PREFILTER_OUT_{i}" in found
    ]
    return body + ([Set("reference", f"reference + ({' + '.join(terms)})")] if terms else [])


def _error(found: dict[str, float], compares: bool) -> list[Statement]:
    """Statements that make the error with its deadband, where something needs it."""
    body: list[Statement] = []
    body += [Set("error", "reference - measured")] if compares or "DEADBAND" in found else []
    if "DEADBAND" in found:
        inside = If("error < -DEADBAND", [Set("error", "error + DEADBAND")], [Set("error", "0.0")])
        body += [
            Note("deadband: smaller errors are none, larger ones count from its edge"),
            If("error > DEADBAND", [Set("error", "error - DEADBAND")], [inside]),
            Set("measured", "reference - error"),
        ]
    return body


def _chain(path: Path) -> list[str]:
    """Names of the states of a path: its input, where lags need that of one sample ago, and its lags."""
    return (
        [f"{path.name}_{j}" for j in range(0 if any(path.old) else 1, path.order + 1)] if path.order else []
    )


def _share(path: Path, kind: str, j: int) -> str:
    """Name of a share of the j-th lag: one name for equal lags."""
    return f"{path.name.upper()}_{kind}" + ("" if len({*path.new}) == len({*path.old}) == 1 else f"_{j}")


def _path(path: Path, found: dict[str, float], first: bool) -> list[Statement]:
    """Statements of a chain of lags and the gains on its differences."""
    name, n, upper = path.name, path.order, path.name.upper()
    weighted = {1.0: "reference - measured", 0.0: "0.0 - measured"}.get(
        path.weight, f"{upper}_WEIGHT * reference - measured"
    )
    equal = " equal" if len({*path.new}) == len({*path.old}) == 1 else ""
    lags = f": {n}{equal} lag{'s' if n > 1 else ''}" if n else ""
    body: list[Statement] = [Note(name.replace("_", " ") + " part" + lags), Set("entering", weighted)]
    level = ["entering", *(f"{name}_{j}" for j in range(1, n + 1))]
    if n:
        body.append(If("not started", [Set(x, "entering") for x in _chain(path)]))
    if any(path.new) and any(path.old):
        body += [Set("before", f"{name}_0")]
        for j in range(1, n + 1):
            x = f"{name}_{j}"
            new, old = (_share(path, kind, j) for kind in ("NEW", "OLD"))
            step = f"{x} + ({new} * ({level[j - 1]} - {x}) + {old} * (before - {x}))"
            body += [Set("after", step), Set("before", x), Set(x, "after")]
    elif any(path.new):
        for j in range(1, n + 1):
            x = f"{name}_{j}"
            body.append(Set(x, f"{x} + {_share(path, 'NEW', j)} * ({level[j - 1]} - {x})"))
    elif n:  # the last lag first: each takes what the one before it was
        for j in range(n, 0, -1):
            x = f"{name}_{j}"
            body.append(Set(x, f"{x} + {_share(path, 'OLD', j)} * ({name}_{j - 1} - {x})"))
    body += [Set(f"{name}_0", "entering")] if any(path.old) else []
    # differences that end at the last state, of one order after the other
    highest = max((i for i, gain in enumerate(path.gains) if gain), default=0)
    for k in range(highest + 1):
        for j in range(n, n - (highest - k) - 1 if k else n, -1):
            body.append(Set(f"difference_{j}", f"{level[j - 1]} - {level[j]}"))
        if k:
            level = [f"difference_{j}" if j >= n - (highest - k) else x for j, x in enumerate(level)]
        if f"{upper}_GAIN_{k}" in found:
            term = f"{upper}_GAIN_{k} * {level[n]}"
            body.append(Set("action", term if first else f"action + {term}"))
            first = False
    return body


def _tracking(k: DigitalController, found: dict[str, float]) -> list[Statement]:
    """Statements that take up a signal that acted in place of ours."""
    inside: list[Statement] = []
    if k.integrates:
        inside.append(Set("integral", "integral + TRACKED * (track_value - control)"))
    if k.from_signal and _remembers(k):
        inside.append(Set("old", f"track_value{_less_bias(found)} - integral"))
    condition = "tracking and started"
    return [
        Note("what acted since the last sample in place of our signal"),
        If(condition, [*inside, Set("control", "track_value")]),
    ]


def _with_integral(k: DigitalController, found: dict[str, float]) -> list[Statement]:
    """Statements of modes, integral, limits and anti-windup."""
    source = "action" if k.from_signal else "error"
    shares = (("INTEGRAL_NEW", source), ("INTEGRAL_OLD", "old"))
    growth = " + ".join(f"{name} * {signal}" for name, signal in shares if name in found)
    forced = [
        If("manual", [Set("wanted", "manual_value")], [Set("wanted", "control")]),
        *_limited(found),
        Note("the integral follows: no bump on the way back"),
        Set("integral", f"limited{_less_bias(found)} - action"),
        Set("carry", "0.0"),
    ]
    keep: list[Statement] = [Set("carry", "added - (grown - integral)"), Set("integral", "grown")]
    if "TAKEN_BACK" in found:
        correction = [
            Set("added", "TAKEN_BACK * (limited - wanted) + carry"),
            Set("integral", "grown + added"),
            Set("carry", "added - (integral - grown)"),
        ]
        keep += [
            Note("part of what a limit cut off is taken back from the integral"),
            If("limited < wanted or limited > wanted", correction),
        ]
    if k.anti_windup == "clamping" and k.limited:
        again = [_wanted(found, "integral"), *_limited(found)]
        keep = [
            Note("the integral rests while it would drive the signal further beyond the limit"),
            If("(limited - wanted) * growth < 0.0", again, keep),
        ]
    automatic = [
        Note("the integral; what rounding takes from it is carried over"),
        Set("growth", growth),
        Set("added", "growth + carry"),
        Set("grown", "integral + added"),
        _wanted(found, "grown"),
        *_limited(found),
        *keep,
    ]
    body: list[Statement] = [
        Note(f"manual, {'new gains, ' * k.tunable}or the first sample: it starts with the signal it has"),
        Set("forced", "manual or retuned" if k.tunable else "manual"),
    ]
    body += [If("not started", [Set("forced", "true")]), If("forced", forced, automatic)]
    if _remembers(k):
        body.append(Set("old", f"limited{_less_bias(found)} - integral" if k.from_signal else "error"))
    if k.anti_windup == "clamping ahead":
        # the same for what this sample's error adds, which comes with the next sample
        body.append(If("(limited - wanted) * INTEGRAL_OLD * error < 0.0", [Set("old", "0.0")]))
    return body


def _remembers(k: DigitalController) -> bool:
    """Whether the integral needs a signal of one sample ago."""
    return k.growth[1] != 0.0


def _less_bias(found: dict[str, float]) -> str:
    return "".join(f" - {name}" for name in ("BIAS", "feedforward") if name in found)


def _wanted(found: dict[str, float], integral: str = "") -> Set:
    """Return the statement that sums up what the controller wants."""
    first = "".join(f"{name} + " for name in ("BIAS", "feedforward") if name in found)
    return Set("wanted", first + "action" + (f" + {integral}" if integral else ""))


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


def _targets(body: Sequence[Statement]) -> set[str]:
    """Names that statements assign to."""
    found: set[str] = set()
    for one in body:
        if isinstance(one, Set):
            found.add(one.target)
        elif isinstance(one, If):
            found |= _targets(one.then) | _targets(one.otherwise)
    return found
