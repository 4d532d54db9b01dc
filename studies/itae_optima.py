"""Find ITAE-optimal controllers for second-order models with dead time, and fit rules of `pidalab.rules` to them.

A simplex search with the exact simulation finds, for models of gain 1 and time constant 1,

* the PIDA controller of least ITAE, for set-point steps, for load steps, and for load steps with Ms up to 2;
* for each of these models the best pair of factors f_d, f_a in the rule of heo2023;
* the PID and PIDA controllers for the models of the paper's Fig. 1, the PID also with a nearly ideal derivative;
* the best pair of factors by IAE, ITAE and their sum, to see to which of these measures Table 1 of heo2023 was fitted.

The last result is written to book/data/itae_factors.csv, the others to book/data/itae_optima.csv. Then the
constants of `direct.setpoint`, `direct.load`, `itae.setpoint_factors` and `itae.load_factors` are printed. This takes
many hours on one core. ``python studies/itae_optima.py 1,0.5 0.3,2`` prints only the optima of models given as
``damping,ratio``.

The stored optima of the fit and the validation were found by the same search with a faster simulation, which agrees
with the exact one to 1e-4 (to 2e-3 for seven loads with long tails). Every stored ITAE was computed with the exact
simulation. For six optima this script found the stored parameters within 0.3 %. The constants were fitted in the same
way. The constants of the two rules for factors were fitted to tables of ITAE as a function of f_d and f_a. A full run
may change last digits.
"""

from __future__ import annotations

import csv
import math
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # threads do not help with small matrices

import numpy as np
from scipy.optimize import minimize

import pidalab
from pidalab.rules import direct, itae

DATA = Path(__file__).parents[1] / "book" / "data"
COLUMNS = (
    "role",
    "kind",
    "ms_bound",
    "damping",
    "ratio",
    "kc",
    "tau_i",
    "tau_d",
    "tau_a",
    "itae",
    "f_d",
    "f_a",
)
DAMPINGS = (0.3, 0.4, 0.55, 0.7, 0.9, 1.1, 1.5, 2.0)
RATIOS = (0.1, 0.14, 0.2, 0.28, 0.4, 0.55, 0.75, 1.0, 1.4, 2.0)
FIT = [(xi, r) for xi in DAMPINGS for r in RATIOS]
VALIDATION = [
    (round(0.3 * (2 / 0.3) ** u, 3), round(0.1 * 20**v, 3))
    for u, v in np.random.default_rng(1).random((40, 2))
]
FIGURE = [(xi, r) for xi in (0.5, 1.0) for r in (0.25, 0.5, 1.0)]
TABLE = [(xi, r) for xi in (0.3, 0.5, 0.75, 1.0) for r in (0.12, 0.25, 0.5, 0.79, 1.2, 1.6, 2.0)]
BOUND = 2.0  # largest Ms for loads
SHARP = 0.002  # α_d of a nearly ideal derivative
TASKS = (("setpoint", math.inf), ("load", math.inf), ("load", BOUND))
RUNS = {"setpoint": pidalab.step_response, "load": pidalab.load_response}
RULES = {"setpoint": (direct.setpoint, itae.pida_setpoint), "load": (direct.load, itae.pida_load)}

MEASURES = {  # "mixed" is ITAE for a step at t = 1, with time counted from 0
    "IAE": lambda run: run.iae(),
    "ITAE": lambda run: run.itae(),
    "mixed": lambda run: run.itae(origin=-1.0),
}
TIMES = np.linspace(0.0, 60.0, 3001)
Plant = tuple[float, float]


def unit(plant: Plant) -> pidalab.Process:
    """Return the model with this damping and ratio, with gain and time constant 1."""
    return pidalab.sopdt(1.0, 1.0, *plant)


def value(plant: Plant, controller: pidalab.NonInteractivePIDA, kind: str, end: float = 100.0) -> float:
    """Return the ITAE of a unit step, or infinity for an unstable loop.

    Doubling the horizon changes the value of a stored optimum by less than 2e-5 (for one load by 1.3e-4). Halving the
    step changes it by less than 6e-5.
    """
    loop = pidalab.Loop(unit(plant), controller)
    if not pidalab.is_stable(loop):
        return math.inf
    steps = math.ceil(end / min(0.01, plant[1] / 20))
    return RUNS[kind](loop, np.linspace(0.0, end, steps + 1)).itae()


def excess(plant: Plant, controller: pidalab.NonInteractivePIDA, bound: float) -> float:
    """Return the relative amount by which Ms exceeds its bound."""
    if bound == math.inf:
        return 0.0
    return max(0.0, pidalab.max_sensitivity(pidalab.Loop(unit(plant), controller))[0] / bound - 1)


def penalised(plant: Plant, controller: pidalab.NonInteractivePIDA, kind: str, bound: float) -> float:
    """Return the logarithm of ITAE, plus a steep penalty if Ms is above the bound."""
    cost = value(plant, controller, kind)
    return math.log(cost) + 20 * excess(plant, controller, bound) if cost < math.inf else 1e3


def search(
    cost: Callable[[np.ndarray], float], start: Sequence[float] | np.ndarray, size: float, tolerance: float
) -> np.ndarray:
    """Minimise by simplex search, restarted with smaller simplices until there is no improvement."""
    x, best = np.array(start, dtype=float), math.inf
    for scale in (size, size / 3, size / 9):
        simplex = np.vstack([x, x + scale * np.eye(x.size)])
        options = {"initial_simplex": simplex, "xatol": tolerance, "fatol": 1e-7}
        found = minimize(cost, x, method="Nelder-Mead", options=options)
        if not found.success:
            raise ArithmeticError(f"the least ITAE was not found: {found.message}")
        x, gain, best = found.x, best - found.fun, found.fun
        if gain < 1e-5:
            break
    return x


def optimum(plant: Plant, kind: str, bound: float) -> pidalab.NonInteractivePIDA:
    """Return the best PIDA controller, searched from the better of the two direct rules."""
    starts = [rule(unit(plant)) for rule, _ in RULES.values()]
    first = min(starts, key=lambda c: penalised(plant, c, kind, bound))
    x = [math.log(v) for v in (first.kc, first.tau_i, first.tau_d, first.tau_a)]
    found = search(
        lambda x: penalised(plant, pidalab.NonInteractivePIDA(*np.exp(x)), kind, bound),
        x,
        size=0.15,
        tolerance=2e-4,
    )
    return pidalab.NonInteractivePIDA(*np.exp(found))


def best_factors(plant: Plant, kind: str, bound: float) -> itae.Factors:
    """Return the best pair of factors of heo2023 for one plant."""
    _, rule = RULES[kind]

    def cost(pair: np.ndarray) -> float:
        f_d, f_a = (float(v) for v in pair)
        r = plant[1]
        changed = r * (1 - f_d) / (1 + 0.5 * r * f_d) if f_d > -2 / r else math.inf
        if f_d > 0.95 or f_a < 0.02 or changed > 4.5:  # a formula of Table 3 has a pole near 5.1
            return 1e3
        return penalised(plant, rule(unit(plant), factors=(f_d, f_a)), kind, bound)

    starts = [(f_d, f_a) for f_d in (-0.4, 0.05, 0.35, 0.5) for f_a in (0.4, 0.6, 0.9)]
    start = min(starts, key=lambda pair: cost(np.array(pair)))
    return itae.Factors(*(float(v) for v in search(cost, start, size=0.05, tolerance=1e-4)))


def optimal_pid(plant: Plant, alpha_d: float = 0.05) -> pidalab.NonInteractivePIDA:
    """Return the best PID controller for set-point steps, searched from the ITAE-2 rule."""

    def controller(x: np.ndarray) -> pidalab.NonInteractivePIDA:
        return pidalab.NonInteractivePIDA(*np.exp(x), 0.0, alpha_d)

    start = itae.pid_setpoint(unit(plant))
    x = [math.log(v) for v in (start.kc, start.tau_i, start.tau_d)]
    return controller(search(lambda x: penalised(plant, controller(x), "setpoint", math.inf), x, 0.15, 2e-4))


def table_factors(plant: Plant, measure: Callable[[pidalab.Response], float]) -> itae.Factors:
    """Return the pair of factors that minimises a measure of set-point steps, searched from Table 1."""

    def cost(pair: np.ndarray) -> float:
        f_d, f_a = (float(v) for v in pair)
        if not (0 <= f_d < 0.9 and f_a > 0):
            return math.inf
        loop = pidalab.Loop(unit(plant), itae.pida_setpoint(unit(plant), factors=(f_d, f_a)))
        return measure(pidalab.step_response(loop, TIMES)) if pidalab.is_stable(loop) else math.inf

    options = {"xatol": 1e-3, "fatol": 1e-4}
    found = minimize(cost, itae.factors(unit(plant)), method="Nelder-Mead", options=options)
    if not found.success:
        raise ArithmeticError(f"the best pair of factors was not found: {found.message}")
    return itae.Factors(*found.x)


def setpoint_form(plant: Plant, constants: np.ndarray) -> pidalab.NonInteractivePIDA:
    """Evaluate `direct.setpoint` with other constants: gain, lead, and correction for the derivative filter."""
    xi, r = plant
    gain, lead, off = constants
    b = lead * r - off * (0.05 / (2 * xi)) ** 2 / r
    return with_gains(gain / r * np.array([1.0, 2 * xi + b, 1 + 2 * xi * b, b]))


def load_form(plant: Plant, constants: np.ndarray) -> pidalab.NonInteractivePIDA:
    """Evaluate `direct.load` with other constants. Each gain is a weighted sum of 1, ratio * damping and ratio**2."""
    xi, r = plant
    return with_gains(constants.reshape(4, 3) @ [1.0, r * xi, r**2] / r ** np.array([3, 2, 1, 0]))


def with_gains(gains: np.ndarray) -> pidalab.NonInteractivePIDA:
    """Return the controller with these gains. The acceleration is corrected for the derivative filter."""
    ki, kp, kd, ka = gains
    tau_d = kd / kp
    return pidalab.NonInteractivePIDA(kp, kp / ki, tau_d, math.sqrt(2 * (ka / kp + 0.05 * tau_d**2)))


def setpoint_factor_form(plant: Plant, constants: np.ndarray) -> pidalab.NonInteractivePIDA:
    """Evaluate the set-point rule with other constants in `itae.setpoint_factors`, for dampings on one side of 0.9."""
    log_xi, log_r = np.log(plant)
    pair = constants.reshape(2, 4) @ [1.0, log_r, log_xi, log_r * log_xi]
    return itae.pida_setpoint(unit(plant), factors=tuple(pair))


def load_factor_form(plant: Plant, constants: np.ndarray) -> pidalab.NonInteractivePIDA:
    """Evaluate the load rule with other constants in `itae.load_factors`."""
    log_xi, log_r = np.log(plant)
    f_a = constants @ [1.0, log_r, log_xi, log_r * log_xi, log_r**2, log_xi**2]
    return itae.pida_load(unit(plant), factors=(0.0, f_a))


def fit(
    form: Callable, start: Sequence[float], least: dict[Plant, float], kind: str, bound: float
) -> np.ndarray:
    """Return the constants with the least mean of log(ITAE / optimum). If Ms is bounded, add 0.3 times the maximum."""
    scale = np.abs(start)

    def cost(x: np.ndarray) -> float:
        try:
            costs = [penalised(p, form(p, x * scale), kind, bound) - math.log(v) for p, v in least.items()]
        except ValueError:  # a gain is below 0
            return 1e3
        return float(np.mean(costs)) + (0.3 * max(costs) if bound < math.inf else 0.0)

    return search(cost, np.sign(start), size=0.03, tolerance=1e-3) * scale


def on_fit_board(plant: Plant) -> bool:
    """Return True for every other plant of the grid, like one colour of a chess board, and for the corners."""
    i, j = DAMPINGS.index(plant[0]), RATIOS.index(plant[1])
    return (i + j) % 2 == 0 or (i in (0, len(DAMPINGS) - 1) and j in (0, len(RATIOS) - 1))


def main() -> None:
    """Find the optima, write them, and fit the constants of the rules."""
    rows, least = [], {}
    for kind, bound in TASKS:
        for role, plants in (("fit", FIT), ("validation", VALIDATION)):
            for plant in plants:
                c = optimum(plant, kind, bound)
                cost = value(plant, c, kind)
                least[kind, bound, role, plant] = cost
                pair = (
                    best_factors(plant, kind, bound)
                    if role == "fit" and (kind, bound) != TASKS[1]
                    else ("", "")
                )
                rows.append((role, kind, bound, *plant, c.kc, c.tau_i, c.tau_d, c.tau_a, cost, *pair))
    for plant in FIGURE:
        found = optimum(plant, *TASKS[0]), optimal_pid(plant), optimal_pid(plant, SHARP)
        for role, c in zip(("figure", "figure-pid", "figure-pid-sharp"), found, strict=True):
            cost = value(plant, c, "setpoint")
            rows.append((role, *TASKS[0], *plant, c.kc, c.tau_i, c.tau_d, c.tau_a, cost, "", ""))
    write("itae_optima.csv", COLUMNS, rows)
    pairs = [
        (name, *plant, *table_factors(plant, measure))
        for plant in TABLE
        for name, measure in MEASURES.items()
    ]
    write("itae_factors.csv", ("measure", "damping", "ratio", "f_d", "f_a"), pairs)
    black = [p for p in FIT if on_fit_board(p)]
    low, high = ([p for p in FIT if (p[0] <= 0.9) == side] for side in (True, False))
    for form, start, (kind, bound), plants in (
        (setpoint_form, (0.72, 0.36, 0.39), TASKS[0], FIT),
        (
            load_form,
            (0.04, 0.55, 0.46, 0.34, 1.85, 0.003, 0.79, 0.71, -0.076, 0.34, 0.058, -0.023),
            TASKS[2],
            black,
        ),
        (setpoint_factor_form, (0.39, -0.02, 0.27, 0.08, 0.94, 0.21, 0.44, 0.16), TASKS[0], low),
        (setpoint_factor_form, (0.35, -0.05, -0.46, -0.19, 0.99, 0.23, -0.26, -0.24), TASKS[0], high),
        (load_factor_form, (0.72, -0.09, 0.19, 0.07, -0.06, 0.01), TASKS[2], FIT),
    ):
        targets = {p: least[kind, bound, "fit", p] for p in plants}
        print(form.__name__, fit(form, start, targets, kind, bound).round(3).tolist())


def write(name: str, columns: Sequence[str], rows: Sequence[tuple]) -> None:
    """Write a table with six digits, which determine the ITAE of an optimum to 1e-6."""
    with (DATA / name).open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows([f"{v:.6g}" if isinstance(v, float) else v for v in row] for row in rows)


if __name__ == "__main__":
    if sys.argv[1:]:
        for plant in ((float(a), float(b)) for a, b in (text.split(",") for text in sys.argv[1:])):
            for kind, bound in TASKS:
                c = optimum(plant, kind, bound)
                print(plant, kind, bound, c, f"ITAE {value(plant, c, kind):.6g}")
    else:
        main()
