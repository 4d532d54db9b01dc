"""Reading on a phone: figures of one theme, and commas that stay at their formulas."""

import re

from looking import NARROW

FETCHED = (
    "theme => [...document.querySelectorAll(`main img.only-${theme}`)].some((image) => image.naturalWidth)"
)


def test_a_phone_fetches_the_figures_of_its_theme(visit, site):
    page, _ = visit((site / "book" / "learn" / "limits.html").as_uri(), viewport=NARROW)
    assert [page.evaluate(FETCHED, theme) for theme in ("light", "dark")] == [True, False]


def loose_marks(page: str) -> int:
    """Formulas of a line whose comma a browser may put on the next one, or whose bracket it may leave behind."""
    tied = '<span class="tied">'
    after = rf'(?<!{tied})(?<!{tied}\()<span class="math [^>]*>[^<]*</span>[,.;:!?)]'
    return len(re.findall(after, page)) + len(re.findall(rf'(?<!{tied})\(<span class="math ', page))


def test_a_formula_keeps_its_comma(site):
    pages = list(site.glob("book/**/*.html"))
    assert len(pages) > 20
    assert [page.name for page in pages if loose_marks(page.read_text(encoding="utf-8"))] == []
