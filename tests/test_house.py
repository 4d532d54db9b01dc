"""Check that imports follow the order in CONTRIBUTING, packages are independent, and `import pidalab` is fast."""

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
SRC = ROOT / "src"
DESIGN = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").split("**Imports run one way.**")[1]
LIBRARY, WING = DESIGN.split("The modules of `plant` are ordered, too:")
# modules that import `pidalab.plant` when it is first used
ATOP = ["pidalab.__main__", "pidalab.warm_up"]  # programs that a user runs
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
    """Return a list of modules for each line. A module imports only from earlier lines and itself."""
    text = text.split("Imports that only type checkers see count")[0]
    rooms = [line.strip().split("  ")[0] for line in text.splitlines() if line.startswith(7 * " ")]
    return [[f"{package}.{room}" for room in re.findall(r"\w+", line)] for line in rooms]


HELPERS = sorted(
    f"pidalab.{path.stem}" for path in (SRC / "pidalab").glob("_*.py") if not path.stem.startswith("__")
)
CORRIDOR = [HELPERS, *lines(LIBRARY, "pidalab")]
ROAD = lines(WING, "pidalab.plant")


def name_of(path):
    """Return the dotted name of a module."""
    parts = path.relative_to(SRC).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(path): path for path in sorted(SRC.rglob("*.py"))}


def imported(path):
    """Yield the dotted names that a file imports, also in functions and for types."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: a relative import hides where the arrow goes"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@cache
def arrows(module):
    """Return the modules of the project that a module imports."""
    modules = {
        name if name in MODULES else name.rpartition(".")[0]
        for name in imported(MODULES[module])
        if name.split(".")[0] in ("pidalab", "paperledger")
    }
    return modules - {module}


def room(module, package="pidalab"):
    """Return the direct child of a package that a module belongs to."""
    inner = module.removeprefix(f"{package}.")
    return f"{package}.{inner.split('.')[0]}" if inner != module else module


def in_wing(module):
    return f"{module}.".startswith("pidalab.plant.")


def misplaced():
    """Yield each import that breaks the order in CONTRIBUTING, or imports the whole library."""
    for package, order in (("pidalab", [*CORRIDOR, ATOP]), ("pidalab.plant", ROAD)):
        place = {part: i for i, line in enumerate(order) for part in line}
        for module in (m for m in MODULES if m.startswith(f"{package}.")):
            part = room(module, package)
            if part not in place:
                yield f"CONTRIBUTING does not name {part}"
                continue
            for target in arrows(module) - {HANDS_ON.get(module)}:
                if target == "pidalab" and module not in ATOP and ".cli." not in module:
                    yield f"{module} imports the whole library"
                elif target.startswith(f"{package}.") and place.get(room(target, package), 99) > place[part]:
                    yield f"{module} imports {target}, which comes later"


def test_imports_follow_the_order():
    assert [*misplaced()] == []


def test_no_circular_imports():
    graph = {module: arrows(module) - {HANDS_ON.get(module)} for module in MODULES}
    order = list(TopologicalSorter(graph).static_order())
    assert set(order) >= set(MODULES)


def test_packages_stay_apart():
    """The library imports `pidalab.plant` only to re-export names. pidalab and paperledger do not import each other."""
    for module in MODULES:
        for target in arrows(module):
            if in_wing(target):
                assert in_wing(module) or module == "pidalab.__main__" or HANDS_ON.get(module) == target
            assert module.split(".")[0] == target.split(".")[0], f"{module} imports {target}"


def test_imports_are_lazy():
    """Slow packages and `pidalab.plant` are imported only when they are used."""
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
def test_public_names_match_the_stub(package):
    """Each name of the stub exists and comes from its module. No name hides a module."""
    stub = SRC.joinpath(*package.split("."), "__init__.pyi")
    imports = [
        node for node in ast.parse(stub.read_text(encoding="utf-8")).body if isinstance(node, ast.ImportFrom)
    ]
    homes = [(alias.name, node.module) for node in imports for alias in node.names]
    door = import_module(package)
    assert sorted(door.__all__) == sorted(name for name, _ in homes)
    for name, module in homes:
        home = import_module(f"{package}.{module or name}")
        assert getattr(door, name) is (getattr(home, name) if module else home)
    rooms = {room(module, package) for module in MODULES}
    assert {f"{package}.{name}" for name, module in homes if module}.isdisjoint(rooms)


def test_unknown_names_are_refused():
    import pidalab

    for door in (pidalab, pidalab.plant, pidalab.identification, pidalab.digital):
        with pytest.raises(AttributeError, match="nonsense"):
            _ = door.nonsense
    assert set(dir(pidalab)) >= set(pidalab.__all__)
    assert pidalab.__version__
