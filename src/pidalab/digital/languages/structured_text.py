"""Structured text of IEC 61131-3: a function block, and a second one that tests it."""

from __future__ import annotations

from pidalab.digital.languages.text import Syntax, more, rows, statements
from pidalab.digital.program import Program, Vector

SYNTAX = Syntax("(* {} *)", "{} := {};", "IF {} THEN", "ELSE", "END_IF;")


def write(program: Program, head: list[str], vector: Vector, name: str, real: str) -> str:
    """Return a FUNCTION_BLOCK of IEC 61131-3, and a second one that tests it."""
    words = {"and": "AND", "or": "OR", "not": "NOT", "true": "TRUE", "false": "FALSE"}
    number = _st_number

    def namer(token: str) -> str:
        return words.get(token, token)

    kinds = {"real": real, "bool": "BOOL"}
    states = {x: value for x, value in program.states.items() if x != "control" and x not in program.gains}
    steps = len(vector["control"])
    arrays: list[str] = []
    for signal, values in vector.items():
        kind = "BOOL" if program.inputs.get(signal) == "bool" else real
        written = [str(value).upper() if isinstance(value, bool) else number(value) for value in values]
        arrays.append(f"    test_{signal} : ARRAY [0..{steps - 1}] OF {kind} := [")
        arrays += rows(written, "        ")
        arrays[-1] += "];"
    arguments = [f"{x} := test_{x}[k]" for x in program.inputs]
    return "\n".join(
        [
            "(*",
            *(f"   {line}".rstrip() for line in head),
            "",
            "   Call it once in each sample time. It starts at the first measurement, with the signal `control` has.",
            "   With manual it gives manual_value, within the limits. With tracking it takes track_value for the",
            "   signal that acted since the last sample. Signals must be finite: check measurements before.",
            *(f"   {line}" for line in more(program)),
            "*)",
            f"FUNCTION_BLOCK {name}",
            "VAR_INPUT",
            *(f"    {x} : {kinds[kind]};" for x, kind in program.inputs.items()),
            *(f"    {x} : {real} := {number(value)};" for x, value in program.gains.items()),
            "END_VAR",
            "VAR_OUTPUT",
            f"    control : {real} := {number(float(program.states['control']))};",
            "END_VAR",
            "VAR",
            *(
                f"    {x} : {'BOOL := FALSE' if isinstance(value, bool) else f'{real} := {number(value)}'};"
                for x, value in states.items()
            ),
            *(f"    {x} : {'BOOL' if x == 'forced' else real};" for x in program.variables),
            "END_VAR",
            "VAR CONSTANT",
            *(f"    {x} : {real} := {number(value)};" for x, value in program.constants.items()),
            "END_VAR",
            *statements(program.body, SYNTAX, namer, "    "),
            "END_FUNCTION_BLOCK",
            "",
            f"FUNCTION_BLOCK {name}_selftest",
            "VAR_OUTPUT",
            f"    worst : {real} := 0.0;",
            "END_VAR",
            "VAR",
            f"    tested : {name};",
            "    k : INT;",
            "END_VAR",
            "VAR CONSTANT",
            *arrays,
            "END_VAR",
            f"    FOR k := 0 TO {steps - 1} DO",
            f"        tested({', '.join(arguments[:2])},",
            f"            {', '.join(arguments[2:4])},",
            f"            {', '.join(arguments[4:])});",
            "        IF ABS(tested.control - test_control[k]) > worst THEN",
            "            worst := ABS(tested.control - test_control[k]);",
            "        END_IF;",
            "    END_FOR;",
            "END_FUNCTION_BLOCK",
            "",
        ]
    )


def _st_number(value: float) -> str:
    """Write a number with digits on both sides of the point, which the standard asks for."""
    text = repr(float(value))
    if "e" not in text:
        return text
    mantissa, exponent = text.split("e")
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}E{int(exponent)}"
