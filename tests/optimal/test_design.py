"""Check the optimum: it keeps its limits at all frequencies, and no oracle or rival has a lower IAE."""

import csv
import importlib
import math
import random
from functools import reduce
from pathlib import Path

import numpy as np
import pytest
from engine_errors import oracle
from threadpoolctl import threadpool_info, threadpool_limits

import pidalab
from pidalab import HighOrderPID, Loop
from pidalab.optimal.design import _valleys
from pidalab.optimal.polish import polish
from pidalab.optimal.problem import Problem, SampledNoise, _other_side, unit_of_time
from pidalab.optimal.search import Search
from pidalab.requirements import Requirements

THIRD = pidalab.lags(3, delay=1.0)
INTEGRATING = pidalab.Process([1.0], [0.3, 1.0, 0.0], 0.7)


def keeps(design, ms, mks=math.inf):
    """Return True if a design is stable and keeps its limits on a dense grid."""
    loop, w = design.loop(), np.geomspace(1e-4, 1e5, 200_001)
    return (
        pidalab.is_stable(loop)
        and np.abs(loop.S(1j * w)).max() <= ms
        and np.abs(loop.transfer("u", "n", 1j * w)).max() <= mks
    )


def test_the_search_finds_the_better_of_two_local_optima():
    """A PIDA near the PID has an IAE of 3.41. A PIDA with a slower filter has a fifth less."""
    pid, pida = (pidalab.optimal.load(THIRD, order, ms=1.4, mks=20.0) for order in (1, 2))
    assert keeps(pid, 1.4, 20.0)
    assert keeps(pida, 1.4, 20.0)
    assert pid.iae == pytest.approx(3.415, rel=2e-3)
    assert pida.iae == pytest.approx(2.654, rel=2e-3)
    assert pida.active == ("ms", "mks")
    assert pida.edge == ()
    assert pida.digits == 9
    assert pida.valleys[0] == pida.iae
    assert any(other == pytest.approx(3.41, rel=0.02) for other in pida.valleys)
    response = pidalab.load_response(pida.loop(), np.linspace(0.0, 200.0, 8001))
    assert pida.iae == pytest.approx(response.iae(), rel=1e-6)


@pytest.mark.parametrize("second", [1.0, 60.0])
def test_valleys_list_local_optima_in_any_unit_of_time(second):
    """One local optimum is nearly the best PID. A search that starts from a design lists only that optimum."""
    process = pidalab.lags(3, lag=second, delay=second)
    pid, pida = (pidalab.optimal.load(process, order, ms=1.4, mks=20.0) for order in (1, 2))
    assert pida.valleys == pytest.approx((pida.iae, pid.iae), rel=0.01)
    from_there = pidalab.optimal.load(process, 2, ms=1.4, mks=19.0, start=pida)
    assert from_there.valleys == (from_there.iae,)
    assert from_there.valleys == pytest.approx((pida.iae,), rel=0.02)


@pytest.mark.parametrize(
    ("process", "most", "h", "gains", "filter_time"),
    [
        (pidalab.lags(4), 1.0589, 0.0628, [0.49291, 2.1694, 3.458, 2.6981, 0.22122], 0.43036),
        (pidalab.lags(2, delay=1.0), 0.2867, 0.0481, [0.38954, 1.0558, 1.0306, 0.0998], 0.4052),
        (INTEGRATING, 0.17588, 0.039185, [0.1052, 0.7048, 1.065, 0.7188, 0.0845], 0.5142),
    ],
)
def test_no_rival_has_a_lower_iae(process, most, h, gains, filter_time):
    """Two rivals have a small highest derivative. On the third plant, a search may exceed a limit by a millionth."""
    order = len(gains) - 2
    rival = Loop(process, HighOrderPID(gains, filter_time, order + 1))
    assert pidalab.max_sensitivity(rival)[0] <= 2.0
    assert pidalab.noise_gain(rival, h) <= most
    design = pidalab.optimal.load(process, order, ms=2.0, noise_gain=most, sample_time=h)
    response = pidalab.load_response(rival, np.linspace(0.0, 200.0, 16001))
    assert design.iae <= response.iae() * (1 + 1e-4)


@pytest.mark.parametrize(
    ("process", "order", "most", "h", "active"),
    [
        (pidalab.fopdt(1.0, 2.0, 1.0), 1, 1.5, 0.05, {"ms", "noise_gain"}),
        (pidalab.ipdt(1.0, 1.0), 1, 3.0, 0.1, {"ms", "sample_time"}),  # the filter is as fast as the sample
    ],
)
def test_noise_gain_is_kept_behind_a_filter_that_can_be_sampled(process, order, most, h, active):
    design = pidalab.optimal.load(process, order, ms=1.4, noise_gain=most, sample_time=h)
    assert pidalab.noise_gain(design.loop(), h) == pytest.approx(design.noise_gain, rel=1e-5)
    assert design.noise_gain <= most
    assert design.controller.filter_time >= h * (1 - 1e-6)
    assert set(design.active) == active
    assert keeps(design, 1.4)


def test_sampled_noise_matches_noise_gain():
    """Some loops are near the stability limit of the sampled loop or beyond it."""
    problem, h = Problem(pidalab.ipdt(1.0, 1.03), 1, (1.0, 1.0)), 0.2
    fine = SampledNoise(problem, h, 12)
    for gain in (0.2, 0.5, 0.7):
        x = np.array([0.05, gain, 0.3 * gain, -1.5])
        gains, time = problem.controller(x)
        true = pidalab.noise_gain(Loop(problem.process, HighOrderPID(gains.tolist(), time, 2)), h)
        assert math.sqrt(fine(x)[0]) == pytest.approx(true, rel=2e-6)
        assert not fine.unstable(x)
    assert fine.unstable(np.array([0.05, 2.0, 0.6, -1.5]))


def test_the_sign_and_the_units_of_a_process_do_not_matter():
    plain = pidalab.optimal.load(pidalab.fopdt(1.0, 2.0, 1.0), 0, ms=1.5)
    other = pidalab.optimal.load(pidalab.fopdt(-4.0, 120.0, 60.0), 0, ms=1.5)
    assert other.iae == pytest.approx(60 * 4 * plain.iae, rel=1e-4)
    assert -4 * other.controller.coefficients[1] == pytest.approx(plain.controller.coefficients[1], rel=1e-2)


@pytest.mark.parametrize(
    ("den", "delay", "order"),
    [([1.0, 0.0, 0.0], 1.0, 1), ([1.0, 0.0, 0.0, 0.0], 0.1, 2), ([1.0, 0.0, 1.0], 0.2, 1)],
    ids=["double", "triple", "undamped"],
)
def test_plants_that_only_a_derivative_or_acceleration_stabilises(den, delay, order):
    process = pidalab.Process([1.0], den, delay)
    with pytest.raises(
        ValueError, match=f"no stable controller of order {order - 1} .* controllers of order {order}"
    ):
        pidalab.optimal.load(process, order - 1, ms=1.6)
    design = pidalab.optimal.load(process, order, ms=1.6, mks=100.0)
    assert keeps(design, 1.6, 100.0)
    assert {"ms", "mks"} <= set(design.active)


def test_integrators_alone_are_limited_by_noise_only():
    process = pidalab.Process([1.0], [1.0, 0.0, 0.0])
    quiet, loud = (pidalab.optimal.load(process, 1, ms=1.4, mks=m) for m in (20.0, 80.0))
    assert keeps(quiet, 1.4, 20.0)
    # Four times the noise allows half the time scale.
    assert quiet.iae / loud.iae == pytest.approx(8.0, rel=1e-3)


def test_gradients_are_those_of_the_functions():
    problem = Problem(THIRD, 2, (0.6, 1.6))
    x = np.array([0.3, 0.5, 0.4, 0.1, -2.0])
    for function in (
        problem.iae(120.0),
        SampledNoise(problem, 0.05),
        problem.slack(np.geomspace(0.1, 10.0, 7), {"ms": 1.4, "mks": 20.0, "mt": 1.3, "inverse_disk": 0.9}),
    ):
        steps = 1e-6 * np.eye(x.size)
        numeric = [(np.asarray(function(x + h)[0]) - np.asarray(function(x - h)[0])) / 2e-6 for h in steps]
        np.testing.assert_allclose(function(x)[1](), np.transpose(numeric), atol=1e-6)


def test_an_unstable_process_has_a_design_unless_its_dead_time_is_too_long():
    design = pidalab.optimal.load(pidalab.Process([1.0], [1.0, -1.0], 0.1), 1, ms=2.0, mks=30.0, disk=0.9)
    assert keeps(design, 2.0, 30.0)
    assert design.digits == 9
    with pytest.raises(ValueError, match=r"no stable controller of order 1 .* whatever its ms"):
        pidalab.optimal.load(pidalab.Process([1.0], [1.0, -1.0], 3.0), 1, ms=2.0)


def test_a_limit_of_noise_that_leaves_too_little_gain_is_refused():
    with pytest.raises(ValueError, match="too slow to simulate"):
        pidalab.optimal.load(pidalab.fopdt(1.0, 1.0, 1.0), 0, ms=1.4, noise_gain=1e-5, sample_time=0.1)


def test_a_dead_time_too_short_for_the_noise_sets_no_unit():
    """A shorter dead time does not raise the IAE."""
    longer, shorter = (pidalab.tune(pidalab.fopdt(1.0, 1.0, L), sample_time=1e-3).iae for L in (1e-2, 1e-4))
    assert shorter <= longer


def stored():
    """Return the stored rows of the study."""
    with (Path(__file__).parents[2] / "book" / "data" / "optimal_check.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_second_optimiser_found_nothing_better():
    """The second optimiser stops at three or four digits."""
    assert len(stored()) >= 14
    assert max(float(row["iae"]) / float(row["iae_second"]) for row in stored()) <= 1.001


def test_a_random_tenth_of_the_stored_optima_is_reproduced(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "studies")
    plants = importlib.import_module("optimal_check").PLANTS
    rows = stored()
    for row in random.sample(rows, -(-len(rows) // 10)):
        process, mks = plants[row["plant"]]
        again = pidalab.optimal.load(process, int(row["order"]), ms=float(row["ms"]), mks=mks).iae
        assert again == pytest.approx(float(row["iae"]), rel=1e-3), row["plant"]


def test_a_search_uses_one_thread_and_restores_the_setting(monkeypatch):
    """Threads make a design ten times slower, since its matrices are small."""

    def threads():
        return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}

    inside = []
    monkeypatch.setattr(
        "pidalab.optimal.design.descend_over_filter_times", lambda *_: inside.append(threads())
    )
    with threadpool_limits(limits=2, user_api="blas"):
        with pytest.raises(ValueError, match="ms"):
            pidalab.optimal.load(pidalab.fopdt(1.0, 1.0, 1.0), 0, ms=1.4)
        assert inside[0] == {1}
        assert threads() == {2}


# Parts of the search.


@pytest.mark.parametrize(
    ("gains", "filter_time", "count"), [([4e5, 1.2e5], 1.2e-4, 2), ([4e8, 1.8e4], 1.5e-5, 0)]
)
def test_a_very_short_dead_time_counts_where_the_gain_is_high(gains, filter_time, count):
    """The dead time is 1e-5 of the lag, and the gain is high enough for it to matter."""
    process = pidalab.fopdt(1.0, 1.0, 1e-5)
    assert pidalab.unstable_poles(Loop(process, HighOrderPID(gains, filter_time, 1))) == count
    problem = Problem(process, 0, (1.0, 1.0))
    assert problem.unstable(np.array([*gains, math.log(filter_time)])) == (count > 0)


def test_values_of_valleys_differ_by_a_hundredth_and_are_no_more_than_twice_the_least():
    assert _valleys(1.0, [2.0, 1.0099, 1.5, 1.514, 1.99, 2.5]) == (1.0, 1.5, 1.99)
    assert _valleys(1.0, [1.0101]) == (1.0, 1.0101)
    assert _valleys(3.0, []) == (3.0,)
    # A search may end slightly beyond a limit, with a lower IAE than the best design within the limit.
    assert _valleys(3.0783, [3.0727, 3.6649, 3.6601]) == (3.0783, 3.6601)


def test_an_optimum_meets_its_conditions():
    """From nearby points Newton's method finds the same optimum to nine digits. No feasible step is better."""
    unit = unit_of_time(THIRD, Requirements(ms=1.4, mks=20.0))
    search = Search(Problem(THIRD, 1, (abs(complex(THIRD(1j / unit))), unit)), Requirements(ms=1.4, mks=20.0))
    start = search.descend(np.array([0.3, 0.4, 0.3, -4.0]))[1]
    ends = [polish(search, start * factor) for factor in (1.0, 0.999, 1.002)]
    for end in ends:
        assert end.step < 1e-9
        np.testing.assert_allclose(end.x, ends[0].x, rtol=1e-8)
    loop, x = search.loop(ends[0].x), ends[0].x
    assert pidalab.max_sensitivity(loop)[0] == pytest.approx(1.4, rel=2e-9)
    assert pidalab.robustness.max_control_sensitivity(loop)[0] == pytest.approx(20.0, rel=2e-9)
    # Along directions that keep the active limits, the IAE of the engine has slope 0.
    t = np.linspace(0.0, 200.0 * unit, 8001)
    measures = (
        lambda x: math.log(pidalab.max_sensitivity(search.loop(x))[0]),
        lambda x: math.log(pidalab.robustness.max_control_sensitivity(search.loop(x))[0]),
        lambda x: math.log(pidalab.load_response(search.loop(x), t).iae()),
    )
    h = 1e-4 * np.eye(x.size)
    ms, mks, iae = ([(f(x + d) - f(x - d)) / 2e-4 for d in h] for f in measures)
    limits = np.transpose([ms, mks])
    prices, *_ = np.linalg.lstsq(limits, -np.array(iae), rcond=None)
    assert np.all(prices > 0)
    assert np.max(np.abs(limits @ prices + iae)) < 1e-3 * np.max(np.abs(iae))


def test_area_below_zero_and_its_gradient():
    """A straight line from 1 to -3 is below zero for three quarters of a step, with an area of 9/8."""
    area, slope = _other_side(np.array([1.0, -3.0, -1.0, 2.0, 0.0]))
    assert area == pytest.approx(9 / 8 + 2.0 + 1 / 6)
    assert slope[-1] == 0.0
    for k, h in enumerate(1e-6 * np.eye(5)[:4]):
        e = np.array([1.0, -3.0, -1.0, 2.0, 0.5])
        assert _other_side(e)[1][k] == pytest.approx((_other_side(e + h)[0] - _other_side(e - h)[0]) / 2e-6)


MIGO = {
    "lags-apart": (
        pidalab.Process([1.0], reduce(np.convolve, ([10.0**-k, 1.0] for k in range(4)))),
        3.56,
        0.66,
    ),
    "four-lags": (pidalab.lags(4), 0.432, 2.43),
    "dead-time": (pidalab.Process([1.0], [0.0025, 0.1, 1.0], 1.0), 0.170, 0.404),
}


@pytest.mark.parametrize("name", MIGO)
def test_the_pi_controllers_of_migo(name):
    """The circle of MIGO, which encloses the circles of Ms = M and Mt = M, is a disk margin of 2/(2M - 1).

    The error of these loops does not change its sign after a load, so the least IAE has the largest integral gain.
    """
    process, kp, ti = MIGO[name]
    design = pidalab.optimal.load(process, 0, disk=2 / 1.8)
    assert design.active == ("disk",)
    assert design.disk == pytest.approx(2 / 1.8, rel=1e-6)
    gains = design.controller.gains()
    assert (gains.kp, gains.kp / gains.ki) == pytest.approx((kp, ti), rel=1e-2)


def test_a_limit_of_mt_is_kept_and_raises_the_iae():
    process, *_ = MIGO["lags-apart"]
    free, kept = (pidalab.optimal.load(process, 1, ms=1.6, mks=500.0, mt=mt) for mt in (None, 1.1))
    assert pidalab.margins(free.loop()).mt > 1.1
    assert kept.mt == pytest.approx(pidalab.margins(kept.loop()).mt, rel=1e-9)
    assert kept.mt <= 1.1
    assert "mt" in kept.active
    assert kept.iae > free.iae


@pytest.mark.filterwarnings("error")
def test_the_progress_bar_starts_no_thread(monkeypatch):
    def refuse(*_):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr("tqdm.std.TMonitor", refuse)
    monkeypatch.setattr("tqdm.std.tqdm.monitor", None)
    pidalab.optimal.load(pidalab.fopdt(1.0, 1.0, 1.0), 0)


# Compare the optimum with a lower bound for PI controllers, and with optima of high precision.
#
# The search computes the IAE with straight lines between samples, but since the optimum is flat, the least IAE is wrong
# by at most END. The limits are kept to a billionth.

END = 1e-6


@pytest.mark.parametrize("case", oracle("optima.json")["cases"], ids=lambda case: case["name"])
def test_least_iae(case):
    process = pidalab.Process(case["process"]["num"], case["process"]["den"], case["delay"])
    design, least = pidalab.optimal.load(process, 0, ms=case["ms"]), float(case["values"]["iae_at_least"])
    # the search ends at the smallest filter time
    assert design.controller.filter_time == pytest.approx(case["filter_time"], rel=1e-9)
    assert least * (1 - 1e-9) <= design.iae <= least * (1 + END)


@pytest.mark.parametrize("case", oracle("limited_optima.json")["cases"], ids=lambda case: case["name"])
def test_least_iae_under_limits_of_noise(case):
    process = pidalab.Process(case["process"]["num"], case["process"]["den"])
    design = pidalab.optimal.load(process, case["order"], ms=case["ms"], mks=case["mks"])
    assert design.iae == pytest.approx(float(case["values"]["iae"]), rel=END)


@pytest.mark.parametrize("case", oracle("delayed_optima.json")["cases"], ids=lambda case: case["name"])
def test_least_iae_with_dead_time(case):
    process = pidalab.Process(case["process"]["num"], case["process"]["den"], case["delay"])
    design = pidalab.optimal.load(process, case["order"], ms=case["ms"], mks=case["mks"])
    least = float(case["values"]["iae"])
    assert least * (1 - 1e-8) <= design.iae <= least * (1 + END)
