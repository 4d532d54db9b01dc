"""What readers without JavaScript see where a live figure or the lab would be."""

import pytest

MARKS = ('class="pidalab-live"', 'class="pidalab-lab"')
NEEDS = "needs JavaScript"
SEEN = (
    "image => image.checkVisibility() && image.complete && image.naturalWidth > 0 && image.alt.trim() !== ''"
)
PICTURE = "data:image/svg+xml,%3Csvg xmlns='http://www.w3.org/2000/svg' width='9' height='9'%3E%3C/svg%3E"
STILL = f'<div class="pidalab-live"><img alt="words" src="{PICTURE}"></div>'


@pytest.fixture(params=["light", "dark"])
def page(request, browser):
    context = browser.new_context(java_script_enabled=False, color_scheme=request.param)
    yield context.new_page()
    context.close()


def gaps(page):
    """Live figures of an open page without one picture, and labs that do not say what they need."""
    figures, labs = page.locator(".pidalab-live").all(), page.locator(".pidalab-lab").all()
    pictures = [sum(image.evaluate(SEEN) for image in figure.locator("img").all()) for figure in figures]
    wrong = [f"figure {k}: {count} pictures" for k, count in enumerate(pictures) if count != 1]
    return wrong + [f"lab {k} is silent" for k, lab in enumerate(labs) if NEEDS not in lab.inner_text()]


def test_a_picture_stands_for_each_live_figure_and_words_for_the_lab(page, site):
    pages = [
        path for path in (site / "book").rglob("*.html") if any(mark in path.read_text() for mark in MARKS)
    ]
    assert len(pages) == 12  # six lectures, five chapters, the lab
    wrong = {}
    for path in pages:
        page.goto(path.as_uri())
        wrong[path.name] = gaps(page)
    assert wrong == {path.name: [] for path in pages}


@pytest.mark.parametrize(
    ("html", "found"),
    [
        (STILL, []),
        (STILL.replace("<img", "<img hidden"), ["figure 0: 0 pictures"]),
        (STILL.replace("words", ""), ["figure 0: 0 pictures"]),
        (STILL.replace(PICTURE, "gone.svg"), ["figure 0: 0 pictures"]),
        (STILL.replace("></div>", f'><img alt="twin" src="{PICTURE}"></div>'), ["figure 0: 2 pictures"]),
        ('<div class="pidalab-lab"><script>1</script></div>', ["lab 0 is silent"]),
    ],
)
def test_a_gap_is_found(html, found, page):
    page.set_content(html)
    assert gaps(page) == found
