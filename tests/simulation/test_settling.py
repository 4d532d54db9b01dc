"""Check integrals to infinity."""

import math

import pytest

import pidalab
from pidalab.simulation.exact import simulate_until_settled

LOOP = pidalab.Loop(pidalab.fopdt(1.0, 1.0, 0.5), pidalab.PIDA(kp=0.8, ti=1.0))


@pytest.mark.parametrize("horizon", [3.0, 20.0, 200.0])
def test_the_integral_does_not_depend_on_the_first_horizon(horizon):
    """Without overshoot the IAE of a load step is ti/kp."""
    response = simulate_until_settled(pidalab.load_response, LOOP, horizon)
    assert response.iae(horizon=math.inf) == pytest.approx(1.25, rel=1e-4)


def test_a_first_horizon_may_be_within_the_dead_time():
    loop = pidalab.Loop(pidalab.fopdt(1.0, 1.0, 5.0), pidalab.PIDA(kp=0.2, ti=2.0))
    expected = simulate_until_settled(pidalab.load_response, loop, 100.0).iae(horizon=math.inf)
    for horizon in (1.0, 5.0, 9.9):
        assert simulate_until_settled(pidalab.load_response, loop, horizon).iae(
            horizon=math.inf
        ) == pytest.approx(expected, rel=1e-4)
