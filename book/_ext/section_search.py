"""A search whose hits are sections, not pages: chapters before the reference, and no server.

While Sphinx writes the pages, the text of every section is collected; at the end it becomes one script, which the
search page loads beside MiniSearch. A script, not a data file, because a page opened from disk may load no data.
"""

import json
from pathlib import Path

from bs4 import BeautifulSoup, Tag

HEADINGS = ("h1", "h2", "h3", "h4")
# Code, formulas' source and buttons are not what a reader looks for.
LEFT_OUT = (
    "script, style, .cell_input, summary, .headerlink, button, .toctree-wrapper, table.dataframe, .only-dark"
)
LONGEST = 6000  # characters kept of a section
# How much a hit counts, by the beginning of the page's name; the first that fits.
WEIGHTS = (
    ("book/api", 0.05),
    ("book/audit", 0.15),
    ("book/scoreboard", 0.5),
    ("book/errata", 0.5),
    ("book/bibliography", 0.1),
    ("book/learn/index", 0.5),
    ("book/learn", 1.3),
    ("", 1.0),
)


def sections(body: str) -> list[tuple[str, str, str]]:
    """Return (anchor, title, text) of each section of a page; a section's text is without its subsections'."""
    page = BeautifulSoup(body, "html.parser")
    for element in page.select(LEFT_OUT):
        element.decompose()
    for formula in page.select(
        ".math"
    ):  # a formula as text, without the marks that tell where it begins and ends
        formula.string = formula.get_text().strip().removeprefix("\\(").removesuffix("\\)")
    found = []
    for section in page.find_all(["section", "dl"]):
        heading = (
            section.find(HEADINGS, recursive=False)
            if section.name == "section"
            else section.find("dt", id=True)
        )
        if heading is None:
            continue
        anchor = section.get("id") or heading.get("id") or ""
        own = [
            child.get_text(" ", strip=True) if isinstance(child, Tag) else str(child).strip()
            for child in section.children
            if child is not heading and not (isinstance(child, Tag) and child.name == "section")
        ]
        title = heading.get_text(" ", strip=True) if section.name == "section" else anchor
        found.append((anchor, title, " ".join(filter(None, own))[:LONGEST]))
    return found


def collect(app, pagename, templatename, context, doctree):
    """Keep a page's sections, and give the search page its scripts."""
    if pagename == "search":
        for script in (
            "vendor/minisearch/minisearch.min.js",
            "sections.js",
            "section_search.js",
        ):
            app.add_js_file(script)
    if doctree is None or "body" not in context:
        return
    weight = next(value for start, value in WEIGHTS if pagename.startswith(start))
    page = context.get("title", pagename)
    page = BeautifulSoup(page, "html.parser").get_text()
    for anchor, title, text in sections(context["body"]):
        app.section_index.append(
            {
                "id": len(app.section_index),
                "page": page,
                "title": title,
                "text": text,
                "weight": weight,
            }
            | {"url": app.builder.get_target_uri(pagename) + (f"#{anchor}" if anchor else "")}
        )


def write_index(app, exception):
    """Write what was collected as a script."""
    if exception or app.builder.format != "html":
        return
    text = json.dumps(app.section_index, ensure_ascii=False, separators=(",", ":"))
    Path(app.outdir, "_static", "sections.js").write_text(f"window.bookSections={text};\n", encoding="utf-8")


def setup(app):
    app.section_index = []
    app.connect("html-page-context", collect, priority=900)  # after the figures have their twins
    app.connect("build-finished", write_index)
    return {"parallel_read_safe": True, "parallel_write_safe": False}
