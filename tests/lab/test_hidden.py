"""Check the hidden plants: stored optima, points, and what the reader sees."""

import random
import re

import numpy as np
import pytest
from engine import SCRIPT, Engine

import pidalab

FILES = ("engine", "model", "hidden-data", "hidden")
CALLS = """
pidalabEngine.plant = ({name}) => pidalabHidden.plantOf(name);
pidalabEngine.judged = ({name, given}) => pidalabHidden.judged(name, given);
pidalabEngine.stepTest = ({name}) => pidalabHidden.stepTest(name, Math.random);
"""
MS, NOISE = 1.6, 1.0


@pytest.fixture(scope="module")
def page():
    return Engine("\n".join([*(SCRIPT.with_name(f"{n}.js").read_text() for n in FILES), CALLS]))


@pytest.fixture(scope="module")
def names(page):
    text = page.context.eval("JSON.stringify(pidalabHidden.names())")
    return [name.strip('" []') for name in text.split(",")]


def best_of(plant):
    gains = plant["best"]["gains"]
    process = pidalab.Process(plant["num"], plant["den"], plant["delay"])
    return pidalab.Loop(process, pidalab.HighOrderPID(gains, plant["best"]["filterTime"], 3))


def answer_of(plant, factor=1.0):
    ki, kp, kd, ka = plant["best"]["gains"]
    times = {"ti": kp / ki, "td": kd / kp, "ta": ka / kp, "Tf": plant["best"]["filterTime"]}
    return {"kp": factor * kp, **times}


def test_stored_optima_keep_their_limits_and_have_the_stored_iae(page, names):
    assert len(names) == 10
    for name in names:
        plant = page.plant(name=name)
        loop = best_of(plant)
        assert pidalab.margins(loop).ms <= MS * 1.0001, name
        assert pidalab.relative_noise_gain(loop) <= NOISE * 1.0001, name
        t = np.linspace(0.0, 4 * plant["end"], 4001)
        assert plant["iae"] == pytest.approx(pidalab.load_response(loop, t).iae(), rel=2e-3), name


def test_the_library_finds_no_better_design(page, names):
    """One random plant is tested, since a search takes seconds."""
    plant = page.plant(name=random.choice(names))
    process = best_of(plant).process
    scale = pidalab.noise_scale(process)
    best = pidalab.optimal.load(
        process, 2, ms=MS, noise_gain=NOISE * scale.gain, sample_time=scale.sample_time
    )
    assert plant["iae"] == pytest.approx(best.iae, rel=5e-3)


def test_points_are_those_of_the_true_plant(page, names):
    for name in names:
        plant = page.plant(name=name)
        assert page.judged(name=name, given=answer_of(plant, 0.999))["points"] >= 99, name
        if name != "tank level":  # with an integrator, less gain reduces robustness
            assert 20 < page.judged(name=name, given=answer_of(plant, 0.5))["points"] < 80, name
        for factor, word in ((1.3, "Ms must be at most 1.6"), (50.0, "Unstable"), (-1.0, "other sign")):
            verdict = page.judged(name=name, given=answer_of(plant, factor))
            assert verdict["points"] == 0, (name, factor)
            assert word in verdict["say"], (name, verdict["say"])
        noisy = page.judged(name=name, given={**answer_of(plant, 0.9), "Tf": plant["best"]["filterTime"] / 2})
        assert noisy["points"] == 0, name


def test_the_script_hides_its_models():
    text = SCRIPT.with_name("hidden-data.js").read_text()
    values = re.findall(r'": "(\w+)"', text)
    assert len(values) == 10
    assert all(re.fullmatch("[0-9a-f]{200,}", value) for value in values)


def test_a_step_test_shows_the_plant_and_its_noise(page, names):
    for name in names:
        plant, record = page.plant(name=name), page.stepTest(name=name)
        t, u, y = (np.array(record[key]) for key in "tuy")
        process = best_of(plant).process
        first = int(np.argmax(u))
        clean = np.append(np.zeros(first), pidalab.open_loop_step(process, t).y)[: t.size]
        noise = y - clean - np.mean(y - clean)
        assert 0.003 < np.std(noise) / np.ptp(clean) < 0.03, name
