"""Numbers that pages show outside the ledger, each with the second way that holds it.

nbval proves that a page still computes what it shows, not that it is right. Each entry of `SHOWN` finds numbers in the
stored outputs or sentences of a page, and computes them again without the library: by closed forms, on a dense grid of
frequencies, by a Fourier series of the transform, or from the tables that studies wrote. Each entry of `SAME` finds
two places that show the same quantity.
"""

import csv
import json
import re
from collections.abc import Callable, Sequence
from functools import cache
from math import e, pi, sqrt
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.signal import cont2discrete, tf2ss
from second import response

ROOT = Path(__file__).parents[2]
BOOK = ROOT / "book"
GRID = np.geomspace(1e-3, 300, 200_001)


class Shown(NamedTuple):
    """Numbers on a page, found by the groups of a pattern in its text."""

    page: str
    pattern: str
    others: Callable[[], Sequence[float]] | None = None


@cache
def text_of(page: str) -> str:
    """Return sentences and text outputs of a page."""
    path = BOOK / page
    if path.suffix == ".md":
        return path.read_text(encoding="utf-8")
    found = []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        outputs = cell.get("outputs", [])
        texts = [one.get("text") or one.get("data", {}).get("text/plain", "") for one in outputs]
        found += ["".join(cell["source"]) if cell["cell_type"] == "markdown" else "", *map("".join, texts)]
    return "\n".join(found)


def numbers(shown: Shown, text: str | None = None) -> list[str]:
    """Return the numbers of the first place that the pattern finds; none if there is no such place."""
    found = re.search(shown.pattern, text_of(shown.page) if text is None else text)
    return [one.replace("−", "-") for one in found.groups()] if found else []


def half_unit(text: str) -> float:
    """Return half a unit of the last place."""
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
    """Return a controller of gain and times; `ta` multiplies s squared."""
    return controller(kp / ti, kp, kp * td, kp * ta, tf, n)


def largest(values):
    """Return the top of a curve, between the points of a grid."""
    k = int(np.argmax(values))
    if not 0 < k < len(values) - 1:
        return float(values[k])
    a, b, c = values[k - 1 : k + 2]
    return float(b + (a - c) ** 2 / (8 * (2 * b - a - c))) if 2 * b > a + c else float(b)


def ms(control, plant=lags):
    """Return the largest sensitivity, on a grid."""
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
    """Return gain, Ms and IAE of one of them."""
    k, error, _ = lecture_1()[kind]
    return [k, 1.4, error]


def sampled_ms(h: float) -> float:
    """Return Ms of the PIDA of lecture 6 by backward differences, its plant held; the dead time is whole samples."""
    a, b, c, _, _ = cont2discrete(tf2ss([1.0], [1.0, 3.0, 3.0, 1.0]), h, "zoh")
    w = np.linspace(1e-3, pi / h, 4001)
    z = np.exp(1j * h * w)
    plant = np.array([(c @ np.linalg.solve(one * np.eye(3) - a, b))[0, 0] for one in z]) * z ** -round(1 / h)
    s = (1 - 1 / z) / h
    return largest(1 / np.abs(1 + plant * standard(1.416, 3.882, 1.199, 0.929, 0.378)(s)))


def proportional_gain(wanted: float) -> float:
    """Return the gain of the integrator with dead time that has this Ms."""
    return brentq(lambda k: ms(lambda s: k, integrator) - wanted, 0.1, 1.2, xtol=1e-6)


def table(path: Path) -> list[dict[str, str]]:
    """Return the rows of a table."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def saved(path: Path, noise: str, **chosen: str) -> list[float]:
    """Return what PIDA saves of the IAE of PID in per cent, by plant, from the table of a study."""
    rows = [
        row for row in table(path) if row["noise_limit"] == noise and row["ms_limit"] == "1.4" and row["iae"]
    ]
    least = {(row["plant"], row["order"]): float(row["iae"]) for row in rows}
    return [
        100 - 100 * value / least[plant, "1"]
        for (plant, order), value in least.items()
        if order == "2" and (plant, "1") in least and plant == chosen.get("plant", plant)
    ]


OPTIMA = ROOT / "src" / "pidalab" / "comparison" / "tables" / "optima.csv"
FRONTIER = BOOK / "data" / "frontier.csv"


def best(limit: float) -> tuple[float, float]:
    """Return the IAE of PID and PIDA on the landing page, by the responses of its designs."""
    script = r'pidalab-landing">\s*<script type="application/json">(.*?)</script>'
    state = json.loads(re.search(script, text_of("intro.md"))[1])
    k = state["limits"].index(limit)
    (_, *pid, pid_filter), (_, *pida, pida_filter) = state["PID"][k], state["PIDA"][k]
    return iae(controller(*pid, tf=pid_filter, n=2)), iae(controller(*pida, tf=pida_filter, n=3))


def landing(limit: float) -> float:
    """Return what PIDA saves on the landing page in per cent."""
    pid, pida = best(limit)
    return 100 - 100 * pida / pid


def strangers() -> list[float]:
    """Return plants, and shares in per cent: refused, true Ms at most 2, within what was reported."""
    rows = table(BOOK / "data" / "strangers.csv")
    made = [(float(row["ms_true"]), float(row["ms_worst"])) for row in rows if row["ms_true"]]
    shares = (len(rows) - len(made)) / len(rows), sum(a <= 2.0005 for a, _ in made) / len(made)
    within = sum(a <= b + 0.0005 for a, b in made) / len(made)
    return [len(rows), *(100 * share for share in (*shares, within))]


def foreign() -> list[float]:
    """Return records, those in open loop, designs, and their share in per cent."""
    rows = table(BOOK / "data" / "foreign.csv")
    readable = [row for row in rows if row["experiment"] and not row["remark"]]
    served = sum(row["result"] == "a PID" for row in readable)
    return [len(rows), len(readable), served, 100 * served / len(readable)]


def portraits() -> list[float]:
    """Return the seconds of one worker, their ratio to all, and the seconds of two."""
    rows = table(BOOK / "data" / "portrait_comparison.csv")
    seconds = {row["method"]: float(row["seconds"]) for row in rows}
    one = seconds["portrait, one worker"]
    return [one, one / seconds["portrait"], seconds["portrait, two workers"]]


def hump(n: int) -> float:
    """Return the top of x/(1 + x²)^(n/2)."""
    return sqrt((n - 1) ** (n - 1) / n**n)


# ------------------------------------------------------------------------------------------------ the table

ONE, TWO, THREE = (f"learn/{name}.ipynb" for name in ("what-acceleration-does", "when-it-pays", "tuning"))
FOUR, FIVE, SIX = (f"learn/{name}.ipynb" for name in ("filter-and-noise", "limits", "digital"))
N = r"([-+−]?\d+\.?\d*)"  # a number
IPDT = (0.8328, 3.9, 0.4875, 0.07042)

SHOWN = {
    **{
        f"lecture 1, gain, Ms and IAE of the {kind}": Shown(
            ONE, rf"{kind} +kp {N}, Ms {N}, IAE {N}", lambda kind=kind: with_three_lags(kind)
        )
        for kind in ("PI", "PID", "PIDA")
    },
    **{
        f"lecture 1, 1/ki and IAE of the {kind}": Shown(
            ONE,
            rf"{kind} +1/ki = {N}, IE {N}, IAE {N}",
            lambda kind=kind: [1 / lecture_1()[kind][2]] * 2 + [lecture_1()[kind][1]],
        )
        for kind in ("PI", "PID", "PIDA")
    },
    "lecture 1, times by hand": Shown(ONE, rf"by hand: ti {N}, td {N}, ta {N}", lambda: [3, 1, 1 / 3]),
    "lecture 1, task of the gain": Shown(
        ONE, rf"\$k_p = 0\.869\$ gives \$M_s = {N}\$", lambda: [ms(standard(0.869, 3, 1, 1 / 3, 0.1))]
    ),
    "lecture 2, areas of the filters": Shown(TWO, rf"\n\[{N} {N} \] \[0", lambda: [pi / 4, 3 * pi / 16]),
    "lecture 2, three designs at one noise": Shown(
        TWO,
        rf"The PIDA: IAE {N}, PID {N}, PI {N}",
        lambda: [
            iae(standard(1.4563, 3.74526, 1.14511, 0.8491, 0.31331)),
            iae(standard(0.87905, 2.49711, 0.99221, 0, 0.12353, 2)),
            iae(standard(0.46812, 2.14891, 0, 0, 0.06857, 1)),
        ],
    ),
    **{
        f"lecture 2, least IAE at a noise of {noise}": Shown(
            TWO, rf"noise {noise}: PID {N}, PIDA {N}, ", lambda noise=noise: list(best(noise))
        )
        for noise in (0.5, 1.5)
    },
    "lecture 2, what acceleration saves": Shown(
        TWO,
        rf"balanced, three lags +{N} +{N} +{N}",
        lambda: [saved(FRONTIER, noise, plant="balanced, three lags")[0] for noise in ("0.1", "0.4", "1.6")],
    ),
    "lecture 3, Ms and what it guarantees": Shown(
        THREE,
        rf"\$M_s = {N}\$.*?-\(1 - 1/M_s\) = {N}\$.*?M_s/\(M_s - 1\) = {N}\$",
        lambda: [top := ms(standard(1.2, 3, 1, 1 / 3, 0.1)), 1 / top - 1, top / (top - 1)],
    ),
    "lecture 3, a design that meets the limits": Shown(
        THREE,
        rf"T_f = 0\.315\$: \$M_s = {N}\$, .*?IAE {N}",
        lambda: [f(standard(1.43, 3.75, 1.145, 0.85, 0.315)) for f in (ms, iae)],
    ),
    **{
        f"lecture 3, gain for Ms {wanted}": Shown(
            THREE, rf"Ms {wanted}: k D = {N}", lambda wanted=wanted: [proportional_gain(wanted)]
        )
        for wanted in (1.4, 1.6, 2.0)
    },
    "lecture 3, Ms of two thirds": Shown(
        THREE, rf"k D = 2/3: Ms {N}", lambda: [ms(lambda s: 2 / 3, integrator)]
    ),
    "lecture 3, tail of a cancelled lag": Shown(THREE, rf"exp\(-1\) = {N}", lambda: [1 / e]),
    "lecture 4, Ms by the order of the filter": Shown(
        FOUR,
        rf"Order 3, 6, 2: \$M_s\$ {N}, {N}, {N}",
        lambda: [
            ms(standard(*IPDT, tf, n), integrator) for n, tf in ((3, 0.1151), (6, 0.059155), (2, 0.22499))
        ],
    ),
    "lecture 4, lags of the filters": Shown(
        FOUR, rf"are {N}, {N} and {N}: one order", lambda: [3 * 0.1151, 6 * 0.059155, 2 * 0.22499]
    ),
    **{
        f"lecture 4, top of order {n}": Shown(
            FOUR,
            rf"n = {n}: {N}, by hand {N}, square root of n times it {N}",
            lambda n=n: [hump(n), hump(n), sqrt(n) * hump(n)],
        )
        for n in (2, 3, 4, 6, 20)
    },
    "lecture 5, least IAE under a limit": Shown(FIVE, rf"above the least {N}", lambda: [1 + 0.5 / 0.1]),
    "lecture 5, task of the limit": Shown(FIVE, rf"Together {N}\.", lambda: [1 + 0.5 / 0.2]),
    "lecture 6, Ms of the PI by half a sample": Shown(
        SIX,
        rf"predicted {N}",
        lambda: [ms(controller(k := lecture_1()["PI"][2], 1.5 * k, tf=0.1, n=1), lambda s: lags(s, 1.1))],
    ),
    "lecture 6, the integral of the error": Shown(
        SIX, rf"sum of e {N}, 1/ki {N}", lambda: [1 / lecture_1()["PIDA"][2]] * 2
    ),
    "lecture 6, Ms of a sampled PIDA": Shown(
        SIX, rf"\$h = 0\.2\$ gives \$M_s = {N}\$", lambda: [sampled_ms(0.2)]
    ),
    "lecture 6, aliases": Shown(
        SIX, rf"that can be seen {N}, seen {N}", lambda: [pi / 0.5, 2 * pi / 0.5 - 12.3]
    ),
    "lecture 6, task of the alias": Shown(SIX, rf"13\.2 - 2\\pi/0\.5\| = {N}", lambda: [13.2 - 4 * pi]),
    "landing page": Shown(
        "intro.md",
        rf"noise gain of 0\.3 .*? saves {N} % .*?{N} % in the median.*?saves {N} % here.*?{N} % in the median",
        lambda: [landing(0.3), median(saved(OPTIMA, "0.3")), landing(1.5), median(saved(OPTIMA, "1.5"))],
    ),
    "plants of others, records": Shown(
        "others.ipynb", rf"{N} records, {N} of them .*?\nof these {N} gave a controller: {N}%", foreign
    ),
    "plants of others, random plants": Shown(
        "others.ipynb",
        rf"{N} plants, {N}% refused\n(?:.*\n)true Ms at most 2\.0: {N}%\ntrue Ms within the reported worst: {N}%",
        strangers,
    ),
    "how fast, portraits": Shown(
        "speed/how-fast.ipynb",
        rf"portrait, one worker +10,000 +{N} +{N}.*\nportrait, two workers +10,000 +{N}",
        portraits,
    ),
}

SAME = {
    "best PID of lecture 2": (
        Shown(TWO, rf"local searches ended: .*; PID {N}"),
        Shown(TWO, rf"noise 1\.5: PID {N}, PIDA"),
    ),
    "best PIDA of lecture 2": (
        Shown(TWO, rf"\nIAE {N}, Ms 1\.400, relative noise gain 0\.50"),
        Shown(TWO, rf"noise 0\.5: PID [\d.]+, PIDA {N}"),
    ),
    **{
        f"IE and IAE of lecture 2 at a noise of {noise}": (
            Shown(TWO, rf"noise {noise}: 1/ki .*; IAE {N} and {N}"),
            Shown(TWO, rf"noise {noise}: PID {N}, PIDA {N}"),
        )
        for noise in (0.25, 0.5, 1.5)
    },
    "PIDA of lectures 1 and 6": (Shown(ONE, rf"PIDA 1/ki = {N}"), Shown(SIX, rf"1/ki {N}")),
    "noise PIDA of lectures 2 and 3": (
        Shown(TWO, rf"The PIDA: IAE [\d.]+, PID {N}"),
        Shown(THREE, rf"The best PID under both limits has an IAE of {N}:"),
    ),
}
