"""Disturbances of what claims stand on: each changes the library, or the page, before the checks are imported.

`claims.py` asks with them whether every claim can fail, `faults.py` plants errors of its own beside them.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import sys
from collections.abc import Callable, Iterable
from importlib import import_module
from pkgutil import walk_packages
from types import FunctionType, ModuleType
from typing import Any
from zlib import crc32

import numpy as np

ROOMS = (
    "areas",
    "robustness",
    "identification",
    "reduction",
    "rules",
    "simulation.noise",
    "optimal",
)
FACTORS = (
    1.011,
    0.983,
    1.027,
    0.991,
    1.019,
    0.973,
    1.007,
)  # neighbours change unequally, so that no ratio stays


def changed(value: Any, strength: float = 1.0, place: int = 0) -> Any:
    """Change every real or complex number inside a value; counts, texts and objects of the library stay."""
    factor = 1 + strength * (FACTORS[place % len(FACTORS)] - 1)
    if isinstance(value, bool | int | str | type(None)):
        return value
    if isinstance(value, float | complex | np.floating | np.complexfloating):
        return value * factor
    if isinstance(value, np.ndarray):
        return _changed_array(value, strength, place)
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return type(value)(*(changed(part, strength, place + i) for i, part in enumerate(value)))
    if isinstance(value, tuple | list):
        return type(value)(changed(part, strength, place + i) for i, part in enumerate(value))
    if isinstance(value, dict):
        return {key: changed(part, strength, place + i) for i, (key, part) in enumerate(value.items())}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return _changed_record(value, strength, place)
    if type(value).__module__.startswith("mpmath") and hasattr(value, "real"):
        return value * factor
    return value


def _changed_array(value: np.ndarray, strength: float, place: int) -> np.ndarray:
    if value.dtype.kind not in "fc":
        return value
    factors = 1 + strength * (
        np.resize(np.roll(FACTORS, -place % len(FACTORS)), value.size).reshape(value.shape) - 1
    )
    return value * factors


def _changed_record(value: Any, strength: float, place: int) -> Any:
    """A record keeps its type; controllers are left alone, as their constructor is disturbed."""
    if type(value).__module__.startswith(("pidalab.controllers", "pidalab.response")):
        return value
    fresh = object.__new__(type(value))
    for i, field in enumerate(dataclasses.fields(value)):
        object.__setattr__(fresh, field.name, changed(getattr(value, field.name), strength, place + i))
    for name, part in getattr(value, "__dict__", {}).items():
        if name not in fresh.__dict__:
            object.__setattr__(fresh, name, part)
    return fresh


def decided(value: Any, place: int = 0) -> Any:
    """Turn a decision round and move a count by one."""
    if isinstance(value, bool | np.bool_):
        return not value
    if isinstance(value, int):
        return value + 1
    if isinstance(value, np.ndarray) and value.dtype.kind in "bi":
        return ~value if value.dtype.kind == "b" else value + 1
    return value


def replaced(functions: Iterable[Callable[..., Any]], change: Callable[[Any, int], Any], prefix: str) -> None:
    """Put functions whose results are changed in place of others, in every module that knows them by name."""
    wrapped = {id(function): after(function, change) for function in functions}
    for name, module in [*sys.modules.items()]:
        if module is not None and name.partition(".")[0] == prefix:
            for key, value in [*vars(module).items()]:
                if id(value) in wrapped:
                    setattr(module, key, wrapped[id(value)])


def after(function: Callable[..., Any], change: Callable[[Any, int], Any]) -> Callable[..., Any]:
    """Return a function that changes the result of another, each by an amount of its own."""
    place = crc32(getattr(function, "__qualname__", "").encode())

    @functools.wraps(function)
    def disturbed(*arguments: Any, **options: Any) -> Any:
        return change(function(*arguments, **options), place)

    return disturbed


def library_functions() -> list[Callable[..., Any]]:
    """Public functions of the rooms that compute; the simulation is disturbed by its responses."""
    import pidalab

    for module in walk_packages(pidalab.__path__, "pidalab."):
        if not module.name.endswith("__main__") and ".ledger" not in module.name:
            import_module(module.name)
    modules = [
        module
        for name, module in [*sys.modules.items()]
        if any(name == f"pidalab.{room}" or name.startswith(f"pidalab.{room}.") for room in ROOMS)
    ]
    return [
        function for module in modules for function in _own(module) if not function.__name__.startswith("_")
    ]


def _own(module: ModuleType) -> list[Callable[..., Any]]:
    return [
        value
        for value in vars(module).values()
        if (isinstance(value, FunctionType) or hasattr(value, "cache_clear"))
        and getattr(value, "__module__", "") == module.__name__
    ]


# ------------------------------------------------------------------------------------------------ before the import


def processes(strength: float = 1.0) -> None:
    """Every process has another gain, other lags and another dead time."""
    from pidalab.process import Process

    make = Process.__init__

    def disturbed(self: Process, num: Any, den: Any, delay: float = 0.0) -> None:
        make(self, num, den, delay)
        powers = np.arange(self.den.size)[::-1]
        lags = 1 + strength * (0.023 * powers + 0.007 * powers**2)  # uneven, so that no damping stays
        self.__dict__["num"] = self.num * (1 + 0.031 * strength)
        self.__dict__["den"] = self.den * lags
        self.__dict__["delay"] = self.delay * (1 + 0.017 * strength)

    Process.__init__ = disturbed  # type: ignore[method-assign]


def another_lag() -> None:
    """Every process has a lag more, so that orders and counts change."""
    from pidalab.process import Process

    make = Process.__init__

    def disturbed(self: Process, num: Any, den: Any, delay: float = 0.0) -> None:
        make(self, num, np.convolve(den, [0.05, 1.0]), delay)

    Process.__init__ = disturbed  # type: ignore[method-assign]


def controllers(strength: float = 1.0) -> None:
    """Every controller has other gains and times."""
    from pidalab import controllers as module

    factors = {
        "kp": 0.02,
        "kc": 0.02,
        "ti": 0.03,
        "tau_i": 0.03,
        "td": -0.03,
        "tau_d": -0.03,
        "ta": 0.05,
        "kd": -0.03,
    }
    factors |= {
        "tau_a": 0.05,
        "ka": 0.05,
        "filter_time": 0.04,
        "n": 0.04,
        "m": 0.04,
        "alpha_d": 0.04,
        "alpha_a": 0.04,
    }

    def disturb(kind: type) -> None:
        make = kind.__init__

        @functools.wraps(make)
        def disturbed(self: Any, *arguments: Any, **options: Any) -> None:
            given = inspect.signature(make).bind(self, *arguments, **options)
            for name, value in given.arguments.items():
                if name in factors and isinstance(value, int | float) and not isinstance(value, bool):
                    given.arguments[name] = value * (1 + strength * factors[name])
                elif name == "gains":
                    given.arguments[name] = changed(np.asarray(value, dtype=float), strength)
            make(*given.args, **given.kwargs)

        kind.__init__ = disturbed  # type: ignore[misc]

    for kind in (module.PIDA, module.NonInteractivePIDA, module.HighOrderPID, module.SeriesPIDA):
        disturb(kind)


def responses(strength: float = 1.0) -> None:
    """Every response grows by a part of itself until its end."""
    from pidalab.response import Response

    make = Response.__post_init__

    def disturbed(self: Response) -> None:
        make(self)
        grows = 1 + 0.02 * strength * (0.5 + np.linspace(0.0, 1.0, self.t.size))
        for name in ("y", "u"):
            signal = np.asarray(getattr(self, name))
            object.__setattr__(self, name, signal * grows)

    Response.__post_init__ = disturbed  # type: ignore[method-assign]


def results(strength: float = 1.0) -> None:
    """Every function of the library that computes, the simulation apart, returns something else."""
    replaced(library_functions(), lambda value, place: changed(value, strength, place), "pidalab")


def methods(strength: float = 1.0) -> None:
    """Every method of processes, controllers, loops and responses that computes returns something else."""
    from pidalab import controllers as module
    from pidalab.loop import Loop
    from pidalab.process import Process
    from pidalab.response import Response

    kinds = (Process, Loop, Response, module.Controller, *module.Controller.__subclasses__())
    for kind in kinds:
        for name, method in [*vars(kind).items()]:
            if isinstance(method, FunctionType) and (name == "__call__" or not name.startswith("_")):
                setattr(kind, name, after(method, lambda value, place: changed(value, strength, place)))


def constants(strength: float = 1.0) -> None:
    """Every constant of the library's rules, limits and levels is another."""
    library_functions()  # imports every module
    for name, module in [*sys.modules.items()]:
        if any(name == f"pidalab.{room}" or name.startswith(f"pidalab.{room}.") for room in ROOMS):
            for place, (key, value) in enumerate([*vars(module).items()]):
                if key.lstrip("_").isupper():
                    setattr(module, key, changed(value, strength, place))


def decisions() -> None:
    """Every decision of the library is turned round, every count is one more."""
    replaced(library_functions(), decided, "pidalab")


def printed(strength: float = 1.0) -> None:
    """Every printed number that a check starts from is another."""
    from pidalab.ledger import Ledger

    read = Ledger.printed

    def disturbed(self: Ledger, id: str) -> float:
        return changed(read(self, id), strength, crc32(self.full(id).encode()))

    Ledger.printed = disturbed  # type: ignore[method-assign]


def tables(strength: float = 1.0) -> None:
    """Every table of stored results has other numbers."""
    import csv

    import pandas as pd

    read = pd.read_csv

    def disturbed(*arguments: Any, **options: Any) -> pd.DataFrame:
        frame = read(*arguments, **options)
        reals = frame.select_dtypes("float")
        return frame.assign(**{name: changed(frame[name].to_numpy(), strength) for name in reals})

    pd.read_csv = disturbed
    for name in ("loadtxt", "genfromtxt", "load"):
        setattr(np, name, after(getattr(np, name), lambda value, place: changed(value, strength, place)))

    def field(text: Any, place: int) -> Any:
        try:
            return repr(changed(float(text), strength, place)) if "." in text else text
        except ValueError:
            return text

    class Reader(csv.DictReader):
        """Rows with other numbers."""

        def __next__(self) -> dict[Any, Any]:
            row = super().__next__()
            return {key: field(value, i) for i, (key, value) in enumerate(row.items())}

    csv.DictReader = Reader  # type: ignore[misc]


# ------------------------------------------------------------------------------------------------ after the import


class Elsewhere:
    """A module in which some functions return something else."""

    def __init__(self, module: Any, names: Iterable[str], change: Callable[[Any, int], Any]) -> None:
        self._module = module
        for name in names:
            if hasattr(module, name):
                setattr(self, name, after(getattr(module, name), change))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._module, name)


NUMERICS = (
    "roots polyval polymul polyfit convolve exp sqrt log log10 interp trapezoid atan atan2 tan cos comb factorial prod "
    "quad polyroots minimize_scalar solve_ivp expm1"
)
SEARCHES = "brentq root_scalar findroot newton root fsolve minimize minimize_scalar"


def elementary(
    names: str = NUMERICS, strength: float = 1.0, prefixes: tuple[str, ...] = ("pidalab_checks", "pidalab")
) -> None:
    """Polynomials, exponentials, quadratures or searches that library and page call give something else."""
    import math

    import mpmath
    from scipy import integrate, optimize

    owners = (np, math, mpmath, integrate, optimize)
    others = {
        id(owner): Elsewhere(owner, names.split(), lambda value, place: changed(value, strength, place))
        for owner in owners
    }
    functions = [
        getattr(owner, name) for owner in owners[1:] for name in names.split() if hasattr(owner, name)
    ]
    single = {
        id(f): after(f, lambda value, place: changed(value, strength, place))
        for f in functions
        if callable(f)
    }
    for name, module in [*sys.modules.items()]:
        if name.partition(".")[0] in prefixes and module is not None and ".ledger" not in name:
            for key, value in [*vars(module).items()]:
                if id(value) in others or id(value) in single:
                    setattr(module, key, others.get(id(value)) or single[id(value)])


def seen_decisions(prefix: str = "pidalab_checks") -> None:
    """Every decision and count of the library is another where the page asks for it; inside the library it stays."""
    import pidalab

    names = ("is_stable", "unstable_poles")
    for name, module in [*sys.modules.items()]:
        if name.startswith(f"{prefix}.") and getattr(module, "pidalab", None) is pidalab:
            module.pidalab = Elsewhere(pidalab, names, decided)


def formulas(strength: float = 1.0, prefix: str = "pidalab_checks") -> None:
    """Every function of the page's own, the sections apart, returns something else."""
    modules = [module for name, module in [*sys.modules.items()] if name.startswith(f"{prefix}.")]
    sections = {id(section) for module in modules for section in getattr(module, "SECTIONS", ())}
    own = [function for module in modules for function in _own(module) if id(function) not in sections]
    replaced(own, lambda value, place: changed(value, strength, place), prefix)


def verdicts(prefix: str = "pidalab_checks") -> None:
    """Every decision of the page's own functions is turned round, every count is one more."""
    modules = [module for name, module in [*sys.modules.items()] if name.startswith(f"{prefix}.")]
    sections = {id(section) for module in modules for section in getattr(module, "SECTIONS", ())}
    own = [function for module in modules for function in _own(module) if id(function) not in sections]
    replaced(own, decided, prefix)
