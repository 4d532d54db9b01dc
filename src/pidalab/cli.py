"""The command line: from a plant record to controller code, and every rule on a plant."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

if TYPE_CHECKING:
    from pidalab.digital import DigitalController
    from pidalab.identification import Fit
    from pidalab.loop import Loop
    from pidalab.rules import Design

MODELS = ("auto", "fopdt", "sopdt", "lags", "ipdt")
SHOWN = 15.0  # length of the responses in the report, in slowest times of the loop
POINTS = 3000  # most samples of a response in the report

REPORT = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{{ title }}</title>
<style>body{font:16px/1.5 system-ui,sans-serif;max-width:50rem;margin:2rem auto;padding:0 1rem;background:#fff;
color:#111}pre{overflow-x:auto;background:#f3f3f3;padding:.7rem}svg{max-width:100%;height:auto}</style></head>
<body><h1>{{ title }}</h1>
{% for head, text in sections %}<h2>{{ head }}</h2><pre>{{ text }}</pre>
{% endfor %}<h2>Responses, simulated with the model</h2>
<figure role="img" aria-label="{{ caption }}">{{ figure }}<figcaption>{{ caption }}</figcaption></figure>
</body></html>
"""


class Result(NamedTuple):
    """What `pidalab tune` found: all that it prints and writes comes from here."""

    fit: Fit
    design: Design
    digital: DigitalController
    sections: list[tuple[str, str]]


def _one_line(command: Callable[..., None]) -> Callable[..., None]:
    """Turn what the library refuses into one line on stderr, and exit status 1."""

    @functools.wraps(command)
    def guarded(**options: Any) -> None:
        try:
            command(**options)
        except (ValueError, TypeError, OSError) as refusal:
            raise click.ClickException(" ".join(str(refusal).split())) from refusal

    return guarded


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="pidalab")
def main() -> None:
    """PIDA control: tune a controller from a plant record, compare rules on a plant."""


@main.command("tune")
@click.argument("record", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option(
    "--time", default="0", show_default=True, help="Column of the time: its name, or its number from 0."
)
@click.option("--u", default="1", show_default=True, help="Column of the plant's input.")
@click.option("--y", default="2", show_default=True, help="Column of the measured output.")
@click.option("--model", default="auto", show_default=True, type=click.Choice(MODELS), help="Model to fit.")
@click.option("--kind", default="PIDA", show_default=True, type=click.Choice(["PI", "PID", "PIDA"]))
@click.option("--rule", default="optimal", show_default=True, help="The optimum, or a rule by its name.")
@click.option("--ms", default=1.6, show_default=True, help="Largest maximum sensitivity.")
@click.option(
    "--noise-gain", type=float, help="Largest gain from noise to u; by default from the record's noise."
)
@click.option(
    "--sample-time", type=float, required=True, help="Of the controller, in the record's unit of time."
)
@click.option("--u-min", type=float, default=float("-inf"), help="Lower limit of u, in the record's units.")
@click.option("--u-max", type=float, default=float("inf"), help="Upper limit of u.")
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), help="Folder for code and report.")
@_one_line
def tune_command(record: Path, out: Path | None, **options: Any) -> None:
    """Tune a controller from a plant RECORD, a delimited text file with an open-loop step.

    Prints the model, the controller, margins and doubts; with --out also writes controller.c, controller.st,
    controller.py, controller.json and report.html.

    \b
    Example:
      pidalab tune step.csv --time time --u valve --y level --kind PIDA --ms 1.6 --sample-time 0.2 --out folder
    """
    result = _tuned(record, **options)
    for head, text in result.sections:
        click.echo(f"{head}\n{_indented(text)}\n")
    if out is not None:
        for path in _written(result, f"{options['kind']} controller for {record.name}", out):
            click.echo(f"written: {path}")


@main.command("compare")
@click.option("--num", required=True, help="Numerator, highest power first: '1' or '-0.5,1'.")
@click.option("--den", required=True, help="Denominator, highest power first: '1,3,3,1'.")
@click.option("--delay", default=0.0, show_default=True, help="Dead time.")
@click.option("--ms", default=1.6, show_default=True, help="Largest maximum sensitivity of the optima.")
@click.option(
    "--noise-gain", default=10.0, show_default=True, help="Largest gain from noise to u of the optima."
)
@click.option("--sample-time", default=0.01, show_default=True, help="Sample time of that noise.")
@_one_line
def compare_command(num: str, den: str, delay: float, **limits: float) -> None:
    """Judge every rule of the library on a plant, beside the optima.

    \b
    Example:
      pidalab compare --num 1 --den 1,3,3,1 --delay 1
    """
    from pidalab.comparison import compare
    from pidalab.process import Process

    click.echo(str(compare(Process(_numbers("--num", num), _numbers("--den", den), delay), **limits)))


def _numbers(name: str, text: str) -> list[float]:
    try:
        return [float(part) for part in text.replace(",", " ").split()]
    except ValueError:
        raise click.UsageError(f"{name} must be numbers with commas between them, found {text!r}") from None


# --- from the record to the controller --------------------------------------------------------------------------------


def _tuned(
    record: Path,
    time: str,
    u: str,
    y: str,
    model: str,
    kind: str,
    rule: str,
    ms: float,
    noise_gain: float | None,
    sample_time: float,
    u_min: float,
    u_max: float,
) -> Result:
    from pidalab.identification import fit
    from pidalab.loop import Loop
    from pidalab.record import Record
    from pidalab.robustness.margins import margins
    from pidalab.tuning import tune

    read = Record.read_csv(record, time=_column(time), u=_column(u), y=_column(y))
    found = fit(read, model)
    design = tune(found, kind, ms, noise_gain, sample_time, rule)
    for name in ("output_filter", "prefilter"):
        if getattr(design, name) is not None:
            raise ValueError(
                f"--rule {rule} makes a controller with a filter beside it ({name.replace('_', ' ')}), which the code "
                "would lack; take another rule, or the library itself"
            )
    # the working point of the record: model and controller count from there
    rest = float(read.steps[0].before) if read.steps else float(read.u[0])
    digital = design.controller.discretise(
        sample_time, "backward", limits=(u_min, u_max), bias=rest, y_offset=read.rest
    )
    sampled = margins(Loop(found.process, digital))
    sections = [
        ("Record", str(read)),
        ("Model", f"{found.process!r}\n{found}"),
        ("Controller", f"{design.controller}\n{_vendors(design)}"),
        ("Margins, continuous", str(margins(design.loop(found.process)))),
        (f"Margins, sampled every {sample_time:g}", str(sampled)),
        ("Expected with the model", _expected(design)),
        ("Doubts", "\n".join([*design.doubts, *_stability(sampled.stable)]) or "none found"),
    ]
    return Result(found, design, digital, sections)


def _column(text: str) -> str | int:
    return int(text) if text.isdecimal() else text


def _vendors(design: Design) -> str:
    """Forms of vendors, or why there are none."""
    try:
        return f"in seconds, if that is the record's unit of time:\n{design.controller.vendor_forms('s')}"
    except ValueError as refusal:
        return f"no vendor's form: {refusal}"


def _expected(design: Design) -> str:
    names = {
        "iae": "IAE of a unit load step",
        "ms": "Ms",
        "mks": "largest gain from noise to u",
        "ms_worst": "worst Ms within the uncertainty of the model",
        "iae_worst": "worst IAE within it",
    }
    return "\n".join(
        f"{said}: {design.info[name]:.5g}" for name, said in names.items() if name in design.info
    )


def _stability(stable: bool) -> list[str]:
    return [] if stable else ["the sampled loop is unstable: take a shorter sample time"]


def _indented(text: str) -> str:
    return "\n".join(f"  {line}" for line in text.splitlines())


# --- what is written --------------------------------------------------------------------------------------------------


def _written(result: Result, title: str, out: Path) -> list[Path]:
    """Write code and report into a folder."""
    from pidalab.loop import Loop
    from pidalab.robustness.margins import margins

    k = result.digital
    sampled = margins(Loop(result.fit.process, k))
    texts = {
        "controller.c": k.c(margins=sampled),
        "controller.st": k.structured_text(margins=sampled),
        "controller.py": k.python(margins=sampled),
        "controller.json": k.json(margins=sampled),
        "report.html": _report(result, title),
    }
    out.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        (out / name).write_text(text, encoding="utf-8")
    return [out / name for name in texts]


def _report(result: Result, title: str) -> str:
    import jinja2
    from markupsafe import Markup

    caption = (
        "Output and control signal, from the working point, after a unit step of the load (left) and of the set point "
        "(right), of the continuous design."
    )
    template = jinja2.Environment(autoescape=True).from_string(REPORT)
    figure = Markup(_figure(result.design.loop(result.fit.process)))
    return template.render(title=title, sections=result.sections, figure=figure, caption=caption)


def _figure(loop: Loop) -> str:
    """Draw load and set-point response with u, as SVG."""
    import io

    import numpy as np
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    from pidalab.robustness.poles import rightmost_poles
    from pidalab.simulation.exact import load_response, step_response

    slowest = -1.0 / float(np.max(rightmost_poles(loop).real))
    t = np.linspace(0.0, SHOWN * slowest + 5 * loop.process.delay, POINTS)
    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    FigureCanvasSVG(figure)
    axes = figure.subplots(2, 2, sharex=True)
    for column, (name, simulate) in enumerate({"load": load_response, "set point": step_response}.items()):
        response = simulate(loop, t)
        axes[0, column].plot(t, response.y)
        axes[1, column].plot(t, response.u, color="C1")
        axes[0, column].set_title(f"unit step of the {name}")
        axes[1, column].set_xlabel("time")
    axes[0, 0].set_ylabel("output y")
    axes[1, 0].set_ylabel("control signal u")
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    return text.getvalue()[text.getvalue().index("<svg") :]


if __name__ == "__main__":
    main()
