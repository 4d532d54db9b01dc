"""Shake a library at its doors: every number that leaves it is off by a few parts in 100,000.

A page that takes a number from a paper, or from a ledger, still has the same number then. A page that takes it from the
library has another one. `Shaker` changes the modules of a package while they are imported; their files stay.

Only the outermost call is off. What functions of the package give to each other is exact, so that searches converge as
always, and so is compiled code. The change is not a common factor: quotients of two results are off as well.
"""

import ast
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum
from functools import wraps
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from inspect import isgenerator
from math import isfinite, log, sin
from types import FunctionType, MappingProxyType, ModuleType
from typing import Any
from zlib import crc32

import numpy as np

SIZE = 1e-5  # a number is off by two to six times this
PRINTS = 1e-3  # what a page reads in print is off by so much less
CACHED = "cached_property"
SHOWN = ("__call__",)  # of the names with underscores these are doors
LEFT = ("setter", "deleter", "overload", "contextmanager")  # decorators of what is no door
Off = Callable[[Any, str], Any]


@dataclass
class Shaker:
    """What to shake, and what to leave.

    Parameters
    ----------
    package : str
        Name of the package whose public functions, methods and properties are the doors.
    exact : frozenset of str, optional
        Functions that only put together what they are given, such as ``demo.plant.make_plant``: off by nothing.
    fields : frozenset of str, optional
        Fields of objects that stay, such as times.
    whole : dict of str to function, optional
        By the name of a class of the package, how to shake an object of it as a whole: a function of the object and of
        `off`. By default all of its fields are shaken, each by itself.
    compiled : frozenset of str, optional
        Decorators of functions that are compiled, which stay as they are.
    left : frozenset of str, optional
        Names of classes of the package whose objects stay as they are, such as compiled functions.
    size : float, optional
        How much.
    only_prints : bool, optional
        Leave the library exact, and shake what pages read in print: what is called computed has to stay.

    Examples
    --------
    >>> shaker = Shaker("demo")
    >>> f"{shaker.off(1.0, 'demo.gain') - 1:.1e}", f"{shaker.off(2.0, 'demo.gain') / 2 - 1:.1e}"
    ('2.5e-05', '2.0e-05')
    >>> shaker.off({"orders": [1, 2], "name": "PID"}, "demo.orders")
    {'orders': [1, 2], 'name': 'PID'}
    """

    package: str
    exact: frozenset[str] = frozenset()
    fields: frozenset[str] = frozenset()
    whole: Mapping[str, Callable[[Any, Off], Any]] = field(default_factory=dict)
    compiled: frozenset[str] = frozenset()
    left: frozenset[str] = frozenset()
    size: float = SIZE
    only_prints: bool = False
    used: set[str] = field(default_factory=set)
    _inside: int = 0

    # ------------------------------------------------------------------------------------------------ numbers

    def off(self, value: Any, key: str) -> Any:
        """Return a result slightly off; a number that is whole, 0 or infinite stays.

        Parameters
        ----------
        value : any
            A number, an array, a container of these, or an object of the package.
        key : str
            The door it leaves by.

        Returns
        -------
        any
            Of the same kind; what was given stays unchanged.
        """
        return self._walk(value, key, {})

    def _walk(self, value: Any, key: str, seen: dict[int, Any]) -> Any:
        if isinstance(value, str | bytes | bool | int | Enum | type | ModuleType | None):
            return value
        if isinstance(value, float | complex | np.inexact):
            size = float(np.abs(value))
            if not isfinite(size) or size == 0:
                return value
            kind: Any = type(value)
            return kind(value * (1 + self._part(key, log(size))))
        if id(value) in seen:
            return seen[id(value)][0]
        found = self._compound(value, key, seen)
        seen[id(value)] = found, value  # kept, so that nothing else gets its number while this goes on
        return found

    def _compound(self, value: Any, key: str, seen: dict[int, Any]) -> Any:
        if isinstance(value, np.ndarray):
            return self._array(value, key, seen)
        if isinstance(value, dict):
            return type(value)((name, self._walk(one, key, seen)) for name, one in value.items())
        if isinstance(value, MappingProxyType):
            return MappingProxyType({name: self._walk(one, key, seen) for name, one in value.items()})
        if isinstance(value, tuple | list | set | frozenset):
            parts = [self._walk(one, key, seen) for one in value]
            return type(value)(*parts) if hasattr(value, "_fields") else type(value)(parts)
        if hasattr(value, "to_numpy") and hasattr(value, "iloc"):  # of pandas
            numeric = value.map if hasattr(value, "map") else value.applymap
            return numeric(lambda one: self._walk(one, key, seen))
        if isinstance(value, FunctionType):
            return self.door(value)
        if isgenerator(value):
            return (self._walk(one, key, {}) for one in value)
        package = type(value).__module__.partition(".")[0]
        if package == self.package and hasattr(value, "__dict__") and type(value).__name__ not in self.left:
            return self._object(value, key, seen)
        return value

    def _array(self, value: np.ndarray, key: str, seen: dict[int, Any]) -> np.ndarray:
        if value.dtype == object:
            return np.array([self._walk(one, key, seen) for one in value.ravel()], object).reshape(
                value.shape
            )
        if value.dtype.kind not in "fc":
            return value
        size = np.abs(value)
        live = np.isfinite(value) & (size > 0)
        found = np.array(value)
        found[live] *= 1 + self._part(key, np.log(size[live]))
        found.setflags(write=value.flags.writeable)
        return found

    def _object(self, value: Any, key: str, seen: dict[int, Any]) -> Any:
        for kind in type(value).__mro__:
            if kind.__name__ in self.whole:
                return self.whole[kind.__name__](
                    value, lambda one, name: self._walk(one, f"{key}.{name}", seen)
                )
        found = object.__new__(type(value))
        seen[id(value)] = found, value
        for name, one in value.__dict__.items():
            if isinstance(getattr(type(value), name, None), _CachedDoor):
                continue  # to be found anew
            kept = name in self.fields
            found.__dict__[name] = one if kept else self._walk(one, f"{key}.{name}", seen)
        return found

    def _part(self, key: str, place: Any) -> Any:
        """How far off, relative; nobody's factor, and for no two doors the same."""
        phase = crc32(key.encode()) % 6283 / 1000
        return self.size * (4 + 2 * (np.sin if isinstance(place, np.ndarray) else sin)(phase + place))

    # ------------------------------------------------------------------------------------------------ doors

    def door(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function whose result is off where the outermost call leaves the package."""
        key = f"{function.__module__}.{function.__qualname__}"

        @wraps(function)
        def through(*args: Any, **options: Any) -> Any:
            return self._leave(key, lambda: function(*args, **options))

        return through

    def wall(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function behind which all is exact, and whose result is: a constructor, an operator."""

        @wraps(function)
        def within(*args: Any, **options: Any) -> Any:
            self._inside += 1
            try:
                return function(*args, **options)
            finally:
                self._inside -= 1

        return within

    def _leave(self, key: str, call: Callable[[], Any]) -> Any:
        if self._inside:
            return call()
        if key in self.exact:
            return self.wall(call)()
        self.used.add(key)
        self._inside += 1
        try:
            found = call()
        finally:
            self._inside -= 1
        return self.off(found, key)

    @contextmanager
    def shaking(self) -> Iterator[None]:
        """Import the package with doors; it must not have been imported before."""
        if self.package in sys.modules:
            raise ImportError(f"{self.package} was imported before it could be shaken")
        finder = _Finder(self)
        sys.meta_path.insert(0, finder)
        try:
            yield
        finally:
            sys.meta_path.remove(finder)


class _CachedDoor:
    """A cached property whose stored value is exact, and off where it leaves the package."""

    def __init__(self, shaker: Shaker, function: Callable[[Any], Any]) -> None:
        self.shaker, self.function, self.name = shaker, function, function.__name__
        self.__doc__ = function.__doc__

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        if instance is None:
            return self

        def exact() -> Any:
            if self.name not in instance.__dict__:
                instance.__dict__[self.name] = self.function(instance)
            return instance.__dict__[self.name]

        return self.shaker._leave(f"{self.function.__module__}.{self.function.__qualname__}", exact)

    def __set__(self, instance: Any, value: Any) -> None:
        instance.__dict__[self.name] = value


class _Doors(ast.NodeTransformer):
    """Put a door on each public function, method and property of a module; functions in functions are private."""

    def __init__(self, shaker: Shaker) -> None:
        self.compiled, self.left = shaker.compiled, shaker.left

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        return node if node.name in self.left else self.generic_visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        words = [ast.unparse(one) for one in node.decorator_list]
        heads = {word.partition("(")[0].rpartition(".")[2] for word in words}
        if heads & {*self.compiled, *LEFT}:
            return node
        if node.name.startswith("__") and node.name not in SHOWN and not words:
            node.decorator_list = [ast.Name("__wall__", ast.Load())]
        elif node.name.startswith("_") and node.name not in SHOWN:
            return node
        elif CACHED in heads:
            node.decorator_list = [ast.Name("__cached_door__", ast.Load())]
        else:  # outside of a cache, else inside of all
            place = 0 if any("cache" in head for head in heads) else len(words)
            node.decorator_list.insert(place, ast.Name("__door__", ast.Load()))
        return ast.fix_missing_locations(node)


class _Loader(SourceFileLoader):
    """Loads a module with doors; nothing is written beside it."""

    shaker: Shaker

    def get_code(self, fullname: str) -> Any:
        path = self.get_filename(fullname)
        tree = ast.parse(self.get_data(path))
        if not any(part.startswith("_") for part in fullname.split(".")):  # else it is nobody's door
            tree = _Doors(self.shaker).visit(tree)
        return compile(tree, path, "exec", dont_inherit=True)

    def exec_module(self, module: ModuleType) -> None:
        shaker = self.shaker
        module.__dict__["__door__"] = shaker.door
        module.__dict__["__wall__"] = shaker.wall
        module.__dict__["__cached_door__"] = lambda function: _CachedDoor(shaker, function)
        shaker._inside += 1  # what the package gives to itself while it is imported
        try:
            super().exec_module(module)
        finally:
            shaker._inside -= 1
            for name in ("__door__", "__wall__", "__cached_door__"):  # no page sees that it is shaken
                del module.__dict__[name]


class _Finder(MetaPathFinder):
    def __init__(self, shaker: Shaker) -> None:
        self.shaker = shaker

    def find_spec(self, fullname: str, path: Any, target: Any = None) -> ModuleSpec | None:
        if fullname.partition(".")[0] != self.shaker.package:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _Loader(spec.loader.name, spec.loader.path)
            spec.loader.shaker = self.shaker
        return spec
