"""Pages without JavaScript show a picture for each live figure."""

import pytest

MARKS = ('class="pidalab-live"', 'class="pidalab-lab"')
NEEDS = "needs JavaScript"
COUNTS = """() => [...document.querySelectorAll(".pidalab-live")].map((figure) => [...figure.querySelectorAll("img")]
  .filter((image) => image.checkVisibility() && image.complete && image.naturalWidth > 0 && image.alt.trim()).length)"""


@pytest.fixture(scope="module")
def page(browser):
    context = browser.new_context(java_script_enabled=False)
    yield context.new_page()
    context.close()


def gaps(page):
    """Live figures of an open page without one picture in a theme, and labs that do not say what they need."""
    wrong = []
    for theme in ("light", "dark"):
        page.emulate_media(color_scheme=theme)
        counts = enumerate(page.evaluate(COUNTS))
        wrong += [f"{theme}, figure {k}: {count} pictures" for k, count in counts if count != 1]
    labs = enumerate(page.locator(".pidalab-lab").all_inner_texts())
    return wrong + [f"lab {k} is silent" for k, words in labs if NEEDS not in words]


def test_a_picture_stands_for_each_live_figure_and_words_for_the_lab(page, site):
    pages = [
        path
        for path in (site / "book").rglob("*.html")
        if any(mark in path.read_text(encoding="utf-8") for mark in MARKS)
    ]
    assert len(pages) == 12  # six lectures, five chapters, the lab
    wrong = {}
    for path in pages:
        page.goto(path.as_uri())
        wrong[path.name] = gaps(page)
    assert wrong == {path.name: [] for path in pages}
