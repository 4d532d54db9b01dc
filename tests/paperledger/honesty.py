"""What the source of a page must not do: read statically, so that no run can hide it.

Each function returns a list of findings, one line each.
"""

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

STORED = {
    "rows",
    "fresh",
    "computed",
    "evidence",
    "derived",
    "shown",
}  # what the ledger keeps or was handed over
MARKERS = re.compile(r"#\s*(NBVAL_\w+|PYTEST_VALIDATE\w*)")
TAGS = re.compile(r"raises-exception|nbval-.*|skip-execution")
# calls that compute nothing by themselves
PURE = re.compile(
    r"float|int|abs|round|min|max|len|sum|dict|list|tuple|zip|enumerate|range|product|str|np|math"
    r"|np\.(float64|array|asarray|abs|round|mean)|.*\.(items|values)"
)


def cells(path: Path) -> list[tuple[str, list[str]]]:
    """Source, magics left out, and tags of the code cells of a notebook."""
    code = [
        cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"
    ]
    sources = [re.sub(r"(?m)^[%!].*$", "", "".join(cell["source"])) for cell in code]
    return [(source, cell["metadata"].get("tags", [])) for source, cell in zip(sources, code, strict=True)]


def page(path: Path) -> list[str]:
    """Read a notebook that hands something over."""
    code = cells(path)
    found = [f"tag {tag}" for _, tags in code for tag in tags if TAGS.fullmatch(tag)]
    found += [f"marker {marker}" for source, _ in code for marker in MARKERS.findall(source)]
    tree = ast.parse("\n".join(source for source, _ in code))
    if not tree.body or ast.unparse(tree.body[-1]) != "book.close()":
        found.append("does not end with book.close()")
    if sum(_called(call).endswith("Ledger.open") for call in _calls(tree)) != 1:
        found.append("opens not one ledger")
    return found + module(tree)


def module(tree: ast.AST) -> list[str]:
    """Read the code of a page, or of a module beside it."""
    assigned = _assignments(tree)
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr in STORED and _of_ledger(node.value, assigned):
            found.append(f"reads .{node.attr}, which the ledger keeps")
        if (isinstance(node, ast.Try) and node.handlers) or (
            isinstance(node, ast.With) and _suppresses(node)
        ):
            found += ["a failure of the ledger is swallowed" for call in _calls(node) if _hands(call)]
        if isinstance(node, ast.Constant) and re.search(r"ledger/|ledger.*\.csv", str(node.value)):
            found.append("names a file of the ledger")
        if isinstance(node, ast.Assign) and re.match(r"(book|Ledger)\.", ast.unparse(node)):
            found.append("changes the ledger")
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("paperledger."):
            found.append("imports from inside the ledger")
        if isinstance(node, ast.Call) and _hands(node):
            found += [f"{ast.unparse(node)[:60]}: {reason}" for reason in _judge(node, assigned)]
    return found


def _calls(tree: ast.AST) -> list[ast.Call]:
    return [node for node in ast.walk(tree) if isinstance(node, ast.Call)]


def _called(call: ast.Call) -> str:
    return ast.unparse(call.func)


def _hands(call: ast.Call) -> bool:
    return _called(call) in ("book.compare", "book.decide", "book.close")


def _suppresses(node: ast.With) -> bool:
    return any(re.search("suppress|raises", ast.unparse(item.context_expr)) for item in node.items)


def _assignments(tree: ast.AST) -> dict[str, list[ast.expr]]:
    """Everything that is assigned to a name, anywhere in a page."""
    assigned: dict[str, list[ast.expr]] = {}
    for node in ast.walk(tree):
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        value = getattr(node, "value", None) or getattr(node, "iter", None)  # of a loop
        for name in (name for target in targets if target and value for name in ast.walk(target)):
            if isinstance(name, ast.Name):
                assigned.setdefault(name.id, []).append(value)
    return assigned


def _of_ledger(node: ast.AST, assigned: dict[str, list[ast.expr]], seen: tuple[str, ...] = ()) -> bool:
    """Whether something is the ledger or a row of it."""
    if isinstance(node, ast.Name) and node.id not in seen:
        values = assigned.get(node.id, [])
        return node.id in ("book", "row") or any(_of_ledger(x, assigned, (*seen, node.id)) for x in values)
    return isinstance(node, ast.Call | ast.Subscript) and ast.unparse(node).startswith("book.row")


def computes(node: ast.AST, assigned: dict[str, list[ast.expr]], seen: tuple[str, ...] = ()) -> bool:
    """Tell whether a value is computed: something in it is called, or comes from elsewhere.

    Numbers typed in, and arithmetic on them alone, are not computed; what the paper prints is, by a call.
    """
    if isinstance(node, ast.Name):
        values = assigned.get(node.id)
        if node.id in seen or values is None:
            return node.id not in seen and not PURE.fullmatch(node.id)
        return any(computes(value, assigned, (*seen, node.id)) for value in values)
    if isinstance(node, ast.Call) and not PURE.fullmatch(_called(node)):
        return True
    return any(computes(child, assigned, seen) for child in ast.iter_child_nodes(node))


def _leaves(node: ast.AST, id: str = "") -> Iterator[tuple[str, ast.AST]]:
    """Values of a dictionary that is written out, with their ids as far as they are."""
    if isinstance(node, ast.Dict):
        for key, value in zip(node.keys, node.values, strict=True):
            yield from _leaves(value, f"{id}.{key.value if isinstance(key, ast.Constant) else ''}")
    elif isinstance(node, ast.DictComp):
        yield from _leaves(node.value, id)
    else:
        yield id.strip("."), node


def _judge(call: ast.Call, assigned: dict[str, list[ast.expr]]) -> Iterator[str]:
    """Say why what a call hands over is refused."""
    comparing = _called(call) == "book.compare"
    for id, value in _leaves(call.args[not comparing]) if len(call.args) > (not comparing) else ():
        sides = value.elts if isinstance(value, ast.Tuple) else [value]
        if not computes(value, assigned):
            yield "hands over what is typed in"
        elif comparing and _prints(id, value, assigned):
            yield "hands back what is printed"
        elif not comparing and any(isinstance(side, ast.Compare | ast.BoolOp) for side in sides):
            yield "hands over a truth value as a number"
        elif not comparing and any(re.match(r"(np\.)?round\(", ast.unparse(side)) for side in sides):
            yield "rounds, so that drift stays hidden"
        elif len(sides) == 2 and ast.unparse(sides[0]) == ast.unparse(sides[1]):
            yield "compares a number with itself"


def _prints(id: str, node: ast.AST, assigned: dict[str, list[ast.expr]]) -> bool:
    """Whether a value is a printed number and nothing else, or takes the print of its own row."""
    seen: list[str] = []
    while isinstance(node, ast.Name) and len(assigned.get(node.id, [])) == 1 and node.id not in seen:
        seen.append(node.id)
        node = assigned[node.id][0]
    while isinstance(node, ast.Call) and PURE.fullmatch(_called(node)) and node.args:
        node = node.args[0]
    if isinstance(node, ast.Call) and _called(node) == "book.printed":
        return True
    own = [call for call in _calls(node) if _called(call) == "book.printed" and call.args]
    return any(id and ast.unparse(call.args[0]).strip("'\"").endswith(id) for call in own)
