"""Tables of the pages, with indices set as indices: M_s, TV_1(u_d), PIDA_1."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec

import pandas as pd
from pidalab.ledger import Display

_INDEX = re.compile(r"([^\W\d_])_(\w+)")
Parameters = ParamSpec("Parameters")


def table(frame: pd.DataFrame) -> Display:
    """A frame as a page shows it; in a terminal it stays as it is."""
    html = frame.to_html(border=0, max_rows=None)
    return Display(_INDEX.sub(r"\1<sub>\2</sub>", html), frame.to_string())


def tabled(section: Callable[Parameters, pd.DataFrame]) -> Callable[Parameters, Display]:
    """Let a function that returns a frame return its table."""

    @wraps(section)
    def shown(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Display:
        with pd.option_context("display.max_colwidth", None):
            return table(section(*args, **kwargs))

    return shown
