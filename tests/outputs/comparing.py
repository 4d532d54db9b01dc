"""Compare stored outputs of a notebook with fresh outputs: text exactly, figures by what they draw.

nbval compares outputs as strings. This is right for text, which shows only digits that are the same on every processor.
But the last decimals of the coordinates in an SVG depend on the processor. So an SVG is compared element by element:

* Elements and their order, words, names and line styles must be the same.
* Coordinates may differ by a thousandth of the size of their axes (outside axes, of the figure) or by a quarter of a
  point, whichever is larger. A quarter of a point is a seventh of the width of a line.
* Colours may differ by two of 255 levels, and other numbers by a thousandth of their value.
* Each line must stay within the tolerance of the other line. Their points may differ: Matplotlib drops points that lie
  within a ninth of a point of the line through their neighbours, and rounding decides which.

Names of markers and clip paths depend on the coordinates. So the elements to which they refer are compared instead. The
start values of a live figure are compared to one part in 10,000. nbval compares everything else.

This module is a plug-in of pytest that changes how nbval compares outputs.
"""

import base64
import io
import json
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from matplotlib.image import imread
from nbval.plugin import IPyNbCell

THOUSANDTH = 1e-3
HAIR = 0.25  # in points; two simplified lines may be 2/9 apart
LEVELS = 2  # of 255 levels of a colour
DESIGN = 1e-4  # relative difference of a start value, which has six digits

NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?")
COLOUR = re.compile(r"#([0-9a-f]{6})\b")
GENERATED = re.compile(r"[a-z][0-9a-f]{10}|image[0-9a-f]{10}")
REFERENCE = re.compile(r"url\(#(.+?)\)|^#(.+)$")
TOKEN = re.compile(rf"[A-Za-z]|{NUMBER.pattern}")
LIVE = re.compile(r'(?<=<script type="application/json">)(.*?)(?=</script>)', flags=re.DOTALL)
UNSEEN = ("metadata", "defs")  # definitions are compared where they are used
ALONG = {"x": 0, "width": 0, "y": 1, "height": 1}

Element = ET.Element
Tolerance = tuple[float, float]


class Different(Exception):
    """Raised with the place and the difference if two figures do not draw the same."""


def figure_difference(stored: str, fresh: str) -> str | None:
    """Compare two figures.

    Parameters
    ----------
    stored, fresh : str
        SVG, as matplotlib writes it.

    Returns
    -------
    str or None
        The first difference in words, or None if both draw the same.
    """
    if stored == fresh:
        return None
    try:
        _Pair(_read(stored), _read(fresh)).compare()
    except Different as difference:
        return str(difference)
    return None


def live_difference(stored: str, fresh: str) -> str | None:
    """Compare two outputs in HTML, in which a live figure stores its start values as JSON.

    Parameters
    ----------
    stored, fresh : str
        HTML.

    Returns
    -------
    str or None
        The first difference in words, or None. All except this JSON must be identical.
    """
    if stored == fresh:
        return None
    pieces = list(zip(LIVE.split(stored), LIVE.split(fresh), strict=False))
    if len(LIVE.findall(stored)) != len(LIVE.findall(fresh)):
        return "not the same number of live figures"
    for k, (old, new) in enumerate(pieces):
        if k % 2:
            for here, (a, b) in _leaves(json.loads(old), json.loads(new), "live figure"):
                if not _near_values(a, b):
                    return f"{here}: {a} stored, {b} now"
        elif old != new:
            return "not the same text"
    return None


def _leaves(a, b, here: str) -> Iterator[tuple[str, tuple]]:
    if isinstance(a, dict) and isinstance(b, dict) and list(a) == list(b):
        for key in a:
            yield from _leaves(a[key], b[key], f"{here}, {key}")
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for k, pair in enumerate(zip(a, b, strict=True)):
            yield from _leaves(*pair, f"{here}[{k}]")
    else:
        yield here, (a, b)


def _near_values(a, b) -> bool:
    if isinstance(a, float) and isinstance(b, float):
        return abs(a - b) <= DESIGN * abs(a)
    return a == b


def _read(svg: str) -> Element:
    return ET.fromstring(svg, parser=ET.XMLParser(target=ET.TreeBuilder(insert_comments=True)))


def _tag(element: Element) -> str:
    return "words" if element.tag is ET.Comment else element.tag.rpartition("}")[2]


def _shown(element: Element) -> list[Element]:
    return [child for child in element if _tag(child) not in UNSEEN]


def _numbers(text: str) -> np.ndarray:
    return np.array([float(number) for number in NUMBER.findall(text)])


@dataclass
class _Pair:
    """A stored figure and a fresh figure, to be compared."""

    stored: Element
    fresh: Element
    defined: tuple[dict[str, Element], dict[str, Element]] = field(init=False)
    alike: set[tuple] = field(default_factory=set)  # pairs of equal definitions

    def __post_init__(self) -> None:
        self.defined = tuple(
            {element.get("id"): element for element in root.iter() if element.get("id")}
            for root in (self.stored, self.fresh)
        )

    def compare(self) -> None:
        """Raise Different at the first difference."""
        sheets = [[sheet.text for sheet in root.iter() if _tag(sheet) == "style"] for root in self]
        if sheets[0] != sheets[1]:
            raise Different("not the same style sheet")
        width, height = (_numbers(self.stored.get(name))[0] for name in ("width", "height"))
        self.walk(self.stored, self.fresh, _tolerance(width, height), "figure")

    def __iter__(self) -> Iterator[Element]:
        return iter((self.stored, self.fresh))

    def walk(self, a: Element, b: Element, within: Tolerance, here: str) -> None:
        """Compare two elements and their contents."""
        if _tag(a) != _tag(b) or (a.text or "").strip() != (b.text or "").strip():
            raise Different(f"{here}: {_said(a)} stored, {_said(b)} now")
        if (name := a.get("id", "")) and not GENERATED.fullmatch(name):
            here = f"{here}, {name}"
            if name.startswith("axes_"):
                within = _of_axes(a) or within
        self.attributes(a, b, within, here)
        inside = _shown(a), _shown(b)
        for pair in zip(*inside, strict=False):
            self.walk(*pair, within, here)
        if len(inside[0]) != len(inside[1]):
            raise Different(f"{here}: {len(inside[0])} parts stored, {len(inside[1])} now")

    def attributes(self, a: Element, b: Element, within: Tolerance, here: str) -> None:
        """Compare the attributes of two elements."""
        if a.keys() != b.keys():
            raise Different(f"{here}: attributes {a.keys()} stored, {b.keys()} now")
        for key, old in a.items():
            new, name = b.get(key), key.rpartition("}")[2]
            if old == new and not REFERENCE.search(old):
                continue
            same = True
            if name == "d":
                _same_course(old, new, within, here)
            elif name == "id":
                same = bool(GENERATED.fullmatch(old) and GENERATED.fullmatch(new))
            elif name in ALONG:
                same = abs(_numbers(old)[0] - _numbers(new)[0]) <= within[ALONG[name]]
            elif name == "viewBox":
                same = bool(np.all(np.abs(_numbers(old) - _numbers(new)) <= 2 * within))
            elif name == "transform":
                same = _same_transform(old, new, within)
            elif old.startswith("data:image/png;base64,"):
                same = _same_picture(old, new)
            elif REFERENCE.search(old) and REFERENCE.search(new):
                self.referred(old, new, within, here)
                same = _same_words(REFERENCE.sub("", old), REFERENCE.sub("", new))
            else:
                same = _same_words(old, new)
            if not same:
                raise Different(f"{here}: {name} {old[:80]!r} stored, {new[:80]!r} now")

    def referred(self, old: str, new: str, within: Tolerance, here: str) -> None:
        """Compare the elements to which two attributes refer."""
        names = [next(filter(None, REFERENCE.search(text).groups())) for text in (old, new)]
        if not all(map(GENERATED.fullmatch, names)) and names[0] != names[1]:
            raise Different(f"{here}: {names[0]} stored, {names[1]} now")
        if (key := (*names, within)) not in self.alike:
            self.walk(*(known[name] for known, name in zip(self.defined, names, strict=True)), within, here)
            self.alike.add(key)


def _said(element: Element) -> str:
    return f"{_tag(element)} {(element.text or '').strip()!r}"


def _tolerance(width: float, height: float) -> Tolerance:
    return max(THOUSANDTH * width, HAIR), max(THOUSANDTH * height, HAIR)


def _of_axes(axes: Element) -> Tolerance | None:
    """Return the tolerance within axes, from the size of their frame, or None without a frame."""
    frame = next((part for part in axes if (part.get("id") or "").startswith("patch_")), None)
    path = None if frame is None else next((part for part in frame if _tag(part) == "path"), None)
    return None if path is None else _tolerance(*np.ptp(_points(path.get("d"))[1], axis=0))


def _same_transform(old: str, new: str, within: Tolerance) -> bool:
    """Compare translations within the tolerance, and rotations and scales to a thousandth."""
    calls = [re.findall(r"(\w+)\((.*?)\)", text) for text in (old, new)]
    if [name for name, _ in calls[0]] != [name for name, _ in calls[1]]:
        return False
    for (name, one), (_, other) in zip(*calls, strict=True):
        a, b = _numbers(one), _numbers(other)
        allowed = np.array(within[: len(a)]) if name == "translate" else THOUSANDTH * np.abs(a)
        if len(a) != len(b) or np.any(np.abs(a - b) > allowed):
            return False
    return True


def _same_words(old: str, new: str) -> bool:
    """Compare texts. Words must be identical, colours and numbers must agree within their tolerances."""
    levels = [
        np.array([[int(c[i : i + 2], 16) for i in (0, 2, 4)] for c in COLOUR.findall(text)])
        for text in (old, new)
    ]
    rest = [COLOUR.sub("#", text) for text in (old, new)]
    if NUMBER.sub("0", rest[0]) != NUMBER.sub("0", rest[1]):
        return False
    a, b = map(_numbers, rest)
    return bool(np.all(np.abs(levels[0] - levels[1]) <= LEVELS) and np.allclose(a, b, THOUSANDTH, 0.0))


def _same_picture(old: str, new: str) -> bool:
    """Compare the pixels of two pictures."""
    a, b = (imread(io.BytesIO(base64.b64decode(text.partition(",")[2])), format="png") for text in (old, new))
    return a.shape == b.shape and bool(np.all(np.abs(a - b) <= (LEVELS + 0.5) / 255))


def _points(path: str) -> tuple[str, np.ndarray]:
    """Return the commands of a path and its points, shape (n, 2)."""
    tokens = TOKEN.findall(path)
    commands = "".join(token for token in tokens if token.isalpha())
    return commands, np.array([float(token) for token in tokens if not token.isalpha()]).reshape(-1, 2)


def _same_course(old: str, new: str, within: Tolerance, here: str) -> None:
    """Compare two paths point by point or, if the points differ, by the course of their lines."""
    (commands, a), (others, b) = _points(old), _points(new)
    a, b = a / within, b / within
    if commands == others and np.all(np.abs(a - b) <= 1.0):
        return
    if not set(commands + others) <= set("MLz"):
        raise Different(f"{here}: not the same curve")
    lines = _segments(commands, a), _segments(others, b)
    far = max(_farthest(*lines), _farthest(*lines[::-1]))
    if far > 1.0:
        raise Different(f"{here}: a line is off by {far:.1f} times what is allowed")


def _segments(commands: str, points: np.ndarray) -> np.ndarray:
    """Return the straight pieces of a path, shape (n, 2, 2): piece, end, coordinate."""
    pieces, start, place = [], 0, -1
    for command in commands:
        if command == "z":
            pieces.append(points[[place, start]])
            continue
        place += 1
        if command == "M":
            start = place
        pieces.append(points[[max(place - 1, start), place]])
    return np.array(pieces)


def _farthest(lines: np.ndarray, others: np.ndarray) -> float:
    """Return the largest distance of some lines from others, at points that are twenty tolerances apart."""
    count = np.ceil(np.hypot(*np.diff(lines, axis=1)[:, 0].T) / 20).astype(int) + 1
    share = np.concatenate([np.linspace(0.0, 1.0, n) for n in count])[:, None]
    start, end = (np.repeat(lines[:, k], count, axis=0) for k in (0, 1))
    places = start + share * (end - start)
    ahead = others[:, 1] - others[:, 0]
    length = np.maximum((ahead**2).sum(axis=1), 1e-30)
    worst = 0.0
    for some in np.array_split(places, len(places) * len(others) // 1_000_000 + 1):
        offset = some[:, None] - others[:, 0]
        along = np.clip((offset * ahead).sum(axis=2) / length, 0.0, 1.0)
        apart = np.hypot(*np.moveaxis(offset - along[..., None] * ahead, 2, 0))
        worst = max(worst, float(apart.min(axis=1).max(initial=0.0)))
    return worst


FIGURE = "image/svg+xml"
COMPARED = {FIGURE: figure_difference, "text/html": live_difference}


to_the_letter = IPyNbCell.compare_outputs


def compare_outputs(cell: IPyNbCell, test, ref, skip_compare=None) -> bool:
    """Return True if the figures of a cell draw the same, and if nbval finds all other outputs equal."""
    found = []
    for kind, difference in COMPARED.items():
        stored, fresh = (
            [output["data"] for output in outputs if kind in output.get("data", {})]
            for outputs in (ref, test)
        )
        for old, new in zip(stored, fresh, strict=False):
            if (words := difference(old[kind], new[kind])) is not None:
                found.append(f" mismatch {kind!r}: {words}")
            if words is None or kind == FIGURE:  # nbval shows the difference of two texts
                new[kind] = old[kind]
    same = to_the_letter(cell, test, ref, skip_compare)
    cell.comparison_traceback += found
    return same and not found


def pytest_configure() -> None:
    """Let nbval compare outputs with this module."""
    IPyNbCell.compare_outputs = compare_outputs
