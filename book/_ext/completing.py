"""Complete Jupyter Book: parallel writing, formulas without a network, a content security policy, numbers of figures by
lecture, and repairs for screen readers, keyboard and print.
"""

import gc
import os
import re
import shutil
from importlib.resources import as_file, files
from pathlib import Path

# --- speed: garbage collection would take a sixth of the time, since Sphinx frees few of its nodes ---


def write_in_parallel(app, env):
    """Write in parallel, now that all pages have been read."""
    app.parallel = os.cpu_count()


# --- a policy: no page loads anything from another host ---

# The pages have inline scripts and styles (formulas, figures, the lab), and run WebAssembly in workers.
POLICY = "; ".join(
    [
        "default-src 'self'",
        "script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' blob:",
        "style-src 'self' 'unsafe-inline'",
        "img-src 'self' data: blob:",
        "font-src 'self' data:",
        "connect-src 'self' data: blob:",
        "worker-src 'self' blob:",
        "object-src 'none'",
        "base-uri 'self'",
        "form-action 'self'",
    ]
)
META = f'<meta http-equiv="Content-Security-Policy" content="{POLICY}" />'


def add_policy(app, pagename, templatename, context, doctree):
    """Put the policy into the head of a page, before anything that it governs."""
    context["metatags"] = f"{META}\n{context.get('metatags', '')}"


# --- MathJax from the site itself: one script and the fonts of the distribution --

SCRIPT = "tex-chtml.js"
FONTS = "output/chtml/fonts/woff-v2"
FORMULA = r'<span class="math notranslate nohighlight">[^<]*</span>'
MARKED = re.compile(rf"(\({FORMULA}[,.;:!?)]*|{FORMULA}[,.;:!?)]+)")


def copy_mathjax(app, exception):
    """Copy the script and its fonts, in the layout the script expects."""
    if exception or app.builder.format != "html":
        return
    # The name of the package has hyphens, so it cannot be imported.
    with as_file(files("sphinx-mathjax-offline") / "static" / "mathjax") as source:
        target = Path(app.outdir) / "_static" / "mathjax"
        shutil.copytree(source / FONTS, target / FONTS, dirs_exist_ok=True)
        shutil.copy(source / SCRIPT, target)


def tie_marks(app, pagename, templatename, context, doctree):
    """Keep a formula and its comma or bracket on one line."""
    if "body" in context:
        context["body"] = MARKED.sub(r'<span class="tied">\1</span>', context["body"])


# --- figures and exercises: counted on each page, after the number with which the title begins, if any ---


def prefix_of(title: str) -> tuple[int, ...]:
    """Return the number at the beginning of a title."""
    found = re.match(r"(\d+) ", title)
    return (int(found[1]),) if found else ()


def number_by_page(app, env):
    """Number figures and exercises by page."""
    for page, kinds in env.toc_fignumbers.items():
        if not env.toc_secnumbers.get(page, {}).get(""):
            prefix = prefix_of(env.titles[page].astext())
            for numbers in kinds.values():
                numbers.update({name: (*prefix, k) for k, name in enumerate(numbers, start=1)})
    return []


# --- repairs ---

EMPTY_HEADER = re.compile(r"<th(\s[^>]*)?>\s*(<p>\s*</p>)?\s*</th>")
SAME_NAME = ' aria-label="Toggle hidden content"'
FRAME = re.compile(r'<table[^>]*\bclass="[^"]*\bdataframe\b[^"]*"[^>]*>.*?</table>', re.DOTALL)
# M_s, ω_gc, PIDA_1: a letter or capitals with an index in a cell of a table of numbers. File names do not match.
INDEX = re.compile(
    r"(?<![\w.])([^\W\d_][\u0300-\u036f]?|[A-Z]{2,5})_(-?\w{1,5})(?!\w|[.-]\w)(?=[^<>]*</t[hd]>)"
)


def repaired(body: str) -> str:
    """Return the body of a page with names for folds, no empty table headers, and typeset indices."""
    body = body.replace(SAME_NAME, "")  # the words in the bar already name the fold
    body = EMPTY_HEADER.sub("<td></td>", body)
    return FRAME.sub(lambda table: INDEX.sub(r"\1<sub>\2</sub>", table.group()), body)


def repair(app, pagename, templatename, context, doctree):
    """Repair a page before it is written."""
    if "body" in context:
        context["body"] = repaired(context["body"])


def setup(app):
    gc.set_threshold(100_000, 50, 50)
    app.connect("env-updated", write_in_parallel)
    # Formulas are not interactive, so the Tab key skips them.
    app.config.mathjax3_config = {"options": {"menuOptions": {"settings": {"inTabOrder": False}}}}
    app.config.mathjax_path = f"mathjax/{SCRIPT}"
    app.add_js_file("folds.js")
    app.connect("html-page-context", repair)
    app.connect("html-page-context", tie_marks)
    app.connect("html-page-context", add_policy, priority=900)  # after others that add to the head
    app.connect("env-get-updated", number_by_page, priority=900)  # after Sphinx has numbered them
    app.connect("build-finished", copy_mathjax)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
