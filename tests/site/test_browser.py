"""The built book as a reader meets it: in a browser, in light and dark, on a wide and on a narrow screen."""

import re
import threading
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest
from looking import NARROW, contrasts, looked_over
from turning import astray

from paperledger import papers


class QuietHandler(SimpleHTTPRequestHandler):
    def log_message(self, *args):
        pass


@contextmanager
def serve(directory):
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(QuietHandler, directory=directory)) as server:
        # the interval is how long a server that is told to stop goes on
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.fixture(scope="module")
def home(site):
    with serve(site) as address:
        yield address


@pytest.fixture(scope="module")
def judged():
    """Kinds of text whose contrast was judged on a page before."""
    return set()


def test_page(page_name, home, site, visit, judged):
    """A page is loaded once for all that is looked at, since that takes longest."""
    page, wrong = visit(f"{home}/{page_name}.html", viewport=NARROW)
    assert page.locator("html").get_attribute("data-theme") == "light"
    found = astray(page, site / f"{page_name}.html") + looked_over(page) + wrong
    assert found + contrasts(page, judged) == []


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
def test_an_address_that_encodes_nothing(place, home, visit):
    _, wrong = visit(f"{home}/book/{place}")
    assert wrong == []


def chapters(root):
    return [f"book/{paper}" for paper in papers(root / "book" / "ledger")]


def test_method_chapters_are_in_the_table_of_contents(root, toc):
    assert chapters(root)
    assert set(chapters(root)) <= set(toc)


def test_the_theme_is_that_of_the_readers_system(home, visit):
    page, wrong = visit(f"{home}/book/intro.html", "dark")
    assert page.locator("html").get_attribute("data-theme") == "dark"
    assert wrong == []


WORDS = [
    "Bode",
    "anti-windup",
    "two degrees of freedom",
    "SIMC",
    "PIDA",
    "dead time",
    "noise",
    "windup",
    "IAE",
]
NOT_FIRST = re.compile(r"book/(api|audit|bibliography|scoreboard|errata)")


@pytest.mark.parametrize("words", WORDS)
def test_search_leads_to_sections_and_to_chapters_first(words, home, visit):
    page, wrong = visit(f"{home}/search.html?q={words.replace(' ', '+')}")
    first = page.locator("#search-results li a").first
    first.wait_for()
    address = first.get_attribute("href")
    assert wrong == []
    assert "#" in address
    assert not NOT_FIRST.search(address)


# What a reader would type, and where a good answer is: among the first three sections found.
ANSWERED = {
    "install": "how-do-i.html#install",
    "how to install pidalab": "how-do-i.html#install",
    "download": "how-do-i.html#install",
    "cite": "how-do-i.html#cite",
    "licence": "how-do-i.html#cite",
    "bumpless transfer": "digital.html#bumpless-transfer",
    "manual to automatic": "digital.html#bumpless-transfer",
    "step response identification": "design.html",
    "tune from data": "design.html",
    "system identification": "design.html#fit",
    "Ziegler Nichols": "rules.html",
    "Ziegler–Nichols": "rules.html",
    "lambda tuning": "rules.html",
    "first order plus dead time": "process.html#pidalab.fopdt",
    "setpoint weighting": "how-do-i.html#weigh-the-set-point",
    "derivative kick": "how-do-i.html#weigh-the-set-point",
    "derivative filter": "filter-and-noise.html",
    "anti-windup": "limits.html",
    "integrator windup": "limits.html",
    "gain margin": "tuning.html#what-ms-means",
    "maximum sensitivity": "tuning.html#what-ms-means",
    "PLC code": "design.html#write",
    "C code": "how-do-i.html#get-c-code",
    "sampling time": "digital.html#choose-h",
    "aliasing": "digital.html",
    "Bode plot": "how-do-i.html#draw-a-bode-plot",
    "cascade control": "how-do-i.html#control-a-cascade",
    "gain scheduling": "how-do-i.html#gain-scheduling",
    "Smith predictor": "how-do-i.html#also-not-supported",
    "Matlab": "how-do-i.html#hand-a-controller",
    "settling time": "notation.html#conventions",
    "PIDD2": "what-acceleration-does.html#names",
    "2DOF": "how-do-i.html#weigh-the-set-point",
    "temperature control Arduino": "heater.html",
    "dead time compensation": "how-do-i.html#also-not-supported",
    "IMC": "rules.html#pidalab.rules.itae.imc_pid",
    "acceleration term": "what-acceleration-does.html",
}
FOUND = """(queries) => queries.map((query) => {
  Search.performSearch(query);
  return [...document.querySelectorAll("#search-results li a")].slice(0, 3).map((a) => a.getAttribute("href"));
})"""


def test_what_readers_type_is_found(home, visit):
    page, wrong = visit(f"{home}/search.html?q=noise")
    page.locator("#search-results li a").first.wait_for()
    found = dict(zip(ANSWERED, page.evaluate(FOUND, list(ANSWERED)), strict=True))
    missed = {
        query: found[query]
        for query, answer in ANSWERED.items()
        if not any(answer in each for each in found[query])
    }
    assert (missed, wrong) == ({}, [])


# What the search shows of a long section whose title alone has its word, and how the section begins.
IN_ITS_TITLE = """() => {
  for (const { title, page, text, url } of bookSections) {
    const lower = text.toLowerCase();
    const absent = (each) => /^[a-z]{6,}$/i.test(each) && !lower.includes(each.toLowerCase());
    const word = title.split(" ").find(absent);
    if (!word || text.length < 400 || page.includes(word)) continue;
    Search.performSearch(word);
    const hits = [...document.querySelectorAll("#search-results li")];
    const hit = hits.find((li) => li.querySelector("a").href.endsWith(url));
    if (hit) return [hit.querySelector(".context").textContent, text];
  }
}"""


def test_a_word_of_the_title_alone_shows_how_its_section_begins(home, visit):
    page, _ = visit(f"{home}/search.html?q=noise")
    page.locator("#search-results li a").first.wait_for()
    shown, text = page.evaluate(IN_ITS_TITLE)
    assert shown.startswith(text[:200])


def test_focus_is_seen(home, visit):
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
