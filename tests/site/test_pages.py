"""The book's files and its built pages, read without a browser.

Each check is a function that returns the list of what it finds wrong. The book must give an empty list;
below, every check also meets a bad sample and must name what is wrong with it.
"""

import re
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag, urlsplit

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook, new_output

# --- notebooks ---------------------------------------------------------------


def notebooks(root: Path) -> list[Path]:
    return sorted(path for path in root.glob("book/**/*.ipynb") if ".ipynb_checkpoints" not in path.parts)


def notebooks_not_in_toc(pages: list[str], root: Path) -> list[str]:
    names = (path.relative_to(root).with_suffix("").as_posix() for path in notebooks(root))
    return [f"{name}: not in the table of contents" for name in names if name not in pages]


FOLDS = {"hide-input", "hide-cell"}


def shows(output) -> bool:
    """Whether a reader sees an output; what is only kept for another page is not seen."""
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
LOADING_LINKS = {
    "stylesheet",
    "icon",
    "preload",
    "prefetch",
    "modulepreload",
    "preconnect",
    "dns-prefetch",
    "manifest",
}
CSS_URL = re.compile(r"""(?:url\(\s*|@import\s+)["']?([^"')\s]+)""")


class Page(HTMLParser):
    """What a page consists of: anchors, classes, images, the links it offers, the addresses a browser loads for it."""

    def __init__(self, text: str):
        super().__init__()
        self.anchors, self.links, self.loads, self.images, self.classes = set(), [], [], [], set()
        self.in_style = False
        self.open = {"article": 0, "h1": 0, "p": 0, "td": 0}
        self.heading = self.words = ""  # of the article: its title, and what stands in paragraphs and tables
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attrs = {name: value or "" for name, value in attrs}
        self.in_style = tag == "style"
        if tag in self.open:
            self.open[tag] += 1
        self.anchors |= {attrs[key] for key in ("id", "name") if key in attrs}
        self.classes |= set(attrs.get("class", "").split())
        self.loads += CSS_URL.findall(attrs.get("style", ""))
        self.loads += [attrs[name] for name in LOADING_ATTRIBUTES & attrs.keys() if attrs[name]]
        if tag == "img":
            self.images.append(attrs)
        if "href" in attrs:
            loading = tag == "link" and LOADING_LINKS & set(attrs.get("rel", "").split())
            (self.loads if loading else self.links).append(attrs["href"])
        if tag == "meta" and attrs.get("http-equiv", "").lower() == "refresh":
            self.links.append(attrs["content"].partition("url=")[2])

    def handle_endtag(self, tag):
        if tag in self.open:
            self.open[tag] -= 1

    def handle_data(self, data):
        if self.in_style:
            self.loads += CSS_URL.findall(data)
        elif self.open["article"] and self.open["h1"]:
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


parsed = cache(Page)  # several checks look at the same pages


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
            elif file.endswith("lab.html") and anchor.startswith("lab-"):
                continue  # a state of the lab, see test_across
            elif anchor and target in pages and unquote(anchor) not in pages[target].anchors:
                wrong.append(f"{path.relative_to(site)}: {address} has no such anchor")
    return wrong


def external_loads(site: Path) -> list[str]:
    """What a browser would ask another host for while it shows a page."""
    loads = [(path, address) for path, page in read_pages(site).items() for address in page.loads]
    loads += [
        (path, address)
        for path in sorted(site.rglob("*.css"))
        for address in CSS_URL.findall(path.read_text(encoding="utf-8"))
    ]
    return [f"{path.relative_to(site)}: loads {address}" for path, address in loads if is_external(address)]


def images_without_words(site: Path) -> list[str]:
    """Images of the book's own (the theme's logo stands beside its text); a file name is no description."""
    return [
        f"{path.relative_to(site)}: {image.get('src')} has no alt text"
        for path, page in read_pages(site).items()
        for image in page.images
        if "_images/" in image.get("src", "")
        and (not image.get("alt", "").strip() or "_images/" in image["alt"])
    ]


def tracebacks(site: Path) -> list[str]:
    """Pages that show an error: a result that cannot be displayed does not stop its cell, nor the build."""
    return [
        f"{path.relative_to(site)}: shows an error"
        for path, page in read_pages(site).items()
        if "traceback" in page.classes
    ]


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


@pytest.mark.parametrize("check", [broken_links, external_loads, images_without_words, tracebacks])
def test_built_pages(check, site):
    assert check(site) == []


# --- and a bad one is caught -------------------------------------------------

SVG = {"image/svg+xml": "<svg/>"}
WORDS = {"mystnb": {"figure": {"caption": "A step."}, "image": {"alt": "It rises."}}}


def cell(*outputs, count=1, **metadata):
    return new_code_cell("1 + 1", execution_count=count, outputs=list(outputs), metadata=metadata)


def shown(data=SVG):
    return new_output("display_data", data=data)


BAD_NOTEBOOKS = {
    "error ZeroDivisionError": [
        cell(new_output("error", ename="ZeroDivisionError", evalue="", traceback=[]))
    ],
    "text on stderr": [cell(new_output("stream", name="stderr", text="careful"))],
    "no stored output": [cell()],
    "not run in order: [2, 1]": [cell(shown({"text/plain": "2"}), count=2), cell(count=1)],
    "not run in order: [None]": [cell(shown({"text/plain": "2"}), count=None)],
    "figure without caption": [cell(shown(), mystnb={"image": {"alt": "It rises."}})],
    "cell 2: folded, and nothing to see": [
        cell(shown(), **WORDS),
        cell(count=2, tags=["hide-input"]),
    ],
    "cell 1: folded, and nothing to see": [
        cell(new_output("display_data", data={}, metadata={"scrapbook": {}}), tags=["hide-cell"])
    ],
    "figure without alt": [cell(shown({"image/png": ""}), mystnb={"figure": {"caption": "A step."}})],
}


@pytest.mark.parametrize(("problem", "cells"), BAD_NOTEBOOKS.items(), ids=BAD_NOTEBOOKS)
def test_bad_notebook_is_caught(problem, cells, tmp_path):
    path = tmp_path / "bad.ipynb"
    nbformat.write(new_notebook(cells=cells), path)
    (found,) = notebook_problems(path)
    assert problem in found


def test_good_notebook_passes(tmp_path):
    path = tmp_path / "good.ipynb"
    folded = cell(shown(), tags=["hide-input"], **WORDS)
    nbformat.write(new_notebook(cells=[folded, new_code_cell("")]), path)
    assert notebook_problems(path) == []


@pytest.mark.parametrize(
    ("html", "problem"),
    [
        ("", "no heading"),
        ("<h1>Title</h1><p>Words outside of the article.</p>", "no heading"),
        ("<article><p>Words.</p></article>", "no heading"),
        ("<article><h1><a>#</a></h1><p>Words.</p></article>", "no heading"),
        ("<article><h1>Title<a>#</a></h1></article><p>A footer.</p>", "no text"),
        ("<article><h1>Title</h1><p> </p></article>", "no text"),
    ],
)
def test_an_empty_page_is_caught(html, problem, tmp_path):
    (tmp_path / "page.html").write_text(html, encoding="utf-8")
    assert pages_not_built(["page"], tmp_path) == [f"page: {problem}"]
    (tmp_path / "page.html").write_text(
        "<article><h1>Title<a>#</a></h1><table><td>7</td></table></article>", encoding="utf-8"
    )
    assert pages_not_built(["page"], tmp_path) == []


def test_missing_page_and_stray_notebook_are_caught(tmp_path):
    (tmp_path / "book").mkdir()
    (tmp_path / "book" / "stray.ipynb").touch()
    assert pages_not_built(["book/gone"], tmp_path) == ["book/gone: not in the built site"]
    assert notebooks_not_in_toc(["book/gone"], tmp_path) == ["book/stray: not in the table of contents"]


BAD_HTML = {
    '<a href="gone.html">': broken_links,
    '<a href="#gone">': broken_links,
    '<a href="index.html#gone">': broken_links,
    '<img src="gone.svg">': broken_links,
    '<script src="https://cdn.example/x.js"></script>': external_loads,
    '<link rel="stylesheet" href="//cdn.example/x.css">': external_loads,
    '<iframe src="https://cdn.example/"></iframe>': external_loads,
    "<style>@import 'https://cdn.example/x.css';</style>": external_loads,
    '<p style="background: url(https://cdn.example/x.png)">': external_loads,
    '<img src="_images/x.svg">': images_without_words,
    '<img src="_images/x.svg" alt="_images/x.svg">': images_without_words,
    '<div class="output traceback">TypeError</div>': tracebacks,
}


@pytest.mark.parametrize(("html", "check"), BAD_HTML.items(), ids=BAD_HTML)
def test_bad_page_is_caught(html, check, tmp_path):
    (tmp_path / "index.html").write_text(html, encoding="utf-8")
    assert len(check(tmp_path)) == 1


def test_bad_stylesheet_is_caught(tmp_path):
    (tmp_path / "x.css").write_text(
        "@font-face { src: url('https://cdn.example/x.woff2') }", encoding="utf-8"
    )
    assert len(external_loads(tmp_path)) == 1


def test_good_page_passes(tmp_path):
    (tmp_path / "_images").mkdir()
    (tmp_path / "_images" / "x.svg").touch()
    (tmp_path / "index.html").write_text(
        '<h1 id="top">Page</h1><a href="#top">up</a><a href="index.html?q=1#top">again</a>'
        '<a href="https://doi.org/10.1">paper</a><img src="_images/x.svg" alt="It rises.">',
        encoding="utf-8",
    )
    assert broken_links(tmp_path) + external_loads(tmp_path) + images_without_words(tmp_path) == []
