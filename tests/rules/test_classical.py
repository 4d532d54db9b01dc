"""SIMC, AMIGO, lambda tuning and Ziegler-Nichols: published examples, closed forms, what is refused."""

import math
from functools import partial, reduce

import numpy as np
import pytest

import pidalab
from pidalab.rules import classical
from pidalab.rules.classical import simc


def test_simc_of_two_lags_is_the_published_example():
    """1/((s+1)(0.2s+1)), the first example of Skogestad (2003): kc = 5.5 and tau_I = 0.8 for PI."""
    process = pidalab.Process([1.0], np.convolve([1.0, 1.0], [0.2, 1.0]))
    design = classical.simc(process, kind="PI")
    assert (design.controller.kp, design.controller.ti) == pytest.approx((5.5, 0.8))
    assert design.lags == pytest.approx((1.1,))
    assert design.delay == pytest.approx(0.1)


def test_half_rule_of_many_lags_and_a_zero():
    """(-0.3s+1)(...)/((2s+1)(1s+1)(0.4s+1)(0.2s+1)(0.05s+1)^3): theta = 1.47 and 0.77 (Skogestad's example 2)."""
    den = np.ones(1)
    for time in (2.0, 1.0, 0.4, 0.2, 0.05, 0.05, 0.05):
        den = np.convolve(den, [time, 1.0])
    process = pidalab.Process([-0.3, 1.0], den)
    first, second = classical.simc(process, "PI"), classical.simc(process, "PID")
    assert first.lags == pytest.approx((2.5,), rel=1e-3)
    assert first.delay == pytest.approx(0.5 + 0.4 + 0.2 + 0.15 + 0.3, rel=1e-3)
    assert second.lags == pytest.approx((2.0, 1.2), rel=1e-3)
    assert second.delay == pytest.approx(0.2 + 0.2 + 0.15 + 0.3, rel=1e-3)


@pytest.mark.parametrize("kind", ["PI", "PID"])
def test_simc_cancels_and_has_its_known_margins(kind):
    """On its own model L = e^(-theta s)/(2 theta s): Ms = 1.59, gain margin pi, phase margin 61.4 degrees."""
    model = pidalab.Process([2.0], np.convolve([5.0, 1.0], [1.5, 1.0] if kind == "PID" else [1.0]), delay=1.0)
    design = classical.simc(model, kind, n=1e4)
    margins = pidalab.margins(design.loop())
    assert margins.gm == pytest.approx(math.pi, rel=2e-3)
    assert margins.pm == pytest.approx(61.35, abs=0.1)
    assert margins.ms == pytest.approx(1.590, rel=2e-3)


def test_amigo_pi_keeps_ms_near_its_target():
    for lag in (0.1, 0.5, 2.0, 10.0, 100.0):
        ms = pidalab.margins(classical.amigo(pidalab.fopdt(3.0, lag, 1.0), "PI").loop()).ms
        assert 1.2 < ms < 1.65
    ms = pidalab.margins(classical.amigo(pidalab.ipdt(0.2, 2.0), "PI").loop()).ms
    assert 1.3 < ms < 1.5


def test_lambda_tuning_gives_the_closed_loop_asked_for():
    """The lag cancels, L = e^(-Ls)/((lambda + L)s): a first-order response but for the dead time's rest."""
    design = classical.lambda_tuning(pidalab.fopdt(2.0, 3.0, 0.01), closed_loop_time=1.0)
    response = pidalab.step_response(design.loop(), np.linspace(0.0, 10.0, 1001))
    assert np.allclose(response.y, 1 - np.exp(-np.maximum(response.t - 0.01, 0)), atol=0.01)


def test_the_batch_has_134_processes():
    from pidalab.comparison.plants import batch

    cases = list(batch())
    assert len(cases) == len({case.name for case in cases}) == 134
    assert all(case.process.num[-1] > 0 for case in cases)


@pytest.mark.parametrize("gain", [1.0, -0.25])
def test_ultimate_rule_of_an_integrator_with_dead_time(gain):
    """Under a gain K it oscillates at pi/(2 L) with K k L = pi/2."""
    design = classical.ziegler_nichols_ultimate(pidalab.ipdt(gain, delay=2.0), "PI")
    assert design.ultimate_gain == pytest.approx(np.pi / 4 / gain)
    assert design.ultimate_period == pytest.approx(8.0)
    assert design.controller.kp == pytest.approx(0.45 * np.pi / 4 / gain)


def test_ultimate_rule_of_an_integrator_with_lags():
    """Of 1/(s (s + 1)(s + 2)) Routh has the border at K = 6, where it oscillates at the root of 2."""
    design = classical.ziegler_nichols_ultimate(pidalab.Process([1.0], [1.0, 3.0, 2.0, 0.0]))
    period = 2 * np.pi / np.sqrt(2)
    assert design.ultimate_gain == pytest.approx(6.0)
    assert design.ultimate_period == pytest.approx(period)
    found = design.controller
    assert (found.kp, found.ti, found.td) == pytest.approx((3.6, period / 2, period / 8))
    assert found.ta == 0


K, T, L = -2.0, 3.0, 0.5
LAG, INTEGRATOR = pidalab.fopdt(K, T, L), pidalab.ipdt(K, L)


@pytest.mark.parametrize(
    ("rule", "model", "kind", "expected"),
    [
        (classical.amigo, LAG, "PI", ((0.15 + (0.35 - 1.5 / 12.25) * 6) / K, 0.175 + 58.5 / (9 + 18 + 1.75), 0)),
        (classical.amigo, LAG, "PID", (2.9 / K, 0.5 * 2.6 / 0.8, 0.75 / 3.15)),
        (classical.amigo, INTEGRATOR, "PI", (0.35 / (K * L), 13.4 * L, 0)),
        (classical.amigo, INTEGRATOR, "PID", (0.45 / (K * L), 8 * L, L / 2)),
        (classical.ziegler_nichols_step, LAG, "PI", (0.9 * T / (K * L), L / 0.3, 0)),
        (classical.ziegler_nichols_step, LAG, "PID", (1.2 * T / (K * L), 2 * L, L / 2)),
        (classical.ziegler_nichols_step, INTEGRATOR, "PI", (0.9 / (K * L), L / 0.3, 0)),
        (classical.ziegler_nichols_step, INTEGRATOR, "PID", (1.2 / (K * L), 2 * L, L / 2)),
        (classical.simc, LAG, "PI", (T / (K * 2 * L), T, 0)),
        (classical.simc, LAG, "PID", (T / (K * 2 * L), T, 0)),  # there is no second lag
        (classical.simc, INTEGRATOR, "PID", (1 / (K * 2 * L), 8 * L, 0)),
        (classical.simc, pidalab.fopdt(K, 30.0, L), "PI", (30 / (K * 2 * L), 8 * L, 0)),
        (classical.simc, pidalab.Process([K], [5.0, 6.0, 1.0], L), "PID", (1.25 * 5 / (K * 2 * L), 5.0, 0.8)),
        (classical.lambda_tuning, LAG, "PI", (T / (K * (T + L)), T, 0)),
        (classical.lambda_tuning, LAG, "PID", (3.25 / (K * 3.25), 3.25, 0.75 / 3.25)),
    ],
)  # fmt: skip
def test_every_rule_beside_its_printed_formula(rule, model, kind, expected):
    found = rule(model, kind).controller
    assert (found.kp, found.ti, found.td, found.ta) == pytest.approx((*expected, 0.0), rel=1e-12)
    assert found.n == 10
    with pytest.raises(ValueError, match="kind must be 'PI' or 'PID', found 'P'"):
        rule(model, "P")


@pytest.mark.parametrize("kind", ["PI", "PID"])
def test_closed_loop_time_stands_beside_the_dead_time(kind):
    """Of an integrator with a lag, which the PID cancels and the PI adds to the dead time."""
    model = pidalab.Process([0.5], [3.0, 1.0, 0.0], delay=1.0)
    found = classical.simc(model, kind, closed_loop_time=0.25)
    rest = 1.0 if kind == "PID" else 1.0 + 3.0 / 2
    series = found.controller.gains().series()
    assert (found.delay, found.closed_loop_time) == pytest.approx((rest, 0.25))
    assert series.ti == pytest.approx(4 * (0.25 + rest))
    assert series.kp == pytest.approx(1 / (0.5 * (0.25 + rest)))
    assert classical.lambda_tuning(LAG).closed_loop_time == T


@pytest.mark.parametrize("kind", ["PI", "PID"])
def test_half_rule_needs_no_more_lags_than_there_are(kind):
    found = classical.simc(pidalab.Process([-0.2, 2.0], [4.0, 1.0], delay=0.3), kind)
    assert (found.lags, found.delay) == (pytest.approx((4.0,)), pytest.approx(0.4))
    assert found.controller.kp == pytest.approx(4.0 / (2.0 * 0.8))


# --- Chien, Hrones and Reswick ----------------------------------------------------------------------------------------

# Åström and Hägglund (1995), section 4.2: a kp, ti and td, L for 0.5 and T for 3
CHR_TABLE = {
    ("load", 0, "PI"): (0.6, 4 * 0.5, 0),
    ("load", 0, "PID"): (0.95, 2.4 * 0.5, 0.42 * 0.5),
    ("load", 20, "PI"): (0.7, 2.3 * 0.5, 0),
    ("load", 20, "PID"): (1.2, 2 * 0.5, 0.42 * 0.5),
    ("setpoint", 0, "PI"): (0.35, 1.2 * 3, 0),
    ("setpoint", 0, "PID"): (0.6, 3, 0.5 * 0.5),
    ("setpoint", 20, "PI"): (0.6, 3, 0),
    ("setpoint", 20, "PID"): (0.95, 1.4 * 3, 0.47 * 0.5),
}


@pytest.mark.parametrize(("test", "overshoot", "kind"), CHR_TABLE)
def test_chien_hrones_reswick_is_its_table(test, overshoot, kind):
    model = pidalab.fopdt(-2.0, lag=3.0, delay=0.5)
    C = classical.chien_hrones_reswick(model, test, overshoot, kind).controller
    a = -2.0 * 0.5 / 3.0
    assert (a * C.kp, C.ti, C.td) == pytest.approx(CHR_TABLE[test, overshoot, kind])


def chr_overshoot(test, overshoot, kind, lag):
    """Per cent of the step of the set point, or of the largest deviation after the load."""
    loop = classical.chien_hrones_reswick(pidalab.fopdt(1.0, lag, 1.0), test, overshoot, kind).loop()
    t = np.linspace(0.0, 40.0 + 8 * lag, 8001)
    if test == "setpoint":
        return pidalab.step_response(loop, t).overshoot()
    y = pidalab.load_response(loop, t).y
    return -100 * y.min() / y.max()


@pytest.mark.parametrize("lag", [4.0, 12.0, 50.0])
def test_what_chien_hrones_and_reswick_reach_on_their_model(lag):
    """As the docstring has it: 0 and 20 % are what the rules are called, and not what all of them reach."""
    for kind in ("PI", "PID"):
        assert chr_overshoot("setpoint", 0, kind, lag) < 2
    assert chr_overshoot("load", 0, "PI", lag) < 0.1
    assert chr_overshoot("load", 0, "PID", lag) < 9
    assert 9 < chr_overshoot("load", 20, "PI", lag) < 40
    assert 5 < chr_overshoot("load", 20, "PID", lag) < 11
    assert 27 < chr_overshoot("setpoint", 20, "PID", lag) < 39
    for kind, test in ((k, t) for k in ("PI", "PID") for t in ("load", "setpoint")):
        assert chr_overshoot(test, 0, kind, lag) < chr_overshoot(test, 20, kind, lag)


def test_the_pi_for_set_points_overshoots_by_a_closed_form():
    """It cancels the lag: y' = 0.6 (1 - y(t - 1)), cubic where y(t - 1) is 1 and y largest."""
    v = (0.6 - np.sqrt(0.6**2 - 4 * 0.18 * 0.4)) / (2 * 0.18)  # 0.6 + 0.6 v - 0.18 v^2 = 1
    peak = 1.02 + 0.6 * (0.4 * v - 0.3 * v**2 + 0.06 * v**3)
    assert chr_overshoot("setpoint", 20, "PI", 8.0) == pytest.approx(100 * (peak - 1), abs=0.01)


def of_times(gain, leads, lags, delay=0.0, integrators=0):
    """gain prod(T s + 1) / (prod(tau s + 1) s^integrators) e^(-s delay)."""
    num, den = (reduce(np.convolve, ([time, 1.0] for time in times), np.ones(1)) for times in (leads, lags))
    return pidalab.Process(gain * num, np.append(den, np.zeros(integrators)), delay)


SKOGESTAD = {  # the fifteen examples of Skogestad (2003)
    "E1": of_times(1, [], [1, 0.2]),
    "E2": of_times(1, [-0.3, 0.08], [2, 1, 0.4, 0.2, 0.05, 0.05, 0.05]),
    "E3": of_times(2, [15], [20, 1, 0.1, 0.1]),
    "E4": of_times(1, [], [1, 1, 1, 1]),
    "E5": of_times(1, [], [1, 0.2, 0.04, 0.008]),
    "E6": of_times(1, [0.17, 0.17], [1, 1, 0.028], integrators=1),
    "E7": of_times(1, [-2], [1, 1, 1]),
    "E8": of_times(1, [], [1, 1], integrators=1),
    "E9": of_times(1, [], [1, 1], 1.0),
    "E10": of_times(1, [], [20, 2], 1.0),
    "E11": of_times(1, [-1], [6, 2, 2], 1.0),
    "E12": of_times(1, [6, 3], [10, 8, 1], 0.3),
    "E13": of_times(1, [2], [10, 0.5], 1.0),
    "E14": of_times(1, [-1], [], integrators=1),
    "E15": of_times(1, [-1], [1]),
}


@pytest.mark.parametrize("kind", ["PI", "PID"])
@pytest.mark.parametrize("name", SKOGESTAD)
def test_simc_takes_all_examples_of_its_author(name, kind):
    """With a closed-loop time where two lags are all there is: then there is no effective dead time."""
    wanted = 0.1 if (name, kind) == ("E1", "PID") else None
    design = simc(SKOGESTAD[name], kind, closed_loop_time=wanted, n=1e4)
    # of the PID for E13, which he does not print, 2.9: its model is a rough one
    assert 1.0 < design.ms < (3.0 if (name, kind) == ("E13", "PID") else 2.01)


@pytest.mark.parametrize(
    ("name", "kind", "gain", "lags", "delay"),
    [
        ("E2", "PI", 1.0, [2.5], 1.47),
        ("E2", "PID", 1.0, [2.0, 1.2], 0.77),
        ("E3", "PI", 1.5, [1.05], 0.15),
        ("E3", "PID", 1.5, [1.0, 0.15], 0.05),
        ("E6", "PID", 1.0, [1.33], 0.358),
        ("E12", "PI", 0.225, [1.0], 0.3),
        ("E13", "PI", 0.625, [4.5], 1.25),
    ],
)
def test_zeros_in_the_left_half_plane(name, kind, gain, lags, delay):
    """The models that the author prints for them, from memory: his table is not at hand.

    The PI model of E6 is not among them. The half rule gives it the dead time 1.188; the printed value may be 1.69, the
    sum of all its lags.
    """
    design = simc(SKOGESTAD[name], kind)
    assert design.gain == pytest.approx(gain, rel=1e-6)
    assert design.lags == pytest.approx(lags, rel=1e-6)
    assert design.delay == pytest.approx(delay, rel=1e-6)


@pytest.mark.parametrize(
    ("leads", "lags", "delay", "gain"),
    [
        ([3.0], [2.5], 1.0, 3.0 / 2.5),  # T1: the zero is the slower, both slower than the dead time
        ([3.0], [2.5], 2.8, 3.0 / 2.8),  # T1a: the dead time lies between them
        ([3.0], [2.5], 4.0, 1.0),  # T1b: it is longer than both
        ([3.0], [4.0], 0.5, 3.0 / 4.0),  # T2: the dead time is short
        ([2.0], [8.0], 1.0, 5.0 / 8.0),  # T3: the lag is more than five times as long, and 3 of it are left
    ],
)
def test_a_zero_and_the_lag_beside_it(leads, lags, delay, gain):
    """Another lag, far away, tells the gain that the pair leaves."""
    design = simc(of_times(1.0, leads, [*lags, 1e3], delay), "PID")
    assert (design.gain, design.lags[0], design.delay) == pytest.approx((gain, 1e3, delay), rel=1e-9)
    assert design.lags[1:] == pytest.approx([3.0] if leads == [2.0] else [])


def test_a_dead_time_alone_is_integrated():
    """1/(K (tau_c + theta)) over s: L = e^(-s theta)/(2 theta s), whose Ms is 1.59."""
    design = simc(of_times(2.0, [], [], 3.0), "PI")
    assert design.controller(0.1j) == pytest.approx(1 / (2.0 * 6.0 * 0.1j))
    assert design.ms == pytest.approx(1.59049, rel=1e-5)


def test_two_integrators():
    design = simc(of_times(2.0, [], [], 1.0, integrators=2), n=1e6)
    s, kc = 0.3j, 1 / (4 * 2.0 * 2.0**2)
    assert design.controller(s) == pytest.approx(kc * (1 + 1 / (8 * s)) * (1 + 8 * s), rel=1e-5)
    assert pidalab.is_stable(design.loop())
    with pytest.raises(ValueError, match=r"kind must be 'PID' .* found 'PI'"):
        simc(of_times(2.0, [], [], 1.0, integrators=2), "PI")


def test_improved_simc():
    """A third of the dead time as derivative, in series form: kc (1 + 1/(ti s)) (1 + td s)."""
    design = classical.improved_simc(pidalab.fopdt(2.0, 4.0, 1.5), closed_loop_time=1.0, n=1e6)
    s = 0.7j
    assert design.controller(s) == pytest.approx(4 / (2 * 2.5) * (1 + 1 / (4 * s)) * (1 + 0.5 * s), rel=1e-5)
    for lag in (1e-3, 0.1, 1.0, 10.0, 1e3):
        assert 1.65 < classical.improved_simc(pidalab.fopdt(1.0, lag, 1.0), n=1e6).ms < 1.73
    alone = classical.improved_simc(of_times(2.0, [], [], 3.0)).controller
    assert alone(s) == pytest.approx((1 / s + 1) / (2 * 4.5))


ONE, CHR = pidalab.fopdt(1.0, 1.0, 1.0), classical.chien_hrones_reswick


@pytest.mark.parametrize(
    ("rule", "arguments", "message"),
    [
        (simc, (pidalab.sopdt(1, 1, 0.4, 1),), "model .* real stable poles"),
        (simc, (pidalab.Process([1.0], [1.0, 2 * 0.998, 1.0]),), "real stable poles"),  # imaginary parts of 6 %
        (simc, (pidalab.Process([1.0], [1.0, -1.0]),), "real stable poles"),
        (simc, (pidalab.Process([1.0], [1.0, 0.0, 0.0, 0.0]),), "at most two integrators"),
        (simc, (pidalab.Process([0.5, 0.2, 1.0], [1.0, 2.0, 1.0]),), "real zeros"),
        (simc, (pidalab.Process([1.0, 0.0], [1.0, 2.0, 1.0]),), "no zero at 0"),
        (simc, (pidalab.fopdt(1, 1, 0), "PI"), "closed_loop_time"),
        (classical.amigo, (pidalab.fopdt(1, 1, 0),), "dead time above 0"),
        (partial(classical.lambda_tuning, closed_loop_time=0.0), (ONE,), "closed_loop_time must be above 0"),
        (classical.ziegler_nichols_ultimate, (pidalab.lags(2),), "process"),
        (classical.ziegler_nichols_ultimate, (pidalab.Process([1.0], [1.0, 1.0, 0.0]),), "process"),
        (classical.ziegler_nichols_ultimate, (pidalab.Process([1.0], [1.0, -1.0, 0.0], 1.0),), "process"),
        (CHR, (pidalab.fopdt(1.0, 1.0, 0.0),), "dead time above 0"),
        (CHR, (pidalab.ipdt(1.0, 1.0),), "one stable pole"),
        (CHR, (ONE, "noise"), "test must be 'load' or 'setpoint'"),
        (CHR, (ONE, "load", 10), "overshoot must be 0 or 20, found 10"),
        (CHR, (ONE, "load", 0, "PIDA"), "kind must be 'PI' or 'PID'"),
    ],
)  # fmt: skip
def test_refusals(rule, arguments, message):
    with pytest.raises(ValueError, match=message):
        rule(*arguments)
