"""A search is asked whether it succeeded, everywhere; the border of a property, from both sides."""

import ast
import json
import math
from pathlib import Path

import pytest
from scipy.optimize import minimize, root, root_scalar

from pidalab.roots import border, succeeded

ROOT = Path(__file__).parents[1]
# what returns a result that says whether the search succeeded
ASKED = {
    "basinhopping", "differential_evolution", "direct", "dual_annealing", "least_squares", "linprog", "lsq_linear",
    "milp", "minimize", "minimize_scalar", "root", "root_scalar", "shgo",
}  # fmt: skip
# what warns at most, or says so in a number: `root`, `minimize` and `least_squares` do the same and say it better
NEVER = {"fmin", "fmin_bfgs", "fmin_cg", "fmin_l_bfgs_b", "fmin_slsqp", "fmin_powell", "fsolve", "leastsq"}
BRACKETS = {
    "bisect",
    "brenth",
    "brentq",
    "newton",
    "ridder",
    "toms748",
}  # these raise, unless they are told not to
ANSWERS = {"success", "converged"}
# results that are no answer but a place to go on from: what is used of them is judged by other means
ON_THE_WAY = {
    "src/pidalab/optimal/_solver.py: descend": "value and limits of the end are computed, and it is polished",
    "src/pidalab/optimal/_starts.py: relax": "the end is taken if it misses the limits by less than the start",
    "benchmarks/optimum.py: evolution": "a goal or the time ends it; its best is kept with its error",
    "studies/optimal_check.py: second": "a budget, not a tolerance, ends it; limits of the end are judged",
}


def sources():
    """Python of the project, by name: files, and the cells of notebooks."""
    for folder in ("src", "book", "studies", "tools", "benchmarks"):
        for path in sorted((ROOT / folder).rglob("*")):
            name = str(path.relative_to(ROOT))
            if path.suffix == ".py":
                yield name, path.read_text(encoding="utf-8")
            elif path.suffix == ".ipynb" and ".ipynb_checkpoints" not in path.parts:
                cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
                code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
                lines = "\n".join(code).splitlines()
                yield name, "\n".join(line for line in lines if not line.lstrip().startswith(("%", "!")))


def called(node):
    """Name of what a call calls, without what it belongs to."""
    if not isinstance(node, ast.Call):
        return ""
    return getattr(node.func, "id", getattr(node.func, "attr", ""))


def told(call, name):
    """The constant that a call passes by name, None without one."""
    return next(
        (k.value.value for k in call.keywords if k.arg == name and isinstance(k.value, ast.Constant)), None
    )


def unasked(text):
    """Where a source uses a search without asking whether it succeeded: name of the function, or the line."""
    tree = ast.parse(text)
    imported = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("scipy.optimize")
        for alias in node.names
    }
    whole = any(
        alias.name.startswith("scipy")
        for node in ast.walk(tree)
        if isinstance(node, (ast.Import, ast.ImportFrom))
        for alias in node.names
    ) or any(isinstance(n, ast.ImportFrom) and n.module == "scipy" for n in ast.walk(tree))
    places = {}  # of every node, the innermost function
    for node in ast.walk(tree):  # outer ones come first
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Module)):
            places |= dict.fromkeys(ast.walk(node), node)
    for node in ast.walk(tree):
        name = called(node)
        searches = name in ASKED | NEVER | BRACKETS and (
            name in imported or (whole and isinstance(node.func, ast.Attribute))
        )
        if not searches:
            continue
        if name in BRACKETS:
            asked = told(node, "disp") is not False and not told(node, "full_output")
        else:
            asked = name in ASKED and is_asked(node, places[node])
        if not asked:
            yield getattr(places[node], "name", f"line {node.lineno}")


def is_asked(call, function):
    """Whether the success of a call is read: by `succeeded`, or as an attribute of the name that it is given."""
    names = set()
    for node in ast.walk(function):
        if called(node) == "succeeded" and call in ast.walk(node):
            return True
        if isinstance(node, (ast.Assign, ast.AnnAssign, ast.NamedExpr)) and node.value is call:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names |= {target.id for target in targets if isinstance(target, ast.Name)}
    return any(
        (isinstance(node, ast.Attribute) and node.attr in ANSWERS and getattr(node.value, "id", "") in names)
        or (called(node) == "succeeded" and any(getattr(arg, "id", "") in names for arg in node.args))
        for node in ast.walk(function)
    )


def test_every_search_is_asked_whether_it_succeeded():
    found = {f"{name}: {where}" for name, text in sources() if "scipy" in text for where in unasked(text)}
    assert found == set(ON_THE_WAY)


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("from scipy.optimize import minimize\nx = minimize(f, [0.0]).x", 1),
        (
            "from scipy import optimize\ndef g():\n    found = optimize.minimize(f, [0.0])\n    return found.x",
            1,
        ),
        ("from scipy.optimize import fsolve\nx = fsolve(f, 0.0)", 1),
        ("from scipy.optimize import brentq\nx, _ = brentq(f, 0.0, 1.0, full_output=True)", 1),
        ("from scipy.optimize import root\nfound = root(f, 0.0)\nassert found.success\nprint(found.x)", 0),
        ("from scipy.optimize import minimize\nx = succeeded(minimize(f, [0.0]), 'x').x", 0),
        ("def root():\n    pass\nroot()", 0),
    ],
)
def test_a_planted_search_that_nobody_asks_is_found(text, count):
    assert len(list(unasked(text))) == count


def test_a_search_that_failed_is_no_answer():
    def valley(x):
        return (x[0] - 1) ** 2 + 100 * (x[1] - x[0] ** 2) ** 2

    short = minimize(valley, [-1.2, 1.0], method="Nelder-Mead", options={"maxiter": 20})
    with pytest.raises(
        ArithmeticError, match=r"the valley was not found: Maximum .* \(at .*, after \d+ values\)"
    ):
        succeeded(short, "the valley")
    with pytest.raises(ArithmeticError, match="a zero was not found"):
        succeeded(root(lambda x: x**2 + 1, 1.0), "a zero")
    with pytest.raises(ArithmeticError, match="a zero was not found: convergence error"):
        succeeded(root_scalar(lambda x: x**3 - 2, bracket=(0, 9), method="bisect", maxiter=3), "a zero")
    whole = minimize(valley, [-1.2, 1.0], method="Nelder-Mead")
    assert succeeded(whole, "the valley") is whole


@pytest.mark.parametrize(("inside", "outside"), [(0.0, 5.0), (-3.0, 4.0)])
def test_border_on_the_side_where_it_holds(inside, outside):
    found = border(lambda x: x < math.e, inside, outside)
    assert math.e * (1 - 2e-7) < found < math.e
    mirrored = border(lambda x: x > -math.e, -inside, -outside)
    assert mirrored == -found
