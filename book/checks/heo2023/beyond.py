"""Beyond the paper: what the rule costs, and how near it and other rules come to the optimum; no row of the ledger."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import ClassVar

import control
import numpy as np
import pandas as pd
import pidalab
from pidalab.controllers import NonInteractivePIDA
from pidalab.process import Process
from pidalab.response import Response
from pidalab.rules import direct, itae

from .examples import KINDS, METHODS, processes, second_order, tuned
from .table1 import data, optima, unit, with_factors

BOUNDS = {"setpoint": math.inf, "load": 2.0}  # on Ms, of the optima that the rules are compared with
COLUMNS = ("itae", "ms", "overshoot", "kick")
LIMITS = (math.inf, 100.0, 30.0, 10.0, 5.0, 2.0)
LAGS = (0.0, 0.05, 0.1, 0.15, 0.25, 0.35, 0.5, 0.6, 0.7)
TENTH = 10  # one row of so many is recomputed

Rule = Callable[[Process], NonInteractivePIDA]
CONTEST: dict[str, dict[str, Rule]] = {
    "setpoint": {
        "ITAE-2": itae.pid_setpoint,
        "Table 1": itae.pida_setpoint,
        "refit": lambda m: itae.pida_setpoint(m, factors=itae.setpoint_factors),
        "direct": direct.setpoint,
    },
    "load": {
        "ITAE-2": itae.pid_load,
        "Table 1": itae.pida_load,
        "refit": lambda m: itae.pida_load(m, factors=itae.load_factors),
        "direct": direct.load,
    },
}


@dataclass(frozen=True)
class Task:
    """One row of book/data/itae_rules.csv: a rule on a model; without `least` only Ms is wanted."""

    NAMES: ClassVar = ("role", "kind", "rule", "damping", "ratio")
    role: str
    kind: str
    rule: str
    damping: float
    ratio: float
    controller: NonInteractivePIDA
    least: float = math.nan

    @property
    def names(self) -> tuple[str, str, str, float, float]:
        """What tells the row from others."""
        return self.role, self.kind, self.rule, self.damping, self.ratio


def tasks() -> list[Task]:
    """All rows of the table: Ms on a grid of models, and every rule on the models whose optimum is known."""
    found = []
    grid = [
        (round(float(xi), 6), round(float(r), 6))
        for xi in np.linspace(0.3, 2, 15)
        for r in np.geomspace(0.1, 2, 15)
    ]
    for kind, rule, (xi, r) in product(CONTEST, ("ITAE-2", "Table 1"), grid):
        found.append(Task("grid", kind, rule, xi, r, CONTEST[kind][rule](unit(xi, r))))
    for one in data("itae_optima.csv").itertuples():
        if one.role not in ("fit", "validation") or one.ms_bound != BOUNDS[one.kind]:
            continue
        model, at = unit(one.damping, one.ratio), (one.damping, one.ratio)
        tried = {name: rule(model) for name, rule in CONTEST[one.kind].items()}
        tried["least"] = optima()[one.role, one.kind, one.ms_bound, *at]
        if one.role == "fit" and one.kind == "setpoint":
            tried["best factors"] = with_factors(model, one.f_d, one.f_a)
        found += [Task(one.role, one.kind, name, *at, C, one.itae) for name, C in tried.items()]
    return found


def measure(task: Task) -> tuple[float, float, float, float]:
    """ITAE over the least, Ms, overshoot in per cent and u(0+) of a set-point step; infinite if unstable."""
    loop = pidalab.Loop(unit(task.damping, task.ratio), task.controller)
    if not pidalab.is_stable(loop):
        return math.inf, math.inf, math.nan, math.nan
    ms = pidalab.max_sensitivity(loop)[0]
    if math.isnan(task.least):
        return math.nan, ms, math.nan, math.nan
    run = KINDS[task.kind](loop, np.linspace(0, 80, math.ceil(80 / min(0.04, task.ratio / 8)) + 1))
    kick = float(pidalab.step_response(loop, [0.0, 0.01]).u[0])
    return run.itae() / task.least, ms, run.overshoot() if task.kind == "setpoint" else math.nan, kick


@cache
def contest() -> pd.DataFrame:
    """The stored table."""
    return data("itae_rules.csv")


def recomputed() -> pd.DataFrame:
    """Every tenth row of the stored table, in an order drawn once with the seed 2023, computed anew."""
    stored, all_tasks = contest(), tasks()
    assert [task.names for task in all_tasks] == [
        *stored[list(Task.NAMES)].itertuples(index=False, name=None)
    ]
    chosen = np.random.default_rng(2023).permutation(len(stored))[::TENTH]
    fresh = np.array([measure(all_tasks[i]) for i in chosen])
    with np.errstate(invalid="ignore"):
        apart = np.abs(fresh / stored[list(COLUMNS)].to_numpy()[chosen] - 1)
    same = np.isnan(fresh) == stored[list(COLUMNS)].isna().to_numpy()[chosen]
    assert same.all()
    assert np.nanmax(np.where(np.isfinite(fresh), apart, np.nan)) < 1e-5
    counts = {
        "rows": len(stored),
        "recomputed": len(chosen),
        "of them unstable": int(np.isinf(fresh[:, 1]).sum()),
    }
    return pd.DataFrame({"": {**counts, "largest relative difference": "below 1e-5"}})


def unseen() -> pd.DataFrame:
    """All rules on the models that no fit has seen."""
    rows = {}
    for (kind, rule), one in (
        contest().query("role == 'validation' and rule != 'least'").groupby(["kind", "rule"], sort=False)
    ):
        stable = np.isfinite(one.itae)
        spoken = kind.replace("setpoint", "set point")
        rows[f"{spoken}, {rule}"] = {
            "mean": f"{math.exp(np.log(one.itae[stable]).mean()):.2f}",
            "worst": f"{one.itae[stable].max():.2f}",
            "unstable": f"{(~stable).sum()}",
            "Ms": f"{one.ms[stable].median():.2f}",
            "largest": f"{one.ms[stable].max():.2f}",
            "overshoot, %": f"{one.overshoot.median():.1f}".replace("nan", "–"),
            "u(0+)": f"{one.kick.median():.0f}",
        }
    return pd.DataFrame(rows).T


@cache
def zeros() -> dict[tuple[float, float], tuple[np.ndarray, np.ndarray, float]]:
    """Poles of each model, zeros of its best set-point controller, and how far the nearest zero is from a pole."""
    found = {}
    for (role, kind, _, xi, r), C in optima().items():
        if (role, kind) == ("fit", "setpoint"):
            gains, poles = C.gains(), np.roots([1.0, 2 * xi, 1.0])
            # the derivative filter takes alpha_d kp td² of the acceleration away again
            lost = gains.kp * C.alpha_d * C.tau_d**2
            places = np.roots([gains.ka - lost, gains.kd, gains.kp, gains.ki])
            found[xi, r] = poles, places, max(float(np.abs(places / pole - 1).min()) for pole in poles)
    return found


def free_peaks() -> list[float]:
    """Ms of the load optima without a bound, on the models that no fit has seen."""
    return [
        pidalab.max_sensitivity(pidalab.Loop(unit(xi, r), C))[0]
        for (role, kind, bound, xi, r), C in optima().items()
        if (role, kind, bound) == ("validation", "load", math.inf)
    ]


@cache
def limited(name: str, limit: float, lag: float) -> Response:
    """Example 1 with a digital controller of limited output and a filter of the set point, 1/(lag s + 1)²."""
    controller = {
        "ITAE-2": tuned()[1, "itae2", "setpoint"],
        "proposed": tuned()[1, "proposed", "setpoint"],
        "direct": direct.setpoint(second_order()[1].process),
    }[name]
    smooth = control.tf([1.0], [lag**2, 2 * lag, 1.0]) if lag else None
    loop = pidalab.Loop(processes()[1], controller, prefilter=smooth)
    return pidalab.simulate_sampled(loop, np.linspace(0, 12, 60001), setpoint=1.0, limits=(-limit, limit))


@cache
def best_lag(name: str, limit: float) -> tuple[float, float]:
    """Least ITAE over the time constants of the filter, and the one that gives it."""
    return min((limited(name, limit, lag).itae(), lag) for lag in LAGS)


def actuator() -> pd.DataFrame:
    """ITAE with a limited actuator; in parentheses the best time constant of the set-point filter."""
    rows: dict[str, dict[str, str]] = {}
    for limit in LIMITS:
        row = rows.setdefault("none" if limit == math.inf else f"±{limit:g}", {})
        for name in ("ITAE-2", "proposed"):
            row[f"{name}, no filter"] = f"{limited(name, limit, 0.0).itae():.2f}"
        for name in ("ITAE-2", "proposed", "direct"):
            row[f"{name}, best"] = "{:.2f} ({:g})".format(*best_lag(name, limit))
    return pd.DataFrame(rows).T.rename_axis("limit of u")


def gained(limit: float) -> str:
    """What the proposed PIDA gains over the PID with a limited actuator, both with their best filter."""
    return f"{100 * (1 - best_lag('proposed', limit)[0] / best_lag('ITAE-2', limit)[0]):.0f} %"


def sample_times() -> pd.DataFrame:
    """ITAE of Example 1 with a digital controller, for several sample times; infinite if unstable."""
    rows = {}
    for h in (0.0001, 0.0003, 0.001, 0.003, 0.01):
        t, row = h * np.arange(round(15 / h) + 1), {}
        for method in ("itae2", "proposed"):
            loop = pidalab.Loop(processes()[1], tuned()[1, method, "setpoint"])
            value = pidalab.simulate_sampled(loop, t, setpoint=1.0).itae()
            row[METHODS[method]] = f"{value:.3g}" if value < 100 else "unstable"
        rows[f"{h:g}"] = row
    return pd.DataFrame(rows).T.rename_axis("sample time")


@cache
def on_full(kind: str) -> dict[str, dict[str, tuple[float, float]]]:
    """ITAE and Ms of all rules on seven processes that are no models, each reduced first."""
    full = {f"Example {k}": process for k, process in processes().items()}
    full |= {
        "8 lags": pidalab.lags(8),
        "4 lags with delay 2": pidalab.lags(4, delay=2.0),
        "lags 1 to 1/8": Process([1.0], np.poly([-1.0, -2.0, -4.0, -8.0]) / 64),
        "3 lags, zero at +2": Process([-0.5, 1.0], [1.0, 3.0, 3.0, 1.0], delay=0.1),
    }
    rows: dict[str, dict[str, tuple[float, float]]] = {}
    t = np.linspace(0, 200, 10001)
    for name, process in full.items():
        model = pidalab.reduction.to_sopdt(process).process
        loops = {label: pidalab.Loop(process, rule(model)) for label, rule in CONTEST[kind].items()}
        rows[name] = {
            label: (KINDS[kind](loop, t).itae(), pidalab.max_sensitivity(loop)[0])
            for label, loop in loops.items()
        }
    return rows


def on_processes(kind: str) -> pd.DataFrame:
    """ITAE on these processes, with Ms in parentheses."""
    return pd.DataFrame(on_full(kind)).T.map(lambda pair: "{:.3g} ({:.2f})".format(*pair))
