"""Make slides of the lectures: one HTML file each, which needs no network, no other file and no notebook.

The source is the lecture itself, with its stored outputs; `make book` writes them to _build/html/slides. What a slide
shows is a heading with its formulas, lists, figures, live figures and results, and a little text; long text and code
become notes, which the key N shows. Exercises share slides, each with its answer folded.
"""

import base64
import re
import sys
from collections.abc import Iterator
from html import escape
from importlib.resources import files
from itertools import zip_longest
from math import ceil
from pathlib import Path
from typing import NamedTuple

import nbformat
from markdown_it import MarkdownIt
from mdit_py_plugins.dollarmath import dollarmath_plugin

ROOT = Path(__file__).resolve().parents[1]
HERE, LAB = Path(__file__).parent, ROOT / "book" / "_static" / "lab"
SCRIPTS = ("engine", "optima", "model", "optimum", "plot", "record", "lab", "live")
SHOWN = {"list", "formula", "figure", "live", "result", "table", "shown"}  # on the slide; the rest are notes
PICTURES = {"figure", "live"}
PLAN = "<ul>\n<li><strong>You need:</strong>"  # what the teacher reads before, no slide
SHORT, LEAD_IN = 1000, 200  # characters that a slide without a figure bears, and of what leads to a formula
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; font-src data:"
)
TOGETHER = 4  # exercises on a slide, at most
CODE_SHOWN = "The recipe"  # heading under which code is no note
FENCE = re.compile(r"\{([a-z:-]+)\}\s*(.*)")
LINK = re.compile(r"\[([^\]]*)\]\(([^)\s]*)\)")
LEAD = re.compile(r"<p><strong>(.*?)</strong>")
ROLE = re.compile(r"\{cite\}`([^`]*)`")


class Block(NamedTuple):
    """A piece of a lecture: what kind it is, and its HTML; a heading and an exercise have their text instead."""

    kind: str
    html: str


def markdown() -> MarkdownIt:
    """Return a Markdown parser that leaves formulas to MathJax."""

    def formula(tex: str, options: dict) -> str:
        return (r"\[{}\]" if options["display_mode"] else r"\({}\)").format(escape(tex))

    own = MarkdownIt("commonmark", {"html": True}).enable("table")
    return own.use(dollarmath_plugin, renderer=formula, allow_labels=False)


# --- from cells to blocks --------------------------------------------------------------------------------------------


def title(path: Path) -> str:
    """First heading of a page, for links without words."""
    if path.suffix == ".ipynb":
        cells = nbformat.read(path, as_version=4).cells
        text = "\n".join(cell.source for cell in cells if cell.cell_type == "markdown")
    else:
        text = path.read_text(encoding="utf-8")
    return re.search(r"^# (.*)$", text, re.MULTILINE)[1]


def plain(text: str, folder: Path) -> str:
    """Return text without links and citations."""
    text = LINK.sub(lambda link: link[1] or f"*{title(folder / link[2])}*", text)
    return ROLE.sub("", text).replace(" .", ".")


def blocks_of_text(own: MarkdownIt, text: str) -> Iterator[Block]:
    """Blocks of a Markdown cell."""
    tokens = own.parse(text)
    start = depth = 0
    for i, token in enumerate(tokens):
        depth += token.nesting
        if depth:
            continue
        piece, start = tokens[start : i + 1], i + 1
        html = own.renderer.render(piece, own.options, {})
        kind = piece[0].type
        if kind == "heading_open":
            yield Block(piece[0].tag, own.renderer.renderInline(piece[1].children, own.options, {}))
        elif kind == "fence":
            yield from fenced(own, piece[0].info, piece[0].content)
        elif kind.startswith("math_block"):
            yield Block("formula", html)
        elif kind in ("bullet_list_open", "ordered_list_open"):
            if not html.startswith(PLAN):
                yield Block("list", html)
        else:
            yield Block({"table_open": "table"}.get(kind, "text"), html)


def fenced(own: MarkdownIt, info: str, content: str) -> Iterator[Block]:
    """Blocks of a directive, or of plain code."""
    directive = FENCE.match(info)
    name, title = (directive[1], directive[2]) if directive else ("", "")
    label = re.match(r":label: task-([\d-]+)\n", content)
    content = re.sub(r"^(:[\w-]+:.*\n)+", "", content)
    if name == "raw":
        yield Block("live", content)
    elif name == "exercise":
        yield Block("exercise", f"<h2>Exercise: {escape(title)}</h2>{own.render(content)}")
    elif name == "task":  # on a slide nobody enters a number: its answer is folded, as that of an exercise
        words, _, _, answer = re.split(r"^---$", content, flags=re.MULTILINE)
        number = label[1].replace("-", ".") if label else ""
        yield Block("exercise", f"<h2>Task {number}: {escape(title)}</h2>{own.render(words)}")
        yield Block("solution-start", "")
        yield Block("text", own.render(answer))
        yield Block("solution-end", "")
    elif name in ("solution-start", "solution-end"):
        yield Block(name, "")
    elif name:
        yield Block("list", f"<div class='box'><strong>{escape(title)}</strong>{own.render(content)}</div>")
    else:
        yield Block("code", f"<pre><code>{escape(content)}</code></pre>")


def blocks_of_code(cell, darkened) -> Iterator[Block]:
    """Code of a cell, its figure in both inks, and what it prints."""
    tags = set(cell.metadata.get("tags", []))
    if not tags & {"remove-input", "remove-cell"}:
        yield Block("code", f"<pre><code>{escape(cell.source)}</code></pre>")
    for output in cell.outputs:
        data = output.get("data", {})
        if "scrapbook" in output.get("metadata", {}):
            continue
        if "image/svg+xml" in data:
            yield Block("figure", figure("".join(data["image/svg+xml"]), cell.metadata["mystnb"], darkened))
        elif "text/html" in data:
            yield Block("table", "".join(data["text/html"]))
        else:
            text = output.get("text") or data.get("text/plain", "")
            yield Block("result", f"<pre>{escape(''.join(text))}</pre>")


def figure(svg: str, words, darkened) -> str:
    """A figure as two images that are part of the page: as drawn, and in the inks of a dark page."""
    alt = escape(words["image"]["alt"])
    images = [
        f'<img class="{theme}" alt="{alt}" src="data:image/svg+xml;base64,{base64.b64encode(own.encode()).decode()}">'
        for theme, own in (("only-light", svg), ("only-dark", darkened(svg)))
    ]
    caption = re.sub(r"\$([^$]*)\$", r"\\(\1\\)", escape(words["figure"]["caption"]))
    return f"<figure>{''.join(images)}<figcaption>{caption}</figcaption></figure>"


def whole(blocks: list[Block]) -> Iterator[Block]:
    """Live figures in one piece: what one block opens and a later one closes, with all between, but for code."""
    inside: list[str] | None = None
    for block in blocks:
        if block.kind == "live" and inside is None:
            inside = []
        if inside is None or block.kind == "code":
            yield block
            continue
        inside.append(block.html)
        if block.kind == "live" and "</div>" in block.html:  # a link to the lab would lead nowhere
            yield Block("live", "".join(inside).replace('"lab": true', '"lab": false'))
            inside = None


# --- from blocks to slides -------------------------------------------------------------------------------------------


def slides(blocks: list[Block]) -> Iterator[str]:
    """Group blocks into slides, by headings and exercises."""
    heading, pile = "", []
    answer: list[Block] | None = None
    question, exercises = "", []
    for block in [*blocks, Block("h2", "")]:
        if answer is not None:
            if block.kind == "solution-end":
                inner = "".join(each.html for each in answer)
                folded = f"{question}<details><summary>Answer</summary>{inner}</details>"
                exercises.append(Block("shown", folded))
                answer = None
            else:
                answer.append(block)
        elif block.kind in ("h1", "h2", "h3"):
            yield from section(heading, pile)
            yield from shared(exercises)
            exercises = []
            heading, pile = (f"<h1>{block.html}</h1>" if block.kind == "h1" else f"<h2>{block.html}</h2>"), []
        elif block.kind == "exercise":
            yield from section(heading, pile)
            heading, pile, question = "", [], block.html
        elif block.kind == "solution-start":
            answer = []
        else:
            pile.append(block)


def shared(exercises: list[Block]) -> Iterator[str]:
    """Slides of exercises, as few and as even as can be."""
    if exercises:
        size = ceil(len(exercises) / ceil(len(exercises) / TOGETHER))
        yield from (slide("", exercises[k : k + size]) for k in range(0, len(exercises), size))


def section(heading: str, pile: list[Block]) -> Iterator[str]:
    """Slides of one heading: a figure has one of its own, with the words that announce it."""
    group: list[Block] = []
    alone = False  # what is on the slide is a figure, perhaps with results
    for block in ready(heading, pile):
        full = any(each.kind in SHOWN for each in group)
        if full and (block.kind in PICTURES or (alone and block.kind in SHOWN - {"result"})):
            at = announcement(group) if block.kind in PICTURES else len(group)
            if any(each.kind in SHOWN for each in group[:at]):
                yield slide(heading, group[:at])
                group = group[at:]
            alone = False
        group.append(block)
        alone = alone or block.kind in PICTURES
    if any(block.kind in SHOWN for block in group):
        yield slide(heading, group)


def announcement(group: list[Block]) -> int:
    """Return where the sentence that announces a figure begins, or the end if there is none."""
    last = next((k for k in reversed(range(len(group))) if group[k].kind in SHOWN), len(group))
    announces = last < len(group) and group[last].html.rstrip().endswith(":</p>")
    return last if announces else len(group)


def ready(heading: str, pile: list[Block]) -> list[Block]:
    """Blocks of a heading with the kinds that decide where they go."""
    if heading.startswith("<h1>"):  # the question and what one can do then; results wait for the figure
        first = next((k for k, b in enumerate(pile) if b.kind in PICTURES), 0)
        for k, block in enumerate(pile):
            if block.kind == "text" and k < first:
                pile[k] = Block("shown", block.html)
            elif block.kind == "result" and k < first:
                pile[k] = Block("note", block.html)
    elif CODE_SHOWN in heading:
        pile = [Block("result", b.html) if b.kind == "code" else b for b in pile]
    elif not any(block.kind in SHOWN for block in pile):
        pile = [Block("shown", b.html) if b.kind == "text" else b for b in pile]
    led = []
    for block, after in zip_longest(pile, [each.kind for each in pile[1:]]):
        lead = LEAD.match(block.html) if block.kind == "text" else None
        if lead and after in ("formula", "list"):  # of a paragraph that begins in bold, that is shown
            led += [Block("lead", f"<h3>{lead[1].rstrip('.')}</h3>"), block]
        elif lead or (block.kind == "text" and after == "formula" and length(block) <= LEAD_IN):
            led.append(Block("shown", block.html))
        else:
            led.append(block)
    return led


def length(block: Block) -> int:
    """Return the number of characters of a block; code counts as none."""
    return (
        0 if block.kind == "code" else len(re.sub(r"<style.*?</style>|<[^>]*>", "", block.html, flags=re.S))
    )


def slide(heading: str, blocks: list[Block]) -> str:
    """HTML of a slide: text is shown, too, where there is no figure and little else; or the words that lead it."""
    room = sum(map(length, blocks)) <= SHORT and not any(block.kind in PICTURES for block in blocks)
    shown, left_out = (SHOWN | {"text"}, "lead") if room else (SHOWN | {"lead"}, "")
    parts = [block.html for block in blocks if block.kind in shown]
    notes = [block.html for block in blocks if block.kind not in {*shown, left_out}]
    aside = f'<aside class="notes">{"".join(notes)}</aside>' if notes else ""
    return f'<section class="slide"><div class="inner">{heading}{"".join(parts)}{aside}</div></section>'


# --- files -----------------------------------------------------------------------------------------------------------


def lectures(toc: Path) -> list[Path]:
    """Notebooks under book/learn, in the order of the table of contents."""
    names = re.findall(r"file: (book/learn/[\w-]+)", toc.read_text(encoding="utf-8"))
    return [path for name in names if (path := toc.parent / f"{name}.ipynb").is_file()]


def page(path: Path) -> str:
    """The whole HTML file of a lecture."""
    sys.path.insert(0, str(ROOT / "book" / "_ext"))
    from figures_for_dark import darkened

    own, blocks = markdown(), []
    for cell in nbformat.read(path, as_version=4).cells:
        if cell.cell_type == "markdown":
            blocks += blocks_of_text(own, plain(cell.source, path.parent))
        elif cell.cell_type == "code":
            blocks += blocks_of_code(cell, darkened)
    made = list(slides(list(whole(blocks))))
    name = next(block.html for block in blocks if block.kind == "h1")
    mathjax = files("sphinx-mathjax-offline") / "static" / "mathjax" / "tex-svg.js"
    live = [LAB / f"{name}.js" for name in SCRIPTS] if any("pidalab-live" in each for each in made) else []
    styles = [LAB / "lab.css", HERE / "slides.css"]
    scripts = [HERE / "slides.js", *live, mathjax]
    return "".join(
        [
            f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{name}</title>',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',
            *(f"<style>{each.read_text(encoding='utf-8')}</style>" for each in styles),
            f"</head><body><main>{''.join(made)}</main>",
            *(f"<script>{inside(each.read_text(encoding='utf-8'))}</script>" for each in scripts),
            "</body></html>\n",
        ]
    )


def inside(script: str) -> str:
    """A script that can be written inside a page."""
    return script.replace("</script", r"<\/script")


def main(target: Path) -> list[Path]:
    """Write the slides of all lectures."""
    target.mkdir(parents=True, exist_ok=True)
    made = []
    for path in lectures(ROOT / "_toc.yml"):
        made.append(target / f"{path.stem}.html")
        made[-1].write_text(page(path), encoding="utf-8")
    return made
