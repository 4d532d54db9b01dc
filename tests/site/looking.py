"""What is wrong with an open page, as its reader meets it, and the screens it is read on."""

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page

WIDE, NARROW = {"width": 1280, "height": 900}, {"width": 390, "height": 844}

TYPESET = "() => !document.querySelector('script[src*=mathjax]') || window.MathJax?.startup?.promise?.then(() => true)"

# Findings of axe-core that come from tools the book stands on: the rule, and what marks the element.
ACCEPTED = [
    ("empty-table-header", '<th class="head">'),  # a header that is a formula, which axe is not shown
    ("aria-allowed-role", "doc-biblioentry"),  # docutils' markup of a bibliography entry
    ("aria-deprecated-role", "doc-biblioentry"),
    ("aria-required-children", "citation-list"),
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

OVERFLOW = "() => document.scrollingElement.scrollWidth - document.scrollingElement.clientWidth"

# Formulas are read, not operated, and a fold's button says what it unfolds.
HINDRANCES = """() => {
  const all = (selector) => [...document.querySelectorAll(selector)], found = [];
  if (all("mjx-container[tabindex]").length) found.push("formulas are stops of the Tab key");
  for (const fold of all("main [aria-label='Toggle hidden content']")) found.push("a fold without a name");
  for (const fold of all("main details > summary")) {
    if (!fold.textContent.trim()) found.push("a fold without words");
    if (/cell (source|output)/.test(fold.textContent)) found.push("a fold that only names a cell");
  }
  const index = /(^|[^\\w.\\p{L}])(\\p{L}\\p{M}?|[A-Z]{2,5})_[-\\p{L}\\d]/u;
  for (const cell of all("main table.dataframe :is(th, td)"))
    if (index.test(cell.textContent)) found.push(`an index left raw: ${cell.textContent}`);
  return found;
}"""

WORDLESS = "() => [...document.images].filter(i => !i.alt.trim() && !i.closest('a, button')).map(i => i.src)"


def problems(page: Page) -> list[str]:
    """What a reader would stumble over on an open page."""
    wrong = [f"maths left raw: {text}" for text in page.evaluate(RAW_MATHS)]
    wrong += [f"image without alt text: {source}" for source in page.evaluate(WORDLESS)]
    wrong += page.evaluate(HINDRANCES)
    if (pixels := page.evaluate(OVERFLOW)) > 1:
        wrong.append(f"page {pixels} px wider than the screen")
    return wrong


def barriers(page: Page, **more) -> list[str]:
    """What axe-core finds on an open page, less what is accepted."""
    # Without preload: axe would ask for stylesheets itself, and look for some in the wrong place.
    options = {"resultTypes": ["violations"], "preload": False, **more}
    findings = Axe().run(page, {"exclude": [["mjx-container"]]}, options).response["violations"]
    return [
        f"axe {finding['id']}: {node['html']}"
        for finding in findings
        for node in finding["nodes"]
        if not any(finding["id"] == rule and mark in node["html"] for rule, mark in ACCEPTED)
    ]
