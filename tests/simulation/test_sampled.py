"""Compare the sampled simulation with closed forms, the exact engine, Runge-Kutta steps and the oracle."""

import math

import control
import numpy as np
import pytest
from engine_errors import oracle, sampled_oracle_loop
from scipy.special import gammainc

import pidalab
from pidalab import PIDA, AsymmetricPlant, HighOrderPID, Loop, Process, SeriesPIDA, simulate, simulate_sampled
from pidalab.rules import mrdp
from pidalab.simulation.sampled_step import filtered
from pidalab.statespace import discretise

LOOPS = {
    "chain": Loop(pidalab.lags(4), PIDA(1.31, 3.37, 0.938, 0.269), control.tf([1.0], [0.0164, 0.256, 1.0])),
    "prefilter": Loop(pidalab.sopdt(2.0, 1.5, 1.2, 0.7), PIDA(0.6, 3.0, 0.5, 0.1, 3, 3), None, control.tf(1, [0.5, 1])),
    "integrating": Loop(pidalab.ipdt(1.0, 1.0), PIDA(0.4, 8.0, 0.0, 0.0)),
    "misaligned": Loop(pidalab.fopdt(1.0, 2.0, math.sqrt(0.5)), PIDA(0.9, 2.0, 0.0, 0.0)),
    "feedthrough": Loop(Process([0.4, 1.0], [1.0, 1.0], 0.7), 0.6),
    "short delay": Loop(pidalab.ipdt(1.0, 0.001), 0.5),
    "reset": Loop(pidalab.fopdt(1.0, 2.0, math.sqrt(0.5)), SeriesPIDA(0.3, 0.1, 0.0, 1.0, 0.1, 1)),
    "reset, filters": Loop(
        pidalab.lags(2), SeriesPIDA(0.8, 0.2, 0.0, 1.5, 0.2, 2), control.tf(1, [0.1, 1]), control.tf(1, [0.5, 1])
    ),
    "PID_2^1": mrdp.tune(pidalab.ipdt(1.0, delay=1.0), m=1, n=2, te=0.2).loop(),
    "PID_6^2": mrdp.tune(pidalab.ipdt(1.0, delay=1.0), m=2, n=6, te=1.2).loop(),
}  # fmt: skip


@pytest.mark.parametrize("name", LOOPS)
def test_first_order_convergence_to_the_continuous_loop(name):
    """Half the sample time halves the error in y, u and the area, also if samples and dead time are not aligned."""
    errors = []
    for fineness in (20, 40, 80):
        t = np.linspace(0.0, 12.0, 60 * fineness + 1)
        inputs = {"setpoint": 1.0, "load": np.where(t < 5.0, 0.0, 0.3)}
        sampled, exact = simulate_sampled(LOOPS[name], t, **inputs), simulate(LOOPS[name], t, **inputs)
        off = [
            np.max(np.abs(getattr(sampled, key) - getattr(exact, key))[::fineness])
            for key in ("y", "u", "area")
        ]
        errors.append(off)
    ratios = np.array(errors)[:-1] / np.array(errors)[1:]
    assert np.all((ratios > 1.8) & (ratios < 2.3)), ratios
    assert max(errors[-1]) < 0.15


def test_static_plant_with_dead_time_repeats_the_controller():
    r = simulate_sampled(Loop(Process([2.0], [1.0], 0.25), 0.3), 0.1 * np.arange(8), setpoint=1.0)
    assert r.y.round(12).tolist() == [0.0, 0.0, 0.0, 0.6, 0.6, 0.6, 0.24, 0.24]  # u of 0.05 samples before t
    assert r.area[3:5] == pytest.approx([0.6 * 0.05, 0.6 * 0.15])


@pytest.mark.parametrize("ratio", [1e-3, 0.1, 1.0, 20.0, 1e4], ids="{}_samples".format)
def test_filter_of_sixth_order_is_its_closed_form(ratio):
    """The output is a sum of derivatives of the gamma distribution."""
    h, gains, n = 0.02, [0.5, 2.0, 1.3, 0.7, 0.2, 0.05], 6
    time = ratio * h
    t = h * np.arange(4000)
    x = t / time
    density = np.polynomial.Polynomial([0.0] * (n - 1) + [1.0 / math.factorial(n - 1) / time])
    expected = gains[0] * (t * gammainc(n, x) - n * time * gammainc(n + 1, x)) + gains[1] * gammainc(n, x)
    for gain in gains[2:]:
        expected += gain * density(x) * np.exp(-x)
        density = (density.deriv() - density) / time
    u = filtered(discretise(*HighOrderPID(gains, time, n).fraction(), h), np.ones(t.size))
    assert np.max(np.abs(u - expected)) < 1e-9 * max(gains[1], np.max(np.abs(expected)))


def asymmetric(rise, fall, delay=0.0):
    return AsymmetricPlant(
        control.tf([3.0, 2.0], [4.0, 5.0, 1.0]), rise, fall, control.tf([-0.2], [0.3, 1.0]), delay
    )


def test_equal_speeds_are_a_process():
    plant, t = asymmetric(2.0, 2.0, delay=0.13), 0.05 * np.arange(400)
    assert plant.rising == plant.falling
    s = 0.3 + 0.9j
    expected = np.exp(-0.13 * s) * (plant.main(s) / (2 * s + 1) + plant.direct(s))
    assert plant.rising(s) == pytest.approx(expected, rel=1e-12)
    inputs = {"setpoint": 1.0, "load": np.sin(t), "noise": 0.1 * np.cos(7 * t), "limits": (-0.4, 0.8)}
    loop = Loop(plant.rising, PIDA(0.7, 3.0, 0.2, 0.0, n=2))
    linear, with_plant = simulate_sampled(loop, t, **inputs), simulate_sampled(loop, t, **inputs, plant=plant)
    for key in ("y", "u", "area"):
        np.testing.assert_allclose(getattr(linear, key), getattr(with_plant, key), atol=1e-11)


@pytest.mark.parametrize("samples", [0.0, 0.3, 1.0, 2.0 - 1e-12, 2.0 + 1e-12, 3.9])
@pytest.mark.parametrize(
    "limits", [(-math.inf, math.inf), (0.0, 0.6), (-0.5, 0.0)], ids=["free", "up", "down"]
)
def test_closed_loop_event_by_event(samples, limits):
    """A PI loop with feedthrough is integrated by Runge-Kutta steps between changes of the input."""
    h, n, rng = 0.4, 50, np.random.default_rng(7)
    direct = 0.2 if samples else control.tf([0.2], [0.5, 1.0])
    plant = AsymmetricPlant(control.tf([1.2], [0.7, 1.0]), 0.9, 2.5, direct, samples * h)
    inputs = {
        "setpoint": rng.normal(size=n).cumsum(),
        "load": 0.2 * rng.normal(size=n),
        "noise": rng.normal(size=n),
    }
    kp, ti = 0.3, 2.0
    r = simulate_sampled(
        Loop(plant.rising, PIDA(kp, ti)), h * np.arange(n), limits=limits, plant=plant, **inputs
    )

    def slope(x, w):
        past = 0.2 * w if samples else x[2]
        lagged = (0.2 * w - x[2]) / 0.5
        return np.array(
            [(w - x[0]) / (0.9 if w > x[0] else 2.5), (1.2 * x[0] - x[1]) / 0.7, lagged, x[1] + past]
        )

    whole = math.floor(samples + 1e-6)
    part = h * max(0.0, samples - whole) if abs(samples - round(samples)) > 1e-6 else 0.0
    x, total, v = np.zeros(4), 0.0, []

    def input_of(sample):
        return v[sample] if sample >= 0 else 0.0

    for k in range(n):
        now = input_of(k - whole - (part > 0)) if samples else 0.0
        y = x[1] + (0.2 * now if samples else x[2])
        assert (r.y[k], r.area[k]) == pytest.approx((y, x[3]), abs=1e-7)
        error = inputs["setpoint"][k] - inputs["noise"][k] - y
        u = min(max(kp * (error + total / ti), limits[0]), limits[1])
        assert r.u[k] == pytest.approx(u, abs=1e-7)
        total += h * error
        v.append(u + inputs["load"][k])
        for duration, w in ((part, input_of(k - whole - 1)), (h - part, input_of(k - whole))):
            step = duration / 40
            for _ in range(40):
                k1 = slope(x, w)
                k2 = slope(x + step / 2 * k1, w)
                k3 = slope(x + step / 2 * k2, w)
                x = x + step / 6 * (k1 + 2 * k2 + 2 * k3 + slope(x + step * k3, w))


def test_paths_share_a_common_pole_and_keep_others():
    lag = [120.0, 1.0]
    plant = AsymmetricPlant(control.tf([1.0], lag), 60.0, 180.0, control.tf([0.5], lag))
    for process, time in ((plant.rising, 60.0), (plant.falling, 180.0)):
        assert process.den.size == 3
        assert process(0.01j) == pytest.approx((1 / (1 + 0.01j * time) + 0.5) / (1 + 1.2j))
    plant = AsymmetricPlant(control.tf([1.0], [2.0, 1.0]), 1.0, 2.0, control.tf([0.5], [7.0, 1.0]))
    assert plant.falling(0.4j) == pytest.approx(1 / (2 * 0.4j + 1) ** 2 + 0.5 / (7 * 0.4j + 1), rel=1e-12)
    assert AsymmetricPlant(control.tf([1.0], [2.0, 1.0]), 1.0, 2.0, 0.5).rising(0.0) == pytest.approx(1.5)


# Responses of loops with a digital controller against the oracle: to 1e-9 of max(1, the largest value so far).


@pytest.mark.parametrize("case", oracle("sampled_loops.json")["cases"], ids=lambda case: case["name"])
def test_responses(case):
    loop, t = sampled_oracle_loop(case), case["sample_time"] * np.arange(case["samples"])
    for source in ("setpoint", "load"):
        response = pidalab.simulate_sampled(loop, t, **{source: 1.0})
        for signal in ("y", "u"):
            if f"{source}.{signal}" in case["values"]:
                true = np.array(case["values"][f"{source}.{signal}"], float)
                error = np.abs(getattr(response, signal)[case["values"]["picked"]] - true)
                assert np.max(error / np.maximum.accumulate(np.maximum(1.0, np.abs(true)))) <= 1e-9


@pytest.mark.parametrize(
    "case",
    [case for case in oracle("sampled_loops.json")["cases"] if case["method"] == "zoh"],
    ids=lambda case: case["name"],
)
def test_a_continuous_controller_is_discretised_for_held_inputs(case):
    """The loop matches the digital controller of the method zoh."""
    loop, t = sampled_oracle_loop(case, digital=False), case["sample_time"] * np.arange(case["samples"])
    response = pidalab.simulate_sampled(loop, t, setpoint=1.0)
    true = np.array(case["values"]["setpoint.y"], float)
    assert np.max(np.abs(response.y[case["values"]["picked"]] - true)) <= 1e-9
