"""What makes the book readable: short cells that show something, folds that say what they hide.

As in `test_pages`, each check returns what it finds wrong, and each meets a bad sample below.
"""

import re
from pathlib import Path

import nbformat
import pytest
from looking import NARROW
from nbformat.v4 import new_code_cell, new_notebook, new_output

FOLDS = {"hide-input", "hide-cell"}


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


def notebooks(root: Path) -> list[Path]:
    return sorted(path for path in root.glob("book/**/*.ipynb") if ".ipynb_checkpoints" not in path.parts)


def test_folded_cells_show_something(root):
    assert [problem for path in notebooks(root) for problem in reading_problems(path)] == []


FETCHED = (
    "theme => [...document.querySelectorAll(`main img.only-${theme}`)].some((image) => image.naturalWidth)"
)


def test_a_phone_fetches_the_figures_of_its_theme(visit, site):
    page, _ = visit((site / "book" / "learn" / "limits.html").as_uri(), viewport=NARROW)
    assert [page.evaluate(FETCHED, theme) for theme in ("light", "dark")] == [True, False]


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


def test_a_loose_comma_is_caught():
    assert loose_marks(r'<span class="math notranslate">\(x\)</span>, and') == 1
