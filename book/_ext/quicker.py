"""What makes Sphinx quicker, with the same pages.

It holds millions of nodes and lets few go: looking among them for garbage takes a sixth of its time. And several
processes write the pages. One reads them, since not all extensions can put together what several have read.
"""

import gc
import os


def write_in_parallel(app, env):
    """All pages have been read."""
    app.parallel = os.cpu_count()


def setup(app):
    gc.set_threshold(100_000, 50, 50)
    app.connect("env-updated", write_in_parallel)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
