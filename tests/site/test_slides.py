"""A lecture as slides: nothing is lost, keys move them, nothing is cut off."""

import pytest
from looking import NARROW, OVERFLOW, barriers, mark_kinds

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
            assert (
                page.evaluate(
                    "() => { const s = document.querySelector('.now'); return s.scrollWidth - s.clientWidth }"
                )
                <= 0
            )
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
    mark_kinds(page)
    assert wrong + barriers(page, runOnly=["color-contrast", "image-alt", "button-name"]) == []


def test_a_slider_keeps_its_keys(lectures, visit):
    page, _ = visit(f"{lectures['what-acceleration-does']}#slides")
    while not page.locator(".now .pidalab-live").count():
        page.keyboard.press("ArrowRight")
    before = page.evaluate(SHOWN)
    page.locator(".now input[type=range]").first.press("ArrowRight")
    assert page.evaluate(SHOWN) == before
    page.keyboard.press("Escape")
    page.wait_for_function("() => !document.querySelector('.slide')")
