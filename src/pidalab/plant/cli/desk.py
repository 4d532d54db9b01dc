"""The command for the Temperature Control Lab."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from pidalab._names import KINDS
from pidalab._table import set_out
from pidalab.plant.cli.parts import csv_of, ms, one_line, out, show, write

if TYPE_CHECKING:
    from pidalab.response import Response

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
