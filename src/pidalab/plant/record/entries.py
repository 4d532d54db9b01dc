"""Entries of a text file as numbers, whatever stands around and within them."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from pidalab._check import Array

if TYPE_CHECKING:
    import pandas as pd

# What takes the place of a value that was not recorded.
MISSING = ["", "-", "?", "nan", "na", "n/a", "#n/a", "null", "none"]
MISSING += ["bad", "bad input", "no data", "i/o timeout"]
# how dates and times of day begin
STAMP = re.compile(r"(\d{1,4}[-/.]\w{1,9}[-/.]\d{1,4}([T ]\d|$)|\d{1,2}:\d\d)")
GROUPED = r"[-+]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?"  # a number with a comma after the thousands
# a number with a decimal comma: points stand after thousands, or it is another number
WITH_COMMA = r"[^.]*|[-+]?[1-9]\d{0,2}(\.\d{3})+(,\d*)?"
# what may be behind a number; blanks before it are taken off apart, which takes no longer for more of them
SIGN = r"(%|°\s{0,9}[CF]?)$"


def is_value(entry: str) -> bool:
    """Whether an entry is a number, a date, or a word for a missing one."""
    text = bare(entry) or entry.strip()
    return text.lower() in MISSING or STAMP.match(text) is not None or not math.isnan(number(text))


def bare(entry: Any) -> Any:
    """Return an entry, or a Series of them, without blanks and brackets around it and a sign of per cent or degrees."""
    if isinstance(entry, str):
        return re.sub(SIGN, "", entry.strip(" \t[]{}();'\"")).rstrip()
    return entry.str.strip(" \t[]{}();'\"").str.replace(SIGN, "", regex=True).str.rstrip()


def number(text: str) -> float:
    """Return a bare entry as a number, with a decimal point or comma; nan where it is none."""
    if re.fullmatch(GROUPED, text):
        return float(text.replace(",", ""))
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


def numbers(column: pd.Series, comma: bool) -> tuple[Array, Array]:
    """Return a column as numbers, nan where one is missing, and where there is neither a number nor a word for none."""
    import pandas as pd

    values = pd.to_numeric(column, errors="coerce").to_numpy(dtype=float, copy=True)
    # what reads as it stands needs no more; of decimal commas none does for sure
    left = np.isnan(values) | comma
    column = column[left]
    text = bare(column)
    if comma:
        text = text.where(text.str.fullmatch(WITH_COMMA), "")
        text = text.str.replace(".", "", regex=False).str.replace(",", ".", regex=False)
    else:
        text = text.mask(text.str.fullmatch(GROUPED), text.str.replace(",", "", regex=False))
    values[left] = pd.to_numeric(text, errors="coerce").to_numpy(dtype=float)
    values[~np.isfinite(values)] = np.nan
    wrong = np.isnan(values)
    wrong[left] &= ~bare(column).str.lower().isin(MISSING).to_numpy(dtype=bool)
    return values, wrong
