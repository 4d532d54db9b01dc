"""What readers without JavaScript see where a live figure or the lab would be."""

import pytest

MARKS = ('class="pidalab-live"', 'class="pidalab-lab"')
NEEDS = "needs JavaScript"
COUNTS = """() => [...document.querySelectorAll(".pidalab-live")].map((figure) => [...figure.querySelectorAll("img")]
  .filter((image) => image.checkVisibility() && image.complete && image.naturalWidth > 0 && image.alt.trim()).length)"""
PICTURE = "data:image/svg+xml,%3Csvg xmlns='http://www.w3.org/2000/svg' width='9' height='9'%3E%3C/svg%3E"
STILL = f'<div class="pidalab-live"><img alt="words" src="{PICTURE}"></div>'
PALE = "<style>@media (prefers-color-scheme: dark) { img { display: none } }</style>"


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


def in_both_themes(count):
    return [f"{theme}, figure 0: {count} pictures" for theme in ("light", "dark")]


@pytest.mark.parametrize(
    ("html", "found"),
    [
        (STILL, []),
        (STILL.replace("<img", "<img hidden"), in_both_themes(0)),
        (STILL.replace("words", ""), in_both_themes(0)),
        (STILL.replace(PICTURE, "gone.svg"), in_both_themes(0)),
        (STILL.replace("></div>", f'><img alt="twin" src="{PICTURE}"></div>'), in_both_themes(2)),
        (PALE + STILL, ["dark, figure 0: 0 pictures"]),
        ('<div class="pidalab-lab"><script>1</script></div>', ["lab 0 is silent"]),
    ],
)
def test_a_gap_is_found(html, found, page):
    page.set_content(html)
    assert gaps(page) == found
