"""Read a digital controller from JSON."""

from __future__ import annotations

import json
import math
from typing import Any, NoReturn

from pidalab.digital.controller import DigitalController
from pidalab.digital.filters import FilterChain, Prefilter
from pidalab.digital.parameters import DISCRETE_ANTI_WINDUP
from pidalab.plant.code.files import canonical, checksum, content

LONGEST_FILE = 2_000_000  # characters; `json()` writes at most a tenth of this
# These fields have the same names in the JSON and in a DigitalController.
SAME = ("sample_time", "method", "anti_windup", "deadband", "feedforward", "tunable")
ABOUT = {"about", "version", "checksum"}  # these fields do not affect the controller


def from_json(text: str) -> DigitalController:
    """Read a controller from the text that ``DigitalController.json`` returns.

    Nothing in the file is executed. Type and range of every field are checked. Coefficients and test vector are
    computed again and compared with the file.

    Parameters
    ----------
    text : str
        Content of the file.

    Returns
    -------
    DigitalController
        A controller with the same parameters, before its first step. The file does not contain the states.

    Raises
    ------
    TypeError
        If text is not a str.
    ValueError
        If ``json()`` did not write the text, or if the text was changed.

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
        expected = content(k)
        for name in {**stored, **expected}.keys() - ABOUT:
            if canonical(stored[name]) != canonical(expected[name]):
                raise ValueError(f"it was changed by hand: {name!r:.60} does not match the other fields")
        if stored["checksum"] != checksum(stored):
            raise ValueError("it was changed by hand: its checksum does not match its fields")
    except (LookupError, TypeError, ValueError, ArithmeticError, RecursionError) as wrong:
        raise ValueError(
            f"text must be the JSON of a digital controller, as json() writes it: {wrong!s:.300}"
        ) from None
    return k


def _controller(stored: dict[str, Any]) -> DigitalController:
    """Return the controller of a JSON object; `DigitalController` checks the fields."""
    integral, weights, rest = (stored[name] for name in ("integral", "setpoint_weights", "working_point"))
    if stored["anti_windup"] not in DISCRETE_ANTI_WINDUP:
        raise ValueError(f"anti_windup must be one of {DISCRETE_ANTI_WINDUP}")
    low, high = stored["limits"]
    prefilter, rate = stored["prefilter"], stored["rate_limit"]
    return DigitalController(
        paths=tuple(FilterChain(**_tuples(path)) for path in stored["paths"]),
        integrates=integral["acts"],
        from_signal=integral["grows_by"] != "error",
        growth=(integral["new"], integral["old"]),
        back_calculation_gain=integral["back_calculation_gain"],
        tracking_gain=integral["tracking_gain"],
        weights=(weights["b"], weights["c"]),
        limits=(-math.inf if low is None else low, math.inf if high is None else high),
        rate_limit=math.inf if rate is None else rate,
        bias=rest["u"],
        y_offset=rest["y"],
        source=stored["controller"],
        prefilter=None if prefilter is None else Prefilter(**_tuples(prefilter)),
        **{name: stored[name] for name in SAME},
    )


def _tuples(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _tuples(x) for name, x in value.items()}
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if len(dict(pairs)) < len(pairs):
        raise ValueError("a name occurs twice in an object")
    return dict(pairs)


def _no_number(word: str) -> NoReturn:
    raise ValueError(f"{word} is not a number of JSON")


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text:.40} is too large for double precision")
    return number
