"""Compare the exact engine between dead times with the oracle, for ordinary and extreme filters."""

import numpy as np
import pytest
from delay_loop_series import by_talbot
from engine_errors import INPUTS, SIGNALS, oracle, worst_error
from mpmath import workdps

from pidalab import PIDA, HighOrderPID, Loop, Process, SeriesPIDA, ipdt, lags
from pidalab.simulation.exact import unit_step_responses

CASES = oracle("between.json")["cases"]


def exact(loop, time, digits=120):
    """Return the values at a time, by inversion of the Laplace transform: `{"setpoint.y": ...}`."""
    blocks = {key: dict(zip(("num", "den"), part, strict=True)) for key, part in loop.blocks.items()}
    with workdps(digits):
        values = by_talbot(
            {"output_filter": None, **blocks, "delay": loop.process.delay}, [time], digits // 2
        )
    return {key: float(value[0]) for key, value in values.items()}


def assert_exact(loop, time, points, true, rel=1e-9, abs_=0.0):
    """Compare all signals at the last of `points` times."""
    unit = unit_step_responses(loop, np.linspace(0.0, time, points), "rdn")
    for k, name in enumerate(INPUTS):
        for signal, row in SIGNALS.items():
            size = max(abs(true[f"{name}.{signal}"]), abs_ * np.abs(unit[k, row]).max())
            assert abs(unit[k, row, -1] - true[f"{name}.{signal}"]) <= rel * size, (points, name, signal)


@pytest.mark.parametrize("points", [2, 23, 1001], ids=lambda n: f"{n}points")
@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_each_time_ends_a_grid(case, points):
    error, where = worst_error(case, points)
    assert error <= 1e-9, where


@pytest.mark.parametrize(
    ("process", "controller", "time", "grids"),
    [
        # The peak of u is 1e4 to 3e5 times y, and 50 to 280 times faster than the plant.
        (
            Process([3.6], [1, 1, 0], 0.0625),
            PIDA(3.72, 0.905, 0.349, 0.0489, n=32.7, m=13.7),
            0.61,
            (2, 23, 301),
        ),
        (
            Process([0.177], [0.121, 1.121, 1, 0], 0.0904),
            PIDA(66.3, 3.7, 0.187, 0.104, n=21.2, m=56.1),
            0.773,
            (2, 23, 301),
        ),
        # The time is not a multiple of the dead time.
        (
            Process([-0.163, 0.323], [1, 1], 4.937),
            PIDA(-0.0569, 19.9, 0.304, 2.59, n=173.0, m=65.2),
            43.0,
            (201,),
        ),
    ],
)
def test_fast_and_loud_controllers_keep_their_digits(process, controller, time, grids):
    loop = Loop(process, controller)
    true = exact(loop, time)
    for points in grids:
        assert_exact(loop, time, points, true, abs_=1.0)


@pytest.mark.parametrize(
    ("process", "controller", "time"),
    [
        (ipdt(2.3, 0.067), SeriesPIDA(0.55, 0.0586, 0.0, 1.8, filter_time=2e-6, filter_order=2), 0.25),
        (Process([1.85], [1, -0.1176], 3.31), HighOrderPID([0.0194, 0.46, 0.118], 3e-12, 2), 11.0),
        (Process([1.0], [1.0, 1.0], 0.47), PIDA(0.5, 1.2, 0.15, n=1e8), 3.1),
    ],
    ids=["series", "unstable lag", "feeds back much"],
)
def test_a_peak_behind_a_high_order_filter_comes_back(process, controller, time):
    loop = Loop(process, controller)
    for points in (2, 301):
        assert_exact(loop, time, points, exact(loop, time, 200))


FLANK = Loop(lags(3, delay=1.0), PIDA(1.0, 3.0, 1.0, 0.3, n=10, m=1e9))


@pytest.mark.parametrize("constants", [15.0, 45.0])
def test_the_decay_of_a_short_peak(constants):
    """The time is some filter times (3e-10) after a dead time, when the peak decays."""
    time = 1.0 + 3e-10 * constants
    u = unit_step_responses(FLANK, np.array([0.0, time]), "r")[0, 2, -1]
    # Rounding of the time, 1e-16, is 3e-7 of the filter time.
    assert u == pytest.approx(exact(FLANK, time, 200)["setpoint.u"], rel=3e-6)


@pytest.mark.parametrize("multiple", [1, 3])
def test_just_at_a_dead_time_the_filter_has_not_moved(multiple):
    before = exact(FLANK, multiple * (1 - 1e-13))
    for points in (2, 2 * multiple + 1):
        assert_exact(FLANK, multiple, points, before, rel=2e-10, abs_=0.1)


@pytest.mark.parametrize(
    ("process", "controller", "end", "points"),
    [
        (
            Process([-1.7, 2.18], [1, 1], 0.3926),
            PIDA(-0.00398, 0.929, 0.0372, 0.0554, n=14.15, m=27.2),
            4.1,
            5,
        ),
        (ipdt(2.79, 0.817), PIDA(-0.0283, 6.18, 0.71, 0.01065, n=58.7, m=3.54e9), 1.5, 5),
        (Process([0.336, 1.526], [1, 0, 0]), PIDA(0.0376, 0.35, 0.0968, 0.03, n=5.7e7, m=3.2e9), 6.4, 401),
        (ipdt(2.0, 0.3), HighOrderPID([1.0, 1.0, 0.2, 0.03], filter_time=6e-5, filter_order=2), 3.0, 400),
        # The value is 0.9 between bursts of 1e14.
        (Process([1.0], [1.0, 1.0], 0.41), PIDA(0.12, 0.8, 0.25, 0.02, n=20, m=50), 13.36, 5),
    ],
    ids=["between the times", "no number", "closed by large numbers", "loud filter", "bursts"],
)
def test_lost_digits_are_refused(process, controller, end, points):
    with pytest.raises(ValueError, match=r"uncertain|overflow"):
        unit_step_responses(Loop(process, controller), np.linspace(0.0, end, points), "rdn")
