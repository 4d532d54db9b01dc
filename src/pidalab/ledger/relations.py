"""What decides a statement: the relation its row asks for, and the inequality of two computed numbers that decides it.

A row says ``IAE of the PIDA < IAE of the PID | clearly``; what was computed is kept beside it, as evidence,
``6.528000000 < 0.8 * 10.00000000 | worst of 4: ex2, Ms 1.4; ratio 0.31 to 0.65``.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from math import isfinite, isinf
from typing import Any, Self

from pidalab.ledger.conventions import COMPARE, CONVENTIONS, SIGNS, Bound
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
Pair = tuple[Number, Number]
Cases = Mapping[Any, Pair] | Mapping[Any, Number] | Pair | Number

ROUNDING = "rounding"  # the convention of an identity
IDENTITY = 1e-9  # largest relative residual of two formulas that are called the same
_RELATION = re.compile(r"(?:(.*?) )?(<=?|>=?|==|!=|≈)(?: (.*))?")
_EVIDENCE = re.compile(r"(\S+) (<=?|>=?|==|!=) (?:(\S+) \* )?(\S+)(?: \| (.+))?")


@dataclass(frozen=True)
class Relation:
    """What a statement asks for, as the column ``relation`` of its row says it.

    Parameters
    ----------
    left : str
        What the left side is; may be empty.
    sign : str
        One of ``< <= > >= == != ≈``; ``==`` and ``!=`` are for integers, ``≈`` needs a convention.
    right : str
        What the right side is; the tolerance of an identity.
    convention : str
        A key of `CONVENTIONS`; ``rounding`` for an identity, whose left side is a residual; or empty.
    some : bool
        Whether one case is enough; by default every case must hold.

    Examples
    --------
    >>> relation = Relation.parse("IAE of the PIDA < IAE of the PID | clearly")
    >>> relation.left, relation.convention, relation.some
    ('IAE of the PIDA', 'clearly', False)
    >>> print(relation.decide({"Ms 1.4": (0.7, 1.0), "Ms 2.0": (0.5, 1.0)}))
    0.7000000000 < 0.8 * 1.000000000 | worst of 2: Ms 1.4; ratio 0.50 to 0.70
    """

    left: str
    sign: str
    right: str
    convention: str = ""
    some: bool = False

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read the column of a row.

        Parameters
        ----------
        text : str
            Left name, sign, right name, then after ``|`` an optional convention and an optional ``some``.

        Returns
        -------
        Relation

        Raises
        ------
        LedgerError
            If it is none, or the convention does not go with the sign.

        Examples
        --------
        >>> Relation.parse("residual <= 1e-9 | rounding").is_identity
        True
        """
        words, *marks = (part.strip() for part in text.split("|"))
        found = _RELATION.fullmatch(words)
        if not found:
            raise LedgerError(
                f"relation {text!r} is none such as 'IAE of the PIDA < IAE of the PID | clearly'"
            )
        some = marks[-1:] == ["some"]
        rest = marks[:-1] if some else marks
        convention = " | ".join(rest)
        left, sign, right = (part or "" for part in found.groups())
        if convention == ROUNDING:
            if sign != "<=" or float(read_number(right)) <= 0:
                raise LedgerError(f"relation {text!r}: an identity reads 'residual <= 1e-9 | rounding'")
        elif convention and convention not in CONVENTIONS:
            raise LedgerError(
                f"unknown convention {convention!r}; one of {', '.join(CONVENTIONS)}, {ROUNDING}"
            )
        elif convention and sign not in CONVENTIONS[convention].bounds:
            allowed = " or ".join(CONVENTIONS[convention].bounds)
            raise LedgerError(f"the convention {convention!r} goes with {allowed}, found {sign!r}")
        elif sign == "≈" and not convention:
            raise LedgerError("'≈' needs a convention, such as similar")
        return cls(left, sign, right, convention, some)

    @property
    def is_identity(self) -> bool:
        """Whether a residual is compared with rounding; only its decade is kept, as it depends on the machine."""
        return self.convention == ROUNDING

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """What has to hold: one inequality, or two."""
        if self.convention in CONVENTIONS:
            return CONVENTIONS[self.convention].bounds[self.sign]
        return (Bound(self.sign),)

    @property
    def words(self) -> str:
        """The relation for a reader."""
        if self.is_identity:
            return "residual of an identity"
        said = " ".join(part for part in (self.left, SIGNS[self.sign][0], self.right) if part)
        named = said if self.left or self.right else ""
        return ", ".join(part for part in (named, self.convention, "in some case" * self.some) if part)

    def decide(self, cases: Cases, digits: int = DIGITS) -> "Evidence":
        """Find the case that decides: the worst one, or the best where one is enough.

        Parameters
        ----------
        cases : mapping of any to pair of numbers, or pair of numbers, or number
            Both sides by case, or of the only case; for an identity residuals by case, or the only one.
        digits : int, optional
            Significant digits to keep of real numbers; integers stay exact.

        Returns
        -------
        Evidence

        Raises
        ------
        LedgerError
            If there is no case, or a side is no number of the kind that the relation compares.

        Examples
        --------
        >>> print(Relation.parse("poles == none").decide((2, 0)))
        2 == 0
        >>> print(Relation.parse("residual <= 1e-9 | rounding").decide({"m = 1": 3.1e-16, "m = 2": 2e-14}))
        1e-13 <= 1e-9
        """
        named = (
            {_name(key): value for key, value in cases.items()} if isinstance(cases, Mapping) else {"": cases}
        )
        if not named:
            raise LedgerError("no cases to decide from")
        if self.is_identity:
            return self._residual([float(plain(value)) for value in named.values()])
        pairs = {name: _pair(value) for name, value in named.items()}
        if self.convention in ("settled", "identical"):  # how far off, to either side
            pairs = {name: (abs(left), abs(right)) for name, (left, right) in pairs.items()}
        slack = {name: self._slack(*pair) for name, pair in pairs.items()}
        name = (
            max(slack, key=lambda case: slack[case][0])
            if self.some
            else min(slack, key=lambda case: slack[case][0])
        )
        bound = slack[name][1]
        left, right = pairs[name]
        scale = max((abs(side) for side in (left, right) if isfinite(side)), default=0)
        which = (
            f"{'best' if self.some else 'worst'} of {len(pairs)}: {name}"
            if isinstance(cases, Mapping)
            else ""
        )
        remark = "; ".join(part for part in (which, _ratios([*pairs.values()])) if part)
        first, second = (significant(side, scale, digits) for side in (left, right))
        return Evidence(first, bound.sign, bound.factor, second, remark)

    def _slack(self, left: Number, right: Number) -> tuple[float, Bound]:
        """How far a case is from turning, relative, and the bound that is nearest; what fails is negative."""
        if self.sign in ("==", "!=") and not (isinstance(left, int) and isinstance(right, int)):
            raise LedgerError(
                f"{self.sign!r} is for integers, found {left!r} and {right!r}; real numbers take 'rounding'"
            )
        if self.convention and not (0 <= left < float("inf") and 0 <= right < float("inf")):
            raise LedgerError(
                f"the convention {self.convention!r} compares magnitudes, finite and not negative; "
                f"found {left} and {right}"
            )
        found = []
        for bound in self.bounds:
            asked = float(bound.times) * right if bound.factor else right
            infinite = isinf(left) or isinf(asked)
            distance = float(left != asked) if infinite else gap(left, asked)
            # rounded, so that rounding errors never exchange two equal cases
            found.append((round(distance if COMPARE[bound.sign](left, asked) else -distance, 9), bound))
        return min(found, key=lambda one: one[0])

    def _residual(self, residuals: list[float]) -> "Evidence":
        """Keep the decade of the largest residual; all digits if it is no rounding."""
        found, tolerance = max(map(abs, residuals)), float(self.right)
        if not isfinite(found):
            raise LedgerError(f"a residual is finite, found {found}")
        if found > tolerance:
            return Evidence(significant(found, found, DIGITS), "<=", "", self.right)
        decade = next(power for power in range(-30, 400) if found <= float(f"1e{power}"))
        kept = f"1e{decade}" if float(f"1e{decade}") <= tolerance else self.right
        return Evidence(kept, "<=", "", self.right)

    def allows(self, evidence: "Evidence") -> bool:
        """Tell whether evidence is an inequality that this relation asks for.

        Parameters
        ----------
        evidence : Evidence
            What a row keeps.

        Returns
        -------
        bool

        Examples
        --------
        >>> Relation.parse("A < B | much").allows(Evidence.parse("1 < 2"))
        False
        """
        if self.is_identity:
            return (evidence.sign, evidence.factor, evidence.right) == ("<=", "", self.right)
        return (evidence.sign, evidence.factor) in self.bounds


@dataclass(frozen=True)
class Evidence:
    """The inequality of two computed numbers that decides a statement, as its row keeps it.

    Parameters
    ----------
    left : str
        The left number with its digits.
    sign : str
        A key of `COMPARE`.
    factor : str
        What the right number is multiplied by: ``0.8``, ``1/0.9`` or nothing.
    right : str
        The right number with its digits.
    remark : str, optional
        Of how many cases this is the worst, and the range of the ratio of both sides over them.

    Examples
    --------
    >>> kept = Evidence.parse("0.6528506558 < 0.5 * 1.000000000 | worst of 6: ξ = 0.5")
    >>> kept.verdict, kept.shown()
    ('fails', '0.6529 ≮ 0.5 · 1.000')
    """

    left: str
    sign: str
    factor: str
    right: str
    remark: str = ""

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read what a row keeps.

        Parameters
        ----------
        text : str
            The column ``evidence``.

        Returns
        -------
        Evidence

        Raises
        ------
        LedgerError
            If it is no inequality of two numbers.

        Examples
        --------
        >>> Evidence.parse("3 == 3 | worst of 2: at 1.4").remark
        'worst of 2: at 1.4'
        """
        found = _EVIDENCE.fullmatch(text)
        if not found:
            raise LedgerError(
                f"evidence {text!r} is no inequality such as '10.82 <= 10' or '1.2 < 0.5 * 3.1'"
            )
        left, sign, factor, right, remark = found.groups()
        for side in (left, right, (factor or "1").removeprefix("1/")):
            if side.lstrip("-") != "inf":
                read_number(side)
        return cls(left, sign, factor or "", right, remark or "")

    def __str__(self) -> str:
        factor = f"{self.factor} * " if self.factor else ""
        remark = f" | {self.remark}" if self.remark else ""
        return f"{self.left} {self.sign} {factor}{self.right}{remark}"

    @property
    def verdict(self) -> str:
        """Either ``holds`` or ``fails``, decided by the numbers as written."""
        left, right = _exact(self.left), _exact(self.right)
        asked = right * Bound(self.sign, self.factor).times if self.factor else right
        return "holds" if COMPARE[self.sign](left, asked) else "fails"

    @property
    def is_coarse(self) -> bool:
        """Whether a real side has fewer digits than `significant` writes."""
        sides = [Decimal(side) for side in (self.left, self.right) if "inf" not in side]
        scale = max((abs(side) for side in sides), default=Decimal(0))
        return any(exponent(side) < 0 and exponent(side) > significant_place(side, scale) for side in sides)

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
        >>> Evidence.parse("1.000000000 < 2").same(Evidence.parse("1.000000001 < 2"))
        True
        """
        sides = ((self.left, fresh.left), (self.right, fresh.right))
        return (
            (self.sign, self.factor) == (fresh.sign, fresh.factor)
            and all(old == new or _near(old, new) for old, new in sides)
            and same_text(self.remark, fresh.remark)
        )

    def shown(self) -> str:
        """Return the inequality for a reader: four digits, or as many as tell both sides apart; a sign that is true.

        Returns
        -------
        str

        Examples
        --------
        >>> Evidence.parse("1.234567000 >= 1.234891000").shown()
        '1.2346 ≱ 1.2349'
        """
        sides = (self.left, self.right)
        pairs = (tuple(shorten(side, digits) for side in sides) for digits in range(4, DIGITS + 2))
        short = next((pair for pair in pairs if len({*pair}) == len({*sides})), sides)
        factor = f"{self.factor} · " if self.factor else ""
        return f"{short[0]} {SIGNS[self.sign][self.verdict == 'fails']} {factor}{short[1]}"


def gap(left: float, right: float) -> float:
    """Return the distance of two numbers as a share of the larger magnitude; 0 for two zeros.

    Examples
    --------
    >>> gap(0.9, 1.0), gap(0, 0)
    (0.1, 0.0)
    """
    larger = max(abs(left), abs(right))
    return abs(left - right) / larger if larger else 0.0


def _name(key: object) -> str:
    words = ", ".join(map(str, key)) if isinstance(key, tuple) else str(key)
    return words.replace("|", "/")


def _pair(value: object) -> Pair:
    sides = tuple(value) if isinstance(value, Iterable) else ()
    if len(sides) != 2:
        raise LedgerError(f"expected a pair (left, right), found {value!r}")
    return plain(sides[0]), plain(sides[1])


def _ratios(pairs: list[Pair]) -> str:
    """Say the range of left over right, where all are positive real numbers."""
    if not all(0 < left < float("inf") and 0 < right < float("inf") for left, right in pairs):
        return ""
    if all(isinstance(left, int) and isinstance(right, int) for left, right in pairs):
        return ""
    low, high = (_two_digits(choose(left / right for left, right in pairs)) for choose in (min, max))
    return f"ratio {low}" + (f" to {high}" if high != low else "")


def _two_digits(ratio: float) -> str:
    """Two digits, or as many as tell it from 1; a tiny or huge ratio may be one of rounding errors."""
    if not 1e-3 <= ratio <= 1e3:
        return "under 0.001" if ratio < 1 else "over 1000"
    digits = next((n for n in range(2, 6) if float(f"{ratio:.{n}g}") != 1), 2)
    text = f"{ratio:#.{digits}g}"
    return f"{float(text):g}" if "e" in text else text.removesuffix(".")


def _exact(side: str) -> Any:
    return float(side) if "inf" in side else Fraction(side)


def _near(old: str, new: str) -> bool:
    return "inf" not in old + new and "." in old + new and agrees(float(new), old)
