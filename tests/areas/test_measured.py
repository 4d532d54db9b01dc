"""Compare areas from records with areas of the model: steps, other inputs, closed loops, noise and short records."""

import numpy as np
import pytest

import pidalab
from pidalab import areas
from pidalab.areas import RecordWarning

G1, G2 = pidalab.lags(4), pidalab.lags(2, delay=0.5)


def step_record(process, horizon=50.0, h=0.01):
    t = h * np.arange(round(horizon / h) + 1)
    return t, np.ones_like(t), pidalab.open_loop_step(process, t).y


def driven(process, t, u):
    """Return the exact response to a held input."""
    return pidalab.simulate(pidalab.Loop(process, 0.0), t, load=u).y


@pytest.mark.parametrize("process", [G1, G2, pidalab.sopdt(-3.0, 0.5, 0.6, 1.0)])
@pytest.mark.parametrize("h", [0.01, 0.05])
def test_step(process, h):
    """A coarse record is as good as a fine one, since the output starts smoothly. The errors are rounding of y."""
    measured = areas.from_record(*step_record(process, h=h), 10, start=(0.0, 0.0))
    assert measured.values == pytest.approx(areas.from_process(process, 10), rel=1e-5)
    assert measured.settled


def test_units_and_levels():
    t, _, y = step_record(G2)
    u = np.where(t < 4.0, 30.0, 26.0)
    y = 70.0 - 4.0 * 2.5 * np.concatenate([np.zeros(400), y[:-400]])
    measured = areas.from_record(60 * t, u, y, 6)
    assert measured.values == pytest.approx(2.5 * areas.from_process(G2, 6) * 60.0 ** np.arange(6), rel=1e-8)
    assert (*measured.input_levels, *measured.output_levels) == pytest.approx((30, 26, 70, 60))
    assert measured.gain == pytest.approx(2.5)
    assert measured.span[0] == pytest.approx(240.0)


def test_any_change_of_a_held_input():
    t = 0.01 * np.arange(6001)
    u = np.select([t < 1, t < 3, t < 3.5, t < 8], [2.0, 5.0, -1.0, 4.0], 3.0)
    measured = areas.from_record(t, u, 7.0 + driven(G1, t, u - 2.0), 8)
    assert measured.values == pytest.approx(areas.from_process(G1, 8), rel=1e-5)


def test_record_of_a_closed_loop():
    """The set point changes under digital PID control. The areas are those of the process, not of the loop."""
    t = 0.02 * np.arange(6001)
    record = pidalab.simulate_sampled(pidalab.Loop(G1, pidalab.PIDA(kp=1.2, ti=3.0, td=0.9)), t, setpoint=2.0)
    measured = areas.from_record(t, record.u, record.y, 6, start=(0.0, 0.0))
    assert measured.values == pytest.approx(areas.from_process(G1, 6), rel=1e-5)


# Uncertainty.


@pytest.mark.parametrize("hold", [1, 5])
@pytest.mark.parametrize(("process", "horizon", "noise"), [(G1, 30, 1e-2), (G2, 20, 1e-3)])
@pytest.mark.filterwarnings("ignore::pidalab.areas.RecordWarning")
def test_uncertainty_matches_the_spread_of_many_records(process, horizon, noise, hold):
    """Compare the errors of 40 records with their uncertainty, for white noise and noise held for five samples."""
    t, u, y = step_record(process, horizon, h=0.02)
    rng, expected = np.random.default_rng(5), areas.from_process(process, 6)
    records = [
        areas.from_record(
            t, u, y + noise * np.repeat(rng.normal(size=t.size), hold)[: t.size], 6, start=(0.0, 0.0)
        )
        for _ in range(40)
    ]
    error = np.sqrt(np.mean([(r.values - expected) ** 2 for r in records], axis=0))
    claimed = np.median([r.uncertainty for r in records], axis=0)
    assert np.all(error < 2.5 * claimed)
    assert np.all(error > 0.1 * claimed)
    assert np.median([r.noise for r in records]) == pytest.approx(noise, rel=0.1)
    correlation = records[0].covariance / np.outer(records[0].uncertainty, records[0].uncertainty)
    assert np.linalg.eigvalsh(correlation).min() > 1e-9  # the errors of the areas are not fully correlated


@pytest.mark.parametrize("process", [G1, G2, pidalab.lags(3, delay=0.5)])
@pytest.mark.parametrize(("h", "noise"), [(0.2, 1e-3), (0.02, 1e-2)])
@pytest.mark.filterwarnings("ignore::pidalab.areas.RecordWarning")
def test_noise_does_not_hide_the_end_of_the_transient(process, h, noise):
    """Of 20 records, 90 % have errors within 2.5 uncertainties, and they are cut after the transient has ended."""
    t, u, y = step_record(process, 30.0, h)
    records = []
    for seed in range(20):
        noisy = y + noise * np.random.default_rng(seed).normal(size=t.size)
        records.append(areas.from_record(t, u, noisy, 10, start=(0.0, 0.0)))
    expected = areas.from_process(process, 10)
    worst = [np.max(np.abs(r.values - expected) / r.uncertainty) for r in records]
    assert np.all([r.settled for r in records])
    assert np.quantile(worst, 0.9) < 2.5
    assert 1 - np.interp(np.median([r.span[1] for r in records]), t, y) < noise


@pytest.mark.parametrize("step", [0.001, 0.01])
@pytest.mark.parametrize("noise", [0.0, 0.2, 0.6])
@pytest.mark.filterwarnings("ignore::pidalab.areas.RecordWarning")
def test_uncertainty_covers_quantisation(step, noise):
    """Quantisation hides a tail below half a quantum, so the record looks noise-free."""
    t, u, y = step_record(G1, 50.0, 0.02)
    y = step * np.round(y / step + noise * np.random.default_rng(0).normal(size=t.size))
    measured = areas.from_record(t, u, y, 6, start=(0.0, 0.0))
    assert np.all(np.abs(measured.values - areas.from_process(G1, 6)) < 2.5 * measured.uncertainty)
    assert measured.uncertainty[1] < 30 * step


def test_a_short_record_warns():
    with pytest.warns(RecordWarning, match="still drifts at its end"):
        measured = areas.from_record(*step_record(G1, 8.0), 4, start=(0.0, 0.0))
    error = np.abs(measured.values - areas.from_process(G1, 4))
    assert not measured.settled
    assert np.all(error < 3 * measured.uncertainty)


def test_a_record_gives_the_areas_of_its_arrays():
    t = 0.02 * np.arange(3001)
    u = np.where(t < 4.0, 40.0, 45.0)
    y = 55.0 + driven(G2, t, u - 40.0)
    expected = areas.from_record(t, u, y, 6)
    assert areas.from_record(pidalab.Record(1000.0 + t, u, y), count=6).values == pytest.approx(
        expected.values, rel=1e-6
    )
    rng = np.random.default_rng(0)
    moved = np.sort(t + 0.009 * rng.uniform(-1.0, 1.0, t.size))
    messy = pidalab.Record(
        moved, np.where(moved < 4.0, 40.0, 45.0) + rng.uniform(-0.001, 0.001, t.size), np.interp(moved, t, y)
    )
    assert areas.from_record(messy, count=3).values == pytest.approx(expected.values[:3], rel=0.02)


# The levels, span and noise from which the uncertainty is computed.


def test_measured_areas_hold_levels_span_and_noise():
    t = 0.1 * np.arange(600)
    u = np.where(t < 2.0, 5.0, 7.0)
    y = 20.0 + driven(pidalab.lags(2), t, u - 5.0)
    y += np.resize([0.01, -0.01], 600)
    measured = areas.from_record(t, u, y, 2)
    assert measured.input_levels == (5.0, 7.0)
    assert measured.output_levels == pytest.approx((20.0, 22.0), abs=1e-3)
    assert measured.span[0] == 2.0
    assert measured.noise == pytest.approx(0.01, rel=1e-3)
