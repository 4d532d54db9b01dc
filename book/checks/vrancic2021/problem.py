"""What vrancic2021 computes with: its processes, designs and rivals, each made once."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from functools import cache
from typing import Any, NamedTuple, cast

import control
import numpy as np
import pidalab
from pidalab import areas
from pidalab.rules import magnitude_optimum as mo

SAMPLE_TIME = 0.002  # T_S of Section 3, s
BAND = 2 * math.pi / SAMPLE_TIME  # omega_S, eq. (28), rad/s
SHORT_FILTER = 0.1  # T_F of example 1, s
FIRST, UPDATES = 0.035, 4  # how T_F was iterated, see `hidden.start`
GAINS = "km1", "k0", "k1", "k2", "k3", "k4"
AREAS = {1: 6, 2: 8, 3: 10}  # of Table 1, by the order of the controller
EXAMPLE_1 = tuple((g, m) for g in (1, 2) for m in (1, 2, 3))


class Case(NamedTuple):
    """A design of Tables 3 to 6: process, orders and wanted noise gain."""

    g: int
    m: int
    n: int
    wanted: int

    def __str__(self) -> str:
        return f"PID_{self.n}^{self.m}, K_HF = {self.wanted}"


CASES = (
    {f"table3.khf{k}": Case(3, 3, 4, k) for k in (2, 5, 10, 20)}
    | {f"table4.n{n}": Case(3, 3, n, 10) for n in (3, 4, 5, 6)}
    | {f"table5.m{m}": Case(3, m, m + 1, 10) for m in (1, 2, 3, 4)}
    | {f"table6.m{m}": Case(4, m, m + 1, 10) for m in (2, 3, 4)}
)
TABLE_3 = tuple(key for key in CASES if key.startswith("table3"))
TABLE_4 = tuple(key for key in CASES if key.startswith("table4"))
TABLE_5 = tuple(key for key in CASES if key.startswith("table5"))
TABLE_6 = tuple(key for key in CASES if key.startswith("table6"))
REPEATED = "table4.n4", "table5.m3"  # the design of Table 3 with K_HF = 10 once more
ONCE = tuple(key for key in CASES if key not in REPEATED)
NOISY = tuple(key for key in ONCE if key not in TABLE_6)  # those with a sigma_rel

# Controllers of the other methods as printed: gains of (40), (43) and (46), and their T_F.
RIVAL = {5: "Lurang", 6: "Jung", 7: "Puangdownreong"}
RIVAL_ID = {5: "lurang", 6: "jung", 7: "puang"}
RIVAL_GAINS = {
    5: (2.20, 3.60, 1.60, 0.06),
    6: (529.8, 516.5, 179.2, 26.3),
    7: (1.647, 2.684, 1.105, -2.65e-3),
}
RIVAL_FILTER = {5: 0.01, 6: 0.005}


def pid(design: pidalab.Design) -> pidalab.HighOrderPID:
    """The controller of a magnitude optimum design, as the type that it is."""
    return cast(pidalab.HighOrderPID, design.controller)


@cache
def process(g: int) -> pidalab.Process:
    """G_P1 to G_P7: G_P3 as used, not as printed in (33); G_P6 with the gain 1/18."""
    return {
        1: lambda: pidalab.lags(4),
        2: lambda: pidalab.lags(2, delay=0.5),
        3: lambda: pidalab.lags(3, delay=0.5),
        4: lambda: pidalab.lags(3, delay=1.0),
        5: lambda: pidalab.Process([6.0], np.poly([-1.0, -2.0, -3.0])),
        6: lambda: pidalab.Process([1.0], np.poly([-1.0, -3.0, -6.0])),
        7: lambda: pidalab.Process([64.0], np.poly([-1.0, -2.0, -4.0, -8.0])),
    }[g]()


@cache
def printed_gp3() -> pidalab.Process:
    """G_P3 as (33) prints it."""
    return pidalab.lags(4, delay=0.2)


@cache
def plain_areas(g: int, count: int = 12) -> np.ndarray:
    """Areas of a process, without filter."""
    return areas.from_process(process(g), count)


@cache
def example(g: int, m: int) -> pidalab.HighOrderPID:
    """A controller of Table 2: n = m and T_F = 0.1."""
    return pid(mo.tune(process(g), m, m, SHORT_FILTER))


@cache
def tuned(key: str) -> pidalab.HighOrderPID:
    """A controller of Tables 3 to 6, iterated as the paper seems to have done."""
    g, m, n, wanted = CASES[key]
    return pid(mo.tune_for_noise(process(g), m, n, wanted, SAMPLE_TIME, first=FIRST, updates=UPDATES))


@cache
def exact_noise(
    g: int, m: int, n: int, wanted: float, sample_time: float = SAMPLE_TIME
) -> pidalab.HighOrderPID:
    """A controller whose T_F comes from the exact noise gain."""
    return pid(mo.tune_for_exact_noise(process(g), m, n, wanted, sample_time))


@cache
def noise(key: str) -> float:
    """Expected sigma_rel of a design of Tables 3 to 6."""
    return pidalab.noise_gain(pidalab.Loop(process(CASES[key].g), tuned(key)), SAMPLE_TIME)


def integral_gain(key: str) -> float:
    """K_-1 of a design of Tables 3 to 6."""
    return tuned(key).coefficients[0]


@cache
def filter_47() -> control.TransferFunction:
    """The filter of case 3, eq. (47), that both controllers share."""
    return control.tf([1.0], [5.26e-5, 0.0132, 1.0])


def rival(g: int, filter_order: int = 2) -> Any:
    """The controller of the other method for G_P5, G_P6 or G_P7."""
    if g == 7:
        return with_filter_47(RIVAL_GAINS[7])
    return pidalab.HighOrderPID(RIVAL_GAINS[g], RIVAL_FILTER[g], filter_order)


def with_filter_47(gains: Iterable[float]) -> control.TransferFunction:
    """Gains K_-1, K_0, ... with the filter (47)."""
    return filter_47() * control.tf(list(gains)[::-1], [1.0, 0.0])


@cache
def gains_48() -> np.ndarray:
    """Gains of PID_2^2 for G_P7 with the filter (47)."""
    return mo.gains(areas.with_filter(plain_areas(7, 8), filter_47()), m=2)


@cache
def contest(g: int) -> dict[str, Any]:
    """Controllers that Section 5 compares on G_P5, G_P6 or G_P7; the rival comes last."""
    if g == 7:
        own: dict[str, Any] = {"PID_2^2": with_filter_47(gains_48())}
    else:
        own = {f"PID_{m}^{m}": pid(mo.tune(process(g), m, m, RIVAL_FILTER[g])) for m in (2, 3)}
    return own | {RIVAL[g]: rival(g)}


def loop(g: int, controller: Any, prefilter_time: float = 0.0) -> pidalab.Loop:
    """A loop with the prefilter of (9), or without it."""
    prefilter = smooth(prefilter_time) if prefilter_time else None
    return pidalab.Loop(process(g), controller, prefilter=prefilter)


@cache
def smooth(time: float) -> control.TransferFunction:
    """The prefilter 1/(T_FR s + 1)^2 of (9)."""
    return control.tf([1.0], [time**2, 2 * time, 1.0])


def magnitude_optima() -> Iterator[tuple[str, int, pidalab.Loop]]:
    """Every loop of Tables 2 to 6, (41), (44) and (48) once: its name, m, and the loop."""
    for g, m in EXAMPLE_1:
        yield f"G_P{g}, PID_{m}^{m}", m, loop(g, example(g, m))
    for key in ONCE:
        case = CASES[key]
        yield f"G_P{case.g}, {case}", case.m, loop(case.g, tuned(key))
    for g in RIVAL:
        for name, controller in contest(g).items():
            if name != RIVAL[g]:
                yield f"G_P{g}, {name}", int(name[-1]), loop(g, controller)


def tex(name: str) -> str:
    """PID_2^2 as a figure shows it."""
    return name if "_" not in name else f"PID$_{name[4]}^{name[6]}$" + name[7:]


def written_out(plain: np.ndarray, m: int, n: int, time: float) -> np.ndarray:
    """Gains by (8) and (17) in floating point, beside the library's exact fractions."""
    lower = np.subtract.outer(np.arange(plain.size), np.arange(plain.size))
    matrix = np.where(lower >= 0, time ** lower.clip(0), 0.0)
    A = np.linalg.matrix_power(matrix, n) @ plain
    rows = np.arange(m + 2)[:, None]
    columns = np.arange(m + 2)[None, :]
    index = 2 * rows + 1 - columns
    M = np.where(index >= 0, (-1.0) ** (columns + 1) * A[index.clip(0)], 0.0)
    return np.linalg.solve(M, -0.5 * np.eye(1, m + 2)[0])
