"""The exact engine against the high-precision oracle."""

import json
from pathlib import Path

import control
import numpy as np
import pytest

import pidalab
from pidalab.simulation.exact import unit_step_responses

ORACLE = json.loads((Path(__file__).parent / "oracle" / "delay_loops.json").read_text())["cases"]


def oracle_loop(case):
    def block(name):
        return control.tf(case[name]["num"], case[name]["den"]) if case[name] else None

    process = pidalab.Process(case["process"]["num"], case["process"]["den"], case["delay"])
    return pidalab.Loop(process, block("controller") or 1.0, block("output_filter"), block("prefilter"))


def envelope(case, name, signal, i):
    """Running maximum of a diverging response, where the oracle holds one."""
    return case["envelope"][name][signal][i] if "envelope" in case else 0.0


@pytest.mark.parametrize("points", [2, 14, 401], ids=lambda n: f"{n}points")
@pytest.mark.parametrize("case", ORACLE, ids=lambda case: case["name"])
def test_oracle(case, points):
    """1e-9 relative to max(1, |value|) (or the running envelope) at every time, aligned with the dead time or not."""
    loop = oracle_loop(case)
    inputs = {"setpoint": "r", "load": "d", "noise": "n"}
    driven = [name for name in inputs if name in case["values"]]
    for i, time in enumerate(case["times"]):
        if time == 0.0:
            continue
        unit = unit_step_responses(loop, np.linspace(0.0, time, points), "".join(inputs[name] for name in driven))
        for k, name in enumerate(driven):
            for row, signal in ((0, "y"), (2, "u")):
                reference = [float(value) for value in case["values"][name][signal][: i + 1]]
                scale = max(1.0, abs(reference[i]), envelope(case, name, signal, i))
                if signal == "u":  # after a kick of the control signal, relative to the kick
                    scale = max(scale, *np.abs(reference))
                error = abs(unit[k, row, -1] - reference[i]) / scale
                assert error <= 1e-9, f"{name} {signal} at t = {time}: {unit[k, row, -1]!r} against {reference[i]!r}"
