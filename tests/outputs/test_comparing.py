"""Figures compared by what they draw: rounding passes, an error of one per cent in a curve of a page does not."""

import io
import re
import shutil
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import nbformat
import numpy as np
import pytest
from comparing import figure_difference, live_difference
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "book" / "learn" / "what-acceleration-does.ipynb"
LINE = re.compile(
    r'(<g id="line2d_\d+">\s*<path d=")([^"]*)(" clip-path="[^"]*" style="fill: none; stroke: #1f5fa8)'
)
TICK = re.compile(
    r'<g id="ytick_\d+">.*?<use xlink:href="#\w+" x="\S+" y="(\S+)".*?<text[^>]*>([^<]+)</text>', re.DOTALL
)


def code(page):
    """Cells of code of a page."""
    return [cell for cell in nbformat.read(page, as_version=4).cells if cell.cell_type == "code"]


def first_figure(page):
    """Number of the first cell with a figure, and the figure."""
    return next(
        (k, output["data"]["image/svg+xml"])
        for k, cell in enumerate(code(page))
        for output in cell.outputs
        if "image/svg+xml" in output.get("data", {})
    )


def wrong(svg, factor):
    """Multiply the values of a figure's first curve, which are read from the ticks of its linear axis."""
    places, values = zip(*TICK.findall(svg), strict=True)
    slope, zero = np.polyfit([float(value.replace("−", "-")) for value in values], [*map(float, places)], 1)
    assert slope < 0

    def moved(point):
        return f"{point[1]} {point[2]} {zero + factor * (float(point[3]) - zero):.6f}"

    found, count = LINE.subn(
        lambda line: line[1] + re.sub(r"([ML]) (\S+) (\S+)", moved, line[2]) + line[3], svg, count=1
    )
    assert count == 1
    return found


def drawn(x=1.0, *, size=5, label="PI", colour="#1f5fa8", until=10.0, simplify=1 / 9, picture=0.5):
    """Draw some of everything: a curve, markers, an area, a map of colours, and words."""
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


def test_one_per_cent_in_a_curve_of_a_page_is_seen():
    svg = first_figure(PAGE)[1]
    assert figure_difference(svg, wrong(svg, 1.0)) is None
    assert figure_difference(svg, wrong(svg, 1 + 1e-5)) is None
    assert re.search(r"axes_1, line2d_\d+: a line is off by", figure_difference(svg, wrong(svg, 1.01)))


def test_nbval_sees_it_too(tmp_path):
    """A page's first figure made anew in a notebook, beside a curve that rounding moved, and one that is wrong."""
    (tmp_path / "book").mkdir()
    shutil.copy(ROOT / "book" / "conftest.py", tmp_path / "book")
    for folder in ("tests", "tools"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    last, svg = first_figure(PAGE)
    for name, factor in {"rounding": 1 + 1e-5, "per-cent": 1.01}.items():
        cells = code(PAGE)[: last + 1]
        for output in cells[last].outputs:
            if "image/svg+xml" in output.get("data", {}):
                output["data"]["image/svg+xml"] = wrong(svg, factor)
        nbformat.write(nbformat.v4.new_notebook(cells=cells), tmp_path / "book" / f"{name}.ipynb")
    options = [
        "--nbval",
        "--nbval-current-env",
        "-q",
        "--tb=short",
        "-p",
        "no:cacheprovider",
        "-p",
        "no:xdist",
    ]
    paths = ["-c", ROOT / "pyproject.toml", f"--rootdir={tmp_path}", tmp_path / "book"]
    run = subprocess.run(
        [sys.executable, "-m", "pytest", *options, *paths],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    failed = re.findall(r"^FAILED (\S+)", run.stdout, flags=re.MULTILINE)
    assert failed == ["book/per-cent.ipynb::Cell"], run.stdout + run.stderr
    assert "a line is off by" in run.stdout


@pytest.mark.parametrize("other", [{}, {"x": 1 + 1e-6}, {"simplify": 1 / 30}, {"picture": 0.502}], ids=str)
def test_what_draws_the_same(other):
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
def test_what_does_not(other, words):
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
