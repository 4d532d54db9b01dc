"""Run the subset of structured text (IEC 61131-3) that the library writes: parse it strictly, translate it to Python.

An undeclared name, an assignment to a constant or an input, and a value of the wrong type are errors.
"""

import re

import numpy as np

TYPES = {"BOOL": False, "INT": 0, "REAL": 0.0, "LREAL": 0.0}
NUMBER = r"-?\d+\.\d+(?:E-?\d+)?"
LITERAL = {"BOOL": "TRUE|FALSE", "INT": r"-?\d+", "REAL": NUMBER, "LREAL": NUMBER}
SECTION = re.compile(r"(VAR(?:_INPUT|_OUTPUT| CONSTANT)?)\s+(.*?)END_VAR", re.S)
VARIABLE = re.compile(r"(\w+) : (?:ARRAY \[0\.\.(\d+)\] OF )?(\w+)(?: := (.+))?")
TOKEN = re.compile(
    rf"(?P<number>{NUMBER[2:]}|\d+)|(?P<name>\.?[A-Za-z]\w*)|(?P<sign>:=|<=|>=|<>|[-+*()<>=,\[\]])|\s+"
)
WORDS = {"AND": "and", "OR": "or", "NOT": "not", "TRUE": "True", "FALSE": "False", "ABS": "abs"}
SIGNS = {"=": "==", "<>": "!=", ":=": "="}
KEYWORD = re.compile(
    "|".join([*WORDS, *TYPES]) + "|IF|THEN|ELSE|END_IF|FOR|TO|DO|END_FOR|VAR|END_VAR|OF", re.I
)
STATEMENT = re.compile(
    r"\s*(?:IF (?P<condition>[^;]*?) THEN|(?P<otherwise>ELSE)|(?P<end>END_IF|END_FOR);"
    r"|FOR (?P<index>\w+) := (?P<first>[^;]*?) TO (?P<last>[^;]*?) DO"
    r"|(?P<called>\w+)\((?P<arguments>[^;]*)\);|(?P<target>\w+) := (?P<value>[^;]*);)",
    re.S,
)


def name_of(text):
    if KEYWORD.fullmatch(text) or not re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*", text):
        raise SyntaxError(f"{text} is no name")
    return text.lower()  # the language does not distinguish upper and lower case


def literal(kind, text):
    if not re.fullmatch(LITERAL[kind], text):
        raise SyntaxError(f"{text} is no {kind}")
    return text == "TRUE" if kind == "BOOL" else int(text) if kind == "INT" else float(text)


def expression(text):
    """Translate an expression to Python. Its variables become attributes of `own`."""
    words, position = [], 0
    while position < len(text):
        token = TOKEN.match(text, position)
        if not token:
            raise SyntaxError(f"what is {text[position:]!r}?")
        position, kind, word = token.end(), token.lastgroup, token[0]
        if kind == "name" and word not in WORDS:
            word = word.lower() if word.startswith(".") else f"own.{name_of(word)}"
        words.append(WORDS.get(word, SIGNS.get(word, word)) if kind else " ")
    return "".join(words)


def python(body):
    """Translate the statements of a block to the source of a function."""
    lines, indent, position = ["def run(own):"], "    ", 0
    while body[position:].strip():
        statement = STATEMENT.match(body, position)
        if not statement:
            raise SyntaxError(f"no statement: {body[position : position + 60]!r}")
        position, parts = statement.end(), statement.groupdict()
        if parts["otherwise"] or parts["end"]:
            indent = indent[4:]
        if parts["called"]:
            given = (argument.split(" := ") for argument in re.split(r",\s+", parts["arguments"]))
            arguments = ", ".join(f"{name_of(name)}={expression(value)}" for name, value in given)
            lines.append(f"{indent}own.{name_of(parts['called'])}({arguments})")
        elif parts["target"]:
            lines.append(f"{indent}own.{name_of(parts['target'])} = {expression(parts['value'])}")
        elif not parts["end"]:
            choice = f"if truth({expression(parts['condition'])}):" if parts["condition"] else "else:"
            if parts["index"]:
                span = f"range({expression(parts['first'])}, {expression(parts['last'])} + 1)"
                choice = f"for own.{name_of(parts['index'])} in {span}:"
            lines.append(indent + choice)
            indent += "    "
    return "\n".join(lines)


def truth(value):
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"a condition must be BOOL, found {value!r}")
    return value


def read(text):
    """Return variables and function of each function block in a text, by name."""
    blocks = {}
    plain = re.sub(r"\(\*.*?\*\)", "", text, flags=re.S)
    for name, content in re.findall(r"FUNCTION_BLOCK (\w+)\s+(.*?)END_FUNCTION_BLOCK", plain, re.S):
        variables, space = {}, {"truth": truth}
        for section, declared in SECTION.findall(content):
            for line in filter(None, (" ".join(item.split()) for item in declared.split(";"))):
                variable, last, kind, value = VARIABLE.fullmatch(line).groups()
                variable = name_of(variable)
                if variable in variables or not (kind in TYPES or kind.lower() in blocks):
                    raise SyntaxError(f"{line}: declared twice, or of no type")
                initial = TYPES.get(kind)
                if last:
                    initial = [literal(kind, item) for item in value.strip("[] ").split(", ")]
                    assert len(initial) == int(last) + 1
                elif value:
                    initial = literal(kind, value)
                variables[variable] = (section, kind, initial)
        source = python(SECTION.sub("", content))
        if unknown := {*re.findall(r"\bown\.(\w+)", source)} - {*variables}:
            raise SyntaxError(f"not declared: {unknown}")
        exec(source, space)
        blocks[name_of(name)] = (variables, space["run"])
    return blocks


class Instance:
    """A function block with its variables. The function `real` converts numbers to the precision of the type."""

    def __init__(self, blocks, name, real=float):
        variables, self._run = blocks[name]
        self._kinds = {variable: (section, kind) for variable, (section, kind, _) in variables.items()}
        self._real = real
        for variable, (_, kind, value) in variables.items():
            initial = Instance(blocks, kind.lower(), real) if kind not in TYPES else self._cast(kind, value)
            vars(self)[variable] = initial

    def _cast(self, kind, value):
        if isinstance(value, list):
            return [self._cast(kind, item) for item in value]
        wanted = {"BOOL": (bool, np.bool_), "INT": int}.get(kind, (float, self._real))
        if not isinstance(value, wanted) or (kind != "BOOL" and isinstance(value, bool)):
            raise TypeError(f"{value!r} is no {kind}")
        return self._real(value) if kind in ("REAL", "LREAL") else value

    def __setattr__(self, name, value):
        if not name.startswith("_"):
            section, kind = self._kinds[name]
            if section in ("VAR CONSTANT", "VAR_INPUT"):
                raise SyntaxError(f"assignment to {name}")
            value = self._cast(kind, value)
        super().__setattr__(name, value)

    def __call__(self, **inputs):
        for name, value in inputs.items():
            section, kind = self._kinds[name]
            if section != "VAR_INPUT":
                raise SyntaxError(f"{name} is no input")
            vars(self)[name] = self._cast(kind, value)
        self._run(self)
        return self

    def step(self, **inputs):
        """Run the block once; return its control signal."""
        return self(**inputs).control
