"""Every public name has a docstring with the sections that its signature and source call for."""

import dataclasses
import importlib
import inspect
import re
from functools import cached_property
from types import ModuleType

import pytest
from numpydoc.docscrape import FunctionDoc

MODULES = ["pidalab", "pidalab.rules", "pidalab.identification", "pidalab.ledger", "pidalab.plots"]


def members(module):
    """Public names of a module: __all__ where there is one, otherwise what it defines; a package may import them."""
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
    """Collect public functions, classes and methods; an object that has several names is collected once."""
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
    found, seen = {}, set()
    for name in MODULES:
        try:
            module = importlib.import_module(name)
        except ModuleNotFoundError as missing:
            if missing.name != name:
                raise
            continue
        found.update(walk(module, name, seen))
    return found


NAMES = collect()


class Subject:
    """One public name: its docstring, parameters and source."""

    def __init__(self, name):
        self.value = NAMES[name]
        self.property = isinstance(self.value, (property, cached_property))
        if self.property:
            self.function = getattr(self.value, "fget", None) or self.value.func
        else:
            self.function = self.value
        self.text = inspect.getdoc(self.function) or ""
        self.doc = FunctionDoc(None, doc=self.text) if self.text else {}

    @property
    def is_class(self):
        return inspect.isclass(self.value)

    @property
    def is_record(self):
        """A class that functions return and nobody constructs documents attributes instead of parameters."""
        return self.is_class and (
            issubclass(self.value, tuple)
            or bool(self.doc.get("Attributes"))
            or issubclass(self.value, Exception)
        )

    def parameters(self):
        if self.is_class and dataclasses.is_dataclass(self.value) and "__init__" not in vars(self.value):
            return [field.name for field in dataclasses.fields(self.value) if field.init]
        target = self.value.__init__ if self.is_class else self.function
        if self.is_class and target is object.__init__:
            return []
        names = inspect.signature(target).parameters
        return [name for name in names if name not in ("self", "cls")]

    def source(self):
        if not self.is_class:
            return inspect.getsource(self.function)
        hooks = [vars(self.value)[name] for name in ("__init__", "__post_init__") if name in vars(self.value)]
        return "".join(inspect.getsource(hook) for hook in hooks if hook.__code__.co_filename.endswith(".py"))

    def raises(self):
        return re.findall(r"^\s+raise (\w+)", self.source(), re.M)

    def returns_something(self):
        if self.is_class or self.property:
            return False
        annotation = inspect.signature(self.function).return_annotation
        return annotation not in (None, "None", inspect.Signature.empty)


@pytest.fixture(params=list(NAMES))
def subject(request):
    return Subject(request.param)


def test_the_walk_finds_what_users_call():
    for name in ("Process", "PIDA.transfer_function", "Loop.transfer", "margins", "simulate", "Response.iae"):
        assert f"pidalab.{name}" in NAMES
    for name in ("pidalab.rules.haalman.pida", "pidalab.identification.three_point"):
        assert name in NAMES
    assert len(NAMES) > 60
    assert not any("._" in name for name in NAMES)


def test_summary(subject):
    """One sentence on the first line, which is what an index page shows."""
    first = subject.text.split("\n")[0].strip()
    assert first, "no docstring"
    assert first[0].isupper() or not first[0].isalpha() or subject.is_record
    assert first.endswith((".", ".`", ":")) or subject.text.split("\n\n")[0].strip().endswith((".", ":"))


def test_parameters(subject):
    """As many as in the signature, with the same names, in the same order."""
    documented = [
        name.strip().lstrip("*")
        for entry in subject.doc.get("Parameters", [])
        for name in entry.name.split(",")
    ]
    if subject.property:
        assert documented == []
    elif subject.is_record and not documented:
        assert issubclass(subject.value, (tuple, Exception)) or subject.doc["Attributes"]
    else:
        assert documented == subject.parameters()


def test_parameters_have_a_type_and_a_text(subject):
    for entry in subject.doc.get("Parameters", []):
        assert entry.type, f"{entry.name} has no type"
        assert " ".join(entry.desc).strip(), f"{entry.name} has no description"


def test_returns(subject):
    if subject.returns_something():
        assert subject.doc.get("Returns") or subject.doc.get("Yields"), (
            "returns something, and does not say what"
        )
    elif not subject.is_class:
        assert not subject.doc.get("Returns") or subject.property


def test_raises(subject):
    """A raise in the source is documented, with its type."""
    documented = ", ".join(f"{entry.type} {entry.name}" for entry in subject.doc.get("Raises", []))
    for error in subject.raises():
        assert error in documented, f"raises {error}, and documents {documented or 'nothing'}"


def test_examples(subject):
    if subject.property or subject.is_record:
        return
    assert any(">>>" in line for line in subject.doc.get("Examples", [])), "no example"
