"""Commands that start from a record of a plant: three candidates, one with its code, or gains that already run."""

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
    progress,
    show,
    times,
    write,
)
from pidalab.plant.doubts import doubt

if TYPE_CHECKING:
    from pidalab.controllers import PIDA
    from pidalab.plant.checking import Check
    from pidalab.plant.fitting import Fit
    from pidalab.plant.record import Record
    from pidalab.rules import Design

MODEL_WORDS = ("auto", "fopdt", "sopdt", "lags", "ipdt", "ifopdt", "sopdtz")
ANTI_WINDUP_WORDS = ("reset", "back-calculation", "clamping", "none")
WEIGHT = click.FloatRange(0.0, 1.0)  # of a set point: beyond 1 it would be another one
ABOVE = click.FloatRange(0.0, min_open=True)
READING = ("time", "u", "y", "period", "delimiter", "skip", "step", "u_before", "outliers", "run")
TUNING = ("rule", "ms", "ms_worst", "noise_gain", "spread", "sample_time")
CODE = {
    "controller.c": "c",
    "controller.st": "structured_text",
    "controller.py": "python",
    "controller.json": "json",
}
START = """\
1. Units: u, y and time of the record are those of your controller, and its sample time is {sample_time:g}.
2. Direction: by hand, move u {way} a little; y must rise.
3. First step: a small step of the set point, ready to switch to manual. Expect {overshoot:.2g} % of overshoot, and more
   than {twice:.2g} % only if the plant has changed since the record."""

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
    click.option("--outliers", type=click.Choice(["drop", "keep"]), help="What becomes of wild outputs."),
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
    click.option("--spread", type=float, help="Share of doubt in the model; by default from the record."),
    click.option("--sample-time", type=float, required=True, help="Of the controller, in the record's time."),
)
code = add_options(
    limits,
    click.option("--b", type=WEIGHT, help="Weight of the set point in P; 0.5, or 1 if it is shaped already."),
    click.option("--c", type=WEIGHT, help="Weight of the set point in D and A; 0, or 1 as for --b."),
    click.option("--rate-limit", type=ABOVE, default=math.inf, help="Largest change of u in a unit of time."),
    click.option("--deadband", type=click.FloatRange(0.0), default=0.0, help="Error in y that is ignored."),
    click.option("--anti-windup", type=click.Choice(ANTI_WINDUP_WORDS), help="What a limit does to I."),
    click.option("--feedforward", is_flag=True, help="Code with an input that is added to the signal."),
    click.option("--float", "single", is_flag=True, help="C code in single precision."),
    click.option("--tunable", is_flag=True, help="Code with gains that may change while it runs."),
)


@click.command("report")
@record
@design
@click.option("--trade-off", is_flag=True, help="Also the least error over the noise, at two limits of Ms.")
@click.option("--out", type=Place(dir_okay=False), help="HTML file to write.")
@force
@one_line
def report_command(out: Path | None, force: bool, trade_off: bool, **options: Any) -> None:
    """Set PI, PID and PIDA for the plant of a RECORD side by side, with the same limits.

    \b
    Example:
      pidalab report step.csv --time time --u valve --y level --sample-time 0.2 --out report.html
    """
    from pidalab.plant.reporting import report

    read, fitted = fitted_record(options)
    with progress("searching for a PI, a PID and a PIDA"):
        found = report(fitted, **{name: options[name] for name in TUNING})
    sections, traded = [("Candidates", str(found)), ("Model", str(fitted)), ("Record", str(read))], None
    if trade_off:
        from pidalab.plant.noise_curves import trade_off as find_trade_off

        with progress("searching for the trade-off"):
            traded = find_trade_off(found.process)
        sections.insert(1, ("Trade-off", str(traded)))
    show(sections)
    if out is not None:
        title = f"PI, PID and PIDA for {plain_text(options['record'].name)}"
        write(out.parent, {out.name: found.page(title, traded=traded)}, force)


@click.command("tune")
@record
@click.option("--kind", default="PIDA", type=click.Choice(KINDS))
@design
@code
@click.option("--full-output", type=float, help="u at full power: prints the gains of firmware, too.")
@out
@one_line
def tune_command(out: Path | None, force: bool, kind: str, **options: Any) -> None:
    """Tune a controller from a plant RECORD, a text file with an input that moves: a step, best from rest.

    Prints whether it is safe, the gains, what to check before the start, doubts and the model. With --out also writes
    controller.c, controller.st, controller.py, controller.json and report.html.

    \b
    Example:
      pidalab tune step.csv --time time --u valve --y level --kind PIDA --ms 1.6 --sample-time 0.2 --out folder
    """
    from pidalab import _check
    from pidalab.loop import Loop
    from pidalab.plant.reporting import MEASURES, report
    from pidalab.robustness.margins import margins

    full_output, h = options["full_output"], options["sample_time"]
    if full_output is not None and not _check.real("--full-output", full_output):
        raise ValueError("--full-output must not be 0: it is u at full power")
    read, fitted = fitted_record(options)
    with progress(f"searching for a {kind}"):
        found = report(fitted, kinds=kind, **{name: options[name] for name in TUNING})
    row = found.rows[0]
    assert row.design is not None
    digital = _digital(row.design, read, options)
    sampled = margins(Loop(fitted.process, digital))
    measured = [
        f"{name}: {value:.4g}" + f" ({meaning})" * (name != "worst Ms")
        for x, (name, meaning) in MEASURES.items()
        if not math.isnan(value := getattr(row, x))
    ]
    start = START.format(
        sample_time=h,
        way="up" if fitted.parameters["gain"] > 0 else "down",
        overshoot=row.overshoot,
        twice=2 * max(row.overshoot, 5.0),
    )
    doubts = [*row.design.doubts, *_no_limits(options["u_min"], options["u_max"])]
    sections = [
        ("Safe?", found.safety),
        ("Gains", f"{row.design.controller}\n{_vendors(row.design, full_output)}"),
        ("Limits and units", _limits(read, digital, h, options, row.design.info["notes"])),
        ("Before the start", start),
        ("Doubts", "\n".join([*read.doubts, *fitted.doubts, *doubts]) or "none found"),
    ]
    folded = [
        ("Expected", "\n".join(measured)),
        ("Margins, continuous", str(margins(row.design.loop(fitted.process)))),
        (f"Margins, sampled every {h:g}", str(sampled)),
        ("Model", f"{fitted.process!r}\n{fitted.described()}"),
        ("Record", read.described()),
    ]
    show(sections + folded)
    if out is None:
        return
    called = options["record"].name
    note = "\n".join(f"Doubt: {said}" for said in (*read.doubts, *fitted.doubts, *doubts))
    head = {"record": called, "time_unit": "unit of the record", "margins": sampled, "note": note}
    texts = {name: getattr(digital, language)(**head) for name, language in CODE.items()}
    if options["single"]:
        texts["controller.c"] = digital.c(precision="single", **head)
    title = f"{kind} controller for {plain_text(called)}"
    write(out, texts | {"report.html": found.page(title, sections, folded)}, force)


@click.command("check")
@record
@click.option(
    "--kp", type=float, required=True, help="Gain, in units of u per unit of y; or P of a firmware."
)
@click.option("--ti", type=float, help="Integral time, in the log's unit of time.")
@times
@click.option(
    "--firmware",
    type=click.Choice(("klipper", "betaflight", "betaflight-yaw")),
    help="The gains are its numbers --kp, --ki, --kd, in place of times; the log is in seconds.",
)
@click.option("--ki", type=float, help="I of that firmware.")
@click.option("--kd", default=0.0, help="D of that firmware.")
@click.option("--full-output", default=1.0, help="u of the log at full power of that firmware.")
@click.option("--filter", "lag", default=0.0, help="Time constant of the measurement's filter.")
@click.option("--sample-time", type=float, help="Of the controller; by default that of the log.")
@limits
@ms_worst
@one_line
def check_command(
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
    from pidalab import _check
    from pidalab.plant.checking import check

    lags = None
    if _check.real("--filter", lag, at_least=0.0):
        import control

        lags = control.TransferFunction([1.0], [lag, 1.0])
    running = _running(firmware, full_output, options)
    read = read_record(options)
    with progress("fitting the plant and searching for three sets of gains"):
        asked = {"sample_time": sample_time, "ms_worst": ms_worst, "model": options["model"]}
        found = check(read, running, output_filter=lags, **asked)
        said = str(found)
    sections = [
        ("Gains", said),
        ("Model", f"{found.fit.process!r}\n{found.fit.described()}"),
        ("Log", read.described()),
    ]
    if firmware is not None:
        sections.insert(
            1, (f"The sets as {firmware} writes them", _as_firmware(found, firmware, full_output))
        )
    show(sections)


def fitted_record(options: dict[str, Any]) -> tuple[Record, Fit]:
    """Read and fit the record that the options describe."""
    from pidalab.plant.fitting import fit

    read = read_record(options)
    with progress("fitting the plant"):
        return read, fit(read, options["model"])


def read_record(options: dict[str, Any]) -> Record:
    """Read the record that the options describe, and compare it with the limits of u."""
    from pidalab.plant.record import Record

    with progress("reading"):
        read = Record.read_csv(options["record"], **{name: options[name] for name in READING})
    low, high = options.get("u_min", -math.inf), options.get("u_max", math.inf)
    least, most = min(read.u.min(), read.u_before), max(read.u.max(), read.u_before)
    if not low <= least <= most <= high:
        raise ValueError(
            f"--u-min and --u-max must contain u of the record, which runs from {least:.6g} to {most:.6g}, found "
            f"{low:g} and {high:g}: give them in the unit of the record's u; if u was not limited there, log it behind "
            "the limits of the actuator"
        )
    return read


def _digital(design: Design, read: Record, options: dict[str, Any]) -> Any:
    """Return the controller as code runs it, around the working point of the record."""
    # a prefilter shapes the set point already, and automatic reset is written as such with both weights 1
    shaped = design.prefilter is not None or design.controller.automatic_reset() is not None
    further = {name: options[name] for name in ("rate_limit", "deadband", "feedforward", "tunable")}
    for name, usual in (("b", 1.0 if shaped else 0.5), ("c", 1.0 if shaped else 0.0)):
        further[name] = usual if options[name] is None else options[name]
    if options["anti_windup"] is not None:
        further["anti_windup"] = options["anti_windup"]
    rest = float(read.steps[0].before) if read.steps else read.u_before
    return design.discretise(
        options["sample_time"],
        "backward",
        limits=(options["u_min"], options["u_max"]),
        bias=rest,
        y_offset=read.rest,
        **further,
    )


def _limits(read: Record, digital: Any, h: float, options: dict[str, Any], notes: tuple[str, ...]) -> str:
    return "\n".join(
        [
            f"u from {options['u_min']:g} to {options['u_max']:g}; {digital.bias:.6g} at y = {read.rest:.6g}, the rest "
            "of the record",
            f"sample time {h:g}; every time in the unit of the record, which is sampled every {read.sampling:.4g}",
            *notes,
        ]
    )


def _no_limits(low: float, high: float) -> list[str]:
    """Say which limits of u are missing."""
    lacking = [name for name, limit in (("--u-min", low), ("--u-max", high)) if math.isinf(limit)]
    return [doubt("no limits", options=" and ".join(lacking))] if lacking else []


def _vendors(design: Design, full_output: float | None) -> str:
    """Return the parameters of vendor blocks, or why there are none."""
    try:
        forms = design.vendor_forms("s", full_output)
    except ValueError as refusal:
        return f"no vendor block: {refusal}"
    return f"as vendor blocks, if the record's unit of time is the second:\n{forms}"


def _running(firmware: str | None, full_output: float, options: dict[str, Any]) -> PIDA:
    """Return the controller that runs, of times or of the numbers of a firmware."""
    from pidalab.controllers import PIDA

    kp, ti, ki, kd = (options.pop(name) for name in ("kp", "ti", "ki", "kd"))
    own = {name: options.pop(name) for name in ("td", "ta", "n", "m")}
    if firmware is None and ti is not None and ki is None and not kd:
        return PIDA(kp, ti, **own)
    if firmware is not None and ki is not None and ti is None and not own["td"] and not own["ta"]:
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
