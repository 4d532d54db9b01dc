"""Check the book's notebooks and built pages without a browser."""

import importlib
import re
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag, urlsplit

import evidence
import nbformat
import pytest
import sheets
import vendored

from paperledger import papers

# --- notebooks ---------------------------------------------------------------


def notebooks(root: Path) -> list[Path]:
    return sorted(path for path in root.glob("book/**/*.ipynb") if ".ipynb_checkpoints" not in path.parts)


FOLDS = {"hide-input", "hide-cell"}


def shows(output) -> bool:
    """Return True if a reader sees an output. An output that is kept for another page is hidden."""
    return "scrapbook" not in output.get("metadata", {})


def notebook_problems(path: Path) -> list[str]:
    """List outputs that are missing, failed, out of order or without words, and empty folds."""
    cells = [
        cell
        for cell in nbformat.read(path, as_version=4).cells
        if cell.cell_type == "code" and cell.source.strip()
    ]
    wrong = []
    if cells and not any(cell.outputs for cell in cells):
        wrong.append("no stored output: run `make notebooks`")
    counts = [cell.execution_count for cell in cells]
    if counts != list(range(1, len(cells) + 1)):
        wrong.append(f"cells not run in order: {counts}")
    for number, cell in enumerate(cells, 1):
        for output in cell.outputs:
            if output.output_type == "error":
                wrong.append(f"cell {number}: error {output.ename}")
            if output.get("name") == "stderr":
                wrong.append(f"cell {number}: text on stderr")
        if FOLDS & {*cell.metadata.get("tags", [])} and not any(map(shows, cell.outputs)):
            wrong.append(f"cell {number}: folded, and nothing to see")
        if any({"image/svg+xml", "image/png"} & output.get("data", {}).keys() for output in cell.outputs):
            mystnb = cell.metadata.get("mystnb", {})
            wrong += [
                f"cell {number}: figure without {word} (metadata mystnb.{where}.{word})"
                for where, word in (("figure", "caption"), ("image", "alt"))
                if not mystnb.get(where, {}).get(word, "").strip()
            ]
    return [f"{path.name}: {problem}" for problem in wrong]


# --- built pages -------------------------------------------------------------

LOADING_ATTRIBUTES = {"src", "poster", "data"}
LOADS = "stylesheet icon preload prefetch modulepreload preconnect dns-prefetch manifest"  # by a link with this rel


class Page(HTMLParser):
    """Anchors, links, loaded addresses, heading and words of a page."""

    def __init__(self, text: str):
        super().__init__()
        self.anchors, self.links, self.loads = set(), [], []
        self.open = {"article": 0, "h1": 0, "p": 0, "td": 0}
        self.heading = self.words = ""  # title, paragraphs and tables of the article
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attrs = {name: value or "" for name, value in attrs}
        if tag in self.open:
            self.open[tag] += 1
        self.anchors |= {attrs[key] for key in ("id", "name") if key in attrs}
        self.loads += [attrs[name] for name in LOADING_ATTRIBUTES & attrs.keys() if attrs[name]]
        if "href" in attrs:
            loading = tag == "link" and set(LOADS.split()) & set(attrs.get("rel", "").split())
            (self.loads if loading else self.links).append(attrs["href"])
        if tag == "meta" and attrs.get("http-equiv", "").lower() == "refresh":
            self.links.append(attrs["content"].partition("url=")[2])

    def handle_endtag(self, tag):
        if tag in self.open:
            self.open[tag] -= 1

    def handle_data(self, data):
        if self.open["article"] and self.open["h1"]:
            self.heading += data.strip(" #\n")
        elif self.open["article"] and (self.open["p"] or self.open["td"]):
            self.words += data.strip()


@cache
def read_pages(site: Path) -> dict[Path, Page]:
    paths = (path for path in sorted(site.rglob("*.html")) if "_static" not in path.parts)
    return {path: Page(path.read_text(encoding="utf-8")) for path in paths}


# --- whole book --------------------------------------------------------------


def test_every_page_of_the_toc_is_built(toc, site):
    built = read_pages(site)
    pages = {name: built.get(site / f"{name}.html") for name in toc}
    assert [name for name, page in pages.items() if not (page and page.heading and page.words)] == []


def test_no_figure_is_black_in_the_dark(site):
    twins = list((site / "_images").glob("*-dark.svg"))
    assert twins
    black = re.compile(r"""["' :](#000|#000000|black)\b""")
    assert [twin.name for twin in twins if black.search(twin.read_text(encoding="utf-8"))] == []


def test_notebooks(root, toc):
    paths = notebooks(root)
    assert paths
    assert {path.relative_to(root).with_suffix("").as_posix() for path in paths} <= set(toc)
    assert [problem for path in paths for problem in notebook_problems(path)] == []


def test_no_link_is_broken(site):
    """Links and loaded files lead to files of the site, and anchors to places on the page."""
    pages, wrong = read_pages(site), []
    for path, page in pages.items():
        for address in page.links + page.loads:
            if urlsplit(address).scheme or urlsplit(address).netloc:
                continue
            file, anchor = urldefrag(address)
            target = (path.parent / unquote(file)).resolve() if file.partition("?")[0] else path
            target = target.with_name(target.name.partition("?")[0])
            if not target.is_file():
                wrong.append(f"{path.relative_to(site)}: {address} is not there")
            elif anchor == "slides" or (file.endswith("lab.html") and anchor.startswith("lab-")):
                continue  # not an anchor, but slides or a state of the lab
            elif anchor and target in pages and unquote(anchor) not in pages[target].anchors:
                wrong.append(f"{path.relative_to(site)}: {address} has no such anchor")
    assert wrong == []


def loose_marks(page: str) -> int:
    """Count formulas whose comma or bracket a browser may put on another line."""
    tied = '<span class="tied">'
    after = rf'(?<!{tied})(?<!{tied}\()<span class="math [^>]*>[^<]*</span>[,.;:!?)]'
    return len(re.findall(after, page)) + len(re.findall(rf'(?<!{tied})\(<span class="math ', page))


def test_a_formula_keeps_its_comma(site):
    pages = list(site.glob("book/**/*.html"))
    assert len(pages) > 20
    assert [page.name for page in pages if loose_marks(page.read_text(encoding="utf-8"))] == []


# --- lectures and chapters --------------------------------------------------------------------------------------------

RUN = "\n<a cell that ran>\n"
ANSWER = re.compile(r"\{solution-start\}[^\n]*\n(?::class:[^\n]*\n)?```(.*?)```\{solution-end\}", re.DOTALL)
LIVE, IN_THE_LAB = 'class="pidalab-live"', '"lab": true'


def cells_of(path: Path) -> list:
    return nbformat.read(path, as_version=4).cells


@pytest.fixture(scope="module")
def lessons(root) -> dict[str, list]:
    """Return the cells of lectures and chapters."""
    paths = sorted(root.glob("book/learn/*.ipynb"))
    paths += [root / "book" / f"{paper}.ipynb" for paper in papers(root / "book" / "ledger")]
    assert len(paths) == 11
    return {path.name: cells_of(path) for path in paths}


def test_every_exercise_has_an_answer_in_words_that_was_run(lessons):
    """Each answer has a sentence, and a cell that printed or drew something."""
    for name, cells in lessons.items():
        text = "\n".join(RUN if c.cell_type == "code" and c.outputs else c.source for c in cells)
        answers = ANSWER.findall(text)
        assert text.count("```{exercise}") == len(answers), name
        for answer in answers:
            words = answer.replace(RUN, "")
            assert RUN in answer, (name, answer)
            assert "." in words, (name, answer)
            assert len(re.findall(r"\w+", words)) >= 5, (name, answer)


def test_every_live_figure_leads_to_the_lab_with_its_loops(lessons):
    for name, cells in lessons.items():
        code = [cell for cell in cells if cell.cell_type == "code"]
        shown = [output.get("data", {}).get("text/html", "") for cell in code for output in cell.outputs]
        assert (
            sum(IN_THE_LAB in html for html in shown) == sum(cell.source.count(LIVE) for cell in cells) > 0
        ), name


def test_every_fold_of_code_says_what_it_shows(root):
    """Names are unique on a page."""
    for path in sorted((root / "book").rglob("*.ipynb")):
        hidden = [c for c in cells_of(path) if {"hide-input", "hide-cell"} & set(c.metadata.get("tags", []))]
        names = [c.metadata.get("mystnb", {}).get("code_prompt_show") for c in hidden]
        assert all(name and name.startswith("Code: ") for name in names), path.name
        assert len(set(names)) == len(names), path.name


# --- sheets, search, evidence, licences ------------------------------------------------------------------------------

DATA = {
    "slips": [
        {"value": 0.4, "word": "The inverse."},
        {"of": "gm", "word": "The margin it has."},
        {"given": {"kp": 2, "ti": 3}, "word": "Too bold."},
        {"given": {"order": [1, 0]}, "word": "The other way."},
        {"when": {"ms": [1.5, 1.6]}, "word": "Used up."},
    ],
    "items": [{"name": "A"}, {"name": "B"}],
    "reasons": [{"text": "it is fast", "word": "It is slow."}, {"text": "it leads", "right": True}],
}


def test_sheets_print_the_word_for_each_wrong_answer():
    assert sheets.said(DATA) == [
        ("0.4", "The inverse."),
        ("gm", "The margin it has."),
        ("kp 2, ti 3", "Too bold."),
        ("B, A", "The other way."),
        ("ms from 1.5 to 1.6", "Used up."),
        ("it is fast", "It is slow."),
    ]


@pytest.mark.parametrize(("kind", "shown"), [(name, shown) for name, (_, shown) in sheets.KINDS.items()])
def test_a_sheet_has_every_task_and_what_is_for_its_reader(site, kind, shown):
    soup = sheets.sheet("Tasks", shown)
    tasks = soup.select(".pidalab-task")
    assert len(tasks) == sum(len(page_tasks) for _, page_tasks in sheets.collected()) >= 24
    assert soup.select(".pidalab-task script, .pidalab-task .headerlink, form") == []
    for task in tasks:
        parts = [part.get_text() for part in task.select(".task-part")]
        assert parts == [name for name in ("Hint", "Answer") if name.lower() in shown]
        assert bool(task.select(".task-said")) <= ("said" in shown)
    text = soup.get_text(" ")
    assert ("That is the integral gain" in text) == (kind == "tasks-teacher")
    assert "its lead allows more gain" in text  # the sheet has the options of a question


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


def test_search_splits_a_page_into_sections(root, monkeypatch):
    monkeypatch.syspath_prepend(root / "book" / "_ext")
    assert importlib.import_module("section_search").sections(PAGE) == [
        ("one", "First title", "Some words and x^2 . A task."),
        ("two", "Second", "More."),
        ("pidalab.tune", "pidalab.tune", "Tune a loop. Returns Design"),
    ]


def test_tables_of_how_we_know_are_filled_and_shown(site, root):
    page = (root / "book" / "how-we-know.md").read_text(encoding="utf-8")
    names = evidence.MARK.findall(page)
    assert len(names) == len(evidence.TABLES)
    full = evidence.filled(page)
    assert "<!-- evidence" not in full
    shown = (site / "book" / "how-we-know.html").read_text(encoding="utf-8")
    assert shown.count("<table") == page.count("\n|---") + len(names)


def test_the_notice_covers_every_file_of_the_site(site):
    components = vendored.components(vendored.table(), site)
    assert (site / vendored.NOTICE).read_text(encoding="utf-8") == vendored.notice(components)
    assert {name for component in components for name in component["files"]} == set(vendored.carried(site))
    assert all(re.fullmatch(r"[\d.]+", component["version"]) for component in components)
