"""Write a bill of materials and a notice of the third-party files in the built site.

`vendored.toml` says which files belong to which project, and under which licence. A file of the site that nobody claims
is an error, and so is a project without files.
"""

import hashlib
import json
import re
import sys
import tomllib
from dataclasses import dataclass
from fnmatch import fnmatchcase
from importlib.metadata import version
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
TABLE = ROOT / "tools" / "vendored.toml"
# named as SPDX does, without the line of the copyright, which each project has
TEXTS = ROOT / "tools" / "licences"
# asks for a link, not for its text
LINKED = {"CC-BY-4.0": "https://creativecommons.org/licenses/by/4.0/legalcode"}
SITE = ROOT / "_build" / "html"
OWN = ("_static/sections.js",)  # written by the book's extensions
BILL, NOTICE = "sbom.cdx.json", "third-party.txt"
RULE = f"\n\n{'-' * 72}\n\n"
HEAD = "Files of others in this site, with their licences; the texts follow. sbom.cdx.json has all files with hashes."


@dataclass(frozen=True)
class Component:
    """A project whose files the site carries."""

    name: str
    version: str
    url: str
    purl: str
    licence: str  # an SPDX expression
    copyright: str
    files: tuple[str, ...]  # below the site


def table() -> list[dict[str, Any]]:
    """Read the projects."""
    return tomllib.loads(TABLE.read_text(encoding="utf-8"))["component"]


def carried(site: Path) -> list[str]:
    """List the files of others: what is in _static and not in book/_static."""
    own = {path.relative_to(ROOT / "book").as_posix() for path in (ROOT / "book" / "_static").rglob("*")}
    own = {name for name in own if not name.startswith("_static/vendor/")} | {
        *OWN,
        "_static/vendor/README.md",
    }
    found = (path.relative_to(site).as_posix() for path in (site / "_static").rglob("*") if path.is_file())
    return sorted(name for name in found if name not in own)


def components(rows: list[dict[str, Any]], site: Path) -> list[Component]:
    """Give every file to its project.

    Raises
    ------
    ValueError
        If a file has no project or several, a project no file, or a version is not found.
    """
    owners = {name: [row["name"] for row in rows if claims(row, name)] for name in carried(site)}
    wrong = [
        f"{name} belongs to {' and '.join(has) or 'nobody'}" for name, has in owners.items() if len(has) != 1
    ]
    wrong += [f"{row['name']} has no files" for row in rows if [row["name"]] not in owners.values()]
    if wrong:
        raise ValueError("\n".join([f"{TABLE.name} and the site disagree:", *wrong]))
    kept = ("name", "url", "purl", "licence", "copyright")
    return [
        Component(
            **{key: row[key] for key in kept},
            version=release(row, site),
            files=tuple(name for name, has in owners.items() if has == [row["name"]]),
        )
        for row in rows
    ]


def claims(row: dict[str, Any], name: str) -> bool:
    """Return True if a file belongs to a project; a star stands for any characters, folders included."""
    return any(fnmatchcase(name, pattern) for pattern in row["files"])


def release(row: dict[str, Any], site: Path) -> str:
    """Return the version: that of the package that brings the files, or the one that a file names."""
    if "version" not in row:
        return version(row["purl"].removeprefix("pkg:pypi/"))
    where = row["version"]
    found = re.search(where["pattern"], (site / where["file"]).read_text(encoding="utf-8"))
    if found is None:
        raise ValueError(f"{row['name']}: {where['pattern']!r} finds no version in {where['file']}")
    return found[1]


def bill(found: list[Component], site: Path) -> str:
    """Return the bill of materials in CycloneDX's format, without a time, so that it is the same every time."""
    return json.dumps(
        {
            "bomFormat": "CycloneDX",
            "specVersion": "1.6",
            "version": 1,
            "metadata": {
                "component": {"type": "application", "name": "pidalab-book", "bom-ref": "pidalab-book"}
            },
            "components": [
                {
                    "type": "library",
                    "bom-ref": f"{one.purl}@{one.version}",
                    "name": one.name,
                    "version": one.version,
                    "purl": f"{one.purl}@{one.version}",
                    "licenses": [{"expression": one.licence}],
                    "copyright": f"Copyright {one.copyright}",
                    "externalReferences": [{"type": "website", "url": one.url}],
                    "components": [
                        {
                            "type": "file",
                            "name": name,
                            "hashes": [{"alg": "SHA-256", "content": digest(site / name)}],
                        }
                        for name in one.files
                    ],
                }
                for one in found
            ],
        },
        indent=1,
    )


def digest(path: Path) -> str:
    """Return the SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def notice(found: list[Component]) -> str:
    """Return names, licences and copyrights for people to read, and the whole text of each licence that asks for it.

    Raises
    ------
    FileNotFoundError
        If the text of a licence is not at hand.
    """
    blocks = [
        f"{one.name} {one.version}\n  Copyright {one.copyright}\n  {one.licence}\n  {one.url}\n  {len(one.files)} files"
        for one in found
    ]
    licences = sorted({name for one in found for name in one.licence.split(" AND ")})
    texts = [
        f"{name}\n\n{LINKED.get(name) or (TEXTS / f'{name}.txt').read_text(encoding='utf-8').strip()}"
        for name in licences
    ]
    return RULE.join(["\n\n".join([HEAD, *blocks]), *texts]) + "\n"


def write(site: Path) -> None:
    """Write both files into the site."""
    found = components(table(), site)
    (site / BILL).write_text(bill(found, site) + "\n", encoding="utf-8")
    (site / NOTICE).write_text(notice(found), encoding="utf-8")


if __name__ == "__main__":
    try:
        write(SITE)
    except ValueError as problem:
        sys.exit(str(problem))
