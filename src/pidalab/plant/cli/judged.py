"""The command that judges a rule of the user on many plants."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from pidalab._names import STARTING_MODELS
from pidalab.plant.cli.parts import one_line


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
@click.option("--workers", default=2, help="Processes side by side.")
@click.option("--out", type=click.Path(path_type=Path), help="Folder for figure, CSV and LaTeX table.")
@one_line
def benchmark_command(
    rule: str, name: str | None, model: str, plants: tuple[str, ...], workers: int, out: Path | None
) -> None:
    """Judge a rule of your own on 134 plants, beside all rules and the best there is: about a minute.

    The function takes a process and returns a controller. The file is run: it is your code.

    \b
    Example, with "import pidalab; def tune(p): return pidalab.rules.classical.simc(p, 'PI')" in rule.py:
      pidalab benchmark rule.py:tune --model first_order --out folder
    """
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    from pidalab.comparison.benchmarking import benchmark

    file, _, function = rule.rpartition(":")
    path = Path(file)
    if not function.isidentifier() or not path.is_file():
        raise ValueError(f"rule must be a file and its function, FILE.py:FUNCTION, found {rule!r}")
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        found = benchmark(RuleOfFile(path.resolve(), function), name, model, plants or None, pool)
    click.echo(str(found))
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        found.csv(out / "benchmark.csv")
        (out / "benchmark.tex").write_text(found.latex(), encoding="utf-8")
        found.plot().savefig(out / "benchmark.svg")
        click.echo(f"figure, rows and a table for a paper: {out}")
