"""Maintain the ledgers in ``book/ledger``: python -m paperledger COMMAND ...

new KEY           write the files of a new paper, and list what else it needs
update KEY ...    run the pages of papers and store what they compute
show KEY ...      print ledgers, printed beside computed
check             validate all files, print their scores, and list what a paper lacks
manifest          freeze what is claimed, and print what changed; review it line by line
shake LIBRARY KEY ...  run pages with a package that is slightly off, and see each row move
readme FILE ...   bring the score in Markdown files up to date
"""

import argparse
import sys
from collections.abc import Sequence

from paperledger import Ledger, LedgerError, load_all, update, write_score
from paperledger.pages import freeze
from paperledger.rows import find_folder
from paperledger.running import missing, new


def _update(papers: list[str]) -> None:
    problems = []
    for paper in papers:
        result = update(paper)
        print("\n".join([f"{paper}: {len(result.changes)} entries changed", *result.changes]))
        problems += result.problems
    if problems:
        raise LedgerError("\n".join(["left to do:", *problems]))


def _show(papers: list[str]) -> None:
    for book in map(Ledger.open, papers):
        print(book.table(), "", book.scorebar(), sep="\n")


def _check(_: list[str]) -> None:
    books = load_all()
    print(*(book.scorebar() for book in books.values()), sep="\n")
    for line in (line for paper in books for line in missing(paper, find_folder())):
        print(line)


def _new(papers: list[str]) -> None:
    for paper in papers:
        folder = find_folder()
        print(*new(paper, folder), *missing(paper, folder), sep="\n")


def _manifest(_: list[str]) -> None:
    changes = freeze()
    print("\n".join([f"manifest: {'rewritten' if changes else 'up to date'}", *changes]))


def _readme(files: list[str]) -> None:
    for file in files:
        print(f"{file}: {'rewritten' if write_score(file) else 'up to date'}")


def _shake(names: list[str]) -> None:
    from paperledger.shake import (
        Shaker,
        shake,  # numpy takes a while, and only this needs it
    )

    if not names:
        raise LedgerError("shake needs the name of the package that computes: shake LIBRARY KEY ...")
    if shake(Shaker(names[0]), None, names[1:]):
        raise LedgerError("a row that does not move was not computed; see above")


COMMANDS = {
    "new": _new,
    "update": _update,
    "show": _show,
    "check": _check,
    "manifest": _manifest,
    "shake": _shake,
    "readme": _readme,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command, of the command line by default; 0, or 1 after printing what is wrong."""
    parser = argparse.ArgumentParser("python -m paperledger", usage=__doc__.partition(": ")[2])
    parser.add_argument("command", choices=COMMANDS)
    parser.add_argument("names", nargs="*")
    asked = parser.parse_args(arguments)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a file on Windows has no τ; nothing stops for that
            stream.reconfigure(errors="backslashreplace")
    try:
        COMMANDS[asked.command](asked.names)
    except (LedgerError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
