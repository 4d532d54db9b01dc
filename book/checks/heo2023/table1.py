"""Table 1 and Fig. 1: what the factors were fitted to, how well, and how near the rule is to the optimum."""

import math
from collections.abc import Callable
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pidalab
from pidalab.controllers import NonInteractivePIDA
from pidalab.ledger import Ledger, every
from pidalab.process import Process
from pidalab.response import Response
from pidalab.rules import itae

from .examples import listed, percents, second_order

MEASURES: dict[str, Callable[[Response], float]] = {
    "IAE": Response.iae,
    "ITAE": Response.itae,
    "mixed": lambda run: run.itae(origin=-1.0),  # the step at t = 1 and time from 0
}
SMALL = "Eight digits are kept: ITAE to infinity weighs the late, small errors most."
SETTLE = np.linspace(0, 60, 3001)
DAMPINGS = (0.3, 0.5, 0.75, 1.0, 1.5, 2.0)
RATIOS = (0.25, 0.5, 0.79, 1.2, 2.0)


def unit(damping: float, ratio: float) -> Process:
    """Model of gain and time constant 1."""
    return pidalab.sopdt(1.0, 1.0, damping, ratio)


def data(name: str) -> pd.DataFrame:
    """A stored table of the book."""
    return pd.read_csv(Path(__file__).parents[2] / "data" / name)


def with_factors(model: Process, f_d: float, f_a: float) -> NonInteractivePIDA:
    """The rule for the set point with given factors."""
    return itae.pida_setpoint(model, factors=lambda _: (f_d, f_a))


def domain(book: Ledger) -> pd.DataFrame:
    """The models of the examples, and the range of the fit."""
    rows = {f"Example {k}": {"θ/τ": m.delay / m.tau, "ξ": m.damping} for k, m in second_order().items()}
    limits = {"θ/τ": (0.1, 2.0), "ξ": (0.3, 2.0)}
    above = {f"{name}, {x} from below": (limits[x][0], row[x]) for name, row in rows.items() for x in limits}
    below = {f"{name}, {x} from above": (row[x], limits[x][1]) for name, row in rows.items() for x in limits}
    table = pd.DataFrame(rows).T
    text = f"θ_m/τ_m = {listed(table['θ/τ'])}; ξ_m = {listed(table['ξ'])}."
    book.statement("table1.range", *every(above | below, "<="), note=text)
    return table.map("{:.3f}".format)


BREAKS: dict[
    str, tuple[Callable[[Process], object], str, str, tuple[float, ...]]
] = {  # formula, parameter, variable, places
    "Table 1, f_a": (itae.factors, "f_a", "r", (0.37, 1.0)),
    "Table 1, f_d ": (itae.factors, "f_d", "ξ", (1.0,)),
    "Table 1, f_a ": (itae.factors, "f_a", "ξ", (1.0,)),
    "Table 2, k_c": (itae.pid_setpoint, "kc", "ξ", (0.9,)),
    "Table 2, τ_i": (itae.pid_setpoint, "tau_i", "r", (1.0,)),
    "Table 3, k_c": (itae.pid_load, "kc", "r", (0.9,)),
    "Table 3, τ_i": (itae.pid_load, "tau_i", "r", (0.4,)),
}


def _jumps(rule: Callable[[Process], object], parameter: str, variable: str, place: float) -> list[float]:
    """Relative jumps of a parameter at a place of one variable, along the other."""
    found = []
    for other in np.linspace(0.1, 2.0, 20) if variable == "ξ" else np.linspace(0.3, 2.0, 18):
        sides = [(x, other) if variable == "ξ" else (other, x) for x in (place - 1e-9, place + 1e-9)]
        low, high = (getattr(rule(unit(*side)), parameter) for side in sides)
        found.append(high / low - 1)
    return found


def crossings() -> list[float]:
    """Ratios at which the last two formulas of f_a cross, for several dampings."""
    found = []
    for xi in DAMPINGS:
        lines = [
            np.polyfit(ends, [itae.factors(unit(xi, x)).f_a for x in ends], 1)
            for ends in ((0.4, 1.0), (1.1, 2.0))
        ]
        found.append(float(np.roots(lines[0] - lines[1])[0]))
    return found


def breaks(book: Ledger) -> pd.DataFrame:
    """Where the formulas of Tables 1 to 3 change, and by how much they jump there."""
    rows, largest = {}, {}
    for name, (rule, parameter, variable, places) in BREAKS.items():
        for place in places:
            jumps = _jumps(rule, parameter, variable, place)
            where = f"{name.strip()} at {variable} = {place:g}"
            rows[where] = {"smallest": f"{min(jumps):+.1%}", "largest": f"{max(jumps):+.1%}"}
            largest[where] = max(map(abs, jumps))
    meet, kept = crossings(), _branches()
    text = (
        f"At 0.37 f_a jumps by {100 * largest['Table 1, f_a at r = 0.37']:.2f} % at most. The last two formulas meet "
        f"at {min(meet):.3f} to {max(meet):.3f}. Between there and 1 the formula as printed gives the smaller IAE for "
        f"{kept} of {len(DAMPINGS)} dampings at θ_m/τ_m = 0.9, so the break may be meant."
    )
    names: dict[str, Any] = {"left_name": "largest jump of f_a at 1.0", "right_name": "f_a"}
    book.statement(
        "table1.break",
        largest["Table 1, f_a at r = 1"],
        "<=",
        1.0,
        note=text,
        convention="identical",
        **names,
    )
    return pd.DataFrame(rows).T


def _branches() -> int:
    """For how many dampings f_a as printed has the smaller IAE at θ/τ = 0.9, between crossing and break."""
    better = 0
    for xi in DAMPINGS:
        model = unit(xi, 0.9)
        f_d, f_a = itae.factors(model)
        line = np.polyfit((1.1, 2.0), [itae.factors(unit(xi, x)).f_a for x in (1.1, 2.0)], 1)
        other = with_factors(model, f_d, float(np.polyval(line, 0.9)))
        loops = [pidalab.Loop(model, C) for C in (with_factors(model, f_d, f_a), other)]
        costs = [pidalab.step_response(loop, SETTLE).iae() for loop in loops]
        better += costs[0] < costs[1]
    return better


@cache
def excess() -> pd.DataFrame:
    """By what share Table 1 is above the least value that any factors give, by measure and damping."""
    rows: dict[tuple[str, float], dict[float, float]] = {}
    for one in data("itae_factors.csv").itertuples():
        model = unit(one.damping, one.ratio)
        costs = [
            MEASURES[one.measure](pidalab.step_response(pidalab.Loop(model, C), SETTLE))
            for C in (itae.pida_setpoint(model), with_factors(model, one.f_d, one.f_a))
        ]
        rows.setdefault((one.measure, one.damping), {})[one.ratio] = costs[0] / costs[1]
    return pd.DataFrame(rows).T


def _spread(over: pd.DataFrame) -> str:
    """Excess of Table 1 by damping, for a note."""
    return "; ".join(f"ξ_m = {xi:g}: {percents(row - 1)}" for xi, row in over.iterrows())


def cost(book: Ledger) -> pd.DataFrame:
    """Which integral Table 1 minimises, and over which range."""
    over = excess()
    short, long = over.columns < 1, over.columns > 1
    for id, measure, part in (
        ("eq10.cost", "IAE", short),
        ("st.cost.itae", "ITAE", short),
        ("table1.fit", "IAE", long),
    ):
        chosen = over.loc[measure].loc[:, part]
        cases = {
            f"ξ_m = {xi:g}, θ_m/τ_m = {r:g}": (chosen.loc[xi, r], 1.0)
            for xi, r in product(chosen.index, chosen.columns)
        }
        text = f"Above the least {measure} for θ_m/τ_m = {listed(chosen.columns)}; {_spread(chosen)}."
        if measure == "ITAE":
            mixed = over.loc["mixed"].loc[:, short]
            text += f" With the step at t = 1 and time from 0, which is IAE + ITAE: {_spread(mixed)}."
        book.statement(id, *every(cases, "within", convention="similar"), note=text)
    shown = (over - 1).map("{:.1%}".format)
    shown.index = [f"{name}, ξ = {xi:g}" for name, xi in over.index]
    shown.columns = [f"θ/τ = {x:g}" for x in over.columns]
    return shown


def _half(damping: float, ratio: float, share: float) -> NonInteractivePIDA:
    """The rule with another share of the dead time added to the time constant in (9)."""
    f_d, f_a = itae.factors(unit(damping, ratio))
    pid = itae.pid_setpoint(pidalab.sopdt(1.0, 1 + share * ratio * f_d, damping, ratio * (1 - f_d)))
    return NonInteractivePIDA(pid.kc, pid.tau_i, pid.tau_d, f_a * pid.tau_d)


def half(book: Ledger) -> pd.DataFrame:
    """Half of the dead time that is taken away, added to the time constant: better than nothing?"""
    rows: dict[tuple[float, str], dict[float, float]] = {}
    for xi, ratio in product(DAMPINGS, RATIOS):
        runs = [
            pidalab.step_response(pidalab.Loop(unit(xi, ratio), _half(xi, ratio, share)), SETTLE)
            for share in (0.5, 0.0)
        ]
        for name in ("ITAE", "IAE"):
            values = [MEASURES[name](run) for run in runs]
            rows.setdefault((xi, name), {})[ratio] = values[0] / values[1]
    table = pd.DataFrame(rows).T
    for id, name in (("st.half", "ITAE"), ("st.half.iae", "IAE")):
        chosen = table.xs(name, level=1)
        cases = {
            f"ξ_m = {xi:g}, θ_m/τ_m = {r:g}": (chosen.loc[xi, r], 1.0) for xi, r in product(DAMPINGS, RATIOS)
        }
        fewer = int((chosen < 1).to_numpy().sum())
        text = f"Smaller in {fewer} of {chosen.size} models, f_d and f_a of Table 1; with half over without, "
        text += "; ".join(f"ξ_m = {xi:g}: {listed(row, '.2f')}" for xi, row in chosen.iterrows()) + "."
        names: dict[str, Any] = {"left_name": f"{name} with half over {name} without", "right_name": "1"}
        book.statement(id, *every(cases, "<"), note=text, **names)
    table.index = [f"{name}, ξ = {xi:g}" for xi, name in table.index]
    table.columns = [f"θ/τ = {x:g}" for x in table.columns]
    return table.map("{:.2f}".format)


def optimised(book: Ledger) -> pd.DataFrame:
    """(11): with the new model as the process the cost would fall with f_d without end."""
    model = unit(0.5, 0.5)
    table1 = itae.factors(model)
    rows: dict[str, dict[str, float]] = {}
    for f_d in (0.2, 0.25, 0.3, table1.f_d, 0.35, 0.4, 0.5, 0.6, 0.7):
        C = with_factors(model, f_d, table1.f_a)
        new = pidalab.sopdt(1.0, 1.0 + 0.25 * f_d, 0.5, 0.5 * (1 - f_d))
        row: dict[str, float] = {}
        rows[f"{f_d:.3f}"] = row
        for name, process in (("new model", new), ("original", model)):
            loop = pidalab.Loop(process, C)
            run = pidalab.step_response(loop, SETTLE) if pidalab.is_stable(loop) else None
            row |= {
                f"ITAE, {name}": run.itae() if run else math.inf,
                f"IAE, {name}": run.iae() if run else math.inf,
            }
    table = pd.DataFrame(rows).T.rename_axis("f_d")
    chosen, first, last = table.loc[f"{table1.f_d:.3f}"], table.iloc[0], table.iloc[-1]
    text = (
        f"θ_m/τ_m = 0.5, ξ_m = 0.5, f_a of Table 1. On the new model ITAE is {chosen['ITAE, new model']:.3f} at f_d = "
        f"{table1.f_d:.3f} of Table 1 and {last['ITAE, new model']:.3f} at 0.7; with the process of eq. (15) "
        f"{first['ITAE, original']:.3f} at 0.2, {chosen['ITAE, original']:.3f} at Table 1 and "
        f"{table.loc['0.400', 'ITAE, original']:.3f} at 0.4."
    )
    names: dict[str, Any] = {"left_name": "ITAE on the new model, f_d of Table 1", "right_name": "f_d = 0.7"}
    book.statement("eq11.plant", chosen["ITAE, new model"], "<=", last["ITAE, new model"], note=text, **names)
    return table.map("{:.3f}".format)


@cache
def optima() -> dict[tuple[str, str, float, float, float], NonInteractivePIDA]:
    """The stored optima, by role, kind, bound on Ms, damping and ratio."""
    return {
        (one.role, one.kind, one.ms_bound, one.damping, one.ratio): NonInteractivePIDA(
            one.kc, one.tau_i, one.tau_d, one.tau_a, 0.002 if one.role == "figure-pid-sharp" else 0.05
        )
        for one in data("itae_optima.csv").itertuples()
    }


@cache
def figure1() -> dict[tuple[float, float], dict[str, Response]]:
    """Set-point steps for Paper Fig. 1: its dead time is not in the text, so there are three."""
    fine, found = np.linspace(0, 60, 12001), {}
    for xi, ratio in product((0.5, 1.0), (0.25, 0.5, 1.0)):
        model = unit(xi, ratio)
        controllers = {
            "PIDA, proposed": itae.pida_setpoint(model),
            "PIDA, optimal": optima()["figure", "setpoint", math.inf, xi, ratio],
            "PID, ITAE-2": itae.pid_setpoint(model),
            "PID, optimal": optima()["figure-pid", "setpoint", math.inf, xi, ratio],
            "PID, ITAE-2, sharp": itae.pid_setpoint(model, alpha_d=0.002),
            "PID, optimal, sharp": optima()["figure-pid-sharp", "setpoint", math.inf, xi, ratio],
        }
        found[xi, ratio] = {
            name: pidalab.step_response(pidalab.Loop(model, C), fine) for name, C in controllers.items()
        }
    return found


def figure1_statements(book: Ledger) -> pd.DataFrame:
    """Paper Fig. 1: the rule, the optimum and ITAE-2."""
    rows, over = {}, {}
    for (xi, ratio), one in figure1().items():
        cost = {name: run.itae(math.inf) for name, run in one.items()}
        name = f"ξ = {xi:g}, θ/τ = {ratio:g}"
        rows[name] = {
            "rule to optimum": cost["PIDA, proposed"] / cost["PIDA, optimal"],
            "rule to ITAE-2": cost["PIDA, proposed"] / cost["PID, ITAE-2"],
            "ITAE-2 to best PID": cost["PID, ITAE-2"] / cost["PID, optimal"],
            "sharp": cost["PID, ITAE-2, sharp"] / cost["PID, optimal, sharp"],
        }
        over[name] = one["PIDA, proposed"].overshoot(), one["PIDA, optimal"].overshoot()
    table = pd.DataFrame(rows).T
    cases = {column: {name: (row[column], 1.0) for name, row in rows.items()} for column in table}
    given = "θ_m/τ_m is not in the text; taken as 0.25, 0.5 and 1, with ξ_m = 0.5, then 1. "
    text = f"{given}Over that of ITAE-2: {listed(table['rule to ITAE-2'], '.2f')}; integrals to infinity."
    book.statement("st.fig1.pid", *every(cases["rule to ITAE-2"], "<", convention="much"), note=text)
    text = f"{given}Over the least found: {listed(table['rule to optimum'], '.2f')}. A local search found the optima."
    book.statement(
        "st.fig1.optimal",
        *every(cases["rule to optimum"], "within", convention="similar"),
        note=f"{text} {SMALL}",
        digits=8,
    )
    text = (
        f"The same models. Over the least found with α_d = 0.05: {listed(table['ITAE-2 to best PID'], '.2f')}; with a "
        f"nearly ideal derivative, α_d = 0.002: {listed(table['sharp'], '.2f')}."
    )
    both = {f"{name}, α_d 0.05": pair for name, pair in cases["ITAE-2 to best PID"].items()}
    both |= {f"{name}, α_d 0.002": pair for name, pair in cases["sharp"].items()}
    book.statement(
        "st.itae2.optimal", *every(both, "within", convention="similar"), note=f"{text} {SMALL}", digits=8
    )
    text = f"{given}Rule and optimum, in per cent: {'; '.join(f'{a:.1f} and {b:.1f}' for a, b in over.values())}."
    names: dict[str, Any] = {"left_name": "overshoot of the rule", "right_name": "of the optimum"}
    book.statement("st.fig1.overshoot", *every(over, "<"), note=text, **names)
    shown = table.map("{:.2f}".format)
    shown["overshoot of rule, optimum, %"] = [f"{a:.1f}, {b:.1f}" for a, b in over.values()]
    return shown
