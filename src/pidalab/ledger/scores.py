"""Counting rows: by verdict where the paper's problem decides, and apart what stands on print or on reading."""

from collections import Counter
from collections.abc import Iterable, Mapping
from html import escape

from pidalab.ledger.display import Display
from pidalab.ledger.rows import Row
from pidalab.ledger.verdicts import CONFIRMING, VERDICTS

KINDS = {
    **{verdict: verdict for verdict in VERDICTS if verdict != "not-computable"},
    "print-agrees": "agree with other print",
    "print-disagrees": "disagree with other print",
    "reading": "settled by reading",
    "not-computable": "not computable",
}


def kind(row: Row) -> str:
    """Tell under what a row is counted.

    Parameters
    ----------
    row : Row
        Of a ledger.

    Returns
    -------
    str
        A key of `KINDS`: a verdict if the row is computed from the paper's problem, else what its basis is; ``open``
        while nobody has judged.

    Examples
    --------
    >>> kind(Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced", "from-print"))
    'print-agrees'
    """
    if not row.verdict:
        return "open"
    if row.basis == "from-print":
        return "print-agrees" if row.verdict in CONFIRMING else "print-disagrees"
    return "reading" if row.basis == "reading" and row.verdict != "not-computable" else row.verdict


def score(rows: Iterable[Row]) -> dict[str, int]:
    """Count rows by `kind`.

    Parameters
    ----------
    rows : iterable of Row
        Of one ledger or of several.

    Returns
    -------
    dict of str to int
        Every key of `KINDS` in its order; ``open`` last, if some rows have no verdict yet.

    Examples
    --------
    >>> {name: count for name, count in score([Row("demo.kp", "Table 1", "gain", "1.31")]).items() if count}
    {'open': 1}
    """
    return {**dict.fromkeys(KINDS, 0), **Counter(kind(row) for row in rows)}


def score_line(name: str, counts: Mapping[str, int]) -> str:
    """Say a score in one line.

    Parameters
    ----------
    name : str
        What was counted, the key of a paper.
    counts : mapping of str to int
        Counts by `kind`.

    Returns
    -------
    str

    Examples
    --------
    >>> score_line("demo", {"reproduced": 3, "print-agrees": 1, "differs": 0})
    'demo: 4 claims, 3 reproduced, 1 agree with other print'
    """
    total = sum(counts.values())
    parts = [f"{count} {KINDS.get(kind, kind)}" for kind, count in counts.items() if count]
    return f"{name}: " + ", ".join([f"{total} claim{'' if total == 1 else 's'}", *parts])


def bar(name: str, counts: Mapping[str, int]) -> str:
    """Draw a score as an HTML bar without legend; a screen reader reads `score_line`.

    Parameters
    ----------
    name : str
        What was counted.
    counts : mapping of str to int
        Counts by `kind`.

    Returns
    -------
    str
    """
    total = sum(counts.values())
    parts = "".join(
        f'<span class="verdict-{escape(kind)}" style="width:{100 * count / total:.2f}%"></span>'
        for kind, count in counts.items()
        if count
    )
    return f'<div class="scorebar" role="img" aria-label="{escape(score_line(name, counts))}">{parts}</div>'


def scorebar(name: str, counts: Mapping[str, int]) -> Display:
    """Show a score as a bar with a legend.

    Parameters
    ----------
    name : str
        What was counted.
    counts : mapping of str to int
        Counts by `kind`.

    Returns
    -------
    Display
    """
    legend = "".join(
        f'<li class="verdict-{escape(kind)}">{escape(KINDS.get(kind, kind))} {count}</li>'
        for kind, count in counts.items()
        if count
    )
    return Display(f'{bar(name, counts)}\n<ul class="scorelegend">{legend}</ul>', score_line(name, counts))
