"""What words such as *similar* or *clearly* mean: one table for all papers, fixed before any number was compared."""

import operator
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple

COMPARE: dict[str, Callable[[Any, Any], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}
SIGNS = {  # for a reader: what holds, and what does not
    "<": ("<", "≮"),
    "<=": ("≤", "≰"),
    ">": (">", "≯"),
    ">=": ("≥", "≱"),
    "==": ("=", "≠"),
    "!=": ("≠", "="),
    "≈": ("≈", "≉"),
}


class Bound(NamedTuple):
    """What one side of a relation is compared with: the other one, perhaps times a factor such as ``0.8``."""

    sign: str
    factor: str = ""

    @property
    def times(self) -> Fraction:
        """The factor as a number."""
        return Fraction(self.factor) if "/" not in self.factor else 1 / Fraction(self.factor[2:])


@dataclass(frozen=True)
class Convention:
    """The meaning of a word that compares; one table for all papers, fixed before any number was compared.

    Parameters
    ----------
    words : str
        The words of a paper that it covers.
    meaning : str
        What they mean in the book.
    limit : float
        The threshold.
    bounds : dict of str to tuple of Bound
        What has to hold, by the sign that it qualifies.

    Examples
    --------
    >>> CONVENTIONS["much"].bounds["<"]
    (Bound(sign='<', factor='0.5'),)
    """

    words: str
    meaning: str
    limit: float
    bounds: dict[str, tuple[Bound, ...]]


CONVENTIONS = {
    "similar": Convention(
        "similar, about, comparable",
        "within 10 % of the larger",
        0.1,
        {"≈": (Bound(">=", "0.9"), Bound("<=", "1/0.9"))},
    ),
    "slightly": Convention(
        "slightly",
        "a difference, and at most 10 %",
        0.1,
        {"<": (Bound("<"), Bound(">=", "0.9")), ">": (Bound(">"), Bound("<=", "1/0.9"))},
    ),
    "clearly": Convention(
        "clearly, significantly",
        "at least 20 % of the larger",
        0.2,
        {"<": (Bound("<", "0.8"),), ">": (Bound(">", "1.25"),)},
    ),
    "much": Convention(
        "much", "at least a factor of 2", 2.0, {"<": (Bound("<", "0.5"),), ">": (Bound(">", "2"),)}
    ),
    "negligible": Convention(
        "≫, negligible against",
        "at least a factor of 10",
        10.0,
        {"<": (Bound("<", "0.1"),), ">": (Bound(">", "10"),)},
    ),
    "settled": Convention(
        "no overshoot, without oscillation, monotonic, settled",
        "at most 2 % of the change (the settling band)",
        0.02,
        {"<=": (Bound("<=", "0.02"),), ">": (Bound(">", "0.02"),)},
    ),
    "identical": Convention(
        "identical curves, no visible difference",
        "at most 1 % of the range (a line's width in a figure)",
        0.01,
        {"<=": (Bound("<=", "0.01"),), ">": (Bound(">", "0.01"),)},
    ),
}
