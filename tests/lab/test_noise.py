"""Check that all functions and pages give the same relative noise gain."""

import numpy as np
import pytest
from engine import SCRIPT, Engine
from test_engine import random_loops

import pidalab
from pidalab.comparison.judging import measure_row
from pidalab.plant.reporting import measure_candidate

CALLS = """
pidalabEngine.scale = ({process}) => pidalabModel.noiseScale(process);
pidalabEngine.shown = ({process, design, end}) => pidalabModel.study(process, design, {end});
pidalabEngine.judged = ({process, design}) => ({ value: pidalabModel.relativeNoiseGain(process, design) });
pidalabEngine.number = ({text}) => ({ value: pidalabModel.readNumber(text) });
"""


@pytest.fixture(scope="module")
def model():
    return Engine("\n".join([*(SCRIPT.with_name(f"{n}.js").read_text() for n in ("engine", "model")), CALLS]))


def plant_of(process):
    return {"num": process.num.tolist(), "den": process.den.tolist(), "delay": process.delay}


def design_of(kp, ti, td, ta, time, order):
    kind = "PIDA" if ta else "PID" if td else "PI"
    gains = [kp / ti, kp, kp * td, kp * ta][: 4 if ta else 3 if td else 2]
    design = {"kind": kind, "kp": kp, "ti": ti, "td": td, "ta": ta, "filterTime": time, "filterOrder": order}
    return design, pidalab.HighOrderPID(gains, time, order)


PLANTS = {
    "lags and dead time": pidalab.lags(3, delay=1.0),
    "lags alone": pidalab.Process([2.0], [6.0, 11.0, 6.0, 1.0]),
    "integrator": pidalab.ipdt(0.5, delay=2.0),
    "no ultimate period": pidalab.lags(2),
    "integrator without one": pidalab.Process([3.0], [2.0, 1.0, 0.0]),
    "unstable": pidalab.Process([2.0], [1.0, -0.5], delay=0.1),
    "a zero on the right": pidalab.Process([-1.0, 1.0], [1.0, 3.0, 3.0, 1.0]),
    "oscillating": pidalab.sopdt(1.0, 1.0, 0.1, 0.3),
    "two integrators": pidalab.Process([1.0], [1.0, 1.0, 0.0, 0.0]),
    "slow": pidalab.fopdt(0.02, 5e3, 40.0),
}


@pytest.mark.parametrize("process", PLANTS.values(), ids=PLANTS)
def test_noise_scale_matches_the_library(process, model):
    scale = model.scale(process=plant_of(process))
    true = pidalab.noise_scale(process)
    assert [scale["sampleTime"], scale["gain"]] == pytest.approx([true.sample_time, true.gain], rel=1e-9)


def doors(process, loop, design, model):
    """Return the relative noise gain by every function that computes it."""
    scale, plant = pidalab.noise_scale(process), plant_of(process)
    by_hand = pidalab.rules.Design(process, loop.controller, source="by hand")
    design_row = measure_row("one", "PIDA", lambda: by_hand, process, scale.sample_time, horizon=40.0)
    return {
        "library": pidalab.relative_noise_gain(loop),
        "by its parts": pidalab.noise_gain(loop, scale.sample_time) / scale.gain,
        "tables of the comparison": design_row.noise_gain / scale.gain,
        "report": measure_candidate(by_hand, "one", "PIDA", process).relative_noise,
        "lab and live figures": model.shown(process=plant, design=design, end=40.0)["sigma"],
        "tasks": model.judged(process=plant, design=design)["value"],
    }


CONTROLLERS = [
    (1.0, 3.0, 1.0, 0.4, 0.2, 3),
    (0.7, 2.1, 1.1, 0.0, 0.08, 2),
    (0.3, 2.0, 0.0, 0.0, 0.0686, 1),
    (0.332384 * 3.3683, 3.3683, 1.1269, 0.7825, 0.230722, 3),
]


@pytest.mark.parametrize("numbers", CONTROLLERS, ids=str)
def test_all_functions_give_the_same_relative_noise_gain(numbers, model):
    process = pidalab.lags(3, delay=1.0)
    design, controller = design_of(*numbers)
    gains = doors(process, pidalab.Loop(process, controller), design, model)
    assert gains == pytest.approx(dict.fromkeys(gains, gains["library"]), rel=1e-6)


def test_relative_noise_gain_of_random_loops_matches_the_library(model):
    """Filters that are faster than a sample of the noise use backward differences."""
    compared = 0
    for loop, _, _ in random_loops(40, seed=23):
        gains = [*loop.controller.coefficients, 0.0, 0.0, 0.0][:4]
        if gains[0] == 0 or not pidalab.is_stable(loop):
            continue
        kp = gains[1]
        design, _ = design_of(
            kp,
            kp / gains[0],
            gains[2] / kp,
            gains[3] / kp,
            loop.controller.filter_time,
            loop.controller.filter_order,
        )
        gain = model.judged(process=plant_of(loop.process), design=design)["value"]
        try:
            true = pidalab.relative_noise_gain(loop)
        except ValueError:
            assert np.isnan(gain), repr(loop)
            continue
        compared += 1
        assert gain == pytest.approx(true, rel=1e-6), repr(loop)
    assert compared > 10


ENTERED = {
    "2.5": 2.5,
    "2,5": 2.5,
    " 5/2 ": 2.5,
    "1+2.5": 3.5,
    "exp(-1)": np.exp(-1),
    "1/e": np.exp(-1),
    "e^-1": np.exp(-1),
    "36.8 %": 0.368,
    "8.4 dB": 10**0.42,
    "2·π/0,5": 4 * np.pi,
    "-2^2": -4,
    "sqrt(2)/2": 0.5**0.5,
    "(1+2)*3": 9,
    "2e3": 2000,
    "−7": -7,
}
NO_NUMBER = [
    "",
    "one",
    "1.2.3",
    "1e400",
    "--1",
    "1/0",
    "1 000",
    "(1",
    "1)",
    "2 m",
    "exp",
    "e e",
    "constructor",
    "9" * 70,
]


@pytest.mark.parametrize("text", ENTERED)
def test_numbers_are_read_in_common_notations(text, model):
    assert model.number(text=text)["value"] == pytest.approx(ENTERED[text])


@pytest.mark.parametrize("text", NO_NUMBER)
def test_other_text_is_not_read_as_a_number(text, model):
    assert np.isnan(model.number(text=text)["value"])
