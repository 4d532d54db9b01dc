"""What the languages share: names within expressions, and lists of values on several lines."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from pidalab.digital.program import Program

TOKEN = re.compile(r"[A-Za-z_]\w*|\d+\.\d+")
FEEDFORWARD = "feedforward is added to the signal, before the limits."
RETUNED = (
    "The gains are variables: write new ones, and call it once with retuned. The signal stays as it is for that",
    "sample, and goes on from there.",
)
Namer = Callable[[str], str]


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
