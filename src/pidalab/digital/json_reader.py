"""A digital controller read back from the JSON that it wrote."""

from __future__ import annotations

import json
import math
from typing import Any

from pidalab.digital.code import signals
from pidalab.digital.controller import DigitalController
from pidalab.digital.paths import Path
from pidalab.digital.prefilter import Prefilter
from pidalab.digital.program import program


def from_json(text: str) -> DigitalController:
    """Read a controller back from what its ``json()`` wrote.

    Parameters
    ----------
    text : str
        The file.

    Returns
    -------
    DigitalController
        The same, with its start at the first measurement.

    Raises
    ------
    ValueError
        For text that is no such file, or whose test vector does not come out: somebody changed it by hand.

    Examples
    --------
    >>> import pidalab
    >>> k = pidalab.PIDA(kp=2.0, ti=4.0).discretise(0.5, limits=(0.0, 10.0))
    >>> pidalab.digital.from_json(k.json()) == k
    True
    """
    try:
        stored = json.loads(text)
        integral = stored["integral"]
        low, high = stored["limits"]
        k = DigitalController(
            sample_time=stored["sample_time"],
            method=stored["method"],
            paths=tuple(
                Path(p["name"], p["weight"], *(tuple(p[x]) for x in ("new", "old", "gains")))
                for p in stored["paths"]
            ),
            integrates=integral["acts"],
            from_signal=integral["grows_by"] != "error",
            growth=(integral["new"], integral["old"]),
            taken_back=integral["taken_back"],
            tracked=integral["tracked"],
            anti_windup=stored["anti_windup"],
            weights=(stored["setpoint_weights"]["b"], stored["setpoint_weights"]["c"]),
            limits=(-math.inf if low is None else low, math.inf if high is None else high),
            rate_limit=math.inf if stored["rate_limit"] is None else stored["rate_limit"],
            deadband=stored["deadband"],
            bias=stored["working_point"]["u"],
            y_offset=stored["working_point"]["y"],
            y_span=stored["units"]["y"],
            u_span=stored["units"]["u"],
            source=stored["controller"],
            prefilter=None if stored["prefilter"] is None else _prefilter(**stored["prefilter"]),
            feedforward=stored.get("feedforward", False),
            tunable=stored.get("tunable", False),
        )
        *inputs, expected = (stored["test"][name] for name in (*program(k).inputs, "control"))
        found = signals(k, inputs)
    except (KeyError, TypeError, ValueError) as wrong:
        raise ValueError(f"text must be the JSON of a digital controller, found none: {wrong!r}") from None
    if found != expected:
        raise ValueError("text was changed by hand: the controller in it does not repeat its own test vector")
    return k


def _prefilter(move: list[list[float]], **others: Any) -> Prefilter:
    """Return a prefilter with tuples for the lists of JSON."""
    rest: dict[str, Any] = {name: tuple(x) if isinstance(x, list) else x for name, x in others.items()}
    return Prefilter(move=tuple(tuple(row) for row in move), **rest)
