"""Code that a digital controller writes: its head, its test vector, and what it is called."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from pidalab.digital import languages
from pidalab.digital.program import INPUTS, MORE, Vector, program

if TYPE_CHECKING:
    from pidalab.digital.controller import DigitalController

STEPS = 30  # samples of the test vector within the working range
FAR = 5  # samples after them on either side of the set point
DOUBLINGS = 24  # of the distance at most
RESERVED = re.compile(  # words of structured text, in which the name stands alone, and of Python as a class
    "a(nd|t|ction)|bool|by|case|config|constant|do|d?int|else|elsif|exit|false|for|from|function|if|l?real|mod|none|not|"
    "of|on|or|program|repeat|return|struct|task|then|to|true|type|until|var|while|with|xor"
)


def identifier(name: str) -> str:
    """Check a name for the code: letters, digits and single underscores, as all three languages allow."""
    allowed = isinstance(name, str) and re.fullmatch(r"[a-z](_?[a-z0-9])*", name)
    if not allowed or RESERVED.fullmatch(name) or name in (*INPUTS, *MORE) or name == "control":
        raise ValueError(
            f"name must be an identifier of small letters, digits and single underscores that begins with a letter "
            f"and is no word of a language, found {name!r}"
        )
    return name


def head(k: DigitalController, margins: Any, note: str) -> list[str]:
    """Return lines that say where the code comes from."""
    units = (
        "" if k.y_span == k.u_span == 1.0 else f", a unit of y in {k.y_span!r} and of u in {k.u_span!r} units"
    )
    lines = [
        "Digital controller, written by pidalab.",
        f"Controller: {k.source or 'not named'}",
        f"Sample time: {k.sample_time!r}, method: {k.method}, anti-windup: {k.anti_windup or 'none'}",
        f"Weights of the set point: b = {k.weights[0]!r}, c = {k.weights[1]!r}",
        f"Limits: {k.limits[0]!r} to {k.limits[1]!r}, rate limit: {k.rate_limit!r}, deadband: {k.deadband!r}",
        f"Working point: u = {k.bias!r}, y = {k.y_offset!r}{units}",
    ]
    lines += [] if k.prefilter is None else [f"Prefilter of the set point: {k.prefilter}"]
    if margins is not None:
        lines += [
            f"Margins: {line}" if i == 0 else f"  {line}" for i, line in enumerate(str(margins).splitlines())
        ]
    if not isinstance(note, str):
        raise TypeError(f"note must be a text, found {type(note).__name__}")
    lines += note.splitlines()
    return [re.sub(r"\*/|\*\)|\"\"\"", "", line) for line in lines]


def vector(k: DigitalController) -> Vector:
    """Return inputs and expected control signals: a set-point jump, a manual spell, a tracked signal, a disturbance.

    Then the measurement goes to either side, as far as takes the control signal over its whole range.
    """
    low, high = k.limits
    # a manual signal within the limits, and another one that acts in between
    span = high - low if math.isfinite(high - low) else 2.0 * k.u_span
    by_hand = round(min(max(k.bias + 0.1 * span, low), high), 6)
    rows: Vector = {name: [] for name in program(k).inputs}
    y = 0.0
    for i in range(STEPS):
        target = 0.0 if i < 2 else 0.2 if i < 24 else -0.1
        y += 0.25 * (target - y) + (0.02 if i == 20 else 0.0)
        values = (k.y_offset + k.y_span * target, k.y_offset + k.y_span * round(y, 4))
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


def _far(k: DigitalController, rows: Vector, size: float) -> Vector:
    """Return the inputs with the measurement far on either side of the set point at the end, in units of the model."""
    usual = {
        "setpoint": k.y_offset,
        "manual_value": rows["manual_value"][0],
        "track_value": rows["track_value"][0],
    }
    longer: Vector = {
        name: values + 2 * FAR * [usual.get(name, type(values[0])(0))] for name, values in rows.items()
    }
    ends = [k.y_offset + side * k.y_span * size for side in (1.0, -1.0) for _ in range(FAR)]
    longer["measurement"] = rows["measurement"] + ends
    return longer


def signals(k: DigitalController, inputs: Sequence[Sequence[Any]]) -> list[float]:
    """Return the control signals of a controller from its start, for a row of each input."""
    states = SimpleNamespace(**program(k).states)
    step = languages.executed(k._code)
    return [step(states, *row) for row in zip(*inputs, strict=True)]


def written(k: DigitalController, language: str, name: str, margins: Any, note: str) -> str:
    """Write the code in one of the languages."""
    return languages.written(program(k), language, head(k, margins, note), vector(k), identifier(name))


def as_json(k: DigitalController, margins: Any, note: str) -> str:
    """Return the controller as JSON; infinite limits are null."""
    content = {
        "about": head(k, margins, note),
        "controller": k.source,
        "sample_time": k.sample_time,
        "method": k.method,
        "anti_windup": k.anti_windup,
        "setpoint_weights": dict(zip("bc", k.weights, strict=True)),
        "limits": [x if math.isfinite(x) else None for x in k.limits],
        "rate_limit": k.rate_limit if math.isfinite(k.rate_limit) else None,
        "deadband": k.deadband,
        "working_point": {"u": k.bias, "y": k.y_offset},
        "feedforward": k.feedforward,
        "tunable": k.tunable,
        "units": {"u": k.u_span, "y": k.y_span},
        "paths": [
            {"name": p.name, "weight": p.weight, "new": p.new, "old": p.old, "gains": p.gains}
            for p in k.paths
        ],
        "prefilter": None if k.prefilter is None else k.prefilter._asdict(),
        "integral": {
            "acts": k.integrates,
            "grows_by": "signal of the paths" if k.from_signal else "error",
            "new": k.growth[0],
            "old": k.growth[1],
            "taken_back": k.taken_back,
            "tracked": k.tracked,
        },
        "coefficients": k.coefficients,
        "test": vector(k),
    }
    return json.dumps(content, indent=2) + "\n"
