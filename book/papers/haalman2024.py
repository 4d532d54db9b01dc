"""haalman2024, section 4: what is given, and what chapter and audit do to its loops."""

from itertools import product

import numpy as np
from paperledger import Ledger
from scipy.optimize import brentq

import pidalab
from pidalab.rules.haalman import OutputFilter

t = np.linspace(0, 60, 6001)  # of every record: a sample each 0.01
processes = {"ex1": pidalab.lags(4), "ex2": pidalab.lags(8)}  # eqs. (11), (17)
kinds = {"pida": "PIDA", "pid": "PID"}
asked = {"ms14": 1.4, "ms20": 2.0}
tests = {"setpoint": {"setpoint": 1.0}, "load": {"load": 1.0}}

# The eight loops by the names they have in the ledger, such as ex1.pida.ms14.
cases = [".".join(parts) for parts in product(processes, kinds, asked)]
process = {case: processes[case[:3]] for case in cases}
ms = {case: asked[case[-4:]] for case in cases}
twin = {case: case.replace("pida", "pid") for case in cases if "pida" in case}

# Where the printed IAE end, and records of the noise in the measurement.
horizon = {case: 20 if "ex1" in case else 40 if ms[case] < 2 else 60 for case in cases}
noise = np.array([pidalab.uniform_noise(t, 0.1, seed) for seed in range(20)])


def second_order_models():
    """Models (14) and (20) as printed: the paper does not say how they were found."""
    printed = Ledger.open("haalman2024").printed
    found = {}
    for ex in processes:
        a2, a1, delay = (printed(f"{ex}.sopdt.{key}") for key in ("a2", "a1", "delay"))
        found[ex] = pidalab.Process([1], [a2, a1, 1], delay)
    return found


def at_ms(process, controller, ms, order, time):
    """Loop with an output filter 1/(time s + 1)^order and the gain that gives it this Ms."""
    F = OutputFilter(time, order, np.nan)
    k = pidalab.gain_for_ms(pidalab.Loop(process, controller, F), ms)
    return pidalab.Loop(process, k * controller, F)


def noise_gain(loop):
    """Standard deviation of u over that of the noise, a new value each 0.01."""
    return pidalab.noise_gain(loop, sample_time=0.01)


def at_noise(process, controller, ms, order, gain):
    """The same with the filter time that gives u this noise gain; None where none does."""

    def excess(log_time):
        loop = at_ms(process, controller, ms, order, np.exp(log_time))
        return np.log(noise_gain(loop) / gain)

    fastest, slowest = np.log((0.012, 1.5))  # filter times
    if excess(fastest) < 0:
        return None
    found = brentq(excess, fastest, slowest, xtol=1e-11)
    return at_ms(process, controller, ms, order, np.exp(found))


def load_iae(loop):
    """IAE after a unit step of the load, without noise, to the end."""
    return pidalab.load_response(loop, np.linspace(0, 400, 8001)).iae(np.inf)


# How the paper writes what the ledger calls so.
words = {"ex1": "Example 1", "ex2": "Example 2", "pida": "PIDA", "pid": "PID"}
words |= {"ms14": "Ms 1.4", "ms20": "Ms 2.0", "topdt": "model", "sopdt": "model"}
words |= {"k": "K", "l": "L", "alpha": "α", "tau": "τ", "delay": "dead time"}
words |= {"a1": "a₁", "a2": "a₂", "a3": "a₃", "wgc": "ω_gc", "filter": "time of F"}
words |= {"kp": "Kp", "ti": "Ti", "td": "Td", "ta": "Ta", "iae": "IAE"}
words |= {"setpoint": "set point", "sec3": "section 3", "sec4": "section 4"}
words |= {"eq5": "eq. (5)", "eq9": "eq. (9)", "l35": "factor of t35", "l85": "of t85"}
words |= {f"level{x}": f"level {x} %" for x in (5, 35, 85)}
words |= {"slowdown": "time of F × ω_gc", "factor": "corner of F / ω_gc"}
words |= {"haalman": "Haalman's rule", "pm": "phase margin", "noise": "noise, %"}
