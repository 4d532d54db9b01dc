"""The command that judges a rule of the user on many plants."""

from __future__ import annotations

import io
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pidalab._names import STARTING_MODELS
from pidalab.plant.cli.parts import one_line, out, write

if TYPE_CHECKING:
    from pidalab.comparison.benchmarking import Benchmark

FILES = ("benchmark.csv", "benchmark.tex", "benchmark.svg")


class RuleOfFile:
    """A function of a Python file, which is loaded where it is called first, in other processes too."""

    def __init__(self, path: Path, name: str) -> None:
        self.path, self.__name__ = path, name
        self.function: Any = None

    def __call__(self, process: Any) -> Any:
        """Call the function."""
        if self.function is None:
            import runpy

            space = runpy.run_path(str(self.path))
            if not callable(space.get(self.__name__)):
                raise TypeError(
                    f"rule must be a function of {self.path.name}, found no {self.__name__!r} there"
                )
            self.function = space[self.__name__]
        return self.function(process)

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"function": None}


@click.command("benchmark")
@click.argument("rule", metavar="FILE.py:FUNCTION")
@click.option("--name", help="What the rule is called in tables; by default its function's name.")
@click.option(
    "--model",
    type=click.Choice(STARTING_MODELS),
    default="process",
    help="What the rule is given of a plant.",
)
@click.option(
    "--plant", "plants", multiple=True, help="One of the plants, such as 'P2 T=1'; may be repeated."
)
@click.option("--workers", default=2, type=click.IntRange(1), help="Processes side by side.")
@out
@one_line
def benchmark_command(
    rule: str,
    name: str | None,
    model: str,
    plants: tuple[str, ...],
    workers: int,
    out: Path | None,
    force: bool,
) -> None:
    """Judge a rule of your own on 134 plants, beside all rules and the best there is: about a minute.

    The function takes a process and returns a controller. The file is run: it is your code. With --out also writes
    the rows as CSV, the ranking as a LaTeX table, and a figure.

    \b
    Example, with "import pidalab; def tune(p): return pidalab.rules.classical.simc(p, 'PI')" in rule.py:
      pidalab benchmark rule.py:tune --model first_order --out folder
    """
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    from pidalab.comparison.benchmarking import benchmark
    from pidalab.plant.writing import refuse_others

    file, _, function = rule.rpartition(":")
    path = Path(file)
    if not function.isidentifier() or not path.is_file():
        raise ValueError(f"rule must be a file and its function, FILE.py:FUNCTION, found {rule!r}")
    if out is not None and not force:  # before a minute of work
        refuse_others({out / file: None for file in FILES})
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        found = benchmark(RuleOfFile(path.resolve(), function), name, model, plants or None, pool)
    click.echo(str(found))
    if out is not None:
        write(out, dict(zip(FILES, _texts(found), strict=True)), force)


def _texts(found: Benchmark) -> tuple[str, str, str]:
    """Return rows, table and figure as the texts of files."""
    figure = io.StringIO()
    found.plot().savefig(figure, format="svg")
    with tempfile.TemporaryDirectory() as folder:
        rows = found.csv(Path(folder, "rows.csv")).read_text(encoding="utf-8")
    return rows, found.latex(), figure.getvalue()
