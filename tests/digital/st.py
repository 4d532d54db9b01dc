"""A small interpreter of structured text, IEC 61131-3: parses function blocks, runs them, and accepts nothing else.

It knows VAR sections with BOOL, INT, REAL, LREAL, arrays and instances of blocks; assignments, IF, FOR and calls of
instances; comparisons, AND, OR, NOT, + - * and ABS. A name that is not declared, an assignment to a constant or to an
input, and a value of the wrong type are errors, as they are to a compiler.
"""

import re

TOKEN = re.compile(
    r"\(\*.*?\*\)|(?P<number>\d+\.\d+(?:E-?\d+)?|\d+(?!\.\d))|(?P<name>[A-Za-z]\w*)|(?P<sign>:=|\.\.|<=|>=|<>|[-+*()<>=,;:.\[\]])"
    r"|(?P<space>\s+)|(?P<wrong>.)",
    re.S,
)
KEYWORDS = {"FUNCTION_BLOCK", "END_FUNCTION_BLOCK", "VAR", "VAR_INPUT", "VAR_OUTPUT", "END_VAR", "CONSTANT"}
KEYWORDS |= {
    "IF",
    "THEN",
    "ELSE",
    "END_IF",
    "FOR",
    "TO",
    "DO",
    "END_FOR",
    "AND",
    "OR",
    "NOT",
    "TRUE",
    "FALSE",
    "ABS",
}
KEYWORDS |= {"BOOL", "INT", "REAL", "LREAL", "ARRAY", "OF"}
TYPES = {"BOOL": False, "INT": 0, "REAL": 0.0, "LREAL": 0.0}


class Parser:
    """Function blocks from text: each a dictionary of variables and a list of statements."""

    def __init__(self, text):
        self.tokens, self.at = [], 0
        for found in TOKEN.finditer(text):
            if found.lastgroup == "wrong":
                raise SyntaxError(f"what is {found[0]!r}?")
            if found.lastgroup in ("number", "name", "sign"):
                self.tokens.append((found.lastgroup, found[0]))
        self.blocks = {}
        while self.at < len(self.tokens):
            self.block()

    def next(self, *wanted):
        kind, text = self.tokens[self.at]
        if wanted and text not in wanted and kind not in wanted:
            raise SyntaxError(f"expected {wanted}, found {text!r} after {self.tokens[self.at - 4 : self.at]}")
        self.at += 1
        return text

    def sees(self, text):
        return self.tokens[self.at][1] == text

    def name(self):
        name = self.next("name")
        if name.upper() in KEYWORDS:
            raise SyntaxError(f"{name} is a keyword")
        if "__" in name or name.endswith("_"):
            raise SyntaxError(f"{name}: underscores must be single and inside")
        return name.lower()  # the language does not tell capitals from small letters

    def block(self):
        self.next("FUNCTION_BLOCK")
        name, self.variables = self.name(), {}
        while self.sees("VAR") or self.sees("VAR_INPUT") or self.sees("VAR_OUTPUT"):
            self.section()
        body = self.statements("END_FUNCTION_BLOCK")
        self.next("END_FUNCTION_BLOCK")
        self.blocks[name] = (self.variables, body)

    def section(self):
        kind = self.next()
        if self.sees("CONSTANT"):
            kind = self.next()
        while not self.sees("END_VAR"):
            name = self.name()
            if name in self.variables:
                raise SyntaxError(f"{name} is declared twice")
            self.next(":")
            type_name, size = self.type()
            if type_name not in TYPES and type_name not in self.blocks:
                raise SyntaxError(f"no type {type_name}")
            value = [TYPES[type_name]] * size if size else TYPES.get(type_name)
            if self.sees(":="):
                self.next()
                value = self.literals(size, type_name) if size else self.literal(type_name)
            self.next(";")
            self.variables[name] = (kind, type_name, value)
        self.next("END_VAR")

    def type(self):
        if not self.sees("ARRAY"):
            word = self.next("name")
            return (word if word in TYPES else word.lower()), 0
        for word in ("ARRAY", "[", "0", ".."):
            self.next(word)
        size = int(self.next("number")) + 1
        self.next("]")
        self.next("OF")
        return self.next(*TYPES), size

    def literals(self, size, type_name):
        self.next("[")
        values = [self.literal(type_name)]
        while self.sees(","):
            self.next()
            values.append(self.literal(type_name))
        self.next("]")
        if len(values) != size:
            raise SyntaxError(f"{len(values)} values for an array of {size}")
        return values

    def literal(self, type_name):
        if type_name == "BOOL":
            return self.next("TRUE", "FALSE") == "TRUE"
        sign = -1 if self.sees("-") and self.next() else 1
        text = self.next("number")
        if (type_name == "INT") == ("." in text):
            raise SyntaxError(f"{text} is no {type_name}")
        return sign * (int(text) if type_name == "INT" else float(text))

    def statements(self, *ends):
        found = []
        while not any(self.sees(end) for end in ends):
            found.append(self.statement())
        return found

    def statement(self):
        if self.sees("IF"):
            self.next()
            condition = self.expression()
            self.next("THEN")
            then, otherwise = self.statements("ELSE", "END_IF"), []
            if self.next() == "ELSE":
                otherwise = self.statements("END_IF")
                self.next("END_IF")
            self.next(";")
            return "if", condition, then, otherwise
        if self.sees("FOR"):
            self.next()
            name = self.known(self.name())
            self.next(":=")
            first = self.expression()
            self.next("TO")
            last = self.expression()
            self.next("DO")
            body = self.statements("END_FOR")
            self.next("END_FOR")
            self.next(";")
            return "for", name, first, last, body
        name = self.known(self.name())
        kind, type_name, _ = self.variables[name]
        if self.sees("("):
            self.next()
            given = {}
            while not given or self.next(",", ")") == ",":
                argument = self.name()
                self.next(":=")
                given[argument] = self.expression()
            self.next(";")
            for argument in given:
                if self.blocks[type_name][0][argument][0] != "VAR_INPUT":
                    raise SyntaxError(f"{argument} is no input of {type_name}")
            return "call", name, given
        if kind in ("CONSTANT", "VAR_INPUT"):
            raise SyntaxError(f"assignment to {name}")
        self.next(":=")
        value = self.expression()
        self.next(";")
        return "set", name, value

    def known(self, name):
        if name not in self.variables:
            raise SyntaxError(f"{name} is not declared")
        return name

    def expression(self):
        return self.binary(["OR"], ["AND"], ["<", ">", "<=", ">=", "=", "<>"], ["+", "-"], ["*"])

    def binary(self, signs, *tighter):
        def inner():
            return self.binary(*tighter) if tighter else self.factor()

        found = inner()
        while self.tokens[self.at][1] in signs:
            found = (self.next(), found, inner())
        return found

    def factor(self):
        kind, text = self.tokens[self.at]
        if text in ("NOT", "-"):
            self.next()
            return text + "1", self.factor()
        if text in ("(", "ABS"):
            if text == "ABS":
                self.next()
            self.next("(")
            inner = self.expression()
            self.next(")")
            return ("ABS", inner) if text == "ABS" else inner
        if text in ("TRUE", "FALSE"):
            return "literal", self.next() == "TRUE"
        if kind == "number":
            self.next()
            return "literal", float(text) if "." in text else int(text)
        name = self.known(self.name())
        if self.sees("["):
            self.next()
            index = self.expression()
            self.next("]")
            return "item", name, index
        if self.sees("."):
            self.next()
            return "member", name, self.name()
        return "name", name


class Instance:
    """A function block with its variables; `real` makes numbers of the precision of its type."""

    def __init__(self, blocks, name, real=float):
        self.blocks, self.real = blocks, real
        self.kinds, self.body = blocks[name]
        self.values = {}
        for variable, (_, kind, value) in self.kinds.items():
            self.values[variable] = Instance(blocks, kind, real) if kind in blocks else self.cast(kind, value)

    def cast(self, kind, value):
        if isinstance(value, list):
            return [self.cast(kind, one) for one in value]
        if (kind == "BOOL") != isinstance(value, bool):
            raise TypeError(f"{value!r} is no {kind}")
        if (kind == "INT") != (isinstance(value, int) and kind != "BOOL"):
            raise TypeError(f"{value!r} is no {kind}")
        return self.real(value) if kind in ("REAL", "LREAL") else value

    def __call__(self, **inputs):
        for name, value in inputs.items():
            self.values[name] = self.cast(self.kinds[name][1], value)
        self.run(self.body)
        return self.values

    def run(self, body):
        for kind, *rest in body:
            if kind == "set":
                self.values[rest[0]] = self.cast(self.kinds[rest[0]][1], self.value(rest[1]))
            elif kind == "if":
                self.run(rest[1] if self.truth(rest[0]) else rest[2])
            elif kind == "for":
                for i in range(self.value(rest[1]), self.value(rest[2]) + 1):
                    self.values[rest[0]] = i
                    self.run(rest[3])
            else:
                self.values[rest[0]](**{name: self.value(one) for name, one in rest[1].items()})

    def truth(self, expression):
        value = self.value(expression)
        if not isinstance(value, bool):
            raise TypeError(f"a condition must be BOOL, found {value!r}")
        return value

    def value(self, expression):
        kind, *rest = expression
        if kind == "literal":
            return self.real(rest[0]) if isinstance(rest[0], float) else rest[0]
        if kind == "name":
            return self.values[rest[0]]
        if kind == "item":
            return self.values[rest[0]][self.value(rest[1])]
        if kind == "member":
            return self.values[rest[0]].values[rest[1]]
        if kind in ("AND", "OR"):
            left, right = self.truth(rest[0]), self.truth(rest[1])
            return left and right if kind == "AND" else left or right
        if kind == "NOT1":
            return not self.truth(rest[0])
        left = self.value(rest[0])
        if kind == "-1":
            return -left
        if kind == "ABS":
            return abs(left)
        right = self.value(rest[1])
        if isinstance(left, bool) or isinstance(right, bool):
            raise TypeError(f"{left!r} {kind} {right!r}")
        if kind in "+-*":
            return left + right if kind == "+" else left - right if kind == "-" else left * right
        return bool({"<": left < right, ">": left > right, "<=": left <= right, ">=": left >= right}[kind])
