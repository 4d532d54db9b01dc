"""Check the benchmarks: independent methods converge to the exact engine."""

import csv
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import pidalab

sys.path.insert(0, str(Path(__file__).parents[1]))  # pytest's importlib mode does not add it

from benchmarks import dead_time, loops, measure, peers

HORIZON = 8.0  # dead times
STIFF, STABLE, LARGE, UNSTABLE = (measure.case_loop(dead_time.case_of(*design)) for design in dead_time.LOOPS)


def difference(peer, loop, setting):
    """Return the largest difference from the exact engine, relative to the largest |y| so far and at least 1."""
    t, y = peer(loop, HORIZON, setting)()
    exact = pidalab.step_response(loop, t).y
    return np.max(np.abs(y - exact) / np.maximum(1.0, np.maximum.accumulate(np.abs(exact))))


@pytest.mark.parametrize("peer", [peers.hold, peers.runge_kutta], ids=lambda peer: peer.__name__)
@pytest.mark.parametrize(
    ("loop", "per_delay"),
    [(STIFF, 4000), (STABLE, 400), (LARGE, 400), (UNSTABLE, 2000)],
    ids=["stiff", "stable", "large", "unstable"],
)
def test_fixed_steps_converge_to_the_exact_engine(peer, loop, per_delay):
    """Half the step divides the difference by 2 to the order of the method."""
    coarse, fine = (difference(peer, loop, steps) for steps in (per_delay, 2 * per_delay))
    assert fine < 0.25
    assert np.log2(coarse / fine) == pytest.approx(4 if peer is peers.runge_kutta else 1, abs=0.15)


@pytest.mark.parametrize("loop", [STIFF, STABLE, LARGE], ids=["stiff", "stable", "large"])
def test_error_of_padé_falls_with_its_order(loop):
    errors = [difference(peers.pade, loop, order) for order in (3, 5, 10, 20)]
    assert all(worse > better for worse, better in pairwise(errors))


def test_the_reference_of_the_costs_is_the_exact_engine():
    for order in (1, 12):
        loop = loops.family(order, 1.0)
        _, y = peers.exact(loop, HORIZON, None, 100)()
        np.testing.assert_allclose(loops.extrapolated(loop, HORIZON, 100), y, rtol=0, atol=1e-11)


def test_stored_errors_of_the_exact_engine():
    with (measure.DATA / f"{dead_time.RESULTS}.csv").open(encoding="utf-8") as file:
        assert file.readline().startswith("# Made by `make bench` with Python ")
        errors = [float(row["error"]) for row in csv.DictReader(file) if row["method"] == "pidalab"]
    assert len(errors) == len(dead_time.LOOPS)
    assert max(errors) < 1e-9
