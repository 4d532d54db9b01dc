"""Draw figures of responses and loops.

With `use_book_style`, the figures are also legible in grey.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.projections import register_projection
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab._check import Array
from pidalab._text import KINDS
from pidalab.controllers import Controller, HighOrderPID
from pidalab.loop import Loop
from pidalab.process import Process
from pidalab.response import Response
from pidalab.style import GREY, STYLE, BookAxes

LINE_POINTS = 4000  # largest number of points of a line
# Largest number of points of a noisy line. Matplotlib cannot simplify a noisy line, so a vector file would store nearly
# all its points.
NOISY_POINTS = 400


def use_book_style() -> None:
    """Configure matplotlib for the book, with transparent SVG that is identical in every run.

    A line whose label names a kind of controller gets the colour and dash of that kind.

    Examples
    --------
    >>> from pidalab import plots
    >>> plots.use_book_style()
    """
    mpl.rcParams.update(STYLE)  # type: ignore[arg-type]
    register_projection(BookAxes)
    try:
        from matplotlib_inline.backend_inline import set_matplotlib_formats
    except ImportError:  # this is not a notebook
        return
    set_matplotlib_formats("svg", metadata={"Date": None, "Creator": None})  # type: ignore[no-untyped-call]
    if "inline" in mpl.get_backend():
        # Figures are shown when a cell ends. The hook of pyplot would draw each of them a second time.
        plt.uninstall_repl_displayhook()


def thin(t: Array, x: Array, points: int = LINE_POINTS) -> tuple[Array, Array]:
    """Reduce a long line to few points, keeping the extremes of every section.

    Parameters
    ----------
    t, x : ndarray, shape (n,)
        The line.
    points : int, optional
        Approximate number of points to keep.

    Returns
    -------
    t, x : ndarray
        First, smallest, largest and last point of each section, in order of time.

    Examples
    --------
    >>> import numpy as np
    >>> from pidalab import plots
    >>> t = np.linspace(0.0, 1.0, 10001)
    >>> plots.thin(t, np.sin(50 * t), points=400)[0].size <= 400
    True
    """
    if x.size <= points:
        return t, x
    keep = [np.array([0, x.size - 1])]
    for stretch in np.array_split(np.arange(x.size), max(1, points // 4)):
        keep.append(stretch[[0, int(np.argmin(x[stretch])), int(np.argmax(x[stretch])), -1]])
    i = np.unique(np.concatenate(keep))
    return t[i], x[i]


def signal(
    ax: Axes,
    responses: Mapping[str, Response],
    name: str,
    until: float | None = None,
    faint: Mapping[str, Response] | None = None,
) -> None:
    """Draw one signal of several responses.

    Parameters
    ----------
    ax : Axes
        Axes to draw into.
    responses : mapping of str to Response
        Responses to draw. The keys are the labels of the lines.
    name : {"y", "u", "e"}
        Signal to draw.
    until : float, optional
        End of the time axis. By default the end of the records.
    faint : mapping of str to Response, optional
        Faint lines behind the others, without label, such as single noisy runs. Each has the colour of the response
        with the same key.

    Raises
    ------
    TypeError
        If `ax` is not an Axes, or if `responses` is not a mapping of labels to responses.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> import matplotlib.pyplot as plt
    >>> r = pidalab.step_response(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.3), np.linspace(0, 20, 201))
    >>> figure, ax = plt.subplots()
    >>> pidalab.plots.signal(ax, {"P": r}, "y")
    >>> ax.get_xlabel()
    'time units'
    """
    _require_axes(ax)
    _require_by_label("responses", responses, Response)
    for label, response in responses.items():
        end = response.t <= (until or response.t[-1]) * (1 + 1e-9)
        (line,) = ax.plot(*thin(response.t[end], getattr(response, name)[end]), label=label, zorder=3)
        if faint and label in faint:
            run = faint[label]
            end = run.t <= (until or run.t[-1]) * (1 + 1e-9)
            style: dict[str, Any] = {"color": line.get_color(), "alpha": 0.35, "linewidth": 0.6}
            ax.plot(*thin(run.t[end], getattr(run, name)[end], NOISY_POINTS), "-", **style)
    ax.set_xlabel("time units")
    ax.set_xlim(0, until)


def experiment(
    runs: Mapping[str, Response], y_label: str, u_label: str, time_label: str = "time units"
) -> Figure:
    """Draw set point and outputs of several runs of an experiment, and the control signals below.

    Parameters
    ----------
    runs : mapping of str to Response
        Responses by label, all with the same set point.
    y_label, u_label, time_label : str, optional
        Axis labels, with units.

    Returns
    -------
    Figure
        Figure with two axes.

    Raises
    ------
    TypeError, ValueError
        If `runs` is not a mapping of labels to responses, or if their times or set points differ.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> r = pidalab.step_response(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.3), np.linspace(0, 20, 201))
    >>> len(pidalab.plots.experiment({"P": r}, "level, m", "valve, %", "time, s").axes)
    2
    """
    _require_by_label("runs", runs, Response)
    if not runs:
        raise TypeError("runs must be a dictionary of labels and responses, found an empty one")
    first = next(iter(runs.values()))
    for label, run in runs.items():
        if not np.array_equal(run.t, first.t) or not np.array_equal(run.r, first.r):
            raise ValueError(f"runs must have the same times and set point, found others in {label!r}")
    figure, axes = plt.subplots(2, 1, figsize=(6.4, 4.8), sharex=True)
    axes[0].plot(*thin(first.t, first.r), "-", color=GREY, linewidth=1.0, drawstyle="steps-post")
    for ax, name, label in zip(axes, "yu", (y_label, u_label), strict=True):
        signal(ax, runs, name)
        ax.set(ylabel=label, xlabel="")
    axes[1].set(xlabel=time_label, xlim=(0, first.t[-1]))
    axes[0].legend(ncols=3, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    return figure


def maps(
    x: ArrayLike,
    y: ArrayLike,
    values: Mapping[str, ArrayLike],
    levels: Sequence[float],
    label: str,
    names: tuple[str, str] = ("θ/τ", "ξ"),
) -> Figure:
    """Draw maps of quantities that depend on two parameters, two maps in a row, with a common scale.

    Parameters
    ----------
    x, y : array_like, shape (n,) and (m,)
        Values of the parameters, above 0. The axis of x is logarithmic.
    values : mapping of str to array_like, shape (m, n)
        Maps to draw. The keys are the titles. Values that are not finite, such as those of unstable loops, are hatched.
    levels : sequence of float
        Limits of the shades. Values below the first limit have the first shade, and values above the last limit an
        additional shade.
    label : str
        Label of the scale.
    names : tuple of str, optional
        Labels of x and y.

    Returns
    -------
    Figure
        Figure with the maps and the scale.

    Raises
    ------
    ValueError
        If the shape of a map is not (m, n).

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> ratio, damping = np.array([0.1, 0.5, 2.0]), np.array([0.3, 1.0])
    >>> both = {"sum": damping[:, None] + ratio, "product": damping[:, None] * ratio}
    >>> figure = pidalab.plots.maps(ratio, damping, both, [0, 1, 2], "a number")
    >>> [ax.get_title() for ax in figure.axes]
    ['sum', 'product', '']
    """
    x, y = _check.vector("x", x), _check.vector("y", y)
    rows = math.ceil(len(values) / 2)
    size = 6.4, 0.4 + 2.6 * rows
    figure, axes = plt.subplots(rows, 2, figsize=size, sharex=True, sharey=True, squeeze=False)
    for ax, (title, value) in zip(axes.flat, values.items(), strict=False):
        drawn = np.asarray(value, float)
        if drawn.shape != (y.size, x.size):
            raise ValueError(f"values[{title!r}] must have the shape {y.size, x.size}, found {drawn.shape}")
        drawn = np.where(np.isfinite(drawn), np.maximum(drawn, levels[0]), np.nan)
        ax.patch.set(hatch="////", edgecolor=GREY)
        shades = ax.contourf(x, y, drawn, levels, cmap="viridis_r", extend="max")
        ax.grid(False)
        ax.set(xscale="log", title=title, xticks=[tick for tick in (0.1, 0.3, 1, 2) if x[0] <= tick <= x[-1]])
        ax.xaxis.set_major_formatter("{x:g}")
        ax.minorticks_off()
    for ax in axes[-1]:
        ax.set_xlabel(names[0])
    for ax in axes[:, 0]:
        ax.set_ylabel(names[1])
    scale = figure.colorbar(shades, ax=axes, label=label, format="{x:g}")
    for i, patch in enumerate(scale.ax.findobj(PathPatch)):
        patch.set_gid(f"as-drawn-{i}")  # dark mode does not recolour the shade above the last level
    return figure


def legend(figure: Figure, ncols: int = 3, **more: Any) -> None:
    """Add a common legend to a figure, with each label once.

    Parameters
    ----------
    figure : Figure
        Figure with labelled lines.
    ncols : int, optional
        Number of labels in a row.
    **more
        Further arguments of `matplotlib.figure.Figure.legend`. By default ``loc`` is "outside upper left".

    Examples
    --------
    >>> import matplotlib.pyplot as plt, pidalab
    >>> figure, axes = plt.subplots(1, 2, layout="constrained")
    >>> for ax in axes:
    ...     _ = ax.plot([0, 1], [0, 1], label="PI")
    >>> pidalab.plots.legend(figure)
    >>> [text.get_text() for text in figure.legends[0].get_texts()]
    ['PI']
    """
    handles: dict[str, Any] = {}
    for ax in figure.axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    place: dict[str, Any] = {"loc": "outside upper left", "ncols": ncols} | more
    figure.legend(list(handles.values()), list(handles), **place)


def label_lines(ax: Axes, at: Mapping[str, float], below: Collection[str] = ()) -> None:
    """Write the label of each line next to the line and in its colour, instead of a legend.

    The positions depend on the scales and limits of the axes, so set these before the call.

    Parameters
    ----------
    ax : Axes
        Axes with labelled lines.
    at : mapping of str to float
        Position of each label on the x axis, in units of the data.
    below : collection of str, optional
        Labels that are written below their lines instead of above.

    Raises
    ------
    TypeError, ValueError
        If `ax` is not an Axes, or if a label belongs to no line.

    Examples
    --------
    >>> import matplotlib.pyplot as plt, pidalab
    >>> figure, ax = plt.subplots()
    >>> _ = ax.plot([0, 1, 2], [0, 1, 1], label="PI")
    >>> pidalab.plots.label_lines(ax, {"PI": 1.5})
    >>> ax.texts[0].get_text()
    'PI'
    """
    _require_axes(ax)
    lines, (bottom, _) = {str(line.get_label()): line for line in ax.get_lines()}, ax.get_ylim()
    for label, x in at.items():
        if label not in lines:
            raise ValueError(f"keys of 'at' must be labels of lines in 'ax' ({list(lines)}), found {label!r}")
        points = ax.transData.transform(lines[label].get_xydata())
        here = float(ax.transData.transform((x, bottom))[0])
        before, y, after = np.interp([here - 5, here, here + 5], *points.T)
        up = -1 if label in below else 1
        # Where the line slopes, shift the label to the side that the line does not cross.
        side = 0 if abs(after - before) < 0.5 else int(np.sign(before - after)) * up
        place: dict[str, Any] = {"ha": ("center", "left", "right")[side], "va": "bottom" if up > 0 else "top"}
        x, y = ax.transData.inverted().transform((here, y))
        away: dict[str, Any] = {"xytext": (3 * side, 3 * up), "textcoords": "offset points"}
        ax.annotate(label, (x, y), **away, **place, color=lines[label].get_color())


def nyquist(ax: Axes, loops: Mapping[str, Loop], frequencies: Array, ms: float | None = None) -> None:
    """Draw L(jw) near the critical point, with the circle of a given Ms.

    Parameters
    ----------
    ax : Axes
        Axes to draw into.
    loops : mapping of str to Loop
        Loops by the labels of their curves.
    frequencies : ndarray
        Frequencies in rad per time unit.
    ms : float, optional
        Maximum sensitivity, drawn as the circle with radius 1/ms around -1, which L must not enter.

    Raises
    ------
    TypeError, ValueError
        If an argument is not valid, such as `loops` without labels.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> import matplotlib.pyplot as plt
    >>> figure, ax = plt.subplots()
    >>> loop = pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.5)
    >>> pidalab.plots.nyquist(ax, {"P": loop}, np.logspace(-1, 1, 100), ms=1.6)
    """
    radius = None if ms is None else 1 / _check.real("ms", ms, at_least=1.0)
    _require_axes(ax)
    _require_by_label("loops", loops, Loop)
    w = _check.vector("frequencies", frequencies)
    for label, loop in loops.items():
        value = loop.L(1j * w)
        ax.plot(value.real, value.imag, label=label)
    if radius is not None:
        angle = np.linspace(0, 2 * np.pi, 200)
        ax.plot(-1 + radius * np.cos(angle), radius * np.sin(angle), ":", color=GREY, linewidth=1.2)
    ax.plot([-1], [0], "+", color=GREY, markersize=9)
    ax.set(aspect="equal", xlabel="real part", ylabel="imaginary part")


def magnitude(ax: Axes, curves: Mapping[str, Array], frequencies: Array) -> None:
    """Draw magnitudes over frequency on logarithmic axes.

    Parameters
    ----------
    ax : Axes
        Axes to draw into.
    curves : mapping of str to ndarray
        Complex or real values by the labels of their curves.
    frequencies : ndarray
        Frequencies in rad per time unit.

    Raises
    ------
    TypeError, ValueError
        If an argument is not valid, such as `curves` without labels.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> import matplotlib.pyplot as plt
    >>> figure, ax = plt.subplots()
    >>> w = np.logspace(-1, 1, 100)
    >>> pidalab.plots.magnitude(ax, {"S": pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.5).S(1j * w)}, w)
    """
    _require_axes(ax)
    _require_by_label("curves", curves, np.ndarray)
    frequencies = _check.vector("frequencies", frequencies)
    for label, values in curves.items():
        ax.loglog(*thin(frequencies, np.abs(values)), label=label)
    ax.set(xlabel="frequency, rad per time unit", ylabel="magnitude")


class _LiveFigure:
    """Content of a live figure, stored as JSON in a script element for the scripts of the page."""

    def __init__(self, state: Mapping[str, Any]) -> None:
        self.state = dict(state)

    def __repr__(self) -> str:
        return f"live figure: {', '.join(self.state['names'])}"

    def _repr_html_(self) -> str:
        text = json.dumps(self.state, ensure_ascii=False).replace("<", "\\u003c")
        return f'<script type="application/json">{text}</script>'


def live(plant: str | Process, controllers: Mapping[str, Controller], **more: Any) -> _LiveFigure:
    """Make a live figure of the book.

    Call the function in a cell inside ``<div class="pidalab-live">``. This div becomes a figure with controls. Readers
    without JavaScript see the figure that the cell draws.

    Parameters
    ----------
    plant : str or Process
        Name of a plant of the lab, such as "lags3", or a process. With a process, ``conditions`` must contain ``end``,
        the end of the time axis.
    controllers : mapping of str to HighOrderPID
        PI, PID or PIDA controllers by name. Their numbers are passed with six digits.
    **more : Any
        Further options of the figure: ``knobs``, ``plots``, ``numbers``, ``rule``, ``ms``, ``conditions``, ``lab``. The
        comment at the top of book/_static/lab/live.js describes them.

    Returns
    -------
    object
        Object that the notebook displays. Its ``state`` contains all options.

    Raises
    ------
    TypeError, ValueError
        If a controller is not a PI, PID or PIDA of the type HighOrderPID, or if a process is given without ``end``.

    Examples
    --------
    >>> import pidalab
    >>> pi = pidalab.HighOrderPID([0.5, 1.0], filter_time=0.1, filter_order=1)
    >>> pidalab.plots.live("lags3", {"PI": pi}, plots=["load"]).state["designs"][0]["ti"]
    2.0
    """
    _require_by_label("controllers", controllers, HighOrderPID)
    designs = [_design(name, controller) for name, controller in controllers.items()]
    if isinstance(plant, Process):
        if not more.get("conditions", {}).get("end", 0) > 0:
            raise ValueError("conditions must have an end (of the time axis) above 0 if plant is a Process")
        numbers = {"num": plant.num.tolist(), "den": plant.den.tolist(), "delay": plant.delay}
        more["plant"] = {name: _six_digits(value) for name, value in numbers.items()}
    return _LiveFigure({"plant": plant, "designs": designs, "names": list(controllers), **more})


def _design(name: str, controller: Any) -> dict[str, Any]:
    """Convert a controller to the form of the lab: the standard form with a binomial filter."""
    gains = controller.coefficients
    if not 2 <= len(gains) <= 4 or gains[0] == 0 or gains[1] == 0:
        raise ValueError(f"controllers[{name!r}] must be a PI, PID or PIDA, found gains {list(gains)}")
    values = {**controller.gains().standard()._asdict(), "filterTime": controller.filter_time}
    rounded = {key: _six_digits(value) for key, value in values.items()}
    return {"kind": KINDS[len(gains) - 2], **rounded, "filterOrder": controller.filter_order}


def _six_digits(value: Any) -> Any:
    """Round a number, or each number of a list, so that a stored page is identical on every machine."""
    return [_six_digits(each) for each in value] if isinstance(value, list) else float(f"{value:.6g}")


def _require_axes(ax: Any) -> None:
    if not isinstance(ax, Axes):
        raise TypeError(f"ax must be one of matplotlib's Axes, found {type(ax).__name__}")


def _require_by_label(name: str, values: Any, kind: type) -> None:
    """Raise unless `values` is a mapping of labels to objects of one type."""
    what = f"{name} must be a dictionary of labels and values of type {kind.__name__}"
    if not isinstance(values, Mapping):
        raise TypeError(f"{what}, found {type(values).__name__}")
    for label, value in values.items():
        if not isinstance(value, kind):
            raise TypeError(f"{what}, found {type(value).__name__} at {label!r}")
