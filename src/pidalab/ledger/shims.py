"""Old calls, for pages that have not moved yet: deleted whole when the last one has.

To delete: this file, the base class of `Ledger`, one line in ``__init__`` and one in ``tests/test_public_names.py``.
"""

import importlib
import sys
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from pidalab.ledger.errors import LedgerError
from pidalab.ledger.files import find_folder, papers
from pidalab.ledger.relations import Number, Pair, Relation
from pidalab.ledger.rows import Row

PACKAGE = "pidalab_checks"  # the name under which book/checks is imported


class OldCalls:
    """`check`, `statement`, `identity` and `note`; a note handed over has no effect."""

    def check(self, claims: Any, value: Any = None, *, note: str | None = None, digits: int = 10) -> None:
        """Hand over numbers: `Ledger.compare` without its table."""
        self.compare({claims: value} if isinstance(claims, str) else claims, digits=digits)  # type: ignore[attr-defined]

    def statement(
        self,
        id: str,
        left: Number,
        relation: str,
        right: Number,
        *,
        note: str | None = None,
        left_name: str = "",
        right_name: str = "",
        convention: str | None = None,
        digits: int = 10,
    ) -> None:
        """Hand over a statement: `Ledger.decide`, whose row knows the relation."""
        row: Row = self.row(id)  # type: ignore[attr-defined]
        kept = Relation.parse(row.relation)
        convention = convention or getattr(relation, "convention", None) or ""
        if ("≈" if relation == "within" else str(relation), convention) != (kept.sign, kept.convention):
            raise LedgerError(
                f"{row.id}: its relation is {row.relation}, handed over as {relation} {convention}"
            )
        self.decide(id, getattr(relation, "cases", (left, right)), digits=digits)  # type: ignore[attr-defined]

    def identity(self, id: str, residual: float, tolerance: float = 1e-9, *, note: str | None = None) -> None:
        """Hand over a residual: `Ledger.decide`, whose row knows the tolerance."""
        self.decide(id, residual)  # type: ignore[attr-defined]

    def note(self, id: str, text: str) -> None:
        """Do nothing: a note is static."""
        self.row(id)  # type: ignore[attr-defined]


class _Chosen(str):
    """A sign that remembers the cases of which one was chosen."""

    cases: dict[str, Pair]
    convention: str | None


def _choose(
    cases: Mapping[str, Pair], sign: str, convention: str | None, some: bool
) -> tuple[Any, _Chosen, Any]:
    relation = Relation("", "≈" if sign == "within" else sign, "", convention or "", some)
    slack = {
        name: relation._slack(
            abs(pair[0]) if convention else float(pair[0]), abs(pair[1]) if convention else float(pair[1])
        )[0]
        for name, pair in cases.items()
        if sign not in ("==", "!=")
    }
    name = (max if some else min)(slack, key=slack.get) if slack else next(iter(cases))  # type: ignore[arg-type]
    chosen = _Chosen(sign)
    chosen.cases, chosen.convention = dict(cases), convention
    return cases[name][0], chosen, cases[name][1]


def every(
    cases: Mapping[str, Pair], relation: str, convention: str | None = None
) -> tuple[Any, _Chosen, Any]:
    """Return the worst of many cases, for `statement`."""
    return _choose(cases, relation, convention, False)


def some(cases: Mapping[str, Pair], relation: str, convention: str | None = None) -> tuple[Any, _Chosen, Any]:
    """Return the best of many cases, for `statement`."""
    return _choose(cases, relation, convention, True)


def checks(paper: str, folder: Path | str | None = None) -> ModuleType:
    """Import the checks of a paper, ``book/checks/<paper>.py`` or a package of that name."""
    ledgers = Path(folder) if folder is not None else find_folder()
    place = (ledgers.parent / "checks").resolve()
    if not has_checks(paper, ledgers):
        known = ", ".join(key for key in papers(ledgers) if has_checks(key, ledgers)) or "none"
        raise LedgerError(f"no checks of {paper} in {place}; there are: {known}")
    parent = sys.modules.get(PACKAGE)
    if parent is None or [*parent.__path__] != [
        str(place)
    ]:  # another book: forget the checks of the last one
        for name in [name for name in sys.modules if name.partition(".")[0] == PACKAGE]:
            del sys.modules[name]
        parent = ModuleType(PACKAGE)
        parent.__path__ = [str(place)]
        sys.modules[PACKAGE] = parent
        importlib.invalidate_caches()
    return importlib.import_module(f"{PACKAGE}.{paper}")


def has_checks(paper: str, folder: Path) -> bool:
    """Tell whether a paper has checks beside a folder of ledgers."""
    place = folder.parent / "checks"
    return (place / f"{paper}.py").is_file() or (place / paper / "__init__.py").is_file()
