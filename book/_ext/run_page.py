"""Add the button that runs the cells of a page, if the site is built by ``make book LIVE=1``."""

import os
import re

PAGES = re.compile(r"book/(learn/[\w-]+|noise-limit|design|[a-z]+\d{4})")


def add_button(app, pagename, templatename, context, doctree):
    """Add script and styles to a page that has code cells."""
    if os.environ.get("LIVE") and PAGES.fullmatch(pagename) and '<div class="cell' in context.get("body", ""):
        app.add_css_file("run/run.css")
        app.add_js_file("run/page.js", **{"data-page": pagename.removeprefix("book/")})


def setup(app):
    app.connect("html-page-context", add_button)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
