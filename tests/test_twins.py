"""The thermal twin gives the printed model; the measures of a step; every refusal."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pidalab
from pidalab import twins
from pidalab.identification import ipdt_tangent

T = 0.02 * np.arange(4000)


@pytest.mark.parametrize(
    "changes",
    [{}, {"velocity_gain": -0.3}, {"apparent_delay": 3.0}, {"rise": 15.0}, {"dip": 0.0}, {"lags": 1}, {"delay": 2.0},
     {"share": 1.0, "conduction": 2.0}],
    ids=str,
)  # fmt: skip
def test_identification_gives_the_printed_model(changes):
    model = ipdt_tangent(T, pidalab.open_loop_step(twins.thermal_plant(**changes).rising, T).y)
    assert model.num[0] == pytest.approx(changes.get("velocity_gain", 0.01), rel=1e-4)
    assert model.delay == pytest.approx(changes.get("apparent_delay", 5.56), rel=1e-4)


def test_twin_is_its_equations():
    """Heating and cooling of the documented differential equations by an ODE solver, for a lamp switched on and off."""
    plant = twins.thermal_plant(delay=0.0)
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
    lamp = np.where(T < 40.0, 50.0, 0.0)
    y = pidalab.simulate_sampled(pidalab.Loop(plant.rising, 0.0), T, 0.0, load=lamp, plant=plant).y
    assert y[2000] == pytest.approx(on.y[-1, -1], abs=1e-6)
    np.testing.assert_allclose(y[2000:], off.sol(T[2000:] - 40.0)[-1], atol=1e-6)
    assert y[:2000].min() < -0.2  # it first moves the wrong way
    assert y[2000:].max() > y[2000] + 0.2


def test_printed_settings_are_stable_on_the_twin_and_not_on_the_model():
    """huba2018, Figs 5 to 7: PID_4^2 and PID_6^4 tuned for a dead time of 5 s, which the twin has as lags."""
    twin, model = twins.thermal_plant(), pidalab.ipdt(0.01, 5.0)
    for m, n, te in ((2, 4, 0.2), (4, 6, 0.8)):
        design = pidalab.rules.mrdp.tune(model, m, n, te)
        assert pidalab.unstable_poles(design.loop()) > 30
        assert pidalab.is_stable(design.loop(twin.rising))
        assert pidalab.is_stable(design.loop(twin.falling))


def test_experiment_is_the_documented_sequence():
    design = pidalab.rules.mrdp.tune(pidalab.ipdt(0.01, 5.0), 4, 6, 0.8)
    r = twins.thermal_experiment(
        design.loop(), twins.thermal_plant(), level=8.0, step=3.0, hold=150.0, sample_time=0.05
    )
    assert (r.t.size, r.step) == (9000, pytest.approx(0.05))
    assert r.r[[0, 2999, 3000, 5999, 6000, -1]].tolist() == [8.0, 8.0, 11.0, 11.0, 8.0, 8.0]
    assert (r.u.min(), r.u.max()) == twins.LAMP
    with pytest.raises(ValueError, match="sample_time must be above 0"):
        twins.thermal_experiment(design.loop(), twins.thermal_plant(), sample_time=0.0)
    with pytest.raises(ValueError, match="hold must be above 0"):
        twins.thermal_experiment(design.loop(), twins.thermal_plant(), hold=-1.0)


def test_windup_is_larger_downwards_because_cooling_is_slower():
    """huba2018, Fig. 7, around the middle of the lamp's range, so that both directions have the same reserve."""
    loop = pidalab.rules.mrdp.tune(pidalab.ipdt(0.01, 5.0), 4, 6, 0.8).loop()
    for fall, larger in ((30.0, 1.0), (60.0, 1.5)):
        run = twins.thermal_experiment(loop, twins.thermal_plant(fall=fall), level=18.0)
        up, down = (run.saturated(twins.LAMP, start, start + 200.0) for start in (200.0, 400.0))
        assert (down > larger * up) == (fall == 60.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"velocity_gain": 0.0}, "velocity_gain must not be 0"),
        ({"apparent_delay": 0.0}, "apparent_delay must be above 0"),
        ({"rise": -1.0}, "rise must be above 0"),
        ({"fall": 0.0}, "fall must be above 0"),
        ({"conduction": 0.0}, "conduction must be above 0"),
        ({"share": 1.1}, r"share must be from 0 to 1, found 1\.1"),
        ({"dip": 1.0}, "dip must be from 0 to below 1, found 1"),
        ({"lags": 0}, "lags must be a whole number, at least 1"),
        ({"delay": -0.1}, "delay must be at least 0"),
        (
            {"delay": 6.0},
            "apparent_delay = 5.56 is exceeded without any lag, through the dead time 6 and the dip 0.05",
        ),
    ],
    ids=str,
)
def test_thermal_plant_complains(changes, message):
    with pytest.raises(ValueError, match=message):
        twins.thermal_plant(**changes)
