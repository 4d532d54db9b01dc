"""Compute numbers that pages show outside the ledger by a second method.

nbval proves that a page still computes the numbers that it shows, but not that they are right. Each entry of `SHOWN`
finds numbers in outputs or sentences of a page, and computes them again without the library. The second method is a
closed form, a dense grid of frequencies, a Fourier series, or a table of a study. `drawn` checks a row of such a table.
Each entry of `SAME` finds two places that show the same quantity.
"""

import csv
import json
import re
from collections.abc import Callable, Sequence
from functools import cache, partial
from itertools import pairwise
from math import e, pi, sqrt
from pathlib import Path
from statistics import median

import numpy as np
from scipy.optimize import brentq, least_squares
from scipy.signal import cont2discrete, tf2ss
from second import response

import pidalab

ROOT = Path(__file__).parents[2]
BOOK = ROOT / "book"
GRID = np.geomspace(1e-3, 300, 200_001)


@cache
def text_of(page: str) -> str:
    """Return sentences and text outputs of a page."""
    path = BOOK / page
    if path.suffix == ".md":
        return path.read_text(encoding="utf-8")
    found = []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        found += ["".join(cell["source"])] if cell["cell_type"] == "markdown" else []
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            found += ["".join(output.get("text") or data.get("text/plain", ""))]
            found += table_rows("".join(data.get("text/html", "")))
    return "\n".join(found)


def table_rows(html: str) -> list[str]:
    """Return the rows of tables with bars between cells. A label of several rows is repeated in each row."""
    found, label, left = [], "", 0
    for row in re.findall(r"<tr.*?</tr>", html, re.DOTALL):
        cells = [
            re.sub(r"<.*?>", "", one).strip() for one in re.findall(r"<t[hd].*?</t[hd]>", row, re.DOTALL)
        ]
        if span := re.search(r'rowspan="(\d+)"', row):
            label, left = cells[0], int(span[1])
        elif left:
            cells = [label, *cells]
        found.append(" | ".join(cells))
        left -= left > 0
    return found


def numbers(page: str, pattern: str) -> list[str]:
    """Return the numbers of the first match of a pattern, or none."""
    found = re.search(pattern, text_of(page))
    return [one.replace("−", "-") for one in found.groups()] if found else []


def half_unit(text: str) -> float:
    """Return half a unit of the last written place of a number."""
    return 0.5 * 10.0 ** -len(text.partition(".")[2])


# ------------------------------------------------------------------------------------------------ second methods


def lags(s, delay=1.0):
    """Return the plant of lectures 1, 2 and 6: three lags and a dead time."""
    return np.exp(-delay * s) / (1 + s) ** 3


def integrator(s):
    """Return the plant of lecture 4."""
    return np.exp(-s) / s


def controller(ki, kp, kd=0.0, ka=0.0, tf=0.0, n=0):
    """Return a PIDA with its filter as a function of s."""
    return lambda s: (ki / s + kp + kd * s + ka * s**2) / (1 + tf * s) ** n


def standard(kp, ti, td=0.0, ta=0.0, tf=0.0, n=3):
    """Return a controller with given gain and times. The time `ta` multiplies s squared."""
    return controller(kp / ti, kp, kp * td, kp * ta, tf, n)


def largest(values):
    """Return the maximum of a curve, also between the points of the grid."""
    k = int(np.argmax(values))
    if not 0 < k < len(values) - 1:
        return float(values[k])
    a, b, c = values[k - 1 : k + 2]
    return float(b + (a - c) ** 2 / (8 * (2 * b - a - c))) if 2 * b > a + c else float(b)


def ms(control, plant=lags):
    """Return the maximum sensitivity, computed on a grid."""
    s = 1j * GRID
    return largest(1 / np.abs(1 + plant(s) * control(s)))


def iae(control, plant=lags, end=60.0):
    """Return the IAE after a unit step of the load, by a Fourier series."""
    t, y = response(lambda s: plant(s) / (1 + plant(s) * control(s)) / s, end)
    return float(np.trapezoid(np.abs(y), t))


@cache
def lecture_1() -> dict[str, tuple[float, float]]:
    """Return gain and IAE of the three controllers whose zeros cancel lags, at Ms 1.4."""
    shapes = {"PI": (1 / 1.5, 1), "PID": (1 / 2.5, 1, 0.6), "PIDA": (1 / 3, 1, 1, 1 / 3)}
    found = {}
    for kind, shape in shapes.items():
        gains = (*shape, 0, 0)[:4]

        def made(k, gains=gains, kind=kind):
            return controller(*(k * one for one in gains), 0.1, len(kind) - 1)

        k = brentq(lambda k, made=made: ms(made(k)) - 1.4, 0.05, 1.5, xtol=1e-6)
        found[kind] = k, iae(made(k)), shape[0] * k
    return found


def with_three_lags(kind: str) -> list[float]:
    """Return gain, Ms and IAE of one of these controllers, and 1/ki twice, since IE = IAE = 1/ki."""
    k, error, integral = lecture_1()[kind]
    return [k, 1.4, error, 1 / integral, 1 / integral, error]


def sampled_ms(h: float) -> float:
    """Return Ms of the PIDA of lecture 6 by backward differences. The dead time is a whole number of samples."""
    a, b, c, _, _ = cont2discrete(tf2ss([1.0], [1.0, 3.0, 3.0, 1.0]), h, "zoh")
    w = np.linspace(1e-3, pi / h, 4001)
    z = np.exp(1j * h * w)
    plant = np.array([(c @ np.linalg.solve(one * np.eye(3) - a, b))[0, 0] for one in z]) * z ** -round(1 / h)
    s = (1 - 1 / z) / h
    return largest(1 / np.abs(1 + plant * standard(1.416, 3.882, 1.199, 0.929, 0.378)(s)))


def proportional_gain(wanted: float) -> list[float]:
    """Return the gain with which a loop of an integrator with dead time has this Ms."""
    return [brentq(lambda k: ms(lambda s: k, integrator) - wanted, 0.1, 1.2, xtol=1e-6)]


def table(path: Path) -> list[dict[str, str]]:
    """Return the rows of a table."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


COMPARISON, OPTIMA, PROCESSES = (
    ROOT / "src" / "pidalab" / "comparison" / "tables" / f"{name}.csv"
    for name in ("comparison", "optima", "processes")
)
FRONTIER = BOOK / "data" / "frontier.csv"


def plants(kept: Callable[[dict[str, str]], bool]) -> list[str]:
    """Return the plants of the batch that the study keeps."""
    return [
        row["plant"] for row in table(PROCESSES) if row["family"] not in ("frontier", "map") and kept(row)
    ]


@cache
def least(path: Path, ms: str = "1.4") -> dict[tuple[str, ...], float]:
    """Return the least IAE by plant, noise and order, from the table of a study."""
    rows = (row for row in table(path) if row["ms_limit"] == ms and row["iae"])
    return {(row["plant"], row["noise_limit"], row["order"]): float(row["iae"]) for row in rows}


def saved(
    path: Path, noise: str = "", order: int = 2, ms: str = "1.4", of: Sequence[str] = ()
) -> list[float]:
    """Return by how many per cent an order reduces the IAE of the next lower order, for some or all plants."""
    known = least(path, ms)
    return [
        100 - 100 * known[key] / known[lower]
        for key in known
        if key[2] == str(order) and (lower := (*key[:2], str(order - 1))) in known
        if key[1] == (noise or key[1]) and (not of or key[0] in of)
    ]


def of_class(name: str) -> list[float]:
    """Return the median savings of PIDA and PID with much and little noise, and the plants of a class."""
    low, high = CLASSES[name]
    some = plants(lambda row: low < float(row["dead_time"]) <= high)
    medians = [median(saved(OPTIMA, noise, order, of=some)) for order in (2, 1) for noise in ("1.5", "0.3")]
    return [*medians, len(some)]


def of_rolloff(name: str) -> list[float]:
    """Return the plants of a roll-off, and the savings of PIDA.

    The savings are the median, the least and the most with much noise, and the saving with little noise.
    """
    low, high = ROLLOFFS[name]

    def kept(row: dict[str, str]) -> bool:
        num, den = ([float(one) for one in row[name].split()] for name in ("num", "den"))
        w = 2j * pi / float(row["ultimate_period"]) * np.array([0.999, 1.001])
        gain = np.log(np.abs(np.polyval(num, w) / np.polyval(den, w)))
        slope = (gain[0] - gain[1]) / np.log(1.001 / 0.999)
        return (
            low <= float(f"{slope:.5g}") < high
        )  # rounded as in the study, since a slow lag has a slope of 1

    loud, quiet = (saved(OPTIMA, noise, of=plants(kept)) for noise in ("1.5", "0.3"))
    return [len(loud), median(loud), min(loud), max(loud), median(quiet)]


def ranked(rule: str, kind: str) -> list[float]:
    """Return the plants of a rule, and its IAE divided by the best IAE of its kind and of all kinds.

    Each ratio is given as its median and as the limit of the worst tenth.
    """
    known, order = least(OPTIMA), str(("PI", "PID", "PIDA").index(kind))
    of_kind, of_all = [], []
    for row in table(COMPARISON):
        if (row["rule"], row["kind"], row["terms"]) == (rule.lower(), kind, "loud") and row["iae_load"]:
            bests = {k: known[row["plant"], "1.5", k] for k in "012" if (row["plant"], "1.5", k) in known}
            of_kind.append(float(row["iae_load"]) / bests[order])
            of_all.append(float(row["iae_load"]) / min(bests.values()))
    return [len(of_all), median(of_kind), median(of_all), float(np.quantile(of_all, 0.9))]


def as_published(rule: str, kind: str) -> list[float]:
    """Return plants, median and highest tenth of Ms, noise, and loops that a wrong model makes unstable."""
    rows = [
        row
        for row in table(COMPARISON)
        if (row["rule"], row["kind"], row["terms"]) == (rule.lower(), kind, "own")
    ]
    rows = [row for row in rows if row["ms"]]
    ms, noise = ([float(row[name]) for row in rows if row[name]] for name in ("ms", "noise_gain"))
    unstable = sum(row["ms_worst"] == "inf" for row in rows)
    return [len(rows), median(ms), float(np.quantile(ms, 0.9)), median(noise), unstable]


def drawn(path: Path, rng: np.random.Generator) -> tuple[str, list[float], list[float]]:
    """Draw an optimum of a study. Return its plant, and Ms, IAE and relative noise gain as stored and from its gains.

    The computed noise gain, of the continuous controller with held noise, is about a per cent lower.
    """
    row = rng.choice([row for row in table(path) if row["iae"] and row["order"] in ("1", "2")])
    (plant,) = (one for one in table(PROCESSES) if one["plant"] == row["plant"])
    unit, period, order = float(plant["ultimate_gain"]), float(plant["ultimate_period"]), int(row["order"])
    gains = [float(row[f"k{k}"] or 0) * unit * period**k for k in range(-1, 3)]
    control = controller(*gains, tf=float(row["filter_time"]) * period, n=order + 1)
    num, den = ([float(one) for one in plant[name].split()] for name in ("num", "den"))

    def process(s):
        return np.polyval(num, s) / np.polyval(den, s) * np.exp(-float(plant["delay"]) * s)

    s = 1j * GRID * 6 / period
    error = iae(control, process, 100 * period) * unit / period
    h = period / 100
    t, u = response(
        lambda s: control(s) / (1 + process(s) * control(s)) * (1 - np.exp(-h * s)) / s, 40 * period
    )
    noise = sqrt(sum(np.interp(np.arange(0, t[-1], h), t, u) ** 2)) / unit
    found = [largest(1 / np.abs(1 + process(s) * control(s))), error, noise]
    return row["plant"], [float(row[name]) for name in ("ms", "iae", "noise_gain")], found


def lower_peaks() -> list[float]:
    """Return by how many per cent the proposed rule has lower load peaks than ITAE-2, as heo2023 shows."""
    peaks = [
        [float(numbers(HEO, rf"\nExample {k}, {rule} \|.* {N}\n")[0]) for rule in ("ITAE-2", "proposed")]
        for k in (1, 2, 3)
    ]
    return [100 - 100 * proposed / itae2 for itae2, proposed in peaks]


def heo_itae(k: int, rule: str) -> list[float]:
    """Return the ITAE for Example k of heo2023 and a rule, from the shown tunings."""
    den = {1: (1, 3, 3, 1), 2: (1, 5, 10, 10, 5, 1), 3: (9.0, 11.4, 3.4, 1.0)}[k]
    settings = {"set point": [(8, 0.2), (20, 0.2), (15, 0.5)], "load": [(12, 0.2), (25, 0.0)]}
    found = []
    for test, (end, delay) in ((test, some[k - 1]) for test, some in settings.items() if len(some) >= k):
        tunings = re.findall(rf"\n{rule}, {test} \|(.*)", text_of(HEO))[k - 1]
        kc, ti, td, ta = map(float, [*re.findall(rf"/ {N}", tunings), "0"][:4])

        def error(s, test=test, delay=delay, kc=kc, ti=ti, td=td, ta=ta):
            control = 1 + 1 / (ti * s) + td * s / (0.05 * td * s + 1)
            control += (ta * s / (0.025 * ta * s + 1)) ** 2 / 2
            process = np.exp(-delay * s) / np.polyval(den, s)
            return (1 if test == "set point" else process) / (1 + kc * process * control) / s

        t, e = response(error, end - 1.0)
        found.append(float(np.trapezoid((t + 1) * np.abs(e), t)))
    return found


def frontier(order: int, ms: str) -> list[float]:
    """Return the savings of an order on the frontier: median, largest, and number of plants with at least a tenth."""
    names = {plant for plant, *_ in least(FRONTIER)}
    tenth = sum(max(saved(FRONTIER, order=order, ms=ms, of=[name]), default=0) >= 10 for name in names)
    every = saved(FRONTIER, order=order, ms=ms)
    return [median(every), max(every), tenth]


def shortest_filter(order: int) -> list[float]:
    """Return the shortest filter of lecture 4, by its formula and by a gain of 1 at −180°."""

    def excess(tf):
        s = 1j * np.linspace(5, 200, 400_001)
        turned = integrator(s) * standard(*IPDT, tf, order)(s)
        crossed = np.flatnonzero((turned.imag[1:] * turned.imag[:-1] < 0) & (turned.real[1:] < 0))
        return -turned.real[crossed].min() - 1

    return [IPDT[0] * IPDT[3] * hump(order), brentq(excess, 0.01, 0.05, xtol=1e-7)]


def best(limit: float) -> tuple[float, float]:
    """Return the IAE of PID and PIDA on the landing page, from responses of the designs."""
    script = r'pidalab-landing">\s*<script type="application/json">(.*?)</script>'
    state = json.loads(re.search(script, text_of("intro.md"))[1])
    k = state["limits"].index(limit)
    (_, *pid, pid_filter), (_, *pida, pida_filter) = state["PID"][k], state["PIDA"][k]
    return iae(controller(*pid, tf=pid_filter, n=2)), iae(controller(*pida, tf=pida_filter, n=3))


def landing(limit: float) -> float:
    """Return by how many per cent PIDA reduces the IAE on the landing page."""
    pid, pida = best(limit)
    return 100 - 100 * pida / pid


def strangers() -> list[float]:
    """Return the plants, and the shares that are refused, have a true Ms of at most 2, or keep the reported Ms."""
    rows = table(BOOK / "data" / "strangers.csv")
    made = [(float(row["ms_true"]), float(row["ms_worst"])) for row in rows if row["ms_true"]]
    shares = (len(rows) - len(made)) / len(rows), sum(a <= 2.0005 for a, _ in made) / len(made)
    within = sum(a <= b + 0.0005 for a, b in made) / len(made)
    return [len(rows), *(100 * share for share in (*shares, within))]


def foreign() -> list[float]:
    """Return the numbers of all records, of open-loop records and of designs, and the share of designs in per cent."""
    rows = table(BOOK / "data" / "foreign.csv")
    readable = [row for row in rows if row["experiment"] and not row["remark"]]
    served = sum(row["result"] == "a PID" for row in readable)
    return [len(rows), len(readable), served, 100 * served / len(readable)]


def portraits() -> list[float]:
    """Return the seconds with one worker, the ratio to all workers, and the seconds with two workers."""
    rows = table(BOOK / "data" / "portrait_comparison.csv")
    seconds = {row["method"]: float(row["seconds"]) for row in rows}
    one = seconds["portrait, one worker"]
    return [one, one / seconds["portrait"], seconds["portrait, two workers"]]


def timed(quantity: str, method: str, points: str = "") -> list[dict[str, str]]:
    """Return the rows of a method."""
    return [
        row
        for row in table(BOOK / "data" / "speed_comparison.csv")
        if (row["quantity"], row["method"]) == (quantity, method) and points in ("", row["value"])
    ]


def span(rows: Sequence[dict[str, str]], key: str, unit: float = 1.0) -> list[float]:
    """Return the least and the largest entry."""
    values = [float(row[key]) / unit for row in rows]
    return [min(values), max(values)]


def faster(quantity: str, method: str) -> list[float]:
    """Return in how many rows a method was faster than pidalab, the number of rows, and the range of ratios."""
    rows = timed(quantity, method)
    less = [row for row in rows if float(row["ratio"]) < 1]
    return [len(less), len(rows), *span(less, "ratio")]


def responses(method: str) -> list[float]:
    """Return ranges of times for three numbers of points, in ms for pidalab and otherwise as ratios."""
    key, unit = ("seconds", 1e-3) if method == "pidalab" else ("ratio", 1.0)
    return [
        x for points in ("501", "2001", "10001") for x in span(timed("response", method, points), key, unit)
    ]


def of_margins(method: str) -> list[float]:
    """Return the ranges of times in ms and of ratios."""
    rows = timed("margins", method)
    return [*span(rows, "seconds", 1e-3), *span(rows, "ratio")]


def optima_in(plant: str, k: int) -> list[float]:
    """Return the seconds of pidalab and of the evolution, and their ratio, for the k-th kind of controller."""
    ours, other = (
        [row for row in timed("optimum", method) if row["loop"].startswith(plant)][k]
        for method in ("pidalab", "differential evolution")
    )
    return [float(ours["seconds"]), float(other["seconds"]), float(other["ratio"])]


def tank() -> list[float]:
    """Return the ultimate gain and a hundredth of the ultimate period of three lags and a dead time of 20."""
    w = brentq(lambda w: 3 * np.arctan(20 * w) + 20 * w - pi, 0.01, 0.1)
    return [(1 + (20 * w) ** 2) ** 1.5 / 0.8, 2 * pi / w / 100]


def years(name: str) -> list[float]:
    """Return the life of a valve of a million strokes, from the shown hourly travel."""
    return [1e8 / float(numbers(NOISE_PAGE, rf"\n{name} \|.*\| {N} \| [\d.]+\n")[0]) / 8760]


@cache
def fitted_step() -> list[float]:
    """Fit gain, time constant, damping and dead time of two lags to the record by another optimiser."""
    text = (BOOK / "data" / "plant_record.csv").read_text(encoding="utf-8").replace(",", ".")
    rows = [line.split(";") for line in text.splitlines()[1:]]
    t, u, y = np.array([[float(x) for x in row] for row in rows if all(row)]).T
    t, first, times = *np.unique(t, return_index=True), t
    y, start = np.array([y[times == one].mean() for one in t]), t[np.flatnonzero(np.diff(u[first]))[0] + 1]

    def misses(x):
        gain, a, b, delay, rest = x
        v = np.maximum(t - start - delay, 0.0)
        return rest + 7 * gain * (1 - (a * np.exp(-v / a) - b * np.exp(-v / b)) / (a - b)) - y

    gain, a, b, delay, _ = least_squares(misses, [2.0, 20.0, 6.0, 5.0, 310.0], x_scale=[1, 10, 5, 5, 1]).x
    return [gain, sqrt(a * b), (a + b) / 2 / sqrt(a * b), delay]


@cache
def designed() -> dict[str, list[float]]:
    """Return Ms and IAE with the model, and Ms with the true plant, of the three controllers of *Design*.

    The library fits and designs. This function only evaluates transfer functions.
    """
    record = pidalab.Record.read_csv(
        BOOK / "data" / "plant_record.csv", time="time", u="valve", y="temperature"
    )
    model = pidalab.identification.fit(record)

    def true(s):
        return 2.3 * np.exp(-8 * s) / ((20 * s + 1) * (6 * s + 1) * (3 * s + 1))

    def fitted(s):
        num, den = np.polyval(model.process.num, s), np.polyval(model.process.den, s)
        return num / den * np.exp(-model.process.delay * s)

    rows: list[list[float]] = []
    for row in pidalab.report(model, ms=1.6, sample_time=0.2).rows:
        ((_, gains, time, order),) = row.design.controller.parts()
        control = controller(*gains, tf=time, n=order)
        rows.append([ms(control, fitted), iae(control, fitted, 600.0), ms(control, true)])
    return dict(zip(("Ms", "IAE load", "true"), map(list, zip(*rows, strict=True)), strict=True))


def hump(n: int) -> float:
    """Return the maximum of x/(1 + x²)^(n/2)."""
    return sqrt((n - 1) ** (n - 1) / n**n)


def humps(n: int) -> list[float]:
    """Return `hump(n)` by two formulas of the page, and times the square root of n."""
    return [hump(n), hump(n), sqrt(n) * hump(n)]


# ------------------------------------------------------------------------------------------------ the table

ONE, TWO, THREE = (f"learn/{name}.ipynb" for name in ("what-acceleration-does", "when-it-pays", "tuning"))
FOUR, FIVE, SIX = (f"learn/{name}.ipynb" for name in ("filter-and-noise", "limits", "digital"))
WHICH, RULES, CURVES = (f"across/{name}.ipynb" for name in ("which-controller", "rules-compared", "frontier"))
HEO = "heo2023.ipynb"
N = r"([-+−]?\d+\.?\d*)"  # a number
FAST, NOISE_PAGE = "speed/how-fast.ipynb", "noise-limit.ipynb"
OTHERS = ("python-control, Padé 3", "python-control, Padé 10", "Runge–Kutta 4, numba")
BOUGHT = ("PID, limit 3.79", "PIDA, limit 3.79", "PID, limit 0.38", "PIDA, limit 0.38")
IPDT = (0.8328, 3.9, 0.4875, 0.07042)
FILTERS = ((3, 0.1151), (6, 0.059155), (2, 0.22499))  # order and time, of lecture 4
THIRDS = (-1, 0, 1 / 3, 2 / 3, 2)  # of the normalised dead time, which is 0 for integrating plants alone
CLASSES = dict(
    zip(("integrating", "lag-dominated", "balanced", "delay-dominated"), pairwise(THIRDS), strict=True)
)
ROLLOFFS = dict(zip(("below 1", "1 to 2", "2 or more"), pairwise((0, 1, 2, 9)), strict=True))
DERIVATIVES = {"PID": 1, "PIDA": 2, "m = 3": 3}
PUBLISHED = [
    ("AMIGO", "PI"),
    ("AMIGO", "PID"),
    ("Haalman", "PID"),
    ("Haalman", "PIDA"),
    ("SIMC", "PI"),
    ("SIMC", "PID"),
]

# An entry has a page, a pattern with a group for each number, and the second method.
SHOWN = [
    *(
        (
            ONE,
            rf"{kind} +kp {N}, Ms {N}, IAE {N}(?s:.*)\n{kind} +1/ki = {N}, IE {N}, IAE {N}",
            partial(with_three_lags, kind),
        )
        for kind in ("PI", "PID", "PIDA")
    ),
    (ONE, rf"by hand: ti {N}, td {N}, ta {N}", lambda: [3, 1, 1 / 3]),
    (ONE, rf"\$k_p = 0\.869\$ gives \$M_s = {N}\$", lambda: [ms(standard(0.869, 3, 1, 1 / 3, 0.1))]),
    (TWO, rf"\n\[{N} {N} \] \[0", lambda: [pi / 4, 3 * pi / 16]),
    (
        TWO,
        rf"the IAE is {N} with PIDA, {N} with PID and {N} with PI",
        lambda: [
            iae(standard(1.4563, 3.74526, 1.14511, 0.8491, 0.31331)),
            iae(standard(0.87905, 2.49711, 0.99221, 0, 0.12353, 2)),
            iae(standard(0.46812, 2.14891, 0, 0, 0.06857, 1)),
        ],
    ),
    *((TWO, rf"noise {noise}: PID {N}, PIDA {N}, ", partial(best, noise)) for noise in (0.5, 1.5)),
    (
        TWO,
        rf"balanced, three lags +{N} +{N} +{N}",
        lambda: [saved(FRONTIER, noise, of=["balanced, three lags"])[0] for noise in ("0.1", "0.4", "1.6")],
    ),
    (
        THREE,
        rf"\$M_s = {N}\$.*?-\(1 - 1/M_s\) = {N}\$.*?M_s/\(M_s - 1\) = {N}\$",
        lambda: [top := ms(standard(1.2, 3, 1, 1 / 3, 0.1)), 1 / top - 1, top / (top - 1)],
    ),
    (
        THREE,
        rf"T_f = 0\.315\$: \$M_s = {N}\$, .*?IAE {N}",
        lambda: [f(standard(1.43, 3.75, 1.145, 0.85, 0.315)) for f in (ms, iae)],
    ),
    *((THREE, rf"Ms {wanted}: k D = {N}", partial(proportional_gain, wanted)) for wanted in (1.4, 1.6, 2.0)),
    (THREE, rf"k D = 2/3: Ms {N}", lambda: [ms(lambda s: 2 / 3, integrator)]),
    (THREE, rf"exp\(-1\) = {N}", lambda: [1 / e]),
    (
        FOUR,
        rf"an \$M_s\$ of {N}\. Order 6 has {N} and order 2 has {N}\.",
        lambda: [ms(standard(*IPDT, tf, n), integrator) for n, tf in FILTERS],
    ),
    (FOUR, rf"are {N}, {N} and {N}\. So a filter order", lambda: [n * tf for n, tf in FILTERS]),
    *(
        (FOUR, rf"n = {n}: {N}, by hand {N}, times the square root of n {N}", partial(humps, n))
        for n in (2, 3, 4, 6, 20)
    ),
    *((FOUR, rf"\nn = {n} \| {N} \| {N}", partial(shortest_filter, n)) for n in (2, 3, 4, 6)),
    (FIVE, rf"above the least {N}", lambda: [1 + 0.5 / 0.1]),
    (FIVE, rf"The sum is {N}\.", lambda: [1 + 0.5 / 0.2]),
    (
        SIX,
        rf"predicted {N}",
        lambda: [ms(controller(k := lecture_1()["PI"][2], 1.5 * k, tf=0.1, n=1), lambda s: lags(s, 1.1))],
    ),
    (SIX, rf"sum of e {N}, 1/ki {N}", lambda: [1 / lecture_1()["PIDA"][2]] * 2),
    (SIX, rf"\$h = 0\.2\$ gives \$M_s = {N}\$", lambda: [sampled_ms(0.2)]),
    (SIX, rf"that can be seen {N}, seen {N}", lambda: [pi / 0.5, 2 * pi / 0.5 - 12.3]),
    (SIX, rf"13\.2 - 2\\pi/0\.5\| = {N}", lambda: [13.2 - 4 * pi]),
    (
        "intro.md",
        rf"noise gain of 0\.3 .*? saves {N} % .*?{N} % in the median.*?saves {N} % on this.*?{N} % in the median",
        lambda: [landing(0.3), median(saved(OPTIMA, "0.3")), landing(1.5), median(saved(OPTIMA, "1.5"))],
    ),
    (HEO, rf"The load peak is {N} % lower", lambda: lower_peaks()[:1]),
    *(
        (
            HEO,
            rf"\nExample {k}, {rule} \| \S+ / {N}" + (rf" \| \S+ / {N}" if k < 3 else ""),
            partial(heo_itae, k, rule),
        )
        for k in (1, 2, 3)
        for rule in ("IMC", "ITAE-2", "proposed")
    ),
    *(
        (
            page,
            rf"peak (?:after a load step )?is {N} to {N} % lower",
            lambda: [min(lower_peaks()), max(lower_peaks())],
        )
        for page in (HEO, f"audit/{HEO}")
    ),
    ("others.ipynb", rf"{N} records, {N} of them .*?\nof these {N} gave a controller: {N}%", foreign),
    (
        "others.ipynb",
        rf"{N} plants, {N}% refused\n(?:.*\n)true Ms at most 2\.0: {N}%\ntrue Ms within the reported worst: {N}%",
        strangers,
    ),
    ("design.ipynb", rf"sopdt: gain = {N} .*?tau = {N} .*?damping = {N} .*?delay = {N} ", fitted_step),
    *(
        ("design.ipynb", rf"\n{name} \| {N} \| {N} \| {N} \|", lambda name=name: designed()[name])
        for name in ("Ms", "IAE load")
    ),
    (
        "design.ipynb",
        rf"PI: Ms with the plant {N}.*\nPID: .* {N},.*\nPIDA: .* {N},",
        lambda: designed()["true"],
    ),
    (NOISE_PAGE, rf"ultimate gain {N} %/K, noise every {N} s", tank),
    *((NOISE_PAGE, rf"\n{name} \|.*\| {N}\n", partial(years, name)) for name in BOUGHT),
    *(
        (
            FAST,
            rf"\n{method} \| " + r" \| ".join([rf"{N} to {N} (?:ms|×), \S+"] * 3),
            partial(responses, method),
        )
        for method in ("pidalab", *OTHERS, "JiTCDDE")
    ),
    *(
        (
            FAST,
            rf"\n{OTHERS[-1]} \| {quantity} \| {N} of {N} \| {N} to {N}",
            partial(faster, quantity, OTHERS[-1]),
        )
        for quantity in ("response", "horizon", "dead time", "order")
    ),
    (FAST, rf"\n{OTHERS[0]} \| margins \| {N} of {N} \| {N} to {N}", partial(faster, "margins", OTHERS[0])),
    *(
        (FAST, rf"\n{method} \| 4 \| {N} to {N} \| {N} to {N}", partial(of_margins, method))
        for method in OTHERS[:2]
    ),
    *(
        (FAST, rf"\n{plant} \| {kind} \| {N} \| {N} \| {N}", partial(optima_in, plant, k))
        for plant in ("lags3", "fopdt_balanced", "ipdt")
        for k, kind in enumerate(("PI", "PID", "PIDA"))
    ),
    (
        FAST,
        rf"portrait, one worker +10,000 +{N} +{N}.*\nportrait, two workers +10,000 +{N}",
        portraits,
    ),
    *(
        (WHICH, rf"\n{name} \| {N}% \| {N}% \| {N}% \| {N}% \| {N}", partial(of_class, name))
        for name in CLASSES
    ),
    *(
        (RULES, rf"\n{name} \| [a-z ]+ \| {N} \| {N}% \| {N}% \| {N}% \| {N}%", partial(of_rolloff, name))
        for name in ROLLOFFS
    ),
    *((RULES, rf"\n{' . '.join([*rule, *[N] * 4])}", partial(ranked, *rule)) for rule in PUBLISHED),
    *(
        (RULES, rf"(?s:.*)\n{' . '.join([*rule, *[N] * 5])}", partial(as_published, *rule))
        for rule in PUBLISHED
    ),
    *(
        (CURVES, rf"\n{name} \| {N}% \| {N}%: .* \| {N} of", partial(frontier, k, "1.4"))
        for name, k in DERIVATIVES.items()
    ),
    *(
        (CURVES, rf"(?s:.*)\n{name} \| {N}% \| {N}%: .* \| {N} of", partial(frontier, k, "2"))
        for name, k in DERIVATIVES.items()
    ),
    (
        CURVES,
        rf"\nfour lags \| {N}% .*? \| {N}% .*? \| {N}%",
        lambda: [saved(FRONTIER, "3.2", k, of=["four lags"])[0] for k in (1, 2, 3)],
    ),
]

# Each entry has two places that show the same numbers.
SAME = [
    ((TWO, rf"local searches ended: .*; PID {N}"), (TWO, rf"noise 1\.5: PID {N}, PIDA")),
    ((TWO, rf"\nIAE {N}, Ms 1\.400, relative noise gain 0\.50"), (TWO, rf"noise 0\.5: PID [\d.]+, PIDA {N}")),
    *(
        ((TWO, rf"noise {noise}: 1/ki .*; IAE {N} and {N}"), (TWO, rf"noise {noise}: PID {N}, PIDA {N}"))
        for noise in (0.25, 0.5, 1.5)
    ),
    ((ONE, rf"PIDA 1/ki = {N}"), (SIX, rf"1/ki {N}")),
    (
        (TWO, rf"the IAE is [\d.]+ with PIDA, {N} with PID"),
        (THREE, rf"The best PID under both limits has an IAE of {N}\."),
    ),
]
