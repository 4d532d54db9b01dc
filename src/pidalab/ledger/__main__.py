"""``python -m pidalab.ledger``: show, check and maintain the ledgers in ``book/ledger``."""

import argparse
import sys
from collections.abc import Sequence

from pidalab.ledger import Ledger, LedgerError, load_all, write_score
from pidalab.ledger.files import MANIFEST
from pidalab.ledger.manifest import freeze
from pidalab.ledger.running import update


def _update(papers: list[str]) -> None:
    problems = []
    for paper in papers:
        result = update(paper)
        print("\n".join([f"{paper}: {len(result.changes)} entries changed", *result.changes]))
        problems += result.problems
    if problems:
        raise LedgerError("\n".join(["left to do:", *problems]))


def _show(papers: list[str]) -> None:
    for paper in papers:
        book = Ledger.open(paper)
        print(book.table(), "", book.scorebar(), sep="\n")


def _check() -> None:
    for book in load_all().values():
        print(book.scorebar())


def _readme(files: list[str]) -> None:
    for file in files:
        print(f"{file}: {'rewritten' if write_score(file) else 'up to date'}")


def _manifest() -> None:
    print(f"{MANIFEST}: {'rewritten' if freeze() else 'up to date'}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    arguments : sequence of str, optional
        By default those of the command line.

    Returns
    -------
    int
        0, or 1 after printing what is wrong.
    """
    parser = argparse.ArgumentParser(prog="python -m pidalab.ledger", description=__doc__)
    commands = parser.add_subparsers(required=True)
    command = commands.add_parser("update", help="run the checks of papers and store what they compute")
    command.add_argument("papers", nargs="+")
    command.set_defaults(run=lambda given: _update(given.papers))
    command = commands.add_parser("show", help="print ledgers, printed beside computed")
    command.add_argument("papers", nargs="+")
    command.set_defaults(run=lambda given: _show(given.papers))
    command = commands.add_parser("check", help="validate all files and print their scores")
    command.set_defaults(run=lambda given: _check())
    command = commands.add_parser("readme", help="bring the score in Markdown files up to date")
    command.add_argument("files", nargs="+")
    command.set_defaults(run=lambda given: _readme(given.files))
    command = commands.add_parser(
        "manifest", help="freeze what is printed, its kind and its basis; review the change"
    )
    command.set_defaults(run=lambda given: _manifest())
    given = parser.parse_args(arguments)
    try:
        given.run(given)
    except (LedgerError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
