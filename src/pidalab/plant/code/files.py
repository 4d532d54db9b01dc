"""Write a digital controller as C, structured text, Python or JSON, with a head and a self-test.

`LANGUAGES` defines how statements are printed in each language. The folder ``templates`` contains all other text.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
import textwrap
from collections.abc import Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from pidalab import _check
from pidalab._text import comment_text, plain_text
from pidalab._version import __version__
from pidalab.digital.languages import PYTHON, Language, function, method, statements
from pidalab.digital.parameters import LARGEST_SIGNAL, Parameters
from pidalab.digital.program import INPUTS, MORE, Vector, constants, program
from pidalab.robustness.margins import Margins

STEPS = 30  # samples of the test vector within the working range
FAR = 5  # further samples far above the set point, and as many far below it
# Largest number of distances that are tried for these samples. Each distance is twice the one before.
DOUBLINGS = 24
INVALID = (12, 15)  # indices of samples with an invalid measurement, the first of them in manual mode
INVALID_MEASUREMENT = 1e30  # above LARGEST_SIGNAL, but finite even in single precision
HEAD_WIDTH, VALUES_WIDTH = 105, 95  # largest number of characters in a line
MOST_NOTES, LONGEST_NOTE = 40, 500  # largest number of lines of a note, and of characters in a line
PRECISIONS = ("double", "single")
LONGEST_NAME = 32  # compilers may ignore further characters of a name
# Keywords of the three languages, and names of their libraries and of PLC software, in small letters. Structured text
# ignores case, so a variable named like a library block ("integral") would not compile.
RESERVED = frozenset(
    re.sub("#.*", "", Path(__file__).with_name("reserved.txt").read_text(encoding="utf-8")).split()
)
# This matches conversions such as REAL_TO_INT, and typed functions such as ADD_REAL.
FAMILIES = re.compile(
    r"[a-z]+[0-9]*(_bcd)?_to_[a-z0-9_]+|(abs|add|div|eq|expt?|g[et]|l[et]|mul|ne|sub|limit|max|min|mux|sel|move|trunc|"
    r"sqrt|ln|log|a?sin|a?cos|a?tan|and|x?or|not|mod|ct[ud]{1,2})_[a-z]+"
)
OWN = frozenset(("tested", "worst", "off", "k", "s", "state", "reset", "selftest"))  # names in the self-tests


def _number_of_structured_text(value: float) -> str:
    """Write a number with digits on both sides of the decimal point, as IEC 61131-3 requires."""
    mantissa, _, exponent = repr(value).upper().partition("E")
    if not exponent or isinstance(value, bool):
        return repr(value).upper()
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}E{int(exponent)}"


LANGUAGES = {
    "c": Language(
        ("/* {} */", "{} = {};", "if ({}) {{", "} else {", "}"),
        {"and": "&&", "or": "||", "not ": "!"},
        number=lambda value: repr(value).lower(),
        state="s->{0}",
        constant="{upper}_{0}",
        literal="({name}_real){0}",
    ),
    "structured_text": Language(
        ("(* {} *)", "{} := {};", "IF {} THEN", "ELSE", "END_IF;"),
        {"and": "AND", "or": "OR", "not ": "NOT ", "true": "TRUE", "false": "FALSE"},
        number=_number_of_structured_text,
    ),
    "python": PYTHON,
}


def identifier(name: str, taken: Iterable[str] = ()) -> str:
    """Check that a name consists of letters, digits and single underscores, as all three languages require.

    Parameters
    ----------
    name : str
        Name of a controller, in small letters.
    taken : iterable of str, optional
        Further names that occur in the code.

    Returns
    -------
    str
        The name.

    Raises
    ------
    ValueError
        If the name is not an identifier, is a reserved word or occurs in `taken`.

    Examples
    --------
    >>> from pidalab.plant.code.files import identifier
    >>> identifier("level_2")
    'level_2'
    """
    plain = isinstance(name, str) and re.fullmatch(r"[a-z](_?[a-z0-9])*", name) and len(name) <= LONGEST_NAME
    if plain:
        capitals = "".join(word.capitalize() for word in name.split("_"))  # name of the class in Python
        reserved = name in RESERVED | OWN or FAMILIES.fullmatch(name) or name.startswith("test_")
        if not reserved and {name, capitals}.isdisjoint(taken):
            return name
    raise ValueError(
        "name must be an identifier of small letters, digits and single underscores that begins with a letter, has at "
        f"most {LONGEST_NAME} characters and is not a word of a language, a library or this code, found {name!r:.60}"
    )


def head(
    k: Parameters,
    *,
    margins: Margins | None = None,
    note: str = "",
    time_unit: str = "",
    record: str = "",
    date: str = "",
) -> list[str]:
    """Return the lines at the head of the code. Unusual characters of the given texts are removed."""
    for name, text in {"note": note, "time_unit": time_unit, "record": record, "date": date}.items():
        if not isinstance(text, str):
            raise TypeError(f"{name} must be a text, found {type(text).__name__}")
    unit = f" {plain_text(time_unit, 20)}" if time_unit else ", in the same time unit as the parameters"
    recorded = f", recorded {comment_text(date, 40)}" if date else ""
    low, high, rate = (f"{x!r}" if math.isfinite(x) else "none" for x in (*k.limits, k.rate_limit))
    lines = [
        f"Digital controller, written by pidalab {plain_text(__version__)}.",
        f"Record: {plain_text(record) or 'not named'}{recorded}",
        f"Controller: {comment_text(k.source, LONGEST_NOTE) or 'not named'}",
        f"Sample time: {k.sample_time!r}{unit}",
        f"Method: {k.method}, anti-windup: {k.anti_windup or 'none'}",
        f"Set-point weights: b = {k.weights[0]!r}, c = {k.weights[1]!r}",
        f"Lower limit: {low}, upper limit: {high}, rate limit: {rate}, deadband: {k.deadband!r}",
        f"Working point: u = {k.bias!r}, y = {k.y_offset!r}",
    ]
    if k.prefilter is not None:
        lines.append(f"Set-point prefilter: {k.prefilter}")
    if margins is not None:
        lines.append(_margins(margins))
    notes = note.splitlines()
    lines += [comment_text(line, LONGEST_NOTE) for line in notes[:MOST_NOTES]]
    lines += [f"and {len(notes) - MOST_NOTES} more lines"] if len(notes) > MOST_NOTES else []
    wrapped = (textwrap.wrap(line, HEAD_WIDTH, subsequent_indent="  ") for line in lines if line)
    return [part for parts in wrapped for part in parts]


def _margins(margins: Margins) -> str:
    if not isinstance(margins, Margins):
        raise TypeError(f"margins must be Margins of a loop, found {type(margins).__name__}")
    if math.isnan(margins.ms):
        return "Margins: the closed loop is unstable"
    ms, gain, phase, delay = (f"{x:.4g}" for x in (margins.ms, margins.gm, margins.pm, margins.dm))
    return f"Margins: Ms = {ms}, gain margin {gain}, phase margin {phase} deg, delay margin {delay}"


def vector(k: Parameters) -> Vector:
    """Return test inputs and the expected control signal.

    The inputs contain set-point steps, manual mode, a tracked signal, a disturbance and two invalid measurements. At
    the end the measurement is first far above and then far below the set point, so that the control signal reaches both
    limits.
    """
    low, high = k.limits
    span = high - low if math.isfinite(high - low) else 2.0
    by_hand = round(min(max(k.bias + 0.1 * span, low), high), 6)
    rest: dict[str, Any] = {"setpoint": k.y_offset, "manual": False, "tracking": False, "retuned": False}
    rest |= {"manual_value": by_hand, "track_value": by_hand, "feedforward": 0.0}
    samples, y = [], 0.0
    for i in range(STEPS):
        target = 0.0 if i < 2 else 0.2 if i < 24 else -0.1
        y += 0.25 * (target - y) + (0.02 if i == 20 else 0.0)
        measured = INVALID_MEASUREMENT if i in INVALID else k.y_offset + round(y, 4)
        events = {"manual": 10 <= i < 13, "tracking": i == 17, "retuned": i == 26, "measurement": measured}
        forward = round(0.05 * span, 6) if 5 <= i < 8 else 0.0
        samples.append({**rest, **events, "feedforward": forward, "setpoint": k.y_offset + target})
    code, step = program(k), function(program(k))
    for doublings in range(DOUBLINGS):
        ends = [k.y_offset + side * 0.25 * 2**doublings for side in (1.0, -1.0) for _ in range(FAR)]
        rows = [*samples, *({**rest, "measurement": end} for end in ends)]
        inputs = {name: [row[name] for row in rows] for name in code.inputs}
        states = SimpleNamespace(**code.states)
        control = [step(states, *row) for row in zip(*inputs.values(), strict=True)]
        if all(not math.isfinite(end) or end in control for end in k.limits):
            break
    return {**inputs, "control": control}


def written(k: Parameters, language: str, name: str, *, precision: str = "double", **about: Any) -> str:
    """Write the code in one language. `name` is the name of the block or class, or in C the prefix of all names."""
    import jinja2

    _check.choice("precision", precision, PRECISIONS)
    code = program(k)
    taken = {*code.constants, *code.gains, *INPUTS, *MORE, *code.states, *code.variables, "TEST", "control"}
    name, has = identifier(name, taken), LANGUAGES[language]
    loader = jinja2.PackageLoader("pidalab.plant.code")
    environment = jinja2.Environment(loader=loader, trim_blocks=True, keep_trailing_newline=True)
    environment.filters |= {"number": has.number, "rows": _rows}
    step = method(code, "    ") if language == "python" else statements(code, has, name, "    ")
    text = environment.get_template(f"{language}.j2").render(
        program=code,
        head=head(k, **about),
        usual=[(x, value) for x, value in code.states.items() if x not in code.gains],
        vector=vector(k),
        name=name,
        precision=precision,
        step=step,
    )
    return "\n".join(line.rstrip() for line in text.split("\n"))


def _rows(values: Iterable[str], indent: str) -> str:
    return textwrap.fill(", ".join(values), VALUES_WIDTH, initial_indent=indent, subsequent_indent=indent)


def as_json(k: Parameters, **about: Any) -> str:
    """Return the controller as JSON, in which infinite limits are null."""
    stored = {"about": head(k, **about), "version": __version__, **content(k)}
    return json.dumps({**stored, "checksum": checksum(stored)}, indent=2) + "\n"


def content(k: Parameters) -> dict[str, Any]:
    """Return the fields of the JSON: parameters, coefficients and test vector."""
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
        "paths": [path._asdict() for path in k.paths],
        "prefilter": None if k.prefilter is None else k.prefilter._asdict(),
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


def checksum(stored: dict[str, Any]) -> str:
    """Return a checksum of the fields. It does not depend on the order of the fields or on the format of numbers.

    The checksum does not protect against deliberate changes.
    """
    fields = {name: value for name, value in stored.items() if name != "checksum"}
    return hashlib.sha256(canonical(fields).encode()).hexdigest()


def canonical(value: Any) -> str:
    """Return compact JSON of a value, with sorted fields and all numbers as floats."""
    return json.dumps(_plain(value), sort_keys=True, separators=(",", ":"))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(x) for name, x in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(x) for x in value]
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return _check.real("number", value) if number else value
