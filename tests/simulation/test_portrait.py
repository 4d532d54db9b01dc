"""Portraits: every measure is that of the loop alone, whoever computes it, and nothing is ever missing."""

import os
import signal
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context

import control
import numpy as np
import pandas as pd
import pytest

import pidalab
from pidalab import Loop, Process, SeriesPIDA, portrait, simulate_sampled
from pidalab.simulation.kept import Kept
from pidalab.simulation.lanes import LANES, _beyond
from pidalab.simulation.portrait import Portrait

PDA = SeriesPIDA(0.094, 0.45, 0.208, ti=0.648, filter_time=0.2, filter_order=4, limits=(-1.1, 0.1))
LOOP = Loop(pidalab.ipdt(1.0, delay=1.0), PDA)
T = 0.02 * np.arange(1500)
GRID = {
    "kp": np.array([0.05, 0.094, 0.3])[:, None, None],
    "ka": np.array([0.15, 0.25])[:, None],
    "ti": [0.4, 0.6, 1.0],
}


def expected(record, y_end, u_end):
    """Measures of a record, by `Response`."""
    return {
        "ie": record.ie(),
        "iae": record.iae(),
        "ise": record.ise(),
        "itae": record.itae(),
        "tv_y": record.tv("y"),
        "tv_u": record.tv("u"),
        "tv1_y": record.tv1("y", final=y_end),
        "tv1_u": record.tv1("u", final=u_end),
        "y_min": min(0.0, record.y.min()),
        "y_max": max(0.0, record.y.max()),
        "u_min": min(0.0, record.u.min()),
        "u_max": max(0.0, record.u.max()),
        "y_end": record.y[-1],
        "u_end": record.u[-1],
    }


LAMBDA = {"integrating": 1.0, "misaligned": 0.7371, "short": 0.011, "none": 0.0}
SCENES = {
    **{name: (pidalab.ipdt(1.3, delay), 4, {"load": 1.0}, (-1.1, 0.4)) for name, delay in LAMBDA.items()},
    "set point": (pidalab.ipdt(0.8, 1.0), 4, {"setpoint": -1.3}, (-0.3, 0.2)),
    "noise": (pidalab.ipdt(1.0, 0.5), 2, {"setpoint": 1.0, "noise": 0.05 * np.sin(T**2)}, (-9.0, 9.0)),
    "steps": (pidalab.sopdt(2.0, 0.7, 0.4, 0.311), 6, {"setpoint": np.sign(np.sin(0.3 * T)), "load": 0.1}, (-0.7, 1.5)),
    "feedthrough": (Process([0.2, 1.0], [1.5, 1.0], 0.43), 3, {"setpoint": 1.0, "load": -0.3}, (-0.5, 2.0)),
}  # fmt: skip


@pytest.mark.parametrize("scene", SCENES)
def test_measures_are_those_of_the_response(scene):
    process, order, inputs, limits = SCENES[scene]
    rng, sets = np.random.default_rng(11), 70  # more than one group of lanes
    parameters = {
        "kp": rng.uniform(0.05, 0.6, sets),
        "kd": rng.uniform(0.0, 0.4, sets),
        "ka": rng.uniform(0.0, 0.1, sets),
        "ti": rng.uniform(0.3, 2.0, sets),
        "filter_time": rng.uniform(0.05, 0.3, sets),
    }
    own = SeriesPIDA(1.0, 0.0, 0.0, 1.0, 1.0, order, limits=limits)
    p = portrait(Loop(process, own), parameters, T, **inputs)
    assert not p.diverged.any()
    for i in (0, 1, 13, 40, 63, 64, 69):
        one = SeriesPIDA(*(float(x[i]) for x in parameters.values()), order, limits=limits)
        record = simulate_sampled(Loop(process, one), T, **({"setpoint": 0.0} | inputs))
        rest = record.r[-1] * process.den[-1] / process.num[-1] - record.d[-1]
        for name, value in expected(record, record.r[-1], rest).items():
            assert getattr(p, name)[i] == pytest.approx(value, rel=1e-9, abs=1e-10), (i, name)


@pytest.mark.parametrize("order", [0, 1])
def test_low_filter_orders(order):
    own = SeriesPIDA(0.3, 0.1 * order, 0.0, 2.0, 0.1, order, limits=(-0.2, 0.3))
    p = portrait(Loop(LOOP.process, own), {"ti": [1.5, 2.0]}, T, setpoint=1.0)
    record = simulate_sampled(Loop(LOOP.process, own), T, setpoint=1.0)
    for name, value in expected(record, 1.0, 0.0).items():
        assert getattr(p, name)[1] == pytest.approx(value, rel=1e-9, abs=1e-10), name


def cancelling(kp, kd, ka, ti):
    """Denominator of huba2024, eq. (20), in descending powers; arrays or numbers."""
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
        own = SeriesPIDA(kp, 0.45, ka, own_ti, 0.2, 4, limits=(-0.1, 0.1))
        filtered = control.tf([0.5 * own_ti, 1.0], cancelling(kp, 0.45, ka, own_ti))
        record = simulate_sampled(Loop(LOOP.process, own, prefilter=filtered), T, setpoint=1.0)
        for name, value in expected(record, 1.0, 0.0).items():
            assert getattr(p, name)[i] == pytest.approx(value, rel=1e-9, abs=1e-10), (i, name)
    fixed = Loop(LOOP.process, PDA, prefilter=control.tf([0.3, 1.0], [0.8, 1.0]))
    same = portrait(LOOP, GRID, T, setpoint=1.0, prefilter=([0.3, 1.0], [0.8, 1.0]))
    np.testing.assert_array_equal(portrait(fixed, GRID, T, setpoint=1.0).iae, same.iae)


def test_a_prefilter_follows_a_set_point_that_moves_late_and_ignores_a_load():
    filtered, late = (
        Loop(LOOP.process, PDA, prefilter=control.tf([1.0], [0.8, 1.0])),
        np.where(T < 5.0, 0.0, 1.0),
    )
    found, record = portrait(filtered, {"kp": PDA.kp}, T, late), simulate_sampled(filtered, T, late)
    assert found.iae == pytest.approx(record.iae(), rel=1e-9)
    assert_same_bits(portrait(filtered, GRID, T, load=1.0), portrait(LOOP, GRID, T, load=1.0))


@pytest.mark.parametrize(
    "c", [(1.0, -1.9, 1.0), (1.0, -2.1, 1.0), (-0.2, 1.1, 0.0), (0.3, -0.2, -0.9), (0.1, -1.0, 1.9)]
)
def test_what_an_absolute_value_adds_to_a_parabola(c):
    """From its roots between 0 and 1, if there are some."""
    h, start, s = 0.1, 3.0, np.linspace(0.0, 1.0, 200_001)
    e, when = np.polynomial.polynomial.polyval(s, c), start + h * s
    more, weighted = (np.trapezoid(abs(f), s) - abs(np.trapezoid(f, s)) for f in (e, when * e))
    assert _beyond(*c, h, start) == pytest.approx((more, weighted), abs=1e-8)


def assert_same_bits(one, other):
    for name, a, b in zip(one._fields, one, other, strict=True):
        assert a.dtype == b.dtype
        assert a.tobytes() == b.tobytes(), name


@pytest.fixture(scope="module")
def many():
    """Sets of many chunks, some of which diverge, and their portrait by threads."""
    rng = np.random.default_rng(2)
    sets = {
        "kp": rng.uniform(0.05, 0.3, 500),
        "ti": rng.uniform(0.1, 1.0, 500),
        "kd": rng.uniform(0.2, 2.0, 500),
    }
    own = SeriesPIDA(0.094, 0.45, 0.208, 0.648, 0.2, 4)
    task = {"loop": Loop(LOOP.process, own), "parameters": sets, "t": T, "load": 1.0}
    p = portrait(**task)
    assert 50 < np.sum(p.iae > 1e3) < 450
    return task, p


def test_chunks_and_neighbours_do_not_matter(many):
    task, p = many
    for chunk in (1, 100, 10**6):
        assert_same_bits(portrait(**task, chunk=chunk), p)
    own_times = ([1.0], [np.linspace(0.01, 40.0, 500), 1.0, 1.0])
    step = task | {"load": 0.0, "setpoint": 1.0, "prefilter": own_times}
    assert_same_bits(portrait(**step, chunk=1), portrait(**step, chunk=10**6))
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
        assert pool.submit(os.getpid).result() != os.getpid()  # it is left open


@pytest.fixture(scope="module")
def dask_client():
    distributed = pytest.importorskip("distributed", reason="no distributed: pip install distributed")
    import dask

    with (
        dask.config.set({"distributed.worker.daemon": True, "distributed.comm.timeouts.connect": "30s"}),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0", host="127.0.0.1"
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def test_dask_gives_the_same_bits(many, dask_client):
    task, p = many
    assert_same_bits(portrait(**task, executor=dask_client.get_executor()), p)
    workers = dask_client.run(os.getpid)
    assert len(set(workers.values()) | {os.getpid()}) == 3  # two other processes


class Deadly(ProcessPoolExecutor):
    """A pool whose third task ends its worker."""

    tasks = 0

    def submit(self, fn, /, *args, **kwargs):
        self.tasks += 1
        return super().submit(os._exit, 7) if self.tasks == 3 else super().submit(fn, *args, **kwargs)


def test_a_worker_that_dies_is_an_error_that_names_the_sets(many):
    task, _ = many
    with (
        Deadly(1, mp_context=get_context("spawn")) as pool,
        pytest.raises(
            RuntimeError, match=r"lost: \d+ of 500 sets are missing \(in flat order .*\)"
        ) as caught,
    ):
        portrait(**task, executor=pool)
    assert isinstance(caught.value.__cause__, BrokenProcessPool)
    assert "128 to 191" in str(caught.value)


def test_a_worker_that_fails_is_an_error_that_names_the_sets(many):
    class Failing(ThreadPoolExecutor):
        def submit(self, fn, /, *args, **kwargs):
            self.tasks = getattr(self, "tasks", 0) + 1
            return super().submit(int, "x") if self.tasks in (2, 8) else super().submit(fn, *args, **kwargs)

    task, _ = many
    with (
        Failing(2) as pool,
        pytest.raises(RuntimeError, match=r"116 of 500 sets .* order 64 to 127, 448 to 499\)"),
    ):
        portrait(**task, executor=pool)


class Killing(Executor):
    """An executor that ends a worker, which has some of the tasks then, once half of them are handed over."""

    def __init__(self, inner, victim):
        self.inner, self.victim, self.tasks = inner, victim, 0

    def submit(self, fn, /, *args, **kwargs):
        self.tasks += 1
        if self.tasks == 5:
            os.kill(self.victim, signal.SIGKILL)
        return self.inner.submit(fn, *args, **kwargs)


def test_dask_finishes_without_a_worker_that_dies(many, dask_client):
    """The cluster hands the dead worker's sets to others."""
    task = many[0] | {"t": 0.001 * np.arange(40_000)}
    executor = dask_client.get_executor(retries=2)
    victim = executor.submit(os.getpid).result()
    assert_same_bits(portrait(**task, executor=Killing(executor, victim)), portrait(**task))
    assert victim not in dask_client.run(os.getpid).values()


def test_what_diverges_is_infinite():
    free = Loop(LOOP.process, SeriesPIDA(0.094, 0.45, 0.208, 0.648, 0.2, 4))
    p = portrait(free, {"kd": [0.45, 50.0]}, 0.1 * np.arange(5000), load=1.0)
    assert p.diverged.tolist() == [False, True]
    assert not p.missing.any()
    for name, x in zip(p._fields[:-2], p, strict=False):
        assert np.isfinite(x[0]), name
        assert x[1] == np.inf, name


def test_shape_of_the_grid():
    p = portrait(LOOP, GRID, T[:50], load=1.0)
    assert all(x.shape == (3, 2, 3) for x in p)
    assert portrait(LOOP, {}, T[:50], load=1.0).iae.shape == ()


def test_one_row_of_a_table_is_a_set():
    row = pd.DataFrame({"ti": [0.5, 0.6], "kp": [0.1, 0.2]}).iloc[1]
    assert (
        portrait(LOOP, row, T[:100], load=1.0).iae
        == portrait(LOOP, {"ti": 0.6, "kp": 0.2}, T[:100], load=1.0).iae
    )


def test_progress_bar(capsys):
    portrait(LOOP, GRID, T[:50], load=1.0, progress=True)
    assert "18/18" in capsys.readouterr().err
    portrait(LOOP, GRID, T[:50], load=1.0)
    assert capsys.readouterr().err == ""


WIDE = np.ones(3000)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"loop": PDA}, TypeError, "loop must be a pidalab.Loop, found SeriesPIDA"),
        ({"loop": Loop(LOOP.process, 0.5)}, TypeError, "loop must have a SeriesPIDA and no output filter, or digital"),
        ({"loop": Loop(LOOP.process, PDA, control.tf(1, [1, 1]))}, TypeError, "and no output filter"),
        ({"parameters": [1.0]}, TypeError, "parameters must be a mapping or a DataFrame .* found list"),
        ({"parameters": {"Kp": [1.0]}}, ValueError, "parameters must be among kp, kd, .* found 'Kp'"),
        ({"parameters": {"kp": ["a"]}}, TypeError, r"parameters\['kp'\] must be an array of real numbers"),
        ({"parameters": {"kp": [[1.0], [1.0, 2.0]]}}, TypeError, r"parameters\['kp'\] must be .* different lengths"),
        ({"prefilter": control.tf(1, [1, 1])}, TypeError, "prefilter must be two sequences of coefficients"),
        ({"parameters": {"kp": []}}, ValueError, r"at least one set, found a grid of shape \(0,\)"),
        ({"parameters": {"kp": [1.0, 2.0], "kd": [1, 2, 3]}}, ValueError, r"broadcast together, found .*'kd': \(3,\)"),
        ({"parameters": {"kp": [1.0, np.nan]}}, ValueError, "kp must be finite and not 0, found nan at index 1"),
        ({"parameters": {"kp": [[1.0], [0.0]]}}, ValueError, r"kp must be finite and not 0, .* index \(1, 0\)"),
        ({"parameters": {"ti": [1.0, -1.0]}}, ValueError, r"ti must be finite and above 0, found -1\.0 at index 1"),
        ({"parameters": {"kd": [np.inf]}}, ValueError, "kd must be finite, found inf at index 0"),
        ({"parameters": {"filter_time": [0.2, 0.01]}}, ValueError, r"sample time must be .* \(0\.01\), found 0\.02"),
        ({"limits": (0.1, -0.1)}, ValueError, r"limits must be \(lower, upper\)"),
        ({"load": 2.0}, ValueError, r"no state of rest: .* need u from -2 to -2, and the limits are \(-1\.1, 0\.1\)"),
        ({"load": [1.0]}, ValueError, "load must be a number or an array as long as t"),
        ({"t": [0.0, 1.0, 3.0]}, ValueError, "t must be uniform"),
        ({"prefilter": ([1.0], [1.0, -1.0])}, ValueError, r"prefilter must be stable, found a pole at 1"),
        ({"prefilter": ([1.0, 1.0], [1.0])}, ValueError, "prefilter must be proper, found 2 and 1"),
        ({"prefilter": ([1.0], [0.0, 1.0])}, ValueError, "first and last coefficients are not 0"),
        ({"prefilter": ([np.nan], [1.0, 1.0])}, ValueError, "prefilter must have finite coefficients"),
        ({"prefilter": 1.0}, TypeError, "prefilter must be two sequences of coefficients, found 1.0"),
        ({"executor": 4}, TypeError, "executor must be a concurrent.futures.Executor or None, found int"),
        ({"memory": 1e4, "t": 1e-3 * np.arange(9.0)}, MemoryError, r"1e\+03 samples need about 5.12e\+05"),
        ({"prefilter": ([1.0], [np.ones(3), 1.0])}, ValueError, r"broadcast together, found .*'prefilter': .*\(3,\)"),
        ({"memory": 0.0}, ValueError, "memory must be above 0, found 0"),
        ({"chunk": 0}, ValueError, "chunk must be a whole number, at least 1, found 0"),
        ({"parameters": {"kp": WIDE[:, None, None], "kd": WIDE[:, None], "ti": WIDE}}, MemoryError,
         r"a grid of shape \(3000, 3000, 3000\) and .* need about 6.48e\+12 bytes, and memory = 2e\+09"),
    ],
)  # fmt: skip
def test_portrait_complains(arguments, error, message):
    with pytest.raises(error, match=message):
        portrait(**({"loop": LOOP, "parameters": {"kp": [0.1, 0.2]}, "t": T, "load": 1.0} | arguments))


def test_half_a_byte_more_than_two_gigabytes_is_refused():
    """Of each set two numbers for every measure, and one for each lane and sample of dead time."""
    numbers = 2 * 2 * len(Portrait._fields[:-1])
    samples = ((2e9 + 0.5) / 8 - numbers) / LANES
    loop = Loop(pidalab.ipdt(1.0, samples * T[1]), PDA)
    with pytest.raises(MemoryError, match=r"memory = 2e\+09 are allowed"):
        portrait(loop, {"kp": [0.1, 0.2]}, T, load=1.0)


def test_derivatives_need_a_filter():
    own = SeriesPIDA(1.0, 0.0, 0.0, 1.0, 0.1, 1)
    with pytest.raises(ValueError, match="ka needs a filter_order of at least 2, found 1"):
        portrait(Loop(LOOP.process, own), {"ka": [0.1]}, T, load=1.0)


def digital_sets():
    """PI, PID and PIDA as a computer runs them, in other units and with limits of their own."""
    classes = [pidalab.PIDA(0.3, 6.0), pidalab.PIDA(0.4, 5.0, 0.4, 0.05, n=5, m=1), PDA]
    usual = {"limits": (-2.0, 0.5), "c": 0.0}
    units = {
        "limits": (10.0, 90.0),
        "bias": 50.0,
        "u_span": 40.0,
        "y_span": 2.0,
        "y_offset": 7.0,
        "rate_limit": 40.0,
    }
    return [[C.discretise(0.05, **options) for C in classes] for options in (usual, units)]


DIGITAL = digital_sets()
STEPS = 0.05 * np.arange(600)
DIGITAL_LOOP = Loop(LOOP.process, DIGITAL[0][0], prefilter=control.tf([1.0], [0.5, 1.0]))
TASK = {"loop": DIGITAL_LOOP, "parameters": {"controller": DIGITAL}, "t": STEPS, "setpoint": 0.7, "load": 0.2}


def test_digital_controllers_are_those_of_the_response():
    p = portrait(**TASK, limits=(-0.9, 1.5))
    assert p.iae.shape == (2, 3)
    assert not (p.diverged | p.missing).any()
    for i, j in np.ndindex(2, 3):
        loop = Loop(LOOP.process, DIGITAL[i][j], prefilter=DIGITAL_LOOP.prefilter)
        record = simulate_sampled(loop, STEPS, setpoint=0.7, load=0.2, limits=(-0.9, 1.5))
        for name, value in expected(record, 0.7, -0.2).items():
            assert getattr(p, name)[i, j] == pytest.approx(value, rel=1e-9, abs=1e-12), name
    assert_same_bits(portrait(**TASK, limits=(-0.9, 1.5), chunk=1, executor=ThreadPoolExecutor(1)), p)
    alone = portrait(**(TASK | {"parameters": {}}), limits=(-0.9, 1.5))
    assert (alone.iae.shape, alone.iae) == ((), p.iae[0, 0])


def test_a_digital_loop_that_diverges_is_infinite():
    wild = pidalab.PIDA(50.0, 1.0).discretise(0.05)
    p = portrait(
        Loop(LOOP.process, wild), {"controller": [wild, DIGITAL[0][0]]}, 0.05 * np.arange(6000), setpoint=0.7
    )
    assert p.diverged.tolist() == [True, False]
    assert (p.iae[0], p.tv1_u[0]) == (np.inf, np.inf)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"parameters": {"kp": [1.0]}}, ValueError, "parameters must be 'controller', .* found 'kp'"),
        ({"parameters": {"controller": [PDA]}}, TypeError, "found SeriesPIDA at index 0 .* discretise"),
        ({"parameters": {"controller": []}}, ValueError, "at least one set"),
        ({"parameters": [1.0]}, TypeError, "parameters must be a mapping, found list"),
        ({"t": T}, ValueError, "t must have the sample time of the digital controllers, 0.05 at index 0"),
        ({"prefilter": ([1.0], [1.0, 1.0])}, ValueError, "prefilter must be that of the loop"),
        ({"limits": (0.1, 1.0)}, ValueError, "hold 0, the control signal at rest"),
        ({"load": 0.8}, ValueError, "no state of rest: .* need u from -0.8 to -0.8, and the limits are"),
        ({"resume": 3}, TypeError, "resume must be the path of a file, found 3"),
        ({"resume": __file__}, ValueError, "resume must be a file that portrait wrote"),
        ({"resume": "nowhere/p"}, ValueError, "resume must be in a folder that exists, found nowhere"),
    ],
)  # fmt: skip
def test_portrait_of_digital_controllers_complains(arguments, error, message):
    with pytest.raises(error, match=message):
        portrait(**(TASK | {"limits": (-0.9, 0.6) if "load" not in arguments else (-0.7, 0.6)} | arguments))


class Interrupting(ThreadPoolExecutor):
    """An executor whose third result is a Ctrl-C; it counts the sets that it is given."""

    def __init__(self, at=3):
        super().__init__(1)
        self.at, self.tasks, self.sets = at, 0, 0

    def submit(self, fn, /, *args, **kwargs):
        self.tasks += 1
        self.sets += args[1].shape[0]
        future = super().submit(fn, *args, **kwargs)
        if self.tasks == self.at:
            future.result()
            future = Future()
            future.set_exception(KeyboardInterrupt())
        return future


def test_what_is_interrupted_returns_what_it_has_and_goes_on_from_a_file(many, tmp_path):
    task, whole = many
    file = tmp_path / "portrait.npz"
    with Interrupting() as pool, pytest.warns(UserWarning, match=r"interrupted: \d+ of 500 sets are missing"):
        p = portrait(**task, executor=pool, resume=file)
    assert 0 < p.missing.sum() < 500
    assert not (p.missing & p.diverged).any()
    for name, x, true in zip(p._fields[:-2], p, whole, strict=False):
        assert np.isnan(x[p.missing]).all(), name
        np.testing.assert_array_equal(x[~p.missing], true[~p.missing])
    # only what is missing is computed, in whole chunks, and the result is the same to the bit
    with Interrupting(at=0) as pool:
        assert_same_bits(portrait(**task, executor=pool, resume=str(file)), whole)
        assert p.missing.sum() <= pool.sets < 500
        assert_same_bits(portrait(**task, executor=pool, resume=file, chunk=100), whole)
        assert pool.sets < 500  # nothing more
    assert [path.name for path in tmp_path.iterdir()] == ["portrait.npz"]
    for other in ({"load": 1.1}, {"limits": (-2.0, 2.0)}, {"t": T[:-1]}, {"parameters": {"kp": [0.1, 0.2]}}):
        with pytest.raises(ValueError, match=r"resume: .*portrait\.npz holds another portrait"):
            portrait(**(task | other), resume=file)


def test_what_a_lost_worker_leaves_is_kept(many, tmp_path):
    class Failing(ThreadPoolExecutor):
        def submit(self, fn, /, *args, **kwargs):
            self.tasks = getattr(self, "tasks", 0) + 1
            return super().submit(int, "x") if self.tasks == 2 else super().submit(fn, *args, **kwargs)

    task, whole = many
    with Failing(1) as pool, pytest.raises(RuntimeError, match="64 of 500 sets are missing"):
        portrait(**task, executor=pool, resume=tmp_path / "p")
    with Interrupting(at=0) as pool:
        assert_same_bits(portrait(**task, executor=pool, resume=tmp_path / "p"), whole)
        assert pool.sets == 64


def test_digital_portraits_go_on_from_a_file(tmp_path):
    whole = portrait(**TASK, limits=(-0.9, 1.5), resume=tmp_path / "p")
    assert_same_bits(portrait(**TASK, limits=(-0.9, 1.5), resume=tmp_path / "p"), whole)
    other = [[DIGITAL[0][0]] * 3, DIGITAL[1]]
    with pytest.raises(ValueError, match="holds another portrait"):
        portrait(**(TASK | {"parameters": {"controller": other}}), limits=(-0.9, 1.5), resume=tmp_path / "p")


def test_sets_that_differ_in_the_prefilter_alone():
    lags = np.array([0.5, 1.0, 2.0])
    found = portrait(LOOP, {"kp": 0.1}, T, setpoint=1.0, prefilter=([1.0], [lags, 1.0]))
    assert found.iae.shape == (3,)
    for value, lag in zip(found.iae, lags, strict=True):
        single = portrait(LOOP, {"kp": 0.1}, T, setpoint=1.0, prefilter=([1.0], [lag, 1.0]))
        assert value == pytest.approx(float(single.iae), rel=1e-12)


def test_a_portrait_is_written_at_once_only_if_asked(tmp_path):
    kept, done = Kept(tmp_path / "p.npz"), np.zeros(3)
    kept.save(done, 0)
    assert not kept.path.exists()
    kept.save(done, 0, now=True)
    assert kept.path.exists()
