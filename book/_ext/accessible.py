"""Small repairs to what the book's tools write, for readers who listen, use the keyboard, or print."""

import re

EMPTY_HEADER = re.compile(r"<th(\s[^>]*)?>\s*(<p>\s*</p>)?\s*</th>")
SAME_NAME = ' aria-label="Toggle hidden content"'
FRAME = re.compile(r'<table[^>]*\bclass="[^"]*\bdataframe\b[^"]*"[^>]*>.*?</table>', re.DOTALL)
# M_s, ω_gc, PIDA_1: a letter or capitals with an index in a cell of a table of numbers; the name of a file goes on
INDEX = re.compile(
    r"(?<![\w.])([^\W\d_][\u0300-\u036f]?|[A-Z]{2,5})_(-?\w{1,5})(?!\w|[.-]\w)(?=[^<>]*</t[hd]>)"
)


def repaired(body: str) -> str:
    """Return the body of a page with folds that say what they hide, no headers of nothing, and indices as such."""
    body = body.replace(SAME_NAME, "")  # the words inside the fold's bar are its name
    body = EMPTY_HEADER.sub("<td></td>", body)
    return FRAME.sub(lambda table: INDEX.sub(r"\1<sub>\2</sub>", table.group()), body)


def repair(app, pagename, templatename, context, doctree):
    """Repair a page before it is written."""
    if "body" in context:
        context["body"] = repaired(context["body"])


def setup(app):
    # Formulas are read, not operated: they are no stops of the Tab key.
    app.config.mathjax3_config = {"options": {"menuOptions": {"settings": {"inTabOrder": False}}}}
    app.add_js_file("folds.js")
    app.connect("html-page-context", repair)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
