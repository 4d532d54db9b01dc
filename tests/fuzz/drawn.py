"""Draw random processes, controllers, loops and records.

`make test` draws the same few cases at every run. `make fuzz` sets ``FUZZ`` to the number of cases of each property and
draws new cases at every run.
"""

import os

import numpy as np
from hypothesis import HealthCheck, Phase, settings, strategies as st

import pidalab

CASES = int(os.environ.get("FUZZ", "0"))


def cases(few, share=1.0):
    """Return settings for `few` cases in `make test`, and for a `share` of FUZZ in `make fuzz`."""
    unhurried = {
        "deadline": None,
        "suppress_health_check": list(HealthCheck),
        "phases": [Phase.explicit, Phase.generate, Phase.shrink],
    }
    if CASES:
        return settings(max_examples=max(1, round(share * CASES)), **unhurried)
    return settings(max_examples=few, derandomize=True, database=None, **unhurried)


def decades(low, high):
    """Draw a number between 10^low and 10^high, uniform in its logarithm, with four digits."""
    return st.floats(low, high).map(lambda x: float(f"{10**x:.4g}"))


delays = st.one_of(st.just(0.0), decades(-2, 1.3))
gains = st.one_of(decades(-0.5, 0.5), decades(-0.5, 0.5).map(lambda k: -k))
dampings = decades(-1.3, 0.5)

stable = st.one_of(
    st.builds(pidalab.fopdt, gains, decades(-1, 1), delays),
    st.builds(pidalab.sopdt, gains, decades(-0.5, 0.5), dampings, delays),
    st.builds(pidalab.lags, st.integers(2, 8), decades(-0.5, 0.5), gains, delays),
    st.builds(  # inverse response
        lambda k, zero, times, delay: pidalab.Process(
            [-k * zero, k], np.poly([-1 / t for t in times]) * np.prod(times), delay
        ),
        gains,
        decades(-1, 0.5),
        st.lists(decades(-1, 0.7), min_size=2, max_size=4),
        delays,
    ),
)
integrating = st.one_of(
    st.builds(pidalab.ipdt, gains, delays),
    st.builds(
        lambda k, t, delay: pidalab.Process([k], [t, 1.0, 0.0], delay), gains, decades(-1, 0.5), delays
    ),
)
unstable = st.builds(
    lambda k, rate, delay: pidalab.Process([k], [1.0, -rate], min(delay, 0.5 / rate)),
    gains,
    decades(-1.5, 0),
    delays,
)
processes = st.one_of(stable, integrating, unstable)


@st.composite
def controllers(draw, process, proper=True):
    """Draw a PI, PID or PIDA whose gain has the sign of the process. If `proper`, a filter makes the loop retarded."""
    m = draw(st.integers(0, 2))
    sign = float(np.sign(process.num[-1]))
    scale = max(process.delay, 0.3)
    kp, ti = draw(decades(-1.5, 0.8)), scale * draw(decades(-0.3, 1.2))
    td, ta = scale * draw(decades(-1.5, 0)), scale * draw(decades(-1.5, -0.3))
    values = [sign * kp / ti, sign * kp, sign * kp * td, sign * kp * ta**2][: m + 2]
    order = m + draw(st.integers(0, 2)) + (1 if proper else 0)
    return pidalab.HighOrderPID(values, scale * draw(decades(-2, -0.3)) if order else 0.0, order)


@st.composite
def loops(draw, family=processes, proper=True):
    """Draw a loop, stable or not."""
    process = draw(family)
    return pidalab.Loop(process, draw(controllers(process, proper)))
