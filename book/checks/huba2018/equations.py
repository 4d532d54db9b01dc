"""Equations (2) to (15) of huba2018, each against the loops that the library closes with the rule's numbers."""

import math

import numpy as np
import pandas as pd
import pidalab
from numpy.typing import NDArray
from pidalab._check import Array
from pidalab.ledger import Ledger, every
from pidalab.rules import mrdp

from .designs import CANCELLED, GRID, ORDERS, constants, ruled, ruled_step, unit

POINTS = np.array([0.3 + 0.2j, 1j, -0.5 + 2j, 3.0 - 1j])  # of the complex plane, where formulas are compared
VANISHES = 1e-9  # a derivative below this share of its largest term is rounding


def residual(left: Array, right: Array) -> float:
    """Largest relative deviation of two arrays."""
    return float(np.max(np.abs(left - right) / np.abs(right)))


def polynomial(m: int, s: Array) -> Array:
    """1 + T_i s + T_i T_D1 s² + … as it stands in eqs (3), (4) and (8), with the constants of a unit T_d."""
    one = constants(m)
    terms = [time * s ** (j + 1) for j, time in enumerate((1.0, *one.derivative_times))]
    return 1 + one.integral_time * np.sum(terms, axis=0)


def forms(book: Ledger) -> pd.DataFrame:
    """Eqs (2) to (4): controller and closed loop of the library against the printed forms."""
    worst = dict.fromkeys(("eq2.forms", "eq3.wy", "eq3.dy", "eq4.denominator"), 0.0)
    for m, n in GRID:
        one, d = constants(m), mrdp.tune(pidalab.ipdt(1.0, delay=0.75), m, n, te=0.25)  # so T_d is 1
        s, kc, ti = POINTS, one.gain, one.integral_time
        Q = (d.filter_time * s + 1) ** -n
        loop = pidalab.Loop(d.model, d.controller)
        first = kc * (
            (1 + ti * s) / (ti * s) + sum(x * s**j for j, x in enumerate(one.derivative_times, start=1))
        )
        # with the filter, e^{T_d s} of eqs (3) and (4) becomes e^{T_dm s}/Q
        quasi = ti * s**2 * np.exp(0.75 * s) / Q + kc * polynomial(m, s)
        pairs = {
            "eq2.forms": (loop.block("controller", s) / Q, first),
            "eq3.wy": (loop.transfer("y", "r", s), kc * polynomial(m, s) / quasi),
            "eq3.dy": (loop.transfer("y", "d", s), ti * s / Q / quasi),
            "eq4.denominator": (ti * s**2 * np.exp(0.75 * s) / Q / loop.S(s), quasi),
        }
        worst |= {name: max(worst[name], residual(*pair)) for name, pair in pairs.items()}
    points = "At points of the complex plane, for m from 0 to 4 and n up to 6"
    notes = {
        "eq2.forms": f"{points}, the filter divided out. The relations between the parameters are understood, "
        "not printed.",
        "eq3.wy": f"{points}, with a filter: its inverse then stands beside e^{{T_d s}}.",
        "eq3.dy": f"{points}, with a filter: its inverse then stands beside e^{{T_d s}} and in the numerator.",
        "eq4.denominator": f"{points}, with a filter: its inverse then stands beside e^{{T_d s}}.",
    }
    for name, value in worst.items():
        book.identity(name, value, note=notes[name])
    shown = {id: "below 1e-9" if value <= VANISHES else f"{value:.0e}" for id, value in worst.items()}
    return pd.Series(shown, name="largest relative deviation").to_frame()


def derivatives(m: int) -> list[float]:
    """Derivatives 0 to m + 3 of x² e^x + N(x) at x_o, each as a share of its largest term."""
    one, found = constants(m), []
    for k in range(m + 4):
        terms = [
            math.exp(one.pole) * c * one.pole**power
            for c, power in zip((1, 2 * k, k * (k - 1)), (2, 1, 0), strict=True)
        ]
        tail = np.polyder(one.numerator, k)
        terms += list(tail * one.pole ** np.arange(tail.size)[::-1])
        found.append(abs(math.fsum(terms)) / max(map(abs, terms)))
    return found


def multiplicity(book: Ledger) -> pd.DataFrame:
    """Eqs (5) and (6): how many derivatives of the quasi-polynomial vanish at the dominant pole."""
    shares = {m: derivatives(m) for m in ORDERS}
    book.identity(
        "eq5.system",
        max(max(row[:-1]) for row in shares.values()),
        note="For m from 0 to 4, each derivative as a share of its largest term: m + 3 conditions for the m + 2 "
        "parameters and s_o.",
    )
    counted = {m: next(k for k, share in enumerate(row) if share > VANISHES) for m, row in shares.items()}
    book.statement(
        "eq5.multiplicity",
        *every({f"m = {m}": (count, m + 2) for m, count in counted.items()}, "=="),
        left_name="derivatives that vanish",
        right_name="m + 2",
        note="The text counts m + 2, which is the number of parameters; s_o is determined by one more condition, "
        f"and eq. (5) itself lists them. For m from 0 to 4 the first {', '.join(map(str, counted.values()))} "
        "derivatives vanish. So two poles remain at s_o, not one, when m + 1 are cancelled.",
    )
    # what is left of derivative m + 2, whose polynomial part is gone: its zero nearest to 0
    nearest = [np.roots([1, 2 * (m + 2), (m + 2) * (m + 1)]).max() for m in ORDERS]
    book.identity(
        "eq6.pole",
        residual(np.array([constants(m).pole for m in ORDERS]), np.array(nearest)),
        note="Derivative m + 2 of x² e^x leaves x² + 2(m+2)x + (m+2)(m+1) = 0. p_o is the root nearest to 0; "
        "−(m+2) − √(m+2) is the other one.",
    )
    cells = {
        f"m = {m}": {
            f"derivative {k}": f"{share:.2f}" if share > VANISHES else "0" for k, share in enumerate(row)
        }
        for m, row in shares.items()
    }
    return pd.DataFrame(cells).fillna("–")


def dominance(book: Ledger) -> pd.DataFrame:
    """Eq. (5): whether anything lies to the right of the multiple pole in the loop without filter."""
    counts = {f"m = {m}": (_poles_right_of(m, constants(m).pole + 0.1), 0) for m in (0, 1)}
    book.statement(
        "eq5.dominant.low",
        *every(counts, "=="),
        left_name="poles to the right",
        right_name="none",
        note="Counted by the argument principle, to the right of s_o + 0.1/T_d: rounding spreads a multiple zero, "
        "and the count must not hang on it.",
    )
    tails = {m: far_poles(m) for m in (2, 3, 4)}
    rightmost = {m: x[np.argmax(x.real > constants(m).pole)] for m, x in tails.items()}
    book.statement(
        "eq5.dominant.high",
        *every({f"m = {m}": (float(x.real.max()), constants(m).pole) for m, x in tails.items()}, "<="),
        left_name="real part of another pole",
        right_name="s_o, both times T_d",
        note="Without filter the loop is then of advanced type, with infinitely many poles to the right of any "
        f"line. Such a pole for m = 2, 3, 4: {', '.join(f'{x:.3f}' for x in rightmost.values())}, in units of "
        "1/T_d. The filter makes the number finite.",
    )
    rows = {
        f"m = {m}": {
            "multiple pole": f"{constants(m).pole:.3f}",
            "a pole to the right": f"{x:.3f}",
        }
        for m, x in rightmost.items()
    }
    return pd.DataFrame(rows).T


def _poles_right_of(m: int, border: float) -> float:
    """Count zeros of x² e^x + N(x) to the right of a border: unstable poles of the loop with the axis moved there."""
    x = np.poly1d([1.0, border])
    num = np.poly1d(constants(m).numerator)(x) * math.exp(-border)
    moved = pidalab.Process(num.coef, (x**2).coef, delay=1.0)
    return pidalab.unstable_poles(pidalab.Loop(moved, 1.0))


def far_poles(m: int, count: int = 40) -> NDArray[np.complexfloating]:
    """Zeros of x² e^x + N(x) above the real axis, one for each turn of the phase, from the second on."""
    turns = 2j * math.pi * np.arange(2, count + 2)
    x = turns.copy()
    for _ in range(60):  # a contraction: the logarithm changes little from turn to turn
        x = np.log(-np.polyval(constants(m).numerator, x) / x**2) + turns
    return x


def filter_pole(book: Ledger) -> pd.DataFrame:
    """Eqs (8) to (11): the multiple pole of the loop with filter and pure integrator."""
    characteristic = 0.0
    for m, n in GRID:
        d = mrdp.tune(pidalab.ipdt(1.0, delay=0.0), m, n, te=1.0)  # T_d is 1, and there is no dead time
        right = d.ti * POINTS**2 * (1 + d.filter_time * POINTS) ** n + d.kc * polynomial(m, POINTS)
        left = (
            d.ti
            * POINTS**2
            * (1 + d.filter_time * POINTS) ** n
            / pidalab.Loop(d.model, d.controller).S(POINTS)
        )
        characteristic = max(characteristic, residual(left, right))
    book.identity(
        "eq8.characteristic",
        characteristic,
        note="As read, an ellipsis stands between the two terms. Nothing is missing there: it marks the break of "
        "the line.",
    )
    taylor = {key: _taylor(*key) for key in GRID}
    strict = {key: one for key, one in taylor.items() if key[1] > key[0]}
    book.identity(
        "eq9.root",
        max(abs(rest[0]) / max(abs(rest)) for rest, _ in strict.values()),
        note="For m from 0 to 4 and n from m + 1 to 6 it solves the condition that derivative m + 2 of s²(1 + T_f "
        "s)^n vanishes, and the multiplicity is m + 3, as for eq. (4).",
    )
    others = {
        key: float(np.roots(rest[:0:-1]).real.max()) for key, (rest, _) in strict.items() if rest.size > 2
    }
    book.statement(
        "eq9.dominant",
        *every(
            {f"m = {m}, n = {n}": (taylor[m, n][1] + x, taylor[m, n][1]) for (m, n), x in others.items()}, "<"
        ),
        left_name="real part of another zero, in 1/T_f",
        right_name="s_n",
        note=f"For m from 0 to 4 and n up to 6 the other zeros lie at least {-max(others.values()):.2f}/T_f to the "
        "left.",
    )
    places = {(m, n): _pole_of_filter(m, n) / mrdp.filter_ratio(m, n) for m, n in GRID}
    book.identity(
        "eq11.equivalent",
        max(abs(x / constants(m).pole - 1) for (m, _), x in places.items()),
        note="For m from 0 to 4 and n from max(m, 1) to 6, s_n of eq. (9) with T_f of eq. (11) is s_o of eq. (6) "
        "with T_d = T_e.",
    )
    cells = {
        f"n = {n}": {f"m = {m}": f"{x:.6f}" for (m, k), x in places.items() if k == n} for n in range(1, 7)
    }
    return pd.DataFrame(cells).fillna("–")


def _pole_of_filter(m: int, n: int) -> float:
    """Eq. (9) with T_f = 1."""
    return (math.sqrt((m + 2) * (n + 1) * (n - m)) - (m + 2) * (n + 1)) / ((n + 1) * (n + 2))


def _taylor(m: int, n: int) -> tuple[Array, float]:
    """Taylor coefficients of s² (s + 1)^n at its pole of the rule, from the power m + 2 on; and that pole."""
    s_n = mrdp.filter_ratio(m, n) * constants(m).pole
    shifted = np.poly1d([1.0, s_n])
    return (shifted**2 * (shifted + 1) ** n).coef[::-1][m + 2 :], s_n


def cancelled(book: Ledger) -> pd.DataFrame:
    """Eqs (13) to (15): what the prefilter cancels, and the integral of the error that is left."""
    worst, slope, rows = 0.0, 0.0, {}
    for m, p in CANCELLED:
        d = mrdp.tune(unit(), m, m + 1, te=0.5, cancelled=p)
        loop, s = d.loop(), POINTS
        zeros = loop.block("controller", s) * d.ti * s * (1 + d.filter_time * s) ** d.n / d.kc
        worst = max(worst, residual(loop.block("prefilter", s), (1 - s / d.pole) ** p / zeros))
        # the slope of the error at s = 0; the even terms of its series drop out of the real part
        slight = 1e-6j
        ie = float((loop.transfer("e", "r", slight) / slight).real)
        slope = max(slope, abs(ie / d.ie - 1))
        rows[m, p] = f"{ie:.4f}"
    book.identity(
        "eq14.cancel",
        worst,
        note="For m from 0 to 4 and p from 1 to m + 1: the zeros of F_p are p times s_o, and its poles are the "
        "zeros of F_wy, so F_p F_wy keeps m + 3 − p poles at s_o.",
    )
    simulated = {f"m = {m}, n = {n}": (ruled_step(1.5, m, n).ie(), ruled(1.5, m, n).ie) for m, n in GRID}
    apart = max(slope, *(abs(found / ie - 1) for found, ie in simulated.values()))
    found, ie = simulated["m = 2, n = 4"]
    book.statement(
        "eq15.ie",
        found * (1 + apart),
        "<=",
        ie * (1 + VANISHES),
        left_name="IE_s simulated, m = 2, n = 4, and the largest deviation of all loops",
        right_name="eq. (15) and rounding",
        note="No more than rounding lies between them, by the slope of the transfer function at s = 0 for m from 0 "
        "to 4 and every p, and by simulation of the loops of Fig. 2. The filter does not enter.",
    )
    cells = {f"p = {p}": {f"m = {m}": rows.get((m, p), "–") for m in ORDERS} for p in range(1, 6)}
    return pd.DataFrame(cells)


def other_zero() -> pd.DataFrame:
    """Gain of the rule at the other zero of its condition, farther from the origin."""
    rows = {}
    for m in ORDERS:
        mu, a = -math.sqrt(m + 2), m + 2 + math.sqrt(m + 2)
        rows[f"m = {m}"] = {
            "gain Kₒ": constants(m).gain,
            "at the other zero": mu * a ** (m + 1) * math.exp(-a) / math.factorial(m),
        }
    return pd.DataFrame(rows).T.round(4)
