"""Integrals to infinity, from whatever horizon the search begins."""

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


def test_a_loop_that_never_settles_is_said():
    with pytest.raises(ValueError, match=rf"does not settle within {3 * 2**13:.3g}".replace("+", r"\+")):
        simulate_until_settled(pidalab.load_response, pidalab.Loop(pidalab.fopdt(1.0, 1.0, 0.5), 0.5), 3.0)


def test_a_first_horizon_within_the_dead_time_is_passed_over():
    loop = pidalab.Loop(pidalab.fopdt(1.0, 1.0, 5.0), pidalab.PIDA(kp=0.2, ti=2.0))
    expected = simulate_until_settled(pidalab.load_response, loop, 100.0).iae(horizon=math.inf)
    for horizon in (1.0, 5.0, 9.9):
        assert simulate_until_settled(pidalab.load_response, loop, horizon).iae(
            horizon=math.inf
        ) == pytest.approx(expected, rel=1e-4)
    with pytest.raises(ValueError, match="horizon must be above 0, found 0"):
        simulate_until_settled(pidalab.load_response, loop, 0.0)


def test_more_dead_times_than_can_be_followed_are_said_in_the_words_of_the_loop():
    loop = pidalab.Loop(pidalab.fopdt(1.0, 1.0, 1e-9), pidalab.PIDA(kp=0.8, ti=1.0))
    with pytest.raises(ValueError, match=r"the loop needs 2e\+10 dead times"):
        simulate_until_settled(pidalab.load_response, loop, 20.0)
