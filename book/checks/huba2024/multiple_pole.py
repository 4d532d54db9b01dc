"""Section 2.2 of huba2024: the multiple pole, eqs. (12) to (22) and Table 1."""

from __future__ import annotations

import math
from functools import cache

import mpmath
import numpy as np
import pandas as pd
import pidalab
from pidalab.ledger import Display, Ledger, every
from pidalab.rules import automatic_reset as ar, mrdp

from . import loops
from .tables import tabled

ROUNDING = 1e-9


def _settings() -> tuple[ar.Setting, ...]:
    return loops.pi(), loops.pid(), loops.pida()


def equations(book: Ledger) -> None:
    """The numbers of (15) to (19)."""
    for eq, pole, one in (
        ("eq15", "eq15", loops.pi()),
        ("eq16", "eq16", loops.pid()),
        ("eq18", "eq17", loops.pida()),
    ):
        book.check({f"{pole}.s0": -1 / one.lag, f"{eq}.kp": one.kp, f"{eq}.ti": one.ti})
    book.check("eq16.td", loops.pid().times[0])
    product_of = book.printed("eq16.kp") * book.printed("eq16.td")
    book.check(
        "eq16.kd",
        product_of,
        note="The product K_p T_D of the printed, rounded factors, as eq. (16) writes it: "
        f"{product_of:.5f}. The gain of "
        f"the multiple pole is (√3 − 1)e^(√3 − 3) = {loops.pid().kd:.5f}, see eq16.kd.rule.",
    )
    book.statement(
        "eq16.kd.rule",
        abs(loops.pid().kd - book.printed("eq16.kd")),
        "<=",
        book.row("eq16.kd").half_unit,
        left_name="distance from 0.2062",
        right_name="half a unit of its last place",
        note=f"K_d of the multiple pole is {loops.pid().kd:.5f}; 0.2062 is the product of two "
        "rounded factors, see eq16.kd.",
    )
    book.check({"eq18.kd": loops.pida().kd, "eq18.ka": loops.pida().ka})
    book.check({"eq19.td": loops.pida().times[0], "eq19.ta2": loops.pida().times[1]})


def table_1(book: Ledger) -> Display:
    """Table 1. Its zeros are there by construction and are settled by reading."""
    for m, one in enumerate(_settings()):
        book.check({f"table1.m{m}.tau0": one.lag, f"table1.m{m}.kappa": one.kp, f"table1.m{m}.tau_i": one.ti})
        if m:
            book.check(f"table1.m{m}.tau_d", one.times[0])
    book.check("table1.m2.tau_a", loops.pida().times[1])
    pairs = {f"m = {m + 1} and {m}": (_settings()[m + 1].lag, _settings()[m].lag) for m in (0, 1)}
    book.statement("table1.tau0.shorter", *every(pairs, "<"), left_name="τ_0", right_name="τ_0 before")
    ratios = {f"m = {m}": (one.lag, one.ti) for m, one in enumerate(_settings()) if m != 1}
    book.statement(
        "table1.tau0.reset",
        *every(ratios, "<", "clearly"),
        left_name="τ_0",
        right_name="τ_i",
        note=f"τ_i/τ_0 is {loops.pi().ti / loops.pi().lag:.2f} for m = 0 and "
        f"{loops.pida().ti / loops.pida().lag:.2f} for m = 2; "
        f"for m = 1 it is {loops.pid().ti / loops.pid().lag:.2f}.",
    )
    return book.table("table1.")


def _derivatives(m: int, count: int) -> tuple[list[mpmath.mpf], mpmath.mpf]:
    """Taylor coefficients of A/T_i at the pole of (14), for the library's gains, and their size."""
    constants = mrdp.constants(m)
    pole, gains = mpmath.mpf(constants.pole), constants.numerator
    found = mpmath.taylor(lambda p: p**2 * mpmath.exp(p) + mpmath.polyval(gains, p), pole, count)
    return found, mpmath.polyval([abs(c) for c in gains], abs(pole))


@tabled
def conditions(book: Ledger) -> pd.DataFrame:
    """Eqs. (12) to (14): the pole is multiple, as often as there are unknowns."""
    last, all_of, then, rank = {}, {}, {}, {}
    for m in range(9):
        taylor, size = _derivatives(m, m + 3)
        last[m] = abs(float(taylor[m + 2] / size))
        all_of[m] = max(abs(float(x / size)) for x in taylor[: m + 3])
        then[m] = abs(float(taylor[m + 3]))
    book.identity(
        "eq14.pole",
        max(last.values()),
        ROUNDING,
        note="For m from 0 to 8, with the library's gains. Derivative m + 2 of eq. (13) leaves "
        "x² + 2(m+2)x + (m+2)(m+1) = 0 with x = T_d s; the other root is farther left.",
    )
    for m, one in enumerate(_settings()):
        product_of = np.convolve([one.ka, one.kd, one.kp], [one.ti, 1.0]) / one.ti
        gains = np.array(mrdp.constants(m).numerator)
        all_of[m] = max(all_of[m], float(np.max(np.abs(product_of[-gains.size :] - gains)) / np.max(gains)))
        rank[f"m = {m}"] = (_rank(m, one), m + 3)
    book.identity(
        "eq12.system",
        max(all_of[m] for m in range(3)),
        ROUNDING,
        note="For m = 0, 1, 2. The next derivative is not zero, so the pole has multiplicity m + "
        "3 and not more. T_i of "
        f"eq. (15) is {loops.pi().ti:.4f}, not the printed closed form.",
    )
    book.statement(
        "eq12.unknowns",
        *every(rank, "=="),
        left_name="rank of the conditions in K_p, K_d, K_a, T_i and s_0",
        right_name="m + 3",
    )
    book.identity("eq17.t0", abs(loops.pida().lag / 0.5 - 1), ROUNDING)
    book.identity(
        "eq17.derivative",
        last[2],
        ROUNDING,
        note="Order 4 is m + 2 for m = 2. The polynomial of eq. (13) has degree 3 and drops out; (x² + 8x + 12)e^x is "
        "left, with the roots −2 and −6.",
    )
    return pd.DataFrame(
        {
            f"m = {m}": {"all m + 3 conditions": f"{all_of[m]:.0e}", "the next": f"{then[m]:.3g}"}
            for m in range(9)
        }
    ).T


def _rank(m: int, one: ar.Setting) -> int:
    """Rank of the Jacobian of (12) in the m + 3 unknowns of the series controller."""
    unknowns = [*(one.kp, one.kd, one.ka)[: m + 1], one.ti, -1 / one.lag]

    def residuals(*x: mpmath.mpf) -> list[mpmath.mpf]:
        gains, ti, pole = x[: m + 1], x[-2], x[-1]
        numerator = lambda s: mpmath.polyval(list(gains[::-1]), s) * (1 + ti * s)  # noqa: E731
        coefficients = mpmath.taylor(lambda s: s**2 * ti * mpmath.exp(s) + numerator(s), pole, m + 2)  # type: ignore[no-untyped-call]
        return [c * mpmath.factorial(i) for i, c in enumerate(coefficients)]

    step, base = mpmath.mpf("1e-7"), [mpmath.mpf(x) for x in unknowns]
    columns = []
    for i in range(m + 3):
        up, down = ([x + sign * step * (i == j) for j, x in enumerate(base)] for sign in (1, -1))
        columns.append(
            [float((a - b) / (2 * step)) for a, b in zip(residuals(*up), residuals(*down), strict=True)]
        )
    return int(np.linalg.matrix_rank(np.array(columns), tol=1e-4))


def closed_forms(book: Ledger) -> None:
    """The closed forms of (15), and (18) against (19)."""
    root = math.sqrt(2)
    book.identity("eq15.s0.form", abs((root - 2) * loops.pi().lag + 1), ROUNDING)
    book.identity("eq15.kp.form", abs(2 * (root - 1) * math.exp(root - 2) / loops.pi().kp - 1), ROUNDING)
    form = (root - 1) / (10 * root - 14)
    book.identity(
        "eq15.ti.form",
        abs(form / loops.pi().ti - 1),
        ROUNDING,
        note=f"As read. (√2 − 1)/(10√2 − 14) is {form:.4f}, half the number printed beside it. Eq. (12) gives "
        "K_p/T_i = (10√2 − 14)e^(√2 − 2), and with the printed K_p this is T_i = 2(√2 − 1)/(10√2 − 14) = 3 + 2√2 = "
        f"{loops.pi().ti:.4f}. A factor of 2 may be lost in the reading.",
    )
    total = loops.designs()["MRDP-PIDA"].delay
    left = book.printed("eq18.ka") / total / (book.printed("eq18.kp") / total)
    right = book.printed("eq19.ta2") * total**2
    book.statement(
        "eq18.ka.dimension",
        left,
        "within",
        right,
        convention="similar",
        left_name="K_a/K_p of (18) as printed, T_d = 1.8",
        right_name="T_A² of (19)",
        note="With K_a = 0.0451/(T_d K_s), as read, K_a/K_p does not have the unit of T_A², and with "
        f"T_d = {total:g} it is {left:.4f} where eq. (19) gives {right:.4f}. Eqs (25), (30) and (31) have T_d in the "
        "numerator, and 0.0451 T_d/K_s agrees. A symbol would have to change its place, which no lost or misread "
        "character does. With T_d = 1 both agree.",
    )


@cache
def _zeros(m: int) -> np.ndarray:
    return np.array([complex(z) for z in mpmath.polyroots(mrdp.constants(m).numerator, 800, extraprec=400)])


@tabled
def zeros(book: Ledger) -> pd.DataFrame:
    """Sections 1 and 2.2: the zeros of the controller and which of them the reset takes."""
    fastest = {m: min(_zeros(m), key=lambda z: z.real) for m in range(1, 9)}
    fits = sum((abs(z.imag) > 1e-9) == (m % 2 == 0) for m, z in fastest.items())
    book.statement(
        "st.intro.even",
        fits,
        "==",
        len(fastest),
        left_name="degrees m from 1 to 8 whose fastest zero is complex just if m is even",
        right_name="all of them",
        note="; ".join(
            f"m = {m}: {z.real:.3f}" + f" ± {abs(z.imag):.3f}j" * (m % 2 == 0) for m, z in fastest.items()
        )
        + ", in units of 1/T_d. Odd m from 3 on have complex pairs too, but slower ones. For m = "
        "0 the only zero is real.",
    )
    gains = {f"m = {m}": (min(mrdp.constants(m).numerator), 0) for m in range(9)}
    book.statement(
        "st.intro.m7",
        *every(gains, ">"),
        left_name="smallest gain of the parallel form",
        note="For m from 0 to 8 the pole of eq. (14) solves eq. (12), see eq14.pole, and all gains are positive.",
    )
    pid = sorted(-1 / z.real for z in _zeros(1))
    book.statement(
        "eq16.smallest",
        loops.pid().ti,
        "<",
        pid[1],
        left_name="T_i/T_d",
        right_name="the other time constant",
    )
    pair = -1 / float(fastest[2].real)
    taken = {"PID": (loops.pid().ti, pid[1]), "PIDA": (ar.double_zero().ti, loops.pida().ti)}
    book.statement(
        "st.abstract.reset",
        *every(taken, "<"),
        left_name="T_i",
        right_name="the other time constant",
        note=f"PID: {loops.pid().ti:.4f} T_d against {pid[1]:.4f} T_d. PIDA_1: {ar.double_zero().ti:.4f} "
        "T_d, from the real part of "
        f"the complex zeros ({pair:.4f}), against {loops.pida().ti:.4f} T_d.",
    )
    smaller = {
        "T_i": (loops.pid().ti, loops.pi().ti),
        "K_p": (loops.pid().kp, loops.pi().kp),
    }
    book.statement("eq16.reset", *every(smaller, "<"), left_name="PID", right_name="PI")
    return pd.DataFrame(
        {m: {"zeros times T_d": ", ".join(f"{z:.3f}" for z in _zeros(m))} for m in range(1, 5)}
    ).T


@tabled
def dominance(book: Ledger) -> pd.DataFrame:
    """Where the multiple pole is the rightmost: argument principle for PI and PID, one pole found for PIDA."""
    right = {}
    for m in (0, 1):
        constants = mrdp.constants(m)
        line = constants.pole + 0.02 + 1j * np.linspace(-400, 400, 800001)
        f = 1 + np.polyval(constants.numerator, line) * np.exp(-line) / line**2
        turns = np.sum(np.angle(f[:-1] / f[1:])) / (2 * np.pi)
        right[f"m = {m}"] = (round(float(turns)) + 2, 0)
    book.statement("eq14.dominant.low", *every(right, "=="), left_name="poles to the right of s_0")
    gains = mrdp.constants(2).numerator
    far = mpmath.findroot(lambda p: p**2 * mpmath.exp(p) + mpmath.polyval(gains, p), mpmath.mpc(0.08, 23.2))
    own = loops.designs()["MRDP-PIDA"].loop()
    book.statement(
        "eq14.dominant.high",
        float(far.real),
        "<=",
        mrdp.constants(2).pole,
        left_name="real part of a pole, times T_d",
        right_name="s_0 T_d",
        note="The loop without filter is of advanced type, with infinitely many poles to the right of s_0; one lies at "
        f"{float(far.real):.4f} + {float(far.imag):.4f}j, in units of 1/T_d, so it is unstable. With the filter of the "
        f"paper the loop of Paper Fig. 3 has {pidalab.unstable_poles(own)} unstable poles.",
    )
    return pd.DataFrame({"poles to the right of s_0": {m: str(found) for m, (found, _) in right.items()}})
