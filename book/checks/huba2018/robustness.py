"""Whether robustness, control effort and speed improve with the derivative order: huba2018 on its own model."""

import math
from collections.abc import Callable
from functools import cache

import numpy as np
import pandas as pd
import pidalab
from pidalab.ledger import Ledger, every
from pidalab.rules import mrdp

from .designs import (
    BANDWIDTH,
    ORDERS,
    constants,
    listed,
    load_integral,
    noise_in_u,
    servo_integral,
    span,
    unit,
)

SERVO = (
    4.3,
    4.5,
    6.0,
    12.0,
)  # equal integrals of the error after a set-point step, in T_dm; PI cannot do less than 4.12
LOAD = (13.5, 15.0, 40.0)  # after a load step, in K_s T_dm²; PI cannot do less than 12.64
EXTRA = (1, 2)  # n − m
USUAL = 10  # ratio of derivative time and filter time in textbooks


def equal_filter(te: float) -> Callable[[int], float]:
    """Give every m the same T_e."""
    return lambda m: te


def equal_servo(ie: float) -> Callable[[int], float]:
    """Give every m the T_e with which eq. (15) has the same value."""
    return lambda m: ie / servo_integral(m) - 1


def equal_load(ie: float) -> Callable[[int], float]:
    """Give every m the T_e with which T_i/K_c, the integral of the error after a load step, is the same."""
    return lambda m: math.sqrt(ie / load_integral(m)) - 1


WAYS = {"T_e": equal_filter, "IAE_s": equal_servo, "load": equal_load}


@cache
def family(way: str, value: float, extra: int) -> pd.DataFrame:
    """Measure the loops m = 0 to 4 that have something in common; n = m + extra."""
    rows = []
    for m in ORDERS:
        d = mrdp.tune(unit(), m, m + extra, WAYS[way](value)(m))
        loop = d.loop()
        found = pidalab.margins(loop)
        rows.append((d.te, found.ms, found.gm, found.pm, found.dm, noise_in_u(loop), d.ie, d.ti / d.kc))
    names = [
        "Tₑ",
        "Ms",
        "gain margin",
        "phase margin, deg",
        "delay margin",
        "noise in u",
        "IE set point",
        "IE load",
    ]
    return pd.DataFrame(rows, columns=names)


def against_pi(way: str, values: tuple[float, ...], column: str) -> dict[str, tuple[float, float]]:
    """Collect a measure of each m from 1 to 4 beside that of PI, for every value and both orders of the filter."""
    return {
        f"{way} = {value:g}, n = m + {extra}, m = {m}": (one[column][m], one[column][0])
        for value in values
        for extra in EXTRA
        for one in [family(way, value, extra)]
        for m in ORDERS[1:]
    }


def margins(book: Ledger) -> pd.DataFrame:
    """Secs I, V.C, VI: robustness over m, with equal T_e and with equal integrals of the error."""
    same, servo, load = family("T_e", 0.5, 1), family("IAE_s", 4.5, 1), family("load", 15.0, 1)
    book.statement(
        "st.robust.te.ms",
        *every(against_pi("T_e", (0.5,), "Ms"), "<"),
        left_name="with m",
        right_name="PI",
        note=f"T_e = 0.5 T_dm, n = m + 1, m from 0 to 4: Ms = {listed(same['Ms'])}, and the delay margin goes from "
        f"{same['delay margin'][0]:.2f} to {same['delay margin'][4]:.2f} T_dm. The paper's own comparison, on the "
        "plant, is st.fig8.oscillation.",
    )
    book.statement(
        "st.robust.iae.ms",
        *every(against_pi("IAE_s", SERVO, "Ms"), "<"),
        left_name="with m",
        right_name="PI",
        note=f"IAE_s = {listed(SERVO, 'g')} T_dm, n = m + 1 and m + 2. With 4.5 and n = m + 1, m from 0 to 4: Ms = "
        f"{listed(servo['Ms'])}.",
    )
    book.statement(
        "st.robust.iae.dm",
        *every(against_pi("IAE_s", SERVO, "delay margin"), ">"),
        left_name="with m",
        right_name="PI",
        note=f"IAE_s = {listed(SERVO, 'g')} T_dm. With 4.5, m from 0 to 4: delay margin "
        f"{listed(servo['delay margin'])} T_dm with n = m + 1, and "
        f"{listed(family('IAE_s', 4.5, 2)['delay margin'])} with n = m + 2. What is equal is the set-point step; "
        "with equal load steps it is the other way round, see st.robust.load.dm.",
    )
    book.statement(
        "st.robust.iae.gm",
        *every(against_pi("IAE_s", SERVO, "gain margin"), ">"),
        left_name="with m",
        right_name="PI",
        note=f"IAE_s = {listed(SERVO, 'g')} T_dm. With 4.5, m from 0 to 4: gain margin "
        f"{listed(servo['gain margin'])} with n = m + 1, but {listed(family('IAE_s', 4.5, 2)['gain margin'])} with "
        "n = m + 2, the orders of the paper's PID_4^2 and PID_6^4.",
    )
    book.statement(
        "st.robust.load.dm",
        *every(against_pi("load", LOAD, "delay margin"), ">"),
        left_name="with m",
        right_name="PI",
        note=f"T_i/K_c, which is the integral of the error after a load step, is {listed(LOAD, 'g')} K_s T_dm². "
        f"With 15 and n = m + 1, m from 0 to 4: delay margin {listed(load['delay margin'])} T_dm, Ms "
        f"{listed(load['Ms'])}, gain margin {listed(load['gain margin'])}.",
    )
    families = {"Tₑ = 0.5": same, "set-point IE = 4.5": servo, "load IE = 15": load}
    return pd.concat(families, names=["equal", "m"]).round(3)


def effort(book: Ledger) -> pd.DataFrame:
    """Sec. I: control effort over m, as noise in u and as total variation."""
    servo, load = (
        against_pi(way, values, "noise in u") for way, values in (("IAE_s", SERVO), ("load", LOAD))
    )
    shares = {
        way: {
            m: [a / b for name, (a, b) in cases.items() if name.endswith(f"n = m + 1, m = {m}")]
            for m in ORDERS[1:]
        }
        for way, cases in (("IAE_s", servo), ("load", load))
    }
    ladder = {
        f"IAE_s = {ie:g}, n = m + {extra}, m = {m + 1}": tuple(
            family("IAE_s", ie, extra)["noise in u"][[m + 1, m]]
        )
        for ie in SERVO
        for extra in EXTRA
        for m in range(4)
    }
    common = (
        f"White noise of unit deviation with {BANDWIDTH / math.pi:.0f} samples in a dead time, n = m + 1. "
    )
    book.statement(
        "st.effort.noise",
        *every(ladder, "<"),
        left_name="noise in u with m",
        right_name="m − 1",
        note=common
        + f"Share of the standard deviation with PI, IAE_s from {min(SERVO):g} to {max(SERVO):g} T_dm: "
        + "; ".join(f"m = {m}: {span(values)}" for m, values in shares["IAE_s"].items())
        + ". At equal IAE_s the load response becomes slower with m, see st.effort.noise.load. At equal T_e the "
        "noise rises.",
    )
    ladder = {
        f"load = {ie:g}, n = m + {extra}, m = {m + 1}": tuple(
            family("load", ie, extra)["noise in u"][[m + 1, m]]
        )
        for ie in LOAD
        for extra in EXTRA
        for m in range(4)
    }
    book.statement(
        "st.effort.noise.load",
        *every(ladder, "<"),
        left_name="noise in u with m",
        right_name="m − 1",
        note=common + f"Share of the standard deviation with PI at equal T_i/K_c, from {min(LOAD):g} to "
        f"{max(LOAD):g} "
        "K_s T_dm²: " + "; ".join(f"m = {m}: {span(values)}" for m, values in shares["load"].items()) + ".",
    )
    t = np.linspace(0, 60, 12_001)
    loops = [mrdp.tune(unit(), m, max(m, 1), equal_servo(4.5)(m)).loop() for m in ORDERS]
    tv = [pidalab.step_response(loop, t).tv("u") for loop in loops]
    book.statement(
        "st.effort.tv",
        *every({f"m = {m + 1}": (tv[m + 1], tv[m]) for m in range(4)}, "<"),
        left_name="total variation of u with m",
        right_name="m − 1",
        note="Set-point step at IAE_s = 4.5 T_dm, n = m (1 for PI), without noise, first jump included: "
        f"{listed(tv, '.3f')} in units of 1/(K_s T_dm), for m from 0 to 4.",
    )
    noise = {f"equal set-point IE = {ie:g}": family("IAE_s", ie, 1)["noise in u"] for ie in SERVO}
    noise |= {f"equal load IE = {ie:g}": family("load", ie, 1)["noise in u"] for ie in LOAD}
    return pd.DataFrame({name: one / one[0] for name, one in noise.items()}).rename_axis("m").round(3)


def uncertain(book: Ledger) -> pd.DataFrame:
    """Sec. VI: loops whose dead time is not the model's, and the three promises of sec. I together."""
    plants, rows = [pidalab.ipdt(1.0, delay=delay) for delay in (0.8, 1.0, 1.2)], {}
    t = np.linspace(0, 80, 4001)
    for m in ORDERS:
        d = mrdp.tune(unit(), m, m + 1, equal_servo(4.5)(m))
        rows[m] = {
            "Ms": max(pidalab.max_sensitivity(d.loop(plant))[0] for plant in plants),
            "IAE set point": max(pidalab.step_response(d.loop(plant), t).iae() for plant in plants),
            "IAE load": max(pidalab.load_response(d.loop(plant), t).iae() for plant in plants),
        }
    cases = {f"{name}, m = {m}": (rows[m][name], rows[0][name]) for m in ORDERS[1:] for name in rows[0]}
    book.statement(
        "st.conclusion.robust",
        *every(cases, "<"),
        left_name="with m",
        right_name="PI",
        note="IAE_s = 4.5 T_dm with the model, n = m + 1, dead times of the plant 20 % shorter and longer; the "
        f"worst of them. For m from 0 to 4: Ms {listed([row['Ms'] for row in rows.values()])}; IAE after a "
        f"set-point step {listed([row['IAE set point'] for row in rows.values()])}, after a load step "
        f"{listed([row['IAE load'] for row in rows.values()], '.1f')}.",
    )
    one = family("IAE_s", 4.5, 1)
    names = {"noise in u": "noise in u", "Ms": "Ms"}
    promised = {
        f"{name}, m = {m}": (one[key][m], one[key][0]) for name, key in names.items() for m in ORDERS[1:]
    }
    book.statement(
        "st.intro.expectations",
        *every(promised, "<"),
        left_name="with m",
        right_name="PI",
        note="At the same speed after a set-point step, IAE_s = 4.5 T_dm and n = m + 1: the noise falls, Ms does "
        "not. The experiments are not published as numbers.",
    )
    return pd.DataFrame(rows).T.rename_axis("m").round(3)


def traditional(book: Ledger) -> pd.DataFrame:
    """Sec. I: the integrated filter against that of the derivative alone; noise at equal load error."""
    one, rows = constants(1), {}
    td = one.derivative_times[0]
    for ratio in (2.0, 3.0, 5.0, USUAL, 20.0, 30.0):
        total = 1 / (1 - td / ratio)  # T_d = T_dm + the filter time, as in eq. (12)
        old = pidalab.PIDA(one.gain / total, one.integral_time * total, td * total, 0.0, n=ratio)
        loops = {n: mrdp.tune(unit(), 1, n, te=total - 1).loop() for n in range(1, 7)}
        noise = {n: noise_in_u(loop) for n, loop in loops.items()}
        best = min(noise, key=lambda n: noise[n])
        before = noise_in_u(pidalab.Loop(unit(), old))
        rows[f"derivative time / filter time = {ratio:g}"] = {
            "Tₑ": total - 1,
            "best n": best,
            "noise, traditional": before,
            "noise, integrated": noise[best],
            "share": noise[best] / before,
        }
    usual = rows[f"derivative time / filter time = {USUAL:g}"]
    share = [row["share"] for row in rows.values()]
    note = (
        "PID tuned for T_dm and its filter as dead time, so that both have the same integral of the error after a "
        "load step; noise with 250 samples in a dead time. With T_D1 2 to 30 times the filter time the integrated "
        f"filter of the best order n up to 6 lets {span(share)} of the noise through."
    )
    book.statement(
        "st.intro.filter.usual",
        usual["noise, integrated"],
        "<",
        usual["noise, traditional"],
        convention="much",
        left_name="noise in u, integrated",
        right_name=f"traditional, T_D1 = {USUAL} filter times",
        note=note,
    )
    te = 0.375  # of Fig. 2 for m = 1; a filter of the derivative alone with this delay is longer than T_D1
    total = 1 + te
    old = pidalab.PIDA(one.gain / total, one.integral_time * total, td * total, 0.0, n=td * total / te)
    sides = [noise_in_u(mrdp.tune(unit(), 1, 2, te).loop()), noise_in_u(pidalab.Loop(unit(), old))]
    book.statement(
        "st.intro.filter.fig2",
        sides[0],
        "<",
        sides[1],
        convention="much",
        left_name="noise in u, integrated",
        right_name="traditional",
        note=f"The same at the setting of Fig. 2 for m = 1, T_e = {te} T_dm, with n = 2. A first-order filter of "
        f"the derivative with this time constant leaves T_D1 only {td * total / te:.2f} filter times, which is no "
        "derivative any more: this much filtering is beyond it.",
    )
    return pd.DataFrame(rows).T.astype({"best n": int}).round(3)
