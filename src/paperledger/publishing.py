"""The account as data that others read: JSON-LD for search engines, and a bundle for an archive or another checker.

The bundle has the ledgers themselves and ``repro.yaml``: each reproduced number, its print, and where it is kept.
"""

import json
import shutil
from collections.abc import Iterable, Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

from paperledger.book import Ledger
from paperledger.display import anchor
from paperledger.pages import load_all
from paperledger.rows import MANIFEST, REMOVED, Row, write_text

CONTEXT = "https://schema.org"


def review(row: Row, board: str, paper: Mapping[str, Any]) -> dict[str, Any]:
    """Return a row as a review of a claim, in the words of schema.org.

    Parameters
    ----------
    row : Row
        A claim with its verdict.
    board : str
        Address of the page on which every row has its place.
    paper : mapping
        The paper that makes the claim, in the same words, as `scholarly` gives it.

    Returns
    -------
    dict

    Examples
    --------
    >>> row = Row("demo.kp", "Table 1", "gain", "1.31", "1.309812345", "reproduced", page="demo")
    >>> found = review(row, "https://example.org/scoreboard.html", {"@type": "ScholarlyArticle", "name": "On PIDA"})
    >>> found["url"], found["claimReviewed"], found["reviewRating"]["alternateName"]
    ('https://example.org/scoreboard.html#demo-kp', 'Table 1: gain = 1.31', 'reproduced')
    """
    address = f"{board}#{anchor(row)}"
    claim = row.printed if row.is_statement else f"{row.quantity} = {row.printed}"
    found = {
        "@type": "ClaimReview",
        "@id": address,
        "url": address,
        "identifier": row.id,
        "claimReviewed": f"{row.where}: {claim}",
        "itemReviewed": {"@type": "Claim", "appearance": {"@id": paper["@id"]} if "@id" in paper else paper},
        "reviewRating": {"@type": "Rating", "alternateName": row.verdict, "ratingExplanation": row.basis},
    }
    if row.found:
        found["reviewBody"] = row.found
    return found


def scholarly(entry: Mapping[str, str]) -> dict[str, Any]:
    """Return a paper in the words of schema.org, from the fields of its bibliography entry.

    Parameters
    ----------
    entry : mapping
        With ``title``, and perhaps ``doi``, ``year`` and ``author``, names joined by *and*.

    Returns
    -------
    dict

    Examples
    --------
    >>> scholarly({"title": "On PIDA", "doi": "10.1/x", "year": "2030", "author": "A and B"})["@id"]
    'https://doi.org/10.1/x'
    """
    found: dict[str, Any] = {"@type": "ScholarlyArticle", "name": entry["title"]}
    if "doi" in entry:
        found = {"@id": f"https://doi.org/{entry['doi']}", **found}
    if "year" in entry:
        found["datePublished"] = entry["year"]
    if "author" in entry:
        found["author"] = [{"@type": "Person", "name": name} for name in entry["author"].split(" and ")]
    return found


def linked(rows: Iterable[Row], board: str, page: str, paper: Mapping[str, Any]) -> str:
    """Return the JSON-LD of a page: the paper it is about, and a review of each claim that it hands over.

    Parameters
    ----------
    rows : iterable of Row
        Of the page.
    board, page : str
        Addresses of the page with all rows, and of this one.
    paper : mapping
        As `scholarly` gives it.

    Returns
    -------
    str
        Safe within a ``script`` element.
    """
    about = {"@type": "LearningResource", "@id": page, "url": page, "about": paper}
    text = json.dumps(
        {"@context": CONTEXT, "@graph": [about, *(review(row, board, paper) for row in rows)]},
        ensure_ascii=False,
        separators=(",", ":"),
    )
    return text.replace("<", "\\u003c")


# ------------------------------------------------------------------------------------------------ the bundle


def checkable(rows: Iterable[Row]) -> list[Row]:
    """Return the numbers that round to their print: what another program can check without our words."""
    return [row for row in rows if row.is_number and row.verdict == "reproduced"]


def repro(books: Mapping[str, Ledger], rows: Sequence[Row] | None = None) -> dict[str, Any]:
    """Return the content of ``repro.yaml``: which number is printed, and in which cell of which ledger it is kept.

    Parameters
    ----------
    books : mapping of str to Ledger
        As `load_all` gives them; their files lie in the folder ``ledger`` beside ``repro.yaml``.
    rows : sequence of Row, optional
        Which numbers; by default those that round to their print.

    Returns
    -------
    dict
    """
    chosen = (
        rows if rows is not None else checkable(row for book in books.values() for row in book.rows.values())
    )
    return {
        "artifacts": [
            {
                "id": paper,
                "path": f"ledger/{paper}.csv",
                "digest": {"algorithm": "sha256", "value": sha256(book.path.read_bytes()).hexdigest()},
            }
            for paper, book in books.items()
        ],
        "claims": [
            {
                "id": row.id.replace(".", "-"),
                "text": f"{row.where}: {row.quantity}",
                "evidence": [
                    {
                        "kind": "table",
                        "artifact": row.id.partition(".")[0],
                        "name": row.id,
                        "reported": row.printed,
                        "column": "computed",
                        "where": {"id": row.id},
                    }
                ],
            }
            for row in chosen
        ],
    }


def publish(ledgers: Path, out: Path) -> list[Path]:
    """Write the ledgers and ``repro.yaml`` into an empty or new folder.

    Parameters
    ----------
    ledgers : pathlib.Path
        Folder of the csv files.
    out : pathlib.Path
        Where to.

    Returns
    -------
    list of pathlib.Path
        The files, all below `out`.
    """
    books, inner = load_all(ledgers), out / "ledger"
    inner.mkdir(parents=True, exist_ok=True)
    names = [f"{paper}.csv" for paper in books] + [
        name for name in (MANIFEST, REMOVED) if (ledgers / name).is_file()
    ]
    files = [Path(shutil.copy(ledgers / name, inner / name)) for name in names]
    claims = out / "repro.yaml"  # JSON is YAML, too
    write_text(claims, f"---\n{json.dumps(repro(books), indent=1, ensure_ascii=False)}\n")
    return sorted([*files, claims])
