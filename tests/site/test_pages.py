"""The book's files and its built pages, read without a browser: each check lists what it finds wrong."""

import re
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag, urlsplit

import nbformat

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
            loading = tag == "link" and LOADING_LINKS & set(attrs.get("rel", "").split())
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
            elif file.endswith("lab.html") and anchor.startswith("lab-"):
                continue  # a state of the lab, see test_across
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
