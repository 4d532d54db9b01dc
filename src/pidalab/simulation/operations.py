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
PARSING = threading.Lock()  # Python 3.11 counts the depth of a syntax tree for all threads together


class Operations(NamedTuple):
    """A step as operations."""

    code: np.ndarray  # intp, (operations, 4): kind, and the places of target, left and right
    places: dict[str, int]  # of signals, constants and states, `SIGNALS` first
    numbers: Array  # their values, and room for what is computed in a step


def operations(program: Program, states: Mapping[str, float]) -> Operations:
    """Turn the statements of a program that has started, in automatic mode, into operations."""
    with PARSING:
        return _compiled(program, states)


def _compiled(program: Program, states: Mapping[str, float]) -> Operations:
    values = {
        **dict.fromkeys(SIGNALS, 0.0),
        **program.constants,
        **states,
        "feedforward": 0.0,
        "0.0": 0.0,
        "1.0": 1.0,
    }
    for node in ast.walk(ast.parse("\n".join(_expressions(program.body)))):
        if isinstance(node, ast.Constant):
            values[repr(node.value)] = float(repr(node.value))
    compiler = _Compiler(list(values))
    compiler.statements(program.body, None)
    compiler.keep(states)
    code, size = _in_few_places(compiler.code, len(values))
    numbers = np.zeros(size)
    numbers[: len(values)] = list(values.values())
    return Operations(code, {name: k for k, name in enumerate(values)}, numbers)


def _expressions(body: Sequence[Statement]) -> list[str]:
    found = []
    for one in body:
        if isinstance(one, Set):
            found.append(one.value)
        elif isinstance(one, If):
            found += [one.condition, *_expressions(one.then), *_expressions(one.otherwise)]
    return found


class _Compiler:
    """Operations as they are made; each result has a place of its own, at which no name but one is changed.

    Attributes
    ----------
    at : dict
        The place of the value that a name has at present, or whether it is true where that is known.
    own : set of int
        Places that a single name refers to, where a change under a condition can be made.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.home = {name: k for k, name in enumerate(names)}
        known = {
            "started": True,
            "manual": False,
            "tracking": False,
            "retuned": False,
            "true": True,
            "false": False,
        }
        self.at: dict[str, int | bool] = {**self.home, **known}
        self.code: list[list[int]] = []
        self.own: set[int] = set()
        self.size = len(names)

    def statements(self, body: Sequence[Statement], mask: int | None) -> None:
        for one in body:
            if isinstance(one, Set):
                self.assign(one.target, self.value(ast.parse(one.value, mode="eval").body), mask)
            elif isinstance(one, If):
                condition = self.value(ast.parse(one.condition, mode="eval").body)
                if isinstance(condition, bool):
                    self.statements(one.then if condition else one.otherwise, mask)
                    continue
                then = condition if mask is None else self.emit(MULTIPLY, mask, condition)
                otherwise = self.emit(SUBTRACT, self.home["1.0"] if mask is None else mask, then)
                self.statements(one.then, then)
                self.statements(one.otherwise, otherwise)

    def assign(self, name: str, value: int | bool, mask: int | None) -> None:
        if mask is None or isinstance(value, bool):
            self.own.discard(int(value))
            self.at[name] = value
            return
        if self.at.get(name) not in self.own:
            self.at[name] = self.emit(COPY, self.at.get(name, value), value)
            self.own.add(self.size - 1)
        self.code.append([CHOOSE, self.at[name], value, mask])

    def value(self, node: ast.expr) -> int | bool:
        """Return the place of an expression, or whether it is true."""
        match node:
            case ast.Name(id=name):
                return self.at[name]
            case ast.Constant(value=value):
                return self.home[repr(value)]
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return self.emit(SUBTRACT, self.home["0.0"], self.value(operand))
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return not self.value(operand)
            case ast.BoolOp(op=op, values=[left, right]):
                first, second = self.value(left), self.value(right)
                if isinstance(first, bool):
                    return second if first == isinstance(op, ast.And) else first
                return self.emit(KINDS[type(op)], first, second)
            case (
                ast.Compare(left=left, ops=[op], comparators=[right])
                | ast.BinOp(left=left, op=op, right=right)
            ):
                return self.emit(KINDS[type(op)], self.value(left), self.value(right))
        raise TypeError(f"a step has no such expression: {ast.unparse(node)}")

    def emit(self, kind: int, left: int, right: int) -> int:
        self.code.append([kind, self.size, left, right])
        self.size += 1
        return self.size - 1

    def keep(self, states: Mapping[str, float]) -> None:
        """Bring the states home, at once where they are computed if their last values are needed no more."""
        changed = [x for x in states if not isinstance(self.at[x], bool) and self.at[x] != self.home[x]]
        for name in changed:
            if self.at[name] < len(self.home):  # an input, or what another state was
                self.at[name] = self.emit(COPY, self.at[name], self.at[name])
        for name in changed:
            home, made = self.home[name], self.at[name]
            first = next(k for k, operation in enumerate(self.code) if operation[1] == made)
            if made < len(self.home) or any(home in operation[2:] for operation in self.code[first:]):
                self.code.append([COPY, home, made, made])
                continue
            for operation in self.code[first:]:
                operation[1:] = [home if place == made else place for place in operation[1:]]
            self.at |= {other: home for other in changed if self.at[other] == made}


def _in_few_places(code: list[list[int]], kept: int) -> tuple[np.ndarray, int]:
    """Use the places of intermediate results again, so that all numbers stay near the processor."""
    last = {place: k for k, operation in enumerate(code) for place in operation[1:]}
    where, size = {place: place for place in range(kept)}, kept
    free: list[int] = []
    for k, operation in enumerate(code):
        target = operation[1]
        if target not in where:
            size += not free
            where[target] = free.pop() if free else size - 1
        done = {place for place in operation[1:] if place >= kept and last[place] == k}
        operation[1:] = [where[place] for place in operation[1:]]
        free += [where[place] for place in done]
    return np.array(code, np.intp).reshape(-1, 4), size
