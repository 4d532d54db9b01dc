"""A Python module without imports: a class with a step, and a test."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pidalab.digital.languages.text import renamed, rows
from pidalab.digital.program import INPUTS, If, Note, Program, Set, Statement, Vector


def write(program: Program, head: list[str], vector: Vector, name: str) -> str:
    """Return a module without imports: a class with a step, and a test."""

    def namer(token: str) -> str:
        return {"true": "True", "false": "False"}.get(
            token, f"self.{token}" if token in program.states else token
        )

    def statements(body: Sequence[Statement], indent: str) -> list[str]:
        lines: list[str] = []
        for one in body:
            if isinstance(one, Note):
                lines.append(f"{indent}# {one.text}")
            elif isinstance(one, Set):
                lines.append(f"{indent}{namer(one.target)} = {renamed(one.value, namer)}")
            elif isinstance(one, If):
                lines += [
                    f"{indent}if {renamed(one.condition, namer)}:",
                    *statements(one.then, indent + "    "),
                ]
                if one.otherwise:
                    lines += [f"{indent}else:", *statements(one.otherwise, indent + "    ")]
        return lines

    arrays: list[str] = []
    for signal, values in vector.items():
        arrays += [f'    "{signal}": [', *rows([repr(value) for value in values], "        "), "    ],"]
    usual: dict[str, Any] = {"manual": False, "manual_value": 0.0, "tracking": False, "track_value": 0.0}
    inputs = ", ".join(f"{x}={usual[x]!r}" if x in usual else x for x in INPUTS)
    kind = "".join(word.capitalize() for word in name.split("_"))
    return "\n".join(
        [
            '"""' + head[0],
            "",
            *head[1:],
            "",
            "With manual it gives manual_value, within the limits. With tracking it takes track_value for the",
            "signal that acted since the last sample. Signals must be finite: check measurements before.",
            '"""',
            "",
            *(f"{x} = {value!r}" for x, value in program.constants.items()),
            "",
            "",
            f"class {kind}:",
            "    def __init__(self):",
            *(f"        self.{x} = {value!r}" for x, value in program.states.items()),
            "",
            f"    def step(self, {inputs}):",
            *statements(program.body, "        "),
            "        return self.control",
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
