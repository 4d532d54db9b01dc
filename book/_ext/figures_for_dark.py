"""Draw every figure for a dark page, too.

A figure is an SVG in dark ink on nothing. For the dark theme a second file is written in which each ink has its
counterpart for a dark page: black becomes nearly white, a hue keeps its hue and becomes lighter. Colour maps mean
numbers, so they stay as they are, and so does every group whose id begins with ``as-drawn``.
The page carries both images, and the theme shows the one that fits. The dark one is fetched when it is to be seen;
print shows the other. The words of a figure are in the font of the page around it.
"""

import colorsys
import re
from pathlib import Path
from urllib.parse import unquote

IMAGE = re.compile(r'<img\b[^>]*\bsrc="[^"]*_images/([^"]+\.svg)"[^>]*>')
SOURCE = re.compile(r'(\bsrc="[^"]*_images/[^"]+)\.svg"')
CLASS = re.compile(r'\bclass="([^"]*)"')
COLOUR = re.compile(r"\b(fill|stroke|stop-color)(: ?|=\")(#[0-9a-fA-F]{6})\b")
GROUP = re.compile(r'<g\b(?:[^>]*?\bid="([^"]*)")?[^>]*?(/?)>|</g>')
AS_DRAWN = ("as-drawn", "QuadMesh", "QuadContourSet", "ContourSet", "TriContourSet")

SIZE = re.compile(r'<svg\b[^>]*?\bwidth="([\d.]+)pt" height="([\d.]+)pt"')
PX = 4 / 3  # of a point
FONT = re.compile(r"'DejaVu Sans'(, [^;\"]*sans-serif)?")  # by whose widths matplotlib places the words
OF_THE_PAGE = (  # as pidalab.css has it
    "system-ui, -apple-system, 'Segoe UI', 'Noto Sans', 'Liberation Sans', Helvetica, Arial, sans-serif"
)

GREY = 0.15  # saturation below which a colour counts as grey
LIGHTEST, DARKEST = 0.92, 0.08  # of a grey: neither glare nor a hole
INK = 0.68  # lightness of a coloured line on a dark page


def for_dark(colour: str) -> str:
    """Return the counterpart of a colour such as ``#1f5fa8`` on a dark page."""
    red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    hue, lightness, saturation = colorsys.rgb_to_hls(red, green, blue)
    turned = DARKEST + (LIGHTEST - DARKEST) * (1 - lightness)
    lightness = turned if saturation < GREY else max(lightness, INK)
    return "#" + "".join(
        f"{round(255 * part):02x}" for part in colorsys.hls_to_rgb(hue, lightness, saturation)
    )


def darkened(svg: str) -> str:
    """Return the SVG of a figure for a dark page."""
    pieces, start, kept = (
        [],
        0,
        0,
    )  # kept: how many groups are open inside one that stays as drawn
    for group in GROUP.finditer(svg):
        text = svg[start : group.start()]
        pieces.append(text if kept else _inked(text))
        start = group.start()
        closing = group.group(0) == "</g>"
        if kept:
            kept += -1 if closing else (0 if group.group(2) else 1)
        elif not closing and not group.group(2) and (group.group(1) or "").startswith(AS_DRAWN):
            kept = 1
    pieces.append(_inked(svg[start:]))
    dark = "".join(pieces)
    # Text and markers without a colour are black. Give the figure a light default, but not to what stays as drawn.
    dark = dark.replace('<g id="as-drawn', '<g fill="#111111" id="as-drawn')
    return dark.replace("<svg ", f'<svg fill="{for_dark("#000000")}" ', 1)


def _inked(text: str) -> str:
    return COLOUR.sub(lambda found: found[1] + found[2] + for_dark(found[3]), text)


def room(svg: str) -> str:
    """Return the attributes of an image that say how large it is, so that a page does not move as it loads."""
    size = SIZE.search(svg)
    if not size:
        return ""
    width, height = (PX * float(length) for length in size.groups())
    return f' width="{width:.0f}" height="{height:.0f}"'


def _pair(tag: str, attributes: str) -> str:
    def shown(tag: str, theme: str) -> str:
        if CLASS.search(tag):
            return CLASS.sub(rf'class="\1 {theme}"', tag, count=1)
        return tag.replace("<img", f'<img class="{theme}"', 1)

    if "only-light" in tag or "only-dark" in tag:
        return tag
    tag = tag.replace("<img", f"<img{attributes}", 1)
    dark = SOURCE.sub(r'\1-dark.svg"', tag).replace("<img", '<img loading="lazy"', 1)
    return shown(tag, "only-light") + shown(dark, "only-dark")


def show_both(app, pagename, templatename, context, doctree):
    """Put the dark twin of each figure beside it."""
    if "body" not in context:
        return
    sources = {name: Path(app.srcdir, source) for source, name in app.builder.images.items()}

    def both(image: re.Match[str]) -> str:
        source = sources[unquote(image[1])]
        return _pair(image[0], room(source.read_text(encoding="utf-8")))

    context["body"] = IMAGE.sub(both, context["body"])


def write_dark(app, exception):
    """Write all figures in the font of the page, and their dark twins, once they are copied."""
    if exception or app.builder.format != "html":
        return
    for path in Path(app.outdir, "_images").glob("*.svg"):
        if not path.stem.endswith("-dark"):
            light = FONT.sub(OF_THE_PAGE, path.read_text(encoding="utf-8"))
            path.write_text(light, encoding="utf-8")
            path.with_name(f"{path.stem}-dark.svg").write_text(darkened(light), encoding="utf-8")


def setup(app):
    app.connect("html-page-context", show_both)
    app.connect("build-finished", write_dark)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
