"""Commands that start from a plant record: three candidates side by side, or one with its code."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pidalab._text import KINDS, plain_text
from pidalab.plant.cli.dialogue import (
    Place,
    add_options,
    column,
    force,
    limits,
    ms,
    ms_worst,
    one_line,
    out,
    show,
    times,
    write,
)

if TYPE_CHECKING:
    from pidalab.controllers import PIDA
    from pidalab.plant.checking import Check
    from pidalab.plant.record import Record
    from pidalab.rules import Design

MODEL_WORDS = ("auto", "fopdt", "sopdt", "lags", "ipdt", "ifopdt", "sopdtz")
ANTI_WINDUP_WORDS = ("reset", "back-calculation", "clamping", "none")
WEIGHT = click.FloatRange(0.0, 1.0)  # of a set point: beyond 1 it would be another one
READING = ("time", "u", "y", "period", "delimiter", "skip", "step", "u_before", "outliers", "run")
CODE = {
    "controller.c": "c",
    "controller.st": "structured_text",
    "controller.py": "python",
    "controller.json": "json",
}


record = add_options(
    click.argument("record", type=click.Path(exists=True, dir_okay=False, path_type=Path)),
    click.option("--time", default="0", callback=column, help="Its name, or its number from 0."),
    click.option("--u", default="1", callback=column, help="Column of the plant's input."),
    click.option("--y", default="2", callback=column, help="Column of the measured output."),
    click.option("--period", type=float, help="Time from sample to sample, for a file without times."),
    click.option("--delimiter", help="Between the columns, such as ';' or '\\s+'; by default found out."),
    click.option("--skip", default=0, help="Lines to leave out at the beginning."),
    click.option("--step", type=float, help="Time of the step that matters, if there are several."),
    click.option("--u-before", type=float, help="Input before the record, if that begins with its step."),
    click.option(
        "--outliers",
        type=click.Choice(["drop", "keep"]),
        help="What becomes of outputs far from their neighbours.",
    ),
    click.option("--run", type=int, help="Which of several runs, from 1, where the time restarts."),
    click.option("--model", default="auto", type=click.Choice(MODEL_WORDS), help="Model to fit."),
)
design = add_options(
    click.option("--rule", default="optimal", help="The optimum, or a rule of 'pidalab rules' by its name."),
    ms,
    ms_worst,
    click.option(
        "--noise-gain", type=float, help="Largest gain from noise to u; by default from the record."
    ),
    click.option(
        "--spread", type=float, help="Share by which the model may be wrong; by default from the record."
    ),
    click.option(
        "--sample-time", type=float, required=True, help="Of the controller, in the record's unit of time."
    ),
)


@click.command("report")
@record
@design
@click.option("--trade-off", is_flag=True, help="Also the least error over the noise, at two limits of Ms.")
@click.option("--out", type=Place(dir_okay=False), help="HTML file to write.")
@force
@one_line
def report_command(out: Path | None, force: bool, model: str, trade_off: bool, **options: Any) -> None:
    """Set PI, PID and PIDA for the plant of a RECORD side by side, with the same limits.

    \b
    Example:
      pidalab report step.csv --time time --u valve --y level --sample-time 0.2 --out report.html
    """
    from pidalab.plant.fitting import fit
    from pidalab.plant.reporting import report

    name = plain_text(options["record"].name)
    read = read_record(options)
    found = report(fit(read, model), **options)
    sections, traded = [("Record", str(read)), ("Model", str(found.fit)), ("Candidates", str(found))], None
    if trade_off:
        from pidalab.plant.noise_curves import trade_off as find_trade_off

        traded = find_trade_off(found.process, sample_time=options["sample_time"])
        sections.append(("Trade-off", str(traded)))
    show(sections)
    if out is not None:
        write(out.parent, {out.name: found.page(f"PI, PID and PIDA for {name}", traded=traded)}, force)


@click.command("tune")
@record
@click.option("--kind", default="PIDA", type=click.Choice(KINDS))
@design
@limits
@click.option(
    "--b",
    type=WEIGHT,
    show_default="0.5, or 1 with a prefilter or automatic reset",
    help="Weight of the set point in the proportional part.",
)
@click.option(
    "--c",
    type=WEIGHT,
    show_default="0, or 1 with a prefilter or automatic reset",
    help="Weight of the set point in the derivatives.",
)
@click.option(
    "--rate-limit",
    type=click.FloatRange(0.0, min_open=True),
    default=math.inf,
    help="Largest change of u in a unit of time.",
)
@click.option(
    "--deadband",
    type=click.FloatRange(0.0),
    default=0.0,
    help="Error, in units of y, that counts as none.",
)
@click.option(
    "--anti-windup",
    type=click.Choice(ANTI_WINDUP_WORDS),
    show_default="reset; without proportional action clamping",
    help="What a limit does to the integral.",
)
@click.option("--float", "single", is_flag=True, help="C in single precision.")
@click.option("--feedforward", is_flag=True, help="Code with an input that is added to the signal.")
@click.option(
    "--tunable", is_flag=True, help="Code with gains that may change while it runs, without a bump."
)
@click.option(
    "--full-output",
    type=float,
    help="u at full power: prints the gains as Klipper and Betaflight write them, too.",
)
@out
@one_line
def tune_command(
    out: Path | None,
    model: str,
    kind: str,
    u_min: float,
    u_max: float,
    b: float | None,
    c: float | None,
    rate_limit: float,
    deadband: float,
    anti_windup: str | None,
    single: bool,
    feedforward: bool,
    tunable: bool,
    full_output: float | None,
    force: bool,
    **options: Any,
) -> None:
    """Tune a controller from a plant RECORD, a text file with an input that moves: a step, best from rest.

    Prints the model, the controller, margins and doubts; with --out also writes controller.c, controller.st,
    controller.py, controller.json and report.html.

    \b
    Example:
      pidalab tune step.csv --time time --u valve --y level --kind PIDA --ms 1.6 --sample-time 0.2 --out folder
    """
    from pidalab import _check
    from pidalab.loop import Loop
    from pidalab.plant.fitting import fit
    from pidalab.plant.reporting import REPORT_COLUMNS, report
    from pidalab.robustness.margins import margins

    called = options["record"].name
    title = f"{kind} controller for {plain_text(called)}"
    if full_output is not None and not _check.real("--full-output", full_output):
        raise ValueError("--full-output must not be 0: it is u at full power")
    read = read_record(options)
    # the working point of the record: model and controller count from there
    rest = float(read.steps[0].before) if read.steps else read.u_before
    if not u_min <= rest <= u_max or u_min == u_max:
        raise ValueError(
            f"--u-min and --u-max must be limits with u of the record at rest, {rest:g}, between them, found "
            f"{u_min:g} and {u_max:g}"
        )
    fitted = fit(read, model)
    found = report(fitted, kinds=kind, **options)
    design, sample_time = found.rows[0].design, options["sample_time"]
    assert design is not None
    # a prefilter shapes the set point already, and automatic reset is written as such with both weights 1
    shaped = design.prefilter is not None or design.controller.automatic_reset() is not None
    usual = (1.0, 1.0) if shaped else (0.5, 0.0)
    further: dict[str, Any] = {
        "b": usual[0] if b is None else b,
        "c": usual[1] if c is None else c,
        "rate_limit": rate_limit,
        "deadband": deadband,
        "feedforward": feedforward,
        "tunable": tunable,
    }
    if anti_windup is not None:
        further["anti_windup"] = anti_windup
    digital = design.discretise(
        sample_time, "backward", limits=(u_min, u_max), bias=rest, y_offset=read.rest, **further
    )
    sampled = margins(Loop(fitted.process, digital))
    doubts = [*fitted.doubts, *design.doubts, *_no_limits(u_min, u_max)]
    sections = [
        ("Record", str(read)),
        ("Model", f"{fitted.process!r}\n{fitted}"),
        ("Controller", f"{design.controller}\n{_vendors(design, full_output)}"),
        ("Margins, continuous", str(margins(design.loop(fitted.process)))),
        (f"Margins, sampled every {sample_time:g}", str(sampled)),
        (
            "Expected",
            "\n".join(f"{name}: {getattr(found.rows[0], x):.4g}" for name, x in REPORT_COLUMNS.items()),
        ),
        ("Doubts", "\n".join(doubts) or "none found"),
    ]
    show(sections)
    if out is None:
        return
    note = "\n".join(f"Doubt: {doubt}" for doubt in (*read.doubts, *doubts))
    head = {
        "record": called,
        "time_unit": "unit of the record",
    }
    texts = {
        name: getattr(digital, language)(margins=sampled, note=note, **head)
        for name, language in CODE.items()
    }
    if single:
        texts["controller.c"] = digital.c(precision="single", margins=sampled, note=note, **head)
    write(out, texts | {"report.html": found.page(title, sections)}, force)


def read_record(options: dict[str, Any]) -> Record:
    """Read the record, and take what says how out of the options."""
    from pidalab.plant.record import Record

    path = options.pop("record")
    return Record.read_csv(path, **{name: options.pop(name) for name in READING})


def _no_limits(low: float, high: float) -> list[str]:
    """Say which limits of u are missing."""
    lacking = [name for name, limit in (("--u-min", low), ("--u-max", high)) if math.isinf(limit)]
    if not lacking:
        return []
    return [
        f"{' and '.join(lacking)} not given: the code does not know where the actuator ends, and may wind up"
    ]


def _vendors(design: Design, full_output: float | None) -> str:
    """Return the parameters of vendor blocks, or why there are none."""
    try:
        return f"as vendor blocks, if the record's unit of time is the second:\n{design.vendor_forms('s', full_output)}"
    except ValueError as refusal:
        return f"no vendor block: {refusal}"


FIRMWARE_NAMES = ("klipper", "betaflight", "betaflight-yaw")


@click.command("check")
@record
@click.option(
    "--kp", type=float, required=True, help="Gain, in units of u per unit of y; or P of a firmware."
)
@click.option("--ti", type=float, help="Integral time, in the log's unit of time.")
@times
@click.option(
    "--firmware",
    type=click.Choice(FIRMWARE_NAMES),
    help="The gains are its numbers --kp, --ki, --kd, in place of times; the log is in seconds.",
)
@click.option("--ki", type=float, help="I of that firmware.")
@click.option("--kd", default=0.0, help="D of that firmware.")
@click.option("--full-output", default=1.0, help="u of the log at full power of that firmware.")
@click.option("--filter", "lag", default=0.0, help="Time constant of the measurement's filter.")
@click.option("--sample-time", type=float, help="Of the controller; by default that of the log.")
@ms_worst
@one_line
def check_command(
    model: str,
    lag: float,
    sample_time: float | None,
    ms_worst: float,
    firmware: str | None,
    full_output: float,
    **options: Any,
) -> None:
    """Judge the gains of a running loop by a log of it, the RECORD.

    Changes of the set point, a step of the load or a bump of u show the plant. Prints the Ms of the loop with its
    interval, what the gains miss, and three sets to try.

    \b
    Examples:
      pidalab check log.csv --time time --u valve --y level --kp 0.6 --ti 12 --sample-time 0.5
      pidalab check hotend.csv --firmware klipper --kp 22.2 --ki 1.08 --kd 114 --sample-time 0.3
    """
    import control

    from pidalab import _check
    from pidalab.plant.checking import check
    from pidalab.plant.fitting import fit

    read = read_record(options)
    lags = control.TransferFunction([1.0], [lag, 1.0]) if _check.real("--filter", lag, at_least=0.0) else None
    running = _running(firmware, full_output, **options)
    found = check(
        read if model == "auto" else fit(read, model),
        running,
        output_filter=lags,
        sample_time=sample_time,
        ms_worst=ms_worst,
    )
    sections = [("Log", str(read)), ("Model", f"{found.fit.process!r}\n{found.fit}"), ("Gains", str(found))]
    if firmware is not None:
        sections.append((f"The sets as {firmware} writes them", _as_firmware(found, firmware, full_output)))
    show(sections)


def _running(
    firmware: str | None,
    full_output: float,
    kp: float,
    ti: float | None,
    ki: float | None,
    kd: float,
    **times: float,
) -> PIDA:
    """Return the controller that runs, of times or of the numbers of a firmware."""
    from pidalab.controllers import PIDA

    if firmware is None and ti is not None and ki is None and not kd:
        return PIDA(kp, ti, **times)
    if firmware is not None and ki is not None and ti is None and not times["td"] and not times["ta"]:
        return PIDA.from_firmware(firmware, kp, ki, kd, full_output)
    raise click.UsageError(
        "give --kp, --ti and perhaps --td and --ta, or --firmware with --kp, --ki and perhaps --kd"
    )


def _as_firmware(found: Check, firmware: str, full_output: float) -> str:
    """Return the sets to try as the three numbers of a firmware, which has no acceleration."""
    from pidalab.plant.vendor import firmware_form

    lines = []
    for row in found.rows:
        if row.design is not None and not row.design.controller.gains().ka:
            form = firmware_form(row.design.controller.gains(), firmware, full_output)
            lines.append(
                f"{row.rule:14} {', '.join(f'{name} = {value:.4g}' for name, value in form.items())}"
            )
    return "\n".join(lines)
