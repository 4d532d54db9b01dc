"""Sections 1 to 2.1 of huba2024: automatic reset, its equivalence with the parallel form, and the filter."""

from __future__ import annotations

import mpmath
import numpy as np
import pandas as pd
import pidalab
from pidalab.ledger import Ledger, every
from pidalab.rules import automatic_reset as ar

from . import loops
from .tables import tabled

ROUNDING = 1e-9


def _points() -> np.ndarray:
    rng = np.random.default_rng(2024)
    return rng.normal(size=20) + 1j * rng.normal(size=20)


def _apart(left: object, right: object) -> float:
    """Largest relative difference of two formulas."""
    left, right = np.asarray(left), np.asarray(right)
    return float(np.max(np.abs(left - right)) / np.max(np.abs(right)))


def closed_loop(book: Ledger) -> None:
    """Eqs. (2) to (6), (13) and (20): the linear loop, against the library's controller, process and prefilter."""
    s, own = _points(), loops.designs()["PIDA_1"]
    c = loops.series("PIDA_1")
    stabiliser = c.kp + c.kd * s + c.ka * s**2
    delay = loops.plant().delay
    unfiltered = c.transfer_function()(s) * (c.filter_time * s + 1) ** c.filter_order
    reset = 1 / (1 + c.ti * s)
    book.identity("eq5.series", _apart(stabiliser / (1 - reset), unfiltered), ROUNDING)
    book.identity(
        "eq5.numerator",
        _apart(unfiltered / (1 - reset), unfiltered),
        ROUNDING,
        note="As read. The numerator is R_p: eq. (5) would otherwise ask for F_R = 0, and its last expression is "
        "R_p/(1 − F_R). A subscript may be lost in the reading.",
    )
    forward = unfiltered * loops.plant()(s)
    numerator = stabiliser * (1 + c.ti * s)
    characteristic = s**2 * c.ti * np.exp(delay * s) + numerator
    book.identity("eq6.closed", _apart(numerator / characteristic, forward / (1 + forward)), ROUNDING)
    book.identity("eq13.characteristic", _apart(characteristic, numerator * (1 + 1 / forward)), ROUNDING)
    book.identity("eq20.zeros", _apart(own.prefilter(s) * numerator, np.full(s.size, c.kp)), ROUNDING)
    only = pidalab.SeriesPIDA(c.kp, 0.0, 0.0, c.ti, c.filter_time, c.filter_order)
    plain = pidalab.PIDA(c.kp, c.ti)(s) / (c.filter_time * s + 1) ** c.filter_order
    book.identity("eq6.pi", _apart(only(s), plain), ROUNDING)


def load_equation(book: Ledger) -> None:
    """The sentence after (2): y' = K_s u + d_i as read, against the library's integrator with a load."""
    gain, delay, h = 2.0, 1.0, 0.01
    t, load = loops.clock(5.0, h), 0.3
    loop = pidalab.Loop(pidalab.ipdt(gain, delay=delay), 0.1)
    r = pidalab.simulate_sampled(loop, t, 1.0, load)
    late = round(delay / h)
    slope, u = np.diff(r.y)[2 * late :] / h, r.u[late : -late - 1]
    book.identity(
        "eq2.disturbance",
        float(np.max(np.abs(slope - (gain * u + load)))),
        ROUNDING,
        note=f"As read. The next line reconstructs d_i as y'/K_s − u. In a simulation with K_s = {gain:g} and the load "
        f"{load} at the input of the process, the printed equation leaves "
        f"{np.max(np.abs(slope - gain * u - load)):.2g}, "
        f"and y' = K_s(u + d_i) nothing but rounding. Parentheses may be lost in the "
        "reading. With K_s = 1, as in Figs 2 and 3, both agree.",
    )


@tabled
def reset(book: Ledger) -> pd.DataFrame:
    """Eqs. (3), (7) and (8): what the automatic reset knows and how far it can go."""
    final = {name: (abs(float(loops.estimate(name)[-1]) - 1.0), 1.0) for name in loops.designs()}
    book.statement("eq3.reconstruction", *every(final, "<="), convention="settled")
    inside, tops = {}, {}
    for name in loops.designs():
        for step in loops.STEPS:
            low, high = loops.limits(step)
            state = loops.series(name).reset_signal(loops.run(name, step).u, loops.T_S)
            inside[f"{name}, {step}"] = (float(np.max(np.abs(state - (low + high) / 2))), (high - low) / 2)
        tops[name] = float(np.max(loops.estimate(name)))
    book.statement(
        "eq7.windup", *every(inside, "<="), left_name="reset from the middle", right_name="half the range"
    )
    invariant = {name: (top - 1.0, 1.0) for name, top in tops.items()}
    book.statement(
        "st.intro.invariant",
        *every(invariant, "<="),
        convention="settled",
        left_name="estimate beyond the load",
        right_name="the load",
        note="Load step of Paper Fig. 3. While u sits on its limit the reset goes to that limit, whatever the load is: "
        + ", ".join(f"{name} estimates up to {top:.3f}" for name, top in tops.items())
        + ", where the load is 1. What holds is that the estimate never leaves the limits.",
    )
    four = {name: ar.multiple_pole(m) for m, name in enumerate(loops.MRDP)} | {"PIDA_1": ar.double_zero()}
    ratios = {name: (one.ti, one.lag) for name, one in four.items()}
    book.statement(
        "st.reset.slow",
        *every(ratios, ">", "clearly"),
        left_name="τ_i",
        right_name="τ_0",
        note="τ_i/τ_0 is "
        + ", ".join(f"{ti / lag:.2f} with {name}" for name, (ti, lag) in ratios.items())
        + ". The short resets that do well at the limits are shorter than the transients.",
    )
    return pd.DataFrame(
        {
            name: {
                "τ_i/τ_0": f"{s.ti / s.lag:.2f}",
                "largest estimate": f"{tops[name]:.3f}",
                "estimate at the end": f"{loops.estimate(name)[-1]:.6f}",
            }
            for name, s in ar.SETTINGS.items()
        }
    ).T


@tabled
def parallel_form(book: Ledger) -> pd.DataFrame:
    """Sections 1 and 2: what the parallel form does at the limits, without protection and with conditioning."""
    names = ("PI", "PID", "MRDP-PIDA", "PIDA_1")
    apart, undershoot, table = {}, {}, {}
    conditioned = {}
    for name in names:
        ways = {"reset": loops.run(name, "load")}
        for way, kind in (("parallel", None), ("conditioning", "conditioning")):
            ways[way] = loops.sampled(loops.parallel(name), "load", anti_windup=kind)
        plain = loops.sampled(loops.parallel(name), "setpoint")
        for step, other in (("load", ways["parallel"]), ("setpoint", plain)):
            own = loops.run(name, step)
            met = np.min(np.abs(np.subtract.outer(own.u, loops.limits(step)))) < 1e-12
            if met:
                gap = np.max(np.abs(own.y[: other.y.size] - other.y))
                apart[f"{name}, {step}"] = (float(gap), float(np.max(np.abs(own.y))))
        undershoot[name] = (loops.beyond(ways["reset"], "load"), loops.beyond(ways["parallel"], "load"))
        if name in loops.MRDP:
            conditioned[name] = (
                loops.beyond(ways["conditioning"], "load"),
                float(ways["conditioning"].y.max()),
            )
        table[name] = {f"undershoot, {way}": f"{loops.beyond(r, 'load'):.4f}" for way, r in ways.items()}
    book.statement(
        "st.intro.equivalence",
        *every(apart, ">"),
        convention="identical",
        note="Without limits both are the same transfer function, see eq5.series. Where a limit "
        "of Paper Fig. 3 is met, "
        f"the outputs differ by {min(g for g, _ in apart.values()):.2f} to {max(g for g, _ in apart.values()):.2f}; PI "
        "meets none after the set-point step.",
    )
    book.statement(
        "st.intro.windup",
        *every(undershoot, "<"),
        note="Undershoot after the load step of Paper Fig. 3, automatic reset against the parallel form without "
        "protection: "
        + ", ".join(f"{name} {a:.4f} and {b:.2f}" for name, (a, b) in undershoot.items())
        + ".",
    )
    book.statement(
        "st.conditioning",
        *every(conditioned, ">"),
        convention="settled",
        note="Simulated with our realisation of conditioning, which follows the limit with the time k_p/k_i: after the "
        "load step "
        + ", ".join(f"{name} falls {a:.2f} below zero" for name, (a, _) in conditioned.items())
        + ". How the paper's controllers were realised is not in it.",
    )
    return pd.DataFrame(table).T


@tabled
def implicit_control(book: Ledger) -> pd.DataFrame:
    """Section 1: the conditioned PI controller is the automatic reset."""
    own = loops.series("PI")
    lags = pidalab.lags(own.filter_order, own.filter_time)
    process = pidalab.Process(lags.num, np.convolve([1.0, 0.0], lags.den), loops.plant().delay)
    cases, rows = {}, {}
    for step in loops.STEPS:
        parallel = loops.sampled(
            pidalab.Loop(process, pidalab.PIDA(own.kp, own.ti)), step, anti_windup="conditioning"
        )
        reset = loops.sampled(
            pidalab.Loop(process, pidalab.SeriesPIDA(own.kp, 0.0, 0.0, own.ti, 1.0, 0)), step
        )
        gap = float(np.max(np.abs(reset.y - parallel.y)))
        cases[step] = (gap, float(np.max(np.abs(reset.y))))
        rows[step] = {"largest |y|": f"{cases[step][1]:.3f}", "difference": f"{gap:.1e}"}
    book.statement(
        "st.intro.implicit",
        *every(cases, "<="),
        convention="identical",
        left_name="difference of y",
        right_name="largest y",
        note="PI, whose direct gain is K_p: conditioning integrates (K_p e + u − u_L)/T_i, which is (u − x)/T_i, the "
        "automatic reset. Both simulated without prefilter at the limits of Paper Fig. 3, the "
        "lags of Q_4 in the process; "
        f"the outputs differ by {max(gap for gap, _ in cases.values()):.0e} at most. With a "
        "filter inside the controller, "
        "as in Paper Fig. 1, they do not agree, see st.conditioning.",
    )
    return pd.DataFrame(rows).T


def stuck(book: Ledger) -> None:
    """After (7): the integral of a parallel controller grows while the actuator is too weak for the load."""
    own, grown = loops.series("PIDA_1"), {}
    for end in (30.0, 60.0, 120.0):
        loop = pidalab.Loop(loops.plant(), own.transfer_function())
        r = loops.sampled(loop, "load", loops.limits("setpoint"), end=end)
        grown[end] = own.kp / own.ti * abs(float(np.trapezoid(r.y, dx=loops.T_S)))
    (first, second, third) = grown.values()
    book.statement(
        "eq7.integral",
        *every({"30 to 60": (second, first), "60 to 120": (third, second)}, ">"),
        note="Parallel form of PIDA_1 without anti-windup, unit load, limits ±0.1 that cannot "
        "compensate it: the integral "
        f"of the error times K_p/T_i is {first:.0f}, {second:.0f} and {third:.0f} after 30, 60 and 120 time units.",
    )


@tabled
def filters(book: Ledger) -> pd.DataFrame:
    """Section 2.1: why all terms share one filter, and what delay stands for it."""
    own = loops.series("PIDA_1")
    ends = {}
    for m, name in enumerate(loops.MRDP):
        passed = np.abs(loops.series(name)(1j * np.array([1e3, 1e6])))
        ends[f"m = {m}"] = (float(passed[1]), float(passed[0]))
    book.statement(
        "eq9.proper",
        *every(ends, "<="),
        left_name="gain of the controller with Q_4 at ω = 1e6",
        right_name="that at 1e3",
    )
    slope = own.filter_order * own.filter_time
    residence = -mpmath.diff(lambda s: (1 + own.filter_time * s) ** -own.filter_order, 0)
    te = loops.pi().kp / loops.series("PI").kp - loops.plant().delay  # T_d for which the gain was made
    book.identity("eq11.average", abs(float(residence) / te - 1), ROUNDING)
    book.check("eq11.te", te)
    book.check("fig3.tf", book.printed("eq11.te") / own.filter_order)
    gains = {}
    for n in (2, 3):
        loop = loops.design(ar.PIDA_1, n=n, filter_time=slope / n).loop()
        gains[n] = float(pidalab.noise_gain(loop, loops.T_S))
    book.statement(
        "st.intro.attenuation",
        gains[3],
        "<",
        gains[2],
        left_name="noise gain with Q_3",
        right_name="that with Q_2",
        note=f"PIDA_1 in the loop of Paper Fig. 3 with the same T_e, white noise at every sample of {loops.T_S:g}: its "
        f"standard deviation reaches u {gains[2]:.3g} times with Q_2 and {gains[3]:.3g} times with Q_3.",
    )
    return pd.DataFrame({"noise gain": {f"Q_{n}": f"{gain:.3g}" for n, gain in gains.items()}})
