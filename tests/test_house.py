"""The design in CONTRIBUTING, kept: three doors, one way for imports, walls, short files, a quick import."""

import ast
import json
import re
import subprocess
import sys
from collections import defaultdict
from functools import cache
from graphlib import TopologicalSorter
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).parents[1]
SRC, TESTS = ROOT / "src", ROOT / "tests"
DESIGN = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").split("**Imports run one way.**")[1]
LIBRARY, WING = DESIGN.split("Inside the wing as well:")
LONGEST = 400  # lines of a file, docstrings aside
# a door, or a method, hands on to the wing, and loads it when it is first used
ATOP = ["pidalab.__main__", "pidalab.warm_up"]  # what a user runs
HANDS_ON = {
    "pidalab.identification": "pidalab.plant.fitting",
    "pidalab.digital": "pidalab.plant.code.json_reader",
    "pidalab.digital.controller": "pidalab.plant.code.files",
    **dict.fromkeys(
        ["pidalab.controllers.base", "pidalab.controllers.parallel", "pidalab.rules._design"],
        "pidalab.plant.vendor",
    ),
}


def lines(text, package):
    """Rooms of a package, a list for each line: one imports only from those on earlier lines, and from its own."""
    text = text.split("Imports for types count")[0]
    rooms = [line.strip().split("  ")[0] for line in text.splitlines() if line.startswith(7 * " ")]
    return [[f"{package}.{room}" for room in re.findall(r"\w+", line)] for line in rooms]


HELPERS = sorted(
    f"pidalab.{path.stem}" for path in (SRC / "pidalab").glob("_*.py") if not path.stem.startswith("__")
)
CORRIDOR = [HELPERS, *lines(LIBRARY, "pidalab")]
ROAD = lines(WING, "pidalab.plant")


def name_of(path):
    """Dotted name of a module."""
    parts = path.relative_to(SRC).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(path): path for path in sorted(SRC.rglob("*.py"))}
OTHERS = [
    path
    for folder in ("book", "studies", "benchmarks", "tools")
    for path in sorted((ROOT / folder).rglob("*"))
    if path.suffix in (".py", ".ipynb") and not {".ipynb_checkpoints", "__pycache__"} & set(path.parts)
]


def code_of(path):
    """Python text of a module or a notebook, without the notebook's magics."""
    if path.suffix == ".py":
        return path.read_text(encoding="utf-8")
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    source = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    return re.sub(r"^\s*[%!].*$", "", source, flags=re.MULTILINE)


def imported(path):
    """Dotted names that a file imports, in functions and for types, too."""
    for node in ast.walk(ast.parse(code_of(path))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: a relative import hides where the arrow goes"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@cache
def arrows(module):
    """Modules of ours that a module imports."""
    found = {
        name if name in MODULES else name.rpartition(".")[0]
        for name in imported(MODULES[module])
        if name.split(".")[0] in ("pidalab", "paperledger")
    }
    return found - {module}


def room(module, package="pidalab"):
    """The part of a package that a module belongs to."""
    inner = module.removeprefix(f"{package}.")
    return f"{package}.{inner.split('.')[0]}" if inner != module else module


def in_wing(module):
    return f"{module}.".startswith("pidalab.plant.")


@pytest.mark.parametrize(
    ("package", "order"), [("pidalab", CORRIDOR), ("pidalab.plant", ROAD)], ids=["library", "wing"]
)
def test_every_room_has_its_place(package, order):
    places = [one for line in order for one in line]
    assert len(order) > 4
    assert len(set(places)) == len(places)
    rooms = {room(module, package) for module in MODULES if module.startswith(f"{package}.")}
    assert rooms - {*places, *ATOP} == set(), "CONTRIBUTING does not name it"


@pytest.mark.parametrize("module", [m for m in MODULES if m.startswith("pidalab.")])
def test_imports_run_one_way(module):
    for package, order in (("pidalab", [*CORRIDOR, ATOP]), ("pidalab.plant", ROAD)):
        if module == package or not module.startswith(f"{package}."):
            continue
        place = {one: i for i, line in enumerate(order) for one in line}
        for target in arrows(module):
            if not target.startswith(f"{package}.") or HANDS_ON.get(module, target) != target:
                assert package != "pidalab" or target != package or module in ATOP, (
                    f"{module} imports the whole library"
                )
                continue
            if HANDS_ON.get(module) == target:
                continue
            assert place[room(target, package)] <= place[room(module, package)], (
                f"{module} imports {target}, which comes later"
            )


def test_no_circles():
    graph = {module: arrows(module) - {HANDS_ON.get(module)} for module in MODULES}
    order = list(TopologicalSorter(graph).static_order())
    assert set(order) >= set(MODULES)


def test_three_doors():
    """The library does not know the wing but where it hands its names on; the account and control do not meet."""
    for module in MODULES:
        for target in arrows(module):
            if in_wing(target):
                assert in_wing(module) or module == "pidalab.__main__" or HANDS_ON.get(module) == target
            assert module.split(".")[0] == target.split(".")[0], f"{module} imports {target}"


def private_uses(path, package):
    """Names with a leading underscore that a file takes from another package than its own."""
    for name in imported(path):
        parts = name.split(".")
        if parts[0] not in ("pidalab", "paperledger"):
            continue
        for k, part in enumerate(parts):
            owner = ".".join(parts[:k])
            if (
                part.startswith("_")
                and not part.startswith("__")
                and not f"{package}.".startswith(f"{owner}.")
            ):
                yield name


@pytest.mark.parametrize("path", [*MODULES.values(), *OTHERS], ids=lambda p: p.relative_to(ROOT).as_posix())
def test_private_names_stay_at_home(path):
    """`_x` of a package is for files of that package: no page, study or other package imports it."""
    package = name_of(path) if path.is_relative_to(SRC) else ""
    assert list(private_uses(path, package)) == []


def without_docstrings(path):
    """Lines of a file that are no docstring."""
    text = path.read_text(encoding="utf-8")
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef)
    texts = [
        node.body[0]
        for node in ast.walk(ast.parse(text))
        if isinstance(node, kinds) and ast.get_docstring(node)
    ]
    return len(text.splitlines()) - sum(text.end_lineno - text.lineno + 1 for text in texts)


@pytest.mark.parametrize(
    "path", [*SRC.rglob("*.py"), *(ROOT / "book" / "papers").rglob("*.py")], ids=lambda p: p.stem
)
def test_files_can_be_read_in_one_sitting(path):
    assert without_docstrings(path) <= LONGEST


def test_a_constant_is_bound_once():
    """One meaning a name, in all of a package: a second binding changes, or seems to mean, what the first one does."""
    homes = defaultdict(list)
    for module, path in MODULES.items():
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.Assign | ast.AnnAssign):
                for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                    for name in ast.walk(target):
                        if isinstance(name, ast.Name) and name.id.isupper():
                            homes[module.partition(".")[0], name.id].append(module)
    assert {name: found for name, found in homes.items() if len(found) > 1} == {}


def test_a_quick_import():
    """Who only wants the ledger, or a process, does not wait for what takes long to import, nor for the wing."""
    heavy = ["control", "matplotlib", "numba", "pandas", "scipy"]
    for code, closed in (
        ("import pidalab", [*heavy, "pidalab.plant"]),
        ("import paperledger", [*heavy, "pidalab"]),
        ("import pidalab; pidalab.Loop(pidalab.lags(3), pidalab.PIDA(1, 2))", [*heavy, "pidalab.plant"]),
        ("from pidalab.identification import three_point; import pidalab.comparison", ["pidalab.plant"]),
        ("import pidalab; pidalab.PIDA(1, 2).discretise(0.1).step(1, 0)", ["jinja2", "pidalab.plant"]),
    ):
        show = f"import json, sys; {code}; print(json.dumps([n for n in {closed} if n in sys.modules]))"
        run = subprocess.run([sys.executable, "-c", show], capture_output=True, text=True, check=True)
        assert json.loads(run.stdout) == [], code


@pytest.mark.parametrize("package", ["pidalab", "pidalab.plant"])
def test_names_at_the_door_have_one_home(package):
    """Each name that the stub has is there; none hides a module, or the other way round."""
    stub = SRC.joinpath(*package.split("."), "__init__.pyi")
    found = [
        node for node in ast.parse(stub.read_text(encoding="utf-8")).body if isinstance(node, ast.ImportFrom)
    ]
    homes = [(alias.name, node.module) for node in found for alias in node.names]
    door = import_module(package)
    assert sorted(door.__all__) == sorted(name for name, _ in homes)
    for name, module in homes:
        home = import_module(f"{package}.{module or name}")
        assert getattr(door, name) is (getattr(home, name) if module else home)
    rooms = {room(module, package) for module in MODULES}
    assert {f"{package}.{name}" for name, module in homes if module}.isdisjoint(rooms)


@pytest.mark.parametrize("package", [name_of(path) for path in SRC.rglob("*/__init__.py")])
def test_no_function_hides_a_module(package):
    """`import pidalab.x.y as y` gives the module y, whatever x takes out of it."""
    inner = [m for m in MODULES if m.rpartition(".")[0] == package and not m.endswith("__main__")]
    for module in inner:
        found = import_module(module)
        assert getattr(import_module(package), module.rpartition(".")[2]) is found


def test_unknown_names_are_refused():
    import pidalab

    for door in (pidalab, pidalab.plant, pidalab.identification, pidalab.digital):
        with pytest.raises(AttributeError, match="nonsense"):
            _ = door.nonsense
    assert set(dir(pidalab)) >= set(pidalab.__all__)
    assert pidalab.__version__


def test_helpers_have_names_of_their_own():
    """The folders that tests import from stand on one path: of two modules of one name the first hides the other."""
    text = (TESTS / "conftest.py").read_text(encoding="utf-8")
    folders = re.search(r"for folder in \(([^)]*)\)", text)[1]
    names = [
        path.stem
        for folder in re.findall(r'"(\w+)"', folders)
        for path in (TESTS / folder).glob("*.py")
        if not path.stem.startswith(("test_", "conftest", "__"))
    ]
    assert len(names) > 9
    assert sorted(names) == sorted({*names})


def test_a_draw_leaves_out_long_tests_alone(monkeypatch):
    """What is named as long is there; chapters and short tests always run, and all of a notebook or nothing."""
    spec = spec_from_file_location("the_conftest", TESTS / "conftest.py")
    conftest = module_from_spec(spec)
    monkeypatch.setattr(sys, "path", [*sys.path])
    spec.loader.exec_module(conftest)
    monkeypatch.setattr(conftest, "DRAW", 10)

    def share(path, tests=1000):
        return sum(conftest.drawn(SimpleNamespace(nodeid=f"{path}::test_{k}")) for k in range(tests)) / tests

    assert [share("tests/test_algebra.py"), share("book/huba2018.ipynb")] == [1.0, 1.0]
    assert 0.05 < share("tests/fuzz/test_hostile.py") < 0.15
    cells = {conftest.drawn(SimpleNamespace(nodeid=f"book/audit/heo2023.ipynb::Cell {k}")) for k in range(40)}
    assert len(cells) == 1
    assert all(next(ROOT.glob(f"{start}*"), None) for start in conftest.LONG)
    assert "DRAW=1 runs all" in conftest.pytest_report_header()
