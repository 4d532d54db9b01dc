"""Check the thermal twin of huba2018's pages, the experiments on it and the imitated solver."""

import numpy as np
import pytest
from papers import huba2018 as setup
from scipy.integrate import solve_ivp

import pidalab
from pidalab.identification import ipdt_tangent

T = 0.02 * np.arange(4000)


@pytest.mark.parametrize(
    "changes",
    [{}, {"rise": 15.0}, {"dip": 0.0}, {"lags": 1}, {"delay": 2.0}, {"share": 1.0, "conduction": 2.0}],
    ids=str,
)
def test_identification_gives_the_printed_model(changes):
    model = ipdt_tangent(T, pidalab.open_loop_step(setup.thermal_plant(**changes).rising, T).y)
    assert model.num[0] == pytest.approx(0.01, rel=1e-4)
    assert model.delay == pytest.approx(5.56, rel=1e-4)


def test_twin_matches_its_equations():
    """Compare heating and cooling with the documented differential equations, solved by an ODE solver."""
    plant = setup.thermal_plant(delay=0.0)
    gain, lag = -plant.direct.num[0][0][0] / 0.05, plant.direct.den[0][0][0] ** (1 / 3)

    def slope(s, x, w):
        body, conducted, *chain = x
        read = gain * (0.7 * body + 0.3 * conducted - 0.05 * w)
        first = [(w - body) / (30.0 if w > body else 60.0), (body - conducted) / 200.0]
        return [
            *first,
            *((before - after) / lag for before, after in zip([read, *chain[:2]], chain, strict=True)),
        ]

    on = solve_ivp(slope, (0.0, 40.0), np.zeros(5), rtol=1e-9, atol=1e-11, args=(50.0,))
    off = solve_ivp(slope, (0.0, 40.0), on.y[:, -1], rtol=1e-9, atol=1e-11, args=(0.0,), dense_output=True)
    assert on.success
    assert off.success
    lamp = np.where(T < 40.0, 50.0, 0.0)
    y = pidalab.simulate_sampled(pidalab.Loop(plant.rising, 0.0), T, 0.0, load=lamp, plant=plant).y
    assert y[2000] == pytest.approx(on.y[-1, -1], abs=1e-6)
    np.testing.assert_allclose(y[2000:], off.sol(T[2000:] - 40.0)[-1], atol=1e-6)
    assert y[:2000].min() < -0.2  # the output first moves in the wrong direction
    assert y[2000:].max() > y[2000] + 0.2


def test_printed_settings_are_stable_on_the_twin_and_not_on_the_model():
    """In Figs 5 to 7, PID_4^2 and PID_6^4 are tuned for a dead time of 5 s. The twin has lags instead."""
    twin = setup.thermal_plant()
    for m, n, te in ((2, 4, 0.2), (4, 6, 0.8)):
        design = pidalab.rules.mrdp.tune(setup.THERMAL, m, n, te)
        assert pidalab.unstable_poles(design.loop()) > 30
        assert pidalab.is_stable(design.loop(twin.rising))
        assert pidalab.is_stable(design.loop(twin.falling))


def test_experiment_and_its_measures():
    design = pidalab.rules.mrdp.tune(setup.THERMAL, 4, 6, 0.8)
    run = setup.experiment(design, setup.thermal_plant(), hold=150.0)
    assert (run.t.size, run.step) == (22_500, pytest.approx(0.02))
    assert run.r[[0, 7499, 7500, 14_999, 15_000, -1]].tolist() == [10.0, 10.0, 15.0, 15.0, 10.0, 10.0]
    assert (run.u.min(), run.u.max()) == setup.LAMP
    clamped = setup.experiment(design, setup.thermal_plant(), "clamping", hold=150.0)
    bare, kept = setup.measures(run, 150.0), setup.measures(clamped, 150.0)
    assert bare.loc["down", "overshoot, %"] > 10 * kept.loc["down", "overshoot, %"]
    cycling = pidalab.rules.mrdp.tune(pidalab.ipdt(0.01, 2.0), 2, 4, 0.2)
    measures = setup.measures(setup.experiment(cycling, setup.thermal_plant()))
    assert measures["overshoot, %"].isna().all()
    assert (measures["at a limit, s"] > 100).all()


@pytest.mark.parametrize("step", ["setpoint", "load"])
def test_imitated_solver_converges(step):
    """With short steps the solver converges to the exact engine. With its usual steps the errors are small."""
    design = pidalab.rules.mrdp.tune(setup.UNIT, 2, 4, 0.5)
    t = np.linspace(0, 10, 10_001)
    exact, errors = pidalab.simulate(design.loop(), t, **{step: 1.0}).y, []
    for rtol in (1e-3, 1e-8):
        times, y = setup.ode45(design, **{step: 1.0}, end=10.0, rtol=rtol, atol=1e-3 * rtol)
        errors.append(np.abs(y - np.interp(times, t, exact)).max())
        assert times[-1] == pytest.approx(10.0)
        assert np.diff(times).max() < 10.0 / 50 + 1e-9
    assert errors[1] < 1e-4 < errors[0] < 5e-3
