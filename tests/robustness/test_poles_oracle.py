"""Unstable poles, and the limits of stability in gain and dead time, against the oracle."""

import math

import control
import pytest
from engine_errors import oracle, oracle_loop

from pidalab import Loop, Process, unstable_poles

CASES = oracle("margins.json")["cases"]


def changed(case, factor, extra):
    """The loop of a case with another gain and a longer dead time."""
    loop = oracle_loop(case)
    process = Process(loop.process.num, loop.process.den, loop.process.delay + extra)
    num, den = loop.blocks["controller"]
    return Loop(process, control.tf(factor * num, den), loop.output_filter)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_number_of_unstable_poles(case):
    assert unstable_poles(oracle_loop(case)) == case["unstable_poles"]
    for other in case["poles"]:
        assert unstable_poles(changed(case, other["factor"], other["extra"])) == other["count"], other


LIMITS = [
    pytest.param(case, limit, id=f"{case['name']}-{limit}")
    for case in CASES
    for limit in ("gm", "gm_low", "dm")
    if case["values"] and 0.0 < float(case["values"][limit]) < math.inf
]


@pytest.mark.parametrize(("case", "limit"), LIMITS)
def test_limits_of_stability(case, limit):
    """With a millionth less gain or dead time than at the limit the loop is stable, with a millionth more it is not."""
    value = float(case["values"][limit])
    if limit == "dm":
        near = 1e-6 * (case["delay"] + value)
        inside, outside = ((1.0, value + x) for x in (-near, near))
    else:
        near = 1e-6 if value > 1 else -1e-6
        inside, outside = ((value * (1 + x), 0.0) for x in (-near, near))
    assert unstable_poles(changed(case, *inside)) == 0 < unstable_poles(changed(case, *outside))
