"""The languages that a program is printed in, and the function that it becomes in Python.

What differs between statements is in `LANGUAGES`; what is around the step, its test included, in ``templates``.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from pidalab.digital.program import If, Note, Program, Set, Statement, Vector

TOKEN = re.compile(r"not |[A-Za-z_]\w*|\d+\.\d+")
WIDTH = 95  # of a line of values
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
        further=further,
        vector=vector,
        name=name,
        upper=name.upper(),
        real=f"{name}_real",
        kind="".join(word.capitalize() for word in name.split("_")),
        step=step,
    )
    return "\n".join(line.rstrip() for line in text.split("\n"))


def step(program: Program) -> str:
    """Return the constants and the step as a function of Python."""
    constants = (f"{name} = {value!r}" for name, value in program.constants.items())
    return "\n".join([*constants, _method(program, "")])


@lru_cache(maxsize=256)
def executed(code: str) -> Callable[..., float]:
    """Return the function of `step`: of an object with the states, which it changes, and of the inputs."""
    space: dict[str, Any] = {}
    exec(code, space)
    return space["step"]


def _method(program: Program, indent: str) -> str:
    """Return the step as a method of a class of Python."""
    inputs = ", ".join(f"{x}={USUAL[x]!r}" if x in USUAL else x for x in program.inputs)
    body = _statements(program, "python", "", indent + "    ")
    return f"{indent}def step(self, {inputs}):\n{body}\n{indent}    return self.control"


def _statements(program: Program, language: str, name: str, indent: str) -> str:
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
                yield indent + note.format(one.text)
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

    return "\n".join(printed(program.body, indent))


def _rows(values: Iterable[str], indent: str) -> str:
    """Wrap values that are separated by commas."""
    return textwrap.fill(", ".join(values), WIDTH, initial_indent=indent, subsequent_indent=indent)
