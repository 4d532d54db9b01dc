"""Filling a ledger from its chapter: the notebook runs, and what it hands over is stored instead of compared."""

import json
from collections.abc import Sequence
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from types import ModuleType
from typing import NamedTuple
from unittest.mock import patch

from pidalab.ledger.book import Ledger, Value, record
from pidalab.ledger.errors import LedgerError
from pidalab.ledger.rows import Row


class Update(NamedTuple):
    """What an update did to the ledgers of a notebook.

    Parameters
    ----------
    changes : list of str
        One line for each entry that changed, old and new.
    problems : list of str
        What is left for a person: verdicts to declare, notes to write, ids never handed over.

    Examples
    --------
    >>> Update(changes=[], problems=["demo.kp: never handed over"]).changes
    []
    """

    changes: list[str]
    problems: list[str]


def update(notebook: Path | str) -> Update:
    """Run a chapter and store what it computes in its ledger.

    Parameters
    ----------
    notebook : path
        The chapter. It runs in its own folder, as in the build of the book; its outputs are not stored.

    Returns
    -------
    Update

    Raises
    ------
    LedgerError
        If a cell fails; nothing is stored then.
    """
    changes, problems = [], []
    for book in _collect(Path(notebook)):
        changes += record(book.paper, book.values, book.path.parent)
        problems += Ledger.open(book.paper, book.path.parent).problems()
        problems += [f"{id}: never handed over" for id in book.missing()]
    return Update(changes, problems)


def _collect(notebook: Path) -> list[Ledger]:
    opened: list[Ledger] = []

    class Collector(Ledger):
        """A ledger that takes every value as it comes."""

        def __init__(self, path: Path, rows: Sequence[Row]) -> None:
            super().__init__(path.absolute(), rows)
            opened.append(self)

        def _judge(self, row: Row, value: Value) -> list[str]:
            return []

        def close(self) -> None:
            pass

    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    sources = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    with patch("pidalab.ledger.Ledger", Collector), chdir(notebook.parent):
        _run(notebook.name, sources)
    return opened


def _run(name: str, sources: list[str]) -> None:
    # Imported here, because the library itself needs neither; figures must not open windows.
    import matplotlib
    from IPython.core.interactiveshell import InteractiveShell
    from traitlets.config import Config

    class Shell(InteractiveShell):
        """A shell without windows."""

        def enable_gui(self, gui: str | None = None) -> None:
            pass

    matplotlib.use("Agg")
    InteractiveShell.clear_instance()
    config = Config({"HistoryManager": {"enabled": False}})
    shell = Shell.instance(config=config, user_module=ModuleType("chapter"))
    try:
        for count, source in enumerate(sources, start=1):
            with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
                result = shell.run_cell(source)
            if error := result.error_before_exec or result.error_in_exec:
                raise LedgerError(f"{name}, code cell {count}: {type(error).__name__}: {error}") from error
    finally:
        Shell.clear_instance()
