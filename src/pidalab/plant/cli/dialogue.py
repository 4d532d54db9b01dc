"""What commands share: refusals on one line, options, and how text is set out."""

from __future__ import annotations

import functools
import io
import math
import sys
import textwrap
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from pidalab.plant.writing import write_files


def one_line(command: Callable[..., None]) -> Callable[..., None]:
    """Turn what the library refuses into one line on stderr, and exit status 1."""

    @functools.wraps(command)
    def guarded(**options: Any) -> None:
        try:
            command(**options)
        except MemoryError as refusal:
            raise click.ClickException(
                "this needs more memory than there is: ask for shorter times, or for fewer samples"
            ) from refusal
        except (ValueError, TypeError, OSError, ImportError, RuntimeError, ArithmeticError) as refusal:
            raise click.ClickException(visible(" ".join(str(refusal).split()))) from refusal

    return guarded


@contextmanager
def progress(text: str) -> Iterator[None]:
    """Say what takes long, after a second, on a terminal; a pipe is not told."""
    timer = threading.Timer(1.0, click.echo, [f"{text} …"], {"err": True})
    timer.daemon = True
    if sys.stderr.isatty():
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


class Place(click.Path):
    """A path to write to; an empty one, as of a variable of a shell that is not set, would be the folder at hand."""

    def __init__(self, **kind: Any) -> None:
        super().__init__(path_type=Path, **kind)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Refuse an empty path, and turn another one as usual."""
        if value == "":
            self.fail("must be a name, found an empty one", param, ctx)
        return super().convert(value, param, ctx)


def add_options(*options: Callable[..., Any]) -> Callable[..., Any]:
    """Put several options on a command, in this order."""

    def put(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            command = option(command)
        return command

    return put


def numbers(ctx: click.Context, param: click.Parameter, value: str) -> list[float]:
    """Read numbers with commas between them; report non-numbers by option."""
    try:
        return [float(part) for part in value.replace(",", " ").split()]
    except ValueError:
        raise click.BadParameter(f"must be numbers with commas between them, found {value!r}") from None


def column(ctx: click.Context, param: click.Parameter, value: str) -> str | int:
    """Take digits alone for the number of a column, anything else for its name."""
    return int(value) if value.isdecimal() else value


ms = click.option("--ms", default=1.6, help="Largest maximum sensitivity.")
ms_worst = click.option("--ms-worst", default=2.0, help="The same with any plant of the spread.")
limits = add_options(  # of the control signal
    click.option("--u-min", default=-math.inf, help="Lower limit of u."),
    click.option("--u-max", default=math.inf, help="Upper limit of u."),
)
plant = add_options(
    click.option("--num", default="1", callback=numbers, help="Numerator, highest power first."),
    click.option(
        "--den", required=True, callback=numbers, help="Denominator, highest power first: '1,3,3,1'."
    ),
    click.option("--delay", default=0.0, help="Dead time."),
)
times = add_options(
    click.option("--td", default=0.0, help="Derivative time."),
    click.option("--ta", default=0.0, help="Acceleration time squared."),
    click.option("--n", default=10.0, help="The derivative's filter is td/n."),
    click.option("--m", default=10.0, help="The acceleration's filter is ta/m, twice."),
)
force = click.option("--force", is_flag=True, help="Replace files that are there and hold something else.")
out = add_options(
    click.option("--out", type=Place(file_okay=False), help="Folder to write to."),
    force,
)


def visible(text: str) -> str:
    """Return text with what a terminal would act on, or hide, as an escape: names of files and of others are in it."""
    return "".join(x if x.isprintable() or x == "\n" else ascii(x)[1:-1] for x in text)


def show(sections: Sequence[tuple[str, str]]) -> None:
    """Print headings and, two characters to the right, texts."""
    for head, text in sections:
        click.echo(f"{head}\n{textwrap.indent(visible(text), '  ', lambda line: True)}\n")


def write(folder: Path, texts: Mapping[str, str], force: bool) -> None:
    """Write files, all of them whole or none, and say so."""
    for path in write_files(folder, texts, replace=force):
        click.echo(visible(f"written: {path}"))


def csv_of(columns: dict[str, Any]) -> str:
    """Return columns of numbers by their names as the text of a file."""
    import numpy as np

    text = io.StringIO()
    table = np.column_stack(list(columns.values()))
    np.savetxt(text, table, fmt="%.10g", delimiter=",", header=",".join(columns), comments="")
    return text.getvalue()
