"""What the languages share: statements, names within expressions, and lists of values on several lines."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

from pidalab.digital.program import If, Note, Program, Set, Statement

TOKEN = re.compile(r"[A-Za-z_]\w*|\d+\.\d+")
FEEDFORWARD = "feedforward is added to the signal, before the limits."
RETUNED = (
    "The gains are variables: write new ones, and call it once with retuned. The signal stays as it is for that",
    "sample, and goes on from there.",
)
Namer = Callable[[str], str]


class Syntax(NamedTuple):
    """How a language writes statements: formats, and a line that closes a choice, if there is one."""

    note: str
    assign: str
    choice: str
    otherwise: str
    end: str


def statements(body: Sequence[Statement], syntax: Syntax, namer: Namer, indent: str) -> list[str]:
    """Print statements, with names as the language has them."""
    lines: list[str] = []
    for one in body:
        if isinstance(one, Note):
            lines.append(indent + syntax.note.format(one.text))
        elif isinstance(one, Set):
            lines.append(indent + syntax.assign.format(namer(one.target), renamed(one.value, namer)))
        elif isinstance(one, If):
            lines.append(indent + syntax.choice.format(renamed(one.condition, namer)))
            lines += statements(one.then, syntax, namer, indent + "    ")
            if one.otherwise:
                lines.append(indent + syntax.otherwise)
                lines += statements(one.otherwise, syntax, namer, indent + "    ")
            lines += [indent + syntax.end] if syntax.end else []
    return lines


def renamed(expression: str, namer: Namer) -> str:
    return TOKEN.sub(lambda found: namer(found[0]), expression)


def more(program: Program) -> list[str]:
    """Lines of the head about inputs that were asked for."""
    return [FEEDFORWARD] * ("feedforward" in program.inputs) + [*RETUNED] * bool(program.gains)


def rows(values: Sequence[str], indent: str, width: int = 96) -> list[str]:
    """Wrap values that are separated by commas."""
    lines, line = [], indent
    for i, value in enumerate(values):
        piece = value + (", " if i + 1 < len(values) else "")
        if len(line) + len(piece) > width and line != indent:
            lines.append(line.rstrip())
            line = indent
        line += piece
    return [*lines, line.rstrip()]
