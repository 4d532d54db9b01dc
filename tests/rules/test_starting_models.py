"""Compare starting models, read from step responses, with closed forms."""

import numpy as np
import pytest
from scipy import optimize

import pidalab
from pidalab.rules.models import StartingModels


def test_reaction_curve_of_two_equal_lags():
    """The tangent at t = 1 of 1/(s + 1)^2 has the slope 1/e and meets the level of rest at 3 - e."""
    model = StartingModels(pidalab.lags(2, delay=0.5)).reaction
    reached = 2.146193  # (1 + t) exp(-t) = 1/e
    assert model.delay == pytest.approx(0.5 + 3 - np.e, rel=1e-4)
    assert model.delay - 0.5 + 1 / -np.roots(model.den)[0] == pytest.approx(reached, rel=2e-3)


def test_an_integrator_with_a_lag_has_its_reaction_curve():
    """The tangent starts after lag and dead time."""
    models = StartingModels(pidalab.Process([2.0], [0.3, 1.0, 0.0], 0.7))
    assert models.reaction is models.integrator
    assert models.reaction.delay == pytest.approx(1.0, rel=1e-3)
    assert models.reaction.num[0] / models.reaction.den[0] == pytest.approx(2.0, rel=1e-3)


@pytest.mark.parametrize("lag", [0.01, 0.2, 1.0, 500.0])
def test_reaction_curve_does_not_depend_on_the_dead_time(lag):
    """Two equal lags are steepest after one of them, with the slope 1/(e lag) at a height of 1 - 2/e."""
    model = StartingModels(pidalab.lags(2, lag=lag, delay=1.0)).reaction
    delay = 1.0 + lag - (np.e - 2) * lag
    reached = 1.0 + lag * optimize.brentq(lambda x: (1 + x) * np.exp(-x) - np.exp(-1), 1.0, 4.0)
    assert model.delay == pytest.approx(delay, rel=1e-5)
    assert model.den[0] / model.den[1] == pytest.approx(reached - delay, rel=1e-5)


def test_a_step_response_with_a_large_jump_has_no_lag():
    """The jump is 80 % of the response."""
    with pytest.raises(ValueError, match="lag must be above 0"):
        _ = StartingModels(pidalab.Process([0.8, 1.0], [1.0, 1.0])).reaction


def test_an_integrator_is_its_own_model_and_a_lag_is_not():
    process = pidalab.ipdt(2.0, delay=0.7)
    assert StartingModels(process).integrator is process
    lag = StartingModels(pidalab.fopdt(2.0, lag=4.0, delay=0.7)).integrator
    assert (lag.num[0], lag.den.tolist()) == (pytest.approx(0.5, rel=1e-2), [1.0, 0.0])
