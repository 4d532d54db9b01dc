"""Check portraits: measures match single simulations, with any executor."""

import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import control
import numpy as np
import pandas as pd
import pytest

import pidalab
from pidalab import Loop, Process, SeriesPIDA, portrait, simulate_sampled
from pidalab.simulation.sampled_lanes import _beyond

PDA = SeriesPIDA(0.094, 0.45, 0.208, ti=0.648, filter_time=0.2, filter_order=4, limits=(-1.1, 0.1))
LOOP = Loop(pidalab.ipdt(1.0, delay=1.0), PDA)
T = 0.02 * np.arange(1500)
GRID = {
    "kp": np.array([0.05, 0.094, 0.3])[:, None, None],
    "ka": np.array([0.15, 0.25])[:, None],
    "ti": [0.4, 0.6, 1.0],
}


def expected(record, y_end, u_end):
    """Return the measures of a record by `Response` up to its end, since some responses diverge."""
    end, measures = record.t[-1], {}
    for name in ("y", "u"):
        x, last = getattr(record, name), {"y": y_end, "u": u_end}[name]
        measures |= {f"tv_{name}": record.tv(name, end), f"tv1_{name}": record.tv1(name, end, final=last)}
        measures |= {f"{name}_min": min(0.0, x.min()), f"{name}_max": max(0.0, x.max()), f"{name}_end": x[-1]}
    return measures | {name: getattr(record, name)(end) for name in ("ie", "iae", "ise", "itae")}


LAMBDA = {"integrating": 1.0, "misaligned": 0.7371, "short": 0.011, "none": 0.0}
SCENES = {
    **{name: (pidalab.ipdt(1.3, delay), 4, {"load": 1.0}, (-1.1, 0.4)) for name, delay in LAMBDA.items()},
    "set point": (pidalab.ipdt(0.8, 1.0), 4, {"setpoint": -1.3}, (-0.3, 0.2)),
    "noise": (pidalab.ipdt(1.0, 0.5), 2, {"setpoint": 1.0, "noise": 0.05 * np.sin(T**2)}, (-9.0, 9.0)),
    "steps": (pidalab.sopdt(2.0, 0.7, 0.4, 0.311), 6, {"setpoint": np.sign(np.sin(0.3 * T)), "load": 0.1}, (-0.7, 1.5)),
    "no filter": (pidalab.ipdt(1.0, 1.0), 0, {"setpoint": 1.0}, (-0.2, 0.3)),
    "filter of order 1": (pidalab.ipdt(1.0, 1.0), 1, {"setpoint": 1.0}, (-0.2, 0.3)),
    "feedthrough": (Process([0.2, 1.0], [1.5, 1.0], 0.43), 3, {"setpoint": 1.0, "load": -0.3}, (-0.5, 2.0)),
}  # fmt: skip


@pytest.mark.parametrize("scene", SCENES)
def test_measures_are_those_of_the_response(scene):
    process, order, inputs, limits = SCENES[scene]
    rng, sets = np.random.default_rng(11), 134  # more than one group of lanes
    parameters = {
        "kp": rng.uniform(0.05, 0.6, sets),
        "kd": rng.uniform(0.0, 0.4, sets) * (order > 0),
        "ka": rng.uniform(0.0, 0.1, sets) * (order > 1),
        "ti": rng.uniform(0.3, 2.0, sets),
        "filter_time": rng.uniform(0.05, 0.3, sets),
    }
    controller = SeriesPIDA(1.0, 0.0, 0.0, 1.0, 1.0, order, limits=limits)
    p = portrait(Loop(process, controller), parameters, T, **inputs)
    assert not p.diverged.any()
    for i in (0, 1, 13, 40, 127, 128, 133):
        single = SeriesPIDA(*(float(x[i]) for x in parameters.values()), order, limits=limits)
        record = simulate_sampled(Loop(process, single), T, **({"setpoint": 0.0} | inputs))
        final = record.r[-1] * process.den[-1] / process.num[-1] - record.d[-1]
        for name, value in expected(record, record.r[-1], final).items():
            assert getattr(p, name)[i] == pytest.approx(value, rel=1e-9, abs=1e-10), (i, name)


def test_an_error_that_dips_below_zero_between_two_samples_counts():
    """Between t = 52.5 and 53 the error falls from 1.8 to -0.05, and ends above 0."""
    process, t, limits = Process([1.0], [1.0, 0.4, 1.0]), 0.5 * np.arange(200), (-1e5, 1e5)
    loop = Loop(process, SeriesPIDA(0.4141294824294266, 0.0, 0.0, 2.463764864097676, 1.0, 0, limits=limits))
    record = simulate_sampled(loop, t, setpoint=1e4)
    measures = portrait(loop, {}, t, setpoint=1e4)
    assert measures.iae == pytest.approx(record.iae(), rel=1e-12)
    assert measures.itae == pytest.approx(record.itae(), rel=1e-12)


def cancelling(kp, kd, ka, ti):
    """Return the denominator of huba2024, eq. (20), in descending powers; arrays or numbers."""
    return (ka / kp * ti, ka / kp + kd / kp * ti, kd / kp + ti, 1.0)


def test_prefilters_that_differ():
    ti = np.array(GRID["ti"])
    den = cancelling(GRID["kp"], 0.45, GRID["ka"], ti)
    p = portrait(LOOP, GRID, T, setpoint=1.0, limits=(-0.1, 0.1), prefilter=([0.5 * ti, 1.0], den))
    for i in [(0, 0, 0), (1, 1, 2), (2, 0, 1)]:
        kp, ka, own_ti = (
            float(x.flat[k] if x.ndim > 1 else x[k])
            for x, k in zip((GRID["kp"], GRID["ka"], ti), i, strict=True)
        )
        controller = SeriesPIDA(kp, 0.45, ka, own_ti, 0.2, 4, limits=(-0.1, 0.1))
        filtered = control.tf([0.5 * own_ti, 1.0], cancelling(kp, 0.45, ka, own_ti))
        record = simulate_sampled(Loop(LOOP.process, controller, prefilter=filtered), T, setpoint=1.0)
        for name, value in expected(record, 1.0, 0.0).items():
            assert getattr(p, name)[i] == pytest.approx(value, rel=1e-9, abs=1e-10), (i, name)
    fixed = Loop(LOOP.process, PDA, prefilter=control.tf([0.3, 1.0], [0.8, 1.0]))
    same = portrait(LOOP, GRID, T, setpoint=1.0, prefilter=([0.3, 1.0], [0.8, 1.0]))
    np.testing.assert_array_equal(portrait(fixed, GRID, T, setpoint=1.0).iae, same.iae)


@pytest.mark.parametrize(
    "c", [(1.0, -1.9, 1.0), (1.0, -2.1, 1.0), (-0.2, 1.1, 0.0), (0.3, -0.2, -0.9), (0.1, -1.0, 1.9)]
)
def test_integral_of_the_absolute_value_of_a_parabola(c):
    """The parabola may have roots between 0 and 1."""
    h, start, s = 0.1, 3.0, np.linspace(0.0, 1.0, 200_001)
    e, when = np.polynomial.polynomial.polyval(s, c), start + h * s
    more, weighted = (np.trapezoid(abs(f), s) - abs(np.trapezoid(f, s)) for f in (e, when * e))
    assert _beyond(*c, h, start) == pytest.approx((more, weighted), abs=1e-8)


def assert_same_bits(first, second):
    for name, a, b in zip(first._fields, first, second, strict=True):
        assert a.dtype == b.dtype
        assert a.tobytes() == b.tobytes(), name


@pytest.fixture(scope="module")
def many():
    """Return many sets of parameters, some with diverging responses, and their portrait."""
    rng = np.random.default_rng(2)
    sets = {
        "kp": rng.uniform(0.05, 0.3, 500),
        "ti": rng.uniform(0.1, 1.0, 500),
        "kd": rng.uniform(0.2, 2.0, 500),
    }
    controller = SeriesPIDA(0.094, 0.45, 0.208, 0.648, 0.2, 4)
    task = {"loop": Loop(LOOP.process, controller), "parameters": sets, "t": T, "load": 1.0}
    p = portrait(**task)
    assert 50 < np.sum(p.iae > 1e3) < 450
    return task, p


def test_neighbours_do_not_matter(many):
    task, p = many
    order = np.random.default_rng(0).permutation(500)
    shuffled = portrait(**(task | {"parameters": {name: x[order] for name, x in task["parameters"].items()}}))
    np.testing.assert_array_equal(shuffled.itae, p.itae[order])
    table = pd.DataFrame(task["parameters"], index=order)
    assert_same_bits(portrait(**(task | {"parameters": table})), p)
    assert table.assign(**p._asdict()).shape == (500, 3 + len(p))


def test_process_pool_gives_the_same_bits(many):
    task, p = many
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        assert_same_bits(portrait(**task, executor=pool), p)
        assert pool.submit(os.getpid).result() != os.getpid()  # the executor is still open


def test_diverging_sets_are_infinite():
    free = Loop(LOOP.process, SeriesPIDA(0.094, 0.45, 0.208, 0.648, 0.2, 4))
    p = portrait(free, {"kd": [0.45, 50.0]}, 0.1 * np.arange(5000), load=1.0)
    assert p.diverged.tolist() == [False, True]
    for name, x in zip(p._fields[:-1], p, strict=False):
        assert np.isfinite(x[0]), name
        assert x[1] == np.inf, name


def test_shape_of_the_grid():
    p = portrait(LOOP, GRID, T[:50], load=1.0)
    assert all(x.shape == (3, 2, 3) for x in p)
    assert portrait(LOOP, {}, T[:50], load=1.0).iae.shape == ()
