"""C99: a struct of states, an initialisation, a step, and a test under <NAME>_SELFTEST."""

from __future__ import annotations

from pidalab.digital.languages.text import Syntax, more, rows, statements
from pidalab.digital.program import Program, Vector

SYNTAX = Syntax("/* {} */", "{} = {};", "if ({}) {{", "} else {", "}")


def write(program: Program, head: list[str], vector: Vector, name: str) -> str:
    """Return C99: a struct of states, an initialisation, a step, and a test under <NAME>_SELFTEST."""
    upper, real = name.upper(), f"{name}_real"
    operators = {"and": "&&", "or": "||", "not": "!", "true": "true", "false": "false"}

    def namer(token: str) -> str:
        if token in operators:
            return operators[token]
        if token[0].isdigit():
            return f"({real}){token}"
        if token in program.states:
            return f"s->{token}"
        return f"{upper}_{token}" if token.isupper() else token

    kinds = {"real": real, "bool": "bool"}
    inputs = [f"{kinds[kind]} {x}" for x, kind in program.inputs.items()]
    signature = [
        f"{real} {name}_step({name}_state *s, {', '.join(inputs[:2])},",
        f"    {', '.join(inputs[2:])})",
    ]
    reals = [x for x in program.variables if x != "forced"]
    lines = [
        "/*",
        *(f" * {line}".rstrip() for line in head),
        " *",
        f" * {name}_init sets the states to a start at the next measurement, and {name}_step advances by a sample.",
        " * With manual it gives manual_value, within the limits. With tracking it takes track_value for the signal",
        " * that acted since the last sample. Signals must be finite: check measurements before. No -ffast-math.",
        *(f" * {line}" for line in more(program)),
        f" * For single precision define {upper}_REAL as float. With {upper}_SELFTEST defined it tests itself.",
        " */",
        "",
        "#include <stdbool.h>",
        "",
        f"#ifndef {upper}_REAL",
        f"#define {upper}_REAL double",
        "#endif",
        f"typedef {upper}_REAL {real};",
        "",
        *(f"static const {real} {upper}_{x} = ({real}){value!r};" for x, value in program.constants.items()),
        "",
        "typedef struct {",
        *(f"    {'bool' if isinstance(value, bool) else real} {x};" for x, value in program.states.items()),
        f"}} {name}_state;",
        "",
        f"void {name}_init({name}_state *s);",
        *signature[:-1],
        signature[-1] + ";",
        "",
        f"void {name}_init({name}_state *s)",
        "{",
        *(
            f"    s->{x} = {'false' if isinstance(value, bool) else f'({real}){value!r}'};"
            for x, value in program.states.items()
        ),
        "}",
        "",
        *signature,
        "{",
        f"    {real}",
        *rows(reals, "        "),
    ]
    lines[-1] += ";"
    lines += ["    bool forced;"] if "forced" in program.variables else []
    body = statements(program.body, SYNTAX, namer, "    ")
    lines += [*(line.replace("! ", "!") for line in body), "    return s->control;", "}", ""]
    return "\n".join([*lines, *_c_test(program, name, vector)])


def _c_test(program: Program, name: str, vector: Vector) -> list[str]:
    upper, real = name.upper(), f"{name}_real"
    lines = [f"#ifdef {upper}_SELFTEST", "#include <math.h>", "#include <stdio.h>", ""]
    for signal, values in vector.items():
        kind = "bool" if program.inputs.get(signal) == "bool" else "double"
        lines.append(f"static const {kind} test_{signal}[] = {{")
        lines += [*rows([repr(value).lower() for value in values], "    "), "};"]
    steps, call = len(vector["control"]), []
    for signal, kind in program.inputs.items():
        call.append(f"({real})test_{signal}[k]" if kind == "real" else f"test_{signal}[k]")
    return [
        *lines,
        "",
        "int main(void)",
        "{",
        f"    {name}_state state;",
        "    double worst = 0.0, low = test_control[0], high = test_control[0];",
        "    int k;",
        f"    {name}_init(&state);",
        f"    for (k = 0; k < {steps}; k++) {{",
        f"        double u = (double){name}_step(&state, {', '.join(call[:2])},",
        f"            {', '.join(call[2:])});",
        "        worst = fmax(worst, fabs(u - test_control[k]));",
        "        low = fmin(low, test_control[k]);",
        "        high = fmax(high, test_control[k]);",
        "    }",
        '    printf("largest difference %g of a span of %g\\n", worst, high - low);',
        f"    return worst <= (sizeof({real}) < sizeof(double) ? 1e-5 : 1e-12) * (high - low) ? 0 : 1;",
        "}",
        "#endif",
        "",
    ]
