"""One row of a ledger, and what can be wrong with it."""

import re
from dataclasses import dataclass
from decimal import Decimal

from pidalab.ledger import digits, verdicts
from pidalab.ledger.errors import LedgerError, naming
from pidalab.ledger.relations import IDENTITY, Evidence, Relation

WORDS = 5  # of a note that carries a verdict; a reason is a sentence
_ID = re.compile(r"[a-z0-9_-]+(\.[a-z0-9_-]+)+")


@dataclass(frozen=True)
class Row:
    """One printed number or statement of a paper, beside what was computed. All entries are strings.

    Parameters
    ----------
    id : str
        Permanent, lower case, dotted, starting with the key of the paper.
    where : str
        Where the paper prints it.
    quantity : str
        What it is, with its unit.
    printed : str
        The printed number, digit for digit; for a statement, a short paraphrase.
    computed : str, optional
        The computed number, or ``holds`` or ``fails``. Empty when settled by reading, or not yet computed.
    verdict : str, optional
        A key of `VERDICTS`, or empty while nobody has judged.
    basis : str, optional
        A key of `BASES`.
    page : str, optional
        The notebook that hands the row over, its path below ``book`` without suffix; empty when settled by reading.
    relation : str, optional
        What a statement asks for; see `Relation`.
    evidence : str, optional
        The inequality of two computed numbers that decides a statement; see `Evidence`.
    note : str, optional
        Reasons, proofs, tolerances: plain text by a person, without numbers that could drift.

    Examples
    --------
    >>> row = Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced", page="demo")
    >>> row.derived()
    'reproduced'
    >>> row.problems()
    []
    """

    id: str
    where: str
    quantity: str
    printed: str
    computed: str = ""
    verdict: str = ""
    basis: str = "computed"
    page: str = ""
    relation: str = ""
    evidence: str = ""
    note: str = ""

    @property
    def is_statement(self) -> bool:
        """Whether the paper prints words, not a number; the quantity is then called ``statement``."""
        return self.quantity == "statement"

    @property
    def is_number(self) -> bool:
        """Whether a number was computed, so that differences make sense."""
        return not self.is_statement and self.computed not in ("", *verdicts.STATEMENT)

    @property
    def found(self) -> str:
        """What was computed: a number, or the evidence of a statement."""
        return self.evidence if self.is_statement else self.computed

    @property
    def half_unit(self) -> float:
        """Half a unit of the last printed place: how far the number may lie from its print.

        Raises
        ------
        LedgerError
            For a statement.

        Examples
        --------
        >>> Row("demo.kp", "Table 1", "gain", printed="1.30").half_unit
        0.005
        """
        with naming(self.id):
            return float(digits.unit(digits.read_number(self.printed)) / 2)

    def derived(self) -> str | None:
        """Return the verdict that follows from the entries, None if they disagree.

        Returns
        -------
        str or None
            For a statement what its evidence gives, for a number see `derive`.

        Raises
        ------
        LedgerError
            If an entry cannot be read.

        Examples
        --------
        >>> Row("demo.kp", "Table 1", "gain", printed="1.31", computed="1.3151").derived()
        'last-digit'
        >>> Row("demo.s", "sec. 2", "statement", "at most 10", evidence="10.82 <= 10").derived()
        'fails'
        """
        with naming(self.id):
            if self.is_statement:
                return Evidence.parse(self.evidence).verdict if self.evidence else self.computed
            return verdicts.derive(self.printed, self.computed, self.note)

    def difference(self) -> Decimal | None:
        """Return computed minus printed in units of the last printed place, None where there is no number.

        Returns
        -------
        decimal.Decimal or None

        Examples
        --------
        >>> Row("demo.kp", "Table 1", "gain", printed="1.30", computed="1.3125").difference()
        Decimal('1.25')
        """
        with naming(self.id):
            return verdicts.difference(self.printed, self.computed) if self.is_number else None

    def shown(self) -> str:
        """Return the computed entry, rounded for a reader; see `show`.

        Returns
        -------
        str

        Examples
        --------
        >>> Row("demo.kp", "Table 1", "gain", printed="1.31", computed="1.309812345").shown()
        '1.3098'
        """
        with naming(self.id):
            return digits.show(self.printed, self.computed) if self.is_number else self.computed

    def disagreement(self) -> str | None:
        """Say why the verdict does not follow from the entries, None if it does.

        Returns
        -------
        str or None

        Examples
        --------
        >>> Row("demo.kp", "Table 1", "gain", "1.31", "1.3151", "reproduced").disagreement()
        'demo.kp: file says reproduced, 1.3151 against printed 1.31 gives last-digit'
        """
        try:
            derived = self.derived()
        except LedgerError as error:
            return str(error)
        found = self.evidence if self.is_statement else f"{self.computed} against printed {self.printed}"
        gives = f"{found} gives {derived or 'no agreement'}"
        if self.verdict in verdicts.DECLARED:
            agrees = derived in verdicts.AGREEING
            return f"{self.id}: declared {self.verdict} starts to agree, {gives}" if agrees else None
        if derived == self.verdict:
            return None
        advice = "" if derived else "; declare misprint, as-read or differs, with a note"
        return f"{self.id}: file says {self.verdict or 'nothing'}, {gives}{advice}"

    def problems(self) -> list[str]:
        """List what is wrong with the row taken alone, one line each.

        Returns
        -------
        list of str

        Examples
        --------
        >>> Row("demo.kp", "Table 1", "gain", "1.31", "1.900000000", "misprint", page="demo").problems()
        ['demo.kp: misprint needs a note of at least 5 words']
        """
        tests = (*self._form(), *self._judged_by_reading(), *self._judged_by_computing())
        found = [f"{self.id}: {message}" for wrong, message in tests if wrong] + self._relation_problems()
        disagreement = self.disagreement() if self.computed and not found else None
        return [*found, disagreement] if disagreement else found

    def _form(self) -> tuple[tuple[bool, str], ...]:
        """What any row has to have."""
        return (
            (not _ID.fullmatch(self.id), "an id is lower case and dotted, such as haalman2024.ex1.pida.kp"),
            (not self.where.strip(), "'where' is empty"),
            (not self.quantity.strip(), "'quantity' is empty"),
            (not self.printed.strip(), "'printed' is empty"),
            (self.is_statement and digits.is_number(self.printed), "a printed number is no statement"),
            (
                self.verdict not in ("", *verdicts.VERDICTS),
                f"unknown verdict {self.verdict!r}; one of {', '.join(verdicts.VERDICTS)}",
            ),
            (
                self.basis not in verdicts.BASES,
                f"unknown basis {self.basis!r}; one of {', '.join(verdicts.BASES)}",
            ),
            (
                self.verdict in verdicts.DECLARED and len(self.note.split()) < WORDS,
                f"{self.verdict} needs a note of at least {WORDS} words",
            ),
            (
                self.verdict == "approximate" and not verdicts.sets_tolerance(self.note),
                "approximate needs a tolerance in its note, such as 'tolerance 1 %' or 'tolerance 0.02'",
            ),
        )

    def _judged_by_reading(self) -> tuple[tuple[bool, str], ...]:
        """What a row that hands over nothing must and must not have."""
        reading = self.basis == "reading"
        return (
            (self.verdict == "not-computable" and not reading, "not-computable, so its basis is reading"),
            (reading and bool(self.computed), "settled by reading, but 'computed' is not empty"),
            (reading and bool(self.evidence), "settled by reading, but 'evidence' is not empty"),
            (reading and bool(self.relation), "settled by reading, but 'relation' is not empty"),
            (reading and bool(self.page), "settled by reading, but 'page' is not empty"),
            (
                reading and len(self.note.split()) < WORDS,
                f"settled by reading needs a note of at least {WORDS} words",
            ),
            (
                reading and self.verdict not in (*verdicts.STATEMENT, *verdicts.DECLARED),
                f"settled by reading cannot be {self.verdict or 'left without a verdict'}",
            ),
        )

    def _judged_by_computing(self) -> tuple[tuple[bool, str], ...]:
        """What a row that is computed must and must not have."""
        computing = self.basis != "reading"
        statement = computing and self.is_statement
        return (
            (computing and not self.computed, "'computed' is empty"),
            (
                statement and bool(self.computed) and not self.evidence,
                "no evidence: a statement is a relation of two numbers",
            ),
            (statement and not self.relation, "no relation: it says what is compared, 'IAE of A < IAE of B'"),
            (bool(self.computed) and computing and not self.page, "'page' is empty"),
            (
                statement and bool(self.evidence) and self.computed not in ("", self._given()),
                f"computed says {self.computed}, the evidence {self.evidence} does not",
            ),
            (not self.is_statement and bool(self.evidence), "a number has no evidence"),
            (not self.is_statement and bool(self.relation), "a number has no relation"),
            (
                not self.is_statement and self.computed in verdicts.STATEMENT,
                "a number is not judged as a statement",
            ),
            (
                self._is_coarse() and not self._says_digits(),
                "fewer digits than ten, and no note says why: 'digits'",
            ),
            (self._hides_drift(), "stored no finer than printed, so that drift stays hidden"),
        )

    def _places(self) -> tuple[Decimal, Decimal] | None:
        """Printed and computed number, None where one is missing or cannot be read, which is said elsewhere."""
        readable = self.is_number and digits.is_number(self.printed) and digits.is_number(self.computed)
        return (Decimal(self.printed), Decimal(self.computed)) if readable else None

    def _is_coarse(self) -> bool:
        """Whether a stored number has fewer digits than `store` writes."""
        if self.is_statement:
            return bool(self.evidence) and self._is_coarse_evidence()
        places = self._places()
        return places is not None and digits.exponent(places[1]) > digits.last_place(places[1], self.printed)

    def _is_coarse_evidence(self) -> bool:
        try:
            identity = bool(self.relation) and Relation.parse(self.relation).is_identity
            return not identity and Evidence.parse(self.evidence).is_coarse
        except LedgerError:
            return False

    def _relation_problems(self) -> list[str]:
        """What is wrong with the relation, and with evidence that is not what it asks for."""
        if not (self.relation and self.is_statement):
            return []
        try:
            relation = Relation.parse(self.relation)
            kept = Evidence.parse(self.evidence) if self.evidence else None
        except LedgerError as error:
            return [f"{self.id}: {error}"]
        found = []
        if kept and not relation.allows(kept):
            found.append(f"{self.id}: evidence {kept} is not what the relation {self.relation} asks for")
        if relation.is_identity and float(relation.right) > IDENTITY and not self.note:
            found.append(f"{self.id}: a tolerance above {IDENTITY:g} needs a note that says why")
        return found

    def _hides_drift(self) -> bool:
        """Whether a stored number is not two places finer than the print, nor has ten digits."""
        places = self._places()
        return (
            places is not None
            and self._is_coarse()
            and digits.exponent(places[1]) > digits.exponent(places[0]) - 2
        )

    def _says_digits(self) -> bool:
        return "digits" in self.note

    def _given(self) -> str:
        """What the evidence gives; that it cannot be read is said by `disagreement`."""
        try:
            return Evidence.parse(self.evidence).verdict
        except LedgerError:
            return self.computed
