"""Small repairs to what the book's tools write, for readers who listen, use the keyboard, or print."""

import re

EMPTY_HEADER = re.compile(r"<th(\s[^>]*)?>\s*(<p>\s*</p>)?\s*</th>")
SAME_NAME = ' aria-label="Toggle hidden content"'


def repaired(body: str) -> str:
    """Return the body of a page with folds that say what they hide and without headers of nothing."""
    body = body.replace(SAME_NAME, "")  # the words inside the fold's bar are its name
    return EMPTY_HEADER.sub("<td></td>", body)


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
