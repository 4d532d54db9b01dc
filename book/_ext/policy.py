"""Forbid each page to load anything from another host.

The pages have inline scripts and styles (formulas, figures, the lab), and run WebAssembly in workers.
"""

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


def add(app, pagename, templatename, context, doctree):
    """Put the policy into the head of a page, before anything that it governs."""
    context["metatags"] = f"{META}\n{context.get('metatags', '')}"


def setup(app):
    """Install the extension."""
    app.connect("html-page-context", add, priority=900)  # after others that add to the head
    return {"parallel_read_safe": True, "parallel_write_safe": True}
