"""What the source of checks and notebooks must not do: read statically, so that no run can hide it.

Each function returns a list of findings, one line each. What is allowed nevertheless stands in `EXCEPTIONS`, with its
reason.
"""

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

HANDING = ("check", "statement", "identity", "note")  # the calls that hand something to the ledger
PRIVATE = ("rows", "entries", "computed", "evidence", "derived", "shown", "_receive", "_judge")
ALLOWED_IMPORTS = ("Ledger", "Display", "every", "some", "checks")
REFUSED_CALLS = ("setattr", "exec", "eval", "patch", "patch.object")
MARKERS = re.compile(r"#\s*(NBVAL_\w+|PYTEST_VALIDATE\w*)")
TAGS = re.compile(r"raises-exception|nbval-.*|skip-execution")
PURE = (
    "float",
    "int",
    "abs",
    "round",
    "min",
    "max",
    "len",
    "sum",
    "dict",
    "list",
    "tuple",
    "zip",
    "enumerate",
)
PURE += ("Fraction", "Decimal", "np.float64", "np.array", "np.asarray", "np.abs", "np.round", "np.int64")
PAGES = ("scoreboard", "errata", "every_row", "load_all", "convention_table", "CONVENTIONS")

EXCEPTIONS: dict[tuple[str, str], str] = {
    # (file, finding): why it is allowed nevertheless
}


def allowed(file: str, findings: list[str]) -> list[str]:
    return [f"{file}: {finding}" for finding in findings if (file, finding) not in EXCEPTIONS]


# ------------------------------------------------------------------------------------------------ any source


def _calls(tree: ast.AST, names: tuple[str, ...]) -> list[ast.Call]:
    return [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in names
    ]


def _of_the_book(call: ast.Call) -> bool:
    """Whether a call is one of the ledger: its id is text, a name or a mapping; NumPy's functions are none."""
    owner = call.func.value if isinstance(call.func, ast.Attribute) else None
    name = owner.attr if isinstance(owner, ast.Attribute) else owner.id if isinstance(owner, ast.Name) else ""
    return name in ("book", "ledger", "Ledger")


def common(tree: ast.AST) -> list[str]:
    """Find a ledger that is changed or read behind its back, and a failure that is swallowed."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Try | ast.With) and _swallows(node):
            calls = [call for call in _calls(node, (*HANDING, "close")) if _of_the_book(call)]
            found += [f"line {call.lineno}: a failure of the ledger is swallowed" for call in calls]
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("pidalab.ledger"):
            names = [alias.name for alias in node.names if alias.name not in (*ALLOWED_IMPORTS, *PAGES)]
            deep = node.module != "pidalab.ledger"
            found += [
                f"line {node.lineno}: imports {name} of the ledger" for name in names or (["inside"] * deep)
            ]
        targets = node.targets if isinstance(node, ast.Assign) else []
        found += [
            f"line {node.lineno}: changes the ledger"
            for target in targets
            if (isinstance(target, ast.Attribute) and "ledger" in ast.unparse(target).lower())
            or (isinstance(target, ast.Attribute) and ast.unparse(target.value) == "book")
        ]
        if isinstance(node, ast.Constant) and re.search(r"ledger/|ledger.*\.csv", str(node.value)):
            found.append(f"line {node.lineno}: names a file of the ledger")
        if isinstance(node, ast.Call) and ast.unparse(node.func) in REFUSED_CALLS:
            found.append(f"line {node.lineno}: calls {ast.unparse(node.func)}")
    return found


def reads_what_is_stored(tree: ast.AST) -> list[str]:
    """Find access to what the ledger keeps, which could be handed back."""
    return [
        f"line {node.lineno}: reads .{node.attr}, which the ledger keeps"
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and node.attr in PRIVATE
    ]


def _swallows(node: ast.Try | ast.With) -> bool:
    if isinstance(node, ast.Try):
        return bool(node.handlers)
    contexts = [ast.unparse(item.context_expr) for item in node.items]
    return any("suppress" in context or "raises" in context for context in contexts)


# ------------------------------------------------------------------------------------------------ checks


class Scope:
    """The names of one function, and of the module around it, with what is assigned to them."""

    def __init__(self, tree: ast.AST, outer: "Scope | None" = None) -> None:
        self.outer = outer
        self.given: set[str] = set()
        self.assigned: dict[str, list[ast.expr]] = {}
        for node in _own(tree):
            self._learn(node)
        if isinstance(tree, ast.FunctionDef):
            arguments = tree.args
            self.given |= {
                arg.arg for arg in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)
            }

    def _learn(self, node: ast.AST) -> None:
        if isinstance(node, ast.Assign):
            for target in node.targets:
                self._assign(target, node.value)
        elif isinstance(node, ast.AnnAssign | ast.AugAssign | ast.NamedExpr) and node.value is not None:
            self._assign(node.target, node.value)
        elif isinstance(node, ast.For | ast.comprehension):
            self._assign(node.target, node.iter)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            self.given |= {(alias.asname or alias.name).partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            self.given.add(node.name)

    def _assign(self, target: ast.expr, value: ast.expr) -> None:
        for name in ast.walk(target):
            if isinstance(name, ast.Name):
                self.assigned.setdefault(name.id, []).append(value)

    def values(self, name: str) -> list[ast.expr] | None:
        """Everything that a name was assigned, None if it comes from elsewhere."""
        if name in self.assigned:
            return self.assigned[name]
        if name in self.given or self.outer is None:
            return None
        return self.outer.values(name)


def _own(tree: ast.AST) -> Iterator[ast.AST]:
    """Walk a function without the functions inside it, whose names are their own."""
    for node in ast.iter_child_nodes(tree):
        yield node
        if not isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Lambda):
            yield from _own(node)


def computes(node: ast.AST, scope: Scope, seen: frozenset[str] = frozenset()) -> bool:
    """Tell whether a value is computed: somewhere in it something is called or comes from elsewhere.

    Numbers typed in, what the paper prints, and arithmetic on them alone are not computed.
    """
    if isinstance(node, ast.Name):
        if node.id in seen or node.id in ("True", "False", "book"):
            return False
        values = scope.values(node.id)
        return (values is None and node.id not in PURE) or any(
            computes(value, scope, seen | {node.id}) for value in values or ()
        )
    if isinstance(node, ast.Call):
        parts = [*node.args, *(word.value for word in node.keywords)]
        if isinstance(node.func, ast.Attribute) and ast.unparse(node.func) not in PURE:
            parts.append(node.func.value)
        elif ast.unparse(node.func) not in PURE:
            return True
        return any(computes(part, scope, seen) for part in parts)
    if isinstance(node, ast.Attribute):
        return ast.unparse(node) not in ("np.inf", "np.pi", "math.pi", "math.inf") and computes(
            node.value, scope, seen
        )
    return any(computes(child, scope, seen) for child in ast.iter_child_nodes(node))


def _prints(node: ast.AST, scope: Scope, seen: frozenset[str] = frozenset()) -> bool:
    """Tell whether a value takes something that the paper prints, as a row that stands on the print may."""
    if isinstance(node, ast.Name) and node.id not in seen:
        return any(_prints(value, scope, seen | {node.id}) for value in scope.values(node.id) or ())
    if isinstance(node, ast.Call) and ast.unparse(node.func) in ("book.printed", "book.row"):
        return True
    return any(_prints(child, scope, seen) for child in ast.iter_child_nodes(node))


def _bare(node: ast.AST, scope: Scope) -> ast.AST:
    """Follow names and conversions that change nothing, down to the expression that makes a value."""
    while True:
        if isinstance(node, ast.Name) and len(values := scope.values(node.id) or []) == 1:
            node = values[0]
        elif (
            isinstance(node, ast.Call)
            and ast.unparse(node.func) in ("float", "int", "abs", "round")
            and node.args
        ):
            node = node.args[0]
        elif isinstance(node, ast.UnaryOp):
            node = node.operand
        else:
            return node


def _own_print(id: str | None, node: ast.AST, scope: Scope, seen: frozenset[str] = frozenset()) -> bool:
    """Tell whether a value takes the printed number of the row that it is handed over for."""
    if isinstance(node, ast.Name) and node.id not in seen:
        return any(_own_print(id, value, scope, seen | {node.id}) for value in scope.values(node.id) or ())
    if isinstance(node, ast.Call) and ast.unparse(node.func) == "book.printed" and node.args:
        return id is not None and ast.unparse(node.args[0]).strip("'\"").endswith(id)
    return any(_own_print(id, child, scope, seen) for child in ast.iter_child_nodes(node))


def _judge(id: str | None, value: ast.AST, scope: Scope) -> str | None:
    """Say why a handed-over number cannot stand, None if nothing is seen."""
    bare = _bare(value, scope)
    if isinstance(bare, ast.Call) and ast.unparse(bare.func) == "book.printed":
        return "hands back what is printed"
    if not computes(value, scope) and not _prints(value, scope):
        return "hands over what is typed in"
    if _own_print(id, value, scope):
        return "computes a row from its own print"
    return None


def _text(node: ast.AST) -> str | None:
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else None


def _pairs(call: ast.Call, scope: Scope) -> list[tuple[str | None, ast.AST]]:
    """Ids and values of one call of `check`, the id None where it is not written out."""
    words = {word.arg: word.value for word in call.keywords}
    arguments = [*call.args, *(words[name] for name in ("claims", "value") if name in words)]
    if len(arguments) > 1:
        return [(_text(arguments[0]), arguments[1])]
    claims = _bare(arguments[0], scope)
    if not isinstance(claims, ast.Dict):
        return [(None, claims)]
    return [(key and _text(key), value) for key, value in zip(claims.keys, claims.values, strict=True)]


def _handed(call: ast.Call, scope: Scope) -> list[str]:
    """Judge one call that hands something over."""
    method = call.func.attr if isinstance(call.func, ast.Attribute) else ""
    if method == "check":
        return [reason for id, value in _pairs(call, scope) if (reason := _judge(id, value, scope))]
    if method == "identity" and len(call.args) > 1:
        return [] if computes(call.args[1], scope) else ["hands over what is typed in"]
    if method == "statement" and len(call.args) > 3:
        sides = (call.args[1], call.args[3])
        if any(isinstance(side, ast.Compare | ast.BoolOp) for side in sides):
            return ["hands over a truth value as a number"]
        if not any(computes(side, scope) or _prints(side, scope) for side in sides):
            return ["compares what is typed in"]
        if any("round" in ast.unparse(side) for side in sides):
            return ["rounds, so that drift stays hidden"]
        if ast.unparse(_bare(sides[0], scope)) == ast.unparse(_bare(sides[1], scope)):
            return ["compares a number with itself"]
    return []


def checks_file(path: Path, file: str) -> list[str]:
    """Read one module of checks.

    A ledger is called ``book`` there, as in the notebooks.
    """
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found = common(tree) + reads_what_is_stored(tree)
    managed = [call for call in _calls(tree, ("open", "close")) if _of_the_book(call)]
    found += [f"line {call.lineno}: opens or closes the ledger" for call in managed]
    for node in ast.walk(tree):
        renamed = (
            isinstance(node, ast.arg)
            and "Ledger" in ast.unparse(node.annotation or ast.Name(""))
            and node.arg != "book"
        )
        alias = isinstance(node, ast.Assign) and ast.unparse(node.value) == "book"
        if renamed or alias:
            found.append(f"line {node.lineno}: a ledger is called book here, so that this test sees it")
    module = Scope(tree)
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    for function in functions:
        scope = Scope(function, module)
        for node in _own(function):
            if isinstance(node, ast.Call) and _of_the_book(node):
                found += [f"line {node.lineno}: {reason}" for reason in _handed(node, scope)]
    return allowed(file, found)


# ------------------------------------------------------------------------------------------------ notebooks


def notebook(path: Path, audit: bool) -> list[str]:
    """Read one notebook: an audit opens one ledger and closes it at the end, a chapter hands over nothing."""
    cells = [
        cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"
    ]
    sources = ["".join(cell["source"]) for cell in cells]
    found = []
    for count, (cell, source) in enumerate(zip(cells, sources, strict=True), start=1):
        tags = [tag for tag in cell.get("metadata", {}).get("tags", []) if TAGS.fullmatch(tag)]
        found += [f"cell {count}: tag {tag}" for tag in tags]
        found += [f"cell {count}: marker {marker}" for marker in MARKERS.findall(source)]
    plain = "\n".join(re.sub(r"(?m)^\s*[%!].*$", "", source) for source in sources)
    tree = ast.parse(plain)
    read = common(tree) + (reads_what_is_stored(tree) if audit else [])
    found += [re.sub(r"^line \d+: ", "", finding) for finding in read]
    found += [
        f"hands over .{call.func.attr} itself; checks do"
        for call in _calls(tree, HANDING)
        if _of_the_book(call)
    ]
    opened = [call for call in _calls(tree, ("open",)) if _of_the_book(call)]
    closed = [call for call in _calls(tree, ("close",)) if _of_the_book(call)]
    if audit:
        last = ast.parse(sources[-1]).body if sources else []
        if len(opened) != 1:
            found.append(f"opens {len(opened)} ledgers")
        if not last or ast.unparse(last[-1]) != "book.close()" or len(closed) != 1:
            found.append("does not end with book.close()")
    elif closed:
        found.append("closes a ledger to which it hands nothing")
    return allowed(path.name, found)


def masked(path: Path, patterns: list[str]) -> list[str]:
    """Find outputs other than figures that a pattern of the sanitiser would mask."""
    found = []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        for output in cell.get("outputs", []):
            data = {"text/plain": output.get("text", ""), **output.get("data", {})}
            for kind, content in data.items():
                text = content if isinstance(content, str) else "".join(map(str, content))
                if kind != "image/svg+xml" and not kind.startswith("image/") and "<svg" not in text:
                    hits = [hit.group() for pattern in patterns for hit in re.finditer(pattern, text)]
                    found += [f"{path.name}: the sanitiser masks {hit!r} in {kind}" for hit in hits[:1]]
    return found
