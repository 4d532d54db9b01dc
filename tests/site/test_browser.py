"""The built book as a reader meets it: in a browser, in light and dark, on a wide and on a narrow screen."""

import os
import shutil
import threading
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import urlsplit

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, sync_playwright

WIDE, NARROW = {"width": 1280, "height": 900}, {"width": 390, "height": 844}

# No other host has an address: a request for one is seen, and goes nowhere.
ARGUMENTS = [
    "--no-sandbox",
    "--disable-background-networking",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
]

# Findings of axe-core that come from tools the book stands on: the rule, and what marks the element.
ACCEPTED = [
    ("aria-allowed-role", "doc-biblioentry"),  # docutils' markup of a bibliography entry
    ("aria-deprecated-role", "doc-biblioentry"),
    ("aria-required-children", "citation-list"),
    ("region", "logo__title"),  # the theme's book name stands outside its landmarks
]

# Formulas that were left as source: delimiters or environments in the text that a reader sees, code aside.
RAW_MATHS = r"""() => {
  const inCode = "pre, code, script, style, mjx-container";
  const walker = document.createTreeWalker(document.querySelector("main"), NodeFilter.SHOW_TEXT);
  const raw = [];
  while (walker.nextNode()) {
    const { data, parentElement } = walker.currentNode;
    if (parentElement.closest(inCode)) continue;
    if (/\\[(\[]|\$\S[^$]*\$|\$\$|\\begin\{|\\frac/.test(data)) raw.push(data.trim());
  }
  for (const formula of document.querySelectorAll("main .math:not(pre)"))
    if (!formula.querySelector("mjx-container")) raw.push(formula.textContent);
  for (const error of document.querySelectorAll("mjx-merror")) raw.push("error: " + error.textContent);
  return raw;
}"""

TYPESET = "() => !document.querySelector('script[src*=mathjax]') || window.MathJax?.startup?.promise?.then(() => true)"

OVERFLOW = "() => document.scrollingElement.scrollWidth - document.scrollingElement.clientWidth"

# Formulas are read, not operated, and a fold's button says what it unfolds.
HINDRANCES = """() => {
  const all = (selector) => [...document.querySelectorAll(selector)], found = [];
  if (all("mjx-container[tabindex]").length) found.push("formulas are stops of the Tab key");
  for (const fold of all("main [aria-label='Toggle hidden content']")) found.push("a fold without a name");
  for (const fold of all("main details > summary")) if (!fold.textContent.trim()) found.push("a fold without words");
  return found;
}"""

WORDLESS = "() => [...document.images].filter(i => !i.alt.trim() && !i.closest('a, button')).map(i => i.src)"


class QuietHandler(SimpleHTTPRequestHandler):
    def log_message(self, *args):
        pass


@contextmanager
def serve(directory):
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(QuietHandler, directory=directory)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.fixture(scope="module")
def home(site):
    with serve(site) as address:
        yield address


@pytest.fixture(scope="module")
def browser():
    names = ("chromium", "chromium-browser", "google-chrome")
    executable = next(filter(None, map(shutil.which, names)), None)
    if executable is None:
        message = (
            f"no browser on PATH ({', '.join(names)}): the pages were not looked at. On Debian: apt install chromium"
        )
        (pytest.fail if os.environ.get("CI") == "true" else pytest.skip)(message)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture
def visit(browser):
    """Open a page; returns it with the list, which still grows, of what goes wrong on it."""
    contexts = []

    def visit(url, theme="light", viewport=WIDE):
        contexts.append(browser.new_context(color_scheme=theme, viewport=viewport))
        page, wrong = contexts[-1].new_page(), []

        def stays_here(request):
            if urlsplit(request.url).netloc not in ("", urlsplit(url).netloc):  # data: and blob: have no host
                wrong.append(f"another host: {request.url}")

        page.on("request", stays_here)
        page.on("console", lambda message: message.type == "error" and wrong.append(f"console: {message.text}"))
        page.on("pageerror", lambda error: wrong.append(f"script: {error}"))
        page.set_default_timeout(120_000)  # a long page of formulas on a busy machine
        page.goto(url, wait_until="load")
        page.wait_for_function(TYPESET)
        return page, wrong

    yield visit
    for context in contexts:
        context.close()


def problems(page: Page) -> list[str]:
    """What a reader would stumble over on an open page."""
    wrong = [f"maths left raw: {text}" for text in page.evaluate(RAW_MATHS)]
    wrong += [f"image without alt text: {source}" for source in page.evaluate(WORDLESS)]
    wrong += page.evaluate(HINDRANCES)
    if (pixels := page.evaluate(OVERFLOW)) > 1:
        wrong.append(f"page {pixels} px wider than the screen")
    return wrong


def barriers(page: Page, **more) -> list[str]:
    """What axe-core finds on an open page, less what is accepted."""
    # Without preload: axe would ask for stylesheets itself, and look for some in the wrong place.
    options = {"resultTypes": ["violations"], "preload": False, **more}
    findings = Axe().run(page, {"exclude": [["mjx-container"]]}, options).response["violations"]
    return [
        f"axe {finding['id']}: {node['html']}"
        for finding in findings
        for node in finding["nodes"]
        if not any(finding["id"] == rule and mark in node["html"] for rule, mark in ACCEPTED)
    ]


def test_page(page_name, home, visit):
    """Light and wide, then dark, then narrow: a page is loaded once, since that takes longest."""
    page, wrong = visit(f"{home}/{page_name}.html")
    assert page.locator("html").get_attribute("data-theme") == "light"
    assert wrong + problems(page) + barriers(page) == []
    page.evaluate("() => { document.documentElement.dataset.theme = 'dark' }")
    assert barriers(page, runOnly=["color-contrast"]) == []
    page.set_viewport_size(NARROW)
    assert wrong + problems(page) == []


def test_the_theme_is_that_of_the_readers_system(home, visit):
    page, wrong = visit(f"{home}/book/intro.html", "dark")
    assert page.locator("html").get_attribute("data-theme") == "dark"
    assert wrong == []


SCREENS = 12  # of 900 px: a method chapter is read in a sitting


def test_a_method_chapter_is_read_in_a_sitting(home, visit, root):
    heights = {}
    for paper in sorted(path.stem for path in root.glob("book/ledger/*.csv") if path.stem != "manifest"):
        page, _ = visit(f"{home}/book/{paper}.html", viewport={"width": 1400, "height": 900})
        heights[paper] = page.locator("article").bounding_box()["height"] / 900
    assert {paper: height for paper, height in heights.items() if height > SCREENS} == {}


@pytest.mark.parametrize("words", ["Bode", "anti-windup", "two degrees of freedom", "SIMC", "PIDA", "dead time"])
def test_search_leads_to_sections_and_to_chapters_first(words, home, visit):
    page, wrong = visit(f"{home}/search.html?q={words.replace(' ', '+')}")
    first = page.locator("#search-results li a").first
    first.wait_for()
    address = first.get_attribute("href")
    assert wrong == []
    assert "#" in address
    assert "book/api" not in address


def test_focus_is_seen(home, visit):
    page, _ = visit(f"{home}/book/intro.html")
    outlines = set()
    for _ in range(12):
        page.keyboard.press("Tab")
        outlines.add(page.evaluate("() => getComputedStyle(document.activeElement).outlineStyle"))
    assert outlines == {"solid"}


BAD = """<!doctype html><html lang="en"><title>Bad</title><main><h1>Bad</h1>%s</main></html>"""


@pytest.mark.parametrize(
    ("html", "found"),
    [
        ("<script>console.error('no')</script>", "console: no"),
        ("<script>throw new Error('no')</script>", "script: no"),
        ("<img alt='far' src='http://far.example/x.svg'>", "another host: http://far.example/x.svg"),
        ("<p>\\(K_p\\)</p>", "maths left raw"),
        ("<p>$$K_p$$</p>", "maths left raw"),
        ("<table><tr><td>$K_p$</td></tr></table>", "maths left raw"),
        ("<p><span class='math'>K_p</span></p>", "maths left raw"),
        ("<img src='data:,'>", "image without alt text"),
        ("<p><mjx-container tabindex='0'>x</mjx-container></p>", "formulas are stops of the Tab key"),
        ("<button aria-label='Toggle hidden content'>+</button>", "a fold without a name"),
        ("<details><summary></summary>hidden</details>", "a fold without words"),
        ("<div style='width: 200vw'>wide</div>", "px wider than the screen"),
        ("<p style='color: #ccc; background: #fff'>pale</p>", "axe color-contrast"),
    ],
)
def test_bad_page_is_caught(html, found, tmp_path, visit):
    (tmp_path / "index.html").write_text(BAD % html)
    (tmp_path / "favicon.ico").touch()
    with serve(tmp_path) as address:
        page, wrong = visit(address)
        assert any(found in problem for problem in wrong + problems(page) + barriers(page))
