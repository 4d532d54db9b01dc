"""What a plot of the lab shows, read back from its picture: the numbers on its axes, and its lines in these."""

import re
from dataclasses import dataclass

import numpy as np

BLOCK = 200_000  # distances at once
STEP = 0.2  # between the points of a curve, in the units of the picture, far below what the tests ask for
PLOTS = r"""host => [...host.querySelectorAll(".lab-plots svg")].map(svg => ({
  title: svg.querySelector(".lab-title").textContent, said: svg.getAttribute("aria-label"),
  frame: ["x", "y", "width", "height"].map(key => svg.querySelector("clipPath rect")[key].baseVal.value),
  ticks: svg.querySelector(".lab-grid").getAttribute("d").match(/M[^M]*/g).map((line, k) => {
    const [, x, y, way] = /M(\S+) (\S+?)([HV])/.exec(line), words = svg.querySelectorAll(".lab-tick")[k].textContent;
    return way === "V" ? ["x", Number(x), words] : ["y", Number(y), words];
  }),
  lines: [...svg.querySelectorAll(".lab-line")].map(path => [path.classList[1], path.getAttribute("d")]),
}))"""


@dataclass(frozen=True)
class Axis:
    """Where a value lies, in the units of the picture: from the words beside two lines of the grid."""

    values: np.ndarray
    places: np.ndarray

    def log(self) -> bool:
        """Whether it names powers of ten: neighbours in equal steps are never more than twice each other."""
        return bool(self.values[1] > 2 * self.values[0] > 0)

    def place(self, values) -> np.ndarray:
        scale = np.log10 if self.log() else np.asarray
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.polyval(np.polyfit(scale(self.values), self.places, 1), scale(values))


@dataclass(frozen=True)
class Plot:
    title: str
    x: Axis
    y: Axis
    frame: tuple[float, float, float, float]
    lines: list[tuple[str, np.ndarray]]

    def line(self, kind: str) -> np.ndarray:
        """Points of the line of one class, in the units of the picture."""
        (found,) = [points for name, points in self.lines if name == kind]
        return found

    def apart(self, kind: str, x, y) -> float:
        """Largest distance between a line of the plot and a curve, either way, inside the frame."""
        curve, line = _thinned(np.column_stack([self.x.place(x), self.y.place(y)])), self.line(kind)
        return max(_farthest(self._seen(line), curve), _farthest(self._seen(curve), line))

    def _seen(self, points: np.ndarray) -> np.ndarray:
        x, y, width, height = self.frame
        return points[np.all((points >= [x, y]) & (points <= [x + width, y + height]), axis=1)]


def _thinned(curve: np.ndarray) -> np.ndarray:
    """Points of a curve, none nearer to the next than STEP along the curve."""
    curve = curve[np.isfinite(curve).all(axis=1)]
    way = np.append(0.0, np.cumsum(np.hypot(*np.diff(curve, axis=0).T)))
    return curve[np.unique(way // STEP, return_index=True)[1]]


def _farthest(points: np.ndarray, line: np.ndarray) -> float:
    """Largest distance of points from a line through others."""
    start, step = line[:-1], np.diff(line, axis=0)
    length = np.maximum((step**2).sum(axis=1), 1e-12)
    worst = 0.0
    for some in np.array_split(points, len(points) * len(line) // BLOCK + 1):
        off = some[:, None] - start
        share = np.clip((off * step).sum(axis=2) / length, 0, 1)
        apart = ((off - share[..., None] * step) ** 2).sum(axis=2)
        worst = max(worst, float(apart.min(axis=1).max(initial=0.0)))
    return worst**0.5


def _points(path: str) -> np.ndarray:
    at, found = (0.0, 0.0), []
    for letter, first, second in re.findall(r"([MLHV])(-?[\d.]+)(?: (-?[\d.]+))?", path):
        at = {"H": (float(first), at[1]), "V": (at[0], float(first))}.get(letter) or (
            float(first),
            float(second),
        )
        found.append(at)
    return np.array(found)


def plots(host) -> dict[str, Plot]:
    """The plots of a figure by their titles."""
    found = {}
    for svg in host.evaluate(PLOTS):
        assert svg["said"] == svg["title"]
        axes = [
            Axis(
                np.array([float(text.replace("−", "-")) for axis, _, text in svg["ticks"] if axis == name]),
                np.array([place for axis, place, _ in svg["ticks"] if axis == name]),
            )
            for name in "xy"
        ]
        found[svg["title"]] = Plot(
            svg["title"], *axes, svg["frame"], [(kind, _points(d)) for kind, d in svg["lines"]]
        )
    return found
