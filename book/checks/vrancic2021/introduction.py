"""What the introduction says about orders of process and controller."""

from __future__ import annotations

import math
from itertools import pairwise

import pandas as pd
import pidalab
from pidalab import areas
from pidalab.ledger import Ledger, every
from pidalab.rules import magnitude_optimum as mo

from . import problem
from .names import typeset
from .residuals import relative
from .theory import solvable


@typeset
def orders(book: Ledger) -> pd.DataFrame:
    """What the introduction says about orders of process and controller."""
    coarse, fine = (_cancellation(time) for time in (0.01, 0.001))
    book.statement(
        "st.intro.loworder",
        *every({f"order {q}": (fine[q], coarse[q]) for q in fine}, "<"),
        left_name="distance of the loop from K/(s(T_F s + 1)^n), T_F = 0.001",
        right_name="T_F = 0.01",
        note="Lags of order 1, 2 and 3 with m one less and n = max(m, 1): the controller tends to cancel "
        "the process. Distance: largest relative deviation of the gains from (s + 1)^q/(2nT_F), "
        + ", ".join(f"{x:.1e}" for x in coarse.values())
        + " and "
        + ", ".join(f"{x:.1e}" for x in fine.values())
        + ". Without a filter the matrix of (15) is singular: the library refuses "
        + f"{sum(not solvable(areas.from_process(pidalab.lags(q), 2 * q + 2), q - 1) for q in fine)} of {len(fine)}.",
    )
    PI = problem.pid(mo.tune(problem.process(1), 0, 0, 0.0))
    ladder = [PI, *(problem.example(1, m) for m in (1, 2, 3))]
    top = [C.coefficients[-1] / (C.filter_time ** len(C.coefficients[2:]) or 1.0) for C in ladder]
    ie = [1 / C.coefficients[0] for C in ladder]
    book.statement(
        "st.intro.noise",
        *every({f"m = {m + 1}": pair for m, pair in enumerate(pairwise(top))}, "<"),
        left_name="gain at high frequencies, order below",
        right_name="this order",
        note="K_m/T_F^m for m from 0 to 3: " + ", ".join(f"{x:.3g}" for x in top) + ".",
    )
    better = {f"m = {m + 2}": pair[::-1] for m, pair in enumerate(pairwise(ie[1:]))}
    book.statement(
        "st.intro.highorder",
        *every(better, "<"),
        left_name="IE of the load response, this order",
        right_name="order below",
        note="1/K_-1 for m = 1, 2 and 3: "
        + ", ".join(f"{x:.3g}" for x in ie[1:])
        + ". The gain at high frequencies rises with it, see st.intro.noise.",
    )
    index = [f"m = {m}" for m in range(4)]
    return pd.DataFrame({"gain at high frequencies": top, "IE, load": ie}, index).map("{:.4g}".format)


def _cancellation(time: float) -> dict[int, float]:
    """Deviation of the gains for q lags from (s + 1)^q / (2 n T_F), by q."""
    found = {}
    for q in (1, 2, 3):
        n = max(q - 1, 1)
        gains = problem.pid(mo.tune(areas.from_process(pidalab.lags(q), 2 * q + 2), q - 1, n, time))
        ideal = [math.comb(q, k) / (2 * n * time) for k in range(q + 1)]
        found[q] = relative(gains.coefficients, ideal)
    return found
