"""The figures of a report and its page."""

from __future__ import annotations

import io
import itertools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import jinja2
import numpy as np
from markupsafe import Markup
from matplotlib import rc_context
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pidalab._check import Array
from pidalab.response import Response
from pidalab.robustness.margins import max_sensitivity
from pidalab.simulation.exact import load_response, step_response
from pidalab.style import GREY, LOOKS, STYLE

if TYPE_CHECKING:
    from pidalab.comparison.judging import DesignRow
    from pidalab.plant.noise_curves import TradeOff
    from pidalab.process import Process

NEGLIGIBLE_ERROR = 0.005  # share of the largest error at which a figure ends
PLANTS_SHOWN = 8  # plants of the spread in the figure
CURVE = 500  # points of a curve in the figure
RULE_MARKERS = "os^Dv*P"
FITS = 1.001  # ratio of Ms to its limit up to which a rule is in a panel
CAPTION = (
    "Unit steps of the load (left) and of the set point (right): output above, control signal below. Last row: gain "
    "from measurement noise to the control signal, and Nyquist curves with the circle of the requested Ms. Faint "
    "curves belong to plants within the spread."
)
TRADED = (
    "More noise in u allows a smaller error: least IAE of a unit step of the load over the limit of the relative noise "
    "gain, for PI, PID and PIDA at each limit of Ms. Markers are rules, in the colour of their kind, in the panel of "
    "the least limit that they keep."
)
PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{{ title }}</title>
<style>body{font:16px/1.5 system-ui,sans-serif;max-width:52rem;margin:2rem auto;padding:0 1rem;background:#fff;
color:#111}div{overflow-x:auto}pre{background:#f3f3f3;padding:.7rem;white-space:pre-wrap}svg{max-width:100%;height:auto}
table{border-collapse:collapse}th,td{padding:.2rem .6rem;text-align:right;border-bottom:1px solid #ccc}
th:first-child,td:first-child,td:last-child{text-align:left}figure{margin:1rem 0}</style></head>
<body><h1>{{ title }}</h1>
{% for head, text in sections %}<h2>{{ head }}</h2><pre>{{ text }}</pre>
{% endfor %}
{% for drawn, caption in figures %}
<figure><div role="img" aria-label="{{ caption }}">{{ drawn }}</div><figcaption>{{ caption }}</figcaption></figure>
{% endfor %}
<details><summary>Measures, simulated with the model</summary><div tabindex="0">{{ table }}</div></details>
{% for head, text in folded %}<details><summary>{{ head }}</summary><pre>{{ text }}</pre></details>
{% endfor %}</body></html>
"""


def page(
    title: str,
    table: str,
    drawn: Figure,
    sections: Sequence[tuple[str, str]],
    folded: Sequence[tuple[str, str]] = (),
    traded: TradeOff | None = None,
) -> str:
    """Return a page with sections of text, one or two figures, a table of HTML and folded sections."""
    template = jinja2.Environment(autoescape=True, trim_blocks=True).from_string(PAGE)
    figures = [(Markup(svg(drawn)), CAPTION)]
    if traded is not None:
        figures.append((Markup(svg(trade_off_figure(traded))), TRADED))
    return template.render(
        title=title, sections=sections, table=Markup(table), figures=figures, folded=folded
    )


def svg(drawn: Figure) -> str:
    """Return a figure as an SVG element, reproducible to the byte."""
    text = io.StringIO()
    with rc_context(STYLE):  # type: ignore[arg-type]
        drawn.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    return text.getvalue()[text.getvalue().index("<svg") :]


def figure(process: Process, ms: float, rows: Sequence[DesignRow], plants: Sequence[Process]) -> Figure:
    """Draw six panels for the designs on a process, with the circle of an Ms and with other plants."""
    stable = [row for row in rows if row.applies]
    if not stable:
        raise ValueError("there is nothing to draw: no candidate is stable with the model")
    with rc_context(STYLE):  # type: ignore[arg-type]
        drawn = Figure(figsize=(6.4, 8.4))
        FigureCanvasSVG(drawn)
        axes = drawn.subplots(3, 2)
        _draw_responses(axes, stable)
        _draw_noise(axes[2, 0], stable)
        _draw_nyquist(axes[2, 1], process, ms, stable, plants)
        if len(stable) > 1:
            drawn.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=3)
    return drawn


def trade_off_figure(found: TradeOff) -> Figure:
    """Draw the least IAE over the relative noise gain, with a panel for each limit of Ms and the rules that keep it."""
    levels = list(dict.fromkeys(point.ms for point in found.points))
    kinds = list(dict.fromkeys(point.kind for point in found.points))
    if not levels:
        raise ValueError("there is nothing to draw: no controller keeps the limits")
    names = dict.fromkeys(row.rule for row in found.rules)
    marks = dict(zip(names, itertools.cycle(RULE_MARKERS), strict=False))
    with rc_context(STYLE):  # type: ignore[arg-type]
        drawn = Figure(figsize=(6.4, 4.2))
        FigureCanvasSVG(drawn)
        axes = np.atleast_1d(drawn.subplots(1, len(levels), sharex=True, sharey=True))
        for ax, ms, calmer in zip(axes, levels, [0.0, *levels], strict=False):
            for kind in kinds:
                points = [(p.relative_noise_gain, p.iae) for p in found.curve(kind, ms)]
                ax.loglog(*np.reshape(points, (-1, 2)).T, **LOOKS[kind], label=kind)
            for row in found.rules:
                if row.applies and calmer * FITS < row.ms <= ms * FITS and not math.isnan(row.noise_gain):
                    look = {"color": LOOKS[row.kind]["color"], "marker": marks[row.rule], "linestyle": ""}
                    ax.plot([row.noise_gain], [row.iae], markersize=6, **look)
            ax.set(title=f"Ms at most {ms:g}", xlabel="relative noise gain")
        axes[0].set(ylabel="IAE of a load step")
        handles, labels = axes[0].get_legend_handles_labels()
        handles += [Line2D([], [], color=GREY, marker=mark, linestyle="") for mark in marks.values()]
        drawn.legend(handles, [*labels, *marks], loc="outside upper left", ncols=3)
    return drawn


def _lasting(response: Response) -> float:
    """Return the time after which the error stays small."""
    large = np.flatnonzero(np.abs(response.e) > NEGLIGIBLE_ERROR * np.max(np.abs(response.e)))
    return float(response.t[large[-1]]) or float(response.t[-1])


def _frequencies(rows: Sequence[DesignRow], low: float, high: float) -> Array:
    """Return frequencies from `low` times the lowest peak of the sensitivity to `high` times the highest."""
    centres = [max_sensitivity(row.design.loop())[1] for row in rows if row.design is not None]
    return np.geomspace(low * min(centres), high * max(centres), CURVE)


def _draw_responses(axes: Any, rows: Sequence[DesignRow]) -> None:
    runs = {"load": load_response, "setpoint": step_response}
    for column, (name, simulate) in enumerate(runs.items()):
        until = max(_lasting(getattr(row, name)) for row in rows)
        t = np.linspace(0.0, 1.05 * until, CURVE + 1)
        for row in rows:
            assert row.design is not None
            response = simulate(row.design.loop(), t)
            for panel, values in zip(axes[:2, column], (response.y, response.u), strict=True):
                panel.plot(t, values, **LOOKS[row.kind], label=row.kind)
        axes[0, column].set(title=f"unit step of the {name.replace('setpoint', 'set point')}")
        axes[1, column].set(xlabel="time")
    axes[0, 0].set(ylabel="output y")
    axes[1, 0].set(ylabel="control signal u")


def _draw_noise(ax: Any, rows: Sequence[DesignRow]) -> None:
    w = _frequencies(rows, 0.05, 50.0)
    for row in rows:
        assert row.design is not None
        ax.loglog(w, np.abs(row.design.loop().transfer("u", "n", 1j * w)), **LOOKS[row.kind])
    ax.set(xlabel="frequency, rad per time unit", ylabel="gain from noise to u")


def _draw_nyquist(
    ax: Any, process: Process, ms: float, rows: Sequence[DesignRow], plants: Sequence[Process]
) -> None:
    w = _frequencies(rows, 0.1, 30.0)
    for row in rows:
        assert row.design is not None
        look = LOOKS[row.kind]
        for plant in plants[:PLANTS_SHOWN]:
            value = row.design.loop(plant).L(1j * w)
            ax.plot(value.real, value.imag, "-", color=look["color"], alpha=0.25, linewidth=0.6)
        value = row.design.loop(process).L(1j * w)
        ax.plot(value.real, value.imag, **look)
    angle = np.linspace(0.0, 2 * np.pi, 200)
    ax.plot(-1 + np.cos(angle) / ms, np.sin(angle) / ms, ":", color=GREY)
    ax.plot([-1], [0], "+", color=GREY)
    ax.set(xlim=(-1.9, 0.5), ylim=(-1.5, 0.9), aspect="equal")
    ax.set(xlabel="real part of L", ylabel="imaginary part of L")
