"""The step of a digital controller as a list of operations, which a compiled loop executes.

`pidalab.digital.program` describes the step as statements, from which C, structured text and Python are written. This
module converts the statements to operations in the same order, so the simulation gives the same bits as the written
code. The list has no jumps. Both branches of an ``if`` are computed, and an assignment takes effect only where its
condition is true. Therefore the same list serves one loop and many loops in parallel.
"""

from __future__ import annotations

import ast
import threading
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.digital.program import If, Program, Set, Statement

# Places (indices) of the controller's signals. SUMMED is the output of a block outside the program.
SETPOINT, MEASUREMENT, CONTROL, SUMMED = range(4)
SIGNALS = ("setpoint", "measurement", "control", "summed")
# ADD computes target = left + right, and so on. COPY is target = left. CHOOSE is target = left where right is not 0.
ADD, SUBTRACT, MULTIPLY, LESS, GREATER, COPY, CHOOSE = range(7)
OPERATION_CODES: dict[type, int] = {
    ast.Add: ADD,
    ast.Sub: SUBTRACT,
    ast.Mult: MULTIPLY,
    ast.Lt: LESS,
    ast.Gt: GREATER,
    ast.And: MULTIPLY,
    ast.Or: ADD,  # the operands of "or" in a program are never both true
}
FOR_OTHERS = ("at_limit",)  # outputs that only the caller reads
PARSING = threading.Lock()  # Python 3.11 counts the nesting of syntax trees in one counter for all threads


class Operations(NamedTuple):
    """A step as operations."""

    code: np.ndarray  # intp, (operations, 4): kind, and the places of target, left and right
    places: dict[str, int]  # places of signals, constants and states, with `SIGNALS` first
    numbers: Array  # values at the places, and space for intermediate results


def operations(program: Program, states: Mapping[str, float]) -> Operations:
    """Compile a program for a controller that has started, is in automatic mode and gets valid samples."""
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
    """Compiler of statements. Each name has a place. Intermediate results use the places after the names.

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
        """Add the operations of statements. A statement takes effect where the number at `mask` is not 0."""
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
        if isinstance(value, bool):
            self.known[name] = value
        elif mask is not None:
            self.code.append([CHOOSE, self.places[name], value, mask])
        elif value >= len(self.places) and self.places[name] not in self.code[-1][2:]:
            # Let the last operation write its result directly to the target. If the operation also reads the target,
            # the result is copied to the target instead. With many parallel loops, an operation that overwrites its
            # own input would run without vector instructions, which is slower than a copy.
            self.code[-1][1] = self.places[name]
        else:
            self.code.append([COPY, self.places[name], value, value])

    def value(self, node: ast.expr) -> int | bool:
        """Return the place of an expression, or its truth value if the value is already known."""
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
        raise TypeError(f"a step cannot contain the expression {ast.unparse(node)}")

    def emit(self, kind: int, left: int, right: int) -> int:
        """Add an operation and return the place of its result."""
        self.code.append([kind, self.free, left, right])
        self.free += 1
        self.size = max(self.size, self.free)
        return self.free - 1
