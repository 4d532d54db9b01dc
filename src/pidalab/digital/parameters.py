"""Parameters of a digital controller, and their checks."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from pidalab import _check
from pidalab.digital.filters import METHOD_WEIGHTS, METHODS, FilterChain, Prefilter, discrete_prefilter

ANTI_WINDUP = ("reset", "back-calculation", "clamping", "conditioning", None)
DISCRETE_ANTI_WINDUP = ("reset", "back-calculation", "clamping", None)
LARGEST_SIGNAL = 1e9  # a sample with a larger signal is skipped
LARGEST_PARAMETER = 1e9  # largest magnitude of a gain, if the gains may change while the controller runs
LARGEST_CONSTANT = 1e15  # with signals up to 1e9, larger constants could overflow in single precision
MOST_PATHS, MOST_PATH_LAGS = 40, 40  # with more paths, or more lags in a path, the code would be unreadable
# Largest number of lags in all paths together. The code grows with the square of the number of lags in a path.
MOST_CODE_LAGS = 160
SHARE_ROUNDING = 1e-6  # the sum of the two coefficients of a lag may exceed 1 by this rounding error


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """Fields of a `DigitalController`, which documents them.

    Every field is checked before it is used in written or executed code.
    """

    sample_time: float
    method: str
    paths: tuple[FilterChain, ...]
    integrates: bool
    from_signal: bool
    growth: tuple[float, float]
    back_calculation_gain: float
    tracking_gain: float
    anti_windup: str | None
    weights: tuple[float, float]
    limits: tuple[float, float]
    rate_limit: float = math.inf
    deadband: float = 0.0
    bias: float = 0.0
    y_offset: float = 0.0
    source: str = ""
    prefilter: Prefilter | None = None
    feedforward: bool = False
    tunable: bool = False

    def __post_init__(self) -> None:
        # The checks convert numbers to floats. The fields are frozen, so set them through vars.
        checked = _numbers(self)
        for name in ("integrates", "from_signal", "feedforward", "tunable"):
            checked[name] = _flag(name, getattr(self, name))
        _check.choice("method", self.method, METHODS)
        _check.choice("anti_windup", self.anti_windup, (*DISCRETE_ANTI_WINDUP, "clamping ahead"))
        if not isinstance(self.source, str):
            raise TypeError(f"source must be a text, found {type(self.source).__name__}")
        if not isinstance(self.paths, tuple) or len(self.paths) > MOST_PATHS:
            raise TypeError(
                f"paths must be a tuple of up to {MOST_PATHS} FilterChain, found {self.paths!r:.60}"
            )
        checked["paths"] = tuple(_path(f"paths[{i}]", path) for i, path in enumerate(self.paths))
        if (lags := sum(path.order for path in checked["paths"])) > MOST_CODE_LAGS:
            raise ValueError(f"paths must have at most {MOST_CODE_LAGS} lags together, found {lags}")
        if self.prefilter is not None:
            checked["prefilter"] = _prefilter(self)
        vars(self).update(checked)
        self._require_consistent()

    def _require_consistent(self) -> None:
        """Raise for fields that contradict each other."""
        low, high = self.limits
        if not low <= self.bias <= high:
            raise ValueError(f"bias must be within the limits ({low:g}, {high:g}), found {self.bias:g}")
        if not self.integrates and (any(self.growth) or self.from_signal):
            raise ValueError("without integral action, growth must be (0, 0) and from_signal False")
        new, old = METHOD_WEIGHTS[self.method]
        shares = [("growth", self.growth)]
        shares += [
            ("(new, old) of a lag", pair)
            for path in self.paths
            for pair in zip(path.new, path.old, strict=True)
        ]
        for what, (now, before) in shares:
            if (now and not new) or (before and not old) or (new == old and now != before):
                raise ValueError(
                    f"{what} must have the form (x, 0) with method 'backward', (x, x) with 'tustin' or (0, x) with "
                    f"'zoh', found {(now, before)} with {self.method!r}"
                )
        if self.tunable:
            largest = max([*map(abs, self.growth), *(abs(g) for p in self.paths for g in p.gains)])
            if largest > LARGEST_PARAMETER:
                raise ValueError(f"gains must be at most {LARGEST_PARAMETER:g} if tunable, found {largest:g}")

    @property
    def limited(self) -> bool:
        """True if the control signal has a limit of range or rate."""
        return bool(np.isfinite([*self.limits, self.rate_limit]).any())


def anti_windup_word(word: str | None, available: tuple[str | None, ...], where: str) -> str | None:
    """Check an anti-windup word against the available words, and return it. Return None for "none"."""
    word = None if word == "none" else word
    _check.choice("anti_windup", word, ANTI_WINDUP)
    if word not in available:
        words = " or ".join(map(repr, dict.fromkeys(available)))
        raise ValueError(f"anti_windup must be {words} {where}, found {word!r}")
    return word


def _numbers(k: Parameters) -> dict[str, Any]:
    """Check the numbers and the pairs of numbers, and return them by name."""
    checked: dict[str, Any] = {
        "sample_time": _check.real("sample_time", k.sample_time, above=0.0),
        "deadband": _check.real("deadband", k.deadband, at_least=0.0),
        "bias": _check.real("bias", k.bias),
        "y_offset": _check.real("y_offset", k.y_offset, at_least=-LARGEST_SIGNAL, at_most=LARGEST_SIGNAL),
        "limits": _check.limits(k.limits),
    }
    endless = isinstance(k.rate_limit, float) and k.rate_limit == math.inf
    checked["rate_limit"] = math.inf if endless else _check.real("rate_limit", k.rate_limit, above=0.0)
    for name in ("back_calculation_gain", "tracking_gain"):
        checked[name] = _check.real(name, getattr(k, name), at_least=0.0, at_most=1.0)
    for name in ("growth", "weights"):
        pair = _check.pair(name, "of the present and the previous sample", getattr(k, name))
        checked[name] = tuple(_constant(f"{name}[{i}]", x) for i, x in enumerate(pair))
    return checked


def _path(name: str, path: Any) -> FilterChain:
    if not isinstance(path, FilterChain):
        raise TypeError(f"{name} must be a FilterChain, found {type(path).__name__}")
    plain = isinstance(path.name, str) and re.fullmatch(r"[a-z](_?[a-z0-9])*", path.name)
    if not plain or len(path.name) > 60:
        raise ValueError(
            f"{name}.name must be an identifier of small letters, digits and single underscores that begins with a "
            f"letter and has at most 60 characters, found {path.name!r:.60}"
        )
    parts = {}
    for part in ("new", "old", "gains"):
        values = getattr(path, part)
        if not isinstance(values, tuple) or len(values) > MOST_PATH_LAGS + 1:
            raise TypeError(f"{name}.{part} must be a tuple of at most {MOST_PATH_LAGS + 1} numbers")
        parts[part] = tuple(_constant(f"{name}.{part}[{i}]", x) for i, x in enumerate(values))
    new, old, gains = parts.values()
    if not len(new) == len(old) == len(gains) - 1:
        raise ValueError(f"{name} needs one more gain than lags, found {len(gains)} gains, {len(new)} lags")
    for pair in zip(new, old, strict=True):
        if not (min(pair) >= 0.0 and 0.0 < sum(pair) <= 1.0 + SHARE_ROUNDING):
            raise ValueError(f"{name} must have lag coefficients >= 0 with 0 < sum <= 1, found {pair}")
    return FilterChain(path.name, _constant(f"{name}.weight", path.weight), new, old, gains)


def _prefilter(k: Parameters) -> Prefilter:
    """Check the coefficients of the prefilter, and discretise it for the sample time."""
    given = k.prefilter
    if not isinstance(given, Prefilter):
        raise TypeError(f"prefilter must be a Prefilter, found {type(given).__name__}")
    num, den = (_check.polynomial(f"prefilter.{name}", getattr(given, name)) for name in ("num", "den"))
    _check.proper("prefilter", num, den)
    if den.size > MOST_PATH_LAGS + 1:
        raise ValueError(f"prefilter must have at most {MOST_PATH_LAGS} poles, found {den.size - 1}")
    true = discrete_prefilter(num, den, k.sample_time, k.method)
    if true is None:
        raise ValueError("prefilter must be None if it is only a gain of 1")
    return true


def _constant(name: str, value: Any) -> float:
    return _check.real(name, value, at_least=-LARGEST_CONSTANT, at_most=LARGEST_CONSTANT)


def _flag(name: str, value: Any) -> bool:
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name} must be True or False, found {value!r:.60}")
    return bool(value)
