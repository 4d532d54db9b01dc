"""Find problems of an open page, on wide and narrow screens."""

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page

WIDE, NARROW = {"width": 1280, "height": 900}, {"width": 390, "height": 844}

TYPESET = "() => !document.querySelector('script[src*=mathjax]') || window.MathJax?.startup?.promise?.then(() => true)"

# Findings of axe-core that other tools cause: rule, and a mark of the element.
ACCEPTED = [
    ("empty-table-header", "data-maths"),  # a formula, see below
    ("aria-allowed-role", "doc-biblioentry"),  # docutils' markup of a bibliography entry
    ("aria-deprecated-role", "doc-biblioentry"),
    ("aria-required-children", "citation-list"),
    ("region", "logo__title"),  # the book name is outside the landmarks of the theme
]

# Formulas left as source: delimiters or environments in the visible text outside code.
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

# Formulas must not be tab stops, and the button of a fold must say what it unfolds.
HINDRANCES = """() => {
  const all = (selector) => [...document.querySelectorAll(selector)], found = [];
  if (all("mjx-container[tabindex]").length) found.push("formulas are stops of the Tab key");
  for (const fold of all("main [aria-label='Toggle hidden content']")) found.push("a fold without a name");
  for (const fold of all("main details > summary")) {
    if (!fold.textContent.trim()) found.push("a fold without words");
    if (/cell (source|output)/.test(fold.textContent)) found.push("a fold that only names a cell");
  }
  const index = /(^|[^\\w.\\p{L}])(\\p{L}\\p{M}?|[A-Z]{2,5})_[-\\p{L}\\d]/u;
  for (const cell of all("main table.dataframe :is(th, td), main .cell_output :is(p, li)")) {
    const words = cell.cloneNode(true);
    words.querySelectorAll("code").forEach((one) => one.remove());
    if (index.test(words.textContent)) found.push(`an index left raw: ${cell.textContent}`);
  }
  for (const table of all(".pidalab-live .lab-table"))
    if (table.scrollWidth > table.clientWidth) found.push(`numbers out of sight: ${table.textContent}`);
  return found;
}"""

# Figures on a small screen, also in folds: words below 9 px (an index is a part of its word), and parts that are cut or
# scroll. The words of a picture are read from its file.
FIGURES = """async () => {
  const shut = [...document.querySelectorAll("main details:not([open])")], found = [];
  shut.forEach((fold) => { fold.open = true; });
  const judge = (what, box, sizes) => {
    if (Math.min(...sizes) < 9) found.push(`words of ${Math.min(...sizes).toFixed(1)} px in ${what}`);
    if (box.left < 0 || box.right > innerWidth) found.push(`cut: ${what}`);
  };
  for (const image of document.querySelectorAll("main img[src$='.svg']")) {
    const box = image.getBoundingClientRect();
    for (let one = image; one.matches("main *"); one = one.parentElement)
      if (one.scrollWidth > one.clientWidth + 1 && /auto|scroll/.test(getComputedStyle(one).overflowX))
        found.push(`scrolls: ${image.src}`);
    if (!box.width) continue;
    const drawn = new DOMParser().parseFromString(await (await fetch(image.src)).text(), "image/svg+xml");
    const scale = box.width / drawn.documentElement.viewBox.baseVal.width;
    const given = (word) => word.closest("[font-size]")?.getAttribute("font-size") || 0; // in a file written by hand
    const own = (one) => parseFloat(one.style.fontSize || given(one));
    const size = (word) => Math.max(...[word, ...word.children].map(own));
    judge(image.src, box, [...drawn.querySelectorAll("text")].map((word) => scale * size(word)));
  }
  for (const plot of document.querySelectorAll("main svg.lab-plot")) {
    const box = plot.getBoundingClientRect(), scale = box.width / plot.viewBox.baseVal.width;
    const sizes = [...plot.querySelectorAll("text")].map((word) => parseFloat(getComputedStyle(word).fontSize));
    if (box.width) judge(plot.textContent, box, sizes.map((size) => scale * size));
  }
  shut.forEach((fold) => { fold.open = false; });
  return found;
}"""

# Tables that do not fit a wide screen, also in folds.
WIDE_TABLES = """() => {
  const shut = [...document.querySelectorAll("main details:not([open])")];
  shut.forEach((fold) => { fold.open = true; });
  const wide = [...document.querySelectorAll("main table")].filter(
    (table) => table.offsetWidth > table.closest(".text_html, div, article").clientWidth + 1,
  );
  const found = wide.map((table) => `wider than the page: ${table.textContent.trim().slice(0, 60)}`);
  shut.forEach((fold) => { fold.open = false; });
  return found;
}"""

WORDLESS = "() => [...document.images].filter(i => !i.alt.trim() && !i.closest('a, button')).map(i => i.src)"

# During transitions, colours and widths would be intermediate.
STILL = "* { transition: none !important }"
# axe-core does not check text on a gradient, such as that of scrolling tables.
PLAIN = "* { background-image: none !important }"
COLOURS = ["color-contrast", "link-in-text-block"]
AXE = "async ([where, options]) => (await axe.run(where, options)).violations"
IN_THEME = "(theme) => { document.documentElement.dataset.theme = theme }"


def problems(page: Page) -> list[str]:
    """List raw formulas, images without words, folds without names, and overflow."""
    wrong = [f"maths left raw: {text}" for text in page.evaluate(RAW_MATHS)]
    wrong += [f"image without alt text: {source}" for source in page.evaluate(WORDLESS)]
    wrong += page.evaluate(HINDRANCES)
    if (pixels := page.evaluate(OVERFLOW)) > 1:
        wrong.append(f"page {pixels} px wider than the screen")
    return wrong


def accessibility_problems(page: Page, **options) -> list[str]:
    """List findings of axe-core outside formulas and code, except accepted findings."""
    if not page.evaluate("() => 'axe' in window"):
        page.evaluate(Axe().axe_script)
    # axe-core does not read formulas, so a formula in a table head seems empty.
    page.evaluate(
        "() => document.querySelectorAll('th:has(mjx-container)').forEach((x) => { x.dataset.maths = 1; })"
    )
    # With preload axe-core would request stylesheets, some at a wrong address.
    options = {"resultTypes": ["violations"], "preload": False, **options}
    return [
        f"axe {finding['id']}: {node['html']}"
        for finding in page.evaluate(AXE, [{"exclude": [["mjx-container"], ["pre"]]}, options])
        for node in finding["nodes"]
        if not any(finding["id"] == rule and mark in node["html"] for rule, mark in ACCEPTED)
    ]


def layout_problems(page: Page) -> list[str]:
    """List problems of a page, narrow and wide, except those of colours."""
    page.add_style_tag(content=STILL)
    page.set_viewport_size(NARROW)
    wrong = [f"narrow: {problem}" for problem in problems(page) + page.evaluate(FIGURES)]
    page.set_viewport_size(WIDE)
    wrong += problems(page) + page.evaluate(WIDE_TABLES)
    page.wait_for_timeout(400)  # until the theme has made scrolling elements tab stops
    return wrong + accessibility_problems(page, rules={rule: {"enabled": False} for rule in COLOURS})


def contrast_problems(page: Page) -> list[str]:
    """List texts that are too pale, and links too similar to their text, in light and dark mode."""
    page.add_style_tag(content=STILL + PLAIN)
    wrong = []
    for theme in ("light", "dark"):
        page.evaluate(IN_THEME, theme)
        wrong += [f"{theme}: {text}" for text in accessibility_problems(page, runOnly=COLOURS)]
    return wrong
