"""Loops that were wrong in silence when random ones were held against the delay terms, one by one."""

import control
import numpy as np
import pytest
from delay_loop_series import by_talbot
from engine_errors import INPUTS, SIGNALS
from mpmath import workdps

from pidalab import PIDA, HighOrderPID, Loop, NonInteractivePIDA, Process, SeriesPIDA, ipdt
from pidalab.simulation.exact import unit_step_responses


def lag(time):
    return control.tf([1.0], [time, 1.0])


def exact(loop, time):
    """The values at a time: `{"setpoint.y": ...}`."""
    blocks = {key: dict(zip(("num", "den"), part, strict=True)) for key, part in loop.blocks.items()}
    blocks.setdefault("output_filter", None)
    with workdps(120):
        found = by_talbot({**blocks, "delay": loop.process.delay}, [time], 64)
    return {key: float(value[0]) for key, value in found.items()}


@pytest.mark.parametrize(
    ("loop", "time"),
    [
        (Loop(ipdt(2.3, 0.067), SeriesPIDA(0.55, 0.0586, 0.0, 1.8, filter_time=2e-6, filter_order=2)), 0.25),
        (
            Loop(
                Process([1.85], [1.0, -0.1176], 3.31),
                HighOrderPID([0.0194, 0.46, 0.118], filter_time=3e-12, filter_order=2),
            ),
            11.0,
        ),
        (
            Loop(
                Process([2.56], [0.304, 1.0], 0.0676),
                PIDA(0.713, 0.33, 0.1055, 0.00522, n=1.2e10, m=3e6),
                lag(0.0069),
            ),
            0.19,
        ),
    ],
    ids=["series_on_an_integrator", "derivative_on_an_unstable_lag", "acceleration_behind_a_slow_filter"],
)
def test_a_kick_without_a_jump_comes_back(loop, time):
    """Behind a filter of higher order a kick has no direct part, and is as high: u read as if it came to nothing."""
    true = exact(loop, time)
    for points in (2, 301):
        unit = unit_step_responses(loop, np.linspace(0.0, time, points), "rdn")
        for k, name in enumerate(INPUTS):
            for signal, row in SIGNALS.items():
                assert unit[k, row, -1] == pytest.approx(true[f"{name}.{signal}"], rel=1e-9), (
                    points,
                    name,
                    signal,
                )


GROWING = Loop(
    Process([-1.7, 2.18], [1.0, 1.0], 0.3926), PIDA(-0.00398, 0.929, 0.0372, 0.0554, n=14.15, m=27.2)
)


@pytest.mark.parametrize(
    ("loop", "end", "points"),
    [
        pytest.param(GROWING, 4.1, 5, id="right_beside_what_it_grows_to_between_the_times"),
        pytest.param(
            Loop(ipdt(2.79, 0.817), PIDA(-0.0283, 6.18, 0.71, 0.01065, n=58.7, m=3.54e9)),
            1.5,
            5,
            id="no_number_the_second_time",
        ),
        pytest.param(
            Loop(
                Process([0.88, 2.12], [1.0, 1.0]),
                NonInteractivePIDA(0.273, 0.553, 0.43, 0.292, alpha_d=0.0116, alpha_a=8.56e-8),
            ),
            3.76,
            401,
            id="fast_before_the_loop_was_closed",
        ),
        pytest.param(
            Loop(
                Process([0.336, 1.526], [1.0, 0.0, 0.0]), PIDA(0.0376, 0.35, 0.0968, 0.03, n=5.7e7, m=3.2e9)
            ),
            6.4,
            401,
            id="closed_by_large_numbers",
        ),
        pytest.param(
            Loop(
                Process([0.454], [1.0, -0.662], 0.05397),
                PIDA(0.1844, 1.182, 0.123, 0.00915, n=45.4, m=1.242e5),
            ),
            0.1176,
            5,
            id="alike_at_few_times",
        ),
        pytest.param(
            Loop(ipdt(2.0, 0.3), HighOrderPID([1.0, 1.0, 0.2, 0.03], filter_time=6e-5, filter_order=2)),
            3.0,
            400,
            id="a_loud_filter_of_ordinary_speed",
        ),
        pytest.param(
            Loop(
                Process([0.452, 2.31], [1.0, 1.0], 2.106),
                PIDA(0.0398, 19.84, 0.06835, 0.02257, n=9.436e5, m=228.8),
            ),
            4.365,
            401,
            id="after_kicks_of_two_speeds",
        ),
    ],
)
def test_lost_digits_are_refused(loop, end, points):
    with pytest.raises(
        ValueError, match=r"rounding leaves .* uncertain, and 1e-\d\d is allowed|the range of numbers"
    ):
        unit_step_responses(loop, np.linspace(0.0, end, points), "rdn")


def test_a_grid_that_misses_what_is_large_still_shows_digits():
    """y grows in bursts to 1e14 and is 0.9 between them: beside bursts on the grid, errors are small."""
    loop = Loop(Process([1.0], [1.0, 1.0], 0.41), PIDA(0.12, 0.8, 0.25, 0.02, n=20, m=50))
    fine = unit_step_responses(loop, np.linspace(0.0, 13.36, 10_001), "r")[0, 0]
    assert abs(fine[-1]) < 1e-12 * np.max(np.abs(fine))
    shown = unit_step_responses(loop, np.linspace(0.0, 13.36, 81), "r")[0, 0]
    assert abs(shown[-1] - fine[-1]) < 1e-6 * np.max(np.abs(shown)) < 1e-9 * np.max(np.abs(fine))
    for points in (2, 5):  # 0.9 has no digits beside 1e14, and nothing else is shown
        with pytest.raises(ValueError, match=r"requested times uncertain, and 1e-06 .* ask for more times"):
            unit_step_responses(loop, np.linspace(0.0, 13.36, points), "r")


def test_a_dead_time_of_more_shares_than_there_are_integers():
    """Machine code counted the shares of a dead time that a series spans in 64 bits; here there are 1e20."""
    loop = Loop(
        Process([-0.163, 0.323], [1.0, 1.0], 4.937), PIDA(-0.0569, 19.9, 0.304, 2.59, n=173.0, m=65.2)
    )
    unit, true = unit_step_responses(loop, np.linspace(0.0, 43.0, 201), "rdn"), exact(loop, 43.0)
    for k, name in enumerate(INPUTS):
        for signal, row in SIGNALS.items():
            size = np.max(np.abs(unit[k, row]))
            assert abs(unit[k, row, -1] - true[f"{name}.{signal}"]) < 1e-9 * size, (name, signal)
