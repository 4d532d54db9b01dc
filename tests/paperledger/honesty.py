"""What the source of a page must not do, as far as `make shake` cannot see it; read statically, so no run hides it.

The shake sees where a number comes from, whatever its name, and what a page does to the ledger. It does not see a cell
that another runner leaves out, an output that is hidden, a failure that is swallowed, a ledger that is handled by its
privates, a page that does something else while it is shaken, or cases of a statement that are left out. Each function
returns a list of findings, one line each.
"""

import ast
import json
import re
from pathlib import Path

PRIVATE = {"fresh", "records", "refused", "closed", "owed", "computed", "evidence"}  # what the ledger keeps
MARKERS = re.compile(r"#\s*(NBVAL_\w+|PYTEST_VALIDATE\w*)")
TAGS = re.compile(r"raises-exception|nbval-.*|skip-execution|remove-output")
ASKING = re.compile(r"__debug__|get_ipython|sys\.(flags|modules|argv)|os\.environ|os\.getenv|book\.path")
REACHING = {"setattr", "delattr", "vars", "type", "globals", "exec", "eval", "__import__"}


def cells(path: Path) -> list[tuple[str, list[str]]]:
    """Source, magics of one line left out, and tags of the code cells of a notebook."""
    code = [
        cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"
    ]
    sources = [re.sub(r"(?m)^(%(?!%)|!).*$", "", "".join(cell["source"])) for cell in code]
    return [(source, cell["metadata"].get("tags", [])) for source, cell in zip(sources, code, strict=True)]


def page(path: Path) -> list[str]:
    """Read a notebook that hands something over."""
    code = cells(path)
    found = [f"tag {tag}" for _, tags in code for tag in tags if TAGS.fullmatch(tag)]
    found += [f"marker {marker}" for source, _ in code for marker in MARKERS.findall(source)]
    magic = [source for source, _ in code if source.lstrip().startswith("%%")]
    if magic:
        return [*found, *(f"a cell magic decides whether it runs: {source[:30]!r}" for source in magic)]
    tree = ast.parse("\n".join(source for source, _ in code))
    if not tree.body or ast.unparse(tree.body[-1]) != "book.close()":
        found.append("does not end with book.close()")
    if sum(_called(call).endswith("Ledger.open") for call in _calls(tree)) != 1:
        found.append("opens not one ledger")
    return found + module(tree)


def module(tree: ast.AST) -> list[str]:
    """Read the code of a page, or of a module beside it."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and _is_ledger(node.value):
            if node.attr.startswith("_") or node.attr in PRIVATE:
                found.append(f"reads .{node.attr}, which the ledger keeps")
            elif isinstance(node.ctx, ast.Store | ast.Del):
                found.append("changes the ledger")
        if isinstance(node, ast.Try | ast.With):
            found += ["a failure of the ledger is swallowed"] * _swallows(node)
        if isinstance(node, ast.Constant) and re.search(r"ledger/|ledger.*\.csv", str(node.value)):
            found.append("names a file of the ledger")
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("paperledger."):
            found.append("imports from inside the ledger")
        if isinstance(node, ast.Name | ast.Attribute | ast.Constant) and ASKING.fullmatch(_said(node)):
            found.append(f"asks where it runs by {_said(node)}")
        if isinstance(node, ast.Call):
            if _called(node).endswith(".decide") and any(
                isinstance(part, ast.comprehension) and part.ifs for part in ast.walk(node)
            ):
                found.append("leaves cases of a statement out")
            if _called(node) in REACHING and any(_is_ledger(one) for one in node.args):
                found.append(f"reaches into the ledger by {_called(node)}")
            if _called(node).endswith(".compare") and any(
                isinstance(part, ast.Attribute) and part.attr == "printed" and not _is_call(part, node)
                for part in ast.walk(node)
            ):
                found.append("hands over what is printed")
    return found


def _said(node: ast.expr) -> str:
    return str(node.value) if isinstance(node, ast.Constant) else ast.unparse(node)


def _calls(tree: ast.AST) -> list[ast.Call]:
    return [node for node in ast.walk(tree) if isinstance(node, ast.Call)]


def _called(call: ast.Call) -> str:
    return ast.unparse(call.func)


def _is_call(part: ast.Attribute, tree: ast.AST) -> bool:
    """Whether an attribute is called: book.printed(...) is a start, row.printed is a text."""
    return any(call.func is part for call in _calls(tree))


def _is_ledger(node: ast.AST) -> bool:
    """Whether something is the ledger, its class or a row of it."""
    text = ast.unparse(node)
    return bool(re.fullmatch(r"book|row|Ledger|book\.rows?\b.*|type\(book\)", text))


def _swallows(node: ast.Try | ast.With) -> bool:
    """Whether a block that handles errors hands something over, or calls a function of the page that may."""
    handles = bool(node.handlers) if isinstance(node, ast.Try) else _suppresses(node)
    return handles and any(re.search(r"\b(compare|decide|close)$", _called(call)) for call in _calls(node))


def _suppresses(node: ast.With) -> bool:
    """A context manager that takes the name of an error keeps that error to itself."""
    return any(
        isinstance(item.context_expr, ast.Call)
        and any(re.search(r"Error|Exception", ast.unparse(one)) for one in item.context_expr.args)
        for item in node.items
    )
