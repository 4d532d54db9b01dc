"""The book's files and its built pages, read without a browser: each check lists what it finds wrong."""

import importlib.util
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

# --- notebooks ---------------------------------------------------------------


def notebooks(root: Path) -> list[Path]:
    return sorted(path for path in root.glob("book/**/*.ipynb") if ".ipynb_checkpoints" not in path.parts)


def notebooks_not_in_toc(pages: list[str], root: Path) -> list[str]:
    names = (path.relative_to(root).with_suffix("").as_posix() for path in notebooks(root))
    return [f"{name}: not in the table of contents" for name in names if name not in pages]


FOLDS = {"hide-input", "hide-cell"}


def shows(output) -> bool:
    """Return True if a reader sees an output; one that is kept for another page is not seen."""
    return "scrapbook" not in output.get("metadata", {})


def notebook_problems(path: Path) -> list[str]:
    """Outputs that are missing, failed, out of order or without words, and folds with nothing to see in them."""
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
    """Anchors of a page, the links that it offers, the addresses that a browser loads for it, and its words."""

    def __init__(self, text: str):
        super().__init__()
        self.anchors, self.links, self.loads = set(), [], []
        self.open = {"article": 0, "h1": 0, "p": 0, "td": 0}
        self.heading = self.words = ""  # of the article: its title, and what stands in paragraphs and tables
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


def is_external(address: str) -> bool:
    return bool(urlsplit(address).netloc)


def read_pages(site: Path) -> dict[Path, Page]:
    return {
        path: parsed(path.read_text(encoding="utf-8"))
        for path in sorted(site.rglob("*.html"))
        if "_static" not in path.parts
    }


parsed = cache(Page)


def broken_links(site: Path) -> list[str]:
    """Links and loaded files that lead nowhere inside the site, and anchors that no page has."""
    pages = read_pages(site)
    wrong = []
    for path, page in pages.items():
        for address in page.links + page.loads:
            if urlsplit(address).scheme or is_external(address):
                continue
            file, anchor = urldefrag(address)
            target = (path.parent / unquote(file)).resolve() if file.partition("?")[0] else path
            target = target.with_name(target.name.partition("?")[0])
            if not target.is_file():
                wrong.append(f"{path.relative_to(site)}: {address} is not there")
            elif anchor == "slides" or (file.endswith("lab.html") and anchor.startswith("lab-")):
                continue  # a way to show the page, or a state of the lab
            elif anchor and target in pages and unquote(anchor) not in pages[target].anchors:
                wrong.append(f"{path.relative_to(site)}: {address} has no such anchor")
    return wrong


def pages_not_built(pages: list[str], site: Path) -> list[str]:
    """Pages of the table of contents that are not there, or of which nothing but the frame is there."""
    built, wrong = read_pages(site), []
    for name in pages:
        page = built.get(site / f"{name}.html")
        if page is None:
            wrong.append(f"{name}: not in the built site")
        elif not (page.heading and page.words):
            wrong.append(f"{name}: {'no text' if page.heading else 'no heading'}")
    return wrong


# --- the book is good --------------------------------------------------------


def test_every_page_of_the_toc_is_built(toc, site):
    assert pages_not_built(toc, site) == []


def test_no_figure_is_black_in_the_dark(site):
    twins = list((site / "_images").glob("*-dark.svg"))
    assert twins
    black = re.compile(r"""["' :](#000|#000000|black)\b""")
    assert [twin.name for twin in twins if black.search(twin.read_text(encoding="utf-8"))] == []


def test_every_notebook_is_in_the_toc(toc, root):
    assert notebooks_not_in_toc(toc, root) == []


def test_notebooks(root):
    assert notebooks(root)
    assert [problem for path in notebooks(root) for problem in notebook_problems(path)] == []


def test_no_link_is_broken(site):
    assert broken_links(site) == []


def loose_marks(page: str) -> int:
    """Formulas of a line whose comma a browser may put on the next one, or whose bracket it may leave behind."""
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


def unanswered(cells: list) -> list[str]:
    """Exercises without an answer that has a sentence and a cell that printed or drew something."""
    text = "\n".join(RUN if c.cell_type == "code" and c.outputs else c.source for c in cells)
    answers = ANSWER.findall(text)
    wrong = [f"an answer that does not run: {answer.strip()}" for answer in answers if RUN not in answer]
    for answer in answers:
        if len(re.findall(r"\w+", answer.replace(RUN, ""))) < 5 or "." not in answer:
            wrong.append(f"an answer without words: {answer.strip()}")
    if (asked := text.count("```{exercise}")) != len(answers):
        wrong.append(f"{asked} exercises, {len(answers)} answers")
    return wrong


def without_lab(cells: list) -> list[str]:
    """Live figures that do not lead to the lab with their loops loaded."""
    figures = sum(cell.source.count(LIVE) for cell in cells)
    told = [o.get("data", {}).get("text/html", "") for c in cells if c.cell_type == "code" for o in c.outputs]
    linked = sum(IN_THE_LAB in html for html in told)
    return (
        [f"{figures} live figures, {linked} of them lead to the lab"]
        if not figures or linked != figures
        else []
    )


def chapters(root: Path) -> list[Path]:
    ledgers = sorted(path.stem for path in root.glob("book/ledger/*.csv"))
    return [root / "book" / f"{paper}.ipynb" for paper in ledgers if paper not in ("manifest", "removed")]


def lectures(root: Path) -> list[Path]:
    return sorted(root.glob("book/learn/*.ipynb"))


def test_every_exercise_has_an_answer_in_words_that_was_run(root):
    pages = lectures(root) + chapters(root)
    assert len(pages) == 11
    assert [(path.name, wrong) for path in pages for wrong in unanswered(cells_of(path))] == []


def test_every_lecture_and_chapter_leads_to_the_lab(root):
    pages = lectures(root) + chapters(root)
    assert [(path.name, wrong) for path in pages for wrong in without_lab(cells_of(path))] == []


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


def test_wrong_answers_are_said_in_words():
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
    assert len(tasks) == sum(len(found) for _, found in sheets.collected()) >= 24
    assert soup.select(".pidalab-task script, .pidalab-task .headerlink, form") == []
    for task in tasks:
        parts = [part.get_text() for part in task.select(".task-part")]
        assert parts == [name for name in ("Hint", "Answer") if name.lower() in shown]
        assert bool(task.select(".task-said")) <= ("said" in shown)
    text = soup.get_text(" ")
    assert ("That is the integral gain" in text) == (kind == "tasks-teacher")
    assert "its lead allows more gain" in text  # options are part of the question


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


def test_every_table_of_the_page_is_made_and_shown(site, root):
    page = (root / "book" / "how-we-know.md").read_text(encoding="utf-8")
    names = evidence.MARK.findall(page)
    assert len(names) == len(evidence.TABLES)
    full = evidence.filled(page)
    assert "<!-- evidence" not in full
    shown = (site / "book" / "how-we-know.html").read_text(encoding="utf-8")
    assert shown.count("<table") == page.count("\n|---") + len(names)


def test_the_notice_covers_every_file_of_the_site(site):
    found = vendored.components(vendored.table(), site)
    assert (site / vendored.NOTICE).read_text(encoding="utf-8") == vendored.notice(found)
    assert {name for one in found for name in one["files"]} == set(vendored.carried(site))
    assert all(re.fullmatch(r"[\d.]+", one["version"]) for one in found)
