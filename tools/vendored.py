"""Write a notice of the third-party files in the built site, with the text of each licence.

`vendored.toml` lists projects with their files and licences. Each file of the site must belong to a project, and each
project must have files.
"""

import re
import sys
import tomllib
from fnmatch import fnmatchcase
from importlib.metadata import version
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
TABLE = ROOT / "tools" / "vendored.toml"
# A line with the SPDX name precedes the text of each licence. The texts contain no copyright lines, since these differ
# between projects.
TEXTS = ROOT / "tools" / "licences.txt"
LINKED = {"CC-BY-4.0": "https://creativecommons.org/licenses/by/4.0/legalcode"}  # needs only a link
SITE = ROOT / "_build" / "html"
NOTICE = "third-party.txt"
RULE = f"\n\n{'-' * 72}\n\n"
HEAD = "Third-party files in this site, with their licences; the texts follow."

Component = dict[str, Any]  # a project in the site, with name, version, url, licence, copyright and files


def table() -> list[Component]:
    """Read the projects."""
    return tomllib.loads(TABLE.read_text(encoding="utf-8"))["component"]


def texts() -> dict[str, str]:
    """Read the texts of licences by name."""
    _, *parts = re.split(r"^=== (\S+)\n", TEXTS.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {name: text.strip() for name, text in zip(parts[::2], parts[1::2], strict=True)}


def carried(site: Path) -> list[str]:
    """List the third-party files of the site: those not in book/_static, and those in book/_static/vendor."""
    own = {path.relative_to(ROOT / "book").as_posix() for path in (ROOT / "book" / "_static").rglob("*")}
    own = {name for name in own if not name.startswith("_static/vendor/")} | {"_static/sections.js"}
    found = (path.relative_to(site).as_posix() for path in (site / "_static").rglob("*") if path.is_file())
    return sorted(name for name in found if name not in own)


def components(rows: list[Component], site: Path) -> list[Component]:
    """Assign every file to its project.

    Raises
    ------
    ValueError
        If a file belongs to no project or to several, a project has no file, or a version is not found.
    """
    owners = {name: [row["name"] for row in rows if claims(row, name)] for name in carried(site)}
    wrong = [
        f"{name} belongs to {' and '.join(has) or 'nobody'}" for name, has in owners.items() if len(has) != 1
    ]
    wrong += [f"{row['name']} has no files" for row in rows if [row["name"]] not in owners.values()]
    if wrong:
        raise ValueError("\n".join([f"{TABLE.name} and the site disagree:", *wrong]))
    files = {row["name"]: [name for name, has in owners.items() if has == [row["name"]]] for row in rows}
    return [row | {"version": release(row, site), "files": files[row["name"]]} for row in rows]


def claims(row: Component, name: str) -> bool:
    """Return True if a file matches a pattern of a project. A star matches any characters, including slashes."""
    return any(fnmatchcase(name, pattern) for pattern in row["files"])


def release(row: Component, site: Path) -> str:
    """Return the version of the installed package, the version given in the table, or the version found in a file."""
    where = row.get("version")
    if where is None:
        return version(row["purl"].removeprefix("pkg:pypi/"))
    if isinstance(where, str):
        return where
    found = re.search(where["pattern"], (site / where["file"]).read_text(encoding="utf-8"))
    if found is None:
        raise ValueError(f"{row['name']}: {where['pattern']!r} finds no version in {where['file']}")
    return found[1]


def notice(found: list[Component]) -> str:
    """Return names, licences and copyrights, followed by the full text of each licence that requires it."""
    blocks = [
        f"{one['name']} {one['version']}\n  Copyright {one['copyright']}\n  {one['licence']}\n  {one['url']}\n"
        f"  {len(one['files'])} files"
        for one in found
    ]
    known = texts() | LINKED
    licences = sorted({name for one in found for name in one["licence"].split(" AND ")})
    return (
        RULE.join(["\n\n".join([HEAD, *blocks]), *(f"{name}\n\n{known[name]}" for name in licences)]) + "\n"
    )


def write(site: Path) -> None:
    """Write the notice into the site."""
    (site / NOTICE).write_text(notice(components(table(), site)), encoding="utf-8")


if __name__ == "__main__":
    try:
        write(SITE)
    except ValueError as problem:
        sys.exit(str(problem))
