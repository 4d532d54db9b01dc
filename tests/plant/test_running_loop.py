"""Check running gains with simulated logs: Ms, loss against the best gains, suggested gains, refusals."""

import re

import numpy as np
import pytest
from scipy.signal import lfilter

import pidalab
from pidalab.plant.checking import check, explained_by
from pidalab.plant.fitting import fit

PLANT, RUNNING, H = pidalab.fopdt(2.0, 12.0, 4.0), pidalab.PIDA(kp=0.6, ti=12.0), 1.0
T = H * np.arange(200)
TRUE = pidalab.margins(pidalab.Loop(PLANT, RUNNING.discretise(H))).ms


def log(setpoint=0.0, load=0.0, noise=0.02, seed=0, slow=0.0):
    """Return the log of a running loop. A slow disturbance is a random walk that returns to 0."""
    rng = np.random.default_rng(seed)
    disturbed = rng.normal(0.0, noise, T.size)
    for k in range(1, T.size):
        disturbed[k] += slow * (disturbed[k - 1] - disturbed[k]) if slow else 0.0
    loop = pidalab.Loop(PLANT, RUNNING.discretise(H))
    run = pidalab.simulate_sampled(loop, T, setpoint, load=load, noise=disturbed)
    return pidalab.Record(T, 40 + run.u, 300 + run.y + disturbed)


def steps(*changes):
    return sum(size * (at <= T) for at, size in changes)


def bumped(noise=0.02):
    """Return a log with a pulse of u in manual mode."""
    u = steps((20, 1.0), (60, -1.0))
    y = pidalab.open_loop_step(PLANT, T).y
    shifted = (np.interp(T - at, T, y, left=0.0) for at in (20, 60))
    y = next(shifted) - next(shifted)
    return pidalab.Record(T, u, y + np.random.default_rng(1).normal(0, noise, T.size))


LOGS = {
    "two changes of the set point": lambda: log(setpoint=steps((20, 1.0), (110, -1.0))),
    "a step of the load": lambda: log(load=steps((20, 1.0))),
    "both": lambda: log(setpoint=steps((110, 1.0)), load=steps((20, 1.0))),
    "a bump of u by hand": bumped,
}


@pytest.mark.parametrize("kind", LOGS)
def test_interval_has_the_true_ms_and_is_narrow(kind):
    found = check(LOGS[kind](), RUNNING, sample_time=H)
    assert found.fit._data.loaded == (kind in ("a step of the load", "both"))
    low, high = found.interval
    assert low <= TRUE <= high < low + 0.4
    assert low <= found.ms <= high
    assert not any("slow" in doubt for doubt in found.doubts)


def test_timid_gains_get_three_safe_sets():
    timid = pidalab.PIDA(kp=0.3, ti=20.0)
    found = check(fit(log(setpoint=steps((20, 1.0))), "fopdt"), timid, sample_time=H)
    assert [row.rule for row in found.rows] == ["now", "best like it", "calmer", "same noise", "faster"]
    now, best, *sets = found.rows
    quiet = pidalab.noise_gain(found.design.loop(found.fit.process), H)
    assert best.iae < now.iae
    assert best.ms_sampled == pytest.approx(found.ms, rel=2e-3)
    assert best.relative_noise <= now.relative_noise * 1.001
    assert found.loss == pytest.approx(100 * (now.iae / best.iae - 1))
    for row, ms, share in zip(sets, (1.4, 1.6, 1.8), (0.5, 1.0, 2.0), strict=True):
        loop = row.design.loop(PLANT)
        assert row.ms_sampled <= ms * 1.001
        own = row.design.loop(found.fit.process)
        assert pidalab.relative_noise_gain(own) == pytest.approx(row.relative_noise)
        assert pidalab.noise_gain(loop, H) <= share * quiet * 1.02
        assert pidalab.margins(pidalab.Loop(PLANT, row.design.discretise(H))).ms <= 2.0
    said = str(found)
    assert f"{found.loss:.0f} % above that of the best PI" in said
    assert re.search(r"faster .* kp = \S+, ti = \S+, filter", said)


def test_optimal_gains_have_no_loss(monkeypatch):
    monkeypatch.setattr("pidalab.plant.checking.SETS", {})  # each set takes seconds and is not tested here
    fitted = fit(log(setpoint=steps((20, 1.0))), "fopdt")
    design = pidalab.tune(fitted.process, "PI", ms=1.5, noise_gain=0.5, sample_time=H)
    assert abs(check(fitted, design.controller, sample_time=H).loss) < 0.2


@pytest.mark.parametrize("record", [lambda: log(), lambda: log(load=0.02 * steps((20, 1.0)))])
def test_uninformative_log_is_refused(record):
    with pytest.raises(ValueError, match="needs a change of the set point"):
        check(record(), RUNNING)


def test_gains_of_the_wrong_sign_are_refused():
    with pytest.raises(ValueError, match=r"found kp = -0\.6 for a plant of gain 2"):
        check(fit(bumped(), "fopdt"), -1 * RUNNING)


def test_unsuitable_controllers_are_refused():
    with pytest.raises(ValueError, match="integral action"):
        check(bumped(), pidalab.PIDA(kp=0.6, ti=np.inf))
    with pytest.raises(TypeError, match="DigitalController"):
        check(bumped(), RUNNING.discretise(1.0))
    with pytest.raises(ValueError, match="ms_worst must be above 1"):
        check(fit(bumped(), "fopdt"), RUNNING, ms_worst=1.0)


def test_unstable_gains_are_doubted_and_safe_ones_given(monkeypatch):
    monkeypatch.setattr("pidalab.plant.checking.SETS", {"calmer": (1.4, 0.5), "faster": (1.8, 2.0)})
    found = check(fit(bumped(), "fopdt"), 10 * RUNNING, sample_time=H)
    assert found.ms == np.inf
    assert any("the controller of the log must have had other gains" in doubt for doubt in found.doubts)
    assert np.isnan(found.loss)
    for row in found.rows[1:]:
        assert row.design.ms_worst <= 2.001  # over the plants that tune draws
        assert pidalab.margins(pidalab.Loop(PLANT, row.design.discretise(H))).ms <= 2.0


@pytest.mark.parametrize(("share", "doubted"), [(1.0, False), (4.0, True), (0.2, True)])
def test_gains_that_did_not_make_the_log(share, doubted):
    given = pidalab.PIDA(kp=share * RUNNING.kp, ti=RUNNING.ti)
    explained, gain = explained_by(given, None, log(setpoint=steps((20, 1.0))))
    assert (explained < 0.8) is doubted
    assert gain == pytest.approx(RUNNING.kp, rel=0.3)
    assert np.isnan(explained_by(given, None, bumped())[0])  # in open loop the controller explains nothing


def random_log(seed):
    """Log a random first-order plant under a PI, with noise and steps of the set point, the load or both.

    A third of the logs has white noise, a third has partly slow noise, and a third also has a wandering load.
    """
    rng = np.random.default_rng([62, seed])
    n = int(rng.integers(200, 600))
    t = np.arange(float(n))
    lag = rng.uniform(6, 25)
    delay, gain = rng.uniform(0.1, 1.0) * lag, rng.choice([-1, 1]) * 10 ** rng.uniform(-1, 1)
    kp = rng.uniform(0.3, 0.6) * lag / (gain * delay) if delay > 1 else 0.4 * lag / gain / delay
    running = pidalab.PIDA(kp=np.sign(kp) * min(abs(kp), 5 / abs(gain)), ti=min(lag, 8 * delay))
    loop = pidalab.Loop(pidalab.fopdt(gain, lag, delay), running.discretise(1.0))
    size, steps, disturbance = rng.uniform(0.5, 2.0), seed % 3, seed // 3 % 3
    setpoint = np.where(t >= rng.integers(20, 60), size, 0.0)
    if rng.random() < 0.5:
        setpoint = setpoint - np.where(t >= rng.integers(n // 2, n - 60), size, 0.0)
    load, setpoint = np.zeros(n), setpoint * (steps != 1)
    if steps:
        load = np.where(t >= rng.integers(20, n // 2), size / abs(gain) * rng.choice([-1, 1]), 0.0)
    noise = rng.normal(0, rng.uniform(0.01, 0.06) * size, n)
    slow = rng.uniform(0.5, 0.95) if disturbance == 1 else 0.0
    if disturbance == 2:
        memory = rng.uniform(0.9, 1.0)
        wander = rng.normal(0, rng.uniform(0.01, 0.06) * size / abs(gain), n)
        load = load + lfilter([1.0], [1.0, -memory], wander)
    drift = rng.normal(0, rng.uniform(0.01, 0.06) * size, n) * np.sqrt(1 - slow**2)
    drift = lfilter([1.0], [1.0, -slow], drift)
    noise = noise + drift * (disturbance == 1)
    run = pidalab.simulate_sampled(loop, t, setpoint, load=load, noise=noise)
    return pidalab.Record(t, 40 + run.u, 300 + run.y + noise), {"gain": gain, "lag": lag, "delay": delay}


def test_intervals_of_closed_loops_contain_the_plant():
    """At least 90 % of the parameters lie within 1.96 standard uncertainties."""
    inside = []
    for seed in range(12):
        record, true = random_log(seed)
        fitted = fit(record, "fopdt", load=seed % 3 > 0)
        inside += [abs(fitted.parameters[x] - true[x]) < 1.96 * fitted.uncertainty[x] for x in true]
    assert np.mean(inside) >= 0.9


def test_slow_disturbances_widen_intervals():
    found = fit(log(setpoint=steps((20, 1.0), (150, -1.0)), noise=0.1, slow=0.9, seed=3), "fopdt")
    assert any("closed loop" in doubt for doubt in found.doubts)
    assert abs(found.parameters["gain"] - 2.0) < 1.96 * found.uncertainty["gain"]


def test_fed_back_disturbances_are_doubted():
    found = check(log(setpoint=steps((20, 0.5)), noise=0.25, slow=0.9), RUNNING, sample_time=H)
    assert any("slow disturbances cause about 14 %" in doubt for doubt in found.doubts)
    assert not found.fit._data.loaded
