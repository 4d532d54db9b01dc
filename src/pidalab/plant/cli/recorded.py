"""Commands for a record of a plant: `report`, `tune` and `check`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

import pidalab
from pidalab._text import KINDS, plain_text
from pidalab.plant.cli import dialogue
from pidalab.plant.doubts import doubt

MODEL_WORDS = ("auto", "fopdt", "sopdt", "lags", "ipdt", "ifopdt", "sopdtz")
ANTI_WINDUP_WORDS = ("reset", "back-calculation", "clamping", "none")
WEIGHT, FROM_ZERO, ABOVE = click.FloatRange(0.0, 1.0), click.FloatRange(0.0), dialogue.ABOVE
READING = ("time", "u", "y", "period", "delimiter", "skip", "u_before", "outliers", "run")
TUNING = ("rule", "ms", "ms_worst", "noise_gain", "spread", "sample_time")
CODE = {"c": "c", "st": "structured_text", "py": "python", "json": "json"}
START = """\
1. Units: your controller must use the units of u, y and time of the record, and the sample time {sample_time:g}.
2. Direction: in manual mode, move u {way} a little. y must rise.
3. First step: make a small step of the set point, ready to switch to manual. Expect {overshoot:.2g} % of overshoot.
   More than {twice:.2g} % means that the plant has changed since the record."""

record = dialogue.add_options(
    click.argument("record", type=dialogue.EXISTING),
    dialogue.columns,
    click.option("--period", type=float, help="Time between samples, for a file without times."),
    click.option("--delimiter", help="Text between columns, as ';' or '\\s+'; default: detected."),
    click.option("--skip", default=0, help="Lines to leave out at the beginning."),
    click.option("--u-before", type=float, help="u before the step, if the record begins with the step."),
    click.option("--outliers", type=click.Choice(["drop", "keep"]), help="Treatment of outlying outputs."),
    click.option("--run", type=int, help="Number of the run to read, from 1, if the time restarts."),
    click.option("--model", default="auto", type=click.Choice(MODEL_WORDS), help="Model to fit."),
)
design = dialogue.add_options(
    click.option("--rule", default="optimal", help="'optimal', or a name that 'pidalab rules' lists."),
    dialogue.ms,
    dialogue.ms_worst,
    click.option("--noise-gain", type=float, help="Largest noise gain; default: from the record."),
    click.option("--spread", type=float, help="Relative error of the model; default: from the record."),
    click.option("--sample-time", type=float, required=True, help="Sample time, in the record's unit."),
)
code = dialogue.add_options(
    dialogue.limits,
    click.option("--b", type=WEIGHT, help="Set-point weight of P; default: 0.5, or 1 with a prefilter."),
    click.option("--c", type=WEIGHT, help="Set-point weight of D and A; default: 0, or 1 with a prefilter."),
    click.option("--rate-limit", type=ABOVE, default=math.inf, help="Largest change of u in a unit of time."),
    click.option("--deadband", type=FROM_ZERO, default=0.0, help="Error in y that is ignored."),
    click.option("--anti-windup", type=click.Choice(ANTI_WINDUP_WORDS), help="How to prevent windup."),
    click.option("--feedforward", is_flag=True, help="Give the code an input that is added to u."),
    click.option("--float", "single", is_flag=True, help="C code in single precision."),
    click.option("--tunable", is_flag=True, help="Allow the gains to change while the code runs."),
)


@dialogue.main.command("report")
@record
@design
@click.option("--out", type=dialogue.OUT_FILE, help="HTML file to write.")
@dialogue.force
def report_command(out: Path | None, force: bool, **options: Any) -> None:
    """Compare a PI, a PID and a PIDA, tuned with the same limits for the plant of a RECORD.

    \b
    Example:
      pidalab report step.csv --time time --u valve --y level --sample-time 0.2 --out report.html
    """
    fitted = fit_record(options)
    with dialogue.progress("searching for a PI, a PID and a PIDA"):
        candidates = pidalab.report(fitted, **{name: options[name] for name in TUNING})
    record = str(fitted.record)
    dialogue.show([("Candidates", str(candidates)), ("Model", str(fitted)), ("Record", record)])
    if out is not None:
        title = f"PI, PID and PIDA for {plain_text(options['record'].name)}"
        dialogue.write(out.parent, {out.name: candidates.page(title)}, force)


@dialogue.main.command("tune")
@record
@click.option("--kind", default="PIDA", type=click.Choice(KINDS))
@design
@code
@dialogue.out
def tune_command(out: Path | None, force: bool, kind: str, **options: Any) -> None:
    """Tune a controller from a plant RECORD, a text file in which the input moves. A step from rest is best.

    Print whether the loop is safe, and then the gains, the checks before the start, the doubts and the model.
    With --out, also write controller.c, controller.st, controller.py, controller.json and report.html.

    \b
    Example:
      pidalab tune step.csv --time time --u valve --y level --kind PIDA --ms 1.6 --sample-time 0.2 --out folder
    """
    h, low, high = (options[x] for x in ("sample_time", "u_min", "u_max"))
    fitted = fit_record(options)
    record = fitted.record
    with dialogue.progress(f"searching for a {kind}"):
        candidates = pidalab.report(fitted, kinds=kind, **{name: options[name] for name in TUNING})
    row = candidates.rows[0]
    assert row.design is not None
    digital = _digital(row.design, record, options)
    sampled = pidalab.margins(pidalab.Loop(fitted.process, digital))
    measured = [
        f"{name}: {value}" + f" ({meaning})" * (name != "worst Ms")
        for name, value, meaning in candidates.table()[1:]
    ]
    way = "up" if fitted.parameters["gain"] > 0 else "down"
    start = START.format(sample_time=h, way=way, overshoot=row.overshoot, twice=2 * max(row.overshoot, 5.0))
    units = [
        f"u from {low:g} to {high:g}; at rest in the record u = {digital.bias:.6g} and y = {record.rest:.6g}",
        f"sample time {h:g}; all times are in {record.time_unit or 'the unit of the record'}; the record has a sample "
        f"every {record.sampling:.4g}",
        *row.design.info["notes"],
    ]
    doubts = [*candidates.doubts, *missing_limits(low, high)]
    sections = [
        ("Safe?", candidates.safety),
        ("Gains", f"{row.design.controller}\n{_vendors(row.design, record.time_unit)}"),
        ("Limits and units", "\n".join(units)),
        ("Before the start", start),
        ("Doubts", "\n".join(doubts) or "none found"),
    ]
    folded = [
        ("Expected", "\n".join(measured)),
        ("Margins, continuous", str(pidalab.margins(row.design.loop(fitted.process)))),
        (f"Margins, sampled every {h:g}", str(sampled)),
        ("Model", f"{fitted.process!r}\n{fitted.described()}"),
        ("Record", record.described()),
    ]
    dialogue.show(sections + folded)
    if out is None:
        return
    name = options["record"].name
    head = {"record": name, "time_unit": record.time_unit, "date": record.date, "margins": sampled}
    head["note"] = "\n".join(f"Warning: {said}" for said in doubts)
    texts = {f"controller.{end}": getattr(digital, language)(**head) for end, language in CODE.items()}
    if options["single"]:
        texts["controller.c"] = digital.c(precision="single", **head)
    title = f"{kind} controller for {plain_text(name)}"
    dialogue.write(out, texts | {"report.html": candidates.page(title, sections, folded)}, force)


@dialogue.main.command("check")
@record
@click.option("--kp", type=float, required=True, help="Gain, in units of u per unit of y.")
@click.option("--ti", type=float, required=True, help="Integral time, in the log's unit of time.")
@dialogue.times
@click.option(
    "--filter", "lag", type=FROM_ZERO, default=0.0, help="Time constant of the measurement's filter."
)
@click.option("--sample-time", type=float, help="Sample time; default: that of the log.")
@dialogue.limits
@dialogue.ms_worst
def check_command(lag: float, **options: Any) -> None:
    """Judge the gains of a running loop by its log, the RECORD.

    The log must contain changes of the set point, a step of the load or a bump of u. Print the Ms of the loop with an
    uncertainty interval, how much larger the IAE is than with the best gains, and three sets of gains to try.

    \b
    Example:
      pidalab check log.csv --time time --u valve --y level --kp 0.6 --ti 12 --sample-time 0.5
    """
    running = pidalab.PIDA(**{name: options[name] for name in dialogue.GAINS})
    lags = pidalab.fopdt(1.0, lag, 0.0).rational_part() if lag else None
    log = read_record(options)
    with dialogue.progress("fitting the plant and searching for three sets of gains"):
        asked = {name: options[name] for name in ("sample_time", "ms_worst", "model")}
        judged = pidalab.check(log, running, output_filter=lags, **asked)
        gains = str(judged)
    model = f"{judged.fit.process!r}\n{judged.fit.described()}"
    dialogue.show([("Gains", gains), ("Model", model), ("Log", log.described())])


def fit_record(options: dict[str, Any]) -> pidalab.identification.Fit:
    """Read and fit the record that the options describe."""
    record = read_record(options)
    with dialogue.progress("fitting the plant"):
        return pidalab.identification.fit(record, options["model"])


def read_record(options: dict[str, Any]) -> pidalab.Record:
    """Read the record that the options describe, and check that its u lies within the limits of u."""
    with dialogue.progress("reading"):
        record = pidalab.Record.read_csv(options["record"], **{name: options[name] for name in READING})
    low, high = options.get("u_min", -math.inf), options.get("u_max", math.inf)
    least, most = min(record.u.min(), record.u_before), max(record.u.max(), record.u_before)
    if not low <= least <= most <= high:
        raise ValueError(
            f"the range from --u-min to --u-max must contain the record's u, from {least:.6g} to {most:.6g}, found "
            f"{low:g} to {high:g}: give both limits in the unit of the record's u. If u was recorded before the "
            "actuator limited it, record the limited u"
        )
    return record


def _digital(design: pidalab.Design, record: pidalab.Record, options: dict[str, Any]) -> Any:
    """Discretise a design, with the working point of the record."""
    # A prefilter already shapes the set point, and automatic reset needs both weights at 1.
    shaped = design.prefilter is not None or design.controller.automatic_reset() is not None
    weights = {"b": 1.0 if shaped else 0.5, "c": 1.0 if shaped else 0.0}
    further = {name: options[name] for name in ("rate_limit", "deadband", "feedforward", "tunable")}
    given = {name: options[name] for name in ("b", "c", "anti_windup") if options[name] is not None}
    return design.discretise(
        options["sample_time"],
        "backward",
        limits=(options["u_min"], options["u_max"]),
        bias=float(record.steps[0].before) if record.steps else record.u_before,
        y_offset=record.rest,
        **(further | weights | given),
    )


def missing_limits(low: float, high: float) -> list[str]:
    """Return a doubt that names the missing limits of u, if any."""
    lacking = [name for name, limit in (("--u-min", low), ("--u-max", high)) if math.isinf(limit)]
    return [doubt("no limits", options=" and ".join(lacking))] if lacking else []


def _vendors(design: pidalab.Design, time_unit: str) -> str:
    """Return the parameters of vendor blocks as text, or the reason why no vendor block fits."""
    try:
        forms = design.vendor_forms(time_unit or "s")
    except ValueError as refusal:
        return f"no vendor block: {refusal}"
    assumed = "" if time_unit else ", if the record's unit of time is the second"
    return f"as vendor blocks{assumed}:\n{forms}"
