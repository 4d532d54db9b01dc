"""Statements: the relation that a row asks for, and the inequality of two computed numbers that decides it.

A row says ``IAE of the PIDA < IAE of the PID | clearly``. What decides it is kept beside it, as evidence:
``6.528000000 < 0.8 * 10.00000000 | worst of 4: ex2, Ms 1.4; ratio 0.31 to 0.65``.
"""

import operator
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from decimal import Decimal
from fractions import Fraction
from math import isfinite, isinf
from typing import Any, Self

from paperledger.digits import DIGITS, LedgerError, plain, read_number, shorten, write

Pair = tuple[float, float]  # integers stay integers
Cases = Mapping[Any, Pair] | Mapping[Any, float] | Pair | float

ROUNDING = "rounding"  # the convention of an identity
SIGNS = {  # the test; for a reader what holds, and what does not
    "<": (operator.lt, "<", "≮"),
    "<=": (operator.le, "≤", "≰"),
    ">": (operator.gt, ">", "≯"),
    ">=": (operator.ge, "≥", "≱"),
    "==": (operator.eq, "=", "≠"),
    "≈": (operator.eq, "≈", "≉"),  # always with a convention, whose bounds decide
}
_PARTS = re.compile(r"(holds|fails) for: (.+)")
_RELATION = re.compile(r"(?:(.*?) )?(<=?|>=?|==|≈)(?: (.*))?")
_EVIDENCE = re.compile(r"(\S+) (<=?|>=?|==) (?:([\d.]+(?:/[\d.]+)?) \* )?(\S+)(?: \| (.+))?")


@dataclass(frozen=True)
class Convention:
    """The meaning of a word that compares: one table for all papers, whose numbers no single row may change.

    Parameters
    ----------
    words : str
        The words of a paper that it covers.
    meaning : str
        What they mean in the book.
    bounds : dict of str to str
        What has to hold, by the sign that it qualifies: inequalities, each a sign and a factor of the right side.

    Examples
    --------
    >>> CONVENTIONS["much"].bounds["<"]
    '< 0.5'
    """

    words: str
    meaning: str
    bounds: dict[str, str]


CONVENTIONS = {
    "similar": Convention(
        "similar, about, comparable", "within 10 % of the larger", {"≈": ">= 0.9, <= 1/0.9"}
    ),
    "slightly": Convention(
        "slightly", "a difference, and at most 10 %", {"<": "<, >= 0.9", ">": ">, <= 1/0.9"}
    ),
    "clearly": Convention(
        "clearly, significantly", "by more than 20 % of the larger", {"<": "< 0.8", ">": "> 1.25"}
    ),
    "much": Convention("much", "by more than a factor of 2", {"<": "< 0.5", ">": "> 2"}),
    "negligible": Convention(
        "≫, negligible against", "by more than a factor of 10", {"<": "< 0.1", ">": "> 10"}
    ),
    "settled": Convention(
        "no overshoot, without oscillation, monotonic, settled",
        "at most 2 % of the change (the settling band)",
        {"<=": "<= 0.02", ">": "> 0.02"},
    ),
    "identical": Convention(
        "identical curves, no visible difference",
        "at most 1 % of the range (a line's width in a figure)",
        {"<=": "<= 0.01", ">": "> 0.01"},
    ),
}
# what has to hold, by convention and sign
_BOUNDS = {name: convention.bounds for name, convention in CONVENTIONS.items()}
_BOUNDS |= {"": {sign: sign for sign in SIGNS if sign != "≈"}, ROUNDING: {"<=": "<="}}


@dataclass(frozen=True)
class Relation:
    """The relation that a statement asks for, from the column ``relation`` of its row.

    Parameters
    ----------
    left : str
        What the left side is; may be empty.
    sign : str
        One of ``< <= > >= == ≈``; ``==`` is for integers, ``≈`` needs a convention.
    right : str
        What the right side is; the tolerance of an identity.
    convention : str
        A key of `CONVENTIONS`; ``rounding`` for an identity, whose left side is a residual; or empty.
    some : bool
        Whether one case is enough; by default every case must hold.
    parts : tuple of str
        Of a statement that holds in part, the cases that were declared to hold, or to fail. A case belongs to a part
        that it is called like, or that its name begins with: ``ex2, Ms 1.4`` to ``ex2``.
    parts_hold : bool
        Whether the parts hold and all other cases fail, or the other way round.

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
    parts: tuple[str, ...] = ()
    parts_hold: bool = True

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read the column of a row.

        Parameters
        ----------
        text : str
            Left name, sign, right name, then after ``|`` an optional convention, and optionally ``some``, or
            ``holds for: ex1; ex2``, or ``fails for: ex3``.

        Returns
        -------
        Relation

        Raises
        ------
        LedgerError
            If it is not a relation, or the convention does not go with the sign.

        Examples
        --------
        >>> Relation.parse("residual <= 1e-9 | rounding").is_identity
        True
        """
        words, *marks = (part.strip() for part in text.split("|"))
        found = _RELATION.fullmatch(words)
        if not found:
            raise LedgerError(f"relation {text!r} does not read like 'IAE of PIDA < IAE of PID | clearly'")
        left, sign, right = (part or "" for part in found.groups())
        some, parts = marks[-1:] == ["some"], _PARTS.fullmatch(marks[-1]) if marks else None
        convention = " | ".join(marks[:-1] if some or parts else marks)
        if sign not in _BOUNDS.get(convention, ()):
            known = f"{', '.join(CONVENTIONS)}, and 'residual <= 1e-9 | rounding' for an identity"
            raise LedgerError(
                f"relation {text!r}: {sign} takes no convention {convention!r}; there are {known}"
            )
        if not parts:
            return cls(left, sign, right, convention, some)
        if convention == ROUNDING:
            raise LedgerError(f"relation {text!r}: an identity holds for every case or fails")
        names = tuple(name.strip() for name in parts[2].split(";"))
        return cls(left, sign, right, convention, some, names, parts[1] == "holds")

    @property
    def is_identity(self) -> bool:
        """True if a residual is compared with rounding. Only its decade is kept; the rest depends on the machine."""
        return self.convention == ROUNDING

    @property
    def words(self) -> str:
        """The relation for a reader."""
        sides = (self.left, SIGNS[self.sign][1], self.right) if self.left or self.right else ()
        said = (" ".join(filter(None, sides)), self.convention, "in some case" * self.some)
        return ", ".join(filter(None, said))

    def decide(self, cases: Cases, digits: int = DIGITS, strict: bool = True) -> "Evidence":
        """Find the case that decides: the worst one, or the best where one is enough.

        Parameters
        ----------
        cases : mapping of any to pair of numbers, or pair of numbers, or number
            Both sides by case, or of the only case; for an identity residuals by case, or the only one.
        digits : int, optional
            Significant digits to keep of real numbers; integers stay exact.
        strict : bool, optional
            Whether each case of a statement that holds in part must be as declared.

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
        named = cases if isinstance(cases, Mapping) else {"": cases}
        if not named:
            raise LedgerError("no cases to decide from")
        if self.is_identity:
            return self._residual([float(plain(value)) for value in named.values()])
        pairs = {_name(key): _pair(value) for key, value in named.items()}
        if self.convention in ("settled", "identical"):  # how far off, to either side
            pairs = {name: (abs(left), abs(right)) for name, (left, right) in pairs.items()}
        if self.parts:
            return self._in_part(pairs, digits, strict)
        best = "best" if self.some else "worst"
        which = f"{best} of {len(pairs)}: {{}}" if named is cases else ""
        return self._evidence(pairs, digits, which)

    def _evidence(self, pairs: dict[str, Pair], digits: int, which: str) -> "Evidence":
        """Keep the case that decides: the one nearest to failing, or to holding where one case is enough."""
        slack = {name: self._slack(*pair) for name, pair in pairs.items()}
        name = (max if self.some else min)(slack, key=lambda case: slack[case][0])
        remark = "; ".join(filter(None, (which.format(name), _ratios([*pairs.values()]))))
        scale = max((abs(side) for side in pairs[name] if isfinite(side)), default=0)
        left, right = (_side(side, scale, digits) for side in pairs[name])
        return Evidence(left, *slack[name][1], right, remark)

    def _in_part(self, pairs: dict[str, Pair], digits: int, strict: bool) -> "Evidence":
        """Keep the weakest part that holds and the part that fails by least; if strict, each case is as declared."""
        if idle := [part for part in self.parts if not any(_belongs(name, part) for name in pairs)]:
            raise LedgerError(f"no case is called {' or '.join(idle)}; there are {'; '.join(pairs)}")
        declared = {
            name: any(_belongs(name, part) for part in self.parts) == self.parts_hold for name in pairs
        }
        for name, pair in pairs.items():
            if strict and (self._evidence({name: pair}, digits, "").verdict == "holds") != declared[name]:
                raise LedgerError(
                    f"{name} is declared to {'hold' if declared[name] else 'fail'}, and does not"
                )
        groups = [{n: pair for n, pair in pairs.items() if declared[n] == side} for side in (True, False)]
        if not all(groups):
            raise LedgerError("a statement that holds in part has a case that holds and one that fails")
        found = []
        for word, group in zip(("holds", "fails"), groups, strict=True):
            names = "; ".join(group).replace("{", "{{").replace("}", "}}")
            relation = replace(self, parts=(), some=word == "fails")
            found.append(
                relation._evidence(group, digits, f"{word} in {len(group)} of {len(pairs)}: {names}")
            )
        return replace(found[0], but=found[1])

    def _slack(self, left: float, right: float) -> tuple[float, tuple[str, str]]:
        """Return the relative distance of a case from its nearest bound, negative if it fails, and that bound."""
        if self.sign == "==" and not (isinstance(left, int) and isinstance(right, int)):
            raise LedgerError(
                f"{self.sign!r} is for integers, found {left!r} and {right!r}; a residual takes <="
            )
        if self.convention and not (0 <= left < float("inf") and 0 <= right < float("inf")):
            raise LedgerError(f"{self.convention!r} compares finite magnitudes, found {left} and {right}")
        found = []
        for bound in _BOUNDS[self.convention][self.sign].split(", "):
            sign, _, factor = bound.partition(" ")
            asked = float(_times(factor)) * right if factor else right
            larger = max(abs(left), abs(asked))
            gap = float(left != asked) if isinf(larger) else abs(left - asked) / (larger or 1)
            # rounded, so that rounding errors never exchange two equal cases
            found.append((round(gap if SIGNS[sign][0](left, asked) else -gap, 9), (sign, factor)))
        return min(found, key=lambda one: one[0])

    def _residual(self, residuals: list[float]) -> "Evidence":
        """Keep the decade of the largest residual; all digits if it is no rounding."""
        found, tolerance = max(map(abs, residuals)), float(self.right)
        if not isfinite(found):
            raise LedgerError(f"a residual is finite, found {found}")
        if found > tolerance:
            return Evidence(_side(found, found, DIGITS), "<=", "", self.right)
        decade = next(f"1e{power}" for power in range(-30, 400) if found <= float(f"1e{power}"))
        return Evidence(decade if float(decade) <= tolerance else self.right, "<=", "", self.right)


@dataclass(frozen=True)
class Evidence:
    """The inequality of two computed numbers that decides a statement, as its row keeps it.

    Parameters
    ----------
    left : str
        The left number with its digits.
    sign : str
        One of ``< <= > >= ==``.
    factor : str
        What the right number is multiplied by: ``0.8``, ``1/0.9`` or nothing.
    right : str
        The right number with its digits.
    remark : str, optional
        Of how many cases this is the worst, and the range of the ratio of both sides over them.
    but : Evidence, optional
        Of a statement that holds in part, the inequality that fails; after `` || `` in the row.

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
    but: "Evidence | None" = None

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
        first, both, second = text.partition(" || ")
        found = _EVIDENCE.fullmatch(first)
        if not found:
            raise LedgerError(f"evidence {text!r} is no inequality such as '1.2 < 0.5 * 3.1'")
        left, sign, factor, right, remark = (part or "" for part in found.groups())
        _ = _exact(left), _exact(right)
        return cls(left, sign, factor, right, remark, cls.parse(second) if both else None)

    def __str__(self) -> str:
        factor = f"{self.factor} * " if self.factor else ""
        remark = f" | {self.remark}" if self.remark else ""
        return f"{self.left} {self.sign} {factor}{self.right}{remark}" + (
            f" || {self.but}" if self.but else ""
        )

    @property
    def inequalities(self) -> tuple["Evidence", ...]:
        """The one inequality, or both of a statement that holds in part."""
        return (replace(self, but=None), *((self.but,) if self.but else ()))

    @property
    def verdict(self) -> str:
        """The verdict of the numbers as written: ``holds``, ``holds-in-part`` or ``fails``."""
        if self.but:
            verdicts = tuple(one.verdict for one in self.inequalities)
            return "holds-in-part" if verdicts == ("holds", "fails") else "fails"
        right = _exact(self.right)
        asked = right * _times(self.factor) if self.factor else right
        return "holds" if SIGNS[self.sign][0](_exact(self.left), asked) else "fails"

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
        if self.but:
            return "; ".join(one.shown() for one in self.inequalities)
        sides = (self.left, self.right)
        pairs = ([shorten(side, digits) for side in sides] for digits in range(4, DIGITS + 2))
        left, right = next((pair for pair in pairs if len({*pair}) == len({*sides})), sides)
        factor = f"{self.factor} · " if self.factor else ""
        return f"{left} {SIGNS[self.sign][1 + (self.verdict == 'fails')]} {factor}{right}"


def _name(key: object) -> str:
    words = ", ".join(map(str, key)) if isinstance(key, tuple) else str(key)
    return words.replace("|", "/")


def _belongs(name: str, part: str) -> bool:
    """Return True if a case is called like a part, or its name begins with that of the part."""
    return name == part or name.startswith(f"{part}, ")


def _pair(value: object) -> Pair:
    sides = tuple(value) if isinstance(value, Iterable) else ()
    if len(sides) != 2:
        raise LedgerError(f"expected a pair (left, right), found {value!r}")
    return plain(sides[0]), plain(sides[1])


def _side(value: float, scale: float, digits: int) -> str:
    """Write one side; an integer stays, and what is below 1e-12 of the larger side is dropped as noise."""
    if isinstance(value, int) or isinf(value):
        return str(value)
    return write(value, Decimal(repr(float(scale))).adjusted() - 12 if scale else -400, digits)


def _ratios(pairs: list[Pair]) -> str:
    """Say the range of left over right, where all are positive real numbers."""
    sides = [side for pair in pairs for side in pair]
    if all(isinstance(side, int) for side in sides) or not all(0 < side < float("inf") for side in sides):
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


def _times(factor: str) -> Fraction:
    over, _, under = factor.partition("/")
    try:
        return Fraction(read_number(over)) / Fraction(read_number(under or "1"))
    except ZeroDivisionError:
        raise LedgerError(f"{factor!r} divides by 0") from None


def _exact(side: str) -> Any:
    return float(side) if side.lstrip("-") == "inf" else Fraction(read_number(side))
