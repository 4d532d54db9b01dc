"""The exact engine between dead times, with filters of ordinary and of extreme speed, against the oracle."""

import numpy as np
import pytest
from delay_loop_series import by_talbot
from engine_errors import INPUTS, SIGNALS, oracle, oracle_loop, scale, worst_error
from mpmath import workdps

from pidalab import PIDA, Loop, Process, lags
from pidalab.simulation.exact import unit_step_responses

CASES = oracle("between.json")["cases"]


@pytest.mark.parametrize("points", [2, 23, 1001], ids=lambda n: f"{n}points")
@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_each_time_ends_a_grid(case, points):
    error, where = worst_error(case, points)
    assert error <= 1e-9, where


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_in_the_middle_of_a_long_grid(case):
    """Each time is the 3001st of 10,001: the same loop, many runs of times and dead times after it."""
    for i, time in enumerate(case["times"]):
        t = np.linspace(0.0, time / 0.3, 10_001)
        try:
            unit = unit_step_responses(oracle_loop(case), t, "rdn")
        except ValueError as refused:
            if "range of numbers" not in str(refused):
                raise
            continue
        for k, name in enumerate(INPUTS):
            for signal, row in SIGNALS.items():
                error = abs(unit[k, row, 3000] - float(case["values"][name][signal][i]))
                assert error <= 1e-9 * scale(case, name, signal, i), (name, signal, time)


def test_the_oracle_holds_what_it_says():
    """At least thirty loops; no time is near a multiple of the dead time."""
    assert len(CASES) >= 30
    for case in CASES:
        share = np.mod(case["times"], case["delay"]) / case["delay"]
        assert np.all((share > 1e-6) & (share < 1 - 1e-6)), case["name"]


def test_a_load_under_a_loud_and_fast_controller():
    """A kick of 1e4 to 3e5 times y, 50 to 280 times faster than the plant: u of the load lost eight digits."""
    for process, controller, time in (
        (Process([3.6], [1, 1, 0], 0.0625), PIDA(3.72, 0.905, 0.349, 0.0489, n=32.7, m=13.7), 0.61),
        (Process([0.192], [0.853, 1.853, 1, 0], 0.385), PIDA(33.3, 3.09, 0.696, 0.324, n=37.1, m=55.4), 2.91),
        (
            Process([0.177], [0.121, 1.121, 1, 0], 0.0904),
            PIDA(66.3, 3.7, 0.187, 0.104, n=21.2, m=56.1),
            0.773,
        ),
    ):
        loop = Loop(process, controller)
        with workdps(120):
            exact = by_talbot(as_case(loop), [time], 64)
        for points in (2, 23, 301):
            unit = unit_step_responses(loop, np.linspace(0.0, time, points), "rdn")
            for k, name in enumerate(INPUTS):
                for signal, row in SIGNALS.items():
                    error = abs(unit[k, row, -1] - float(exact[f"{name}.{signal}"][0]))
                    assert error <= 1e-9 * np.abs(unit[k, row]).max(), (time, points, name, signal)


@pytest.mark.parametrize("constants", [15.0, 30.0, 45.0])
def test_in_the_flank_of_a_kick(constants):
    """So many time constants of a filter of 3e-10 after a dead time, u is what the filter still makes of the kick."""
    loop = Loop(lags(3, delay=1.0), PIDA(1.0, 3.0, 1.0, 0.3, n=10, m=1e9))
    time = 1.0 + 3e-10 * constants
    with workdps(160):
        exact = float(by_talbot(as_case(loop), [time], 100)["setpoint.u"][0])
    found = unit_step_responses(loop, np.array([0.0, time]), "r")[0, 2, -1]
    # the digits of its time: 1e-16 of 3e-10, four times over
    assert found == pytest.approx(exact, rel=3e-6)


@pytest.mark.parametrize("multiple", [1, 2, 3])
def test_just_at_a_dead_time_the_filter_has_not_moved(multiple):
    """At a multiple u is what it was a moment before; a few time constants of 3e-10 later it may be another fifth."""
    loop = Loop(lags(3, delay=1.0), PIDA(1.0, 3.0, 1.0, 0.3, n=10, m=1e9))
    with workdps(120):
        before = by_talbot(as_case(loop), [multiple * (1 - 1e-13)], 64)
    for points in (2, 2 * multiple + 1):
        unit = unit_step_responses(loop, np.linspace(0.0, multiple, points), "rdn")
        for k, name in enumerate(INPUTS):
            for signal, row in SIGNALS.items():
                assert unit[k, row, -1] == pytest.approx(
                    float(before[f"{name}.{signal}"][0]), rel=1e-10, abs=1e-11
                )


def test_a_fast_part_that_sends_much_stays_in_the_process():
    """Derivative action on one lag, behind a filter of 1e-9: a kick comes back with 7.5 % of its height."""
    loop = Loop(Process([1.0], [1.0, 1.0], 0.47), PIDA(0.5, 1.2, 0.15, n=1e8))
    with workdps(160):
        exact = by_talbot(as_case(loop), [3.1], 100)
    unit = unit_step_responses(loop, np.linspace(0.0, 3.1, 5), "rdn")
    for k, name in enumerate(INPUTS):
        for signal, row in SIGNALS.items():
            assert unit[k, row, -1] == pytest.approx(float(exact[f"{name}.{signal}"][0]), rel=1e-9)


@pytest.mark.parametrize("m", [1407.0, 1e5])
def test_lost_digits_are_refused(m):
    """|L| stays large up to a filter 1e4 times faster than the plant: y would be off by 1e-4 and more."""
    loop = Loop(Process([3.26], [1, 1], 0.0885), PIDA(0.0416, 0.731, 0.338, 0.0382, n=120.3, m=m))
    # in which way depends on how the processor rounds
    with pytest.raises(
        ValueError, match=r"rounding leaves .* of the largest value of .* (time constant|more times)"
    ):
        unit_step_responses(loop, np.array([0.0, 0.567]), "rdn")


def as_case(loop):
    """The loop as delay_loop_series wants it."""
    blocks = {
        key: dict(zip(("num", "den"), part, strict=True))
        for key, part in loop.blocks.items()
        if key in ("process", "controller", "output_filter", "prefilter")
    }
    return {**blocks, "delay": loop.process.delay}
