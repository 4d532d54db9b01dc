"""Show the rows of a ledger as tables of claims and scores, in HTML for a page and in text for a terminal.

The HTML has CSS classes but no inline styles, except for the widths of the parts of a score bar. The style sheet of the
site colours the classes ``verdict-…``.
"""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape

from paperledger.rows import Row
from paperledger.verdicts import VERDICTS, Evidence, Relation

# Headings of a score, and below each heading the kinds of rows with their labels. A row of the basis *computed* is
# counted by its verdict. For the bases *fitted* and *from-print*, the kinds only tell agreement from disagreement. The
# basis *reading* has two kinds: claims that are settled by reading the paper, and claims that cannot be computed.
GROUPS = {
    "computed from the paper's problem": {v: v for v in (*VERDICTS, "open") if v != "not-computable"},
    "with settings fitted to printed values": {
        "fitted-agrees": "agree, settings fitted",
        "fitted-disagrees": "disagree, settings fitted",
    },
    "from other printed results": {
        "print-agrees": "agree with another printed value",
        "print-disagrees": "disagree with another printed value",
    },
    "by reading": {"reading": "settled by reading", "not-computable": "not computable"},
}
KINDS = {kind: words for kinds in GROUPS.values() for kind, words in kinds.items()}
BASIS = {"fitted": "settings fitted", "from-print": "from printed values", "reading": "by reading"}
# _MATHS matches a letter, several capitals or a closing bracket, each with an optional index and an optional exponent,
# as in K_-1, PID_2^2, A_(2m+3) and (1 + T s)^n.
_PART = r"(\{[^{}]*\}|\([^()]*\)|[-−]?[^\W_]+)"
_MATHS = re.compile(
    rf"((?<![A-Za-z])[a-z][\u0300-\u036f]?|[A-Z][\u0300-\u036f]|[A-Z]+|[Α-Ωα-ω]|[)\]])(?:_{_PART})?(?:\^{_PART})?"
)
_LETTER = re.compile(r"[^\W\d_][\u0300-\u036f]?")  # one letter, optionally with a bar or hat


@dataclass(frozen=True)
class Display:
    """Output in two forms: HTML for a notebook, and text for everything else.

    Parameters
    ----------
    html : str
        A fragment of HTML.
    text : str
        Text for a terminal.

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
    """Entry of a table, as text and as HTML. `kind` is its CSS class, and `span` is its number of columns."""

    text: str
    html: str
    kind: str = "text"
    span: int = 1


def markup(text: str) -> str:
    """Escape plain text for HTML, and typeset each symbol that has an index or exponent.

    >>> markup("K_-1 of PID_2^2 < 3")
    '<i>K</i><sub>−1</sub> of PID<sub>2</sub><sup>2</sup> &lt; 3'
    """
    return _MATHS.sub(_typeset, escape(text, quote=False))


def _typeset(match: re.Match[str]) -> str:
    base, index, power = match.groups()
    if index is None and power is None:
        return match.group()
    parts = [
        f"<{tag}>{part.strip('{}()').replace('-', '−')}</{tag}>"
        for tag, part in (("sub", index), ("sup", power))
        if part
    ]
    return (f"<i>{base}</i>" if _LETTER.fullmatch(base) else base) + "".join(parts)


def words(text: str) -> Cell:
    """Make a cell of plain text."""
    return Cell(text, markup(text))


def number(text: str) -> Cell:
    """Make a cell from the text of a number."""
    return Cell(text, escape(text).replace("-", "−"), "number")


def grid(
    kind: str,
    header: Sequence[str],
    rows: Sequence[Sequence[Cell]],
    heading: int = 0,
    notes: Sequence[str] = (),
) -> Display:
    """Make a table of the CSS class ``ledger-<kind>`` from rows of cells.

    The column with the index `heading` contains the headings of the rows. The text shows a note to the right of each
    row. The HTML does not show `notes`.

    >>> grid("demo", ["rule", "gain"], [[words("SIMC"), number("1.5")]])
    rule  gain
    SIMC  1.5
    """
    lines = [[*header, ""]]
    body = []
    for row, note in zip(rows, notes or [""] * len(rows), strict=True):
        lines.append([text for cell in row for text in (cell.text, *[""] * (cell.span - 1))] + [note])
        # Cells to the right of a cell with several columns are paired with wrong column names. This does no harm: only
        # number cells use the names, and no number cell is to the right of a cell with several columns.
        columns = zip(row, header, strict=False)
        cells = "".join(_entry(cell, name, k == heading) for k, (cell, name) in enumerate(columns))
        body.append(f"<tr>{cells}</tr>")
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    text = ["  ".join(part.ljust(n) for part, n in zip(line, widths, strict=True)).rstrip() for line in lines]
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in header)
    table = f'<table class="dataframe ledger-{kind}">', f"<thead><tr>{head}</tr></thead>", "<tbody>"
    return Display("\n".join([*table, *body, "</tbody>", "</table>"]), "\n".join(text))


def _entry(cell: Cell, column: str, heading: bool) -> str:
    """Return a cell as HTML. The HTML of a number includes the name of its column, since phones hide the table head."""
    tag, scope = ("th", ' scope="row"') if heading else ("td", "")
    span = f' colspan="{cell.span}"' if cell.span > 1 else ""
    label = f' data-label="{escape(column)}"' if cell.kind == "number" else ""
    return f'<{tag}{scope} class="{cell.kind}"{span}{label}>{cell.html}</{tag}>'


def verdict(row: Row) -> Cell:
    """Make a cell with the verdict of a row. The cell also shows the basis, unless the basis is ``computed``."""
    word, basis = row.verdict or "open", BASIS.get(row.basis, "")
    html = f'<span class="verdict-{escape(word)}">{escape(word)}</span>'
    if not basis:
        return Cell(word, html, "verdict text")
    return Cell(f"{word} ({basis})", f'{html} <span class="basis">{escape(basis)}</span>', "verdict text")


def claim(row: Row, unfold: bool = True, anchored: bool = False) -> Cell:
    """Make a cell with the claim of a row and its place in the paper. The text begins with the id of the row.

    If `unfold` is true, a click on the HTML cell shows the note and the column ``made``. If `anchored` is true, the
    HTML cell also shows the id as a link to the row, and a click shows how to cite the row.
    """
    text = row.printed if row.is_statement else row.quantity
    anchor = row.id.replace(".", "-")  # in a CSS selector, a dot would begin a class
    html = f'{markup(text)} <span class="where">{markup(row.where)}</span>'
    if unfold and (row.note or row.made or anchored):
        made = re.sub(r"\bfit: (.*?) from (.*? numbers?)", r"To \2 we fitted \1", row.made)
        made = made.replace("count: ", "whole or rounded number: ").replace("page: ", "formula of the page: ")
        said = "".join(f"<p>{markup(line)}</p>" for line in (row.note, *made.split(" | ")) if line)
        if anchored:  # readers can copy the id to cite the row
            cite = f"To cite: row {escape(row.id)} of the ledger of pidalab"
            said += f'<p class="row-cite">{cite}, <a href="#{anchor}">with this address</a></p>'
        html = f"<details><summary>{html}</summary>{said}</details>"
    if anchored:
        html += f' <a class="row-id" id="{anchor}" href="#{anchor}">{escape(row.id)}</a>'
    return Cell(f"{row.id}: {text} ({row.where})", html, "claim text")


def evidence(row: Row, span: int = 1) -> Cell:
    """Make a cell with the evidence of a statement."""
    if not row.evidence:
        return Cell("", "—", "evidence text", span)
    kept, relation = Evidence.parse(row.evidence), Relation.parse(row.relation)
    first = f"largest residual {kept.shown()}" if relation.is_identity else kept.shown()
    remarks = [inequality.remark for inequality in kept.inequalities]
    rest = [*filter(None, ("" if relation.is_identity else relation.words, *remarks))]
    below = f' <span class="where">{markup("; ".join(rest))}</span>' if rest else ""
    return Cell("; ".join([first, *rest]), f"{markup(first)}{below}", "evidence text", span)


def claims(rows: Sequence[Row], anchors: bool = False, why: bool = False) -> Display:
    """Show rows as a table, with the differences of numbers and the evidence of statements.

    A difference is computed minus printed, in units of the last printed place. If `why` is true, a column of notes
    replaces the verdicts. Otherwise a click on a claim shows its note. If `anchors` is true, each row has a link to
    cite it.
    """
    statements = all(row.is_statement for row in rows)
    last = ["evidence"] if statements else ["printed", "computed", "difference"]
    cells = []
    for row in rows:
        result = [evidence(row, len(last))] if row.is_statement else _numbers(row)
        named = claim(row, unfold=not why, anchored=anchors)
        cells.append([named, *result, words(row.note)] if why else [verdict(row), named, *result])
    if why:
        return grid("claims", ["claim", *last, "why"], cells)
    return grid("claims", ["verdict", "claim", *last], cells, 1, [row.note for row in rows])


def _numbers(row: Row) -> list[Cell]:
    off = row.difference()
    return [number(row.printed), number(row.shown() or "—"), number("—" if off is None else f"{off:+z.1f}")]


def score(rows: Iterable[Row]) -> dict[str, int]:
    """Count the rows of each kind in `KINDS`. An undecided row counts as ``open``, unless its basis is ``reading``."""
    return {**dict.fromkeys(KINDS, 0), **Counter(map(_kind, rows))}


def _kind(row: Row) -> str:
    apart = {"fitted": "fitted", "from-print": "print"}.get(row.basis)
    if row.verdict and apart:
        agrees = row.verdict in ("reproduced", "last-digit", "approximate", "holds")
        return f"{apart}-{'agrees' if agrees else 'disagrees'}"
    reading = row.basis == "reading" and row.verdict != "not-computable"
    return "reading" if reading else row.verdict or "open"


def score_line(name: str, counts: Mapping[str, int]) -> str:
    """Return a score as one line.

    >>> score_line("demo", {"reproduced": 3, "print-agrees": 1, "differs": 0})
    'demo: 4 claims, 3 reproduced, 1 agree with another printed value'
    """
    total = sum(counts.values())
    parts = [f"{count} {KINDS.get(kind, kind)}" for kind, count in counts.items() if count]
    return f"{name}: " + ", ".join([f"{total} claim{'' if total == 1 else 's'}", *parts])


def scorebar(name: str, counts: Mapping[str, int], legend: bool = False) -> Display:
    """Show a score as a bar, optionally with a legend. Screen readers read the text of `score_line`."""
    line, shown = score_line(name, counts), {kind: count for kind, count in counts.items() if count}
    parts = "".join(
        f'<span class="verdict-{kind}" style="width:{100 * count / sum(counts.values()):.2f}%"></span>'
        for kind, count in shown.items()
    )
    bar = f'<div class="scorebar" role="img" aria-label="{escape(line)}">{parts}</div>'
    items = "".join(
        f'<li class="verdict-{kind}">{KINDS.get(kind, kind)} {count}</li>' for kind, count in shown.items()
    )
    return Display(f'{bar}\n<ul class="scorelegend">{items}</ul>' if legend else bar, line)


# OUTCOMES has other words for verdicts that would mislead in a summary. PLURALS has the plural of the first word of
# an outcome.
OUTCOMES = {"last-digit": "a unit off", "approximate": "within tolerance", "as-read": "differs in our copy"}
PLURALS = {"misprint": "misprints", "differs": "differ", "holds": "hold", "fails": "fail"}


def _words(verdict: str, count: int) -> str:
    first, *rest = OUTCOMES.get(verdict, verdict.replace("-", " ")).split()
    return " ".join([PLURALS.get(first, first) if count > 1 else first, *rest])


def outcome(rows: Sequence[Row]) -> str:
    """Summarise the verdicts of rows in a few words.

    >>> rows = [Row("demo.a", "Table 1", "gain", "1.3", verdict=verdict) for verdict in ("reproduced", "misprint")]
    >>> outcome(rows), outcome(rows[:1]), outcome(rows[:1] * 3)
    ('1 of 2 agrees, 1 misprint', 'reproduced', 'all 3 agree')
    """
    counts = Counter(row.verdict or "open" for row in rows)
    fitted = " (settings fitted)" if any(row.basis == "fitted" for row in rows) else ""
    if len(rows) == 1:
        return _words(next(iter(counts)), 1) + fitted
    good = counts.pop("reproduced", 0) + counts.pop("holds", 0)
    if good == len(rows):
        return f"all {good} agree{fitted}"
    parts = [f"{good} of {len(rows)} agree{'s' * (good == 1)}"] if good else []
    parts += [f"{count} {_words(verdict, count)}" for verdict, count in counts.items()]
    return ", ".join(parts) + fitted


def index(rows: Iterable[Row], page: str, headings: Mapping[str, Sequence[str]]) -> Display:
    """Show each table, figure or other item of a paper, with its heading in the book and the outcome of its rows.

    `page` is the page that shows this index. `headings` has the headings of each page of the paper.
    """
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in sorted(rows, key=lambda row: row.is_statement):
        key = ("statements", row.page) if row.is_statement else (row.where, "")
        groups.setdefault(key, []).append(row)
    cells = []
    for (item, place), some in groups.items():
        place = place or next((row.page for row in some if row.page), "")
        name = "the chapter" if "/" not in place else "its evidence"
        heading = next((text for text in headings.get(place or page, ()) if _names(text, item)), "")
        where = Cell("by reading", "by reading")
        target = f"{'../' * page.count('/')}{place}.html" if place not in ("", page) else ""
        if heading:
            where = Cell(heading, f'<a href="{target}#{slug(heading)}">{markup(heading)}</a>')
        elif place:
            where = Cell(name, f'<a href="{target}">{name}</a>' if target else name)
        cells.append([words(item), where, words(outcome(some))])
    return grid("index", ("printed item", "where", "outcome"), cells)


def _names(heading: str, item: str) -> bool:
    """Return True if a heading names the table, figure, equation or section of a printed item."""
    last = item.rpartition(", ")[2]
    kind, _, number = last.partition(" ")
    if kind in ("eq.", "eqs"):
        return number in heading
    if kind == "sec.":
        number = number.partition(".")[0]
    name = {"sec.": "Section", "Fig.": "Fig."}.get(kind, kind)
    return re.search(rf"\b{re.escape(name)} {re.escape(number)}(?![\w.])", heading) is not None


def slug(heading: str) -> str:
    """Return the anchor that Sphinx gives to a heading.

    >>> slug("Table 4 and Paper Fig. 8")
    'table-4-and-paper-fig-8'
    """
    return re.sub(r"^[-0-9]+|-+$", "", re.sub(r"[^a-z0-9]+", "-", heading.lower()))
