"""The controller of huba2024 as it would run in a microcontroller, in plain Python, beside the engine."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pandas as pd
import pidalab

from . import advice, loops
from .tables import tabled

H, LIMITS = 0.01, (-0.1, 0.1)


def controller(own: pidalab.SeriesPIDA, h: float, low: float, high: float) -> Callable[[float], float]:
    """Series PIDA with Q_4 and automatic reset: a function from the control error to the limited control signal."""
    q = h / own.filter_time
    p = [math.exp(-q) * q**j / math.factorial(j) for j in range(4)]
    g = [1 - sum(p[: i + 1]) for i in range(4)]
    a = math.exp(-h / own.ti)
    x1 = x2 = x3 = x4 = reset = 0.0

    def step(error: float) -> float:
        nonlocal x1, x2, x3, x4, reset
        slope, bend = (x3 - x4) / own.filter_time, (x2 - 2 * x3 + x4) / own.filter_time**2
        u = min(max(own.kp * x4 + own.kd * slope + own.ka * bend + reset, low), high)
        reset = a * reset + (1 - a) * u
        x4 = p[0] * x4 + p[1] * x3 + p[2] * x2 + p[3] * x1 + g[3] * error
        x3 = p[0] * x3 + p[1] * x2 + p[2] * x1 + g[2] * error
        x2 = p[0] * x2 + p[1] * x1 + g[1] * error
        x1 = p[0] * x1 + g[0] * error
        return u

    return step


@tabled
def against_the_engine() -> pd.DataFrame:
    """A ramp of the set point, a load from t = 40 on, and noise; largest differences from the engine."""
    own = advice.recommended().controller
    assert isinstance(own, pidalab.SeriesPIDA)
    clock = loops.clock(80.0, H)
    w, d = np.minimum(1.0, clock / 5), np.where(clock < 40, 0.0, 0.05)
    noise = pidalab.uniform_noise(clock, 0.002, seed=4)
    engine = pidalab.simulate_sampled(
        pidalab.Loop(loops.plant(), own), clock, w, d, noise=noise, limits=LIMITS
    )
    step, late, y = controller(own, H, *LIMITS), [0.0] * round(loops.plant().delay / H), 0.0
    ours = np.empty((2, clock.size))
    for k in range(clock.size):
        u = step(w[k] - (y + noise[k]))
        ours[:, k] = y, u
        late.append(u + d[k])
        y += H * late.pop(0)
    apart = np.max(np.abs(ours - [engine.y, engine.u]))
    share = np.mean(np.abs(engine.u) >= LIMITS[1])
    return pd.DataFrame(
        {"": {"at most 1e-12 apart": str(bool(apart < 1e-12)), "samples at a limit": f"{share:.2f}"}}
    )
