"""Check that every public name has a docstring with the sections that its signature and source need."""

import ast
import importlib
import inspect
import re
import textwrap
from functools import cached_property
from types import ModuleType

import pytest
from numpydoc.validate import validate

MODULES = ["pidalab", "pidalab.rules", "pidalab.identification", "paperledger", "pidalab.plots"]


def members(module):
    """Return the public names of a module: __all__, or its own definitions. A package may import them."""
    names = getattr(module, "__all__", None) or [
        name
        for name, value in vars(module).items()
        if not name.startswith("_")
        and (hasattr(module, "__path__") or getattr(value, "__module__", None) == module.__name__)
    ]
    return {name: getattr(module, name) for name in names if ours(getattr(module, name))}


def ours(value):
    name = value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", "")
    return (inspect.isclass(value) or inspect.isfunction(value) or isinstance(value, ModuleType)) and str(
        name
    ).startswith("pidalab")


def walk(module, path, seen):
    """Collect public functions, classes and methods. An object with several names is collected once."""
    for name, value in members(module).items():
        if id(value) in seen:
            continue
        seen.add(id(value))
        where = f"{path}.{name}"
        if isinstance(value, ModuleType):
            yield from walk(value, where, seen)
        else:
            yield where, value
            if inspect.isclass(value):
                yield from methods(value, where, seen)


def methods(kind, path, seen):
    ours = [base for base in kind.__mro__ if base.__module__.startswith("pidalab")]
    inherited = {name: raw for base in reversed(ours) for name, raw in vars(base).items()}
    for name, raw in inherited.items():
        value = raw.__func__ if isinstance(raw, (classmethod, staticmethod)) else raw
        function = (
            value.fget
            if isinstance(value, property)
            else value.func
            if isinstance(value, cached_property)
            else value
        )
        if not name.startswith("_") and inspect.isfunction(function) and id(function) not in seen:
            seen.add(id(function))
            if function.__module__.startswith("pidalab"):
                yield f"{path}.{name}", value


def collect():
    names, seen = {}, set()
    for name in MODULES:
        names.update(walk(importlib.import_module(name), name, seen))
    return names


NAMES = collect()
# numpydoc's checks of summary, parameters, returned values and examples
ASKED = {"GL08", "SS01", "SS02", "SS03", "PR01", "PR02", "PR03", "PR04", "PR07", "RT01", "EX01"}


def is_record(value):
    """Return True for a class that only functions construct. It documents attributes instead of parameters."""
    return inspect.isclass(value) and (
        issubclass(value, (tuple, Exception)) or "\nAttributes\n---" in (inspect.getdoc(value) or "")
    )


def needless(value):
    """Return the checks that do not apply to a kind of object."""
    if isinstance(value, (property, cached_property)):
        return {"EX01"}
    if is_record(value):
        return {"PR01", "PR02", "PR03", "EX01"}
    return {"GL08"} if inspect.getdoc(value) else set()  # the docstring of the method that it overrides


@pytest.mark.parametrize("name", NAMES)
def test_a_docstring_has_what_its_signature_calls_for(name):
    errors = validate(name)["errors"]
    assert [said for code, said in errors if code in ASKED - needless(NAMES[name])] == []


@pytest.mark.parametrize("name", [name for name in NAMES if not inspect.isclass(NAMES[name])])
def test_a_raise_in_the_source_is_documented(name):
    value = NAMES[name]
    function = getattr(value, "fget", None) or getattr(value, "func", value)
    text = inspect.getdoc(function) or ""
    documented = text.partition("\nRaises\n")[2]
    for node in ast.walk(ast.parse(textwrap.dedent(inspect.getsource(function)))):
        for error in re.findall(r"^raise (\w+)", ast.unparse(node)) if isinstance(node, ast.Raise) else ():
            assert error in documented, f"raises {error}"
