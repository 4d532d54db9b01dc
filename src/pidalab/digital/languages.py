"""Print the step of a digital controller as statements of a programming language. The Python form can also be run.

The other languages, and the files that contain a step, are in `pidalab.plant.code`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from pidalab.digital.program import If, Note, Program, Set, Statement

TOKEN = re.compile(r"not |[A-Za-z_]\w*|\d+\.\d+")
DEFAULTS = {"manual": False, "manual_value": 0.0, "tracking": False, "track_value": 0.0}
DEFAULTS |= {"feedforward": 0.0, "retuned": False}


class Language(NamedTuple):
    """Formats of a language for statements and names. ``name`` in a format stands for the name of the controller."""

    # formats of a note, an assignment, `if`, `else`, and the end of an `if`
    statements: tuple[str, ...]
    words: Mapping[str, str]  # words of program expressions that are written differently in the language
    number: Callable[[float], str]
    state: str = "{0}"
    constant: str = "{0}"
    literal: str = "{0}"  # format of a number in an expression


PYTHON = Language(
    ("# {}", "{} = {}", "if {}:", "else:", ""),
    {"true": "True", "false": "False"},
    number=repr,
    state="self.{0}",
)


def function(program: Program) -> Callable[..., float]:
    """Return the step as a function of an object and the inputs. The function stores the states in the object.

    The executed text contains nothing from a file or a user. All names come from `program`, and constants are passed as
    values instead of text.
    """
    space: dict[str, Any] = {"__builtins__": {}, **program.constants}
    exec(_compiled(method(program, "", notes=False)), space)
    return space["step"]


@lru_cache(maxsize=256)
def _compiled(text: str) -> Any:
    return compile(text, "<step of a digital controller>", "exec")


def method(program: Program, indent: str, notes: bool = True) -> str:
    """Return the step as a method of a Python class."""
    inputs = ", ".join(f"{x}={DEFAULTS[x]!r}" if x in DEFAULTS else x for x in program.inputs)
    body = statements(program, PYTHON, "", indent + "    ", notes)
    return f"{indent}def step(self, {inputs}):\n{body}\n{indent}    return self.control"


def statements(program: Program, has: Language, name: str, indent: str, notes: bool = True) -> str:
    """Print the statements of a step in a language."""
    note, assign, choice, otherwise, end = has.statements

    def renamed(expression: str) -> str:
        return TOKEN.sub(lambda name_or_number: token(name_or_number[0]), expression)

    def token(name_or_number: str) -> str:
        if name_or_number in has.words:
            return has.words[name_or_number]
        if name_or_number[0].isdigit():
            form = has.literal
        elif name_or_number in program.states:
            form = has.state
        else:
            form = has.constant if name_or_number.isupper() else "{0}"
        return form.format(name_or_number, name=name, upper=name.upper())

    def printed(body: Sequence[Statement], indent: str) -> Iterable[str]:
        for statement in body:
            if isinstance(statement, Note):
                yield from [indent + note.format(statement.text)] * notes
            elif isinstance(statement, Set):
                yield indent + assign.format(renamed(statement.target), renamed(statement.value))
            elif isinstance(statement, If):
                yield indent + choice.format(renamed(statement.condition))
                yield from printed(statement.then, indent + "    ")
                if statement.otherwise:
                    yield indent + otherwise
                    yield from printed(statement.otherwise, indent + "    ")
                if end:
                    yield indent + end

    return "\n".join(printed(program.statements, indent))
