"""Add metadata to pages: the canonical address, and citations for search engines.

The site has the address of the repository's GitHub pages, unless ``html_baseurl`` is set.
"""

import re
from functools import cache
from html import escape
from pathlib import Path

from pybtex.database import parse_file


def site(repository):
    """Return the address of the GitHub pages of a repository.

    >>> site("https://github.com/pidalab/pidalab")
    'https://pidalab.github.io/pidalab/'
    """
    owner, name = repository.rstrip("/").split("/")[-2:]
    return f"https://{owner}.github.io/{name}/"


@cache
def bibliography(folder):
    """Return the bibliography of a book."""
    return parse_file(folder / "references.bib").entries


def fields(entry):
    """Return a bibliography entry as plain text."""
    plain = {name: re.sub(r"[{}]|\\.", "", text) for name, text in entry.fields.items()}
    people = [str(person) for person in entry.persons.get("author", [])]
    return plain | {"author": " and ".join(re.sub(r"[{}]|\\.", "", name) for name in people)}


def head(folder, base, docname, title):
    """Return the metadata for the head of a page of a paper."""
    paper = docname.rpartition("/")[2].partition("-")[0]
    if not (folder / "ledger" / f"{paper}.csv").is_file():
        return ""
    entry = fields(bibliography(folder)[paper])
    told = {
        "citation_title": title,
        "citation_author": "The pidalab developers",
        "citation_public_url": f"{base}{docname}.html",
        "citation_reference": f"citation_title={entry['title']}"
        + (f";citation_doi={entry['doi']}" if "doi" in entry else ""),
    }
    return "\n".join(
        [*(f'<meta name="{key}" content="{escape(value)}" />' for key, value in told.items()), ""]
    )


def add(app, docname, templatename, context, doctree):
    """Add the metadata to a page."""
    if doctree is not None:
        said = head(Path(app.srcdir) / "book", app.config.html_baseurl, docname, context.get("title", ""))
        context["metatags"] = context.get("metatags", "") + said


def address(app, config):
    """Set the address of the site, so that each page has its canonical address."""
    if not config.html_baseurl:
        config.html_baseurl = site(config.html_theme_options["repository_url"])


def setup(app):
    """Install the extension."""
    app.connect("config-inited", address)
    app.connect("html-page-context", add)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
