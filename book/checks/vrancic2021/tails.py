"""What the paper says of more derivatives, of overshoot, pulses and slow tails."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from pidalab.ledger import CONVENTIONS, Ledger, every
from scipy.signal import find_peaks

from . import examples, problem
from .names import typeset
from .speed import PREFILTER, measures, responses


@typeset
def more_derivatives(book: Ledger) -> pd.DataFrame:
    """What the abstract and the conclusion say about the order m, at a noise gain of 10."""
    low, high = measures("table5.m1"), measures("table5.m4")
    shares = {name: (high[name], low[name]) for name in ("IAE", "IAE, load")}
    book.statement(
        "st.abstract.improve",
        *every(shares, "<", "clearly"),
        left_name="IAE of PID_5^4",
        right_name="PID_2^1",
        note=f"Tracking with T_FR = {PREFILTER:g}: {high['IAE']:.2f} against {low['IAE']:.2f}. Load: "
        f"{high['IAE, load']:.2f} against {low['IAE, load']:.2f}. σ_rel {problem.noise('table5.m4'):.1f} against "
        f"{problem.noise('table5.m1'):.1f}.",
    )
    run = responses("table4.n4")
    plain, filtered = run["bare"].ie(math.inf), run["set point"].ie(math.inf)
    printed = 1 / (problem.process(3).gain() * problem.integral_gain("table4.n4"))
    book.identity(
        "eq37.ie",
        abs(plain / printed - 1),
        1e-9,
        note=f"PID_4^3 with K_HF = 10 and no prefilter, so that r_f = r: {plain:.6f}.",
    )
    book.identity(
        "eq36.reference",
        abs(filtered / printed - 1),
        1e-9,
        note=f"As read. 1/(K_PR K_-1) is the integral of r_f − y; with r it is 2 T_FR more: {filtered:.3f} for PID_4^3 "
        f"with T_FR = {PREFILTER:g}, where 1/K_-1 = {printed:.3f}. An index f is easily lost in reading.",
    )
    K_0 = problem.tuned("table4.n4").coefficients[1]
    book.identity(
        "eq25.k0",
        abs(K_0 * problem.process(3).gain() - 1),
        1e-9,
        note=f"As read. K_0 is the proportional gain in (1) and (17), {K_0:.3f} for PID_4^3; the sums of (25) need the "
        "constant term of (21) in its place, for which another symbol would do.",
    )
    return pd.DataFrame({str(problem.CASES[key]): measures(key) for key in problem.TABLE_5}).T.map(
        "{:.3f}".format
    )


@typeset
def steps(book: Ledger) -> pd.DataFrame:
    """Oscillation, pulses and slow tails after steps of set point and load."""
    runs = {str(problem.CASES[key]) + f", G_P{problem.CASES[key].g}": responses(key) for key in problem.ONCE}
    runs |= {f"Table 2, G_P{g}, m = {m}": examples.responses(g, m) for g, m in problem.EXAMPLE_1}
    over = {name: run["bare"].overshoot() / 100 for name, run in runs.items()}
    under = {name: 1 - float(run["bare"].y[run["bare"].y.argmax() :].min()) for name, run in runs.items()}
    beyond = {name: float(np.max(-run["load"].u)) - 1 for name, run in runs.items()}
    book.statement(
        "st.nonoscillatory",
        *every({name: (x, 1.0) for name, x in under.items()}, "<=", "settled"),
        left_name="fall below the set point after the overshoot",
        right_name="step",
        note=f"{len(under)} loops of Tables 2 to 6 without reference filter: they overshoot by "
        f"{100 * min(over.values()):.1f} % to {100 * max(over.values()):.1f} %, and fall by "
        f"{100 * min(under.values()):.2f} % to {100 * max(under.values()):.2f} % below 1 afterwards.",
    )
    book.statement(
        "st.conclusion.monotonic",
        *every({name: (x, 1.0) for name, x in beyond.items()}, "<=", "settled"),
        left_name="overshoot of u after a load step",
        right_name="its change",
        note=f"By {100 * min(beyond.values()):.1f} % to {100 * max(beyond.values()):.1f} % in {len(beyond)} loops of "
        "Tables 2 to 6. Necessarily: u/d = −T, so it is minus the output of the reference step without filter.",
    )
    settling = {
        key: (measures(key)["settling"], responses(key)["load"].settling_time()) for key in problem.TABLE_5
    }
    servo = settling["table5.m4"][0]
    load = settling["table5.m4"][1]
    book.statement(
        "st.conclusion.asymmetry",
        servo,
        "<",
        load,
        convention="much",
        left_name="settling of PID_5^4 after a set-point step",
        right_name="after a load step, to 2 % of its peak",
        note=f"Table 5: {', '.join(f'{a:.1f} and {b:.1f}' for a, b in settling.values())} s for m = 1 to 4.",
    )
    pulses = [_pulses(responses(key)["set point"].u) for key in problem.TABLE_5]
    book.statement(
        "st.conclusion.pulses",
        pulses[0],
        "<",
        pulses[-1],
        left_name="extrema of u with m = 1",
        right_name="with m = 4",
        note=f"{', '.join(map(str, pulses))} for m = 1 to 4, counting those that stand out by 1 % of the range of u: "
        "the first derivative that is added makes the difference.",
    )
    rows = {
        name: {
            "overshoot, %": 100 * over[name],
            "then below 1 by, %": 100 * under[name],
            "u beyond its final value, load, %": 100 * beyond[name],
        }
        for name in runs
    }
    return pd.DataFrame(rows).T.map("{:.2f}".format)


def _pulses(u: np.ndarray) -> int:
    """Extrema that stand out by a line's width."""

    height = CONVENTIONS["identical"].limit * np.ptp(u)
    return sum(find_peaks(x, prominence=height)[0].size for x in (u, -u))
