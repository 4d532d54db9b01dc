"""Add the scripts of lab, live figures and slides to the pages that need them."""

LAB = ("engine", "optima", "model", "optimum", "plot", "record", "lab", "live")
PARTS = {
    "lab": LAB,
    "live": LAB,
    "landing": ("engine", "model", "plot", "landing"),
    "hidden": ("engine", "model", "plot", "hidden-data", "hidden"),
}


def add_scripts(app, pagename, templatename, context, doctree):
    """Add scripts and styles where the page has a mark."""
    for mark, parts in PARTS.items():
        if f'class="pidalab-{mark}"' in context.get("body", ""):
            app.add_css_file("lab/lab.css")
            for part in parts:
                app.add_js_file(f"lab/{part}.js")


def add_slides(app, pagename, templatename, context, doctree):
    """Let a lecture be shown as slides."""
    if pagename.startswith("book/learn/") and 'class="pidalab-task"' in context.get("body", ""):
        app.add_css_file("slides.css")
        app.add_js_file("slides.js", loading_method="defer")


def setup(app):
    app.connect("html-page-context", add_scripts)
    app.connect("html-page-context", add_slides)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
