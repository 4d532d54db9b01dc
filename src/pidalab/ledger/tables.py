"""The table of claims: verdict first, then what is claimed, printed beside computed, or the evidence of a statement."""

from collections.abc import Iterable
from html import escape

from pidalab.ledger.display import Cell, Display, chip, grid, markup, number
from pidalab.ledger.relations import Evidence, Relation
from pidalab.ledger.rows import Row

BASIS = {"computed": "", "from-print": "from print", "reading": "by reading"}


def verdict(row: Row) -> Cell:
    """Make a cell of a verdict, and of its basis where that is not the paper's problem.

    Parameters
    ----------
    row : Row
        Of a ledger.

    Returns
    -------
    Cell
    """
    word, basis = row.verdict or "open", BASIS.get(row.basis, row.basis)
    below = f' <span class="basis">{escape(basis)}</span>' if basis else ""
    return Cell(f"{word} ({basis})" if basis else word, chip(word) + below, "verdict text")


def claim(row: Row, where: str, unfold: bool = True) -> Cell:
    """Make a cell of what is claimed, and where; it unfolds to the note. A terminal also shows the id.

    Parameters
    ----------
    row : Row
        Of a ledger.
    where : str
        Where it is printed, as the page wants it said.
    unfold : bool, optional
        Whether the note is inside.

    Returns
    -------
    Cell
    """
    text = row.printed if row.is_statement else row.quantity
    html = f'{markup(text)} <span class="where">{markup(where)}</span>'
    if row.note and unfold:
        html = f"<details><summary>{html}</summary><p>{markup(row.note)}</p></details>"
    return Cell(f"{row.id}: {text} ({where})", html, "claim text")


def evidence(row: Row, span: int = 1) -> Cell:
    """Make a cell of what decides a statement.

    Parameters
    ----------
    row : Row
        Of a ledger.
    span : int, optional
        How many columns it takes.

    Returns
    -------
    Cell
    """
    if not row.evidence:
        return Cell("", "—", "evidence text", span)
    kept = Evidence.parse(row.evidence)
    relation = Relation.parse(row.relation) if row.relation else None
    identity = relation is not None and relation.is_identity
    first = f"largest residual {kept.shown()}" if identity else kept.shown()
    rest = [part for part in (relation.words if relation and not identity else "", kept.remark) if part]
    shown = "; ".join([first, *rest])
    below = f' <span class="where">{markup("; ".join(rest))}</span>' if rest else ""
    return Cell(shown, f"{markup(first)}{below}", "evidence text", span)


def claims(rows: Iterable[Row]) -> Display:
    """Show rows of a ledger.

    Parameters
    ----------
    rows : iterable of Row
        In the order to show.

    Returns
    -------
    Display
        The computed number has two digits more than the print; the difference is in units of the last printed place.
    """
    rows = [*rows]
    statements = all(row.is_statement for row in rows)
    header = ["verdict", "claim", *(["evidence"] if statements else ["printed", "computed", "difference"])]
    decided = [[evidence(row)] if statements else _numbers(row) for row in rows]
    cells = [[verdict(row), claim(row, row.where), *last] for row, last in zip(rows, decided, strict=True)]
    return grid("claims", header, cells, heading=1, remarks=[row.note for row in rows])


def _numbers(row: Row) -> list[Cell]:
    if row.is_statement:
        return [evidence(row, span=3)]
    difference = row.difference()
    return [
        number(row.printed),
        number(row.shown() if row.is_number else "—"),
        number("—" if difference is None else f"{difference:+z.1f}"),
    ]
