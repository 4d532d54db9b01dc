"""The languages that a program is printed in: C, structured text and Python.

What differs between statements is in `LANGUAGES`; what is around the step, its test included, in ``templates``.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

from pidalab.digital.languages import PYTHON, Language, method, statements
from pidalab.digital.statements import Program, Vector

WIDTH = 95  # of a line of values
OUTPUTS = ("control", "fault", "at_limit")  # states that others may read
USAGE = (
    "With manual it gives manual_value, within the limits. With tracking it takes track_value for the signal",
    "that acted since the last sample; at the first sample it starts there, without a bump.",
    "A sample with a signal that is no number, or beyond 1e9 on either side, is left out: signal and states stay,",
    "manual still drives the signal, and fault is true. at_limit is true where a limit cuts something off.",
)
FEEDFORWARD = "feedforward is added to the signal, before the limits."
RETUNED = (
    "The gains are variables: write new ones, and call it once with retuned. The signal stays as it is for that",
    "sample, and goes on from there.",
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


def written(program: Program, language: str, head: Sequence[str], vector: Vector, name: str) -> str:
    """Return the file with a program and its test; `name` is a prefix in C, and that of a block or a class."""
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
        kind="".join(word.capitalize() for word in name.split("_")),
        step=step,
    )
    return "\n".join(line.rstrip() for line in text.split("\n"))


def _rows(values: Iterable[str], indent: str) -> str:
    """Wrap values that are separated by commas."""
    return textwrap.fill(", ".join(values), WIDTH, initial_indent=indent, subsequent_indent=indent)
