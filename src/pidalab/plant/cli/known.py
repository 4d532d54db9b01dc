"""Commands for a known plant: compare all rules, simulate one loop, benchmark a rule of your own."""

from __future__ import annotations

import functools
import io
import math
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import click

import pidalab
from pidalab._text import STARTING_MODELS, set_out
from pidalab.plant.cli import dialogue

DEFAULT_SAMPLES = 2000  # samples of a response with a continuous controller
MOST_DIGITAL_SAMPLES = 1e7  # more samples would exhaust the memory
FILES = ("benchmark.csv", "benchmark.tex", "benchmark.svg")


@dialogue.main.command("compare")
@dialogue.plant
@dialogue.ms
@click.option("--noise-gain", type=float, help="Limit of the noise gain; default: relative noise gain 1.5.")
@click.option("--sample-time", type=float, help="Sample time of the noise; default: ultimate period / 100.")
@click.option("--rule", "rules", multiple=True, help="A rule by name, or 'optimal'; may be repeated.")
def compare_command(
    num: list[float], den: list[float], delay: float, rules: tuple[str, ...], **limits: float
) -> None:
    """Apply every rule of the library to a plant and compare the designs with the optima.

    \b
    Examples:
      pidalab compare --num 1 --den 1,3,3,1 --delay 1
      pidalab compare --den 1,3,3,1 --delay 1 --rule simc --rule optimal
    """
    click.echo(str(pidalab.compare(pidalab.Process(num, den, delay), **limits, rules=rules or None)))


@dialogue.main.command("rules")
def rules_command() -> None:
    """List the rules by name, with the kinds of controllers that they make and their sources."""
    from pidalab.rules.registry import RULES

    for rule in RULES.values():
        click.echo(set_out([rule.name, ", ".join(rule.kinds), rule.source], (27, 15, 0), left=3))


@dialogue.main.command("rule")
@click.argument("relay", required=False, type=dialogue.EXISTING)
@click.option("--ku", type=float, help="Ultimate gain, in units of u per unit of y.")
@click.option("--tu", type=float, help="Ultimate period. The times in the output have its unit.")
@dialogue.columns
def rule_command(relay: Path | None, ku: float | None, tu: float | None, **columns: str | int | None) -> None:
    """List the gains that rules give for an ultimate gain and period, or for a RELAY record.

    The Ms of each controller is listed for simple models with this ultimate gain and period.

    \b
    Examples:
      pidalab rule --ku 250 --tu 7200
      pidalab rule relay.csv --time time --u heater --y temperature
    """
    from pidalab.plant.record.reading import read_columns
    from pidalab.plant.ultimate import models_of, relay_oscillation, rule_table

    if relay is not None and ku is None and tu is None:
        wave = relay_oscillation(*read_columns(relay, columns).values)
        ku, tu = wave.ku, wave.tu
        click.echo(str(wave))
    elif relay is not None or ku is None or tu is None:
        raise click.UsageError("give --ku and --tu, or a RELAY record")
    widths = (18, 5, 11, 11, 11, *[18] * 4)
    click.echo(set_out(["rule", "kind", "kp", "ti", "td", *(f"Ms {x}" for x in models_of(ku, tu))], widths))
    for rule, kind, k, sizes in rule_table(ku, tu):
        values = ["unstable" if math.isinf(value) else f"{value:.2f}" for value in sizes]
        click.echo(set_out([rule, kind, f"{k.kp:.4g}", f"{k.ti:.4g}", f"{k.td:.4g}", *values], widths))


@dialogue.main.command("simulate")
@dialogue.plant
@click.option("--kp", type=float, help="Gain.")
@click.option("--ti", default=math.inf, help="Integral time; default: no integral action.")
@dialogue.times
@click.option("--controller", type=dialogue.EXISTING, help="A controller.json in place of gains.")
@click.option("--until", type=dialogue.ABOVE, required=True, help="End of the simulation.")
@click.option("--setpoint", default=1.0, help="Step of the set point at 0.")
@click.option("--load", default=0.0, help="Step of the load at 0.")
@click.option("--sample-time", type=float, help="Sample time of a digital controller. Default: continuous.")
@dialogue.limits
@click.option("--out", type=dialogue.OUT_FILE, help="CSV file for t, r, y, u.")
@dialogue.force
def simulate_command(
    num: list[float], den: list[float], delay: float, out: Path | None, force: bool, **options: Any
) -> None:
    """Simulate a loop from rest, with its exact dead time, and print margins and measures.

    Signals and limits are relative to the state of rest. If you give a controller.json, the state of rest is the
    working point in the file.

    \b
    Examples:
      pidalab simulate --den 1,3,3,1 --delay 1 --kp 1.3 --ti 3 --td 1 --ta 0.3 --until 40 --out response.csv
      pidalab simulate --num 2.3 --den 360,198,29,1 --delay 8 --controller folder/controller.json --until 200
    """
    import numpy as np

    loop = pidalab.Loop(pidalab.Process(num, den, delay), _controller(options))
    response = _response(loop, **{x: options[x] for x in ("until", "setpoint", "load", "u_min", "u_max")})
    margins, measures = str(pidalab.margins(loop)), _measures(response)
    dialogue.show([("Loop", repr(loop)), ("Margins", margins), ("Measures", measures)])
    if out is not None:
        text, columns = io.StringIO(), [response.t, response.r, response.y, response.u]
        rows = np.column_stack(columns)
        np.savetxt(text, rows, fmt="%.10g", delimiter=",", header="t,r,y,u", comments="")
        dialogue.write(out.parent, {out.name: text.getvalue()}, force)


def _controller(options: dict[str, Any]) -> Any:
    file, h = options["controller"], options["sample_time"]
    if file is None:
        if options["kp"] is None:
            raise click.UsageError("give --kp (and times such as --ti), or --controller")
        k = pidalab.PIDA(**{name: options[name] for name in dialogue.GAINS})
        return k if h is None else k.discretise(h)
    source = click.get_current_context().get_parameter_source
    names = (*dialogue.GAINS, "sample_time")
    given = [x for x in names if source(x) is click.core.ParameterSource.COMMANDLINE]
    if given:
        said = " and ".join(f"--{name.replace('_', '-')}" for name in given)
        raise click.UsageError(f"--controller has its own gains and sample time: leave out {said}")
    try:  # an editor may have added a byte order mark
        return pidalab.digital.from_json(file.read_text(encoding="utf-8-sig"))
    except ValueError as refusal:
        raise ValueError(f"--controller {file}: {refusal}") from None


def _response(loop: pidalab.Loop, until: float, u_min: float, u_max: float, **steps: Any) -> pidalab.Response:
    import numpy as np

    if loop.digital is None:
        if math.isfinite(u_min) or math.isfinite(u_max):
            raise click.UsageError(
                "--u-min and --u-max are limits of a digital controller: give --sample-time"
            )
        return pidalab.simulate(loop, np.linspace(0.0, until, DEFAULT_SAMPLES + 1), **steps)
    h = loop.digital.sample_time
    if not until / h <= MOST_DIGITAL_SAMPLES:
        raise click.UsageError(
            f"--until must be at most {MOST_DIGITAL_SAMPLES:g} samples of {h:g}, found {until:g}"
        )
    t = h * np.arange(max(2, round(until / h) + 1))
    return pidalab.simulate_sampled(loop, t, limits=(u_min, u_max), **steps)


def _measures(response: pidalab.Response) -> str:
    end = float(response.t[-1])  # the loop may diverge, so every measure ends with the simulation
    lines = [
        f"IAE {response.iae(end):.6g}, ITAE {response.itae(end):.6g}, ISE {response.ise(end):.6g}, until {end:g}",
        f"total variation of u {response.tv('u', end):.6g}, largest |u| {abs(response.peak('u', end)):.6g}, "
        f"largest |y| {abs(response.peak('y', end)):.6g}",
        f"output at the end {response.y[-1]:.6g}, control signal {response.u[-1]:.6g}",
    ]
    overshoot, settling = "no overshoot until the end", "not settled to 2 % at the end"
    with suppress(ValueError):
        overshoot = f"overshoot {response.overshoot():.4g} %"
    with suppress(ValueError):
        settling = f"settling time (2 %) {response.settling_time(0.02):.6g}"
    return "\n".join([*lines, f"{overshoot}, {settling}"] if response.r[-1] != 0 else lines)


@functools.cache
def _function(path: Path, name: str) -> Callable[[Any], Any]:
    """Run a Python file and return one of its functions."""
    import runpy

    function = runpy.run_path(str(path)).get(name)
    if not callable(function):
        raise TypeError(f"rule must be a function of {path.name}, found no {name!r} there")
    return function


def _apply(path: Path, name: str, process: Any) -> Any:
    """Call a function of a file. Each process of the pool runs the file only once."""
    return _function(path, name)(process)


@dialogue.main.command("benchmark")
@click.argument("rule", metavar="FILE.py:FUNCTION")
@click.option("--name", help="Name of the rule in tables; default: its function's name.")
@click.option("--model", type=click.Choice(STARTING_MODELS), default="process", help="Model for the rule.")
@click.option("--plant", "plants", multiple=True, help="One plant, such as 'P2 T=1'; may be repeated.")
@click.option("--workers", default=2, type=click.IntRange(1), help="Processes in parallel.")
@dialogue.out
def benchmark_command(rule: str, out: Path | None, force: bool, **options: Any) -> None:
    """Rank a rule of your own among all rules and the optima, for 134 plants, in about a minute.

    The function takes a process and returns a controller. The command runs the file, so use only code that you
    trust. With --out the command also writes the rows as CSV, the ranking as a LaTeX table, and a figure.

    \b
    Example, with "import pidalab; def tune(p): return pidalab.rules.classical.simc(p, 'PI')" in rule.py:
      pidalab benchmark rule.py:tune --model first_order --out folder
    """
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    from pidalab.plant.writing import refuse_others

    file, _, function = rule.rpartition(":")
    path = Path(file)
    if not function.isidentifier() or not path.is_file():
        raise ValueError(f"rule must be a file and its function, FILE.py:FUNCTION, found {rule!r}")
    if out is not None and not force:  # raise the error before the benchmark, which takes a minute
        refuse_others({out / file: None for file in FILES})
    apply = functools.partial(_apply, path.resolve(), function)
    name, plants = options["name"] or function, options["plants"] or None
    with ProcessPoolExecutor(options["workers"], multiprocessing.get_context("spawn")) as pool:
        ranking = pidalab.benchmark(apply, name, options["model"], plants, pool)
    click.echo(str(ranking))
    if out is not None:
        figure = io.StringIO()
        ranking.plot().savefig(figure, format="svg")
        texts = (ranking.csv(), ranking.latex(), figure.getvalue())
        dialogue.write(out, dict(zip(FILES, texts, strict=True)), force)
