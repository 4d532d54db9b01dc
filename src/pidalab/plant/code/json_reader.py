"""Read a digital controller back from the JSON that it wrote. The file is data, and every field is checked."""

from __future__ import annotations

import json
import math
from typing import Any, NoReturn

from pidalab.digital.controller import DigitalController
from pidalab.digital.filters import FilterChain, Prefilter
from pidalab.digital.parameters import DISCRETE_ANTI_WINDUP, MOST_PATH_LAGS, MOST_PATHS
from pidalab.plant.code.files import checksum, content

LONGEST_FILE = 2_000_000  # characters, ten times the longest file that is written
FIELD_NAMES = {  # the names in each object
    "": "about version checksum controller sample_time method anti_windup setpoint_weights limits rate_limit deadband "
    "working_point largest_signal feedforward tunable paths prefilter integral coefficients test",
    "setpoint_weights": "b c",
    "working_point": "u y",
    "integral": "acts grows_by new old back_calculation_gain tracking_gain",
    "prefilter": "num den new old move out",
    "path": "name weight new old gains",
}


def from_json(text: str) -> DigitalController:
    """Read a controller back from what its ``json()`` wrote.

    Nothing in the file is run or becomes code. The type and range of every field are checked, and words must be among
    those allowed. Coefficients and test vector are computed again; a file that differs is refused.

    Parameters
    ----------
    text : str
        The file.

    Returns
    -------
    DigitalController
        The same controller, which starts at its first measurement.

    Raises
    ------
    TypeError
        If text is not a str.
    ValueError
        For text that is not such a file, and for a file that was changed: its coefficients, test vector or checksum do
        not match.

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
        stored = _parsed(text)
        k = _controller(stored)
    except (LookupError, TypeError, ValueError, ArithmeticError, RecursionError) as wrong:
        raise ValueError(
            f"text must be the JSON of a digital controller, as json() writes it: {wrong!s:.300}"
        ) from None
    for name, value in content(k).items():
        if not _same(stored[name], value):
            raise ValueError(f"text was changed by hand: {name!r} does not match the other fields")
    if stored["checksum"] != checksum(stored):
        raise ValueError("text was changed by hand: its checksum does not match its fields")
    return k


def _parsed(text: str) -> dict[str, Any]:
    """Return the object in a JSON; raise for repeated names and for numbers that are not finite."""
    if len(text) > LONGEST_FILE:
        raise ValueError(f"it must have at most {LONGEST_FILE} characters, found {len(text)}")
    stored = json.loads(text, object_pairs_hook=_once, parse_constant=_no_number, parse_float=_finite)
    return _object(stored, "")


def _controller(stored: dict[str, Any]) -> DigitalController:
    """Return the controller of a JSON object; `DigitalController` checks the numbers."""
    integral, weights, rest = (
        _object(stored[name], name) for name in ("integral", "setpoint_weights", "working_point")
    )
    if stored["anti_windup"] not in DISCRETE_ANTI_WINDUP:
        raise ValueError(f"anti_windup must be one of {DISCRETE_ANTI_WINDUP}")
    if not isinstance(stored["controller"], str) or len(stored["controller"]) > LONGEST_FILE // 100:
        raise ValueError(f"controller must be a text of at most {LONGEST_FILE // 100} characters")
    about = _list("about", stored["about"], 1000)
    if not all(isinstance(x, str) for x in (*about, stored["version"], stored["checksum"])):
        raise ValueError("about, version and checksum must be texts")
    low, high = _list("limits", stored["limits"], 2)
    return DigitalController(
        sample_time=stored["sample_time"],
        method=stored["method"],
        paths=tuple(
            FilterChain(
                p["name"], p["weight"], *(_list(x, p[x], MOST_PATH_LAGS + 1) for x in ("new", "old", "gains"))
            )
            for p in (_object(one, "path") for one in _list("paths", stored["paths"], MOST_PATHS))
        ),
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
        prefilter=None if stored["prefilter"] is None else _prefilter(stored),
        feedforward=stored["feedforward"],
        tunable=stored["tunable"],
    )


def _prefilter(stored: dict[str, Any]) -> Prefilter:
    """Return a prefilter with tuples for the lists of JSON."""
    found = _object(stored["prefilter"], "prefilter")
    lists = {name: _list(name, found[name], MOST_PATH_LAGS + 1) for name in ("num", "den", "out", "move")}
    return Prefilter(**found | lists)


def _object(value: Any, name: str) -> dict[str, Any]:
    """Check that a value is an object with exactly the expected names."""
    if not isinstance(value, dict) or {*value} != {*FIELD_NAMES[name].split()}:
        found = sorted(value) if isinstance(value, dict) else type(value).__name__
        raise ValueError(
            f"{name or 'the whole'} must have the names {FIELD_NAMES[name]}, found {found!r:.120}"
        )
    return value


def _list(name: str, value: Any, most: int) -> tuple[Any, ...]:
    if not isinstance(value, list) or len(value) > most:
        raise ValueError(f"{name} must be a list of at most {most} values, found {type(value).__name__}")
    return tuple(value)


def _same(stored: Any, value: Any) -> bool:
    """Return True if a value of the file is as expected; true and 1 differ."""
    if isinstance(value, dict):
        return (
            isinstance(stored, dict)
            and {*stored} == {*value}
            and all(_same(stored[x], value[x]) for x in value)
        )
    if isinstance(value, (list, tuple)):
        return isinstance(stored, list) and len(stored) == len(value) and all(map(_same, stored, value))
    return isinstance(stored, bool) == isinstance(value, bool) and bool(stored == value)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a name occurs twice in an object")
    return found


def _no_number(word: str) -> NoReturn:
    raise ValueError(f"{word} is not a number of JSON")


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text:.40} is beyond double precision")
    return number
