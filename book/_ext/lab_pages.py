"""Give the pages that hold the lab or a live figure its scripts, and no others."""

PARTS = ("engine", "optima", "model", "optimum", "plot", "record", "lab", "live")
SCRIPTS = tuple(f"lab/{part}.js" for part in PARTS)
MARKS = ('class="pidalab-lab"', 'class="pidalab-live"')


def add_scripts(app, pagename, templatename, context, doctree):
    """Add scripts and styles where the page has a mark."""
    if any(mark in context.get("body", "") for mark in MARKS):
        app.add_css_file("lab/lab.css")
        for script in SCRIPTS:
            app.add_js_file(script)


def setup(app):
    app.connect("html-page-context", add_scripts)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
