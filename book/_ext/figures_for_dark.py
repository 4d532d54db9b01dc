"""Draw every figure also for dark mode.

A figure is an SVG in dark colours on a transparent background. A second file replaces each colour: black becomes nearly
white, and hues become lighter. Colour maps, which represent numbers, do not change, nor do groups whose id begins with
``as-drawn``. The page contains both images, and the theme shows one of them. The dark image is fetched only when it is
shown. Print uses the light image. The text of a figure has the font of the page.
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
PX = 4 / 3  # pixels in a point
FONT = re.compile(r"'DejaVu Sans'(, [^;\"]*sans-serif)?")  # matplotlib places text by the widths of this font
OF_THE_PAGE = (  # the font in pidalab.css
    "system-ui, -apple-system, 'Segoe UI', 'Noto Sans', 'Liberation Sans', Helvetica, Arial, sans-serif"
)

GREY = 0.15  # saturation below which a colour counts as grey
LIGHTEST, DARKEST = 0.92, 0.08  # lightness of greys, not pure white or black
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
    )  # kept: depth inside a group that stays as drawn, or 0
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
    # Text and markers without a colour get a light default colour, except in groups that stay as drawn.
    dark = dark.replace('<g id="as-drawn', '<g fill="#111111" id="as-drawn')
    return dark.replace("<svg ", f'<svg fill="{for_dark("#000000")}" ', 1)


def _inked(text: str) -> str:
    return COLOUR.sub(lambda found: found[1] + found[2] + for_dark(found[3]), text)


def room(svg: str) -> str:
    """Return the size attributes of an image, so that a page does not move while it loads."""
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
    """Add the dark version of each figure."""
    if "body" not in context:
        return
    sources = {name: Path(app.srcdir, source) for source, name in app.builder.images.items()}

    def both(image: re.Match[str]) -> str:
        source = sources[unquote(image[1])]
        return _pair(image[0], room(source.read_text(encoding="utf-8")))

    context["body"] = IMAGE.sub(both, context["body"])


def write_dark(app, exception):
    """Write all copied figures in the font of the page, and their dark versions."""
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
