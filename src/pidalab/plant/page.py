"""Make the HTML page of a report, and the figure in it."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import jinja2
import numpy as np
from markupsafe import Markup
from matplotlib import rc_context
from matplotlib.figure import Figure

from pidalab.response import Response
from pidalab.robustness.margins import max_sensitivity
from pidalab.simulation.exact import load_response, step_response
from pidalab.style import GREY, LOOKS, STYLE

if TYPE_CHECKING:
    from pidalab.comparison.judging import DesignRow
    from pidalab.process import Process
    from pidalab.rules import Design

    Candidates = Sequence[tuple[DesignRow, Design]]

NEGLIGIBLE_ERROR = 0.005  # a response is drawn until the error stays below this share of the largest error
PLANTS_SHOWN = 8  # largest number of plants, besides the model, in the figure
CURVE = 500  # number of points of a curve
CAPTION = (
    "Unit steps of the load (left) and of the set point (right): output above, control signal below. Last row: gain "
    "from measurement noise to the control signal, and Nyquist curves with the circle of the requested Ms. Faint "
    "curves belong to other plants that the model allows."
)


def page(
    title: str,
    table: str,
    drawn: Figure,
    sections: Sequence[tuple[str, str]],
    folded: Sequence[tuple[str, str]],
) -> str:
    """Return an HTML page.

    A section has a heading and a text. The sections in `folded` come last, and each of them opens at a click.
    """
    loader = jinja2.PackageLoader("pidalab.plant.code")
    template = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True).get_template("report.j2")
    figure, table = Markup(svg(drawn)), Markup(table)
    return template.render(
        title=title, sections=sections, table=table, drawn=figure, caption=CAPTION, folded=folded
    )


def svg(drawn: Figure) -> str:
    """Return a figure as an SVG element, with equal bytes for equal figures."""
    text = io.StringIO()
    with rc_context(STYLE):  # type: ignore[arg-type]
        drawn.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    return text.getvalue()[text.getvalue().index("<svg") :]


def figure(process: Process, ms: float, rows: Sequence[DesignRow], plants: Sequence[Process]) -> Figure:
    """Draw the loops of the designs with `process`. The last panel also shows `plants` and the requested Ms."""
    stable = [(row, row.design) for row in rows if row.applies and row.design is not None]
    if not stable:
        raise ValueError("there is nothing to draw: no candidate is stable with the model")
    peaks = [max_sensitivity(design.loop())[1] for _, design in stable]
    with rc_context(STYLE):  # type: ignore[arg-type]
        drawn = Figure(figsize=(6.4, 8.4))
        axes = drawn.subplots(3, 2)
        _draw_responses(axes, stable)
        w = np.geomspace(0.05 * min(peaks), 50.0 * max(peaks), CURVE)
        for row, design in stable:
            axes[2, 0].loglog(w, np.abs(design.loop().transfer("u", "n", 1j * w)), **LOOKS[row.kind])
        axes[2, 0].set(xlabel="frequency, rad per time unit", ylabel="gain from noise to u")
        w = np.geomspace(0.1 * min(peaks), 30.0 * max(peaks), CURVE)
        _draw_nyquist(axes[2, 1], process, ms, stable, plants, 1j * w)
        if len(stable) > 1:
            drawn.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=3)
    return drawn


def _lasting(response: Response) -> float:
    """Return the time after which the error stays below `NEGLIGIBLE_ERROR` times the largest error."""
    large = np.flatnonzero(np.abs(response.e) > NEGLIGIBLE_ERROR * np.max(np.abs(response.e)))
    return float(response.t[large[-1]]) or float(response.t[-1])


def _draw_responses(axes: Any, stable: Candidates) -> None:
    runs = {"load": load_response, "setpoint": step_response}
    for column, (name, simulate) in enumerate(runs.items()):
        until = max(_lasting(getattr(row, name)) for row, _ in stable)
        t = np.linspace(0.0, 1.05 * until, CURVE + 1)
        for row, design in stable:
            response = simulate(design.loop(), t)
            for panel, values in zip(axes[:2, column], (response.y, response.u), strict=True):
                panel.plot(t, values, **LOOKS[row.kind], label=row.kind)
        axes[0, column].set(title=f"unit step of the {name.replace('setpoint', 'set point')}")
        axes[1, column].set(xlabel="time")
    axes[0, 0].set(ylabel="output y")
    axes[1, 0].set(ylabel="control signal u")


def _draw_nyquist(
    ax: Any, process: Process, ms: float, stable: Candidates, plants: Sequence[Process], s: Any
) -> None:
    for row, design in stable:
        look = LOOKS[row.kind]
        for plant in plants[:PLANTS_SHOWN]:
            value = design.loop(plant).L(s)
            ax.plot(value.real, value.imag, "-", color=look["color"], alpha=0.25, linewidth=0.6)
        value = design.loop(process).L(s)
        ax.plot(value.real, value.imag, **look)
    angle = np.linspace(0.0, 2 * np.pi, 200)
    ax.plot(-1 + np.cos(angle) / ms, np.sin(angle) / ms, ":", color=GREY)
    ax.plot([-1], [0], "+", color=GREY)
    ax.set(xlim=(-1.9, 0.5), ylim=(-1.5, 0.9), aspect="equal")
    ax.set(xlabel="real part of L", ylabel="imaginary part of L")
