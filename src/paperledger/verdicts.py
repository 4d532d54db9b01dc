"""Derive verdicts on the printed numbers and the statements of a paper.

Numbers are compared as decimals, not as floats. The decimal ``1.005`` lies halfway between ``1.00`` and ``1.01``, but
the nearest float does not.

A statement has a relation, such as ``IAE of the PIDA < IAE of the PID | clearly``. Here *clearly* requires that the
left side is below 0.8 times the right side. The evidence of a statement is the inequality between computed numbers
that decides the statement: ``6.528000000 < 0.8 * 10.00000000 | worst of 4 cases: ex2, Ms 1.4; ratio from 0.31 to
0.65``. In this example the worst of four cases decides. Its name is ``ex2, Ms 1.4``.
"""

import operator
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from decimal import Context, Decimal
from fractions import Fraction
from math import isfinite, isinf, isnan
from numbers import Integral
from typing import Any, Self, SupportsFloat

Pair = tuple[float, float]  # left and right side; a whole number stays an int
Cases = Mapping[Any, Pair] | Mapping[Any, float] | Pair | float

DIGITS = 10  # significant digits of a stored value
WIDEST = Decimal("0.05")  # largest tolerance, as a fraction of the printed number
LONGEST, LARGEST_EXPONENT = 350, 330  # most characters before "e", and largest power of ten
DECLARED = ("misprint", "as-read", "differs", "not-computable")  # verdicts that a person declares
VERDICTS = ("reproduced", "last-digit", "approximate", "holds", "holds-in-part", "fails", *DECLARED)
# If a person declares a disagreement, the verdict that follows from the computed numbers must not be one of these.
AGREEING = ("reproduced", "approximate", "holds", "holds-in-part")
BASES = ("computed", "fitted", "from-print", "reading")

_SLACK = Decimal("1e-9")  # relative tolerance for the rounding of floating-point arithmetic
_NUMBER = r"(?:\d+(?:\.\d+)?|\.\d+)(?:[eE][+-]?\d+)?"
_SIGNED = re.compile(rf"[+-]?{_NUMBER}", re.ASCII)
_INNER = re.compile(_NUMBER, re.ASCII)
_TOLERANCE = re.compile(rf"\btolerance\s+({_NUMBER})(\s*%)?", re.IGNORECASE | re.ASCII)
_WIDE = Context(prec=700)  # enough digits for any double and any printed place


class LedgerError(ValueError):
    """Raised if a ledger has errors or disagrees with computed numbers. The message has one line for each error.

    Examples
    --------
    >>> issubclass(LedgerError, ValueError)
    True
    """


def read_number(text: str) -> Decimal:
    """Read a number from text. The result keeps all written places, including trailing zeros.

    >>> read_number("1.30")
    Decimal('1.30')
    """
    if not _SIGNED.fullmatch(text):
        raise LedgerError(f"{text!r} is not a plain number such as 0.382, -8 or 1e-3")
    mantissa, _, power = text.lower().partition("e")
    if len(mantissa) > LONGEST or len(power) > len("-999") or abs(int(power or 0)) > LARGEST_EXPONENT:
        raise LedgerError(f"{text[:40]!r} is outside the range of doubles, or has more than {LONGEST} digits")
    return Decimal(text)


def plain(value: Any) -> int | float:
    """Convert a computed number to an int or a float. The number may be infinite or a NumPy scalar."""
    scalar = value.item() if getattr(value, "ndim", None) == 0 and hasattr(value, "item") else value
    if isinstance(scalar, Integral) and not isinstance(scalar, bool):
        return int(scalar)
    real = isinstance(scalar, SupportsFloat) and not isinstance(scalar, bool) and not hasattr(scalar, "shape")
    if not real or isnan(float(scalar)):
        raise LedgerError(f"expected a number, found {value!r}")
    return float(scalar)


def exponent(number: Decimal) -> int:
    """Return the power of ten of the last written place, such as -2 for ``1.30``."""
    return int(number.as_tuple().exponent)


def unit(number: Decimal) -> Decimal:
    """Return one unit in the last written place, such as 0.01 for ``1.30``."""
    return Decimal(1).scaleb(exponent(number))


def agrees(fresh: str, stored: str) -> bool:
    """Return True if a new number is within a unit of the last place of a stored number, or within a relative 1e-9.

    A stored number with fewer decimals than the new number could hide a change, so they do not agree, with two
    exceptions. One decimal less is allowed, since 10.00000000 and 9.999999999 both have ten digits. Ten stored decimals
    always suffice, since further decimals of a computed zero are rounding noise.

    >>> agrees("0.3812", "0.3811"), agrees("0.3812", "0.3814"), agrees("0.3812", "0.38")
    (True, False, False)
    """
    old, new = read_number(stored), read_number(fresh)
    close = abs(new - old) <= max(unit(old), _SLACK * abs(old))
    return close and exponent(old) <= max(exponent(new) + 1, -DIGITS)


def write(value: float, floor: int, digits: int = DIGITS) -> str:
    """Write a value with `digits` significant digits, including trailing zeros.

    Digits below ``10**floor`` are dropped. In a computed zero these digits are only rounding noise.

    >>> write(0.5, -12), write(1.2e-17, -11), write(2.5e-7, -17, digits=3)
    ('0.5000000000', '0.00000000000', '2.50e-7')
    """
    number = Decimal(repr(value))
    return _text(number, max(number.adjusted() - digits + 1, floor))


def shorten(text: str, digits: int) -> str:
    """Round a number that has a decimal point to `digits` significant digits. Integers and infinities do not change.

    >>> shorten("1.234567000", 4), shorten("12", 1), shorten("inf", 4), shorten("0.000000000000", 4)
    ('1.235', '12', 'inf', '0')
    """
    if "." not in text:
        return text
    number = read_number(text)
    if not number:
        return "0"
    place = max(number.adjusted() - digits + 1, exponent(number))
    rounded = number.quantize(Decimal(1).scaleb(place), context=_WIDE)
    return f"{rounded:f}" if -4 <= number.adjusted() < DIGITS and exponent(rounded) <= 0 else f"{rounded:e}"


def same_text(old: str, new: str) -> bool:
    """Return True if two texts have equal words and integers, and if `agrees` is true for their decimal numbers.

    >>> same_text("worst of 2 cases: a; ratio 0.31", "worst of 2 cases: a; ratio 0.32"), same_text("2 of 10", "3 of 10")
    (True, False)
    """
    if _INNER.sub("", old) != _INNER.sub("", new):
        return False
    pairs = zip(_INNER.findall(old), _INNER.findall(new), strict=True)
    return all(agrees(b, a) if "." in a and "." in b else Decimal(a) == Decimal(b) for a, b in pairs)


def show(printed: str, computed: str) -> str:
    """Round a stored number for display, to two places more than the printed number and at least three digits.

    The result never has more places than the stored number.

    >>> show("1.31", "1.309812345"), show("1200", "0.001234567890"), show("0.382", "0.38")
    ('1.3098', '0.00123', '0.38')
    """
    number = read_number(computed)
    guarded = exponent(read_number(printed)) - 2
    legible = number.adjusted() - 2 if number else guarded
    return _text(number, max(exponent(number), min(guarded, legible)))


def _text(number: Decimal, place: int) -> str:
    rounded = number.quantize(Decimal(1).scaleb(place), context=_WIDE)
    # A zero is written without sign and exponent.
    return str(rounded).lower() if rounded else f"{abs(rounded):f}"


def tolerance(note: str, printed: Decimal) -> Decimal | None:
    """Read the tolerance in a note: ``tolerance 1 %`` of the printed number, or ``tolerance 0.02`` in the same unit.

    >>> tolerance("measured with noise: tolerance 5 %", Decimal("2.0"))
    Decimal('0.10')
    """
    tolerances = _TOLERANCE.findall(note)
    if not tolerances:
        return None
    if len(tolerances) > 1:
        raise LedgerError("the note sets more than one tolerance")
    size, percent = tolerances[0]
    width = Decimal(size) * (abs(printed) / 100 if percent else 1)
    if width < unit(printed) / 2:  # a value that rounds to the printed number could otherwise be refused
        raise LedgerError(f"the tolerance {width} is finer than the printed digits of {printed}")
    if width > max(WIDEST * abs(printed), unit(printed) / 2):
        raise LedgerError(f"the tolerance {width} is wider than 5 % of {printed}; declare 'differs' instead")
    return width


def difference(printed: str, computed: str) -> Decimal:
    """Return computed minus printed, in units of the last printed place.

    >>> difference("1.30", "1.3125")
    Decimal('1.25')
    """
    number = read_number(printed)
    return (read_number(computed) - number) / unit(number)


def derive(printed: str, computed: str, note: str = "") -> str | None:
    """Return the verdict that follows from two numbers.

    A computed number halfway between two printed numbers agrees with both, since a paper may round it up or down. If a
    note sets a tolerance, a number within the tolerance is ``approximate``, even if it rounds to the printed number.

    Parameters
    ----------
    printed, computed : str
        The two numbers, as text with all digits.
    note : str, optional
        Note that may set a tolerance (see `tolerance`).

    Returns
    -------
    str or None
        Without a tolerance, ``reproduced`` if the numbers differ by at most half a unit of the last printed place, and
        ``last-digit`` if they differ by at most one and a half. With a tolerance, ``approximate``. None if the numbers
        disagree: a person must then declare a verdict.

    Raises
    ------
    LedgerError
        If an entry is not a number, if the note sets several tolerances, or if the tolerance is finer than the printed
        digits or wider than 5 % of the printed number.

    Examples
    --------
    >>> derive("1.31", "1.3098"), derive("1.31", "1.3151"), derive("1.31", "1.4")
    ('reproduced', 'last-digit', None)
    >>> derive("1.31", "1.36", note="step times unpublished, tolerance 5 %")
    'approximate'
    """
    number = read_number(printed)
    width = tolerance(note, number)
    if width is not None:
        return "approximate" if abs(read_number(computed) - number) <= width * (1 + _SLACK) else None
    off = abs(difference(printed, computed)) - _SLACK / 2
    return "reproduced" if off <= 0.5 else "last-digit" if off <= 1.5 else None


# --- statements -----------------------------------------------------------------------------------------------------

ROUNDING = "rounding"  # convention of an *identity*, which states that a residual is only rounding error
SIGNS = {  # for each sign: the comparison, the sign to display if it holds, and the sign to display if it fails
    "<": (operator.lt, "<", "≮"),
    "<=": (operator.le, "≤", "≰"),
    ">": (operator.gt, ">", "≯"),
    ">=": (operator.ge, "≥", "≱"),
    "==": (operator.eq, "=", "≠"),
    "≈": (operator.eq, "≈", "≉"),  # this comparison is not used: the bounds of a convention replace it
}
_PARTS = re.compile(r"(holds|fails) for: (.+)")
_RELATION = re.compile(r"(?:(.*?) )?(<=?|>=?|==|≈)(?: (.*))?")
_EVIDENCE = re.compile(r"(\S+) (<=?|>=?|==) (?:([\d.]+(?:/[\d.]+)?) \* )?(\S+)(?: \| (.+))?")


# A convention gives a word such as *clearly* a numerical meaning, which is the same for all papers. For each sign that
# a relation may have, the convention lists the bounds that must all hold. A bound is a sign and a factor of the right
# side: "< 0.8" means left < 0.8 * right. The page *Notation* defines the words.
CONVENTIONS = {
    "similar": {"≈": ">= 0.9, <= 1/0.9"},
    "slightly": {"<": "<, >= 0.9", ">": ">, <= 1/0.9"},
    "clearly": {"<": "< 0.8", ">": "> 1.25"},
    "much": {"<": "< 0.5", ">": "> 2"},
    "negligible": {"<": "< 0.1", ">": "> 10"},
    "settled": {"<=": "<= 0.02", ">": "> 0.02"},
    "identical": {"<=": "<= 0.01", ">": "> 0.01"},
}
_BOUNDS = CONVENTIONS | {"": {sign: sign for sign in SIGNS if sign != "≈"}, ROUNDING: {"<=": "<="}}


@dataclass(frozen=True)
class Relation:
    """Relation that a statement asserts, from the column ``relation`` of its row.

    Parameters
    ----------
    left : str
        Name of the left side, which may be empty.
    sign : str
        One of ``< <= > >= == ≈``. ``==`` is for integers, and ``≈`` needs a convention.
    right : str
        Name of the right side, or the tolerance of an identity.
    convention : str
        A key of `CONVENTIONS`, ``rounding``, or empty. With ``rounding`` the relation is an identity, and its left side
        is a residual.
    some : bool
        True if one case is enough. By default every case must hold.
    parts : tuple of str
        If a statement holds only in part, names of the cases that a person declared to hold or to fail. The name
        ``ex2`` stands for the case ``ex2`` and for all cases such as ``ex2, Ms 1.4``.
    parts_hold : bool
        True if `parts` hold and all other cases fail. False if `parts` fail and all other cases hold.

    Examples
    --------
    >>> relation = Relation.parse("IAE of the PIDA < IAE of the PID | clearly")
    >>> relation.left, relation.convention, relation.some
    ('IAE of the PIDA', 'clearly', False)
    >>> print(relation.decide({"Ms 1.4": (0.7, 1.0), "Ms 2.0": (0.5, 1.0)}))
    0.7000000000 < 0.8 * 1.000000000 | worst of 2 cases: Ms 1.4; ratio from 0.50 to 0.70
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
        """Read the column ``relation`` of a row.

        Parameters
        ----------
        text : str
            Left name, sign and right name. Two optional parts follow, each after ``|``: a convention, and one of
            ``some``, ``holds for: ex1; ex2`` and ``fails for: ex3``.

        Returns
        -------
        Relation

        Raises
        ------
        LedgerError
            If the text is not a relation, if the convention does not exist for the sign, or if an identity has parts.

        Examples
        --------
        >>> Relation.parse("residual <= 1e-9 | rounding").is_identity
        True
        """
        words, *marks = (part.strip() for part in text.split("|"))
        match = _RELATION.fullmatch(words)
        if not match:
            raise LedgerError(f"relation {text!r} does not read like 'IAE of PIDA < IAE of PID | clearly'")
        left, sign, right = (part or "" for part in match.groups())
        some, parts = marks[-1:] == ["some"], _PARTS.fullmatch(marks[-1]) if marks else None
        convention = " | ".join(marks[:-1] if some or parts else marks)
        if sign not in _BOUNDS.get(convention, ()):
            known = f"{', '.join(CONVENTIONS)}, and 'residual <= 1e-9 | rounding' for an identity"
            raise LedgerError(f"relation {text!r}: {sign} does not allow {convention!r}; known: {known}")
        if not parts:
            return cls(left, sign, right, convention, some)
        if convention == ROUNDING:
            raise LedgerError(f"relation {text!r}: an identity cannot hold in part")
        names = tuple(name.strip() for name in parts[2].split(";"))
        return cls(left, sign, right, convention, some, names, parts[1] == "holds")

    @property
    def is_identity(self) -> bool:
        """True if the statement is that a residual is only rounding error.

        If the statement holds, its evidence has the residual rounded up, since the digits depend on the machine.
        """
        return self.convention == ROUNDING

    @property
    def words(self) -> str:
        """The relation in words for a reader."""
        sides = (self.left, SIGNS[self.sign][1], self.right) if self.left or self.right else ()
        named = f"by the convention “{self.convention}”" if self.convention else ""
        return ", ".join(filter(None, (" ".join(sides).strip(), named, "in at least one case" * self.some)))

    def decide(self, cases: Cases, digits: int = DIGITS, strict: bool = True) -> "Evidence":
        """Find the case that decides the statement: the worst case, or the best case if one case is enough.

        Parameters
        ----------
        cases : mapping of any to pair of numbers, or pair of numbers, or number
            As in `Ledger.decide`.
        digits : int, optional
            Significant digits of real numbers. Integers stay exact.
        strict : bool, optional
            If True, and if the statement holds in part, every case must hold or fail as declared.

        Returns
        -------
        Evidence

        Raises
        ------
        LedgerError
            If there is no case, if a side has a wrong type, such as a float with ``==``, or if a case does not hold or
            fail as declared.

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
        if self.convention in ("settled", "identical"):  # compare distances, whatever their sign
            pairs = {name: (abs(left), abs(right)) for name, (left, right) in pairs.items()}
        if self.parts:
            return self._in_part(pairs, digits, strict)
        best = "best" if self.some else "worst"
        which = f"{best} of {len(pairs)} case{'s' * (len(pairs) > 1)}: {{}}" if named is cases else ""
        return self._evidence(pairs, digits, which)

    def _evidence(self, pairs: dict[str, Pair], digits: int, which: str) -> "Evidence":
        """Return the evidence of the worst case, or of the best case if one case is enough.

        The remark begins with the text `which`, where ``{}`` stands for the name of the case.
        """
        slack = {name: self._slack(*pair) for name, pair in pairs.items()}
        name = (max if self.some else min)(slack, key=lambda case: slack[case][0])
        remark = "; ".join(filter(None, (which.format(name), _ratios([*pairs.values()]))))
        scale = max((abs(side) for side in pairs[name] if isfinite(side)), default=0)
        left, right = (_side(side, scale, digits) for side in pairs[name])
        return Evidence(left, *slack[name][1], right, remark)

    def _in_part(self, pairs: dict[str, Pair], digits: int, strict: bool) -> "Evidence":
        """Return the evidence of the worst case that is declared to hold, and of the best that is declared to fail."""
        if idle := [part for part in self.parts if not any(_belongs(name, part) for name in pairs)]:
            raise LedgerError(f"no case is called {' or '.join(idle)}; there are {'; '.join(pairs)}")
        declared = {n: any(_belongs(n, part) for part in self.parts) == self.parts_hold for n in pairs}
        for name, pair in pairs.items():
            if strict and (self._evidence({name: pair}, digits, "").verdict == "holds") != declared[name]:
                says = "hold" if declared[name] else "fail"
                raise LedgerError(f"{name} is declared to {says}, but does not")
        groups = [{n: pair for n, pair in pairs.items() if declared[n] == side} for side in (True, False)]
        if not all(groups):
            raise LedgerError("a statement that holds in part needs a case that holds and one that fails")
        decisive = []
        for word, group in zip(("holds", "fails"), groups, strict=True):
            names = "; ".join(group).replace("{", "{{").replace("}", "}}")
            relation = replace(self, parts=(), some=word == "fails")
            which = f"{word} in {len(group)} of {len(pairs)} ({names})"
            decisive.append(relation._evidence(group, digits, which))
        return replace(decisive[0], but=decisive[1])

    def _slack(self, left: float, right: float) -> tuple[float, tuple[str, str]]:
        """Return the smallest relative distance of a case from a bound, and this bound.

        The distance from a bound is negative if the bound does not hold.
        """
        if self.sign == "==" and not (isinstance(left, int) and isinstance(right, int)):
            raise LedgerError(f"'==' compares integers, found {left!r} and {right!r}; use <= for a residual")
        if self.convention and not (0 <= left < float("inf") and 0 <= right < float("inf")):
            raise LedgerError(f"{self.convention!r} compares finite magnitudes, found {left} and {right}")
        bounds = []
        for bound in _BOUNDS[self.convention][self.sign].split(", "):
            sign, _, factor = bound.partition(" ")
            asked = float(_times(factor)) * right if factor else right
            larger = max(abs(left), abs(asked))
            gap = float(left != asked) if isinf(larger) else abs(left - asked) / (larger or 1)
            # Round the distance, so that rounding errors do not decide which of two equal cases is the worst.
            bounds.append((round(gap if SIGNS[sign][0](left, asked) else -gap, 9), (sign, factor)))
        return min(bounds, key=lambda pair: pair[0])

    def _residual(self, residuals: list[float]) -> "Evidence":
        """Return the evidence of the largest residual.

        A residual within the tolerance is rounded up to a power of ten, but not above the tolerance. A larger residual
        keeps `DIGITS` digits.
        """
        largest, tolerance = max(map(abs, residuals)), float(self.right)
        if not isfinite(largest):
            raise LedgerError(f"a residual must be finite, found {largest}")
        if largest > tolerance:
            return Evidence(_side(largest, largest, DIGITS), "<=", "", self.right)
        decade = next(f"1e{power}" for power in range(-30, 400) if largest <= float(f"1e{power}"))
        return Evidence(decade if float(decade) <= tolerance else self.right, "<=", "", self.right)


@dataclass(frozen=True)
class Evidence:
    """Inequality between two computed numbers that decides a statement.

    Parameters
    ----------
    left : str
        The left number with its digits.
    sign : str
        One of ``< <= > >= ==``.
    factor : str
        Factor of the right number, such as ``0.8`` or ``1/0.9``, or empty.
    right : str
        The right number with its digits.
    remark : str, optional
        Number of cases, name of the case that decides, and range of the ratio left / right over all cases.
    but : Evidence, optional
        If the statement holds only in part, the inequality that fails. In the row, this inequality follows ``||``.

    Examples
    --------
    >>> kept = Evidence.parse("0.6528506558 < 0.5 * 1.000000000 | worst of 6 cases: ξ = 0.5")
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
        """Read the evidence of a row.

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
            If the text is not an inequality of two numbers.

        Examples
        --------
        >>> Evidence.parse("3 == 3 | worst of 2 cases: at 1.4").remark
        'worst of 2 cases: at 1.4'
        """
        first, both, second = text.partition(" || ")
        match = _EVIDENCE.fullmatch(first)
        if not match:
            raise LedgerError(f"evidence {text!r} is no inequality such as '1.2 < 0.5 * 3.1'")
        left, sign, factor, right, remark = (part or "" for part in match.groups())
        _ = _exact(left), _exact(right)
        return cls(left, sign, factor, right, remark, cls.parse(second) if both else None)

    def __str__(self) -> str:
        factor = f"{self.factor} * " if self.factor else ""
        remark = f" | {self.remark}" if self.remark else ""
        but = f" || {self.but}" if self.but else ""
        return f"{self.left} {self.sign} {factor}{self.right}{remark}{but}"

    @property
    def inequalities(self) -> tuple["Evidence", ...]:
        """The inequality, or both inequalities of a statement that holds in part."""
        return (replace(self, but=None), *((self.but,) if self.but else ()))

    @property
    def verdict(self) -> str:
        """The verdict that follows from the stored digits: ``holds``, ``holds-in-part`` or ``fails``."""
        if self.but:
            verdicts = tuple(inequality.verdict for inequality in self.inequalities)
            return "holds-in-part" if verdicts == ("holds", "fails") else "fails"
        right = _exact(self.right)
        asked = right * _times(self.factor) if self.factor else right
        return "holds" if SIGNS[self.sign][0](_exact(self.left), asked) else "fails"

    def shown(self) -> str:
        """Return the inequality for display. If it fails, its sign is negated.

        Decimals have four significant digits, or more if unequal sides would otherwise look equal.

        Returns
        -------
        str

        Examples
        --------
        >>> Evidence.parse("1.234567000 >= 1.234891000").shown()
        '1.2346 ≱ 1.2349'
        """
        if self.but:
            return "; ".join(inequality.shown() for inequality in self.inequalities)
        sides = (self.left, self.right)
        pairs = ([shorten(side, digits) for side in sides] for digits in range(4, DIGITS + 2))
        left, right = next((pair for pair in pairs if len({*pair}) == len({*sides})), sides)
        factor = f"{self.factor} · " if self.factor else ""
        return f"{left} {SIGNS[self.sign][1 + (self.verdict == 'fails')]} {factor}{right}"


def _name(key: object) -> str:
    return (", ".join(map(str, key)) if isinstance(key, tuple) else str(key)).replace("|", "/")


def _belongs(name: str, part: str) -> bool:
    """Return True if the name of a case equals `part`, or begins with `part` and a comma."""
    return name == part or name.startswith(f"{part}, ")


def _pair(value: object) -> Pair:
    sides = tuple(value) if isinstance(value, Iterable) else ()
    if len(sides) != 2:
        raise LedgerError(f"expected a pair (left, right), found {value!r}")
    return plain(sides[0]), plain(sides[1])


def _side(value: float, scale: float, digits: int) -> str:
    """Write one side of an inequality. Integers stay integers. Drop digits below about 1e-12 * `scale` as noise."""
    if isinstance(value, int) or isinf(value):
        return str(value)
    return write(value, Decimal(repr(float(scale))).adjusted() - 12 if scale else -400, digits)


def _ratios(pairs: list[Pair]) -> str:
    """Return the range of left / right as text.

    The text is empty if all sides are integers, or if any side is 0, negative or infinite.
    """
    sides = [side for pair in pairs for side in pair]
    if all(isinstance(side, int) for side in sides) or not all(0 < side < float("inf") for side in sides):
        return ""
    low, high = (_two_digits(choose(left / right for left, right in pairs)) for choose in (min, max))
    return f"ratio from {low} to {high}" if high != low else f"ratio {low}"


def _two_digits(ratio: float) -> str:
    """Round a ratio to two digits, or to at most five if it would otherwise be 1. Write extreme ratios as bounds."""
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
