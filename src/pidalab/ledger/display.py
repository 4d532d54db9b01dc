"""Tables and bars: the same content as HTML for a page and as text for a terminal.

The HTML carries classes and no styles except the widths of the bar; the colours of ``verdict-…`` are the site's.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape

from pidalab.ledger.rows import Row


@dataclass(frozen=True, repr=False)
class Display:
    """Something to show: a notebook takes the HTML, everything else the text.

    Parameters
    ----------
    html : str
        A fragment, the same for the same content.
    text : str
        The same for a terminal.

    Examples
    --------
    >>> Display("<b>one</b>", "one")
    one
    """

    html: str
    text: str

    def _repr_html_(self) -> str:
        return self.html

    def __repr__(self) -> str:
        return self.text


@dataclass(frozen=True)
class Cell:
    """An entry of a table, as text and as HTML.

    Parameters
    ----------
    text : str
        For a terminal.
    html : str
        For a page, escaped.
    kind : str, optional
        Class of the HTML cell.
    """

    text: str
    html: str
    kind: str = "text"


def words(text: str) -> Cell:
    """Make a cell of plain text."""
    return Cell(text, escape(text))


def number(text: str) -> Cell:
    """Make a cell of a number, to be aligned as one."""
    return Cell(text, escape(text), "number")


def chip(verdict: str) -> Cell:
    """Make a cell of a verdict, in its colour."""
    return Cell(verdict, f'<span class="verdict-{escape(verdict)}">{escape(verdict)}</span>')


def grid(
    kind: str, header: Sequence[str], rows: Iterable[Sequence[Cell]], notes: Iterable[str] | None = None
) -> Display:
    """Lay cells out as a table; the first cell of a row is its heading.

    Parameters
    ----------
    kind : str
        Class of the HTML table.
    header : sequence of str
        Headings of the columns.
    rows : iterable of sequences of Cell
        One cell for each column.
    notes : iterable of str, optional
        A remark for each row: under it on a page, in a last column in a terminal.

    Returns
    -------
    Display

    Examples
    --------
    >>> grid("demo", ["rule", "gain"], [[words("SIMC"), number("1.5")]])
    rule  gain
    SIMC  1.5
    """
    body = [list(row) for row in rows]
    remarks = [""] * len(body) if notes is None else list(notes)
    lines = [list(header), *([cell.text for cell in row] for row in body)]
    widths = [max(len(line[column]) for line in lines) for column in range(len(header))]
    text = [
        "  ".join([*(entry.ljust(width) for entry, width in zip(line, widths, strict=True)), remark]).rstrip()
        for line, remark in zip(lines, ["", *remarks], strict=True)
    ]
    html = [
        f'<table class="dataframe ledger-{kind}">',
        "<thead><tr>" + "".join(f'<th scope="col">{escape(name)}</th>' for name in header) + "</tr></thead>",
        "<tbody>",
    ]
    for row, remark in zip(body, remarks, strict=True):
        html.append("<tr>" + _heading(row[0]) + "".join(map(_entry, row[1:])) + "</tr>")
        if remark:
            html.append(f'<tr class="note"><td colspan="{len(header)}" class="text">{escape(remark)}</td></tr>')
    html += ["</tbody>", "</table>"]
    return Display("\n".join(html), "\n".join(text))


def _heading(cell: Cell) -> str:
    return f'<th scope="row" class="{cell.kind}">{cell.html}</th>'


def _entry(cell: Cell) -> str:
    return f'<td class="{cell.kind}">{cell.html}</td>'


def claim(row: Row, where: str) -> Cell:
    """Make a cell of what is claimed, and where; a terminal also shows the id."""
    text = row.printed if row.is_statement else row.quantity
    return Cell(f"{row.id}: {text} ({where})", f'{escape(text)} <span class="where">{escape(where)}</span>')


def claims(rows: Iterable[Row]) -> Display:
    """Show rows of a ledger, printed beside computed.

    Parameters
    ----------
    rows : iterable of Row
        In the order to show.

    Returns
    -------
    Display
        The computed number has two digits more than the print; the difference is in units of the last printed place.
    """
    rows = list(rows)
    if all(row.is_statement for row in rows):
        return grid("claims", ("claim", "verdict"), map(_statement, rows), [row.note for row in rows])
    header = ("claim", "printed", "computed", "difference", "verdict")
    return grid("claims", header, map(_claim, rows), [row.note for row in rows])


def _statement(row: Row) -> list[Cell]:
    return [claim(row, row.where), chip(row.verdict or "open")]


def _claim(row: Row) -> list[Cell]:
    difference = row.difference()
    return [
        claim(row, row.where),
        number("" if row.is_statement else row.printed),
        number(row.shown() if row.is_number else ""),
        number("" if difference is None else f"{difference:+z.1f}"),
        chip(row.verdict or "open"),
    ]


def score_line(name: str, score: Mapping[str, int]) -> str:
    """Say a score in one line.

    Parameters
    ----------
    name : str
        What was counted, the key of a paper.
    score : mapping of str to int
        Counts by verdict.

    Returns
    -------
    str

    Examples
    --------
    >>> score_line("demo", {"reproduced": 3, "last-digit": 1, "differs": 0})
    'demo: 4 claims, 3 reproduced, 1 last-digit'
    """
    total = sum(score.values())
    counts = [f"{count} {verdict}" for verdict, count in score.items() if count]
    return f"{name}: " + ", ".join([f"{total} claim{'' if total == 1 else 's'}", *counts])


def bar(name: str, score: Mapping[str, int]) -> str:
    """Draw a score as an HTML bar without legend; a screen reader reads `score_line`.

    Parameters
    ----------
    name : str
        What was counted.
    score : mapping of str to int
        Counts by verdict.

    Returns
    -------
    str
    """
    total = sum(score.values())
    parts = "".join(
        f'<span class="verdict-{escape(verdict)}" style="width:{100 * count / total:.2f}%"></span>'
        for verdict, count in score.items()
        if count
    )
    return f'<div class="scorebar" role="img" aria-label="{escape(score_line(name, score))}">{parts}</div>'


def scorebar(name: str, score: Mapping[str, int]) -> Display:
    """Show a score as a bar with a legend.

    Parameters
    ----------
    name : str
        What was counted.
    score : mapping of str to int
        Counts by verdict.

    Returns
    -------
    Display
    """
    legend = "".join(
        f'<li class="verdict-{escape(verdict)}">{escape(verdict)} {count}</li>'
        for verdict, count in score.items()
        if count
    )
    return Display(f'{bar(name, score)}\n<ul class="scorelegend">{legend}</ul>', score_line(name, score))
