"""Print the built site as one PDF, dist/pidalab-book-<version>.pdf.

All pages are joined into one document in the order of the table of contents, so that links between them lead to pages
of the PDF. Answers to exercises stand at the end, folds are open; live figures and folded code are left out.
The browser prints it twice: the second time the contents know their page numbers.
"""

import json
import os
import shutil
import sys
import tempfile
import tomllib
from pathlib import Path
from urllib.parse import unquote, urldefrag, urlsplit

import yaml
from bs4 import BeautifulSoup, Tag
from playwright.sync_api import Page, sync_playwright
from pypdf import PdfReader, PdfWriter

ROOT = Path(__file__).resolve().parents[1]
SITE = ROOT / "_build" / "html"
JOINED = SITE / "_joined.html"
DIST = ROOT / "dist"
STYLE = Path(__file__).with_suffix(".css")
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chromium-headless-shell")
UNPRINTED = (
    ".headerlink",
    ".only-dark",
    ".viewcode-link",
    ".toctree-wrapper",
    ".above-input",
    "script",
    "button",
    "nav",
)
BOOK = "pidalab: PIDA control, reproducible"
FOOTER = '<div style="font: 8pt sans-serif; width: 100%; text-align: center"><span class="pageNumber"></span></div>'


def parts() -> list[tuple[str, list[str]]]:
    """List the parts of the table of contents with their pages; the first is the front page, without a name."""
    toc = yaml.safe_load((SITE.parent / "source" / "_toc.yml").read_text(encoding="utf-8"))
    return [
        ("", [toc["root"]]),
        *((part["caption"], list(_files(part["chapters"]))) for part in toc["parts"]),
    ]


def _files(entries: list) -> list[str]:
    return [name for one in entries for name in (one["file"], *_files(one.get("sections", [])))]


def anchor(page: str, name: str = "") -> str:
    """Return the id of a page, or of a place in it, in the joined document."""
    return f"{page}--{name}" if name else page


def article(page: str, pages: set[str]) -> Tag:
    """Return what a page says, with links that stay within the document and pictures found from its folder."""
    soup = BeautifulSoup((SITE / f"{page}.html").read_text(encoding="utf-8"), "html.parser")
    body = soup.select_one("article.bd-article")
    for live in body.select(".pidalab-live"):
        still(live)
    for task in body.select(".pidalab-task"):
        answer_apart(task)
    for gone in body.select(", ".join(UNPRINTED)):
        gone.decompose()
    for fold in body.select("details"):
        unfold(fold)
    for place in body.select("[id]"):
        place["id"] = anchor(page, place["id"])
    for link in body.select("a[href]"):
        target = inside(page, link["href"], pages)
        if target is None:
            link.unwrap()
        else:
            link["href"] = target
    for picture in body.select("img[src]"):
        picture["src"] = _from_root(page, picture["src"])
    # parts are the first level of the outline, pages the second
    for level in range(5, 0, -1):
        for head in body.select(f"h{level}"):
            head.name = f"h{level + 1}"
    body["id"] = anchor(page)
    return body


def still(live: Tag) -> None:
    """Leave the picture of a live figure; where it has none, its caption."""
    if live.select_one("img") is None:
        state = live.get("data-live") or live.select_one("script[type='application/json']").string
        live.string = (
            f"In the online book a live figure appears here. {json.loads(state).get('caption', '')}".strip()
        )


def answer_apart(task: Tag) -> None:
    """Leave the words of a task; its answer joins those of the exercises."""
    task.select_one(".task-hint").decompose()
    answer = task.select_one(".task-answer")
    answer.name, answer["class"] = "div", "solution"
    answer.summary.name = "p"
    answer.p["class"] = "admonition-title"
    answer.p.string = task.select_one(".task-title").get_text(" ", strip=True).removesuffix("#").strip()


def unfold(fold: Tag) -> None:
    """Open a fold: of a claim its note, of a cell its output. All rows of a paper are in its audit, too."""
    words = fold.summary.extract()
    if fold.select_one("tr:has(.verdict)") and "hide" not in fold.get("class", []):
        fold.string = f"{words.get_text(' ', strip=True)} are in the audit."
    elif fold.find_parent("table"):
        words.name = "span"
        fold.insert(0, words)
    fold.name = "div"
    fold["class"] = "unfolded"


def inside(page: str, address: str, pages: set[str]) -> str | None:
    """Return where a link leads in the joined document; None for a page of the site that is not printed.

    A link to a plant or a design in the lab leads to the page of the lab.
    """
    if urlsplit(address).scheme or urlsplit(address).netloc:
        return address
    file, place = urldefrag(address)
    place = "" if place.startswith("lab-") else place
    name = _from_root(page, file).removesuffix(".html") if file else page
    return f"#{anchor(name, unquote(place))}" if name in pages else None


def _from_root(page: str, address: str) -> str:
    return os.path.normpath(Path(page).parent / unquote(urlsplit(address).path))


def empty(title: str) -> BeautifulSoup:
    """Return a document with the looks and the formulas of the site, and nothing in it."""
    soup = BeautifulSoup((SITE / "book" / "intro.html").read_text(encoding="utf-8"), "html.parser")
    for tag in soup.select("head [href], head [src]"):
        key = "href" if tag.has_attr("href") else "src"
        if not urlsplit(tag[key]).scheme:
            tag[key] = _from_root("book/intro", tag[key])
    # of the scripts only the one that sets formulas is needed
    for script in soup.select("script"):
        if "MathJax" not in script.get_text() and "mathjax" not in script.get("src", ""):
            script.decompose()
    scripts = [script.extract() for script in soup.select("body script")]
    soup.head.extend(scripts)
    soup.head.append(soup.new_tag("style"))
    soup.head.select("style")[-1].string = STYLE.read_text(encoding="utf-8")
    soup.html["data-theme"] = "light"
    soup.title.string = title
    soup.body.clear()
    soup.body.attrs = {"class": "bd-content"}
    return soup


def joined(version: str) -> BeautifulSoup:
    """Return the document: title, contents, every page, answers."""
    soup = empty(BOOK)
    for piece in (title(version), *book(soup)):
        soup.body.append(piece)
    return soup


def faults(soup: BeautifulSoup) -> list[str]:
    """List links of the document to places that it lacks, and pictures without a file."""
    anchors = {place["id"] for place in soup.select("[id]")}
    links = [link["href"] for link in soup.select('a[href^="#"]')]
    pictures = [image["src"] for image in soup.select("img")]
    return [
        *(f"{link} leads nowhere" for link in links if link[1:] not in anchors),
        *(f"{name} is not there" for name in pictures if not (SITE / name).is_file()),
    ]


def title(version: str) -> Tag:
    """Return the first leaf."""
    return BeautifulSoup(
        f"""<div class="title-leaf">
        <p class="big">PIDA control, reproducible</p>
        <p>Papers recomputed number by number, with exact dead time</p>
        <p>pidalab {version} · The pidalab developers</p>
        <p class="small">Text and figures CC BY 4.0, code BSD-3-Clause. The online book has the lab and the live
        figures.</p>
        </div>""",
        "html.parser",
    ).div


def book(soup: BeautifulSoup) -> list[Tag]:
    """Return contents and body; each line of the contents has the anchor that it waits for."""
    pages = {page for _, names in parts() for page in names}
    contents, body, answers = soup.new_tag("div", attrs={"class": "contents"}), [], []
    heading(soup, contents, "h1", "Contents")
    for caption, names in parts():
        articles = {name: article(name, pages) for name in names}
        if caption:
            heading(soup, next(iter(articles.values())), "h1", caption)
            line(soup, contents, caption, "", "part")
        for name, found in articles.items():
            head = found.select_one("h2").get_text(" ", strip=True)
            if taken := [answer.extract() for answer in found.select("div.solution")]:
                answers.append((head, taken))
            body.append(found)
            line(soup, contents, head, anchor(name), "page")
    if answers:
        last = soup.new_tag("article", attrs={"class": "bd-article", "id": "answers"})
        for head, taken in answers:
            group = soup.new_tag("div")
            group.extend(taken)
            heading(soup, group, "h2", head)
            last.append(group)
        heading(soup, last, "h1", "Answers")
        body.append(last)
        line(soup, contents, "Answers", "answers", "part")
    return [contents, *body]


def heading(soup: BeautifulSoup, parent: Tag, name: str, text: str) -> None:
    """Put a heading at the beginning."""
    made = soup.new_tag(name)
    made.string = text
    parent.insert(0, made)


def line(soup: BeautifulSoup, contents: Tag, text: str, target: str, kind: str) -> None:
    """Append a line to the contents, with room for a page number where it leads somewhere."""
    row = soup.new_tag("p", attrs={"class": kind})
    link = soup.new_tag("a", attrs={"href": f"#{target}"}) if target else soup.new_tag("span")
    link.string = text
    row.append(link)
    if target:
        row.append(soup.new_tag("span", attrs={"class": "number", "data-for": target}))
    contents.append(row)


def numbers(path: Path) -> dict[str, int]:
    """Read from a printed document on which page each anchor is, counted from 1."""
    reader = PdfReader(path)
    places = {name.lstrip("/"): place for name, place in reader.named_destinations.items()}
    return {unquote(name): reader.get_destination_page_number(place) + 1 for name, place in places.items()}


def print_to(page: Page, path: Path) -> None:
    """Print the open document."""
    page.pdf(
        path=path, format="A4", outline=True, tagged=True, print_background=True, prefer_css_page_size=True,
        display_header_footer=True, header_template="<span></span>", footer_template=FOOTER,
        margin={"top": "18mm", "bottom": "18mm", "left": "18mm", "right": "18mm"},
    )  # fmt: skip


def printed(source: Path, target: Path, title: str = BOOK) -> None:
    """Set the formulas, print, fill in the page numbers, print again."""
    executable = next(filter(None, map(shutil.which, BROWSERS)), None)
    if executable is None:
        raise FileNotFoundError(f"printing needs a browser on PATH, found none of {', '.join(BROWSERS)}")
    options = ["--no-sandbox", "--disable-background-networking", "--host-resolver-rules=MAP * ~NOTFOUND"]
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        browser = playwright.chromium.launch(executable_path=executable, args=options)
        page = browser.new_page()
        page.set_default_timeout(300_000)
        page.goto(source.as_uri())
        page.evaluate("MathJax.startup.promise")
        draft = Path(folder) / "draft.pdf"
        print_to(page, draft)
        fill = "found => document.querySelectorAll('[data-for]').forEach(e => e.textContent = found[e.dataset.for])"
        page.evaluate(fill, numbers(draft))
        print_to(page, Path(folder) / "book.pdf")
        browser.close()
        finish(Path(folder) / "book.pdf", target, title)


def finish(source: Path, target: Path, title: str) -> None:
    """Name the document, shrink it, and open it with its outline."""
    writer = PdfWriter(clone_from=source)
    writer.add_metadata({"/Title": title, "/Author": "The pidalab developers"})
    writer.page_mode = "/UseOutlines"
    writer.write(target)


def main() -> int:
    """Return 1 if the document refers to what it does not have."""
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    DIST.mkdir(exist_ok=True)
    target = DIST / f"pidalab-book-{version}.pdf"
    document = joined(version)
    if wrong := faults(document):
        print("\n".join(wrong), file=sys.stderr)
        return 1
    JOINED.write_text(str(document), encoding="utf-8")
    try:
        printed(JOINED, target)
    finally:
        JOINED.unlink()
    print(
        f"{target.relative_to(ROOT)}: {len(PdfReader(target).pages)} pages, {target.stat().st_size / 1e6:.1f} MB"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
