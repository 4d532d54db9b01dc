"""Fit models to records: the uncertainty covers the true parameters, and insufficient records are refused."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.signal import lfilter

import pidalab
from pidalab import Record
from pidalab.plant.fitting import fit
from pidalab.plant.fitting.searching import FIRST_ORDER, prepared, refined, search
from pidalab.plant.fitting.uncertainty import covariance

GRID = np.linspace(0.0, 300.0, 3001)
TRUE = pidalab.Process([2.3], np.poly([-1 / 20, -1 / 6, -1 / 3]) * 360, 8.0)
TRUE_STEP = pidalab.open_loop_step(TRUE, GRID).y


def historian(seed, noise=0.25, count=600):
    """Return a record of a valve that steps from 40 to 47 % at t = 37.

    It has irregular times with a gap, and a quantised noisy output with missing values.
    """
    rng = np.random.default_rng(seed)
    t = np.sort(rng.uniform(0.0, 260.0, count))
    y = 350.0 + 7.0 * np.interp(np.maximum(t - 37.0, 0.0), GRID, TRUE_STEP) + rng.normal(0.0, noise, count)
    y = np.round(y / 0.1) * 0.1
    y[rng.integers(0, count, 9)] = np.nan
    keep = (t < 120.0) | (t > 126.0)
    return Record(t[keep], np.where(t < 37.0, 40.0, 47.0)[keep], y[keep])


@pytest.mark.parametrize(
    ("model", "process"),
    [
        ("fopdt", pidalab.fopdt(-1.5, 12.0, 5.0)),
        ("sopdt", pidalab.sopdt(0.4, 9.0, 0.35, 2.0)),
        ("lags", pidalab.lags(4, 3.0, gain=2.0, delay=1.0)),
        ("ipdt", pidalab.ipdt(0.02, 7.0)),
        ("ifopdt", pidalab.Process([0.02], [9.0, 1.0, 0.0], 4.0)),
        ("sopdtz", pidalab.Process([-3.0, 0.5], [60.0, 16.0, 1.0], 2.0)),
    ],
)
def test_clean_records_return_their_model(model, process):
    t = np.arange(0.0, 150.0, 0.5)
    y = 20.0 + 4.0 * np.concatenate([np.zeros(40), pidalab.open_loop_step(process, t[:-40]).y])
    fitted = fit(Record(t, np.where(t < 20.0, 10.0, 14.0), y), model)
    w = np.array([0.01, 0.05, 0.1])
    assert np.allclose(fitted.process(1j * w), process(1j * w), rtol=1e-4)
    assert fitted.process.delay == pytest.approx(process.delay, abs=1e-3)
    assert fit(Record(t, np.where(t < 20.0, 10.0, 14.0), y)).model == model


def test_historian_record():
    fitted = fit(historian(0))
    assert fitted.parameters["gain"] == pytest.approx(2.3, rel=0.01)
    assert fitted.deviation < 1.2 * fitted.noise
    w = 0.05
    assert abs(fitted.process(1j * w) / TRUE(1j * w) - 1) < 0.05
    assert f"{fitted.model} is the simplest within 3 % of the least residual" in fitted.reason
    assert "lag" in str(fitted)


def test_truth_lies_within_two_deviations():
    """If the plant has the fitted structure, 95 % of the parameters lie within two standard deviations."""
    process, t = pidalab.fopdt(2.0, 12.0, 5.0), np.arange(0.0, 120.0)
    clean = np.concatenate([np.zeros(20), pidalab.open_loop_step(process, t[:-20]).y])
    inside = 0
    for seed in range(20):
        y = clean + np.random.default_rng(seed).normal(0.0, 0.1, t.size)
        fitted = fit(Record(t, np.where(t < 20, 0.0, 1.0), y), "fopdt")
        for name, true in (("gain", 2.0), ("lag", 12.0), ("delay", 5.0)):
            inside += abs(fitted.parameters[name] - true) < 2 * fitted.uncertainty[name]
    assert inside >= 50  # of 60 parameters; with uncertainties half as large it would be about 40


def test_spread_has_the_stated_deviation():
    fitted = fit(historian(1), "fopdt")
    gains = [plant.num[-1] / plant.den[-1] for plant in fitted.spread(200)]
    assert np.std(gains) == pytest.approx(fitted.uncertainty["gain"], rel=0.3)
    assert all(plant.delay >= 0 for plant in fitted.spread(200))


def test_spread_has_a_hidden_lag():
    """With noise, two lags look like one lag with a longer dead time, but give a larger Ms with a PID."""
    process, t = pidalab.Process([1.0], np.polymul([10.0, 1.0], [2.0, 1.0]), 3.0), np.arange(0.0, 100.0)
    clean = np.concatenate([np.zeros(20), pidalab.open_loop_step(process, t[:-20]).y])
    y = clean + np.random.default_rng(3).normal(0.0, 0.05, t.size)
    fitted = fit(Record(t, np.where(t < 20.0, 0.0, 1.0), y))
    plants = fitted.spread(30)
    assert fitted.model == "fopdt"
    assert {len(plant.den) - 1 for plant in plants} == {1, 2}
    design = pidalab.tune(fitted.process, "PID", ms=1.6, sample_time=0.2)
    true = pidalab.margins(design.loop(process)).ms
    own, hidden = (
        max(pidalab.margins(design.loop(plant)).ms for plant in plants if len(plant.den) - 1 == order)
        for order in (1, 2)
    )
    assert own < hidden
    assert true < hidden


def test_plants_have_other_gains():
    fitted = fit(historian(0))
    first, *plants = fitted.plants()
    ratios = [plant.gain() / drawn.gain() for plant, drawn in zip(plants, fitted.spread(), strict=True)]
    assert first == fitted.process
    assert set(np.round(ratios, 9)) == {0.85, 1.15}
    assert ratios.count(max(ratios)) > 10


def test_spread_has_the_hidden_part_of_the_dead_time():
    """The step is half-way between two samples. Without noise, only its time within the sample is uncertain."""
    process, t = pidalab.fopdt(2.0, 12.0, 5.0), np.arange(0.0, 120.0, 2.0)
    y = np.interp(t - 19.0, GRID, pidalab.open_loop_step(process, GRID).y, left=0.0)
    fitted = fit(Record(t, np.where(t < 19.0, 0.0, 1.0), y), "fopdt")
    delays = [plant.delay for plant in fitted.spread(40)]
    assert fitted.process.delay == pytest.approx(4.0, abs=0.01)
    assert min(delays) == pytest.approx(4.0, abs=0.3)
    assert max(delays) == pytest.approx(6.0, abs=0.3)


def test_set_point_change_in_closed_loop():
    process = pidalab.fopdt(2.0, 10.0, 4.0)
    t = np.arange(0.0, 300.0, 0.5)
    run = pidalab.simulate_sampled(
        pidalab.Loop(process, pidalab.PIDA(0.6, 10.0)), t, setpoint=np.where(t < 30, 0.0, 1.0),
        noise=pidalab.uniform_noise(t, 0.01, seed=3),
    )  # fmt: skip
    fitted = fit(Record(t, run.u, run.y + run.n), "fopdt")
    for name, true in (("gain", 2.0), ("lag", 10.0), ("delay", 4.0)):
        assert fitted.parameters[name] == pytest.approx(true, rel=0.05)


def test_refusals():
    with pytest.raises(ValueError, match="model must be 'fopdt', 'lags'"):
        fit(historian(0), "arx")
    with pytest.raises(TypeError, match="must be a pidalab"):
        fit(GRID)


@pytest.mark.parametrize("ratio", [2.9, 3.1])
def test_answer_must_exceed_three_times_the_residuals(ratio):
    """The residual alternates, so no model can follow it."""
    t = np.arange(200.0)
    y = np.where(t < 50, 0.0, -np.expm1(-(t - 50) / 10)) + (-1) ** t / ratio
    record = Record(t, np.where(t < 50, 0.0, 1.0), y)
    if ratio > 3:
        assert fit(record, "fopdt").deviation == pytest.approx(1 / ratio, rel=0.01)
    else:
        with pytest.raises(ValueError, match=r"response of 0.99 .* residuals of 0\.34"):
            fit(record, "fopdt")


def test_spread_of_equal_lags_has_unequal_ones():
    """Near the crossover, the true unequal lags have a higher gain than the fitted equal lags."""
    true = pidalab.Process([2.3], np.poly([-1 / 5, -1 / 14, -1 / 33]) * 5 * 14 * 33, 17.7)
    t = np.linspace(0.0, 390.0, 600)
    u = np.where(t < 60.0, 40.0, 47.0)
    y = 7 * np.interp(t - 60.0, t, pidalab.open_loop_step(true, t).y, left=0.0)
    found = fit(Record(t, u, y + np.random.default_rng(1).normal(0.0, 0.16, t.size)), "lags")
    w = np.geomspace(0.04, 0.07, 9)
    ratios = [np.abs(plant(1j * w) / found.process(1j * w)) for plant in found.spread(20)]
    actual = np.abs(true(1j * w) / found.process(1j * w))
    assert np.all(actual > 1.0)
    assert np.all(np.max(ratios, axis=0) >= actual)


def test_fit_as_text():
    fitted, other = fit(historian(0), "fopdt"), fit(historian(0), "fopdt")
    assert fitted == fitted
    assert fitted != other
    assert len({fitted, other}) == 2
    with pytest.raises(AttributeError):
        fitted.model = "ipdt"
    said = str(fitted)
    for name, value in fitted.parameters.items():
        assert f"{name} = {value:.4g} ± {fitted.uncertainty[name]:.2g}" in said
    for value in (fitted.deviation, fitted.noise, fitted.model_error, fitted.nrmse):
        assert f"{value:.3g}" in said
    assert "fopdt was requested." in said
    assert fitted.deviation == pytest.approx(np.sqrt(np.mean(fitted.residuals**2)))
    assert fitted.nrmse == pytest.approx(1 - fitted.deviation / np.std(historian(0).y))


def test_uncertainty_in_closed_form():
    """The squared uncertainty is variance / sum of squared sensitivities, times the number of correlated samples."""
    fitted = fit(historian(2), "fopdt")
    found = fitted._found
    r, jacobian = found.residuals, found.jacobian
    correlation = [float(r[k:] @ r[: r.size - k]) / float(r @ r) for k in range(r.size)]
    end = next(k for k, value in enumerate(correlation) if value <= 0)
    together = 1 + 2 * sum(correlation[1:end])
    variance = float(r @ r) / (r.size - jacobian.shape[1])
    expected = variance * together * np.linalg.inv(jacobian.T @ jacobian)
    np.testing.assert_allclose(covariance(found), expected, rtol=1e-6, atol=1e-12)
    assert list(fitted.uncertainty) == ["gain", "lag", "delay"]
    sigma = np.sqrt(np.diag(expected))[[0, 2, 3]]
    assert list(fitted.uncertainty.values()) == pytest.approx(list(sigma), rel=1e-6)


@pytest.mark.parametrize(("changes", "grid"), [(60, 0.0), (61, 0.5)])
def test_many_input_changes_are_moved_to_a_grid(changes, grid):
    t = 0.5 * np.arange(300)
    u = np.where(np.arange(300) < 20, 0.0, np.minimum(np.arange(300) - 19.0, changes))
    process = pidalab.fopdt(2.0, 5.0, 1.25)
    y = pidalab.simulate(pidalab.Loop(process, 0.0), t, load=u).y
    data = prepared(Record(t, u, 3.0 + y))
    assert data.grid == grid
    assert data.unseen == (0.0 if grid else 0.5)
    np.testing.assert_allclose(2.0 * data.simulated(FIRST_ORDER, [5.0], 1.25), y, atol=1e-9)


def test_prepared_records():
    """Each change of the input is followed. A long record is averaged."""
    t = np.sort(np.random.default_rng(0).uniform(0.0, 100.0, 200))
    data = prepared(Record(t, np.select([t < 20, t < 50], [1.0, 4.0], 2.5), np.minimum(t, 80.0)))
    first, second = int(np.argmax(t >= 20)), int(np.argmax(t >= 50))
    assert data.change_times.tolist() == [t[first], t[second]]
    assert data.changes.tolist() == [3.0, -1.5]
    assert data.unseen == pytest.approx((t[first] - t[first - 1] + t[second] - t[second - 1]) / 2)
    t = 0.01 * np.arange(8001)
    y = np.minimum(np.maximum(t - 20.0, 0.0), 30.0)
    data = prepared(Record(t, np.where(t < 20, 0.0, 1.0), y))
    assert (data.t.size, data.change_times.tolist()) == (4000, [20.0])
    assert np.all(np.abs(data.y - np.interp(data.t, t, y)) < 1e-2)


def test_search_is_as_good_as_all_starts():
    """The problem has several minima. The search starts from the best point in each third of a grid."""
    t = np.arange(0.0, 150.0, 0.5)
    clean = pidalab.open_loop_step(pidalab.lags(6, 3.0, delay=20.0), t[:-40]).y
    y = np.append(np.zeros(40), clean) + np.random.default_rng(0).normal(0.0, 0.01, t.size)
    data = prepared(Record(t, np.where(t < 20.0, 0.0, 1.0), y))
    span = 130.0
    ends = [
        refined(data, FIRST_ORDER, [lag, delay], span).cost
        for lag in span * np.geomspace(0.01, 0.5, 5)
        for delay in span * np.array([0.0, 0.01, 0.03, 0.08, 0.2, 0.35])
    ]
    assert max(ends) > 1.01 * min(ends)
    assert search(data, FIRST_ORDER).cost == pytest.approx(min(ends), rel=1e-6)


T = np.arange(200.0)
U = np.where(T < 40, 0.0, 1.0)
NOISE = np.random.default_rng(0).normal(0.0, 0.05, 200)


def rise(at=40.0, gain=2.0, lag=12.0, delay=5.0):
    return gain * -np.expm1(-np.maximum(T - at - delay, 0.0) / lag)


@pytest.mark.parametrize(
    ("u", "y", "said"),
    [
        (U, 20 + 0.01 * T + NOISE, "not clearly above noise and a drift in time"),
        (U, 20 - 3 * np.exp(-T / 150) + NOISE, "not clearly above noise and a drift in time"),
        (U, np.where(T == 90, -9999.0, rise() + NOISE), r"sample 90 \(y = -9999\).* outliers='drop'"),
        (-0.5 * rise() + 0.001 * NOISE, rise(), "it follows the output"),
    ],
)
def test_uninformative_records_are_refused(u, y, said):
    with pytest.raises(ValueError, match=said):
        fit(Record(T, u, y))


def test_short_record_does_not_identify_parameters():
    early = T < 75
    record = Record(T[early], U[early], (rise(lag=60.0) + NOISE)[early])
    with pytest.raises(ValueError, match=r"does not determine the .* ± "):
        fit(record, "sopdt")


@pytest.mark.parametrize(("model", "lag"), [("fopdt", 12.0), ("sopdt", 6.0)])
def test_initial_state_is_fitted(model, lag):
    process = pidalab.fopdt(2.0, 12.0, 5.0) if model == "fopdt" else pidalab.lags(2, 6.0, 2.0, 5.0)
    y = np.append(np.zeros(40), pidalab.open_loop_step(process, T[:160]).y) + NOISE
    found = fit(Record(T, U, y - 8 * (1 + T / lag * (model == "sopdt")) * np.exp(-T / lag)), model)
    assert found.parameters["gain"] == pytest.approx(2.0, rel=0.05)
    assert found.parameters["delay"] == pytest.approx(5.0, abs=1.0)
    assert "the record does not begin at rest: an initial state was fitted as well" in found.doubts


def test_noise_and_model_error():
    """A single lag is fitted to two lags with noise of 0.005. The doubts name the model error."""
    process = pidalab.Process([2.0], np.polymul([20.0, 1.0], [8.0, 1.0]))
    y = np.append(np.zeros(40), pidalab.open_loop_step(process, T[:160]).y) + 0.1 * NOISE
    single, double = (fit(Record(T, U, y), model) for model in ("fopdt", "sopdt"))
    assert single.noise == pytest.approx(0.005, rel=0.3)
    assert single.model_error > 2 * single.noise > 4 * double.model_error
    assert any("the model error is" in doubt for doubt in single.doubts)
    assert double.doubts == ()


def test_holdout():
    u = U - 2 * (T >= 80) + (T >= 120)
    y = rise() - 2 * rise(80.0) + rise(120.0) + NOISE
    assert fit(Record(T, u, y), "fopdt").holdout > 0.85
    assert fit(Record(T, 0.01 * u, y), "fopdt").holdout > 0.85
    assert np.isnan(fit(Record(T, U, rise() + NOISE), "fopdt").holdout)
    slight = U + 0.04 * (T >= 150)  # too small to count as a change
    assert np.isnan(fit(Record(T, slight, rise(lag=60.0) + 0.1 * NOISE), "fopdt").holdout)
    assert fit(Record(T, u, y + 0.5 * rise(120.0)), "fopdt").holdout < 0.8


def test_spread_is_about_as_likely_as_the_model():
    """Errors of time constant, damping and dead time are correlated, so the parameters are drawn jointly."""
    process = pidalab.Process([2.0], np.polymul([40.0, 1.0], [3.0, 1.0]))
    y = np.append(np.zeros(40), pidalab.open_loop_step(process, T[:160]).y) + NOISE
    found = fit(Record(T, U, y), "sopdt")
    assert found.plants(21)[0] is found.process
    assert len(found.plants(21)) == 21
    plants = [found.process, *found.spread(20)]
    squares = [np.sum((y - pidalab.simulate(pidalab.Loop(plant, 0.0), T, load=U).y) ** 2) for plant in plants]
    assert max(squares) < 1.35 * squares[0]


def test_plot_has_a_band_of_twice_the_noise():
    found = fit(historian(1))
    ax = Figure().subplots()
    found.plot(ax)
    below = ax.lines[2].get_ydata() - found.residuals
    band = ax.patches[0].get_path().get_extents(ax.patches[0].get_patch_transform())
    assert np.ptp(below) == pytest.approx(0.0, abs=1e-9)
    assert (band.y0, band.y1) == pytest.approx((below[0] - 2 * found.noise, below[0] + 2 * found.noise))


def test_explained_share_is_of_the_variance():
    """A fit must explain half of the variance, for any kind of experiment."""
    t = np.arange(2000.0)
    u = np.where((t // 100) % 2 == 0, 0.0, 1.0)
    decay = np.exp(-1 / 10.0)
    # A lag of ten samples follows a dead time.
    clean = np.interp(t - 3.0, t, lfilter([1 - decay], [1, -decay], u))
    noise = np.random.default_rng(0).normal(0.0, 1.0, t.size)
    noise /= noise.std()
    quiet, loud = (clean + share * clean.std() * noise for share in (0.3, 1.3))
    assert fit(Record(t, u, quiet), "fopdt").nrmse == pytest.approx(1 - 0.3 / np.sqrt(1 + 0.3**2), abs=0.02)
    with pytest.raises(ValueError, match=r"explains (36|37|38) % of the variance|not clearly above"):
        fit(Record(t, u, loud), "fopdt")
