"""The benchmarks, as far as they do not depend on time: independent methods approach the exact engine."""

import csv
import json
import re
import sys
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest

import pidalab

sys.path.insert(0, str(Path(__file__).parents[1]))  # pytest's importlib mode does not add it

from benchmarks import dead_time, loops, measure, peers

SPEED = Path(__file__).parents[1] / "book" / "speed"
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


def test_the_reference_of_the_costs_is_the_exact_engine():
    for order in (1, 12):
        loop = loops.family(order, 1.0)
        _, y = peers.exact(loop, HORIZON, None, 100)()
        np.testing.assert_allclose(loops.extrapolated(loop, HORIZON, 100), y, rtol=0, atol=1e-11)


def test_true_margins_are_those_of_an_integrator():
    """K/s e^{-s} under a gain k: gain margin π/2k, phase margin 90° less k rad."""
    gm, pm, _ = loops.true_margins(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.5))
    assert gm == pytest.approx(np.pi, rel=1e-15)
    assert pm == pytest.approx(90 - np.degrees(0.5), rel=1e-15)


def table(name):
    """Rows of a table in book/data, below a line that names the machine."""
    with (measure.DATA / f"{name}.csv").open(encoding="utf-8") as file:
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


def test_the_page_on_speed_types_no_number():
    cells = json.loads((SPEED / "how-fast.ipynb").read_text(encoding="utf-8"))["cells"]
    text = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
    prose = re.sub(r"\]\([^)]*\)|huba2018", "", text)
    assert len(prose) > 2000
    assert re.findall(r".*\d.*", prose) == []
