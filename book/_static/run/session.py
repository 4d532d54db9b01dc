"""Run the cells of a page in the browser, as the kernel of a notebook does.

`worker.js` calls `cells` and `run` and reads their output, one line of JSON. An output is a pair of a kind (`text`,
`html`, `svg` or `error`) and its content. A figure has two contents, for light and dark mode.
"""

import ast
import contextlib
import io
import json
import linecache
import logging
import os
import sys
import traceback
import types

namespace = {"__name__": "__main__"}
outputs = []


class Printed(io.TextIOBase):
    """Printed text of a cell, joined until another output is shown."""

    def write(self, text):
        if outputs and outputs[-1][0] == "text":
            outputs[-1][1] += text
        else:
            outputs.append(["text", text])
        return len(text)


def show(*values, **_):
    """Show values in their richest form, as a notebook does."""
    from completing import repaired  # of the book, as when the page was built

    figures()
    for value in values:
        if hasattr(value, "savefig"):
            draw(value)
        elif svg := getattr(value, "_repr_svg_", lambda: None)():
            outputs.append(["svg", *both(svg)])
        elif html := getattr(value, "_repr_html_", lambda: None)():
            outputs.append(["html", repaired(html)])
        else:
            outputs.append(["text", repr(value) + "\n"])


def both(svg):
    """Return a figure for light and for dark mode, in the font of the page."""
    from figures_for_dark import FONT, OF_THE_PAGE, darkened

    light = FONT.sub(OF_THE_PAGE, svg)
    return light, darkened(light)


def draw(figure):
    """Show one figure."""
    target = io.StringIO()
    figure.savefig(
        target,
        format="svg",
        metadata={"Date": None, "Creator": None},
        bbox_inches="tight",
    )
    outputs.append(["svg", *both(target.getvalue())])


def figures():
    """Show and close all figures of pyplot, if a cell has used it."""
    if plt := sys.modules.get("matplotlib.pyplot"):
        for number in plt.get_fignums():
            draw(plt.figure(number))
        plt.close("all")
        plt.show = lambda *_, **__: figures()


def explore():
    """Let a ledger show a changed value with the stored one. Outside a page it raises an error."""
    from paperledger import Ledger, LedgerError, Row

    class Moved(Row):
        def shown(self):
            return f"{stored[self.id].shown()} → {super().shown()}"

    stored, take = {}, Ledger._take

    def taken(ledger, fresh):
        try:
            return take(ledger, fresh)
        except LedgerError:
            stored[fresh.id] = ledger.rows[fresh.id]
            ledger.fresh[fresh.id] = fresh
            return Moved(**vars(fresh))

    Ledger._take = taken


def cells(page):
    """Enter the folder of a page and return the code of its cells."""
    with open(f"/book/{page}.json", encoding="utf-8") as file:
        found = json.load(file)
    os.chdir(os.path.dirname(f"/book/{page}"))
    sys.path[:0] = [os.getcwd()]
    if any("paperledger" in source for source in found):
        explore()
    return found


def run(number, source):
    """Run a cell and return its outputs, for an exception the traceback."""
    outputs.clear()
    name = f"<cell {number + 1}>"
    linecache.cache[name] = len(source), None, source.splitlines(keepends=True), name
    printed = Printed()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        try:
            tree = ast.parse(source, name)
            last = (
                tree.body.pop()
                if tree.body and isinstance(tree.body[-1], ast.Expr)
                else None
            )
            exec(compile(tree, name, "exec"), namespace)
            if last is not None:
                value = eval(
                    compile(ast.Expression(last.value), name, "eval"), namespace
                )
                if value is not None:
                    show(value)
            figures()
        except BaseException as error:
            below = error.__traceback__.tb_next  # without this function
            outputs.append(
                [
                    "error",
                    "".join(traceback.format_exception(type(error), error, below)),
                ]
            )
    return outputs


def answer(call):
    """Print the answer to a call of the page, as JSON on one line."""
    name, *arguments = json.loads(call)
    print(json.dumps({"cells": cells, "run": run}[name](*arguments)))


def install():
    """Replace the parts of IPython that pages import."""
    display = types.ModuleType("IPython.display")
    display.display = show
    ipython = types.ModuleType("IPython")
    ipython.get_ipython, ipython.display, ipython.version_info = (
        lambda: None,
        display,
        (9, 0),
    )
    sys.modules |= {"IPython": ipython, "IPython.display": display}
    # Matplotlib would warn in the first cell: its check of the temporary folder fails here, though that can be written
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    namespace["display"] = show
