"""MIGO: its six examples, its circle, the edge where it ends, and what it refuses."""

import numpy as np
import pytest

import pidalab
from pidalab.rules import migo

APART = pidalab.Process([1.0], np.poly([-1.0, -10.0, -100.0, -1000.0]) / 1e6)
PLANTS = {
    "apart": APART,
    "four lags": pidalab.lags(4),
    "dead time": pidalab.Process([1.0], [0.0025, 0.1, 1.0], 1.0),
    "integrator": pidalab.Process([1.0], [1.0, 1.0, 0.0], 0.5),
    "wrong way": pidalab.Process([-0.5, 1.0], [1.0, 3.0, 3.0, 1.0]),
    "lag": pidalab.fopdt(1.0, 10.0, 1.0),
}
# Åström and Hägglund (2004), M = 1.4: kp, ti and td, as we remember them; the paper was not at hand
PRINTED = {
    ("apart", "PI"): (3.56, 0.66, 0),
    ("apart", "PID"): (56.9, 0.115, 0.0605),
    ("four lags", "PI"): (0.432, 2.43, 0),
    ("four lags", "PID"): (1.19, 2.22, 1.20),
    ("dead time", "PI"): (0.170, 0.404, 0),
    ("dead time", "PID"): (0.216, 0.444, 0.129),
}


@pytest.mark.parametrize("case", PRINTED, ids=" ".join)
def test_the_examples_of_its_authors(case):
    found = migo.tune(PLANTS[case[0]], case[1]).controller
    assert (found.kp, found.ti, found.td) == pytest.approx(PRINTED[case], rel=5e-3)
    assert found.ta == 0


def distance(name, kp, ki, kd, m=1.4):
    """How far the ideal loop keeps outside of the circle, over its radius, at frequencies of our own."""
    w = np.concatenate([np.geomspace(1e-3, 1e5, 20_000), np.arange(0.005, 100.0, 0.005)])
    L = PLANTS[name](1j * w) * (kp + 1j * (kd * w - ki / w))
    low, high = (m - 1) / m, m / (m - 1)
    return float(np.abs(L + (low + high) / 2).min() / ((high - low) / 2) - 1)


@pytest.mark.parametrize("name", PLANTS)
@pytest.mark.parametrize("m", [1.4, 1.8])
def test_no_nearby_controller_integrates_more(name, m):
    """Outside of the circle, with less derivative gain: beside the PID of the rule, and beside its PI with none."""
    rng = np.random.default_rng(0)
    for kind in ("PI", "PID"):
        ki, kp, kd, _ = migo.tune(PLANTS[name], kind, m=m).controller.gains()
        assert abs(distance(name, kp, ki, kd, m)) < 1e-4
        for _ in range(15):
            nearby = (
                kp * (1 + rng.normal(0.0, 0.03)),
                ki * (1 + rng.uniform(2e-3, 0.03)),
                kd * rng.uniform(0.97, 1.0),
            )
            assert distance(name, *nearby, m) < 0
