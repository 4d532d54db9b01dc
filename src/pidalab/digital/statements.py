"""Statements, which a program of a step consists of.

Expressions are strings of names, numbers, ``+ - * ( ) < > <= >=``, ``and``, ``or`` and ``not``, which every language
has. All names come from here: those of a controller's parts are made from their places.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple


class Note(NamedTuple):
    """A comment."""

    text: str


class Set(NamedTuple):
    """An assignment."""

    target: str
    value: str


class If(NamedTuple):
    """A choice."""

    condition: str
    then: Sequence[Statement]
    otherwise: Sequence[Statement] = ()


Statement = Note | Set | If
Vector = dict[str, list[bool | float]]  # of a test: a value for each sample, by the name of the signal


class Program(NamedTuple):
    """What a language prints.

    Attributes
    ----------
    constants : dict
        Values by name.
    gains : dict
        Initial values by name of what may be changed while it runs; they are among the states.
    inputs : dict
        Kinds of the inputs, "real" or "bool", by name.
    states : dict
        Initial values by name; the truth value `started` says whether the first sample is past.
    variables : dict
        Kinds of what lives within a step, by name.
    checks : list
        Statements that set `fault` where a signal that the sample needs is no number.
    left_out : list
        Statements for a sample with a fault.
    body : list
        Statements for any other sample.
    """

    constants: dict[str, float]
    gains: dict[str, float]
    inputs: dict[str, str]
    states: dict[str, float | bool]
    variables: dict[str, str]
    checks: list[Statement]
    left_out: list[Statement]
    body: list[Statement]

    @property
    def whole(self) -> list[Statement]:
        """All statements of a step."""
        return [*self.checks, If("fault", self.left_out, self.body)]


def targets(body: Sequence[Statement]) -> Iterator[str]:
    """Names that statements assign to."""
    for one in body:
        if isinstance(one, Set):
            yield one.target
        elif isinstance(one, If):
            yield from targets(one.then)
            yield from targets(one.otherwise)
