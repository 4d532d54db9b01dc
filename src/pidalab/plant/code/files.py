"""Code that a digital controller writes: its head, its test vector, and its JSON."""

from __future__ import annotations

import hashlib
import json
import math
import textwrap
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

from pidalab import _check
from pidalab._text import comment_text, plain_text
from pidalab._version import __version__
from pidalab.digital.languages import function
from pidalab.digital.parameters import LARGEST_SIGNAL, Parameters
from pidalab.digital.program import INPUTS, MORE, Vector, constants, program
from pidalab.plant.code import languages
from pidalab.plant.code.words import identifier

STEPS = 30  # samples of the test vector within the working range
FAR = 5  # samples after them on either side of the set point
DOUBLINGS = 24  # of the distance at most
LEFT_OUT = (12, 15)  # samples whose measurement is no measurement, by hand and not
NO_MEASUREMENT = 1e30  # single precision has it, too
HEAD_WIDTH = 105  # characters of a line of the head
MOST_NOTES, LONGEST_NOTE = 40, 500  # lines of a note and their characters


def head(
    k: Parameters,
    *,
    margins: Any = None,
    note: str = "",
    time_unit: str = "",
    record: str = "",
    date: str = "",
) -> list[str]:
    """Return lines that say where the code comes from; text from outside is filtered."""
    given = {"note": note, "time_unit": time_unit, "record": record, "date": date}
    for name, text in given.items():
        if not isinstance(text, str):
            raise TypeError(f"{name} must be a text, found {type(text).__name__}")
    unit = (
        f" {plain_text(time_unit, 20)}" if time_unit else ", in the time unit of the controller's parameters"
    )
    origin = [plain_text(record) or "not named", *([f"recorded {comment_text(date, 40)}"] if date else [])]
    low, high = (f"{x!r}" if math.isfinite(x) else "none" for x in k.limits)
    lines = [
        f"Digital controller, written by pidalab {plain_text(__version__)}.",
        f"Record: {', '.join(origin)}",
        f"Controller: {comment_text(k.source, LONGEST_NOTE) or 'not named'}",
        f"Sample time: {k.sample_time!r}{unit}",
        f"Method: {k.method}, anti-windup: {k.anti_windup or 'none'}",
        f"Set-point weights: b = {k.weights[0]!r}, c = {k.weights[1]!r}",
        f"Lower limit: {low}, upper limit: {high}, rate limit: "
        f"{repr(k.rate_limit) if math.isfinite(k.rate_limit) else 'none'}, deadband: {k.deadband!r}",
        f"Working point: u = {k.bias!r}, y = {k.y_offset!r}",
    ]
    if k.prefilter is not None:
        lines.append(f"Set-point prefilter: {k.prefilter}")
    lines += [] if margins is None else [_margins(margins)]
    notes = note.splitlines()
    lines += [comment_text(line, LONGEST_NOTE) for line in notes[:MOST_NOTES]]
    lines += [f"and {len(notes) - MOST_NOTES} more lines"] if len(notes) > MOST_NOTES else []
    return [
        part for line in lines if line for part in textwrap.wrap(line, HEAD_WIDTH, subsequent_indent="  ")
    ]


def _margins(margins: Any) -> str:
    """Return a line with the margins, made of their numbers alone."""
    try:
        ms, gain, phase, delay = (float(getattr(margins, name)) for name in ("ms", "gm", "pm", "dm"))
    except (AttributeError, TypeError, ValueError):
        raise TypeError(f"margins must be Margins of a loop, found {type(margins).__name__}") from None
    if math.isnan(ms):
        return "Margins: the closed loop is unstable"
    return f"Margins: Ms = {ms:.4g}, gain margin {gain:.4g}, phase margin {phase:.4g} deg, delay margin {delay:.4g}"


def vector(k: Parameters) -> Vector:
    """Return inputs and expected control signals: a set-point jump, a manual spell, a tracked signal, a disturbance.

    Two measurements lie beyond what counts as one. Then the measurement goes to either side, as far as takes the
    control signal over its whole range.
    """
    low, high = k.limits
    # a manual signal within the limits, and another one that acts in between
    span = high - low if math.isfinite(high - low) else 2.0
    by_hand = round(min(max(k.bias + 0.1 * span, low), high), 6)
    rows: Vector = {name: [] for name in program(k).inputs}
    y = 0.0
    for i in range(STEPS):
        target = 0.0 if i < 2 else 0.2 if i < 24 else -0.1
        y += 0.25 * (target - y) + (0.02 if i == 20 else 0.0)
        measured = NO_MEASUREMENT if i in LEFT_OUT else k.y_offset + round(y, 4)
        values = (k.y_offset + target, measured)
        more = {"feedforward": round(0.05 * span, 6) if 5 <= i < 8 else 0.0, "retuned": i == 26}
        further = [more[name] for name in rows if name in more]
        for name, value in zip(
            rows, (*values, 10 <= i < 13, by_hand, i == 17, by_hand, *further), strict=True
        ):
            rows[name].append(value)
    size = 0.25
    for _ in range(DOUBLINGS):
        far = _far(k, rows, size)
        control = signals(k, [*far.values()])
        reached = [not math.isfinite(end) or end in control for end in k.limits]
        if all(reached):
            break
        size *= 2.0
    return {**far, "control": control}


def _far(k: Parameters, rows: Vector, size: float) -> Vector:
    """Return the inputs with the measurement far on either side of the set point at the end, in units of the model."""
    usual = {
        "setpoint": k.y_offset,
        "manual_value": rows["manual_value"][0],
        "track_value": rows["track_value"][0],
    }
    longer: Vector = {
        name: values + 2 * FAR * [usual.get(name, type(values[0])(0))] for name, values in rows.items()
    }
    ends = [k.y_offset + side * size for side in (1.0, -1.0) for _ in range(FAR)]
    longer["measurement"] = rows["measurement"] + ends
    return longer


def signals(k: Parameters, inputs: Sequence[Sequence[Any]]) -> list[float]:
    """Return the control signals of a controller from its start, for a row of each input."""
    own = program(k)
    states, step = SimpleNamespace(**own.states), function(own)
    return [step(states, *row) for row in zip(*inputs, strict=True)]


def written(k: Parameters, language: str, name: str, *, precision: str = "double", **about: Any) -> str:
    """Write the code in one of the languages."""
    _check.choice("precision", precision, languages.PRECISIONS)
    own = program(k)
    taken = {*own.constants, *own.gains, *INPUTS, *MORE, *own.states, *own.variables, "TEST", "control"}
    lines = head(k, **about)
    return languages.written(own, language, lines, vector(k), identifier(name, taken), precision)


def as_json(k: Parameters, **about: Any) -> str:
    """Return the controller as JSON; infinite limits are null."""
    stored = {"about": head(k, **about), "version": __version__, **content(k)}
    return json.dumps({**stored, "checksum": checksum(stored)}, indent=2) + "\n"


def content(k: Parameters) -> dict[str, Any]:
    """Return what makes the controller, with its coefficients and its test vector, as JSON has it."""
    return {
        "controller": k.source,
        "sample_time": k.sample_time,
        "method": k.method,
        "anti_windup": k.anti_windup,
        "setpoint_weights": dict(zip("bc", k.weights, strict=True)),
        "limits": [x if math.isfinite(x) else None for x in k.limits],
        "rate_limit": k.rate_limit if math.isfinite(k.rate_limit) else None,
        "deadband": k.deadband,
        "working_point": {"u": k.bias, "y": k.y_offset},
        "largest_signal": LARGEST_SIGNAL,
        "feedforward": k.feedforward,
        "tunable": k.tunable,
        "paths": [
            {
                "name": p.name,
                "weight": p.weight,
                "new": list(p.new),
                "old": list(p.old),
                "gains": list(p.gains),
            }
            for p in k.paths
        ],
        "prefilter": None if k.prefilter is None else _lists(k.prefilter._asdict()),
        "integral": {
            "acts": k.integrates,
            "grows_by": "signal of the paths" if k.from_signal else "error",
            "new": k.growth[0],
            "old": k.growth[1],
            "back_calculation_gain": k.back_calculation_gain,
            "tracking_gain": k.tracking_gain,
        },
        "coefficients": constants(k),
        "test": vector(k),
    }


def _lists(value: Any) -> Any:
    """Return lists for tuples."""
    if isinstance(value, dict):
        return {name: _lists(x) for name, x in value.items()}
    return [_lists(x) for x in value] if isinstance(value, (tuple, list)) else value


def checksum(stored: dict[str, Any]) -> str:
    """Return a sum over what a JSON says, whatever the order of its names and the way its numbers are written.

    It is no secret: it finds what was changed by hand or by accident, in fields that the test vector cannot see.
    """
    text = json.dumps(_plain(stored), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _plain(value: Any) -> Any:
    """Return a value with all numbers as floats."""
    if isinstance(value, dict):
        return {name: _plain(x) for name, x in value.items() if name != "checksum"}
    if isinstance(value, list):
        return [_plain(x) for x in value]
    return (
        _check.real("number", value)
        if isinstance(value, (int, float)) and not isinstance(value, bool)
        else value
    )
