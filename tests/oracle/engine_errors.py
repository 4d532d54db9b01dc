"""Build the loops of the oracles, and compare the exact engine with them."""

import json
from pathlib import Path

import control
import numpy as np

import pidalab
from pidalab.simulation.exact import unit_step_responses

INPUTS = {"setpoint": "r", "load": "d", "noise": "n"}
SIGNALS = {"y": 0, "u": 2}  # rows of a unit step response


def oracle(name):
    """Return the content of an oracle file."""
    return json.loads(Path(__file__).with_name(name).read_text(encoding="utf-8"))


def oracle_loop(case):
    """Return the loop of a case, with the coefficients of the file."""

    def block(name):
        return control.tf(case[name]["num"], case[name]["den"]) if case.get(name) else None

    process = pidalab.Process(case["process"]["num"], case["process"]["den"], case["delay"])
    return pidalab.Loop(process, block("controller") or 1.0, block("output_filter"), block("prefilter"))


def sampled_oracle_loop(case, digital=True):
    """Return the loop of a case of sampled_loops.json, with its digital or continuous controller."""
    process = pidalab.Process(case["process"]["num"], case["process"]["den"], case["delay"])
    controller = getattr(pidalab, case["controller"])(**case["arguments"])
    if digital:
        controller = controller.discretise(case["sample_time"], case["method"], anti_windup=None)
    return pidalab.Loop(process, controller)


def worst_error(case, points):
    """Return the largest error of all signals and times, and its place. Each time is the end of a grid of `points`."""
    loop, worst = oracle_loop(case), (0.0, "")
    driven = [name for name in INPUTS if name in case["values"]]
    for i, time in enumerate(case["times"]):
        if time == 0.0:
            continue
        unit = unit_step_responses(
            loop, np.linspace(0.0, time, points), "".join(INPUTS[name] for name in driven)
        )
        for k, name in enumerate(driven):
            for signal, row in SIGNALS.items():
                value, reference = unit[k, row, -1], float(case["values"][name][signal][i])
                error = abs(value - reference) / scale(case, name, signal, i)
                where = f"{name} {signal} at t = {time}: {value!r} against {reference!r}, error {error:.2g}"
                worst = max(worst, (error, where))
    return worst


def scale(case, name, signal, i):
    """Return the scale of an error at the time with index i, by default max(1, |value|).

    After a peak of the control signal, the scale is the peak. For a diverging response it is the envelope so far.
    """
    values = np.abs(np.array(case["values"][name][signal][: i + 1], dtype=float))
    envelope = case["envelope"][name][signal][i] if "envelope" in case else 0.0
    return max(1.0, values.max() if signal == "u" else values[i], envelope)
