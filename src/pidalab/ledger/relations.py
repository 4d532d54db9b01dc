"""A statement as a relation between two computed numbers, and the text that keeps it: ``2.381000000 < 3.142000000``."""

import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from math import isfinite, isinf
from typing import Any

from pidalab.ledger.conventions import CONVENTIONS, IDENTITY, find_convention, gap, two_digits
from pidalab.ledger.digits import (
    DIGITS,
    agrees,
    exponent,
    plain,
    read_number,
    same_text,
    shorten,
    significant,
    significant_place,
)
from pidalab.ledger.errors import LedgerError

Number = int | float
COMPARE: dict[str, Callable[[Any, Any], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}
RELATIONS = (*COMPARE, "within")
_TEXT = re.compile(r"(\S+) (<=?|>=?|==|!=|within) (\S+)((?: \| [^|]+)*)")
_SIGNS = {
    **{relation: relation for relation in COMPARE},
    "<=": "≤",
    ">=": "≥",
    "==": "=",
    "!=": "≠",
    "within": "≈",
}
_ROUNDING = "rounding"


class Relation(str):
    """A relation that remembers of which case of many it speaks; made by `every` and `some`.

    Examples
    --------
    >>> left, relation, right = every({"at 1.4": (1, 2), "at 2.0": (3, 4)}, "<")
    >>> relation, relation.remark
    ('<', 'worst of 2: at 2.0')
    """

    remark: str
    convention: str | None


def _slack(left: Number, relation: str, right: Number, convention: str | None) -> float:
    """How far a relation is from turning, relative; larger is better, and whatever holds is above what fails."""
    if convention is not None:
        return find_convention(convention).slack(left, relation, right)
    if relation not in COMPARE:
        raise LedgerError(
            f"unknown relation {relation!r}; one of {', '.join(RELATIONS)}; 'within' needs a convention"
        )
    infinite = isinf(left) or isinf(right)
    distance = float(left != right) if infinite else gap(left, right)
    return distance if COMPARE[relation](left, right) else -distance - 1e-300


def _choose(
    cases: Mapping[str, tuple[Number, Number]], relation: str, convention: str | None, worst: bool
) -> tuple[Number, Relation, Number]:
    if not cases:
        raise LedgerError("no cases to choose from")
    numbers = {name: (plain(left), plain(right)) for name, (left, right) in cases.items()}
    # rounded, so that rounding errors never exchange two equal cases
    slack = {
        name: round(_slack(left, relation, right, convention), 9) for name, (left, right) in numbers.items()
    }
    name = min(slack, key=lambda case: slack[case] if worst else -slack[case])
    chosen = Relation(relation)
    chosen.remark = f"{'worst' if worst else 'best'} of {len(cases)}: {name}"
    chosen.convention = convention
    left, right = numbers[name]
    return left, chosen, right


def every(
    cases: Mapping[str, tuple[Number, Number]], relation: str, convention: str | None = None
) -> tuple[Number, Relation, Number]:
    """Return the worst of many cases: a statement about all of them holds if it holds there.

    Parameters
    ----------
    cases : mapping of str to pair of numbers
        Left and right side by name of the case.
    relation : str
        As in `Ledger.statement`.
    convention : str, optional
        As in `Ledger.statement`, where it need not be repeated.

    Returns
    -------
    tuple
        Left side, relation and right side of the case with the least relative margin, or the most violated one.

    Raises
    ------
    LedgerError
        If there is no case, or one of them is not comparable.

    Examples
    --------
    >>> every({"ex1": (1.0, 2.0), "ex2": (1.5, 2.0)}, "<")
    (1.5, '<', 2.0)
    """
    return _choose(cases, relation, convention, worst=True)


def some(
    cases: Mapping[str, tuple[Number, Number]], relation: str, convention: str | None = None
) -> tuple[Number, Relation, Number]:
    """Return the best of many cases: a statement that there is one holds if it holds there.

    Parameters
    ----------
    cases : mapping of str to pair of numbers
        Left and right side by name of the case.
    relation : str
        As in `Ledger.statement`.
    convention : str, optional
        As in `Ledger.statement`, where it need not be repeated.

    Returns
    -------
    tuple
        Left side, relation and right side of the case with the largest relative margin, or the least violated one.

    Raises
    ------
    LedgerError
        If there is no case, or one of them is not comparable.

    Examples
    --------
    >>> some({"ex1": (3.0, 2.0), "ex2": (1.5, 2.0)}, "<")
    (1.5, '<', 2.0)
    """
    return _choose(cases, relation, convention, worst=False)


@dataclass(frozen=True)
class Evidence:
    """What decides a statement, as its row keeps it.

    Parameters
    ----------
    left : str
        The left number with its digits.
    relation : str
        One of `RELATIONS`.
    right : str
        The right number with its digits.
    remarks : tuple of str, optional
        What the sides are, of how many cases this is the worst, what the convention asks.

    Examples
    --------
    >>> print(Evidence.of(10.82, "<=", 10))
    10.82000000 <= 10
    >>> Evidence.parse("10.82000000 <= 10").verdict
    'fails'
    """

    left: str
    relation: str
    right: str
    remarks: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        left: Number,
        relation: str,
        right: Number,
        *,
        names: tuple[str, str] = ("", ""),
        convention: str | None = None,
        digits: int = DIGITS,
    ) -> "Evidence":
        """Write down a relation between two numbers.

        Parameters
        ----------
        left : int or float
            The left number; an integer stays exact, others are written with `digits` digits.
        relation : str
            One of `RELATIONS`, or what `every` and `some` return.
        right : int or float
            The right number.
        names : tuple of str, optional
            What the sides are.
        convention : str, optional
            Key of a convention that qualifies the relation.
        digits : int, optional
            Significant digits.

        Returns
        -------
        Evidence

        Raises
        ------
        LedgerError
            If a side is no number, the relation is unknown or needs other numbers, or the convention is unknown.

        Examples
        --------
        >>> print(Evidence.of(1.0, "<", 2.5, names=("PIDA", "PID"), convention="clearly"))
        1.000000000 < 2.500000000 | PIDA against PID | clearly: at least 20 %, here 60 %
        """
        left, right = plain(left), plain(right)
        convention = convention or getattr(relation, "convention", None)
        _slack(left, relation, right, convention)  # refuses what cannot be compared
        if relation in ("==", "!=") and not (isinstance(left, int) and isinstance(right, int)):
            raise LedgerError(
                f"{relation!r} is for integers, found {left!r} and {right!r}; use identity for reals"
            )
        remarks = [
            " against ".join(name for name in names if name),
            getattr(relation, "remark", ""),
            find_convention(convention).remark(left, relation, right) if convention else "",
        ]
        scale = max((abs(side) for side in (left, right) if isfinite(side)), default=0)
        kept = tuple(remark.replace("|", "/") for remark in remarks if remark)
        return cls(significant(left, scale, digits), str(relation), significant(right, scale, digits), kept)

    @classmethod
    def identity(cls, residual: float, tolerance: float) -> "Evidence":
        """Write down that a residual is rounding error, to its decade only, as it differs from machine to machine.

        Parameters
        ----------
        residual : float
            The largest relative deviation.
        tolerance : float
            What it has to stay below.

        Returns
        -------
        Evidence

        Raises
        ------
        LedgerError
            If a number is negative or not finite.

        Examples
        --------
        >>> print(Evidence.identity(3.1e-16, 1e-9))
        1e-15 <= 1e-09 | rounding
        """
        residual, tolerance = float(plain(residual)), float(plain(tolerance))
        if not (0 <= residual < float("inf") and 0 < tolerance < float("inf")):
            raise LedgerError(f"a residual and its tolerance are positive, found {residual} and {tolerance}")
        if residual > tolerance:
            return cls(significant(residual, residual, DIGITS), "<=", f"{tolerance:.0e}", (_ROUNDING,))
        decade = next(power for power in range(-30, 400) if residual <= float(f"1e{power}"))
        return cls(f"{min(float(f'1e{decade}'), tolerance):.0e}", "<=", f"{tolerance:.0e}", (_ROUNDING,))

    @classmethod
    def parse(cls, text: str) -> "Evidence":
        """Read what a row keeps.

        Parameters
        ----------
        text : str
            The column `evidence`.

        Returns
        -------
        Evidence

        Raises
        ------
        LedgerError
            If it is no relation of two numbers.

        Examples
        --------
        >>> Evidence.parse("3 == 3 | worst of 2: at 1.4").remarks
        ('worst of 2: at 1.4',)
        """
        found = _TEXT.fullmatch(text)
        if not found:
            raise LedgerError(f"evidence {text!r} is no relation such as '10.82 <= 10'")
        left, relation, right, rest = found.groups()
        for side in (left, right):
            if side.lstrip("-") != "inf":
                read_number(side)
        return cls(left, relation, right, tuple(rest.split(" | ")[1:]))

    def __str__(self) -> str:
        return " | ".join([f"{self.left} {self.relation} {self.right}", *self.remarks])

    @property
    def convention(self) -> str | None:
        """Key of the convention that qualifies the relation."""
        keys = (remark.partition(":")[0] for remark in self.remarks)
        return next((key for key in keys if key in CONVENTIONS), None)

    @property
    def is_rounding(self) -> bool:
        """Whether this is the residual of an identity, of which only the decade is kept."""
        return _ROUNDING in self.remarks

    @property
    def is_coarse(self) -> bool:
        """Whether a real side is kept with fewer digits than `significant` writes; the threshold of a residual may."""
        sides = [Decimal(side) for side in (self.left, self.right) if "inf" not in side]
        scale = max((abs(side) for side in sides), default=Decimal(0))
        return not self.is_rounding and any(
            exponent(side) < 0 and exponent(side) > significant_place(side, scale) for side in sides
        )

    @property
    def numbers(self) -> tuple[Number | Fraction, Number | Fraction]:
        """Both sides as numbers, exact unless infinite."""
        left, right = (float(side) if "inf" in side else Fraction(side) for side in (self.left, self.right))
        return left, right

    @property
    def verdict(self) -> str:
        """Either ``holds`` or ``fails``, decided by the numbers as written.

        Raises
        ------
        LedgerError
            If ``within`` names no convention.
        """
        left, right = self.numbers
        if self.convention:
            holds = CONVENTIONS[self.convention].judge(float(left), self.relation, float(right))
        elif self.relation in COMPARE:
            holds = COMPARE[self.relation](left, right)
        else:
            raise LedgerError(f"evidence {self} names no convention")
        return "holds" if holds else "fails"

    def same(self, fresh: "Evidence") -> bool:
        """Tell whether a fresh run says the same, to one unit in the last written place.

        Parameters
        ----------
        fresh : Evidence
            What the run gave.

        Returns
        -------
        bool

        Examples
        --------
        >>> Evidence.parse("1e-15 <= 1e-09 | rounding").same(Evidence.identity(4e-14, 1e-9))
        True
        """
        if self.is_rounding and fresh.is_rounding and fresh.verdict == self.verdict == "holds":
            return self.right == fresh.right
        sides = zip((self.left, self.right), (fresh.left, fresh.right), strict=True)
        return (
            self.relation == fresh.relation
            and all(old == new or _near(old, new) for old, new in sides)
            and same_text(" | ".join(self.remarks), " | ".join(fresh.remarks))
        )

    def shown(self) -> str:
        """Return the relation for a reader: four digits, or as many as tell both sides apart.

        Returns
        -------
        str

        Examples
        --------
        >>> Evidence.parse("1.234567000 <= 1.234891000").shown()
        '1.2346 ≤ 1.2349'
        """
        if self.is_rounding:
            return f"largest residual {self.left} {_SIGNS[self.relation]} {self.right}"
        sides = (self.left, self.right)
        short = next(
            pair
            for digits in range(4, 2 * DIGITS)
            if len({*(pair := tuple(shorten(side, digits) for side in sides))}) == len({*sides})
            or digits > DIGITS
        )
        return f"{short[0]} {_SIGNS[self.relation]} {short[1]}"

    def nearness(self) -> str:
        """Say how near the decision was.

        Returns
        -------
        str
            Empty for what is equal or not, for rounding, and beside an infinite number.

        Examples
        --------
        >>> Evidence.parse("10.82 <= 10").nearness()
        'by 7.6 %'
        """
        left, right = (float(side) for side in self.numbers)
        if self.is_rounding or self.relation in ("==", "!=") or isinf(left) or isinf(right):
            return ""
        if self.convention:
            return CONVENTIONS[self.convention].said(left, right)
        return f"by {two_digits(100 * gap(left, right))} %"


def _near(old: str, new: str) -> bool:
    return "inf" not in old + new and "." in old + new and agrees(float(new), old)


__all__ = ["COMPARE", "IDENTITY", "RELATIONS", "Evidence", "Number", "Relation", "every", "some"]
