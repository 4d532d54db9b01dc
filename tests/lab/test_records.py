"""Drop records of lags and integrators into the lab, with and without noise."""

import random

import numpy as np
import pytest
from engine import SCRIPT, Engine

import pidalab

FILES = ("engine", "optima", "model", "optimum", "record")
DROP = """
pidalabEngine.find = ({process, kind, knobs}) => pidalabOptimum.find(process, kind, knobs);
pidalabEngine.drop = ({text}) => {
  const found = pidalabRecord.fit(pidalabRecord.readRecord(text));
  return { own: found.own, sigma: found.sigma, span: found.span, process: pidalabModel.ownPlant(found.own) };
};
"""
# lags, dead time, noise as a share of the change
PLANTS = {
    **{
        f"lag {lag}, dead time {delay}, noise {noise}": (pidalab.fopdt(2.0, lag, delay), lag + delay, noise)
        for lag, delay, noise in (
            *((1, 0.1, 0), (3, 1, 0), (10, 20, 0.01), (100, 10, 0.02), (5, 5, 0.005)),
            *((2, 0.4, 0.01), (30, 3, 0), (50, 100, 0.01), (8, 2, 0.02), (1, 1, 0.01)),
        )
    },
    **{
        f"lags {a} and {b}, noise {noise}": (
            pidalab.Process([1.5], np.convolve([a, 1], [b, 1]), delay),
            a + b + delay,
            noise,
        )
        for a, b, delay, noise in ((3, 1, 0.5, 0), (10, 9, 3, 0.01), (5, 0.5, 1, 0.02), (20, 10, 1, 0.005))
    },
    **{
        f"three lags {lag}, noise {noise}": (pidalab.lags(3, lag, delay=delay), 3 * lag + delay, noise)
        for lag, delay, noise in ((1, 1, 0), (4, 2, 0.01), (10, 0.5, 0.02))
    },
    **{
        f"integrator {gain}, noise {noise}": (pidalab.ipdt(gain, delay=delay), 3 * delay, noise)
        for gain, delay, noise in ((1, 1, 0), (0.1, 5, 0.01), (0.5, 2, 0.02))
    },
}


@pytest.fixture(scope="module")
def lab():
    sources = (SCRIPT.with_name(f"{name}.js").read_text(encoding="utf-8") for name in FILES)
    return Engine("\n".join([*sources, DROP]))


@pytest.mark.parametrize("turn", range(4))
def test_record_gives_a_safe_design(turn, lab):
    """Each run tries some records, since all would take half a minute."""
    name = random.choice(sorted(PLANTS)[turn::4])
    plant, scale, noise = PLANTS[name]
    t = np.linspace(0.0, 6.0 * scale, 400)
    y = np.array(pidalab.open_loop_step(plant, t).y)
    y += noise * np.ptp(y) * np.random.default_rng(5).standard_normal(t.size)
    found = lab.drop(text="\n".join(f"{a:.6g},{b:.6g}" for a, b in zip(t, y, strict=True)))
    assert found["own"]["gain"] * plant.num[-1] > 0
    # The lab takes its limit of noise from the record.
    model = pidalab.Process(*(found["process"][key] for key in ("num", "den", "delay")))
    own = 0.1 * found["span"] / max(3.0 * found["sigma"] * pidalab.noise_scale(model).gain, 1e-9)
    best = lab.find(
        process=found["process"], kind="PIDA", knobs={"ms": 1.4, "noise": min(max(own, 0.1), 5.0)}
    )
    design = best["design"]
    kp, ti, td, ta = (design[key] for key in ("kp", "ti", "td", "ta"))
    gains = [kp / ti, kp, kp * td, kp * ta]
    controller = pidalab.HighOrderPID(gains, design["filterTime"], design["filterOrder"])
    ms = pidalab.max_sensitivity(pidalab.Loop(plant, controller))[0]
    assert ms < 2.0, name


@pytest.mark.parametrize("lag", [1e-2, 1e-4, 1e-6])
def test_negligible_lags_change_nothing(lag, lab):
    """The poles of these lags are beyond the highest frequency of the search."""
    plant = pidalab.Process([2.0], np.convolve([3.0, 1.0], np.convolve([lag, 1.0], [lag, 1.0])), 1.0)
    alone, behind = (
        lab.find(
            process={"num": one.num.tolist(), "den": one.den.tolist(), "delay": one.delay},
            kind="PID",
            knobs={"ms": 1.4, "noise": 1.5},
        )["iae"]
        for one in (pidalab.fopdt(2.0, 3.0, 1.0), plant)
    )
    assert behind == pytest.approx(alone, rel=4 * lag + 1e-3)
