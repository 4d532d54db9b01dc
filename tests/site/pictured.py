"""Read numbers and lines of plots in the lab and live figures, and turn their knobs."""

import json
import re
from dataclasses import dataclass

import numpy as np

BLOCK = 200_000  # distances computed at once
STEP = 0.2  # between points of a curve, in units of the picture, far below the tolerances of tests
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
    """The position of values in the units of the picture, from two labelled lines of the grid."""

    values: np.ndarray
    places: np.ndarray

    def log(self) -> bool:
        """Return True if the axis is logarithmic. On a linear axis neighbours differ by at most a factor of 2."""
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
        """Return the points of the line of one class, in the units of the picture."""
        (match,) = [points for name, points in self.lines if name == kind]
        return match

    def apart(self, kind: str, x, y) -> float:
        """Return the largest distance of a line of the plot from a curve, inside the frame."""
        curve, line = _thinned(np.column_stack([self.x.place(x), self.y.place(y)])), self.line(kind)
        return max(_farthest(self._seen(line), curve), _farthest(self._seen(curve), line))

    def _seen(self, points: np.ndarray) -> np.ndarray:
        x, y, width, height = self.frame
        return points[np.all((points >= [x, y]) & (points <= [x + width, y + height]), axis=1)]


def _thinned(curve: np.ndarray) -> np.ndarray:
    """Return points of a curve, at least STEP apart along it."""
    curve = curve[np.isfinite(curve).all(axis=1)]
    way = np.append(0.0, np.cumsum(np.hypot(*np.diff(curve, axis=0).T)))
    return curve[np.unique(way // STEP, return_index=True)[1]]


def _farthest(points: np.ndarray, line: np.ndarray) -> float:
    """Return the largest distance of points from a line."""
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
    position, points = (0.0, 0.0), []
    for letter, first, second in re.findall(r"([MLHV])(-?[\d.]+)(?: (-?[\d.]+))?", path):
        position = {"H": (float(first), position[1]), "V": (position[0], float(first))}.get(letter) or (
            float(first),
            float(second),
        )
        points.append(position)
    return np.array(points)


def plots(host) -> dict[str, Plot]:
    """Return the plots of a figure by their titles."""
    by_title = {}
    for svg in host.evaluate(PLOTS):
        assert svg["said"] == svg["title"]
        axes = [
            Axis(
                np.array([float(text.replace("−", "-")) for axis, _, text in svg["ticks"] if axis == name]),
                np.array([place for axis, place, _ in svg["ticks"] if axis == name]),
            )
            for name in "xy"
        ]
        by_title[svg["title"]] = Plot(
            svg["title"], *axes, svg["frame"], [(kind, _points(d)) for kind, d in svg["lines"]]
        )
    return by_title


# --- live figures ----------------------------------------------------------------------------------------------------

HEARD = """() => [...document.querySelectorAll(".pidalab-live .lab-live")].every((words) => words.textContent.trim())"""
MISSING_PARTS = """() => [...document.querySelectorAll(".pidalab-live")].flatMap((host, k) => [
  ...(host.querySelectorAll(".lab-plots svg").length ? [] : [`figure ${k}: no plot`]),
  ...(host.querySelectorAll("tbody tr").length ? [] : [`figure ${k}: no loop`]),
  ...[host.querySelector(".lab-trouble")?.textContent].filter(Boolean),
])"""
# Ends of a knob's range where a twentieth of the range, or the least step, moves no line and no number.
IDLE_ENDS = """async (bar) => {
  const figure = bar.closest(".pidalab-live"), low = Number(bar.min), high = Number(bar.max);
  const step = Math.max(Number(bar.step), (high - low) / 20);
  const shown = async (value) => {
    bar.valueAsNumber = value;
    bar.dispatchEvent(new Event("input", { bubbles: true }));
    await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
    const numbers = [...figure.querySelectorAll("td")].map((cell) => cell.textContent);
    return [figure.querySelector(".lab-plots").innerHTML, ...numbers].join();
  };
  const idle = [];
  for (const [end, value, back] of [["low", low, low + step], ["high", high, high - step]])
    if ((await shown(value)) === (await shown(back))) idle.push(end);
  return idle;
}"""
# A figure draws at the next frame after a knob has moved.
DRAWN = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
CELLS = "host => [...host.querySelectorAll('tr')].map(row => [...row.cells].map(c => c.textContent.trim()))"
# The required text of a figure after its knobs were turned, from the page's own study of the loops.
EXPECTED = """([told, turned]) => {
  const { PLANTS, RULES, study } = pidalabModel, { NUMBERS } = pidalabLab;
  const plant = structuredClone(PLANTS[told.plant] ?? told.plant), conditions = { end: plant.end, ...told.conditions };
  const rule = RULES[told.rule ?? "hand"], designs = structuredClone(told.designs);
  for (const [{ key, design }, value] of turned) {
    if (key === "plant.delay") plant.delay = value;
    else if (key === "limits") conditions.limits = [-value, value];
    else if (key === "limits.low") conditions.limits = [value, conditions.limits[1]];
    else if (["trackingTime", "sampleTime"].includes(key)) conditions[key] = value;
    else if (key === "ms" && design === undefined) told.ms = value;
    else for (const one of designs.filter((_, k) => design === undefined || k === design)) one[key] = value;
  }
  const made = designs.map((design) => rule.apply(plant, design, design[rule.knob] ?? told[rule.knob]));
  return designs.map((design, k) => {
    const found = study(plant, made[k], { ...conditions, ...design.conditions });
    const known = (key) => found.stable || ["first", "hump"].includes(key);
    return told.numbers.map((key) => (known(key) ? String(NUMBERS[key][1](found)) : null));
  });
}"""


def missing_parts(page):
    """List live figures without a plot, a loop or a spoken description."""
    page.wait_for_function(HEARD, timeout=20_000)
    return page.evaluate(MISSING_PARTS)


def states_of(path):
    """Read the settings of the live figures of a built page."""
    states = re.findall(
        r'class="pidalab-live".*?<script type="application/json">(.*?)</script>',
        path.read_text(encoding="utf-8"),
        re.DOTALL,
    )
    return [json.loads(text) for text in states]


def rows(host):
    """Return the cells of the table without head and names."""
    return [row[1:] for row in host.evaluate(CELLS)[1:]]


def expected_numbers(numbers):
    """Return the numbers of a loop with three digits. An unstable loop has one cell for all missing numbers."""
    known = [f"{float(text):.3g}" for text in numbers if text is not None]
    return [*(["unstable"] if len(known) < len(numbers) else []), *known]


def displayed_numbers(row):
    return [
        f"{float(text.replace('∞', 'inf')):.3g}" if text[-1].isdigit() or text == "∞" else text
        for text in row
    ]


def idle_ends(page, host, knob):
    """List the ends of a knob's range where nothing moves. Restore the knob."""
    row = host.locator(".lab-row", has=page.get_by_label(knob["label"], exact=True))
    box = row.locator("input[type=text]")
    before = box.input_value()
    ends = row.locator("input[type=range]").evaluate(IDLE_ENDS)
    box.fill(before)
    box.press("Enter")
    return [f"{knob['label']}: idle at the {end} end of its range" for end in ends]


def turn(page, host, knob):
    """Move a knob by a tenth of its range, wait for the figure, and return the new value."""
    row = host.locator(".lab-row", has=page.get_by_label(knob["label"], exact=True))
    bar = row.locator("input[type=range]")
    before = [bar.element_handle(), bar.get_attribute("aria-valuetext")]
    bar.press("PageUp")
    page.wait_for_function("([bar, before]) => bar.ariaValueText !== before", arg=before, timeout=20_000)
    page.evaluate(DRAWN)
    value = row.locator("input[type=text]").input_value()
    assert bar.get_attribute("aria-valuetext").startswith(f"{knob['label']} ")
    return float(value)


def live_figure_problems(page, path):
    """Turn each knob of each live figure of an open page, and list problems."""
    figures, wrong = states_of(path), missing_parts(page)
    if page.locator(".pidalab-live").count() != len(figures):
        wrong.append(f"{len(figures)} live figures in the source, not so many on the page")
    for k, figure in enumerate(figures):
        host, turned = page.locator(".pidalab-live").nth(k), []
        wrong += [f"figure {k}, {words}" for knob in figure["knobs"] for words in idle_ends(page, host, knob)]
        for knob in figure["knobs"]:
            turned.append((knob, turn(page, host, knob)))
            expected = page.evaluate(EXPECTED, [figure, turned])
            shown = [displayed_numbers(row) for row in rows(host)]
            due = [expected_numbers(row) for row in expected]
            if shown != due:
                wrong.append(f"figure {k}, {knob['label']}: {shown} for {due}")
        if len(plots(host)) != len(figure["plots"]):
            wrong.append(f"figure {k}: {len(plots(host))} plots for {figure['plots']}")
    return wrong
