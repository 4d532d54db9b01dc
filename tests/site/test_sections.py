"""The index of the search: the sections of a page, each with its own words."""

import importlib.util
import re

import nbformat
import pytest
from docutils.nodes import make_id

PAGE = """
<section id="one"><h1>First <em>title</em><a class="headerlink">#</a></h1>
<p>Some <b>words</b> and <span class="math">\\(x^2\\)</span>.<br></p>
<div class="exercise"><section id="inner"><p>A task.</p></section></div>
<div class="cell_input">code()</div><table class="dataframe"><tr><td>7</td></tr></table>
<details><summary>fold</summary></details>
<section id="two"><h2>Second</h2><p>More.</p>
<dl><dt class="sig" id="pidalab.tune">tune(process)</dt>
<dd>Tune a loop.<dl class="field-list"><dt>Returns</dt><dd>Design</dd></dl></dd></dl>
</section></section><p>Nowhere.</p>
"""


@pytest.fixture(scope="module")
def search(root):
    spec = importlib.util.spec_from_file_location(
        "section_search", root / "book" / "_ext" / "section_search.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_each_section_has_its_own_words(search):
    assert search.sections(PAGE) == [
        ("one", "First title", "Some words and x^2 . A task."),
        ("two", "Second", "More."),
        ("pidalab.tune", "pidalab.tune", "Tune a loop. Returns Design"),
    ]


def test_a_title_is_plain_text(search):
    assert search.words_of("1. The <em>PIDA</em> &amp; more") == "1. The PIDA & more"


def anchors(page):
    """Anchors of the headings of a page's source."""
    if page.suffix == ".ipynb":
        cells = nbformat.read(page, as_version=4).cells
        text = "\n".join(cell.source for cell in cells if cell.cell_type == "markdown")
    else:
        text = page.read_text(encoding="utf-8")
    return {make_id(heading) for heading in re.findall(r"^#+ (.*)$", text, re.MULTILINE)}


def test_sections_with_words_of_readers_exist(search, root):
    """Those of the reference are made by Sphinx; the tests in the browser look for them."""
    missing = []
    for address in search.ALSO:
        name, anchor = address.split(".html#")
        (page,) = root.glob(f"{name}.*")
        if not name.startswith("book/api/") and anchor not in anchors(page):
            missing.append(address)
    assert missing == []
