"""Examples, controllers, figures and other rules for the pages on heo2023, and a search for the optimum."""

import math
import warnings
from itertools import product

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from scipy.optimize import minimize

import pidalab
from pidalab import plots
from pidalab.rules import direct, itae

EXAMPLES = {  # eqs. (17), (18) and (19)
    "ex1": pidalab.lags(3, delay=0.2),
    "ex2": pidalab.lags(5),
    "ex3": pidalab.Process([1.0], np.polymul([9.0, 2.4, 1.0], [1.0, 1.0]), delay=0.5),
}
TABLES = {"ex1": "table4", "ex2": "table5", "ex3": "table6"}
METHODS = {"imc": "IMC", "itae2": "ITAE-2", "proposed": "proposed"}
KINDS = {"itae2": "PID", "proposed": "PIDA"}
TESTS = {"setpoint": pidalab.step_response, "load": pidalab.load_response}
FIRST = {ex: pidalab.reduction.to_fopdt(process) for ex, process in EXAMPLES.items()}
SECOND = {ex: pidalab.reduction.to_sopdt(process) for ex, process in EXAMPLES.items()}


def tuned(ex, method, test):
    """Return a controller of Tables 4 to 6."""
    if method == "imc":
        return itae.imc_pid(FIRST[ex].process)
    return itae.tune(SECOND[ex].process, test, KINDS[method]).controller


NAMES = {
    (ex, test): f"Example {ex[2]}, {test.replace('setpoint', 'set point')}"
    for ex, test in product(EXAMPLES, TESTS)
}
CASES = list(product(EXAMPLES, METHODS, TESTS))
CONTROLLERS = {case: tuned(*case) for case in CASES}
LOOPS = {case: pidalab.Loop(EXAMPLES[case[0]], C) for case, C in CONTROLLERS.items()}


def shape(model):
    """Return the parameters of a model, by their names in the ledger."""
    found = {"tau": model.tau, "theta": model.delay}
    return found | ({"xi": model.damping} if hasattr(model, "damping") else {})


def tunings(C):
    """Return the tunings of a controller, by their names in the ledger."""
    found = {"kc": C.kc, "taui": C.tau_i, "taud": C.tau_d}
    return found | ({"taua": C.tau_a} if C.tau_a else {})


# ---- figures and tables of the chapter
LABELS = {"proposed": "PIDA, proposed", "itae2": "PID, ITAE-2", "imc": "PID, IMC"}


def run(case, until=200):
    """Return the response of a loop of Tables 4 to 6, sampled every 0.02."""
    return TESTS[case[2]](LOOPS[case], np.linspace(0, until, 50 * until + 1))


def draw(ex, until, first):
    """Draw one of Figs 2 to 4, with u below. The first peak of u is cut off and given as text."""
    figure, axes = plt.subplots(2, 2, figsize=(5.6, 3.7))
    for (y, u), test, end in zip(axes.T, TESTS, (first, until), strict=True):
        runs = {
            label: run((ex, method, test), until) for method, label in LABELS.items()
        }
        plots.signal(y, runs, "y", until=until)
        plots.signal(u, runs, "u", until=end)
        y.set(xlabel="", title=f"{test.replace('setpoint', 'set-point')} step")
    u = {method: run((ex, method, "setpoint"), until).u for method in LABELS}
    kick = f"PIDA {u['proposed'][0]:.0f}, then −{-u['proposed'].min():.0f}"
    kick += f"\nPIDs {u['itae2'][0]:.0f} and {u['imc'][0]:.0f}"
    place = {"ha": "right", "va": "top", "transform": axes[1, 0].transAxes}
    axes[1, 0].text(1.0, 1.0, kick, **place)
    axes[0, 0].set_ylabel("output y")
    axes[1, 0].set(ylabel="control u", ylim=(-5, 15))
    plots.legend(figure)


def measured():
    """Return a table of measures of the responses of Figs 2 to 4."""
    rows = {}
    for ex, method in product(EXAMPLES, METHODS):
        servo, load = (run((ex, method, test)) for test in TESTS)
        rows[f"Example {ex[2]}, {METHODS[method]}"] = {
            "rise time": f"{servo.rise_time():.2f}",
            "overshoot, %": f"{servo.overshoot():.1f}",
            "settling, 2 %": f"{servo.settling_time():.1f}",
            "u(0+)": f"{servo.u[0]:.0f}",
            "load peak": f"{load.y.max():.3f}",
        }
    return pd.DataFrame(rows).T


def live_actuator():
    """Return a live figure of Example 1 with limited u, for the paper's PID and PIDA."""
    model, controllers = SECOND["ex1"].process, {}
    for kind, order in (("PID", 2), ("PIDA", 3)):
        gains = itae.tune(model, "setpoint", kind).controller.gains()
        controllers[kind] = pidalab.HighOrderPID([*gains[: order + 1]], 0.05, order)
    loop = pidalab.Loop(EXAMPLES["ex1"], controllers["PIDA"])
    peak = pidalab.step_response(loop, np.linspace(0, 1, 2001)).u.max()
    most = 10 * float(np.ceil(peak / 10))  # a limit of this size never acts
    limit = {"key": "limits", "label": "limit of u", "low": most / 50, "high": most}
    slow = {"key": "filterTime", "label": "filter time", "low": 0.02, "high": 0.5}
    return plots.live(
        "heo-1",
        controllers,
        conditions={"limits": [-most / 10, most / 10], "antiWindup": "clamping"},
        knobs=[knob | {"log": True} for knob in (limit, slow)],
        plots=["setpoint", "control"],
        numbers=["iaeSetpoint", "peak", "ms", "sigma"],
        caption="Raise the limit until nothing is cut off: the PIDA needs a higher limit than the PID. Or make the "
        "filter slower. The figure has set-point steps of Example 1, without a prefilter. PID and PIDA are tuned by "
        "the paper's rules, each with one filter on all its terms, and with clamping at the limit of u.",
        lab=True,
    )


def ms_map(rule, dampings, ratios):
    """Return Ms of a rule on models with gain and time constant 1. Ms is infinite for unstable loops."""
    rows = {}
    for xi, r in product(dampings.tolist(), ratios.tolist()):
        model = unit(xi, r)
        loop = pidalab.Loop(model, rule(model))
        stable = pidalab.is_stable(loop)
        ms = pidalab.max_sensitivity(loop)[0] if stable else np.inf
        rows.setdefault(xi, {})[r] = ms
    return pd.DataFrame(rows).T


# ---- beyond the paper: a limited actuator, and four rules
def limited(C, limit, lag):
    """Return the set-point response of Example 1 with u within ±limit and the prefilter 1/(lag s + 1)²."""
    digital = C.discretise(0.001, "tustin", limits=(-limit, limit), anti_windup=None)
    smooth = pidalab.Process([1.0], [lag**2, 2 * lag, 1.0]) if lag else None
    loop = pidalab.Loop(EXAMPLES["ex1"], digital, prefilter=smooth)
    return pidalab.simulate_sampled(loop, np.linspace(0, 12, 12001), setpoint=1.0)


RULES = {
    "setpoint": {
        "ITAE-2": itae.pid_setpoint,
        "Table 1": itae.pida_setpoint,
        "refit": lambda m: itae.pida_setpoint(m, factors=itae.setpoint_factors(m)),
        "direct": direct.setpoint,
    },
    "load": {
        "ITAE-2": itae.pid_load,
        "Table 1": itae.pida_load,
        "refit": lambda m: itae.pida_load(m, factors=itae.load_factors(m)),
        "direct": direct.load,
    },
}


def unit(damping, ratio):
    """Return a model with gain 1 and time constant 1."""
    return pidalab.sopdt(1.0, 1.0, damping, ratio)


def measures(model, controller, test):
    """Return ITAE, Ms, overshoot in per cent and u(0+). ITAE and Ms of unstable loops are infinite."""
    loop = pidalab.Loop(model, controller)
    if not pidalab.is_stable(loop):
        return math.inf, math.inf, math.nan, math.nan
    samples = math.ceil(80 / min(0.04, model.delay / 8)) + 1
    run = TESTS[test](loop, np.linspace(0, 80, samples))
    over = math.nan
    if test == "setpoint":
        with warnings.catch_warnings():  # an overshoot to within 0.1 % is exact enough
            warnings.simplefilter("ignore", RuntimeWarning)
            over = run.overshoot()
    kick = pidalab.step_response(loop, [0.0, 0.01]).u[0]
    return run.itae(), pidalab.max_sensitivity(loop)[0], over, kick


def least(model, test, start, ms=math.inf, sharp=1e-3):
    """Search the PIDA of least ITAE from `start`, by a simplex over the logarithms of its parameters.

    The cost rises steeply if Ms exceeds the bound `ms`. The search ends if the parameters change by less than `sharp`.
    """
    t = np.linspace(0, 60, 3001)

    def controller(x):
        return pidalab.NonInteractivePIDA(*np.exp(x).tolist())

    def cost(x):
        loop = pidalab.Loop(model, controller(x))
        if not pidalab.is_stable(loop):
            return 1e3
        excess = (
            max(0.0, pidalab.max_sensitivity(loop)[0] / ms - 1)
            if ms < math.inf
            else 0.0
        )
        return math.log(TESTS[test](loop, t).itae()) + 20 * excess

    x = np.log([start.kc, start.tau_i, start.tau_d, start.tau_a])
    for size in (0.15, 0.03):
        options = {"initial_simplex": np.vstack([x, x + size * np.eye(4)])}
        options |= {"xatol": sharp, "fatol": 1e-2 * sharp}
        found = minimize(cost, x, method="Nelder-Mead", options=options)
        if not found.success:
            raise ArithmeticError(f"the least ITAE was not found: {found.message}")
        x = found.x
    return controller(x)


# ---- the paper's notation for names in the ledger
WORDS = {"setpoint": "set point", "itae2": "ITAE-2", "imc": "IMC"}
WORDS |= {ex: f"Example {ex[2]}" for ex in EXAMPLES}
WORDS |= {"tau": "τ", "theta": "θ", "xi": "ξ", "kc": "k_c"}
WORDS |= {"taui": "τ_i", "taud": "τ_d", "taua": "τ_a"}
for (_, table), method in product(TABLES.items(), METHODS):
    WORDS[f"{table}.{method}"] = METHODS[method]
    for test in TESTS:
        WORDS[f"{table}.{method}.{test}"] = (
            f"{METHODS[method]}, {WORDS.get(test, test)}"
        )
for ex, method in product(EXAMPLES, METHODS):
    WORDS[f"itae.{ex}.{method}"] = f"Example {ex[2]}, {METHODS[method]}"
