"""Sphinx holds millions of nodes and lets few go: looking among them for garbage takes a sixth of its time."""

import gc


def setup(app):
    gc.set_threshold(100_000, 50, 50)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
