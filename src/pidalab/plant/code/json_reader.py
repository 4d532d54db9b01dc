"""Read a digital controller from its JSON. The file is data only, and every field is checked."""

from __future__ import annotations

import json
import math
from typing import Any, NoReturn

from pidalab.digital.controller import DigitalController
from pidalab.digital.filters import FilterChain, Prefilter
from pidalab.digital.parameters import DISCRETE_ANTI_WINDUP, MOST_PATH_LAGS, MOST_PATHS
from pidalab.plant.code.files import checksum, content

LONGEST_FILE = 2_000_000  # characters, ten times the longest file that is written
LONGEST_TEXT = 20_000  # characters of the controller's description
ABOUT = {"about", "version", "checksum"}  # fields without influence on the controller


def from_json(text: str) -> DigitalController:
    """Read a controller from the text that its ``json()`` wrote.

    Nothing in the file is run or becomes code. The type and range of every field are checked. Coefficients and test
    vector are computed again, and a file that differs is refused.

    Parameters
    ----------
    text : str
        The file.

    Returns
    -------
    DigitalController
        The same controller, which starts with its first measurement.

    Raises
    ------
    TypeError
        If text is not a str.
    ValueError
        For text that is not such a file, and for a file that was changed.

    Examples
    --------
    >>> import pidalab
    >>> k = pidalab.PIDA(kp=2.0, ti=4.0).discretise(0.5, limits=(0.0, 10.0))
    >>> pidalab.digital.from_json(k.json()) == k
    True
    """
    if not isinstance(text, str):
        raise TypeError(f"text must be a str, found {type(text).__name__}")
    try:
        if len(text) > LONGEST_FILE:
            raise ValueError(f"it must have at most {LONGEST_FILE} characters, found {len(text)}")
        stored = json.loads(text, object_pairs_hook=_once, parse_constant=_no_number, parse_float=_finite)
        k = _controller(stored)
    except (LookupError, TypeError, ValueError, ArithmeticError, RecursionError) as wrong:
        raise ValueError(
            f"text must be the JSON of a digital controller, as json() writes it: {wrong!s:.300}"
        ) from None
    expected = content(k)
    for name in {**stored, **expected}.keys() - ABOUT:
        if name not in stored or name not in expected or not _same(stored[name], expected[name]):
            raise ValueError(f"text was changed by hand: {name!r:.60} does not match the other fields")
    if stored["checksum"] != checksum(stored):
        raise ValueError("text was changed by hand: its checksum does not match its fields")
    return k


def _controller(stored: dict[str, Any]) -> DigitalController:
    """Return the controller of a JSON object; `DigitalController` checks the numbers."""
    integral, weights, rest = (stored[name] for name in ("integral", "setpoint_weights", "working_point"))
    if stored["anti_windup"] not in DISCRETE_ANTI_WINDUP:
        raise ValueError(f"anti_windup must be one of {DISCRETE_ANTI_WINDUP}")
    if not isinstance(stored["controller"], str) or len(stored["controller"]) > LONGEST_TEXT:
        raise ValueError(f"controller must be a text of at most {LONGEST_TEXT} characters")
    about = _list("about", stored["about"], 1000)
    if not all(isinstance(x, str) for x in (*about, stored["version"], stored["checksum"])):
        raise ValueError("about, version and checksum must be texts")
    low, high = _list("limits", stored["limits"], 2)
    return DigitalController(
        sample_time=stored["sample_time"],
        method=stored["method"],
        paths=tuple(map(_path, _list("paths", stored["paths"], MOST_PATHS))),
        integrates=integral["acts"],
        from_signal=integral["grows_by"] != "error",
        growth=(integral["new"], integral["old"]),
        back_calculation_gain=integral["back_calculation_gain"],
        tracking_gain=integral["tracking_gain"],
        anti_windup=stored["anti_windup"],
        weights=(weights["b"], weights["c"]),
        limits=(-math.inf if low is None else low, math.inf if high is None else high),
        rate_limit=math.inf if stored["rate_limit"] is None else stored["rate_limit"],
        deadband=stored["deadband"],
        bias=rest["u"],
        y_offset=rest["y"],
        source=stored["controller"],
        prefilter=None if stored["prefilter"] is None else _prefilter(stored["prefilter"]),
        feedforward=stored["feedforward"],
        tunable=stored["tunable"],
    )


def _path(stored: dict[str, Any]) -> FilterChain:
    lists = (_list(name, stored[name], MOST_PATH_LAGS + 1) for name in ("new", "old", "gains"))
    return FilterChain(stored["name"], stored["weight"], *lists)


def _prefilter(stored: dict[str, Any]) -> Prefilter:
    names = ("num", "den", "out", "move")
    return Prefilter(**stored | {name: _list(name, stored[name], MOST_PATH_LAGS + 1) for name in names})


def _list(name: str, value: Any, most: int) -> tuple[Any, ...]:
    if not isinstance(value, list) or len(value) > most:
        raise ValueError(f"{name} must be a list of at most {most} values, found {type(value).__name__}")
    return tuple(value)


def _same(stored: Any, value: Any) -> bool:
    """Return True if a value of the file is as expected; true and 1 differ."""
    if isinstance(value, dict):
        alike = isinstance(stored, dict) and {*stored} == {*value}
        return alike and all(_same(stored[x], value[x]) for x in value)
    if isinstance(value, (list, tuple)):
        return isinstance(stored, list) and len(stored) == len(value) and all(map(_same, stored, value))
    return isinstance(stored, bool) == isinstance(value, bool) and bool(stored == value)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if len(dict(pairs)) < len(pairs):
        raise ValueError("a name occurs twice in an object")
    return dict(pairs)


def _no_number(word: str) -> NoReturn:
    raise ValueError(f"{word} is not a number of JSON")


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text:.40} is beyond double precision")
    return number
