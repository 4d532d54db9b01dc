"""Define what several commands share: error messages, options and output."""

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

REFUSALS = (ValueError, TypeError, OSError, ImportError, RuntimeError, ArithmeticError)
CONTEXT_SETTINGS = {"help_option_names": ["-h", "--help"], "max_content_width": 110, "show_default": True}
EXISTING = click.Path(exists=True, dir_okay=False, path_type=Path)


class Command(click.Command):
    """A command that reports an error of the library in one line on stderr, with exit status 1."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except MemoryError as refusal:
            said = "this needs more memory than there is: ask for shorter times, or for fewer samples"
            raise click.ClickException(said) from refusal
        except REFUSALS as refusal:
            raise click.ClickException(visible(" ".join(str(refusal).split()))) from refusal


class Group(click.Group):
    """A group of commands of the class `Command`."""

    command_class = Command


@click.group(cls=Group, context_settings=CONTEXT_SETTINGS)
@click.version_option(package_name="pidalab")
def main() -> None:
    """PIDA control: write controller code from a plant record, and compare and simulate controllers.

    \b
    From a record, a delimited text file with an open-loop step:
      pidalab report step.csv --sample-time 0.2                compare PI, PID and PIDA
      pidalab tune step.csv --sample-time 0.2 --out folder     tune one of them and write its code
      pidalab check log.csv --kp 0.6 --ti 12                   judge the gains of a loop
    For a known plant:
      pidalab compare --num 1 --den 1,3,3,1 --delay 1          apply every rule to it
      pidalab simulate --den 1,3,3,1 --kp 2 --ti 3 --until 30  simulate one loop
    Without a plant:
      pidalab rules                                            list the rules by name
      pidalab rule --ku 250 --tu 7200                          gains from ultimate gain and period
      pidalab benchmark rule.py:tune --out folder              rank a rule of yours on 134 plants
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # the console may lack a character
            stream.reconfigure(errors="replace")


@contextmanager
def progress(text: str) -> Iterator[None]:
    """Report work that takes longer than a second, if stderr is a terminal."""
    timer = threading.Timer(1.0, click.echo, [f"{text} …"], {"err": True})
    timer.daemon = True
    if sys.stderr.isatty():
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


class Place(click.Path):
    """A path to write to. An empty path (of an unset shell variable) is refused: it would mean the current folder."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Refuse an empty path."""
        if value == "":
            self.fail("must be a name, found an empty text", param, ctx)
        return super().convert(value, param, ctx)


OUT_FILE = Place(dir_okay=False, path_type=Path)
ABOVE = click.FloatRange(0.0, min_open=True)


def add_options(*options: Callable[..., Any]) -> Callable[..., Any]:
    """Add several options to a command, in this order."""
    return lambda command: functools.reduce(lambda wrapped, option: option(wrapped), options[::-1], command)


def numbers(ctx: click.Context, param: click.Parameter, value: str) -> list[float]:
    """Read numbers that are separated by commas or spaces."""
    try:
        return [float(part) for part in value.replace(",", " ").split()]
    except ValueError:
        raise click.BadParameter(f"must be numbers with commas between them, found {value!r}") from None


def column(ctx: click.Context, param: click.Parameter, value: str | None) -> str | int | None:
    """Convert digits to the number of a column. Return any other text unchanged as the name of a column."""
    return int(value) if value is not None and value.isdecimal() else value


ms = click.option("--ms", default=1.6, help="Upper limit of the maximum sensitivity Ms.")
ms_worst = click.option("--ms-worst", default=2.0, help="Upper limit of Ms with any plant the fit allows.")
limits = add_options(
    click.option("--u-min", default=-math.inf, help="Lower limit of u."),
    click.option("--u-max", default=math.inf, help="Upper limit of u."),
)
plant = add_options(
    click.option("--num", default="1", callback=numbers, help="Numerator, highest power first."),
    click.option("--den", required=True, callback=numbers, help="Denominator, as in '1,3,3,1'."),
    click.option("--delay", default=0.0, help="Dead time."),
)
columns = add_options(
    click.option(
        "--time", callback=column, show_default="time, or 0", help="Column of times: name or number."
    ),
    click.option("--u", callback=column, show_default="u, or 1", help="Column of the plant's input."),
    click.option("--y", callback=column, show_default="y, or 2", help="Column of the measured output."),
)
GAINS = ("kp", "ti", "td", "ta", "n", "m")
times = add_options(
    click.option("--td", default=0.0, help="Derivative time."),
    click.option("--ta", default=0.0, help="Acceleration time squared."),
    click.option("--n", default=10.0, help="The derivative's filter is td/n."),
    click.option("--m", default=10.0, help="The acceleration's filter is two lags of ta/m."),
)
force = click.option("--force", is_flag=True, help="Overwrite files whose contents differ from the new ones.")
out = add_options(
    click.option("--out", type=Place(file_okay=False, path_type=Path), help="Folder to write to."), force
)


def visible(text: str) -> str:
    """Escape control characters, which a name in a file may contain."""
    return "".join(x if x.isprintable() or x == "\n" else ascii(x)[1:-1] for x in text)


def show(sections: Sequence[tuple[str, str]]) -> None:
    """Print headings and indented texts."""
    for head, text in sections:
        click.echo(f"{head}\n{textwrap.indent(visible(text), '  ', lambda line: True)}\n")


def write(folder: Path, texts: Mapping[str, str], force: bool) -> None:
    """Write files, and print their paths."""
    for path in write_files(folder, texts, replace=force):
        click.echo(visible(f"written: {path}"))
