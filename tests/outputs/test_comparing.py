"""Check the comparison of figures: rounding passes, an error of one per cent does not."""

import io
import re

import matplotlib as mpl
import numpy as np
import pytest
from comparing import figure_difference, live_difference
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure


def drawn(x=1.0, *, size=5, label="PI", colour="#1f5fa8", until=10.0, simplify=1 / 9, picture=0.5):
    """Draw a curve, markers, an area, a colour map and words."""
    figure = Figure(figsize=(5, 3))
    FigureCanvasSVG(figure)
    left, right = figure.subplots(1, 2)
    t = np.linspace(0.0, 10.0, 3001)
    left.plot(
        t[t <= until], x * np.exp(-0.3 * t[t <= until]) * np.cos(3 * t[t <= until]), color=colour, label=label
    )
    left.plot([1, 5], [0.2 * x, 0.5 * x], "o", markersize=size)
    left.set(xlim=(0, 10), ylim=(-1, 1))
    left.legend(loc="upper right")
    right.fill_between(t, x * np.sin(t) / 3, 0.5, alpha=0.5)
    right.imshow([[0.0, picture], [0.3, 1.0]], extent=(0, 10, -1, 0), vmin=0.0, vmax=1.0)
    right.set(xlim=(0, 10), ylim=(-1, 1), aspect="auto")
    file = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": "x", "path.simplify_threshold": simplify}):
        figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    return file.getvalue()


@pytest.mark.parametrize("other", [{}, {"x": 1 + 1e-6}, {"simplify": 1 / 30}, {"picture": 0.502}], ids=str)
def test_figures_that_draw_the_same_are_equal(other):
    assert figure_difference(drawn(), drawn(**other)) is None


@pytest.mark.parametrize(
    ("other", "words"),
    [
        ({"x": 1.01}, "line2d_.*: a line is off by"),
        ({"until": 9.7}, "a line is off by"),
        ({"size": 6}, "line2d_"),
        ({"label": "IP"}, "words 'PI' stored, words 'IP' now"),
        ({"colour": "#1f5fb8"}, "#1f5fa8.* stored, .*#1f5fb8.* now"),
        ({"picture": 0.52}, "href .* stored"),
    ],
    ids=str,
)
def test_figures_that_draw_other_things_differ(other, words):
    assert re.search(words, figure_difference(drawn(), drawn(**other)))


def test_live_figures():
    html = (
        '<p>IAE 1.5</p><script type="application/json">{"kp": 2.33442, "kind": "PID", "at": [1.0]}</script>'
    )
    assert live_difference(html, html.replace("2.33442", "2.33443")) is None
    assert (
        live_difference(html, html.replace("2.33442", "2.35")) == "live figure, kp: 2.33442 stored, 2.35 now"
    )
    assert "kind" in live_difference(html, html.replace("PID", "PI"))
    assert "at" in live_difference(html, html.replace("[1.0]", "[]"))
    assert "not the same text" in live_difference(html, html.replace("1.5<", "1.6<"))
