"""Make Sphinx faster, with the same pages.

Sphinx holds millions of nodes and frees few, so garbage collection takes a sixth of its time. Several processes write
the pages. One process reads them, since not all extensions can merge what several have read.
"""

import gc
import os


def write_in_parallel(app, env):
    """Write in parallel, now that all pages have been read."""
    app.parallel = os.cpu_count()


def setup(app):
    gc.set_threshold(100_000, 50, 50)
    app.connect("env-updated", write_in_parallel)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
