"""The step of a digital controller as operations on numbers, which a compiled loop carries out.

`pidalab.digital.program` describes the step, and C, structured text and Python are printed from it. Here it becomes a
list of operations in the same order, so that the simulation gives the same bits as the written code. There are no
jumps: what an ``if`` guards is computed in any case, and takes effect where its condition holds. So one list serves one
loop, and many loops side by side.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.digital.program import If, Program, Set, Statement

# places of the signals of the controller, and of what a block outside the program makes of the error
SETPOINT, MEASUREMENT, CONTROL, ACTION = range(4)
SIGNALS = ("setpoint", "measurement", "control", "action")
# target = left + right, and so on; COPY: target = left; CHOOSE: target = left if right is not 0
ADD, SUBTRACT, MULTIPLY, LESS, GREATER, COPY, CHOOSE = range(7)
KINDS: dict[type, int] = {
    ast.Add: ADD,
    ast.Sub: SUBTRACT,
    ast.Mult: MULTIPLY,
    ast.Lt: LESS,
    ast.Gt: GREATER,
    ast.And: MULTIPLY,
    ast.Or: ADD,  # of conditions that exclude each other
}


class Operations(NamedTuple):
    """A step as operations."""

    code: np.ndarray  # intp, (operations, 4): kind, and the places of target, left and right
    places: dict[str, int]  # by name, `SIGNALS` first
    numbers: Array  # (places,), constants and states; 0 for variables


def operations(program: Program, states: Mapping[str, float]) -> Operations:
    """Turn the statements of a program that has started, in automatic mode, into operations."""
    known = {
        "started": True,
        "manual": False,
        "tracking": False,
        "retuned": False,
        "true": True,
        "false": False,
    }
    values = {
        **dict.fromkeys(SIGNALS, 0.0),
        **program.constants,
        **states,
        "feedforward": 0.0,
        "zero": 0.0,
        "one": 1.0,
    }
    compiler = _Compiler(known, {name: k for k, name in enumerate(values)})
    compiler.statements(program.body, None)
    numbers = np.zeros(len(compiler.places))
    numbers[: len(values)] = list(values.values())
    for text in compiler.literals:
        numbers[compiler.places[text]] = float(text)
    return Operations(np.array(compiler.code, np.intp).reshape(-1, 4), compiler.places, numbers)


class _Compiler:
    """Operations as they are made: what is known to be true or false, and the place of each name."""

    def __init__(self, known: dict[str, bool], places: dict[str, int]) -> None:
        self.known, self.places = known, places
        self.code: list[tuple[int, int, int, int]] = []
        self.literals: list[str] = []
        self.masks = 0  # conditions that hold at present

    def statements(self, body: Sequence[Statement], mask: int | None) -> None:
        for one in body:
            if isinstance(one, Set):
                self.assign(one, mask)
            elif isinstance(one, If):
                condition = self.value(ast.parse(one.condition, mode="eval").body, self.masks)
                if isinstance(condition, bool):
                    self.statements(one.then if condition else one.otherwise, mask)
                else:
                    self.choice(one, condition, mask)

    def choice(self, one: If, condition: int, mask: int | None) -> None:
        """Both branches, each where its condition holds."""
        depth = self.masks
        own = condition if mask is None else self.emit(MULTIPLY, mask, condition, depth)
        other = self.emit(SUBTRACT, self.places["one"] if mask is None else mask, own, depth + 1)
        self.masks += 2
        self.statements(one.then, own)
        self.statements(one.otherwise, other)
        self.masks = depth

    def assign(self, one: Set, mask: int | None) -> None:
        value = self.value(ast.parse(one.value, mode="eval").body, self.masks)
        if isinstance(value, bool):
            self.known[one.target] = value
        elif mask is not None:
            self.code.append((CHOOSE, self.place(one.target), value, mask))
        elif self.code and value == self.place(f" {self.masks}") and self.code[-1][1] == value:
            self.code[-1] = (self.code[-1][0], self.place(one.target), *self.code[-1][2:])
        else:
            self.code.append((COPY, self.place(one.target), value, value))

    def value(self, node: ast.expr, free: int) -> int | bool:
        """Return the place of an expression, or whether it is true; intermediate results are at `free` and behind."""
        match node:
            case ast.Name(id=name):
                return self.known[name] if name in self.known else self.places[name]
            case ast.Constant(value=value):
                self.literals.append(repr(value))
                return self.place(repr(value))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return self.emit(SUBTRACT, self.places["zero"], self.value(operand, free), free)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return not self.value(operand, free)
            case ast.BoolOp(op=op, values=[left, right]):
                pair = self.value(left, free), self.value(right, free + 1)
                if isinstance(pair[0], bool):
                    return pair[1] if pair[0] == isinstance(op, ast.And) else pair[0]
            case (
                ast.Compare(left=left, ops=[op], comparators=[right])
                | ast.BinOp(left=left, op=op, right=right)
            ):
                pair = self.value(left, free), self.value(right, free + 1)
            case _:
                raise TypeError(f"a step has no such expression: {ast.unparse(node)}")
        return self.emit(KINDS[type(op)], *pair, free)

    def emit(self, kind: int, left: int, right: int, free: int) -> int:
        target = self.place(f" {free}")
        self.code.append((kind, target, left, right))
        return target

    def place(self, name: str) -> int:
        return self.places.setdefault(name, len(self.places))
