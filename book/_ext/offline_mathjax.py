"""Serve MathJax from the site itself, so that formulas need no network.

The package ``sphinx-mathjax-offline`` has a whole MathJax distribution. The book needs one script and fonts, 1.6 MB.
A browser may break the line after a formula, so a punctuation mark after it and a bracket before it are tied to it.
"""

import re
import shutil
from importlib.resources import as_file, files
from pathlib import Path

SCRIPT = "tex-chtml.js"
FONTS = "output/chtml/fonts/woff-v2"
FORMULA = r'<span class="math notranslate nohighlight">[^<]*</span>'
MARKED = re.compile(rf"(\({FORMULA}[,.;:!?)]*|{FORMULA}[,.;:!?)]+)")


def copy_mathjax(app, exception):
    """Copy the script and its fonts, in the layout the script expects."""
    if exception or app.builder.format != "html":
        return
    # The package's name holds hyphens, so it cannot be imported by name.
    with as_file(files("sphinx-mathjax-offline") / "static" / "mathjax") as source:
        target = Path(app.outdir) / "_static" / "mathjax"
        shutil.copytree(source / FONTS, target / FONTS, dirs_exist_ok=True)
        shutil.copy(source / SCRIPT, target)


def tie_marks(app, pagename, templatename, context, doctree):
    """Keep a formula and its comma, or its bracket, on one line."""
    if "body" in context:
        context["body"] = MARKED.sub(r'<span class="tied">\1</span>', context["body"])


def setup(app):
    app.config.mathjax_path = f"mathjax/{SCRIPT}"
    app.connect("html-page-context", tie_marks)
    app.connect("build-finished", copy_mathjax)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
