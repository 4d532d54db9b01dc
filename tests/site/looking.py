"""Find what is wrong with an open page, on wide and narrow screens."""

from collections.abc import Iterable

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page

WIDE, NARROW = {"width": 1280, "height": 900}, {"width": 390, "height": 844}

TYPESET = "() => !document.querySelector('script[src*=mathjax]') || window.MathJax?.startup?.promise?.then(() => true)"

# Findings of axe-core that come from tools the book stands on: the rule, and what marks the element.
ACCEPTED = [
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
  for (const cell of all("main table.dataframe :is(th, td), main .cell_output :is(p, li)")) {
    const words = cell.cloneNode(true);
    words.querySelectorAll("code").forEach((one) => one.remove());
    if (index.test(words.textContent)) found.push(`an index left raw: ${cell.textContent}`);
  }
  for (const table of all(".pidalab-live .lab-table"))
    if (table.scrollWidth > table.clientWidth) found.push(`numbers out of sight: ${table.textContent}`);
  return found;
}"""

# Figures on a small screen, those in folds, too: words below 9 px (an index is a part of its word), and what is cut or
# scrolls. A picture's words are read from its file.
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

# Words of first columns, tables in folds too, that go on in the next line though a column of the width that a phone
# has for it would hold them.
BROKEN = r"""() => {
  const shut = [...document.querySelectorAll("main details:not([open])")], range = document.createRange(), found = [];
  shut.forEach((fold) => { fold.open = true; });
  for (const cell of document.querySelectorAll("main table tr > :first-child")) {
    const walker = document.createTreeWalker(cell, NodeFilter.SHOW_TEXT);
    while (walker.nextNode()) {
      const { currentNode: text } = walker;
      if (text.parentElement.closest("mjx-container")) continue;
      for (const word of text.data.matchAll(/[\p{L}\p{N}_.,]+/gu)) {
        range.setStart(text, word.index);
        range.setEnd(text, word.index + word[0].length);
        const boxes = [...range.getClientRects()], width = boxes.reduce((sum, box) => sum + box.width, 0);
        const lines = new Set(boxes.map((box) => Math.round(box.top))).size;
        if (lines > 1 && width < 130) found.push(`broken in a first column: ${word[0]}`);
      }
    }
  }
  shut.forEach((fold) => { fold.open = false; });
  return found;
}"""

# Tables, those in folds too, that do not fit a wide screen.
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

# Formulas as boxes of their size and code as plain text: axe-core is not to take their thousands of parts apart. The
# theme makes what scrolls a stop of the Tab key 0.3 s after the last change of the page or of its size; here, at once.
PLAINER = """() => {
  const all = (selector) => [...document.querySelectorAll(selector)];
  const later = setTimeout;
  globalThis.setTimeout = (act, _, ...given) => later(act, 0, ...given);
  document.querySelector("main").append("");  // a change, if there is no other
  const formulas = all("mjx-container"), sizes = formulas.map((one) => one.getBoundingClientRect());
  formulas.forEach((one, k) => {
    const box = document.createElement("span");
    box.textContent = "x";
    box.style.cssText = `display: inline-block; width: ${sizes[k].width}px; height: ${sizes[k].height}px`;
    one.replaceWith(box);
  });
  for (const code of all("pre:not(:has(a, button, [tabindex]))")) {
    code.parts = [...code.childNodes];
    code.textContent = code.textContent;
  }
  globalThis.settled = new Promise((done) => later(() => later(done)));  // after the theme's
}"""
COLOURED = (
    "() => document.querySelectorAll('pre').forEach((one) => one.parts && one.replaceChildren(...one.parts))"
)

COLOURS = ("color-contrast", "link-in-text-block")
MOST = 8  # texts of a kind whose colours are judged
# A few visible texts and links of each kind that was not judged before, from all over the page: what contrast depends
# on is the same for all of a kind, and so is what tells a link from the text around it; but axe-core does not judge a
# single letter, nor a text that something else covers in part.
MARK_KINDS = """([most, judged]) => {
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), texts = new Set();
  const kinds = new Map(), grounds = new Map(), fades = new Map();
  const add = (parts, one) => {
    const kind = parts.join("|");
    if (!kinds.has(kind)) kinds.set(kind, []);
    kinds.get(kind).push(one);
  };
  while (walker.nextNode()) {
    const { data, parentElement } = walker.currentNode;
    if (data.trim().length > 1 && !parentElement.closest("mjx-container")) texts.add(parentElement);
  }
  const ground = (one) => {  // colours behind a text, down to the first that nothing shines through
    if (!one) return "";
    if (!grounds.has(one)) {
      const { backgroundColor, backgroundImage } = getComputedStyle(one), plain = backgroundImage === "none";
      const own = backgroundColor === "rgba(0, 0, 0, 0)" && plain ? "" : `${backgroundColor} ${backgroundImage} `;
      grounds.set(one, own + (backgroundColor.startsWith("rgb(") && plain ? "" : ground(one.parentElement)));
    }
    return grounds.get(one);
  };
  const faded = (one) => {
    if (!one) return 1;
    if (!fades.has(one)) fades.set(one, getComputedStyle(one).opacity * faded(one.parentElement));
    return fades.get(one);
  };
  for (const text of texts) {
    if (!text.checkVisibility({ opacityProperty: true, visibilityProperty: true })) continue;
    const { color, fontSize, fontWeight, textShadow } = getComputedStyle(text);
    const link = text.closest("a[href]");
    if (link) {
      const around = getComputedStyle(link.parentElement);
      const looks = (s) => [
        s.color, s.backgroundColor, s.borderBottomStyle, s.display, s.fontSize, s.fontStyle, s.fontWeight,
        s.textDecorationLine,
      ];
      add(["link", ...looks(getComputedStyle(link)), ...looks(around)], link);
    }
    const size = parseFloat(fontSize), large = size >= 24 || (size > 18.6 && fontWeight >= 700);
    add([color, large, textShadow, ground(text), faded(text)], text);
  }
  for (const marked of document.querySelectorAll("[data-kind]")) marked.removeAttribute("data-kind");
  for (const kind of judged) kinds.delete(kind);
  for (const same of kinds.values())
    for (let k = 0; k < most; k++) same[Math.floor(k * (same.length - 1) / (most - 1))].dataset.kind = "";
  return [...kinds.keys()];
}"""


# What holds no marked text, emptied: a page of thousands of cells takes axe-core seconds for each theme. The rows stay,
# so that stripes do.
EMPTY_UNMARKED = """() => {
  const empty = (one) => {
    for (const child of one.children)
      if (child.matches("[data-kept]") || child.querySelector("[data-kept]")) empty(child);
      else if (!child.matches("style, script")) child.replaceChildren();
  };
  empty(document.body);
}"""
# Halfway between themes a colour is none, nor is a width between two screens.
STILL = "* { transition: none !important }"
# axe-core judges no text on a gradient: that of what scrolls lies on the colour of its ground.
PLAIN = "* { background-image: none !important }"
ONLY_MARKED = """() => axe.configure({ rules: [
  { id: "color-contrast", selector: "[data-kind]" }, { id: "link-in-text-block", selector: "a[data-kind]" },
] })"""
KEEP_MARKED = "() => document.querySelectorAll('[data-kind]').forEach((one) => { one.dataset.kept = '' })"
IN_THEME = "(theme) => { document.documentElement.dataset.theme = theme }"


def problems(page: Page) -> list[str]:
    """List raw formulas, images without words, nameless folds and overflow."""
    wrong = [f"maths left raw: {text}" for text in page.evaluate(RAW_MATHS)]
    wrong += [f"image without alt text: {source}" for source in page.evaluate(WORDLESS)]
    wrong += page.evaluate(HINDRANCES)
    if (pixels := page.evaluate(OVERFLOW)) > 1:
        wrong.append(f"page {pixels} px wider than the screen")
    return wrong


def mark_kinds(page: Page, judged: Iterable[str] = ()) -> list[str]:
    """Mark a few texts and links of each kind whose colours were not judged before; returns these kinds."""
    return page.evaluate(MARK_KINDS, [MOST, list(judged)])


def barriers(page: Page, **options) -> list[str]:
    """List the findings of axe-core, less the accepted ones; colours are judged on marked texts alone."""
    if not page.evaluate("() => 'axe' in window"):
        page.evaluate(Axe().axe_script)
        page.evaluate(ONLY_MARKED)
    page.evaluate("() => globalThis.settled")
    # Without preload: axe would ask for stylesheets itself, and look for some in the wrong place.
    options = {"resultTypes": ["violations"], "preload": False, **options}
    return [
        f"axe {finding['id']}: {node['html']}"
        for finding in page.evaluate("async (options) => (await axe.run(options)).violations", options)
        for node in finding["nodes"]
        if not any(finding["id"] == rule and mark in node["html"] for rule, mark in ACCEPTED)
    ]


def looked_over(page: Page) -> list[str]:
    """List what is wrong with a page, narrow and wide; its formulas become boxes."""
    page.add_style_tag(content=STILL)
    page.set_viewport_size(NARROW)
    wrong = [
        f"narrow: {problem}" for problem in problems(page) + page.evaluate(FIGURES) + page.evaluate(BROKEN)
    ]
    page.set_viewport_size(WIDE)
    wrong += problems(page) + page.evaluate(WIDE_TABLES)
    page.evaluate(PLAINER)
    wrong += barriers(page, rules={rule: {"enabled": False} for rule in COLOURS})
    page.evaluate(COLOURED)
    return wrong


def contrasts(page: Page, judged: set[str]) -> list[str]:
    """Texts too pale and links too like them in light or in the dark, of kinds not judged before; these are added.

    Little is left of the page: its own scripts may stumble from now on.
    """
    page.add_style_tag(content=STILL + PLAIN)
    new = []
    for theme in ("light", "dark"):  # what is one kind in one may be two in the other
        page.evaluate(IN_THEME, theme)
        new += mark_kinds(page, judged)
        page.evaluate(KEEP_MARKED)
    if not new:
        return []
    page.evaluate(EMPTY_UNMARKED)
    wrong = []
    for theme in ("light", "dark"):
        page.evaluate(IN_THEME, theme)
        mark_kinds(page, judged)
        wrong += [f"{theme}: {text}" for text in barriers(page, runOnly=COLOURS)]
    judged.update(new)
    return wrong
