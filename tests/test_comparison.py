"""All rules on one process: each is a row, measured on the process, and the optimum is the best of those in limits."""

import numpy as np
import pytest
from scipy import optimize

import pidalab
from pidalab.comparison import candidates
from pidalab.rules import classical


@pytest.fixture(scope="module")
def integrating():
    return pidalab.compare(pidalab.ipdt(0.1, delay=1.0), ms=1.6, noise_gain=10.0, sample_time=0.05)


def row(table, rule, kind):
    (found,) = [one for one in table.rows if (one.rule, one.kind) == (rule, kind)]
    return found


def test_nothing_in_the_limits_beats_the_optimum_of_its_kind(integrating):
    for kind in ("PI", "PID", "PIDA"):
        best = row(integrating, "optimal", kind)
        assert integrating.keeps(best)
        rivals = [one for one in integrating.rows if one.kind == kind and integrating.keeps(one)]
        assert min(one.iae_load for one in rivals) >= best.iae_load * 0.999


def test_a_rule_outside_its_validity_is_a_row_with_its_message(integrating):
    found = row(integrating, "direct load", "PIDA")
    assert not found.applies
    assert found.design is None
    assert "integrating" in found.reason
    for text in (str(integrating), integrating._repr_html_()):
        assert found.reason[:30] in text
        assert "keeps both limits" in text


def test_figure_names_every_stable_row(integrating):
    figure = integrating.plot()
    assert len(figure.axes[0].get_yticks()) == sum(one.applies for one in integrating.rows)


def test_rows_are_measured_on_the_process_itself(monkeypatch):
    monkeypatch.setattr(candidates, "_best", lambda *_: iter(()))
    process = pidalab.lags(3, delay=1.0)
    table = pidalab.compare(process, sample_time=0.05)
    found = row(table, "simc", "PI")
    loop = classical.simc(process, "PI").loop(process)
    margins, load = pidalab.margins(loop), pidalab.load_response(loop, np.linspace(0, 200, 20001))
    setpoint = pidalab.step_response(loop, np.linspace(0, 200, 20001))
    assert (found.iae_load, found.iae_setpoint) == pytest.approx((load.iae(), setpoint.iae()), rel=1e-4)
    assert (found.ms, found.delay_margin) == pytest.approx((margins.ms, margins.dm))
    assert found.noise_gain == pytest.approx(pidalab.noise_gain(loop, 0.05))
    assert found.tv == pytest.approx(load.tv("u"), rel=1e-3)
    # a filter faster than the sample is judged as a PLC runs it, and that is said; with its output filter, too
    assert "backward" in row(table, "itae setpoint", "PIDA").reason
    filtered = row(table, "haalman", "PIDA")
    assert "backward" in filtered.reason
    digital = pidalab.Loop(process, filtered.design.discretise(0.05))
    assert filtered.noise_gain == pytest.approx(pidalab.noise_gain(digital, 0.05))


def test_reaction_curve_of_two_equal_lags():
    """1/(s + 1)^2: the tangent at t = 1 has the slope 1/e and meets the level of rest at 3 - e."""
    model = candidates._Models(pidalab.lags(2, delay=0.5)).reaction
    reached = 2.146193  # (1 + t) exp(-t) = 1/e
    assert model.delay == pytest.approx(0.5 + 3 - np.e, rel=1e-4)
    assert model.delay - 0.5 + 1 / -np.roots(model.den)[0] == pytest.approx(reached, rel=2e-3)


def test_an_integrator_with_a_lag_has_its_reaction_curve():
    """Its ramp meets the level of rest after lag and dead time."""
    models = candidates._Models(pidalab.Process([2.0], [0.3, 1.0, 0.0], 0.7))
    assert models.reaction is models.integrator
    assert models.reaction.delay == pytest.approx(1.0, rel=1e-3)
    assert models.reaction.num[0] / models.reaction.den[0] == pytest.approx(2.0, rel=1e-3)


@pytest.mark.parametrize("wrong", [{"ms": 1.0}, {"noise_gain": 0.0}, {"sample_time": -1.0}])
def test_limits_out_of_range(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        pidalab.compare(pidalab.lags(2), **wrong)


@pytest.mark.parametrize("lag", [0.01, 0.2, 1.0, 500.0])
def test_what_is_read_off_a_step_response_does_not_depend_on_the_dead_time(lag):
    """Two equal lags are steepest after one of them, with the slope 1/(e lag) at a height of 1 - 2/e."""
    model = candidates._Models(pidalab.lags(2, lag=lag, delay=1.0)).reaction
    delay = 1.0 + lag - (np.e - 2) * lag
    reached = 1.0 + lag * optimize.brentq(lambda x: (1 + x) * np.exp(-x) - np.exp(-1), 1.0, 4.0)
    assert model.delay == pytest.approx(delay, rel=1e-5)
    assert model.den[0] / model.den[1] == pytest.approx(reached - delay, rel=1e-5)


def test_a_step_response_that_jumps_beyond_its_reach_is_there_at_once():
    """With 80 % of the response in its jump there is no lag to read off."""
    with pytest.raises(ValueError, match="lag must be above 0"):
        _ = candidates._Models(pidalab.Process([0.8, 1.0], [1.0, 1.0])).reaction
