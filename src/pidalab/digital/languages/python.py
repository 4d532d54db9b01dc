"""A Python module without imports: a class with a step, and a test."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

from pidalab.digital.languages.text import Syntax, more, rows, statements
from pidalab.digital.program import Program, Vector

SYNTAX = Syntax("# {}", "{} = {}", "if {}:", "else:", "")

USUAL: dict[str, Any] = {"manual": False, "manual_value": 0.0, "tracking": False, "track_value": 0.0} | {
    "feedforward": 0.0,
    "retuned": False,
}


def step(program: Program) -> str:
    """Return the constants and the step as a function."""
    return "\n".join([*_constants(program), *_step(program, "")])


@lru_cache(maxsize=256)
def executed(code: str) -> Callable[..., float]:
    """Return the function of `step`: of an object with the states, which it changes, and of the inputs."""
    space: dict[str, Any] = {}
    exec(code, space)
    return space["step"]


def _constants(program: Program) -> list[str]:
    return [f"{x} = {value!r}" for x, value in program.constants.items()]


def _step(program: Program, indent: str) -> list[str]:
    """Return the lines of the step, a method of a class."""

    def namer(token: str) -> str:
        return {"true": "True", "false": "False"}.get(
            token, f"self.{token}" if token in program.states else token
        )

    inputs = ", ".join(f"{x}={USUAL[x]!r}" if x in USUAL else x for x in program.inputs)
    return [
        f"{indent}def step(self, {inputs}):",
        *statements(program.body, SYNTAX, namer, indent + "    "),
        f"{indent}    return self.control",
    ]


def write(program: Program, head: list[str], vector: Vector, name: str) -> str:
    """Return a module without imports: a class with a step, and a test."""
    arrays: list[str] = []
    for signal, values in vector.items():
        arrays += [f'    "{signal}": [', *rows([repr(value) for value in values], "        "), "    ],"]
    kind = "".join(word.capitalize() for word in name.split("_"))
    return "\n".join(
        [
            '"""' + head[0],
            "",
            *head[1:],
            "",
            "With manual it gives manual_value, within the limits. With tracking it takes track_value for the",
            "signal that acted since the last sample. Signals must be finite: check measurements before.",
            *more(program),
            '"""',
            "",
            *_constants(program),
            "",
            "",
            f"class {kind}:",
            "    def __init__(self):",
            *(f"        self.{x} = {value!r}" for x, value in program.states.items()),
            "",
            *_step(program, "    "),
            "",
            "",
            "TEST = {",
            *arrays,
            "}",
            "",
            "",
            "def selftest():",
            '    """Return the largest difference to the expected control signal."""',
            f"    tested, rows = {kind}(), zip(*TEST.values())",
            "    return max(abs(tested.step(*row[:-1]) - row[-1]) for row in rows)",
            "",
            "",
            'if __name__ == "__main__":',
            '    print("largest difference", selftest())',
            "",
        ]
    )
