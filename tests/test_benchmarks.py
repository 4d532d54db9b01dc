"""The benchmarks, as far as they do not depend on time: independent methods approach the exact engine."""

import csv
import sys
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest

import pidalab

sys.path.insert(0, str(Path(__file__).parents[1]))  # pytest's importlib mode does not add it

from benchmarks import dead_time, measure, peers, portraits

HORIZON = 8.0  # dead times
STIFF, STABLE, LARGE, UNSTABLE = (measure.case_loop(dead_time.case_of(*design)) for design in dead_time.LOOPS)


def difference(peer, loop, setting):
    """Largest difference from the exact engine, relative to the largest |y| so far and at least 1."""
    t, y = peer(loop, HORIZON, setting)()
    exact = pidalab.step_response(loop, t).y
    return np.max(np.abs(y - exact) / np.maximum(1.0, np.maximum.accumulate(np.abs(exact))))


@pytest.mark.parametrize(
    ("peer", "order", "loop", "per_delay"),
    [
        pytest.param(peers.hold, 1, STIFF, 4000, id="hold-stiff"),
        pytest.param(peers.hold, 1, STABLE, 200, id="hold-stable"),
        pytest.param(peers.hold, 1, LARGE, 200, id="hold-large"),
        pytest.param(peers.hold, 1, UNSTABLE, 2000, id="hold-unstable"),
        pytest.param(peers.runge_kutta, 4, STIFF, 4000, id="runge_kutta-stiff"),
        pytest.param(peers.runge_kutta, 4, STABLE, 400, id="runge_kutta-stable"),
        pytest.param(peers.runge_kutta, 4, LARGE, 400, id="runge_kutta-large"),
        pytest.param(peers.runge_kutta, 4, UNSTABLE, 2000, id="runge_kutta-unstable"),
    ],
)
def test_fixed_steps_converge_to_the_exact_engine(peer, order, loop, per_delay):
    """Half the step divides the difference by 2 to the order, so that its limit is no difference."""
    coarse, fine = (difference(peer, loop, steps) for steps in (per_delay, 2 * per_delay))
    assert fine < 0.25
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.15)


@pytest.mark.parametrize("loop", [STIFF, STABLE, LARGE], ids=["stiff", "stable", "large"])
def test_padé_gets_better_with_its_order(loop):
    errors = [difference(peers.pade, loop, order) for order in (3, 5, 10, 20)]
    assert all(worse > better for worse, better in pairwise(errors))


def table(name):
    """Rows of a table in book/data, below a line that names the machine."""
    with (measure.DATA / f"{name}.csv").open() as file:
        first = file.readline()
        assert first.startswith("# Made by `make bench` with Python ")
        assert " processors " in first
        return list(csv.DictReader(file))


def stored():
    """Rows of the file that an audit reads."""
    return table(dead_time.RESULTS)


def test_stored_results_have_every_loop_and_method():
    asked = [
        (*map(str, design), method, text.format(setting))
        for design, (method, (_, text, settings)) in product(dead_time.LOOPS, dead_time.METHODS.items())
        for setting in settings
    ]
    assert [tuple(row[key] for key in ("m", "n", "te", "method", "setting")) for row in stored()] == asked


def test_stored_results_have_an_error_or_say_why_not():
    for row in stored():
        assert (row["error"] and float(row["seconds"]) > 0) or row["note"]


def test_stored_errors_of_the_exact_engine():
    errors = [float(row["error"]) for row in stored() if row["method"] == "pidalab"]
    assert len(errors) == len(dead_time.LOOPS)
    assert max(errors) < 1e-9


def test_python_control_simulates_the_loops_of_the_portrait():
    """The same loops but for sampling and Padé approximation, which makes waves where y should still rest."""
    fine = portraits.T[:20_001]
    for index in portraits.FEW:
        own = portraits.one_set(index)
        sampled = pidalab.simulate_sampled(pidalab.Loop(portraits.LOOP.process, own), fine, 0.0, load=1.0)
        record = portraits.plain(own, fine[::10])
        assert np.max(np.abs(record.y - sampled.y[::10])) < 0.05
        assert record.iae() == pytest.approx(sampled.iae(), rel=0.003)
    first, last = (portraits.one_set(i).ti / portraits.AROUND["ti"] for i in (0, -1))
    assert (first, last) == pytest.approx((0.8, 1.2))
