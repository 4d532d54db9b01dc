"""What makes the book readable: short cells that show something, folds that say what they hide, words large enough.

As in `test_pages`, each check returns what it finds wrong, and each meets a bad sample below.
"""

import re
from pathlib import Path

import nbformat
import pytest
from looking import NARROW
from nbformat.v4 import new_code_cell, new_notebook, new_output

SMALLEST = 8.25  # points, 11 px: the smallest words of a figure
FOLDS = {"hide-input", "hide-cell"}
# The size of a text in an SVG of matplotlib: its outlines are drawn for 100 points and scaled.
TEXT_SCALE = re.compile(r"scale\((0?\.\d+) -0?\.\d+\)")


def code_cells(path: Path) -> list:
    return [
        cell
        for cell in nbformat.read(path, as_version=4).cells
        if cell.cell_type == "code" and cell.source.strip()
    ]


def lines(cell) -> int:
    return sum(bool(line.strip()) for line in cell.source.splitlines())


def shows(cell) -> bool:
    """Whether a reader sees a result: text, a table or a figure. What is only kept for another page is none."""
    return any(
        output.output_type in ("stream", "execute_result")
        or (output.output_type == "display_data" and "scrapbook" not in output.metadata)
        for output in cell.outputs
    )


def reading_problems(path: Path) -> list[str]:
    cells = code_cells(path)
    wrong = []
    for number, cell in enumerate(cells, 1):
        tags = set(cell.metadata.get("tags", []))
        if tags & FOLDS and not shows(cell):
            wrong.append(f"cell {number}: folded, and nothing to see")
    return [f"{path.name}: {problem}" for problem in wrong]


def small_words(site: Path) -> list[str]:
    """Figures with words below 11 px; superscripts and subscripts are parts of a word."""
    wrong = []
    for path in sorted(site.glob("_images/*.svg")):
        sizes = [100 * float(scale) for scale in TEXT_SCALE.findall(path.read_text(encoding="utf-8"))]
        if sizes and min(sizes) < SMALLEST:
            wrong.append(f"{path.name}: words of {min(sizes):.3g} points")
    return wrong


FIGURE = re.compile(r'<img\b[^>]*\bsrc="[^"]*_images/([^"]+\.svg)"[^>]*>')
ON_A_PHONE = re.compile(r"--phone: (\d+)px")
PX = 4 / 3  # of a point


def sizes_on_a_phone(site: Path) -> dict[str, tuple[float, float]]:
    """The smallest words of each figure in px, and how many px of its width are more than these need."""
    found = {}
    for page in site.rglob("*.html"):
        for image in FIGURE.finditer(page.read_text(encoding="utf-8")):
            svg = (site / "_images" / image[1]).read_text(encoding="utf-8")
            smallest = min((100 * PX * float(scale) for scale in TEXT_SCALE.findall(svg)), default=None)
            if smallest and "landing" not in image[0]:  # which is drawn for a phone
                width = PX * float(re.search(r'<svg [^>]*?width="([\d.]+)pt"', svg)[1])
                phone = float(ON_A_PHONE.search(image[0])[1])
                found[image[1]] = (smallest * phone / width, phone - width * min(1, 11 / smallest))
    return found


def notebooks(root: Path) -> list[Path]:
    return sorted(path for path in root.glob("book/**/*.ipynb") if ".ipynb_checkpoints" not in path.parts)


def test_folded_cells_show_something(root):
    assert [problem for path in notebooks(root) for problem in reading_problems(path)] == []


FETCHED = (
    "theme => [...document.querySelectorAll(`main img.only-${theme}`)].some((image) => image.naturalWidth)"
)


def test_words_of_figures_can_be_read_on_a_phone(site):
    assert small_words(site) == []


def test_figures_on_a_phone_are_as_small_as_their_words_allow(site):
    sizes = sizes_on_a_phone(site)
    assert len(sizes) > 50
    assert [name for name, (words, more) in sizes.items() if words < 11 or more > 1] == []


def test_a_phone_shows_figures_in_that_size_and_fetches_those_of_its_theme(visit, site):
    page, _ = visit((site / "book" / "learn" / "limits.html").as_uri(), viewport=NARROW)
    assert [page.evaluate(FETCHED, theme) for theme in ("light", "dark")] == [True, False]
    figure = page.locator("#fig-learn-5-first img.only-light")
    assert figure.bounding_box()["width"] == float(ON_A_PHONE.search(figure.get_attribute("style"))[1])


def loose_marks(page: str) -> int:
    """Formulas of a line whose comma a browser may put on the next one."""
    return len(re.findall(r'(?<!<span class="tied">)<span class="math [^>]*>[^<]*</span>[,.;:!?)]', page))


def test_a_formula_keeps_its_comma(site):
    pages = list(site.glob("book/**/*.html"))
    assert len(pages) > 20
    assert [page.name for page in pages if loose_marks(page.read_text(encoding="utf-8"))] == []


# --- and a bad one is caught -------------------------------------------------

SHOWN = new_output("execute_result", data={"text/plain": "2"}, execution_count=1)
KEPT = new_output("display_data", data={"text/plain": "2"}, metadata={"scrapbook": {"name": "two"}})


def cell(source="1 + 1", *outputs, tags=()):
    return new_code_cell(source, outputs=list(outputs), metadata={"tags": list(tags)})


BAD = {
    "folded, and nothing to see": [cell("x = 1", tags=["hide-input"])],
    "cell 1: folded, and nothing to see": [cell("x = 1", KEPT, tags=["hide-cell"])],
}


@pytest.mark.parametrize(("problem", "cells"), BAD.items(), ids=BAD)
def test_bad_notebook_is_caught(problem, cells, tmp_path):
    path = tmp_path / "bad.ipynb"
    nbformat.write(new_notebook(cells=cells), path)
    (found,) = reading_problems(path)
    assert problem in found


def test_good_notebook_passes(tmp_path):
    path = tmp_path / "good.ipynb"
    nbformat.write(new_notebook(cells=[cell("x = 1"), cell("x + 1", SHOWN, tags=["hide-input"])]), path)
    assert reading_problems(path) == []


def test_small_words_are_caught(tmp_path):
    (tmp_path / "_images").mkdir()
    (tmp_path / "_images" / "good.svg").write_text('<g transform="translate(1 2) scale(0.1 -0.1)"><use/></g>')
    (tmp_path / "_images" / "bad.svg").write_text(
        '<g transform="translate(1 2) scale(0.07 -0.07)"><use/></g>'
    )
    assert small_words(tmp_path) == ["bad.svg: words of 7 points"]


def test_a_loose_comma_is_caught():
    assert loose_marks(r'<span class="math notranslate">\(x\)</span>, and') == 1
