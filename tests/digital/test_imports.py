"""The files of `digital` depend on each other in one direction, in types as well."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pidalab.digital

FILES = {
    path.stem: path for path in Path(pidalab.digital.__file__).parent.glob("*.py") if path.stem != "__init__"
}


def needs(path):
    """Files of the package that one imports, for type checkers too."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("pidalab.digital"):
            found |= {node.module.rpartition(".")[2], *(alias.name for alias in node.names)} & {*FILES}
    return found


def test_no_circle():
    order = list(TopologicalSorter({name: needs(path) for name, path in FILES.items()}).static_order())
    assert {*order} == {*FILES}
    assert order.index("parameters") < order.index("program") < order.index("controller")
