"""The languages that a program is printed in: C, structured text and Python.

What differs between statements is in `LANGUAGES`; what is around the step, its test included, in ``templates``.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

from pidalab.digital.languages import PYTHON, Language, method, statements
from pidalab.digital.program import Program, Vector

WIDTH = 95  # of a line of values
OUTPUTS = ("control", "fault", "at_limit")  # states that others may read
PRECISIONS = ("double", "single")
USAGE = (
    "With manual, the control signal is manual_value, within the limits.",
    "With tracking, track_value is the signal that acted since the last sample in place of the control signal.",
    "At the first sample the controller starts from track_value, without a bump.",
    "A sample with an input that is NaN, infinite or beyond 1e9 in size is skipped: fault is true, and the control",
    "signal and all states keep their values. Manual mode works all the same.",
    "at_limit is true while a limit cuts off a part of the control signal.",
)
FEEDFORWARD = "feedforward is added to the control signal, before the limits."
RETUNED = (
    "The gains are variables. To change them, write the new values and set retuned for one call. The control signal",
    "keeps its value in that sample and continues from there.",
)


def _number_of_structured_text(value: float) -> str:
    """Write a number with digits on both sides of the point, which the standard asks for."""
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


def written(
    program: Program, language: str, head: Sequence[str], vector: Vector, name: str, precision: str
) -> str:
    """Return the file with a program and its self-test; `name` is the prefix in C, or names the block or class."""
    import jinja2

    has = LANGUAGES[language]
    loader = jinja2.PackageLoader("pidalab.plant.code")
    environment = jinja2.Environment(loader=loader, trim_blocks=True, keep_trailing_newline=True)
    environment.filters |= {"number": has.number, "rows": _rows}
    further = [FEEDFORWARD] * ("feedforward" in program.inputs) + [*RETUNED] * bool(program.gains)
    step = method(program, "    ") if language == "python" else statements(program, has, name, "    ")
    text = environment.get_template(f"{language}.j2").render(
        program=program,
        head=head,
        usage=USAGE,
        further=further,
        usual=[(x, value) for x, value in program.states.items() if x not in program.gains],
        outputs=OUTPUTS,
        vector=vector,
        name=name,
        upper=name.upper(),
        real=f"{name}_real",
        types=("float", "double") if precision == "single" else ("double", "float"),
        kind="".join(word.capitalize() for word in name.split("_")),
        step=step,
    )
    return "\n".join(line.rstrip() for line in text.split("\n"))


def _rows(values: Iterable[str], indent: str) -> str:
    """Wrap values that are separated by commas."""
    return textwrap.fill(", ".join(values), WIDTH, initial_indent=indent, subsequent_indent=indent)
