"""Section 3: the equations from the noise to the filter time, and the two errors of (32) that cancel."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pandas as pd
import pidalab
from pidalab.ledger import CONVENTIONS, Ledger, every
from pidalab.rules import magnitude_optimum as mo
from scipy.integrate import quad
from scipy.special import beta

from . import problem
from .names import typeset
from .residuals import EXACT, relative, residuals

TS = problem.SAMPLE_TIME


@typeset
def noise_equations(book: Ledger) -> pd.DataFrame:
    """Equations (20), (25), (27) and (32): from the noise to the filter time."""
    rows = {}
    # (20): the form with reciprocals, from process and controller alone
    loop = problem.loop(1, problem.example(1, 3))
    s = np.array([1e-7j, 0.4j, 2j, 1 + 1j])
    direct = 1 / (problem.process(1)(s) + 1 / loop.block("controller", s))
    rows["(20)"] = residual = relative(direct, -loop.transfer("u", "n", s))
    book.identity(
        "eq20.form",
        residual,
        EXACT,
        note="PID_3^3 on G_P1 at four points, against the closed loop of the library; at frequency 0 it is "
        f"{abs(direct[0]):.6f} = 1/K_PR, as the controller integrates.",
    )
    rows["(25), F_k"] = residual = max(_equation_25(key) for key in problem.NOISY)
    top = problem.tuned("table5.m4").coefficients[-1]
    book.identity(
        "eq25.f",
        residual,
        EXACT,
        note="Ten designs of Tables 3 to 5 at three frequencies: F(ω²) over the filter against the magnitude "
        f"of (21) itself, with K_i = 0 beyond m; F_4 of PID_5^4 is {top**2:.6f}.",
    )
    rows["(26), (27)"] = residual = max(_equation_27(key) for key in problem.NOISY)
    edge = 1 / problem.tuned("table5.m1").filter_time
    book.identity(
        "eq27.result",
        residual,
        EXACT,
        note="Our reading of (27) is damaged, so it was derived from (26): the second integral is "
        "F_m ω_F^2n (ω_2^(2m−2n+1) − ω_F^(2m−2n+1))/(2m−2n+1) for n > m. Against quadrature of the "
        f"asymptotes, ten designs of Tables 3 to 5; ω_F from {edge:.4g} rad/s down.",
    )
    rows["(31), (32)"] = residual = max(_equation_32(key) for key in problem.NOISY)
    book.identity(
        "eq32.solve",
        residual,
        EXACT,
        note="T_F of (32) put back into (31), ten designs of Tables 3 to 5; T_F of PID_4^3 with K_HF = 10 "
        f"is {_filter_time('table3.khf10'):.6f} from its final K_3.",
    )
    rows["Fig. 5, by hand"] = residual = max(_procedure(key) for key in problem.ONCE)
    book.identity(
        "st.conclusion.analytic",
        residual,
        EXACT,
        note="Each pass of Fig. 5 is (8), (17) and (32), three formulas: written out, they give the T_F and "
        f"gains of all {len(problem.ONCE)} designs. The passes are repeated, as K_m depends on T_F.",
    )
    return residuals(rows)


def _equation_25(key: str) -> float:
    """Residual of the coefficients F_k of (25) for one design."""
    controller = problem.tuned(key)
    K = np.array([1 / problem.process(3).gain(), *controller.coefficients[2:]])
    padded, w = np.append(K, np.zeros(K.size)), np.array([0.5, 5.0, 50.0])
    F = [
        padded[k] ** 2 + 2 * sum((-1) ** (k + i) * K[i] * padded[2 * k - i] for i in range(k))
        for k in range(K.size)
    ]
    n, time = controller.filter_order, controller.filter_time
    printed = np.polyval(F[::-1], w**2) / (1 + (time * w) ** 2) ** n
    block = pidalab.HighOrderPID([0.0, *K], time, n)  # (21) as a block of the library
    magnitude = abs(problem.loop(3, block).block("controller", 1j * w)) ** 2
    return relative(printed, magnitude)


def asymptotic_power(m: int, n: int, edge: float, end: float) -> float:
    """Integral of the asymptotes (26) from 0 to `end`, for F_m = 1: (27)."""
    power = 2 * (m - n) + 1
    tail = edge ** (2 * n) * (end**power - edge**power) / power
    return edge ** (2 * m + 1) / (2 * m + 1) + tail


def _equation_27(key: str) -> float:
    """Residual of (27) for the corner of one design, against quadrature."""
    case, edge = problem.CASES[key], 1 / problem.tuned(key).filter_time
    below = quad(lambda x: x ** (2 * case.m), 0, 1)[0]
    # above the corner on a logarithmic axis, where the asymptote is smooth
    end = math.log(problem.BAND / edge)
    above = quad(lambda x: math.exp((2 * (case.m - case.n) + 1) * x), 0, end, epsabs=0, epsrel=1e-12)[0]
    measured = edge ** (2 * case.m + 1) * (below + above)
    return abs(asymptotic_power(case.m, case.n, edge, problem.BAND) / measured - 1)


def _filter_time(key: str) -> float:
    case = problem.CASES[key]
    top = problem.tuned(key).coefficients[-1]
    return mo.filter_time(top, case.m, case.n, case.wanted, problem.SAMPLE_TIME)


def _equation_32(key: str) -> float:
    """Residual of (31) with the T_F of the library."""
    case, edge = problem.CASES[key], 1 / _filter_time(key)
    top = problem.tuned(key).coefficients[-1] ** 2
    if case.n == case.m:
        return abs(top * edge ** (2 * case.m) / case.wanted**2 - 1)
    both = 1 / (2 * case.m + 1) + 1 / (2 * (case.n - case.m) - 1)
    return abs(top * edge ** (2 * case.m + 1) * both / (case.wanted**2 * problem.BAND) - 1)


def _procedure(key: str) -> float:
    """Residual of the design by (8), (17) and (32) written out, against the library's."""
    g, m, n, wanted = problem.CASES[key]
    plain, time = problem.plain_areas(g)[: 2 * m + 4], problem.FIRST
    for _ in range(problem.UPDATES + 1):
        last = time
        K = problem.written_out(plain, m, n, last)
        ratio = abs(K[-1]) / wanted
        if n == m:
            time = ratio ** (1 / m)
        else:
            both = 1 / (2 * m + 1) + 1 / (2 * (n - m) - 1)
            time = (ratio**2 * both / problem.BAND) ** (1 / (2 * m + 1))
    made = problem.tuned(key)
    return relative([last, *K], [made.filter_time, *made.coefficients])


@cache
def powers(key: str) -> dict[str, float]:
    """Noise of a design up to omega_S, rms: by (20), (21) and (26); and how it is spread."""
    C, P = problem.tuned(key), problem.process(3)
    w = np.linspace(1e-6, problem.BAND, 200001)
    by_20 = abs(pidalab.Loop(P, C).transfer("u", "n", 1j * w)) ** 2
    K, T, n, m = np.array([1.0, *C.coefficients[2:]]), C.filter_time, C.filter_order, problem.CASES[key].m
    by_21 = abs(np.polyval(K[::-1], 1j * w)) ** 2 / (1 + (T * w) ** 2) ** n
    by_26 = C.coefficients[-1] ** 2 * asymptotic_power(m, n, 1 / T, problem.BAND)
    total = np.trapezoid(by_20, w)
    low = np.trapezoid(by_20[w <= 1 / T], w[w <= 1 / T])
    return {
        "(20)": math.sqrt(total / problem.BAND),
        "(21)": math.sqrt(np.trapezoid(by_21, w) / problem.BAND),
        "(26)": math.sqrt(by_26 / problem.BAND),
        "below": low,
        "above": total - low,
        "corner": 1 / T,
    }


@typeset
def estimate(book: Ledger) -> pd.DataFrame:
    """How (32) estimates the noise: each of its steps, for the designs of Tables 3 to 5."""
    found = {str(problem.CASES[key]): powers(key) for key in problem.NOISY}
    closest = max(abs(one["(21)"] / one["(20)"] - 1) for one in found.values())
    book.statement(
        "eq21.close",
        *every({name: (one["(21)"], one["(20)"]) for name, one in found.items()}, "within", "similar"),
        left_name="rms noise up to ω_S by (21)",
        right_name="by (20)",
        note=f"By at most {100 * closest:.1f} %.",
    )
    book.statement(
        "eq26.close",
        *every({name: (one["(20)"], one["(26)"]) for name, one in found.items()}, "within", "similar"),
        left_name="rms noise up to ω_S by (20)",
        right_name="by (26)",
        note="Exact over simplified: "
        + "; ".join(f"{one['(20)'] / one['(26)']:.2f} ({name})" for name, one in found.items())
        + ". At ω = 1/T_F the filter leaves 2^−n of the power, the asymptotes all of it.",
    )
    less = {name: (one["below"], one["above"]) for name, one in found.items()}
    yes = sum(CONVENTIONS["much"].limit * low <= high for low, high in less.values())
    book.statement(
        "st.lowband",
        len(less) - yes,
        "<",
        yes,
        left_name="designs whose noise power below ω_F is not much smaller than above",
        right_name="in which it is",
        note="Share below ω_F: "
        + "; ".join(f"{100 * (a / (a + b)):.0f} % ({name})" for name, (a, b) in less.items())
        + ".",
    )
    book.statement(
        "eq29.ratio",
        *every({name: (one["corner"], problem.BAND) for name, one in found.items()}, "<", "negligible"),
        left_name="ω_F",
        right_name="ω_S",
        note=f"From {min(problem.BAND / x['corner'] for x in found.values()):.0f} to "
        f"{max(problem.BAND / x['corner'] for x in found.values()):.0f} times.",
    )
    rows = {
        str(problem.CASES[key]): {
            "(20) / (26)": f"{powers(key)['(20)'] / powers(key)['(26)']:.2f}",
            "(21) / (20)": f"{powers(key)['(21)'] / powers(key)['(20)']:.4f}",
            "below ω_F": f"{100 * (powers(key)['below'] / (powers(key)['below'] + powers(key)['above'])):.0f} %",
            "ω_S T_F": f"{problem.BAND / powers(key)['corner']:.0f}",
            "σ_rel / K_HF": f"{problem.noise(key) / problem.CASES[key].wanted:.2f}",
        }
        for key in problem.NOISY
    }
    return pd.DataFrame(rows).T


def sigma(controller: pidalab.HighOrderPID) -> float:
    """Expected noise gain on G_P3."""
    return pidalab.noise_gain(problem.loop(3, controller), TS)


@cache
def by_beta(n: int) -> pidalab.HighOrderPID:
    """PID_n^3 for a noise gain of 10 with the exact integral of the highest term in (32): a beta function."""
    T, bracket = 0.1, beta(3.5, n - 3.5)
    for _ in range(30):
        C = problem.pid(mo.tune(problem.plain_areas(3)[:10], 3, n, T))
        T = (C.coefficients[-1] ** 2 * bracket / (100 * problem.BAND)) ** (1 / 7)
    return C


@typeset
def equal_noise(book: Ledger) -> pd.DataFrame:
    """Table 4 once more, with T_F from the exact noise gain."""
    made = {n: problem.exact_noise(3, 3, n, 10.0) for n in (3, 4, 5, 6)}
    wide = {n: problem.exact_noise(3, 3, n, 10.0, TS / 2) for n in made}  # noise up to 2 pi / T_S
    book.statement(
        "st.table4.cause",
        *every({f"n = {n}": (sigma(C), 10.0) for n, C in made.items()}, "within", "similar"),
        left_name="σ_rel with T_F from the exact integral of (21)",
        right_name="K_HF",
        note=f"σ_rel {', '.join(f'{sigma(C):.2f}' for C in made.values())} for n = 3 to 6; K_-1 is then "
        f"{', '.join(f'{C.coefficients[0]:.3f}' for C in made.values())}.",
    )
    book.statement(
        "eq28.shannon",
        *every({f"n = {n}": (sigma(wide[n]), 10.0) for n in (4, 5, 6)}, "within", "similar"),
        left_name="σ_rel with T_F from the exact integral up to ω_S",
        right_name="K_HF",
        note=f"The theorem, named just before, gives π/T_S; the paper selects twice that. σ_rel {sigma(wide[4]):.1f}, "
        f"{sigma(wide[5]):.1f} and {sigma(wide[6]):.1f} for n = 4, 5 and 6, about √2 too much; with n = m, where noise "
        f"passes at all frequencies, {sigma(wide[3]):.1f}.",
    )
    rows = {}
    for n, C in made.items():
        before = problem.tuned(f"table4.n{n}")
        rows[f"PID_{n}^3"] = {
            "T_F, Table 4": f"{before.filter_time:.3f}",
            "K_-1": f"{before.coefficients[0]:.3f}",
            "σ_rel": f"{sigma(before):.2f}",
            "T_F, exact": f"{C.filter_time:.4f}",
            "K_-1, exact": f"{C.coefficients[0]:.3f}",
            "σ_rel, exact": f"{sigma(C):.2f}",
            "σ_rel, beta": f"{sigma(by_beta(n)):.2f}" if n > 3 else "–",
            "σ_rel, band 2π/T_S": f"{sigma(wide[n]):.2f}",
        }
    return pd.DataFrame(rows).T
