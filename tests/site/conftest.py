"""Provide the built site, a browser and the table of contents."""

import os
import shutil
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import yaml
from looking import TYPESET, WIDE
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parents[2]

# No other host has an address, so that requests to other hosts fail.
ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",  # otherwise it emulates a graphics card
    "--disable-background-networking",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
]

FORGET = (
    "() => location.protocol === 'about:' || [localStorage, sessionStorage].forEach((one) => one.clear())"
)


def toc_pages(toc: Path) -> list[str]:
    """Return the pages of a table of contents, in its order."""

    def walk(node):
        if isinstance(node, list):
            for item in node:
                yield from walk(item)
        elif isinstance(node, dict):
            yield from (node[key] for key in ("root", "file") if key in node)
            for value in node.values():
                yield from walk(value)

    return list(walk(yaml.safe_load(toc.read_text(encoding="utf-8"))))


def pytest_generate_tests(metafunc):
    if "page_name" in metafunc.fixturenames:
        metafunc.parametrize("page_name", toc_pages(ROOT / "_toc.yml"))


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def toc() -> list[str]:
    return toc_pages(ROOT / "_toc.yml")


@pytest.fixture(scope="session")
def site() -> Path:
    built = ROOT / "_build" / "html"
    if not (built / "index.html").exists():
        pytest.fail("there is no built site in _build/html: run `make book` first")
    return built


@pytest.fixture(scope="module")
def browser():
    names = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
    with sync_playwright() as playwright:
        fetched = playwright.chromium.executable_path  # the browser that Playwright has downloaded
    executable = next(filter(None, map(shutil.which, [*names, fetched])), None)
    if executable is None:
        message = (
            f"no browser on PATH ({', '.join(names)}): the pages were not looked at; "
            "apt install chromium-headless-shell"
        )
        (pytest.fail if os.environ.get("CI") == "true" else pytest.skip)(message)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def tab(browser):
    """Return one tab for all tests of a file, since opening a tab takes longer than loading a page."""
    context = browser.new_context()
    yield context.new_page()
    context.close()


@pytest.fixture
def visit(browser, tab):
    """Return a function that clears storage and opens a page. It returns the page and the growing list of its errors.

    A second page opens in a new tab, so that the first page stays open.
    """
    opened, heard = [], []

    def listen(page, event, handler):
        page.on(event, handler)
        heard.append((page, event, handler))

    def visit(url, theme="light", viewport=WIDE):
        page, wrong = browser.new_context().new_page() if opened else tab, []
        opened.append(page)
        page.evaluate(FORGET)
        page.goto("about:blank")  # otherwise another state of the lab would not load a new page
        page.emulate_media(media="null", color_scheme=theme)
        page.set_viewport_size(viewport)

        def stays_here(request):
            if urlsplit(request.url).netloc not in ("", urlsplit(url).netloc):  # data: and blob: have no host
                wrong.append(f"another host: {request.url}")

        def complains(message):
            if message.type == "error":
                wrong.append(f"console: {message.text}")

        listen(page, "request", stays_here)
        listen(page, "console", complains)
        listen(page, "pageerror", lambda error: wrong.append(f"script: {error}"))
        page.set_default_timeout(120_000)  # for a long page of formulas on a busy machine
        page.goto(url, wait_until="load")
        page.wait_for_function(TYPESET)
        return page, wrong

    yield visit
    for page, event, handler in heard:
        page.remove_listener(event, handler)
    for page in opened[1:]:
        page.context.close()


@pytest.fixture
def lab(site, visit):
    """Return a function that opens the lab at an address. Nothing may go wrong on the page."""
    opened = []

    def open_lab(address=None, **how):
        page, wrong = visit(address or (site / "book" / "lab.html").as_uri(), **how)
        page.locator(".lab-ready").wait_for()
        opened.append(wrong)
        return page

    yield open_lab
    assert [wrong for wrong in opened if wrong] == []
