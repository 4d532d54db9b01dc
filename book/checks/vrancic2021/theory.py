"""The equations of Sections 1 to 3, each tried against the library, and Tables 1 and 2."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pandas as pd
import pidalab
from pidalab import areas
from pidalab.ledger import Ledger, every
from pidalab.rules import magnitude_optimum as mo
from scipy.optimize import newton

from . import problem
from .names import typeset
from .residuals import EXACT, decade, relative, residuals

SEED = 2021


def table_1(book: Ledger) -> None:
    """Areas of G_P1 and G_P2, alone and with the filters of PID_1^1 to PID_3^3."""
    for g in (1, 2):
        plain = areas.from_process(problem.process(g), 10)
        book.check({f"table1.gp{g}.plain.a{k}": a for k, a in enumerate(plain)})
        for m, count in problem.AREAS.items():
            filtered = areas.with_binomial_filter(plain[:count], problem.SHORT_FILTER, m)
            book.check({f"table1.gp{g}.m{m}.a{k}": a for k, a in enumerate(filtered)})


def table_2(book: Ledger) -> None:
    """Gains of PID_1^1 to PID_3^3 for G_P1 and G_P2."""
    for g, m in problem.EXAMPLE_1:
        gains = problem.example(g, m).coefficients
        named = zip(problem.GAINS, gains, strict=False)
        book.check({f"table2.gp{g}.m{m}.{k}": value for k, value in named})


@typeset
def areas_equations(book: Ledger) -> pd.DataFrame:
    """Equations (3) to (8): what the areas are, and how they follow from a transfer function."""
    rows = {}
    # (4): Gauss-Laguerre quadrature of t^k h(t) with h = t^3 exp(-t)/6 of G_P1
    x, weight = np.polynomial.laguerre.laggauss(20)
    moments = [weight @ x ** (k + 3) / 6 / math.factorial(k) for k in range(10)]
    found = areas.from_process(problem.process(1), 10)
    rows["(4), moments of h"] = residual = relative(moments, found)
    book.identity("eq4.moments", residual, EXACT, note=f"G_P1, k from 0 to 9; the last is {moments[-1]:.6g}.")
    # (6): the series at seven points of |s| = 0.3, inside its radius of convergence 1
    s = 0.3 * np.exp(1j * np.linspace(0, 6, 7))
    series = np.polyval(areas.from_process(problem.process(2), 40)[::-1], -s)
    exact = problem.process(2)(s)
    rows["(6), the series"] = residual = relative(series, exact)
    book.identity(
        "eq6.series",
        residual,
        EXACT,
        note=f"G_P2, 40 areas, seven points with |s| = 0.3; P(0.3) = {exact[0].real:.6f}.",
    )
    low, general, as_read = _equation_7()
    rows["(7), first lines"] = low
    rows["(7), general, with A_i"] = general
    rows["(7), general, as read"] = as_read
    book.identity(
        "eq7.low",
        low,
        EXACT,
        note=f"G_P1 and three random processes with numerator and dead time (seed {SEED}).",
    )
    wrong, right = _general_line(problem.process(1), 3)[1], areas.from_process(problem.process(1), 4)[3]
    book.identity(
        "eq7.general",
        abs(wrong / right - 1),
        EXACT,
        note=f"As read. With A_1 in every term the formula gives {wrong:.0f} for G_P1 and k = 3, "
        f"Table 1 has {right:.0f}. With A_i it agrees up to k = 8 for G_P1 and three random "
        f"processes, to {decade(general)}. An index is easily lost in reading.",
    )
    # (8): the printed matrix, applied three times, against areas of the product
    lower = np.subtract.outer(np.arange(8), np.arange(8))
    matrix = np.where(lower >= 0, problem.SHORT_FILTER ** lower.clip(0), 0.0)
    thrice = np.linalg.matrix_power(matrix, 3) @ areas.from_process(problem.process(2), 8)
    den = np.polymul(np.poly([-1.0] * 2), np.poly([-10.0] * 3) / 1e3)
    filtered = areas.from_process(pidalab.Process([1.0], den, 0.5), 8)
    rows["(8), M_F three times"] = residual = relative(thrice, filtered)
    book.identity(
        "eq8.power",
        residual,
        EXACT,
        note=f"G_P2, n = 3, T_F = {problem.SHORT_FILTER:g}, eight areas; the last is {thrice[-1]:.6f}. The "
        "line that joins the three quantities of (8) is lost in our reading.",
    )
    return residuals(rows)


def _general_line(process: pidalab.Process, k: int) -> tuple[float, float]:
    """A_k by the general line of (7): with A_i in its first sum, and with A_1 as read."""
    a, b = (np.pad(x[::-1] / x[-1], (0, 9))[:9] for x in (process.den, process.num))
    known, gain, delay = areas.from_process(process, 9), process.gain(), process.delay
    late = sum((-1) ** (k + i) * delay**i / math.factorial(i) * b[k - i] for i in range(1, k + 1))
    rest = gain * ((-1) ** (k + 1) * (a[k] - b[k]) + late)
    signed = [((-1) ** (k + i - 1) * a[k - i], i) for i in range(1, k)]
    return (
        rest + sum(factor * known[i] for factor, i in signed),
        rest + sum(factor * known[1] for factor, _ in signed),
    )


@cache
def _equation_7() -> tuple[float, float, float]:
    """Largest relative residuals of (7): its first lines, its general line with A_i, and as read."""
    rng = np.random.default_rng(SEED)
    processes = [problem.process(1)]
    for _ in range(3):
        num, den = rng.uniform(-1, 2, 3), np.poly(-rng.uniform(0.5, 3, 5))
        processes.append(pidalab.Process(num, den, delay=rng.uniform(0, 2)))
    low, general, as_read = [], [], []
    for process in processes:
        a, b = (np.pad(x[::-1] / x[-1], (0, 2)) for x in (process.den, process.num))
        known, gain, delay = areas.from_process(process, 9), process.gain(), process.delay
        first = gain * (a[1] - b[1] + delay)
        second = known[1] * a[1] + gain * (b[2] - a[2] - delay * b[1] + delay**2 / 2)
        low.append(relative([first, second], known[1:3]))
        both = np.array([_general_line(process, k) for k in range(1, 9)])
        general.append(relative(both[:, 0], known[1:]))
        as_read.append(relative(both[:, 1], known[1:]))
    return max(low), max(general), max(as_read)


@typeset
def series_equations(book: Ledger) -> pd.DataFrame:
    """Equations (11) to (17): the open loop as a power series, and the system for the gains."""
    rows: dict[str, float] = {}
    tried = [_series(g, m) for g, m in problem.EXAMPLE_1]
    rows["(11), general term"] = residual = max(series for series, _ in tried)
    K_0 = problem.example(1, 1).coefficients[1]
    book.identity(
        "eq11.series",
        residual,
        EXACT,
        note="The six loops of Table 2: 24 coefficients of s L(s) from its values on a circle, "
        f"against the formula with the areas. K_0 of the first is {K_0:.6f}.",
    )
    rows["(13), real part"] = residual = max(even for _, even in tried)
    book.identity(
        "eq13.even",
        residual,
        EXACT,
        note="The same loops at 0.05, 0.1 and 0.2 rad/s; Re L of the first at 0.2 rad/s is "
        f"{problem.loop(1, problem.example(1, 1)).L(0.2j).real:.8f}.",
    )
    met = [(name, w, miss) for g, name in problem.RIVAL.items() for w, miss in _on_the_line(g)]
    rows["|L| = |1 + L| on the line"] = residual = max(miss for *_, miss in met)
    book.identity(
        "st.mo.line",
        residual,
        EXACT,
        note="Tried with the controllers of the other methods, where Re L passes through −0.5 between 0.01 and 1e4 "
        f"rad/s: {', '.join(f'{name} at {w:.4g} rad/s' for name, w, _ in met)}.",
    )
    rows["(14), the conditions"] = residual = max(_conditions(g, m) for g, m in problem.EXAMPLE_1)
    book.identity(
        "st.analytic",
        residual,
        EXACT,
        note="One linear system of m + 2 equations, (14). Residual relative to the sum of the magnitudes "
        f"of each line's terms, six designs of Table 2; K_3 of the last is "
        f"{problem.example(2, 3).coefficients[-1]:.6f}.",
    )
    _counts(book)
    return residuals(rows)


def _series(g: int, m: int) -> tuple[float, float]:
    """Residuals of (11), coefficients of s L(s), and of (13), Re L, for a loop of Table 2."""
    loop, gains = problem.loop(g, problem.example(g, m)), problem.example(g, m).coefficients
    plain = areas.from_process(problem.process(g), 24)
    signed = areas.with_binomial_filter(plain, problem.SHORT_FILTER, m) * (-1.0) ** np.arange(24)
    printed = np.convolve(signed, gains)[:24]  # sum of (-1)^i A_iF K_(k-i), from k = -1
    # Taylor coefficients of s L(s) from its values on the circle |s| = 1/4
    circle = 0.25 * np.exp(2j * np.pi * np.arange(64) / 64)
    taylor = np.fft.fft(circle * loop.L(circle)).real[:24] / 64
    series = float(np.max(abs(taylor - printed * 0.25 ** np.arange(24))))
    # of the powers s^k those with even k are real on the axis
    w = np.array([0.05, 0.1, 0.2])
    even = np.where(np.arange(24) % 2, printed, 0.0)
    real = (np.polyval(even[::-1], 1j * w) / (1j * w)).real
    return series, relative(real, loop.L(1j * w).real)


def _on_the_line(g: int) -> list[tuple[float, float]]:
    """Frequencies at which Re L of a rival's loop passes through -1/2, and how far |T| is from 1 there."""
    loop = problem.loop(g, problem.rival(g))

    def excess(w: float) -> float:
        return float(loop.L(1j * w).real) + 0.5

    w = np.geomspace(1e-2, 1e4, 4000)
    above = loop.L(1j * w).real + 0.5
    turns = np.flatnonzero(above[1:] * above[:-1] < 0)
    found = [float(newton(excess, w[i], x1=w[i + 1], tol=1e-14, disp=False)) for i in turns]
    return [(x, abs(abs(complex(loop.T(1j * x))) - 1)) for x in found]


def _conditions(g: int, m: int) -> float:
    """Largest residual of (14) with the gains of a design of Table 2, relative to the terms of its line."""
    count, gains = problem.AREAS[m], np.array(problem.example(g, m).coefficients)
    filtered = areas.with_binomial_filter(
        areas.from_process(problem.process(g), count), problem.SHORT_FILTER, m
    )
    odd = np.convolve(filtered * (-1.0) ** np.arange(count), gains)[1:count:2]
    scale = np.convolve(filtered, abs(gains))[1:count:2]
    return float(np.max(abs(odd + 0.5 * np.eye(1, m + 2)[0]) / scale))


def _counts(book: Ledger) -> None:
    """How many areas the system needs, and when a controller is proper."""
    least = {}
    for m, listed in problem.AREAS.items():
        known = areas.from_process(problem.process(2), 14)
        enough = (count for count in range(1, 15) if solvable(known[:count], m))
        least[f"m = {m}"] = next(enough), listed
    book.statement(
        "eq16.size",
        *every(least, "=="),
        left_name="fewest areas that give the gains",
        right_name="listed in Table 1",
        note="m + 2 equations with A_0 to A_(2m+3): "
        + ", ".join(f"{n} for {m}" for m, (n, _) in least.items())
        + ".",
    )
    pairs = [(m, n) for m in range(1, 4) for n in range(5)]
    bounded = [_bounded(m, n) for m, n in pairs]
    book.statement(
        "eq1.proper",
        sum(found is (n >= m) for found, (m, n) in zip(bounded, pairs, strict=True)),
        "==",
        len(pairs),
        left_name="pairs whose gain at high frequencies is bounded just if n ≥ m",
        right_name="pairs tried",
        note=f"m from 1 to 3, n from 0 to 4: {sum(bounded)} are bounded. The library accepts as a controller "
        f"{sum(_accepted(m, n) for m, n in pairs)}, those with n ≥ m.",
    )


def _bounded(m: int, n: int) -> bool:
    """Whether the gain grows no more from 1e6 to 1e7 rad/s, with all K_i = 1 and T_F = 0.1."""
    high = [abs(np.polyval(np.ones(m + 2), s) / s / (0.1 * s + 1) ** n) for s in (1e6j, 1e7j)]
    return bool(high[1] < 2 * high[0])


def solvable(known: np.ndarray, m: int) -> bool:
    try:
        mo.gains(known, m)
    except ValueError:
        return False
    return True


def _accepted(m: int, n: int) -> bool:
    try:
        pidalab.HighOrderPID([1.0] * (m + 2), 0.1, n)
    except ValueError:
        return False
    return True
