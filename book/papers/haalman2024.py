"""Loops, figures and test processes for the pages on haalman2024."""

import warnings
from dataclasses import replace
from itertools import product

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import brentq

import pidalab
from pidalab import plots
from pidalab.rules import haalman

t = np.linspace(0, 60, 6001)  # times of every record
processes = {"ex1": pidalab.lags(4), "ex2": pidalab.lags(8)}  # eqs. (11), (17)
kinds = {"pida": "PIDA", "pid": "PID"}
asked = {"ms14": 1.4, "ms20": 2.0}
tests = {"setpoint": {"setpoint": 1.0}, "load": {"load": 1.0}}

# Names of the eight loops in the ledger, such as ex1.pida.ms14.
cases = [".".join(names) for names in product(processes, kinds, asked)]
process = {case: processes[case[:3]] for case in cases}
ms = {case: asked[case[-4:]] for case in cases}
twin = {case: case.replace("pida", "pid") for case in cases if "pida" in case}

# `horizon` has the end times of the printed IAE, `noise` has twenty records of measurement noise.
horizon = {case: 20 if "ex1" in case else 40 if ms[case] < 2 else 60 for case in cases}
noise = np.array([pidalab.uniform_noise(t, 0.1, seed) for seed in range(20)])


def designs(book):
    """Return models, controllers with exact gain, controllers with printed gain, and filters, by loop."""
    model, exact, used, F = {}, {}, {}, {}
    for case in cases:
        ex, kind, _ = case.split(".")
        y = pidalab.open_loop_step(processes[ex], t).y
        model[case] = pidalab.identification.three_point(
            t, y, crossing="sampled"
        ).process
        if kind == "pid":
            keys = [f"{ex}.sopdt.{key}" for key in ("a2", "a1", "delay")]
            a2, a1, delay = map(book.printed, keys)
            model[case] = pidalab.Process([1], [a2, a1, 1], delay)
        exact[case] = haalman.tune(model[case], ms[case], kinds[kind], m=10).controller
        used[case] = replace(exact[case], kp=book.printed(f"{case}.kp"))
        F[case] = haalman.output_filter(model[case], used[case])
    return model, exact, used, F


def read(ex, step, levels, way):
    """Return the parameters by eq. (5), from a response sampled every `step` and read at these levels."""
    t = np.arange(0, 60 + step / 2, step)
    y = pidalab.open_loop_step(processes[ex], t).y
    if way == "interpolated":
        t5, t35, t85 = np.interp(levels, y, t)
    else:
        t5, t35, t85 = (t[np.argmax(y >= level)] for level in levels)
    L, tau = 1.3 * t35 - 0.29 * t85, 0.67 * (t85 - t35)
    alpha = 0.598 + 0.4799 * t5 / L - 0.41 * (tau / t5) ** 0.6
    lag = (1 - alpha) * L / 2
    a3, a2, a1, _ = np.polymul([tau, 1], np.polymul([lag, 1], [lag, 1]))
    found = {"l": L, "alpha": alpha, "tau": tau, "a3": a3, "a2": a2, "a1": a1}
    return found | {"delay": alpha * L}


def draw(loop, ex, ms):
    """Draw y above u after a set-point and a load step, each with one noisy run."""
    figure, axes = plt.subplots(2, 2, figsize=(5.0, 4.4))
    last = horizon[f"{ex}.pida.{ms}"]
    ends = (
        4 if ex == "ex1" else 15,
        last,
    )  # ends of the time axis of u: after the set-point step, after the load step
    for (y, u), (test, step), end in zip(axes.T, tests.items(), ends, strict=True):
        runs = {label: loop[f"{ex}.{kind}.{ms}"] for kind, label in kinds.items()}
        clean = {k: pidalab.simulate(x, t, **step) for k, x in runs.items()}
        step = step | {"noise": noise[0]}
        noisy = {k: pidalab.simulate(x, t, **step) for k, x in runs.items()}
        plots.signal(y, clean, "y", until=last, faint=noisy)
        plots.signal(u, clean, "u", until=end, faint=noisy)
        y.set(title=f"{test.replace('setpoint', 'set-point')} step", xlabel="")
    axes[0, 0].set_ylabel("output y")
    axes[1, 0].set_ylabel("control u")
    plots.legend(figure)


def live_knob(model):
    """Return a live figure of two PIDA loops, each with a knob for Ms."""
    labels = {"Ms, solid": 1.4, "Ms, dashed": 2.0}
    gains = {
        f"Ms {ms}": [*haalman.pida(model, ms, m=10).gains()] for ms in labels.values()
    }
    controllers = {name: pidalab.HighOrderPID(K, 0.05, 3) for name, K in gains.items()}
    knob = {"key": "ms", "low": 1.1, "high": 3, "step": 0.01}
    live = plots.live(
        model,
        controllers,
        rule="gain",
        conditions={"end": 25},
        knobs=[knob | {"design": k, "label": label} for k, label in enumerate(labels)],
        plots=["nyquist", "load"],
        numbers=["ms", "gm", "pm", "iae"],
        caption="Turn one of the knobs. Each curve touches the circle of radius 1/Ms around −1. With a higher Ms "
        "the load is rejected better. Both loops consist of a PIDA with a single filter, and the model.",
        lab=True,
    )
    for drawn, ms in zip(live.state["designs"], labels.values(), strict=True):
        drawn["ms"] = ms
    return live


def own_model(ratio, alpha):
    """Return the process (4) with K = 1, τ = 1 and the apparent dead time `ratio`."""
    lag = (1 - alpha) * ratio / 2
    return pidalab.Process(
        [1.0], np.polymul([1, 1], np.polymul([lag, 1], [lag, 1])), alpha * ratio
    )


def read_own_model(ratio, alpha):
    """Fit a model to three points of the response of `own_model`."""
    record = np.linspace(0, 12 * (1 + ratio), 6001)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pidalab.areas.RecordWarning)
        return pidalab.identification.three_point(
            record, pidalab.open_loop_step(own_model(ratio, alpha), record).y
        )


def with_peak(loop, top, t):
    """Return a step response. If u exceeds `top`, a prefilter 1/(T s + 1)² lowers the peak of u to `top`."""

    def run(T):
        blocks = loop.process, loop.controller, loop.output_filter
        return pidalab.step_response(
            pidalab.Loop(*blocks, pidalab.Process([1], [T**2, 2 * T, 1])), t
        )

    bare = pidalab.step_response(loop, t)
    if bare.peak("u") <= top:
        return bare
    return run(brentq(lambda T: run(T).peak("u") - top, 0.001, 2.0))


def at_ms(process, controller, ms, order, time):
    """Return the loop with an output filter 1/(time s + 1)^order and the gains scaled for this Ms."""
    F = haalman.OutputFilter(time, order, np.nan)
    k = pidalab.gain_for_ms(pidalab.Loop(process, controller, F), ms)
    return pidalab.Loop(process, k * controller, F)


def noise_gain(loop):
    """Return the noise gain if the noise changes every 0.01."""
    return pidalab.noise_gain(loop, sample_time=0.01)


def at_noise(process, controller, ms, order, gain):
    """Return the loop of `at_ms` with this noise gain, or None if the noise gain is always lower."""

    def excess(log_time):
        loop = at_ms(process, controller, ms, order, np.exp(log_time))
        return np.log(noise_gain(loop) / gain)

    fastest, slowest = np.log((0.012, 1.5))  # filter times
    if excess(fastest) < 0:
        return None
    found = brentq(excess, fastest, slowest, xtol=1e-11)
    return at_ms(process, controller, ms, order, np.exp(found))


def load_iae(loop):
    """Return the IAE after a unit step of the load, integrated to infinity."""
    return pidalab.load_response(loop, np.linspace(0, 400, 8001)).iae(np.inf)


# The paper's notation for the parts of names in the ledger.
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
