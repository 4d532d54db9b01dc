"""What words such as *similar* or *clearly* mean: one table for all chapters, fixed before any number was compared."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite

from pidalab.ledger.errors import LedgerError

ROUNDING = 1e-9  # relative; a value on the limit counts as within, whatever its last bits are


def gap(left: float, right: float) -> float:
    """Return the distance of two numbers as a share of the larger magnitude; 0 for two zeros.

    Parameters
    ----------
    left, right : float
        Any finite numbers.

    Returns
    -------
    float

    Examples
    --------
    >>> gap(0.9, 1.0), gap(0, 0)
    (0.1, 0.0)
    """
    larger = max(abs(left), abs(right))
    return abs(left - right) / larger if larger else 0.0


def two_digits(number: float) -> str:
    """Write a number with two significant digits, and without an exponent where zeros say the same.

    Parameters
    ----------
    number : float
        Any number.

    Returns
    -------
    str

    Examples
    --------
    >>> two_digits(99.97), two_digits(4.76), two_digits(3e-7)
    ('100', '4.8', '3e-07')
    """
    return f"{float(f'{number:.2g}'):g}"


def factor(left: float, right: float) -> float:
    """Return how many times the larger magnitude is the smaller; infinite for a zero and for different signs.

    Parameters
    ----------
    left, right : float
        Any finite numbers.

    Returns
    -------
    float

    Examples
    --------
    >>> factor(1.0, 2.5), factor(0.0, 2.5)
    (2.5, inf)
    """
    smaller, larger = sorted((abs(left), abs(right)))
    if smaller == larger:
        return 1.0 if left == right else float("inf")
    return larger / smaller if left * right > 0 else float("inf")


def share(left: float, right: float) -> float:
    """Return the magnitude of the left number as a share of that of the right.

    Parameters
    ----------
    left, right : float
        A deviation, and the change or range that it is part of.

    Returns
    -------
    float

    Examples
    --------
    >>> share(-0.02, 2.0)
    0.01
    """
    return abs(left) / abs(right) if right else (float("inf") if left else 0.0)


@dataclass(frozen=True)
class Convention:
    """The meaning of a word that compares.

    Parameters
    ----------
    name : str
        Key in `CONVENTIONS`.
    words : str
        The words of a paper that it stands for.
    meaning : str
        What they mean in the book.
    limit : float
        The threshold.
    measure : callable
        What is compared with the threshold: `gap`, `factor` or `share`.
    at_least : bool
        Whether the measure has to reach the limit, instead of staying within.
    relations : tuple of str
        The relations that it can qualify.

    Examples
    --------
    >>> CONVENTIONS["clearly"].judge(0.7, "<", 1.0), CONVENTIONS["clearly"].judge(0.9, "<", 1.0)
    (True, False)
    """

    name: str
    words: str
    meaning: str
    limit: float
    measure: Callable[[float, float], float]
    at_least: bool
    relations: tuple[str, ...]

    def judge(self, left: float, relation: str, right: float, scale: float = 1.0) -> bool:
        """Decide whether a relation holds under the convention.

        Parameters
        ----------
        left : float
            The left number.
        relation : str
            One of `relations`.
        right : float
            The right number.
        scale : float, optional
            Multiplies the limit.

        Returns
        -------
        bool

        Raises
        ------
        LedgerError
            If the convention does not qualify this relation, or a number is not finite.

        Examples
        --------
        >>> CONVENTIONS["similar"].judge(1.0, "within", 1.15), CONVENTIONS["similar"].judge(1.0, "within", 1.15, 2)
        (False, True)
        """
        return self.slack(left, relation, right, scale) >= 0

    def slack(self, left: float, relation: str, right: float, scale: float = 1.0) -> float:
        """Return how far a relation is from its turning point, as a share of the limit; negative if it fails.

        Parameters
        ----------
        left : float
            The left number.
        relation : str
            One of `relations`.
        right : float
            The right number.
        scale : float, optional
            Multiplies the limit.

        Returns
        -------
        float

        Raises
        ------
        LedgerError
            As in `judge`.

        Examples
        --------
        >>> CONVENTIONS["settled"].slack(0.01, "<=", 1.0)
        0.500000001
        """
        if relation not in self.relations:
            allowed = " or ".join(map(repr, self.relations))
            raise LedgerError(f"the convention {self.name!r} goes with {allowed}, found {relation!r}")
        if not (isfinite(left) and isfinite(right)):
            raise LedgerError(f"the convention {self.name!r} needs finite numbers, found {left} and {right}")
        limit = self.limit * scale
        size = (self.measure(left, right) - limit) / limit * (1 if self.at_least else -1) + ROUNDING
        if self.measure is share:
            return size if relation == "<=" else -size or -1e-300
        ahead = {"<": right - left, ">": left - right}.get(relation, 1.0)
        return size if ahead > 0 else -gap(left, right) - 1e-300

    def said(self, left: float, right: float) -> str:
        """Say the measure of two numbers.

        Parameters
        ----------
        left, right : float
            The numbers.

        Returns
        -------
        str

        Examples
        --------
        >>> CONVENTIONS["much"].said(1.0, 2.5), CONVENTIONS["similar"].said(1.0, 1.05)
        ('a factor of 2.5', '4.8 %')
        """
        size = self.measure(left, right)
        return f"a factor of {two_digits(size)}" if self.measure is factor else f"{two_digits(100 * size)} %"

    def remark(self, left: float, relation: str, right: float) -> str:
        """Say what the convention asks and what there is, and whether half or twice the limit would turn the verdict.

        Parameters
        ----------
        left : float
            The left number.
        relation : str
            One of `relations`.
        right : float
            The right number.

        Returns
        -------
        str

        Raises
        ------
        LedgerError
            As in `judge`.

        Examples
        --------
        >>> CONVENTIONS["similar"].remark(1.0, "within", 1.15)
        'similar: at most 10 %, here 13 %; turns within a factor of two of the limit'
        """
        holds = self.judge(left, relation, right)
        near = any(self.judge(left, relation, right, scale) is not holds for scale in (0.5, 2.0))
        bound = "at least" if self.at_least else "at most"
        limit = f"a factor of {self.limit:g}" if self.measure is factor else f"{100 * self.limit:g} %"
        warning = "; turns within a factor of two of the limit" if near else ""
        return f"{self.name}: {bound} {limit}, here {self.said(left, right)}{warning}"


CONVENTIONS = {
    convention.name: convention
    for convention in (
        Convention(
            "similar", "similar, about, comparable", "within 10 % of the larger", 0.1, gap, False, ("within",)
        ),
        Convention("slightly", "slightly", "a difference, and at most 10 %", 0.1, gap, False, ("<", ">")),
        Convention(
            "clearly", "clearly, significantly", "at least 20 % of the larger", 0.2, gap, True, ("<", ">")
        ),
        Convention("much", "much", "at least a factor of 2", 2.0, factor, True, ("<", ">")),
        Convention(
            "negligible",
            "≫, negligible against",
            "at least a factor of 10",
            10.0,
            factor,
            True,
            ("<", ">"),
        ),
        Convention(
            "settled",
            "no overshoot, without oscillation, monotonic, settled",
            "at most 2 % of the change (the settling band)",
            0.02,
            share,
            False,
            ("<=", ">"),
        ),
        Convention(
            "identical",
            "identical curves, no visible difference",
            "at most 1 % of the range (a line's width in a figure)",
            0.01,
            share,
            False,
            ("<=", ">"),
        ),
    )
}
IDENTITY = 1e-9  # largest relative residual of two formulas that are called the same


def find_convention(name: str) -> Convention:
    """Return a convention by its name.

    Parameters
    ----------
    name : str
        Key in `CONVENTIONS`.

    Returns
    -------
    Convention

    Raises
    ------
    LedgerError
        For an unknown name.

    Examples
    --------
    >>> find_convention("much").limit
    2.0
    """
    if name not in CONVENTIONS:
        raise LedgerError(f"unknown convention {name!r}; one of {', '.join(CONVENTIONS)}")
    return CONVENTIONS[name]
