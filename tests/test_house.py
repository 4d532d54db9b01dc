"""The design in CONTRIBUTING, kept: one way for imports, short files, a quick import."""

import ast
import json
import re
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SRC, TESTS = ROOT / "src" / "pidalab", ROOT / "tests"
ORDER = (
    (ROOT / "CONTRIBUTING.md")
    .read_text()
    .split("**Imports run one way.**")[1]
    .split("The ledger stands apart")[0]
)
CORRIDOR = [  # a room imports only from those on earlier lines, and from its own line
    sorted(path.stem for path in SRC.glob("_*.py") if not path.stem.startswith("__")),  # helpers of all
    *(
        re.findall(r"\w+", line.strip().split("  ")[0])
        for line in ORDER.splitlines()
        if line.startswith(7 * " ")
    ),
]
APART = "ledger"
LONGEST = 300  # lines of a file, docstrings aside


def name_of(path):
    """Dotted name of a module, without the package's own."""
    parts = path.relative_to(SRC).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(path): path for path in sorted(SRC.rglob("*.py"))}


def for_types_only(node):
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def imports(tree):
    """Every import of a module, in functions too, but for those that only type checkers see."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            yield node
        elif not for_types_only(node):
            yield from imports(node)


@cache
def arrows(module):
    """Modules of the library that a module imports."""
    found = set()
    for node in imports(ast.parse(MODULES[module].read_text())):
        assert getattr(node, "level", 0) == 0, f"{module}: a relative import hides where the arrow goes"
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        for name in names:
            if name.split(".")[0] == "pidalab":
                inner = name.partition(".")[2]
                found.add(inner if inner in MODULES else inner.rpartition(".")[0])
    return found


def room(module):
    return module.split(".")[0]


def test_every_room_has_its_place():
    places = [one for line in CORRIDOR for one in line]
    assert len(CORRIDOR) > 10
    assert len(set(places)) == len(places)
    assert {room(module) for module in MODULES} - {*places, APART, "", "__main__"} == set(), (
        "CONTRIBUTING does not name it"
    )


@pytest.mark.parametrize("module", [m for m in MODULES if m and room(m) != APART])
def test_imports_run_one_way(module):
    place = {one: i for i, line in enumerate([*CORRIDOR, ["__main__"]]) for one in line}
    for target in arrows(module):
        if target == "" or room(target) == APART:
            assert room(module) in ("cli", "__main__"), f"{module} imports {target or 'the whole library'}"
        else:
            assert place[room(target)] <= place[room(module)], f"{module} imports {target}, which comes later"


def test_no_circles():
    order = list(TopologicalSorter({module: arrows(module) - {module} for module in MODULES}).static_order())
    assert set(order) >= set(MODULES)


def test_the_ledger_stands_apart():
    for module in MODULES:
        if room(module) == APART:
            assert {room(target) for target in arrows(module)} <= {APART, ""}


def without_docstrings(path):
    """Lines of a file that are no docstring."""
    tree = ast.parse(path.read_text())
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef)
    texts = [node.body[0] for node in ast.walk(tree) if isinstance(node, kinds) and ast.get_docstring(node)]
    return len(path.read_text().splitlines()) - sum(text.end_lineno - text.lineno + 1 for text in texts)


@pytest.mark.parametrize(
    "path", [*SRC.rglob("*.py"), *(ROOT / "book" / "papers").rglob("*.py")], ids=lambda p: p.stem
)
def test_files_can_be_read_in_one_sitting(path):
    assert without_docstrings(path) <= LONGEST


def test_a_quick_import():
    """Who only wants the ledger, or a process, does not wait for what takes long to import."""
    heavy = ["control", "matplotlib", "numba", "pandas", "scipy"]
    for code in (
        "import pidalab",
        "import pidalab.ledger",
        "import pidalab; pidalab.Loop(pidalab.lags(3), pidalab.PIDA(1, 2))",
    ):
        show = (
            f"import json, sys; {code}; print(json.dumps([name for name in {heavy} if name in sys.modules]))"
        )
        run = subprocess.run([sys.executable, "-c", show], capture_output=True, text=True, check=True)
        assert json.loads(run.stdout) == [], code


def test_names_at_the_top_have_one_home():
    """Each name that the stub has is there; none hides a module, or the other way round."""
    import pidalab

    found = [
        node
        for node in ast.parse((SRC / "__init__.pyi").read_text()).body
        if isinstance(node, ast.ImportFrom)
    ]
    homes = [(alias.name, node.module) for node in found for alias in node.names]
    assert sorted(pidalab.__all__) == sorted(name for name, _ in homes)
    for name, module in homes:
        home = import_module(f"pidalab.{module or name}")
        assert getattr(pidalab, name) is (getattr(home, name) if module else home)
    assert {name for name, module in homes if module}.isdisjoint({room(module) for module in MODULES})


@pytest.mark.parametrize("package", [name_of(path) for path in SRC.rglob("*/__init__.py")])
def test_no_function_hides_a_module(package):
    """`import pidalab.x.y as y` gives the module y, whatever x takes out of it."""
    inner = [
        module for module in MODULES if module.rpartition(".")[0] == package and module != f"{APART}.__main__"
    ]
    for module in inner:
        found = import_module(f"pidalab.{module}")
        assert getattr(import_module(f"pidalab.{package}"), module.rpartition(".")[2]) is found


def test_unknown_names_are_refused():
    import pidalab

    with pytest.raises(AttributeError, match="nonsense"):
        _ = pidalab.nonsense
    assert set(dir(pidalab)) >= set(pidalab.__all__)
    assert pidalab.__version__


def test_helpers_have_names_of_their_own():
    """The folders that tests import from stand on one path: of two modules of one name the first hides the other."""
    text = (TESTS / "conftest.py").read_text()
    folders = re.search(r"for folder in \(([^)]*)\)", text)[1]
    names = [
        path.stem
        for folder in re.findall(r'"(\w+)"', folders)
        for path in (TESTS / folder).glob("*.py")
        if not path.stem.startswith(("test_", "conftest", "__"))
    ]
    assert len(names) > 9
    assert sorted(names) == sorted({*names})
