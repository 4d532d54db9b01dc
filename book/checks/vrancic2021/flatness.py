"""How flat |T| is: the power of the frequency with which it leaves 1."""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import mpmath
import numpy as np
import pandas as pd
import pidalab
from pidalab import areas
from pidalab.ledger import Ledger, every

from . import problem
from .names import typeset

LOW = 1e-3  # frequency, times the residence time, at which the power is measured


@cache
def flatness() -> dict[str, tuple[int, int, float]]:
    """Power of the frequency with which |T|^-2 leaves 1, what the theorem says, and the largest |T|.

    The gains of every magnitude optimum of the paper are solved again with 200 digits; so the power is an integer.
    """
    found = {}
    for name, m, loop in problem.magnitude_optima():
        controller = loop.controller
        if name.startswith("G_P7"):  # its filter (47) is no binomial one: made part of the process
            den = np.polymul(loop.process.den, problem.filter_47().den[0][0])
            plant, lag, order = pidalab.Process(loop.process.num, den), 0.0, 0
        else:
            plant, lag, order = loop.process, controller.filter_time, controller.filter_order
        known = _lagged(areas.exact(plant, 2 * m + 4), Fraction(lag), order)
        found[name] = _power(known, m, plant, lag, order), 2 * m + 6, pidalab.margins(loop).mt
    return found


def _lagged(known: list[Fraction], lag: Fraction, order: int) -> list[Fraction]:
    """Areas with a filter of `order` equal lags, exactly."""
    for _ in range(order):
        result = [known[0]]
        for value in known[1:]:
            result.append(value + lag * result[-1])
        known = result
    return known


def _power(known: list[Fraction], m: int, plant: pidalab.Process, lag: float, order: int) -> int:
    """Slope of log(|T|^-2 - 1) over log w at a very low frequency, with 200 digits."""
    size = m + 2
    with mpmath.workdps(200):
        A = [mpmath.mpf(a.numerator) / a.denominator for a in known]
        M = mpmath.matrix(size, size)
        for r in range(size):
            for c in range(min(size, 2 * r + 2)):
                M[r, c] = (-1) ** (c + 1) * A[2 * r + 1 - c]
        K = mpmath.lu_solve(M, mpmath.matrix([mpmath.mpf(-0.5), *[0] * (size - 1)]))

        def excess(w: mpmath.mpf) -> mpmath.mpf:
            s = mpmath.mpc(0, w)
            P = mpmath.polyval(plant.num.tolist(), s) / mpmath.polyval(plant.den.tolist(), s)
            C = sum(K[i] * s ** (i - 1) for i in range(size)) / (1 + s * lag) ** order
            L = C * P * mpmath.exp(-s * plant.delay)
            return abs(1 + L) ** 2 / abs(L) ** 2 - 1

        low = mpmath.mpf(LOW) * A[0] / A[1]
        return int(mpmath.nint(mpmath.log(excess(2 * low) / excess(low), 2)))


@typeset
def magnitude(book: Ledger) -> pd.DataFrame:
    """How flat |T| is at low frequencies, in every magnitude optimum of the paper."""
    found = flatness()
    book.statement(
        "st.mo.magnitude",
        *every({name: (power, wanted) for name, (power, wanted, _) in found.items()}, "=="),
        left_name="power of ω with which |T|^-2 leaves 1",
        right_name="2m + 6",
        note=f"{len(found)} loops, gains solved again with 200 digits. Beyond what the paper claims, the "
        f"largest |T| over all frequencies is {max(x for *_, x in found.values()):.6f}.",
    )
    rows = [(name, power, wanted, f"{peak:.6f}") for name, (power, wanted, peak) in found.items()]
    return pd.DataFrame(rows, columns=["loop", "power", "2m + 6", "largest |T|"]).set_index("loop")
