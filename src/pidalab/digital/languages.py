"""Statements printed as a language has them, and the function that they become in Python, which is what runs.

The other languages, and what is around a step in each, are in `pidalab.plant.code`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from pidalab.digital.statements import If, Note, Program, Set, Statement

TOKEN = re.compile(r"not |[A-Za-z_]\w*|\d+\.\d+")
USUAL = {"manual": False, "manual_value": 0.0, "tracking": False, "track_value": 0.0}
USUAL |= {"feedforward": 0.0, "retuned": False}


class Language(NamedTuple):
    """How a language writes statements and names; in formats of names ``name`` is that of the controller."""

    # formats of a note, an assignment, a choice, its other branch, and its end where it has one
    statements: tuple[str, ...]
    words: Mapping[str, str]  # that are others than in expressions of a program
    number: Callable[[float], str]
    state: str = "{0}"
    constant: str = "{0}"
    literal: str = "{0}"  # a number within an expression


PYTHON = Language(
    ("# {}", "{} = {}", "if {}:", "else:", ""),
    {"true": "True", "false": "False"},
    number=repr,
    state="self.{0}",
)


def function(program: Program) -> Callable[..., float]:
    """Return the step as a function of an object with the states, which it changes, and of the inputs.

    What runs is text of our own words alone: names come from `chains` and `program`, and constants do not pass through
    text at all. Nothing that a file or a user gave is in it.
    """
    space: dict[str, Any] = {"__builtins__": {}, **program.constants}
    exec(_compiled(method(program, "", notes=False)), space)
    return space["step"]


@lru_cache(maxsize=256)
def _compiled(text: str) -> Any:
    return compile(text, "<step of a digital controller>", "exec")


def method(program: Program, indent: str, notes: bool = True) -> str:
    """Return the step as a method of a class of Python."""
    inputs = ", ".join(f"{x}={USUAL[x]!r}" if x in USUAL else x for x in program.inputs)
    body = statements(program, PYTHON, "", indent + "    ", notes)
    return f"{indent}def step(self, {inputs}):\n{body}\n{indent}    return self.control"


def statements(program: Program, has: Language, name: str, indent: str, notes: bool = True) -> str:
    """Print the statements of a step in a language."""
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
