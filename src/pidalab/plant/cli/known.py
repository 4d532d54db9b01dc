"""Commands for a plant that is known: every rule on it, or one loop."""

from __future__ import annotations

import io
import math
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pidalab._text import KINDS, STARTING_MODELS, set_out
from pidalab.plant.cli.dialogue import (
    Place,
    column,
    csv_of,
    force,
    limits,
    ms,
    one_line,
    out,
    plant,
    show,
    times,
    write,
)

if TYPE_CHECKING:
    from pidalab.comparison.benchmarking import Benchmark
    from pidalab.loop import Loop
    from pidalab.response import Response

DEFAULT_SAMPLES = 2000  # of a response of a continuous controller
MOST_DIGITAL_SAMPLES = 1e7  # of a digital one: more would fill the memory


@click.command("compare")
@plant
@ms
@click.option(
    "--noise-gain", type=float, help="Largest noise gain of the optima; by default a relative one of 1.5."
)
@click.option(
    "--sample-time", type=float, help="Sample time of that noise; by default the ultimate period over 100."
)
@click.option(
    "--rule",
    "rules",
    multiple=True,
    help="A rule by its name, or 'optimal'; may be repeated. 'pidalab rules' lists them.",
)
@one_line
def compare_command(
    num: list[float], den: list[float], delay: float, rules: tuple[str, ...], **limits: float
) -> None:
    """Judge the rules of the library on a plant, beside the optima.

    \b
    Examples:
      pidalab compare --num 1 --den 1,3,3,1 --delay 1
      pidalab compare --den 1,3,3,1 --delay 1 --rule simc --rule optimal
    """
    from pidalab.comparison import compare
    from pidalab.process import Process

    click.echo(str(compare(Process(num, den, delay), **limits, rules=rules or None)))


@click.command("rules")
def rules_command() -> None:
    """List the rules by name, with the kinds of controllers that they make and their sources."""
    from pidalab.rules.registry import RULES

    for rule in RULES.values():
        click.echo(set_out([rule.name, ", ".join(rule.kinds), rule.source], (27, 15, 0), left=3))


@click.command("rule")
@click.argument("relay", required=False, type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--ku", type=float, help="Ultimate gain, in units of u per unit of y.")
@click.option("--tu", type=float, help="Ultimate period; every time is in its unit.")
@click.option(
    "--time", default="0", callback=column, help="Column of a RELAY record: name, or number from 0."
)
@click.option("--u", default="1", callback=column, help="Column of the relay's output.")
@click.option("--y", default="2", callback=column, help="Column of the measured output.")
@one_line
def rule_command(
    relay: Path | None, ku: float | None, tu: float | None, time: str | int, u: str | int, y: str | int
) -> None:
    """List what rules make of an ultimate gain and period, or of a RELAY record, and their Ms on models that fit.

    \b
    Examples:
      pidalab rule --ku 250 --tu 7200
      pidalab rule relay.csv --time time --u heater --y temperature
    """
    from pidalab.plant.record.reading import read_columns
    from pidalab.plant.ultimate import models_of, relay_oscillation, rule_table

    lines = []
    if relay is not None and ku is None and tu is None:
        wave = relay_oscillation(*read_columns(relay, [time, u, y]).values)
        ku, tu = wave.ku, wave.tu
        lines = [
            f"oscillation over {wave.cycles} cycles: amplitude {wave.amplitude:.4g}, period {tu:.5g}, u at its upper "
            f"level for {100 * wave.bias:.0f} % of the time; ultimate gain {ku:.4g}",
            *(f"doubt: {said}" for said in wave.doubts),
        ]
    elif relay is not None or ku is None or tu is None:
        raise click.UsageError("give --ku and --tu, or a RELAY record")
    widths = (18, 5, 11, 11, 11, *[18] * 4)
    lines.append(
        set_out(["rule", "kind", "kp", "ti", "td", *(f"Ms {name}" for name in models_of(ku, tu))], widths)
    )
    for rule, kind, k, sizes in rule_table(ku, tu):
        values = ["unstable" if math.isinf(value) else f"{value:.2f}" for value in sizes]
        lines.append(set_out([rule, kind, f"{k.kp:.4g}", f"{k.ti:.4g}", f"{k.td:.4g}", *values], widths))
    click.echo("\n".join(lines))


@click.command("simulate")
@plant
@click.option("--kp", type=float, help="Gain.")
@click.option("--ti", default=math.inf, help="Integral time; by default no integral action.")
@times
@click.option(
    "--controller",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="A controller.json of 'pidalab tune', in place of gains.",
)
@click.option("--until", type=float, required=True, help="End of the simulation.")
@click.option("--setpoint", default=1.0, help="Step of the set point at 0.")
@click.option("--load", default=0.0, help="Step of the load at 0.")
@click.option(
    "--sample-time", type=float, help="Of a digital controller, by backward differences; without, continuous."
)
@limits
@click.option("--out", type=Place(dir_okay=False), help="CSV file for t, r, y, u.")
@force
@one_line
def simulate_command(
    num: list[float],
    den: list[float],
    delay: float,
    until: float,
    out: Path | None,
    force: bool,
    **options: Any,
) -> None:
    """Simulate a loop from rest, its dead time exact, and print margins and measures.

    Signals and limits count from the state of rest, but for those of a controller.json, which has its own working
    point.

    \b
    Examples:
      pidalab simulate --den 1,3,3,1 --delay 1 --kp 1.3 --ti 3 --td 1 --ta 0.3 --until 40 --out response.csv
      pidalab simulate --num 2.3 --den 360,198,29,1 --delay 8 --controller folder/controller.json --until 200
    """
    from pidalab.process import Process
    from pidalab.robustness.margins import margins

    loop = _loop(Process(num, den, delay), **{name: options[name] for name in _CONTROLLER})
    response = _response(loop, until, *(options[name] for name in ("setpoint", "load", "u_min", "u_max")))
    show([("Loop", repr(loop)), ("Margins", str(margins(loop))), ("Measures", _measures(response))])
    if out is not None:
        text = csv_of({name: getattr(response, name) for name in ("t", "r", "y", "u")})
        write(out.parent, {out.name: text}, force)


_CONTROLLER = ("controller", "kp", "ti", "td", "ta", "n", "m", "sample_time")


def _loop(
    process: Any, controller: Path | None, kp: float | None, sample_time: float | None, **times: float
) -> Loop:
    from pidalab.controllers import PIDA
    from pidalab.digital import from_json
    from pidalab.loop import Loop

    if controller is not None:
        if also := [name for name in _CONTROLLER[1:] if _is_given(name)]:
            options = " and ".join(f"--{name.replace('_', '-')}" for name in also)
            raise click.UsageError(f"--controller has its own gains and sample time: leave out {options}")
        try:  # an editor may have put a byte order mark before the text
            return Loop(process, from_json(controller.read_text(encoding="utf-8-sig")))
        except ValueError as refusal:
            raise ValueError(f"--controller {controller}: {refusal}") from None
    if kp is None:
        raise click.UsageError("give --kp and its times, or --controller")
    own = PIDA(kp, **times)
    return Loop(process, own if sample_time is None else own.discretise(sample_time))


def _is_given(option: str) -> bool:
    """Whether an option is on the command line."""
    source = click.get_current_context().get_parameter_source(option)
    return source is click.core.ParameterSource.COMMANDLINE


def _response(loop: Loop, until: float, setpoint: float, load: float, low: float, high: float) -> Response:
    import numpy as np

    from pidalab import _check
    from pidalab.simulation.exact import simulate
    from pidalab.simulation.sampled import simulate_sampled

    until = _check.real("--until", until, above=0.0)
    if loop.digital is None:
        if math.isfinite(low) or math.isfinite(high):
            raise click.UsageError(
                "--u-min and --u-max are limits of a digital controller: give --sample-time"
            )
        return simulate(loop, np.linspace(0.0, until, DEFAULT_SAMPLES + 1), setpoint=setpoint, load=load)
    h = loop.digital.sample_time
    if not until / h <= MOST_DIGITAL_SAMPLES:
        raise click.UsageError(
            f"--until must be at most {MOST_DIGITAL_SAMPLES:g} samples of {h:g}, found {until:g}"
        )
    t = h * np.arange(max(2, round(until / h) + 1))
    return simulate_sampled(loop, t, setpoint=setpoint, load=load, limits=(low, high))


def _measures(response: Response) -> str:
    end = float(response.t[-1])  # that of a loop which may diverge, as the lines say
    lines = [
        f"IAE {response.iae(end):.6g}, ITAE {response.itae(end):.6g}, ISE {response.ise(end):.6g}, until {end:g}",
        f"total variation of u {response.tv('u', end):.6g}, largest |u| {abs(response.peak('u', end)):.6g}, "
        f"largest |y| {abs(response.peak('y', end)):.6g}",
        f"output at the end {response.y[-1]:.6g}, control signal {response.u[-1]:.6g}",
    ]
    if response.r[-1] != 0:
        lines.append(f"{_overshoot(response)}, {_settling(response)}")
    return "\n".join(lines)


def _overshoot(response: Response) -> str:
    try:
        return f"overshoot {response.overshoot():.4g} %"
    except ValueError:
        return "no overshoot to be read up to the end"


def _settling(response: Response) -> str:
    try:
        return f"settling time (2 %) {response.settling_time(0.02):.6g}"
    except ValueError:
        return "not settled to 2 % at the end"


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


POWER_RANGE = (0.0, 100.0)
POWER = click.FloatRange(*POWER_RANGE)  # of a heater, in per cent


@click.command("tclab")
@click.option("--connected", is_flag=True, help="Use the board at a serial port; by default it is simulated.")
@click.option("--power", default=50.0, type=POWER, help="Power of the step test, in per cent.")
@click.option("--setpoint", default=40.0, help="Set point of the closed loops, in degrees.")
@click.option("--load", default=60.0, type=POWER, help="Power of the second heater, the load, in per cent.")
@click.option("--duration", default=900.0, help="Seconds of each part of the experiment.")
@click.option("--cooling", default=1200.0, help="Seconds without heat before each run at the board.")
@click.option("--sample-time", default=1.0, help="Of the controllers, in seconds.")
@ms
@out
@one_line
def tclab_command(
    connected: bool,
    power: float,
    setpoint: float,
    load: float,
    duration: float,
    cooling: float,
    sample_time: float,
    ms: float,
    out: Path | None,
    force: bool,
) -> None:
    """Step test, model, PI, PID and PIDA, and their loops on a Temperature Control Lab.

    Each loop goes to the set point, and after the duration meets the second heater. At the board the whole takes about
    three hours by default; the heaters are turned off at the end, also after Ctrl-C.

    \b
    Examples:
      pidalab tclab
      pidalab tclab --connected --out experiment
    """
    import numpy as np

    from pidalab import _check
    from pidalab.plant.heater import Lab
    from pidalab.plant.reporting import report
    from pidalab.plant.writing import refuse_others

    # before an experiment of hours
    _check.real("--setpoint", setpoint)
    _check.real("--cooling", cooling, above=0.0)
    _check.real("--ms", ms, above=1.0)
    if out is not None and not force:
        refuse_others({out / name: None for name in ("report.html", *(f"{kind}.csv" for kind in KINDS))})
    with Lab(connected) as lab:
        record = lab.step_test(power, duration, sample_time=sample_time)
    found = report(record, ms=ms, sample_time=sample_time)
    show([("Record", str(record)), ("Model", str(found.fit)), ("Candidates", str(found))])
    t = sample_time * np.arange(round(2 * duration / sample_time) + 1)
    disturbance = np.where(t < duration, 0.0, load)
    runs = {}
    for row in found.rows:
        if row.design is None:
            continue
        with Lab(connected) as lab:
            if connected:
                lab.hold(0.0, cooling)
            k = row.design.discretise(sample_time, limits=POWER_RANGE)
            runs[row.kind] = lab.closed_loop(k, setpoint, 2 * duration, disturbance)
    where = "at the board" if connected else "simulated"
    show([(f"Closed loops, {where}, after heater 2 went to {load:g} %", _table(runs, duration))])
    if out is not None:
        texts = {"report.html": found.page("Temperature Control Lab")}
        for kind, run in runs.items():
            signals = {
                "t": run.t,
                "setpoint": run.r,
                "heater 2": run.d,
                "temperature": run.y,
                "heater 1": run.u,
            }
            texts[f"{kind}.csv"] = csv_of(signals)
        write(out, texts, force)


def _table(runs: dict[str, Response], start: float) -> str:
    widths = (5, 10, 10)
    lines = [set_out(["", "IAE", "TV of u"], widths)]
    for kind, run in runs.items():
        after = run.between(start, float(run.t[-1]))
        lines.append(set_out([kind, f"{after.iae():.4g}", f"{after.tv('u'):.4g}"], widths))
    return "\n".join(lines)
