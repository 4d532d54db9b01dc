"""Write the ledgers as a bundle for an archive or another checker.

The bundle has the ledgers themselves and ``repro.yaml``: each reproduced number, its print, and where it is kept.
"""

import json
import shutil
from collections.abc import Iterable, Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

from paperledger.book import Ledger
from paperledger.pages import load_all
from paperledger.rows import MANIFEST, REMOVED, Row, write_text


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
