"""Names of gains, areas and controllers as a table shows them."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import wraps
from typing import Any

import pandas as pd
from pidalab.ledger import Ledger

LOW = str.maketrans("-0123456789", "₋₀₁₂₃₄₅₆₇₈₉")
HIGH = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def raised(text: Any) -> Any:
    """Write PID_4^3, K_-1, A_9 and G_P1 with raised and lowered digits; what is no text stays."""
    if not isinstance(text, str):
        return text
    text = re.sub(r"PID_(\d)\^(\d)", lambda hit: f"PID{hit[1].translate(LOW)}{hit[2].translate(HIGH)}", text)
    text = re.sub(r"\b([KA])_(-?\d)", lambda hit: hit[1] + hit[2].translate(LOW), text)
    return re.sub(r"\bG_P(\d)", lambda hit: "Gₚ" + hit[1].translate(LOW), text)


def typeset(section: Callable[..., pd.DataFrame]) -> Callable[..., pd.DataFrame]:
    """Let a section return its table with such names."""

    @wraps(section)
    def shown(book: Ledger) -> pd.DataFrame:
        frame = section(book)
        return frame.map(raised).rename(index=raised, columns=raised).rename_axis(frame.index.name)

    return shown
