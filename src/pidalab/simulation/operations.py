"""The step of a digital controller as operations on numbers, which a compiled loop carries out.

`pidalab.digital.program` describes the step, and C, structured text and Python are printed from it. Here it becomes a
list of operations in the same order, so that the simulation gives the same bits as the written code. There are no
jumps: what an ``if`` guards is computed in any case, and takes effect where its condition holds. So one list serves one
loop, and many loops side by side.
"""

from __future__ import annotations

import ast
import threading
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.digital.program import If, Program, Set, Statement

# places of the signals of the controller, and of what a block outside the program makes of the error
SETPOINT, MEASUREMENT, CONTROL, SUMMED = range(4)
SIGNALS = ("setpoint", "measurement", "control", "summed")
# target = left + right, and so on; COPY: target = left; CHOOSE: target = left if right is not 0
ADD, SUBTRACT, MULTIPLY, LESS, GREATER, COPY, CHOOSE = range(7)
OPERATION_CODES: dict[type, int] = {
    ast.Add: ADD,
    ast.Sub: SUBTRACT,
    ast.Mult: MULTIPLY,
    ast.Lt: LESS,
    ast.Gt: GREATER,
    ast.And: MULTIPLY,
    ast.Or: ADD,  # of conditions that exclude each other
}
FOR_OTHERS = ("at_limit",)  # what a step tells and does not use
PARSING = threading.Lock()  # Python 3.11 counts the depth of a syntax tree for all threads together


class Operations(NamedTuple):
    """A step as operations."""

    code: np.ndarray  # intp, (operations, 4): kind, and the places of target, left and right
    places: dict[str, int]  # of signals, constants and states, `SIGNALS` first
    numbers: Array  # their values, and room for what is computed in a step


def operations(program: Program, states: Mapping[str, float]) -> Operations:
    """Turn the statements of a program that has started, in automatic mode and with good samples, into operations."""
    values = {
        **dict.fromkeys(SIGNALS, 0.0),
        **program.constants,
        **states,
        **dict.fromkeys([*program.variables, "feedforward", "0.0"], 0.0),
        "0.5": 0.5,
        "1.0": 1.0,
    }
    compiler = _Compiler(list(values))
    with PARSING:
        compiler.statements(program.body, None)
    numbers = np.zeros(compiler.size)
    numbers[: len(values)] = list(values.values())
    return Operations(np.array(compiler.code, np.intp).reshape(-1, 4), compiler.places, numbers)


class _Compiler:
    """Operations as they are made; each name has a place, and intermediate results use the places after them.

    Attributes
    ----------
    known : dict
        Truth values that are known before the step runs.
    free : int
        First place after the intermediate results that are still needed.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.places = {name: k for k, name in enumerate(names)}
        self.known = {"started": True, "manual": False, "tracking": False, "retuned": False}
        self.known |= {"true": True, "false": False, "follow": False}
        self.code: list[list[int]] = []
        self.free = self.size = len(names)

    def statements(self, body: Sequence[Statement], mask: int | None) -> None:
        """Add the operations of statements, which take effect where the number at `mask` is not 0."""
        for statement in body:
            kept = self.free
            if isinstance(statement, Set) and statement.target not in FOR_OTHERS:
                self.assign(statement.target, self.value(ast.parse(statement.value, mode="eval").body), mask)
            elif isinstance(statement, If):
                condition = self.value(ast.parse(statement.condition, mode="eval").body)
                if isinstance(condition, bool):
                    self.statements(statement.then if condition else statement.otherwise, mask)
                else:
                    then = condition if mask is None else self.emit(MULTIPLY, mask, condition)
                    otherwise = self.emit(SUBTRACT, self.places["1.0"] if mask is None else mask, then)
                    self.statements(statement.then, then)
                    self.statements(statement.otherwise, otherwise)
            self.free = kept

    def assign(self, name: str, value: int | bool, mask: int | None) -> None:
        """Change the value of a name."""
        if isinstance(value, bool):
            self.known[name] = value
        elif mask is not None:
            self.code.append([CHOOSE, self.places[name], value, mask])
        elif value >= len(self.places) and self.places[name] not in self.code[-1][2:]:
            # computed there at once, unless from the value that is there: lanes that change in place take turns
            self.code[-1][1] = self.places[name]
        else:
            self.code.append([COPY, self.places[name], value, value])

    def value(self, node: ast.expr) -> int | bool:
        """Return the place of an expression, or whether it is true."""
        match node:
            case ast.Name(id=name):
                return self.known[name] if name in self.known else self.places[name]
            case ast.Constant(value=value):
                return self.places[repr(value)]
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return self.emit(SUBTRACT, self.places["0.0"], self.value(operand))
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return not self.value(operand)
            case ast.BoolOp(op=op, values=[left, right]):
                first, second = self.value(left), self.value(right)
                if isinstance(first, bool):
                    return second if first == isinstance(op, ast.And) else first
                return self.emit(OPERATION_CODES[type(op)], first, second)
            case (
                ast.Compare(left=left, ops=[op], comparators=[right])
                | ast.BinOp(left=left, op=op, right=right)
            ):
                return self.emit(OPERATION_CODES[type(op)], self.value(left), self.value(right))
        raise TypeError(f"a step has no such expression: {ast.unparse(node)}")

    def emit(self, kind: int, left: int, right: int) -> int:
        """Add an operation, and return the place of its result."""
        self.code.append([kind, self.free, left, right])
        self.free += 1
        self.size = max(self.size, self.free)
        return self.free - 1
