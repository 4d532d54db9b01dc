"""What a reader sees: the same content as HTML for a page and as text for a terminal.

The HTML carries classes and no styles except the widths of a bar; the colours of ``verdict-…`` are the site's.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

# K_-1, PID_2^2, A_(2m+3), (1 + T s)^n: a letter, capitals or a bracket with an index, an exponent, or both
_PART = r"(\{[^{}]*\}|\([^()]*\)|[-−]?[^\W_]+)"
_MATHS = re.compile(
    rf"((?<![A-Za-z])[a-z][\u0300-\u036f]?|[A-Z][\u0300-\u036f]|[A-Z]+|[Α-Ωα-ω]|[)\]])(?:_{_PART})?(?:\^{_PART})?"
)
_LETTER = re.compile(r"[^\W\d_][\u0300-\u036f]?")  # one letter, perhaps with a bar or hat


@dataclass(frozen=True)
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
    span : int, optional
        How many columns it takes.
    """

    text: str
    html: str
    kind: str = "text"
    span: int = 1


def markup(text: str) -> str:
    """Escape plain text and typeset its names: an index is lowered, an exponent raised, a single letter slanted.

    Parameters
    ----------
    text : str
        Plain text such as ``K_-1`` or ``PID_2^2``.

    Returns
    -------
    str
        HTML.

    Examples
    --------
    >>> markup("K_-1 of PID_2^2 < 3")
    '<i>K</i><sub>−1</sub> of PID<sub>2</sub><sup>2</sup> &lt; 3'
    """
    return _MATHS.sub(_typeset, escape(text, quote=False))


def _typeset(found: re.Match[str]) -> str:
    base, index, power = found.groups()
    if index is None and power is None:
        return found.group()
    slanted = f"<i>{base}</i>" if _LETTER.fullmatch(base) else base
    return slanted + _part("sub", index) + _part("sup", power)


def _part(tag: str, part: str | None) -> str:
    return f"<{tag}>{part.strip('{}()').replace('-', '−')}</{tag}>" if part else ""


def words(text: str) -> Cell:
    """Make a cell of plain text."""
    return Cell(text, markup(text))


def number(text: str) -> Cell:
    """Make a cell of a number, to be aligned as one."""
    return Cell(text, escape(text).replace("-", "−"), "number")


def chip(verdict: str, label: str = "") -> str:
    """Return a verdict in its colour, as HTML."""
    return f'<span class="verdict-{escape(verdict)}">{escape(label or verdict)}</span>'


def grid(
    kind: str,
    header: Sequence[str],
    rows: Iterable[Sequence[Cell]],
    *,
    heading: int = 0,
    remarks: Iterable[str] = (),
) -> Display:
    """Lay cells out as a table.

    Parameters
    ----------
    kind : str
        Class of the HTML table.
    header : sequence of str
        Headings of the columns.
    rows : iterable of sequences of Cell
        The cells of a row span as many columns as there are headings.
    heading : int, optional
        Which cell of a row is its heading.
    remarks : iterable of str, optional
        What a terminal shows after each row.

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
    lines = [[*header], *([part.text for cell in row for part in (cell, *_fill(cell))] for row in body)]
    widths = [max(len(line[column]) for line in lines) for column in range(len(header))]
    beside = ["", *(remarks or [""] * len(body))]
    text = [
        "  ".join([*(entry.ljust(width) for entry, width in zip(line, widths, strict=True)), remark]).rstrip()
        for line, remark in zip(lines, beside, strict=True)
    ]
    html = [
        f'<table class="dataframe ledger-{kind}">',
        "<thead><tr>" + "".join(f'<th scope="col">{escape(name)}</th>' for name in header) + "</tr></thead>",
        "<tbody>",
        *("<tr>" + _entries(row, header, heading) + "</tr>" for row in body),
        "</tbody>",
        "</table>",
    ]
    return Display("\n".join(html), "\n".join(text))


def _fill(cell: Cell) -> list[Cell]:
    """Empty cells after one that takes several columns, for a terminal."""
    return [Cell("", "")] * (cell.span - 1)


def _entries(row: Sequence[Cell], header: Sequence[str], heading: int) -> str:
    """Cells as HTML; on a phone, where a row becomes a block, a number is labelled by the heading of its column."""
    html, column = "", 0
    for place, cell in enumerate(row):
        span = f' colspan="{cell.span}"' if cell.span > 1 else ""
        label = f' data-label="{escape(header[column])}"' if cell.kind == "number" else ""
        tag, scope = ("th", ' scope="row"') if place == heading else ("td", "")
        html += f'<{tag}{scope} class="{cell.kind}"{span}{label}>{cell.html}</{tag}>'
        column += cell.span
    return html
