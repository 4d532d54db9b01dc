"""Maintain the ledgers in ``book/ledger``: python -m paperledger COMMAND ...

new KEY           write the files of a new paper, and list files that should name the paper
update KEY ...    run the pages of papers and store their results
show KEY ...      print ledgers, with printed and computed numbers
check             validate all ledgers, print their scores, and list files that should name a paper but do not
manifest          store all claims, and print the changes, to be reviewed line by line
shake LIBRARY KEY ...  run pages while LIBRARY returns slightly wrong numbers, and check that each row changes
readme FILE ...   update the score in Markdown files
"""

import argparse
import os
import sys
from collections.abc import Sequence

from paperledger import Ledger, LedgerError, load_all, update, write_score
from paperledger.pages import freeze
from paperledger.rows import find_folder
from paperledger.running import missing, new

COMMANDS = ("new", "update", "show", "check", "manifest", "shake", "readme")


def _update(papers: Sequence[str]) -> None:
    problems = []
    for paper in papers:
        result = update(paper)
        print(f"{paper}: {len(result.changes)} entries changed", *result.changes, sep="\n")
        problems += result.problems
    if problems:
        raise LedgerError("\n".join(["left to do:", *problems]))


def run(command: str, names: Sequence[str]) -> None:
    """Run one command."""
    match command:
        case "new":
            for paper in names:
                print(*new(paper, find_folder()), *missing(paper, find_folder()), sep="\n")
        case "update":
            _update(names)
        case "show":
            for book in map(Ledger.open, names):
                print(book.claims(), "", book.scorebar(), sep="\n")
        case "check":
            books = load_all()
            lacks = [line for paper in books for line in missing(paper, find_folder())]
            print(*(book.scorebar() for book in books.values()), *lacks, sep="\n")
        case "manifest":
            changes = freeze()
            print(*changes, f"manifest: {'rewritten' if changes else 'up to date'}", sep="\n")
        case "shake":
            # The import is here and not at the top, since it loads numpy, which takes long.
            from paperledger.shake import Shaker, shake

            if not names:
                raise LedgerError("shake needs the name of the package that computes: shake LIBRARY KEY ...")
            if shake(Shaker(names[0]), None, names[1:]):
                raise LedgerError("the rows above were copied, or their basis is wrong")
        case "readme":
            for file in names:
                print(f"{file}: {'rewritten' if write_score(file) else 'up to date'}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command, by default the one on the command line. Return 0. On an error, print it and return 1."""
    parser = argparse.ArgumentParser("python -m paperledger", usage=__doc__.partition(": ")[2])
    parser.add_argument("command", choices=COMMANDS)
    parser.add_argument("names", nargs="*")
    asked = parser.parse_args(arguments)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # print an escape sequence where a console cannot show a character
            stream.reconfigure(errors="backslashreplace")
    try:
        run(asked.command, asked.names)
    except (LedgerError, UnicodeDecodeError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    os.environ["MPLBACKEND"] = "Agg"  # pages must not open windows
    sys.exit(main())
