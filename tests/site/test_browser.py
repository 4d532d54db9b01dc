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
    ("empty-table-header", "<th></th>"),  # pandas leaves the corner above the row names empty
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
    if (pixels := page.evaluate(OVERFLOW)) > 1:
        wrong.append(f"page {pixels} px wider than the screen")
    return wrong


def barriers(page: Page) -> list[str]:
    """What axe-core finds on an open page, less what is accepted."""
    # Without preload: axe would ask for stylesheets itself, and look for some in the wrong place.
    options = {"resultTypes": ["violations"], "preload": False}
    findings = Axe().run(page, {"exclude": [["mjx-container"]]}, options).response["violations"]
    return [
        f"axe {finding['id']}: {node['html']}"
        for finding in findings
        for node in finding["nodes"]
        if not any(finding["id"] == rule and mark in node["html"] for rule, mark in ACCEPTED)
    ]


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("viewport", [WIDE, NARROW], ids=["wide", "narrow"])
def test_page(page_name, theme, viewport, home, visit):
    page, wrong = visit(f"{home}/{page_name}.html", theme, viewport)
    assert page.locator("html").get_attribute("data-theme") == theme
    assert wrong + problems(page) == []
    if viewport is WIDE:  # the slowest check by far; a narrow screen shows the same elements in the same colours
        assert barriers(page) == []


def test_search_finds_a_page(home, visit):
    page, wrong = visit(f"{home}/search.html?q=bibliography")
    page.locator("#search-results a[href*='bibliography']").first.wait_for()
    assert wrong == []


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
