"""The optimum: limits kept at all frequencies, the better valley, monotone in its limits, beside brute force."""

import csv
import importlib
import math
import random
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import pidalab
from pidalab import HighOrderPID, Loop
from pidalab.optimal._noise import SampledNoise
from pidalab.optimal._problem import Problem

THIRD = pidalab.lags(3, delay=1.0)


def keeps(design, ms, mks=math.inf):
    """Limits on a dense grid, and stability."""
    loop, w = design.loop(), np.geomspace(1e-4, 1e5, 200_001)
    return (
        pidalab.is_stable(loop)
        and np.abs(loop.S(1j * w)).max() <= ms
        and np.abs(loop.transfer("u", "n", 1j * w)).max() <= mks
    )


def test_the_valley_and_not_the_shelf_near_the_pid():
    """A PIDA near the PID stays at 3.41; acceleration with a slower filter takes a fifth off."""
    pid, pida = (pidalab.optimal.load(THIRD, order, ms=1.4, mks=20.0) for order in (1, 2))
    assert keeps(pid, 1.4, 20.0)
    assert keeps(pida, 1.4, 20.0)
    assert pid.iae == pytest.approx(3.415, rel=2e-3)
    assert pida.iae == pytest.approx(2.654, rel=2e-3)
    assert pida.active == ("ms", "mks")
    assert pida.edge == ()
    assert pida.valleys[0] == pytest.approx(pida.iae, rel=2e-3)
    assert any(other == pytest.approx(3.41, rel=0.02) for other in pida.valleys)  # the one near the PID
    response = pidalab.load_response(pida.loop(), np.linspace(0.0, 200.0, 8001))
    assert pida.iae == pytest.approx(response.iae(), rel=1e-6)


@pytest.mark.parametrize(
    ("process", "most", "h", "gains", "filter_time"),
    [
        (pidalab.lags(4), 1.0589, 0.0628, [0.49291, 2.1694, 3.458, 2.6981, 0.22122], 0.43036),
        (pidalab.lags(2, delay=1.0), 0.2867, 0.0481, [0.38954, 1.0558, 1.0306, 0.0998], 0.4052),
    ],
)
def test_the_valley_of_the_order_below_is_not_passed_by(process, most, h, gains, filter_time):
    """Rivals with little of the highest derivative, which a ladder of filter times alone did not lead to."""
    order = len(gains) - 2
    rival = Loop(process, HighOrderPID(gains, filter_time, order + 1))
    assert pidalab.max_sensitivity(rival)[0] <= 2.0
    assert pidalab.noise_gain(rival, h) <= most
    design = pidalab.optimal.load(process, order, ms=2.0, noise_gain=most, sample_time=h)
    response = pidalab.load_response(rival, np.linspace(0.0, 100.0, 8001))
    assert design.iae <= response.iae() * (1 + 1e-4)


def test_less_noise_or_more_robustness_costs_error():
    base = pidalab.optimal.load(THIRD, 2, ms=1.4, mks=10.0).iae
    assert pidalab.optimal.load(THIRD, 2, ms=1.4, mks=4.0).iae > base > 2.654
    assert pidalab.optimal.load(THIRD, 2, ms=1.25, mks=10.0).iae > base
    assert pidalab.optimal.load(THIRD, 2, ms=2.0, mks=10.0).iae < base
    quiet, loud = (pidalab.optimal.load(THIRD, 2, noise_gain=g, sample_time=0.05).iae for g in (4.0, 8.0))
    assert 2.654 < loud < quiet


def test_pi_beside_brute_force():
    """All pairs of gains on a fine grid, with the filter that was found."""
    process = pidalab.ipdt(0.5, 2.0)
    design = pidalab.optimal.load(process, 0, ms=1.6)
    ki, kp = design.controller.coefficients
    assert design.edge == ("filter_time",)
    t, least = np.linspace(0.0, 160.0, 1001), math.inf
    for i in ki * np.linspace(0.9, 1.15, 11):
        for p in kp * np.linspace(0.9, 1.15, 11):
            loop = Loop(process, HighOrderPID([i, p], design.controller.filter_time, 1))
            if pidalab.is_stable(loop) and pidalab.max_sensitivity(loop)[0] <= 1.6:
                least = min(least, pidalab.load_response(loop, t).iae())
    assert design.iae <= least * (1 + 1e-4)


@pytest.mark.parametrize(
    ("process", "order", "most", "h", "active"),
    [
        (pidalab.fopdt(1.0, 2.0, 1.0), 1, 1.5, 0.05, {"ms", "noise_gain"}),
        (pidalab.ipdt(1.0, 1.0), 1, 3.0, 0.1, {"ms", "sample_time"}),  # the filter is as fast as the sample
    ],
)
def test_noise_gain_is_kept_behind_a_filter_that_can_be_sampled(process, order, most, h, active):
    design = pidalab.optimal.load(process, order, noise_gain=most, sample_time=h)
    assert pidalab.noise_gain(design.loop(), h) == pytest.approx(design.noise_gain, rel=1e-5)
    assert design.noise_gain <= most
    assert design.controller.filter_time >= h * (1 - 1e-6)
    assert set(design.active) == active
    assert keeps(design, 1.4)


def test_sampled_noise_is_that_of_the_simulation():
    """By frequencies and by samples, close to where the sampled loop becomes unstable too, and beyond."""
    problem, h = Problem(pidalab.ipdt(1.0, 1.03), 1, (1.0, 1.0), "load"), 0.2
    fine = SampledNoise(problem, h, 12)
    for gain in (0.2, 0.5, 0.7):
        x = np.array([0.05, gain, 0.3 * gain, -1.5])
        gains, time = problem.controller(x)
        true = pidalab.noise_gain(Loop(problem.process, HighOrderPID(gains.tolist(), time, 2)), h)
        assert math.sqrt(fine(x)[0]) == pytest.approx(true, rel=2e-6)
        assert not fine.unstable(x)
    assert fine.unstable(np.array([0.05, 2.0, 0.6, -1.5]))


def test_the_sign_and_the_units_of_a_process_do_not_matter():
    """Gains are those of the mirrored process with the sign turned, in other units of time and gain."""
    one = pidalab.optimal.load(pidalab.fopdt(1.0, 2.0, 1.0), 0, ms=1.5)
    other = pidalab.optimal.load(pidalab.fopdt(-4.0, 120.0, 60.0), 0, ms=1.5)
    assert other.iae == pytest.approx(60 * 4 * one.iae, rel=1e-4)
    assert other.controller.coefficients[1] == pytest.approx(-one.controller.coefficients[1] / 4, rel=1e-2)


def test_an_unstable_process():
    design = pidalab.optimal.load(pidalab.Process([1.0], [1.0, -1.0], 0.1), 1, ms=2.0, mks=30.0)
    assert keeps(design, 2.0, 30.0)


def test_a_limit_of_noise_that_makes_a_loop_slow():
    """A lag of a thousand dead times, and a limit that leaves the gain far below what robustness would allow."""
    process = pidalab.fopdt(1.0, 1000.0, 1.0)
    design = pidalab.optimal.load(process, 0, mks=5.0)
    assert keeps(design, 1.4, 5.0)
    assert "mks" in design.active
    t = np.linspace(0.0, 8000.0, 2001)
    for gain in (2.0, 3.0, 4.0, 4.5):
        for ti in (30.0, 100.0, 200.0, 300.0, 500.0):
            loop = Loop(process, HighOrderPID([gain / ti, gain], design.controller.filter_time, 1))
            if pidalab.robustness.max_control_sensitivity(loop)[0] <= 5.0:
                assert design.iae <= pidalab.load_response(loop, t).iae()


@pytest.mark.parametrize(
    ("den", "delay", "order"),
    [([1.0, 0.0, 0.0], 1.0, 1), ([1.0, 0.0, 0.0, 0.0], 0.1, 2), ([1.0, 0.0, 1.0], 0.2, 1)],
    ids=["double", "triple", "undamped"],
)
def test_plants_that_only_a_derivative_or_acceleration_stabilises(den, delay, order):
    process = pidalab.Process([1.0], den, delay)
    with pytest.raises(
        ValueError, match=f"no stable controller of order {order - 1} .*; order {order} has some"
    ):
        pidalab.optimal.load(process, order - 1, ms=1.6)
    design = pidalab.optimal.load(process, order, ms=1.6, mks=100.0)
    assert keeps(design, 1.6, 100.0)
    assert {"ms", "mks"} <= set(design.active)


def test_integrators_alone_are_limited_by_noise_only():
    process = pidalab.Process([1.0], [1.0, 0.0, 0.0])
    one, other = (pidalab.optimal.load(process, 1, mks=m) for m in (20.0, 80.0))
    assert keeps(one, 1.4, 20.0)
    # time counts in the root of the gain: four times the noise, half of the time, a quarter of the gain to hold
    assert one.iae / other.iae == pytest.approx(8.0, rel=1e-3)


def test_setpoint_with_the_best_prefilter():
    process = pidalab.fopdt(1.0, 1.0, 1.0)
    design = pidalab.optimal.setpoint(process, 0, ms=1.6, mks=4.0)
    assert keeps(design, 1.6, 4.0)
    t = np.linspace(0.0, 60.0, 6001)
    assert design.iae == pytest.approx(pidalab.step_response(design.loop(), t).iae(), rel=1e-6)
    plain = Loop(process, pidalab.optimal.load(process, 0, ms=1.6, mks=4.0).controller)
    assert design.iae < pidalab.step_response(plain, t).iae()


@pytest.mark.parametrize("test", ["load", "setpoint"])
def test_gradients_are_those_of_the_functions(test):
    problem = Problem(THIRD, 2, (0.6, 1.6), test)
    x = np.array([0.3, 0.5, 0.4, 0.1, -2.0, 0.4, -0.5])[: problem.size]
    for function in (
        problem.worth(120.0),
        SampledNoise(problem, 0.05),
        problem.limits(np.geomspace(0.1, 10.0, 7), 1.4, 20.0),
    ):
        steps = 1e-6 * np.eye(x.size)
        numeric = [(np.asarray(function(x + h)[0]) - np.asarray(function(x - h)[0])) / 2e-6 for h in steps]
        np.testing.assert_allclose(function(x)[1], np.transpose(numeric), atol=1e-6)


def test_iae_of_the_search_is_that_of_the_engine():
    problem = Problem(THIRD, 2, (0.6, 1.6), "load")
    x = np.array([0.3, 0.5, 0.4, 0.1, -2.0])
    gains, time = problem.controller(x)
    exact = pidalab.load_response(
        Loop(THIRD, HighOrderPID(gains, time, 3)), np.linspace(0.0, 120.0, 4001)
    ).iae()
    assert problem.worth(120.0)(x)[0] * 1.6 == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: pidalab.optimal.load(Loop(THIRD, 1.0), 1), TypeError, "pass .process"),
        (lambda: pidalab.optimal.load(THIRD, 5), ValueError, "order must be at most 4, found 5"),
        (lambda: pidalab.optimal.load(THIRD, -1), ValueError, "order must be a whole number, at least 0"),
        (lambda: pidalab.optimal.load(THIRD, 1, ms=1.0), ValueError, "ms must be above 1"),
        (lambda: pidalab.optimal.load(THIRD, 1, mks=0.5), ValueError, r"mks must be above 1/\|P\(0\)\| = 1"),
        (lambda: pidalab.optimal.load(THIRD, 1, noise_gain=2.0), ValueError, "sample_time is missing"),
        (lambda: pidalab.optimal.load(THIRD, 1, sample_time=2.0), ValueError, "noise_gain is missing"),
        (lambda: pidalab.optimal.load(pidalab.Process([1.0, 0.0], [1.0, 1.0]), 1), ValueError, "static gain"),
        (lambda: pidalab.optimal.load(pidalab.ipdt(1.0, 0.0), 1), ValueError, "a lag or a dead time"),
        (
            lambda: pidalab.optimal.load(pidalab.Process([1.0], [1.0, -1.0], 3.0), 1, ms=2.0),
            ValueError,
            "no stable controller of order 1 .* whatever its ms",
        ),
        (
            lambda: pidalab.optimal.load(pidalab.Process([1.0], [1.0, -1.0], 0.9), 1, ms=2.0),
            ValueError,
            "keeps ms <= 2; the nearest has ms = 4.0",
        ),
        (
            lambda: pidalab.optimal.load(pidalab.fopdt(1.0, 1.0, 1.0), 0, noise_gain=1e-5, sample_time=0.1),
            ValueError,
            "too slow to be followed",
        ),
    ],
    ids=["loop", "order", "negative", "ms", "mks", "noise", "sample", "zero", "bare", "unstable", "nearest", "slow"],
)  # fmt: skip
def test_what_cannot_be_is_refused(call, error, message):
    with pytest.raises(error, match=message):
        call()


def test_a_dead_time_too_short_for_the_noise_sets_no_unit():
    """A shorter dead time is no reason for a worse design."""
    longer, shorter = (pidalab.tune(pidalab.fopdt(1.0, 1.0, L), sample_time=1e-3).iae for L in (1e-2, 1e-4))
    assert shorter <= longer


def test_dead_time_alone_has_a_design():
    assert keeps(pidalab.optimal.load(pidalab.Process([1.0], [1.0], 1.0), 0), 1.4)


def stored(name="optimal_check"):
    """Rows of a study, as far as it has run."""
    with (Path(__file__).parents[2] / "book" / "data" / f"{name}.csv").open() as file:
        return list(csv.DictReader(file))


def test_the_second_optimiser_found_nothing_better():
    """It stops at three or four digits."""
    assert len(stored()) >= 14
    assert max(float(row["iae"]) / float(row["iae_second"]) for row in stored()) <= 1.001


def test_a_random_tenth_of_the_stored_optima_again(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "studies")
    plants = importlib.import_module("optimal_check").PLANTS
    rows = stored()
    for row in random.sample(rows, -(-len(rows) // 10)):
        process, mks = plants[row["plant"]]
        again = pidalab.optimal.load(process, int(row["order"]), ms=float(row["ms"]), mks=mks).iae
        assert again == pytest.approx(float(row["iae"]), rel=1e-3), row["plant"]


def test_no_random_start_ends_lower(monkeypatch):
    """As stored, to a thousandth; and once more for one of the problems, with few starts."""
    rows = [row for row in stored("random_starts") if row["ratio"]]
    assert len(rows) >= 80
    assert min(float(row["ratio"]) for row in rows) >= 0.999
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "studies")
    study, row = importlib.import_module("random_starts"), random.choice(rows)
    monkeypatch.setattr(study, "STARTS", 3)
    (again,) = study.beside(int(row["problem"]))
    assert again["iae"] == pytest.approx(float(row["iae"]), rel=1e-3)
    assert again["ratio"] >= 0.999


def test_a_search_keeps_to_one_thread_and_gives_the_others_back(monkeypatch):
    """Small matrices handed from thread to thread made a design ten times as long as its work."""

    def threads():
        return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}

    inside = []
    monkeypatch.setattr("pidalab.optimal._solver.search", lambda *_: inside.append(threads()))
    with threadpool_limits(limits=2, user_api="blas"):
        with pytest.raises(ValueError, match="ms"):
            pidalab.optimal.load(pidalab.fopdt(1.0, 1.0, 1.0), 0)
        assert inside[0] == {1}
        assert threads() == {2}
