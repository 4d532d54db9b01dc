"""What the source of a page must not do: read statically, so that no run can hide it.

Each function returns a list of findings, one line each.
"""

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

HANDING = ("compare", "decide")  # the calls that hand something to the ledger
STORED = (
    "rows",
    "fresh",
    "computed",
    "evidence",
    "derived",
    "shown",
)  # what the file keeps, or was handed over
MARKERS = re.compile(r"#\s*(NBVAL_\w+|PYTEST_VALIDATE\w*)")
TAGS = re.compile(r"raises-exception|nbval-.*|skip-execution")
PURE = {
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
}
PURE |= {"range", "product", "str", "np.float64", "np.array", "np.asarray", "np.abs", "np.round", "np.mean"}


def cells(path: Path) -> list[tuple[str, list[str]]]:
    """Source, magics left out, and tags of the code cells of a notebook."""
    code = [
        cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"
    ]
    return [
        (re.sub(r"(?m)^[%!].*$", "", "".join(cell["source"])), cell.get("metadata", {}).get("tags", []))
        for cell in code
    ]


def page(path: Path) -> list[str]:
    """Read a notebook that hands something over."""
    code = cells(path)
    found = [f"tag {tag}" for _, tags in code for tag in tags if TAGS.fullmatch(tag)]
    found += [f"marker {marker}" for source, _ in code for marker in MARKERS.findall(source)]
    tree = ast.parse("\n".join(source for source, _ in code))
    last = ast.parse(code[-1][0]).body if code else []
    if not last or ast.unparse(last[-1]) != "book.close()":
        found.append("does not end with book.close()")
    if sum(ast.unparse(call.func).endswith("Ledger.open") for call in _calls(tree)) != 1:
        found.append("opens not one ledger")
    return found + module(tree)


def module(tree: ast.AST) -> list[str]:
    """Read the code of a page, or of a module beside it."""
    scope = Scope(tree)
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr in STORED and _ledger(node.value, scope):
            found.append(f"reads .{node.attr}, which the ledger keeps")
        if isinstance(node, ast.Try | ast.With) and _swallows(node):
            found += ["a failure of the ledger is swallowed" for call in _calls(node) if _hands(call)]
        if isinstance(node, ast.Constant) and re.search(r"ledger/|ledger.*\.csv", str(node.value)):
            found.append("names a file of the ledger")
        if isinstance(node, ast.Assign | ast.Delete) and any(_alters(target) for target in node.targets):
            found.append("changes the ledger")
        if isinstance(node, ast.ImportFrom) and re.fullmatch(r"pidalab\.ledger\..*", node.module or ""):
            found.append("imports from inside the ledger")
    for call in _calls(tree):
        if _hands(call):
            found += [f"{ast.unparse(call)[:60]}: {reason}" for reason in _judge(call, scope)]
    return found


def _calls(tree: ast.AST) -> list[ast.Call]:
    return [node for node in ast.walk(tree) if isinstance(node, ast.Call)]


def _hands(call: ast.Call) -> bool:
    return ast.unparse(call.func) in {f"book.{name}" for name in (*HANDING, "close")}


def _alters(target: ast.expr) -> bool:
    return isinstance(target, ast.Attribute) and ast.unparse(target.value) in ("book", "Ledger")


def _ledger(node: ast.AST, scope: "Scope", seen: frozenset[str] = frozenset()) -> bool:
    """Whether something is the ledger or a row of it."""
    if isinstance(node, ast.Name) and node.id not in seen:
        return node.id in ("book", "row") or any(
            _ledger(value, scope, seen | {node.id}) for value in scope.assigned.get(node.id, [])
        )
    return isinstance(node, ast.Call | ast.Subscript) and ast.unparse(node).startswith(
        ("book.row", "book.rows")
    )


def _swallows(node: ast.Try | ast.With) -> bool:
    if isinstance(node, ast.Try):
        return bool(node.handlers)
    return any(re.search("suppress|raises", ast.unparse(item.context_expr)) for item in node.items)


class Scope:
    """Names of a page, with everything that is assigned to them anywhere in it."""

    def __init__(self, tree: ast.AST) -> None:
        self.assigned: dict[str, list[ast.expr]] = {}
        for node in ast.walk(tree):
            if isinstance(node, ast.Assign):
                for target in node.targets:
                    self._assign(target, node.value)
            elif isinstance(node, ast.AugAssign | ast.AnnAssign | ast.NamedExpr) and node.value is not None:
                self._assign(node.target, node.value)
            elif isinstance(node, ast.For | ast.comprehension):
                self._assign(node.target, node.iter)

    def _assign(self, target: ast.expr, value: ast.expr) -> None:
        for name in ast.walk(target):
            if isinstance(name, ast.Name):
                self.assigned.setdefault(name.id, []).append(value)


def computes(node: ast.AST, scope: Scope, seen: frozenset[str] = frozenset()) -> bool:
    """Tell whether a value is computed: something in it is called, or comes from elsewhere.

    Numbers typed in, and arithmetic on them alone, are not computed; what the paper prints is, by a call.
    """
    if isinstance(node, ast.Name):
        if node.id in seen or node.id in ("True", "False"):
            return False
        values = scope.assigned.get(node.id)
        if values is None:
            return node.id not in PURE
        return any(computes(value, scope, seen | {node.id}) for value in values)
    if (
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr in ("items", "values")
    ):
        return computes(node.func.value, scope, seen)
    if isinstance(node, ast.Call) and ast.unparse(node.func) not in PURE:
        return True
    if isinstance(node, ast.Call):
        return any(
            computes(part, scope, seen) for part in (*node.args, *(word.value for word in node.keywords))
        )
    if isinstance(node, ast.Attribute):
        return ast.unparse(node) not in ("np.inf", "np.pi", "math.pi", "math.inf") and computes(
            node.value, scope, seen
        )
    return any(computes(child, scope, seen) for child in ast.iter_child_nodes(node))


def _leaves(node: ast.AST, id: str = "") -> Iterator[tuple[str, ast.AST]]:
    """Values of a dictionary that is written out, with their ids as far as they are."""
    if isinstance(node, ast.Dict):
        for key, value in zip(node.keys, node.values, strict=True):
            part = key.value if isinstance(key, ast.Constant) else ""
            yield from _leaves(value, f"{id}.{part}")
    elif isinstance(node, ast.DictComp):
        yield from _leaves(node.value, id)
    else:
        yield id.strip("."), node


def _judge(call: ast.Call, scope: Scope) -> list[str]:
    """Say why what a call hands over cannot stand."""
    name = ast.unparse(call.func)
    if name == "book.compare" and call.args:
        found = []
        for id, value in _leaves(call.args[0]):
            if not computes(value, scope):
                found.append("hands over what is typed in")
            elif _prints(id, value, scope):
                found.append("hands back what is printed")
        return found
    if name == "book.decide" and len(call.args) > 1:
        cases = call.args[1]
        if not computes(cases, scope):
            return ["hands over what is typed in"]
        for _, value in _leaves(cases):
            sides = value.elts if isinstance(value, ast.Tuple) else [value]
            if any(isinstance(side, ast.Compare | ast.BoolOp) for side in sides):
                return ["hands over a truth value as a number"]
            if any(isinstance(side, ast.Call) and ast.unparse(side.func).endswith("round") for side in sides):
                return ["rounds, so that drift stays hidden"]
            if len(sides) == 2 and ast.unparse(sides[0]) == ast.unparse(sides[1]):
                return ["compares a number with itself"]
    return []


def _prints(id: str, node: ast.AST, scope: Scope, seen: frozenset[str] = frozenset()) -> bool:
    """Whether a value is a printed number and nothing else, or takes the print of its own row."""
    bare = node
    while isinstance(bare, ast.Name) and len(scope.assigned.get(bare.id, [])) == 1 and bare.id not in seen:
        seen |= {bare.id}
        bare = scope.assigned[bare.id][0]
    while isinstance(bare, ast.Call) and ast.unparse(bare.func) in PURE and bare.args:
        bare = bare.args[0]
    if isinstance(bare, ast.Call) and ast.unparse(bare.func) == "book.printed":
        return True
    own = [call for call in _calls(bare) if ast.unparse(call.func) == "book.printed" and call.args]
    return any(id and ast.unparse(call.args[0]).strip("'\"").endswith(id) for call in own)
