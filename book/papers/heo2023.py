"""Examples, controllers and rules of heo2023, and a simulation as a short script would run it."""

import math
from itertools import product

import numba
import numpy as np
from scipy.linalg import expm
from scipy.optimize import minimize

import pidalab
from pidalab.roots import succeeded
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
    """Controller of Tables 4 to 6."""
    if method == "imc":
        return itae.imc_pid(FIRST[ex].process)
    return itae.tune(SECOND[ex].process, test, KINDS[method]).controller


def with_f_d(ex, test, f_d):
    """The proposed controller with another f_d, and f_a of Table 1."""
    rule = {"setpoint": itae.pida_setpoint, "load": itae.pida_load}[test]
    model = SECOND[ex].process
    return rule(model, factors=(f_d, itae.factors(model).f_a))


NAMES = {
    (ex, test): f"Example {ex[2]}, {test.replace('setpoint', 'set point')}"
    for ex, test in product(EXAMPLES, TESTS)
}
CASES = list(product(EXAMPLES, METHODS, TESTS))
CONTROLLERS = {case: tuned(*case) for case in CASES}
LOOPS = {case: pidalab.Loop(EXAMPLES[case[0]], C) for case, C in CONTROLLERS.items()}


def shape(model):
    """Parameters of a model by the names of the tables."""
    found = {"tau": model.tau, "theta": model.delay}
    return found | ({"xi": model.damping} if hasattr(model, "damping") else {})


def tunings(C):
    """Tunings of a controller by the names of the tables."""
    found = {"kc": C.kc, "taui": C.tau_i, "taud": C.tau_d}
    return found | ({"taua": C.tau_a} if C.tau_a else {})


# ---- the printed ITAE: unit steps at t = 1, integrals from t = 0 to these ends
ENDS = {
    "ex1": {"setpoint": 8, "load": 12},
    "ex2": {"setpoint": 20, "load": 25},
    "ex3": {"setpoint": 15, "load": 15},
}
SIMULATED = {(ex, test): EXAMPLES[ex] for ex, test in NAMES}
# the dead time of Example 1 left in
SIMULATED["ex2", "setpoint"] = pidalab.lags(5, delay=0.2)
DIFFERENCES = {  # of s/(T s + 1): its gain c and pole p in v[k] = p v[k-1] + c (e[k] - e[k-1])
    "tustin": lambda T, h: (2 / (2 * T + h), (2 * T - h) / (2 * T + h)),
    "hold": lambda T, h: (1 / T, math.exp(-h / T)),
    "backward": lambda T, h: (1 / (T + h), T / (T + h)),
    "forward": lambda T, h: (1 / T, 1 - h / T),
}


def printed_itae(
    case, C=None, plant=None, derivative="tustin", present=True, late=False, exact=False
):
    """ITAE of an experiment of sec. 3, stepped every 0.001, acceleration filters by Tustin's rule.

    `C`, `plant`: others than those of the case. `derivative`: how the derivative filter is
    discretised. `present`: the integral knows the present error. `late`: a sample is weighed with the
    time at its end. `exact`: it is stepped for a held input, not by Euler's method.
    """
    ex, _, test = case
    C, plant = C or CONTROLLERS[case], plant or SIMULATED[ex, test]
    h, n = 0.001, plant.den.size - 1
    A, b = np.zeros((n, n)), np.zeros(n)
    A[:-1, 1:] = np.eye(n - 1)
    A[-1] = -plant.den[:0:-1] / plant.den[0]
    b[-1] = plant.num[-1] / plant.den[0]
    phi, gamma = np.eye(n) + h * A, h * b
    if exact:
        both = expm(h * np.block([[A, b[:, None]], [np.zeros((1, n + 1))]]))
        phi, gamma = both[:n, :n].copy(), both[:n, n].copy()
    slow = DIFFERENCES[derivative](C.alpha_d * C.tau_d, h)
    fast = DIFFERENCES["tustin"](C.alpha_a * C.tau_a, h)
    gains = C.kc, C.tau_i, C.tau_d, C.tau_a**2 / 2
    delay, samples = round(plant.delay / h), round(ENDS[ex][test] / h)
    load = test == "load"
    error = _march(h, phi, gamma, delay, samples, slow, fast, gains, load, present)
    return h**2 * np.sum((np.arange(samples) + late) * np.abs(error))


@numba.njit(error_model="numpy")
def _march(h, phi, gamma, delay, samples, slow, fast, gains, load, present):
    (kc, tau_i, tau_d, ta2), step = gains, round(1 / h)
    x, new = np.zeros(gamma.size), np.zeros(gamma.size)
    error, waiting = np.zeros(samples), np.zeros(samples + delay)
    integral = last = d = v = a = 0.0
    for k in range(samples):
        e = (k >= step and not load) - x[0]
        if present:
            integral += h * e
        d = slow[1] * d + slow[0] * (e - last)
        before, v = v, fast[1] * v + fast[0] * (e - last)
        a = fast[1] * a + fast[0] * (v - before)
        waiting[k + delay] = kc * (e + integral / tau_i + tau_d * d + ta2 * a) + (
            k >= step and load
        )
        if not present:
            integral += h * e
        for i in range(x.size):
            new[i] = gamma[i] * waiting[k]
            for j in range(x.size):
                new[i] += phi[i, j] * x[j]
        x, new = new, x
        error[k] = last = e
    return error


# ---- beyond the paper: a limited actuator, and four rules on models of gain and time constant 1
def limited(C, limit, lag):
    """Set-point step of Example 1, u within ±limit, behind a filter 1/(lag s + 1)²."""
    digital = C.discretise(0.001, "tustin", limits=(-limit, limit), anti_windup=None)
    smooth = pidalab.Process([1.0], [lag**2, 2 * lag, 1.0]) if lag else None
    loop = pidalab.Loop(EXAMPLES["ex1"], digital, prefilter=smooth)
    return pidalab.simulate_sampled(loop, np.linspace(0, 12, 12001), setpoint=1.0)


RULES = {
    "setpoint": {
        "ITAE-2": itae.pid_setpoint,
        "Table 1": itae.pida_setpoint,
        "refit": lambda model: itae.pida_setpoint(
            model, factors=itae.setpoint_factors(model)
        ),
        "direct": direct.setpoint,
    },
    "load": {
        "ITAE-2": itae.pid_load,
        "Table 1": itae.pida_load,
        "refit": lambda model: itae.pida_load(model, factors=itae.load_factors(model)),
        "direct": direct.load,
    },
}


def unit(damping, ratio):
    """Model of gain and time constant 1."""
    return pidalab.sopdt(1.0, 1.0, damping, ratio)


def measures(model, controller, test):
    """ITAE, Ms, overshoot in per cent and u(0+) of a loop; infinite ITAE and Ms if it is unstable."""
    loop = pidalab.Loop(model, controller)
    if not pidalab.is_stable(loop):
        return math.inf, math.inf, math.nan, math.nan
    samples = math.ceil(80 / min(0.04, model.delay / 8)) + 1
    run = TESTS[test](loop, np.linspace(0, 80, samples))
    over = run.overshoot() if test == "setpoint" else math.nan
    ms, kick = (
        pidalab.max_sensitivity(loop)[0],
        pidalab.step_response(loop, [0.0, 0.01]).u[0],
    )
    return run.itae(), ms, over, kick


def least(model, test, start, ms=math.inf, sharp=1e-3):
    """Search the PIDA of least ITAE from `start`, by a simplex over the logarithms of its parameters.

    `ms`: a bound on Ms, beyond which the cost is steep. `sharp`: how far the parameters are followed.
    """
    t = np.linspace(0, 60, 3001)

    def controller(x):
        return pidalab.NonInteractivePIDA(*np.exp(x).tolist())

    def cost(x):
        loop = pidalab.Loop(model, controller(x))
        if not pidalab.is_stable(loop):
            return 1e3
        excess = 0.0
        if ms < math.inf:
            excess = max(0.0, pidalab.max_sensitivity(loop)[0] / ms - 1)
        return math.log(TESTS[test](loop, t).itae()) + 20 * excess

    x = np.log([start.kc, start.tau_i, start.tau_d, start.tau_a])
    for size in (0.15, 0.03):
        options = {"initial_simplex": np.vstack([x, x + size * np.eye(4)])}
        options |= {"xatol": sharp, "fatol": 1e-2 * sharp}
        found = minimize(cost, x, method="Nelder-Mead", options=options)
        x = succeeded(found, "the least ITAE").x
    return controller(x)


# ---- how the paper writes what the ledger calls so
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
