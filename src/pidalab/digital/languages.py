"""The languages that a program is printed in, and the function that it becomes in Python.

What differs between statements is in `LANGUAGES`; what is around the step, its test included, in ``templates``.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from pidalab.digital.statements import If, Note, Program, Set, Statement, Vector

TOKEN = re.compile(r"not |[A-Za-z_]\w*|\d+\.\d+")
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
USUAL = {"manual": False, "manual_value": 0.0, "tracking": False, "track_value": 0.0}
USUAL |= {"feedforward": 0.0, "retuned": False}


def _number_of_structured_text(value: float) -> str:
    """Write a number with digits on both sides of the point, which the standard asks for."""
    mantissa, _, exponent = repr(value).upper().partition("E")
    if not exponent or isinstance(value, bool):
        return repr(value).upper()
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}E{int(exponent)}"


class Language(NamedTuple):
    """How a language writes statements and names; in formats of names ``name`` is that of the controller."""

    # formats of a note, an assignment, a choice, its other branch, and its end where it has one
    statements: tuple[str, ...]
    words: Mapping[str, str]  # that are others than in expressions of a program
    number: Callable[[float], str]
    state: str = "{0}"
    constant: str = "{0}"
    literal: str = "{0}"  # a number within an expression


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
    "python": Language(
        ("# {}", "{} = {}", "if {}:", "else:", ""),
        {"true": "True", "false": "False"},
        number=repr,
        state="self.{0}",
    ),
}


def written(program: Program, language: str, head: Sequence[str], vector: Vector, name: str) -> str:
    """Return the file with a program and its test; `name` is a prefix in C, and that of a block or a class."""
    import jinja2

    number = LANGUAGES[language].number
    loader = jinja2.PackageLoader("pidalab.digital")
    environment = jinja2.Environment(loader=loader, trim_blocks=True, keep_trailing_newline=True)
    environment.filters |= {"number": number, "rows": _rows}
    further = [FEEDFORWARD] * ("feedforward" in program.inputs) + [*RETUNED] * bool(program.gains)
    step = _method(program, "    ") if language == "python" else _statements(program, language, name, "    ")
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


def function(program: Program) -> Callable[..., float]:
    """Return the step as a function of an object with the states, which it changes, and of the inputs.

    What runs is text of our own words alone: names come from `chains` and `program`, and constants do not pass through
    text at all. Nothing that a file or a user gave is in it.
    """
    space: dict[str, Any] = {"__builtins__": {}, **program.constants}
    exec(_compiled(_method(program, "", notes=False)), space)
    made: Callable[..., float] = space["step"]
    return made


@lru_cache(maxsize=256)
def _compiled(text: str) -> Any:
    return compile(text, "<step of a digital controller>", "exec")


def _method(program: Program, indent: str, notes: bool = True) -> str:
    """Return the step as a method of a class of Python."""
    inputs = ", ".join(f"{x}={USUAL[x]!r}" if x in USUAL else x for x in program.inputs)
    body = _statements(program, "python", "", indent + "    ", notes)
    return f"{indent}def step(self, {inputs}):\n{body}\n{indent}    return self.control"


def _statements(program: Program, language: str, name: str, indent: str, notes: bool = True) -> str:
    """Print the statements of a step."""
    has = LANGUAGES[language]
    note, assign, choice, otherwise, end = has.statements

    def renamed(expression: str) -> str:
        return TOKEN.sub(lambda found: token(found[0]), expression)

    def token(found: str) -> str:
        if found in has.words:
            return has.words[found]
        if found[0].isdigit():
            form = has.literal
        elif found in program.states:
            form = has.state
        else:
            form = has.constant if found.isupper() else "{0}"
        return form.format(found, name=name, upper=name.upper())

    def printed(body: Sequence[Statement], indent: str) -> Iterable[str]:
        for one in body:
            if isinstance(one, Note):
                yield from [indent + note.format(one.text)] * notes
            elif isinstance(one, Set):
                yield indent + assign.format(renamed(one.target), renamed(one.value))
            elif isinstance(one, If):
                yield indent + choice.format(renamed(one.condition))
                yield from printed(one.then, indent + "    ")
                if one.otherwise:
                    yield indent + otherwise
                    yield from printed(one.otherwise, indent + "    ")
                if end:
                    yield indent + end

    return "\n".join(printed(program.whole, indent))


def _rows(values: Iterable[str], indent: str) -> str:
    """Wrap values that are separated by commas."""
    return textwrap.fill(", ".join(values), WIDTH, initial_indent=indent, subsequent_indent=indent)
