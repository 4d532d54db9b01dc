"""Slides of the lectures: whole in one file, readable without a network, moved by keys."""

import re

import pytest
import slides
from looking import NARROW, OVERFLOW, barriers, mark_kinds

COUNT = "() => document.querySelectorAll('.slide').length"
SHOWN = (
    "() => [...document.querySelectorAll('.slide')].findIndex((slide) => slide.classList.contains('now')) + 1"
)
TYPESET = "() => document.documentElement.dataset.typeset"
OUTSIDE = """() => {  // pixels of a slide beside the screen, and below
  const slide = document.querySelector(".now");
  return [slide.scrollWidth - innerWidth, slide.scrollHeight - slide.clientHeight];
}"""
PROJECTOR = {"width": 1280, "height": 720}
LOADS = re.compile(r"""<(?:script|img|link|iframe)\b[^>]*\b(?:src|href)="(?!data:)[^"]*""")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return {path.stem: path for path in slides.main(tmp_path_factory.mktemp("slides"))}


def missing(text):
    """List parts that the slides of a lecture lack, and files that they would load."""
    text = re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
    wanted = {  # by its mark
        "a question": "The question.",
        "a figure": "data:image/svg+xml",
        "a live figure": 'class="pidalab-live"',
        "a recipe": "<h2>The recipe</h2>",
        "formulas": r"\(",
        "a project": "<h2>Project</h2>",
    }
    wrong = [f"without {what}" for what, mark in wanted.items() if mark not in text]
    exercises, answers = (
        len(re.findall("<h2>(?:Exercise|Task [1-6]\\.[12]): ", text)),
        text.count("<summary>Answer</summary>"),
    )
    if exercises < 8 or answers != exercises:
        wrong.append(f"{exercises} exercises and tasks, {answers} answers")
    if "You need:" in text:
        wrong.append("a slide of what the teacher reads")
    return wrong + [f"loads {found}" for found in LOADS.findall(text)]


def test_every_lecture_has_slides_with_all_its_parts(made, root):
    assert sorted(made) == sorted(path.stem for path in root.glob("book/learn/*.ipynb"))
    assert {name: missing(path.read_text(encoding="utf-8")) for name, path in made.items()} == {
        name: [] for name in made
    }


def test_slides_are_moved_by_keys_and_fit(made, visit):
    for name, path in made.items():
        page, wrong = visit(path.as_uri(), viewport=PROJECTOR)
        page.wait_for_function(TYPESET)
        for number in range(1, page.evaluate(COUNT) + 1):
            assert page.evaluate(SHOWN) == number, name
            beside, below = page.evaluate(OUTSIDE)
            assert beside <= 0, (name, number)
            assert below <= 1, (name, number)
            page.keyboard.press("PageDown")
        assert page.locator("mjx-merror").count() == 0, name
        assert page.locator("mjx-container").count() > 10, name
        assert page.locator(".pidalab-live .lab-plots svg").count() >= 1, name
        assert wrong == [], name


def test_slides_in_the_dark_on_a_phone(made, visit):
    text = made["what-acceleration-does"].read_text(encoding="utf-8")
    number = next(
        k for k, part in enumerate(re.split(r'class="slide\b', text)) if k > 2 and 'class="notes"' in part
    )
    page, wrong = visit(f"{made['what-acceleration-does'].as_uri()}#{number}", "dark", NARROW)
    page.wait_for_function(TYPESET)
    assert page.evaluate(SHOWN) == number
    assert page.evaluate(OVERFLOW) <= 1
    assert page.locator("html").get_attribute("data-theme") == "dark"
    page.keyboard.press("n")
    assert page.locator(".now .notes").is_visible()
    page.keyboard.press("d")
    assert page.locator("html").get_attribute("data-theme") == "light"
    page.keyboard.press("Home")
    page.keyboard.press("PageDown")
    assert page.evaluate(SHOWN) == 2
    mark_kinds(page)
    assert wrong + barriers(page, runOnly=["color-contrast", "image-alt", "button-name"]) == []


def test_a_slide_appears_step_by_step(made, visit):
    page, _ = visit(made["limits"].as_uri(), viewport=PROJECTOR)
    page.wait_for_function(TYPESET)
    later = page.locator(".now .later")
    assert later.count() == 0  # the first slide is whole
    page.get_by_role("button", name="On", exact=True).click()
    assert page.evaluate(SHOWN) == 2
    for number in range(2, page.evaluate(COUNT)):
        hidden = later.count()
        while hidden:
            assert not later.first.is_visible()
            page.keyboard.press("ArrowRight")
            assert later.count() < hidden
            hidden = later.count()
        page.keyboard.press("ArrowRight")
        assert page.evaluate(SHOWN) == number + 1
    page.keyboard.press("ArrowLeft")
    assert later.count() == 0


def test_a_slider_keeps_its_keys(made, visit):
    page, _ = visit(made["what-acceleration-does"].as_uri())
    page.wait_for_function(TYPESET)
    while not page.locator(".now .pidalab-live").count():
        page.keyboard.press("ArrowRight")
    before = page.evaluate(SHOWN)
    page.locator(".now input[type=range]").first.press("ArrowRight")
    assert page.evaluate(SHOWN) == before
