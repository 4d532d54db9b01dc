"""Check the built book in a browser: light and dark, wide and narrow, search, print and slides."""

import re
import threading
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest
from looking import NARROW, OVERFLOW, accessibility_problems, contrast_problems, layout_problems
from pictured import live_figure_problems


class QuietHandler(SimpleHTTPRequestHandler):
    def log_message(self, *args):
        pass


@contextmanager
def serve(directory):
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(QuietHandler, directory=directory)) as server:
        # The interval limits the time that the server takes to stop.
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.fixture(scope="module")
def home(site):
    with serve(site) as address:
        yield address


def test_page(page_name, home, site, visit):
    """Each page is loaded once for all checks."""
    page, wrong = visit(f"{home}/{page_name}.html", viewport=NARROW)
    assert page.locator("html").get_attribute("data-theme") == "light"
    assert live_figure_problems(page, site / f"{page_name}.html") + layout_problems(page) + wrong == []


# These pages have every kind of text, table, figure and control of the book.
COLOURED = [
    "intro",
    "lab",
    "how-we-know",
    "how-do-i",
    "errata",
    "learn/limits",
    "across/which-controller",
    "api/loop",
]


@pytest.mark.parametrize("name", COLOURED)
def test_texts_and_links_have_enough_contrast(name, home, visit):
    page, _ = visit(f"{home}/book/{name}.html")
    assert contrast_problems(page) == []


def test_every_page_forbids_other_hosts(site):
    pages = [path for path in site.glob("*/**/*.html") if "_static" not in path.parts]  # index.html redirects
    assert len(pages) > 50
    policy = "content=\"default-src '"
    assert [path.name for path in pages if policy not in path.read_text(encoding="utf-8")] == []


def test_a_page_cannot_ask_another_host(home, visit):
    page, wrong = visit(f"{home}/book/notation.html")
    page.evaluate("fetch('https://example.org/').catch(() => 0)")
    page.wait_for_timeout(100)
    assert any("Content Security Policy" in line for line in wrong)


@pytest.mark.parametrize("place", ["lab.html#%", "scoreboard.html#%E0%A4%A"])
def test_a_malformed_address_causes_no_error(place, home, visit):
    _, wrong = visit(f"{home}/book/{place}")
    assert wrong == []


def test_the_theme_follows_the_system(home, visit):
    page, wrong = visit(f"{home}/book/intro.html", "dark")
    assert page.locator("html").get_attribute("data-theme") == "dark"
    assert wrong == []


# The first result for these words is a section of a lecture or chapter.
WORDS = ["Bode", "two degrees of freedom", "SIMC", "PIDA", "dead time", "noise", "IAE"]
NOT_FIRST = re.compile(r"book/(api|audit|bibliography|scoreboard|errata)")
# Words that a reader would type, and a good answer, which is among the first three results.
ANSWERED = {
    "install": "how-do-i.html#install",
    "cite": "how-do-i.html#cite",
    "bumpless transfer": "digital.html#bumpless-transfer",
    "step response identification": "design.html",
    "system identification": "design.html#fit",
    "Ziegler Nichols": "rules.html",
    "lambda tuning": "rules.html",
    "first order plus dead time": "data.html#pidalab.fopdt",
    "setpoint weighting": "how-do-i.html#weigh-the-set-point",
    "derivative filter": "filter-and-noise.html",
    "anti-windup": "limits.html",
    "gain margin": "tuning.html#what-ms-means",
    "C code": "how-do-i.html#get-c-code",
    "sampling time": "digital.html#choose-h",
    "Bode plot": "how-do-i.html#draw-a-bode-plot",
    "cascade control": "how-do-i.html#control-a-cascade",
    "Smith predictor": "how-do-i.html#also-not-supported",
    "Matlab": "how-do-i.html#hand-a-controller",
    "settling time": "notation.html#conventions",
    "PIDD2": "what-acceleration-does.html#names",
    "temperature control Arduino": "heater.html",
    "IMC": "rules.html#pidalab.rules.itae.imc_pid",
}
FOUND = """(queries) => queries.map((query) => {
  Search.performSearch(query);
  return [...document.querySelectorAll("#search-results li a")].slice(0, 3).map((a) => a.getAttribute("href"));
})"""


def test_search_finds_sections_that_answer(home, visit):
    page, wrong = visit(f"{home}/search.html?q=dead+time")
    page.locator("#search-results li a").first.wait_for()
    results = dict(zip([*ANSWERED, *WORDS], page.evaluate(FOUND, [*ANSWERED, *WORDS]), strict=True))
    missed = {
        query: results[query]
        for query, answer in ANSWERED.items()
        if not any(answer in each for each in results[query])
    }
    assert (missed, wrong) == ({}, [])
    first = [results[words][0] for words in WORDS]
    assert [address for address in first if "#" not in address or NOT_FIRST.search(address)] == []


def test_focus_is_visible(home, visit):
    page, _ = visit(f"{home}/book/intro.html")
    outlines = set()
    for _ in range(12):
        page.keyboard.press("Tab")
        outlines.add(page.evaluate("() => getComputedStyle(document.activeElement).outlineStyle"))
    assert outlines == {"solid"}


def test_print_unfolds_all_but_answers(home, visit):
    page, _ = visit(f"{home}/book/huba2018.html")
    page.emulate_media(media="print")
    page.evaluate("() => { dispatchEvent(new Event('beforeprint')) }")
    folds = page.locator(".admonition.dropdown")
    seen = {
        fold.get_by_role("paragraph").nth(1).is_visible()
        for fold in folds.and_(page.locator(".solution")).all()
    }
    assert seen == {False}
    assert page.locator(".admonition.dropdown:not(.solution) table").is_visible()


FETCHED = (
    "theme => [...document.querySelectorAll(`main img.only-${theme}`)].some((image) => image.naturalWidth)"
)


def test_a_phone_fetches_the_figures_of_its_theme(visit, site):
    page, _ = visit((site / "book" / "learn" / "limits.html").as_uri(), viewport=NARROW)
    assert [page.evaluate(FETCHED, theme) for theme in ("light", "dark")] == [True, False]


MARKS = ('class="pidalab-live"', 'class="pidalab-lab"')
COUNTS = """() => [...document.querySelectorAll(".pidalab-live")].map((figure) => [...figure.querySelectorAll("img")]
  .filter((image) => image.checkVisibility() && image.complete && image.naturalWidth > 0 && image.alt.trim()).length)"""


def test_pages_without_javascript_show_pictures(browser, site):
    """Each live figure has a picture in each theme. The lab says that it needs JavaScript."""
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    paths = [
        file
        for file in (site / "book").rglob("*.html")
        if any(mark in file.read_text("utf-8") for mark in MARKS)
    ]
    assert len(paths) == 12  # six lectures, five chapters, the lab
    for path in paths:
        page.goto(path.as_uri())
        for theme in ("light", "dark"):
            page.emulate_media(color_scheme=theme)
            assert set(page.evaluate(COUNTS)) <= {1}, (path.name, theme)
        assert all("needs JavaScript" in words for words in page.locator(".pidalab-lab").all_inner_texts())
    context.close()


# --- slides --------------------------------------------------------------------------------------------------------

KINDS = ".pidalab-live, .pidalab-task, .exercise, figure, .math.notranslate"
SHOWN = (
    "() => [...document.querySelectorAll('.slide')].findIndex((slide) => slide.classList.contains('now')) + 1"
)
BESIDE = "() => { const now = document.querySelector('.now'); return now.scrollWidth - now.clientWidth }"
PROJECTOR = {"width": 1280, "height": 720}


@pytest.fixture(scope="module")
def lectures(site, root):
    return {
        path.stem: (site / "book/learn" / f"{path.stem}.html").as_uri()
        for path in root.glob("book/learn/*.ipynb")
    }


def test_slides_have_all_parts_of_every_lecture(lectures, visit):
    for name, address in lectures.items():
        page, _ = visit(address)
        on_page = page.locator(f"article :is({KINDS})").count()
        page, wrong = visit(f"{address}#slides", viewport=PROJECTOR)
        assert page.locator(f".slide :is({KINDS})").count() == on_page, name
        count = page.locator(".slide").count()
        for number in range(1, count + 1):
            assert page.evaluate(SHOWN) == number, name
            assert page.evaluate(BESIDE) <= 0, name
            page.keyboard.press("PageDown")
        assert page.locator(".pidalab-live .lab-plots svg").count() >= 1, name
        assert wrong == [], name


def test_slides_in_the_dark_on_a_phone(lectures, visit):
    page, wrong = visit(f"{lectures['what-acceleration-does']}#slides-5", "dark", NARROW)
    assert page.evaluate(SHOWN) == 5
    assert page.evaluate(OVERFLOW) <= 1
    page.keyboard.press("n")
    assert page.locator(".now > .notes").first.is_visible()
    page.keyboard.press("Home")
    page.keyboard.press("ArrowRight")
    assert page.evaluate(SHOWN) == 2
    assert wrong + accessibility_problems(page, runOnly=["color-contrast", "image-alt", "button-name"]) == []


def test_arrow_keys_move_a_slider_and_not_the_slides(lectures, visit):
    page, _ = visit(f"{lectures['what-acceleration-does']}#slides")
    while not page.locator(".now .pidalab-live").count():
        page.keyboard.press("ArrowRight")
    before = page.evaluate(SHOWN)
    page.locator(".now input[type=range]").first.press("ArrowRight")
    assert page.evaluate(SHOWN) == before
    page.keyboard.press("Escape")
    page.wait_for_function("() => !document.querySelector('.slide')")
