"""Section 5: who wins, and what it pays; the contest again at equal noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pidalab
from pidalab.ledger import Ledger, every
from pidalab.rules import magnitude_optimum as mo

from . import problem
from .contest import ENDS, PREFILTER, SAMPLES, facts, ises, noise_gain, responses, servo_ise
from .names import typeset

MEASURES = "rise time", "ISE", "peak, load", "ISE, load"


@typeset
def verdicts(book: Ledger) -> pd.DataFrame:
    """Who wins, in Figs 13 to 15 and Tables 7 to 9."""
    for g, ours in ((5, ("PID_2^2",)), (6, ("PID_2^2", "PID_3^3")), (7, ("PID_2^2",))):
        wins = {
            f"{x}, {name}": (facts(g, name)[x], facts(g, problem.RIVAL[g])[x])
            for name in ours
            for x in MEASURES
        }
        if g == 5:  # "the one-order higher controller has a better result"
            wins |= {
                f"{x}, PID_3^3 against PID_2^2": (facts(5, "PID_3^3")[x], facts(5, "PID_2^2")[x])
                for x in MEASURES
            }
        book.statement(
            f"st.case{g - 4}.superior",
            *every(wins, "<"),
            left_name="magnitude optimum",
            right_name="the other",
            note=f"{len(wins)} pairs: rise time and ISE in tracking with T_FR = {PREFILTER:g}, peak and ISE of the "
            f"load response. Rise time {_each(g, 'rise time')}; peak {_each(g, 'peak, load')}.",
        )
        ratio = {
            kind: (ises(g)["PID_2^2"][kind], ises(g)[problem.RIVAL[g]][kind]) for kind in ("tracking", "load")
        }
        book.statement(
            f"st.table{g + 2}.lower",
            *every(ratio, "<", "much" if g == 5 else None),
            left_name="ISE of PID_2^2",
            right_name=problem.RIVAL[g],
            note=f"By factors of {' and '.join(f'{b / a:.3g}' for a, b in ratio.values())}."
            + (" With the computed value in place of the repeated one." if g == 5 else ""),
        )
    _settling(book)
    all_ise = {
        f"G_P{g}, {kind}": (ises(g)["PID_2^2"][kind], ises(g)[problem.RIVAL[g]][kind])
        for g in problem.RIVAL
        for kind in ("tracking", "load")
    }
    louder = _pairs(lambda g: (noise_gain(g, "PID_2^2"), noise_gain(g, problem.RIVAL[g])))
    tracking = _pairs(lambda g: (fair(g)["PID_3^2"][1], fair(g)[problem.RIVAL[g]][1]))
    load = _pairs(lambda g: (fair(g)["PID_3^2"][2], fair(g)[problem.RIVAL[g]][2]))
    book.statement(
        "st.conclusion.better",
        *every(all_ise, "<"),
        left_name="ISE of PID_2^2",
        right_name="the other method",
        note=f"But with more noise: σ_rel {louder} (T_S = {problem.SAMPLE_TIME:g}). With T_F lengthened until the "
        f"noise is that of the other method PID_3^2 has, in tracking, {tracking}, and with the load {load}.",
    )
    rows = {f"G_P{g}, {name}": facts(g, name) for g in problem.RIVAL for name in problem.contest(g)}
    return pd.DataFrame(rows).T.map("{:.3g}".format)


def _pairs(of: Callable[[int], tuple[float, float]]) -> str:
    return ", ".join("{:.3g} against {:.3g}".format(*of(g)) for g in problem.RIVAL)


def _each(g: int, measure: str) -> str:
    return ", ".join(f"{facts(g, name)[measure]:.3g} ({name})" for name in problem.contest(g))


def _settling(book: Ledger) -> None:
    """The load response of G_P6 settles fastest with Jung."""
    level = 2e-5  # the same for all, near 2 % of the peak of Jung
    runs = {name: run["load"] for name, run in responses(6).items()}
    same = {name: float(run.t[abs(run.y) > level][-1]) for name, run in runs.items()}
    own = {name: run.settling_time() for name, run in runs.items()}
    cases = {}
    for name in ("PID_2^2", "PID_3^3"):
        cases[f"2 % of its own peak, {name}"] = own["Jung"], own[name]
        cases[f"{level:g}, {name}"] = same["Jung"], same[name]
    slowest = {name: _slowest(name) for name in runs}
    book.statement(
        "st.case2.settling",
        *every(cases, "<"),
        left_name="settling of the load response with Jung",
        right_name="the other",
        note=f"To 2 % of its own peak {_values(own)} s, to the same {level:g} {_values(same)} s. Real part of the "
        f"slowest pole: {_values(slowest)}.",
    )


def _values(values: dict[str, float]) -> str:
    return ", ".join(f"{x:.1f} ({name})" for name, x in values.items())


def _slowest(name: str) -> float:
    """Real part of the slowest closed-loop pole on G_P6."""
    C = problem.contest(6)[name].transfer_function()
    num, den = C.num[0][0], C.den[0][0]
    P = problem.process(6)
    return float(np.max(np.roots(np.polyadd(np.polymul(den, P.den), np.polymul(num, P.num))).real))


@typeset
def short_filters(book: Ledger) -> pd.DataFrame:
    """What the short filters do to the responses of the Lurang and Jung controllers."""
    t, rows = np.linspace(0, 12, 24001), {}
    for g in (5, 6):
        K = problem.process(g).num[-1] * np.array(problem.RIVAL_GAINS[g])[::-1]
        closed = np.polyadd(np.append(problem.process(g).den, 0.0), K)  # without filter
        step = pidalab.open_loop_step(pidalab.Process(K, np.polymul(closed, [1e-4, 0.02, 1.0])), t)
        load = pidalab.open_loop_step(pidalab.Process(np.append(problem.process(g).num, 0.0), closed), t)
        step, load = replace(step, r=np.ones_like(t)), replace(load, r=np.zeros_like(t))
        with_filter = responses(g)[problem.RIVAL[g]]
        pairs = {
            "rise time": (with_filter["setpoint"].rise_time(), step.rise_time()),
            "IAE": (with_filter["setpoint"].iae(), step.iae()),
            "peak, load": (with_filter["load"].peak(), float(np.max(abs(load.y)))),
            "ISE, load": (with_filter["load"].ise(), load.ise()),
        }
        moved = float(np.max(abs(step.y - with_filter["setpoint"].y)))
        book.statement(
            f"st.case{g - 4}.filter",
            *every(pairs, "within", "similar"),
            left_name="with the filter of order 2",
            right_name="without",
            note=f"Rise time and IAE in tracking with T_FR = {PREFILTER:g}, peak and ISE of the load response. The "
            f"reference response moves by up to {100 * moved:.1f} % of the step; its overshoot is "
            f"{with_filter['setpoint'].overshoot():.1f} % with the filter and {step.overshoot():.1f} % without.",
        )
        for place, label in enumerate(("with filter", "without")):
            rows[f"{problem.RIVAL[g]}, {label}"] = {name: pair[place] for name, pair in pairs.items()}
    base = problem.contest(5)["PID_2^2"]
    wanted = base.coefficients[-1] / base.filter_time**2
    longer = problem.pid(mo.tune_for_noise(problem.process(5), 2, 3, wanted, problem.SAMPLE_TIME))
    louder = pidalab.noise_gain(problem.loop(5, longer), problem.SAMPLE_TIME)
    book.statement(
        "st.case1.higher",
        *every(
            {
                "1/K_-1": (1 / longer.coefficients[0], 1 / base.coefficients[0]),
                "σ_rel": (louder, noise_gain(5, "PID_2^2")),
            },
            "<",
        ),
        left_name="PID_3^2",
        right_name="PID_2^2",
        note=f"With the noise gain K_2/T_F² of PID_2^2 and T_S = {problem.SAMPLE_TIME:g}: K_-1 = "
        f"{longer.coefficients[0]:.1f} against {base.coefficients[0]:.1f}, σ_rel = {louder:.3g} against "
        f"{noise_gain(5, 'PID_2^2'):.3g}. T_S of this section is not in the text.",
    )
    return pd.DataFrame(rows).T.map("{:.3g}".format)


@cache
def fair(g: int) -> dict[str, list[float]]:
    """At equal noise: noise gain, both ISE and the peak after a load step, of the rival and three of ours."""
    old = problem.RIVAL[g]
    rows = {
        old: [
            noise_gain(g, old),
            facts(g, old)["ISE"],
            facts(g, old)["ISE, load"],
            facts(g, old)["peak, load"],
        ]
    }
    servo_end, load_end = ENDS[g]
    for m, n in ((2, 3), (2, 4), (3, 5)):
        C = problem.exact_noise(g, m, n, noise_gain(g, old))
        run = pidalab.load_response(problem.loop(g, C), np.linspace(0, load_end, SAMPLES))
        louder = pidalab.noise_gain(problem.loop(g, C), problem.SAMPLE_TIME)
        rows[f"PID_{n}^{m}"] = [louder, servo_ise(g, C, end=servo_end), run.ise(), run.peak()]
    return rows


@typeset
def at_equal_noise(book: Ledger) -> pd.DataFrame:
    """The contest again, with filters as long as the noise of the other method asks."""
    columns = ["noise gain", "ISE, set point", "ISE, load", "peak, load"]
    rows = {f"G_P{g}, {name}": values for g in problem.RIVAL for name, values in fair(g).items()}
    return pd.DataFrame(rows, columns).T.map("{:.3g}".format)
