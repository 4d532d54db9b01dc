"""Provide digital controllers of every kind, and records to run them over."""

import math

import control
import numpy as np

from pidalab import PIDA, HighOrderPID, NonInteractivePIDA, SeriesPIDA
from pidalab.digital.program import program
from pidalab.rules.haalman import OutputFilter

RANGE = {"limits": (-4.0, 6.0), "bias": 0.5}
STANDARD = PIDA(1.3, 3.3, 0.9, 0.27, n=4, m=2)
SERIES = SeriesPIDA(0.5, 0.4, 0.05, 0.9, 0.2, 4)
LEAD = control.tf([0.3, 1.0], [0.6, 1.0])
RINGING = control.tf([0.5, 1.0], [0.2, 0.4, 1.1, 1.0])
CASES = {
    "plain_pi": PIDA(1.3, 3.3).discretise(0.1, **RANGE),
    "pd": PIDA(1.3, math.inf, 0.9).discretise(0.1, rate_limit=60.0, **RANGE),
    "tustin": STANDARD.discretise(0.1, "tustin", b=0.4, c=0.0, anti_windup="clamping", rate_limit=50.0, **RANGE),
    "zoh": STANDARD.discretise(0.1, "zoh", anti_windup="back-calculation", deadband=0.02, **RANGE),
    "backward": NonInteractivePIDA(1.0, 2.0, 0.5, 0.8).discretise(0.3, c=0.0, y_offset=3.0, **RANGE),
    "fifth": HighOrderPID([0.4, 1.3, 0.6, 0.2, 0.05], 0.3, 5).discretise(0.1, "zoh", b=0.7, c=0.2, **RANGE),
    "third": HighOrderPID([0.4, 1.3, 0.6], 0.3, 3).discretise(0.2, "tustin", anti_windup=None, rate_limit=5.0),
    "gains": HighOrderPID([0.4, 1.3], 0.0, 0).discretise(0.2, anti_windup="clamping", **RANGE),
    "own_reset": SERIES.discretise(0.1, rate_limit=50.0, **RANGE),
    "reset_tustin": SERIES.discretise(0.1, "tustin", deadband=0.01, **RANGE),
    "reset_zoh": SERIES.discretise(0.1, "zoh", **RANGE),
    "behind": STANDARD.discretise(0.1, output_filter=OutputFilter(0.4, 2, math.nan), b=0.8, c=0.0, **RANGE),
    "near": STANDARD.discretise(0.1, "tustin", OutputFilter(0.23, 2, math.nan), c=0.0, **RANGE),
    "near_zoh": STANDARD.discretise(0.1, "zoh", OutputFilter(0.23, 1, math.nan), **RANGE),
    "prefilter": STANDARD.discretise(0.1, prefilter=LEAD, deadband=0.01, y_offset=3.0, **RANGE),
    "prefilter_tustin": PIDA(1.3, 3.3).discretise(0.1, "tustin", prefilter=RINGING, b=0.5, **RANGE),
    "prefilter_zoh": SERIES.discretise(0.1, "zoh", prefilter=RINGING, rate_limit=50.0, **RANGE),
    "reset_behind": SERIES.discretise(0.1, output_filter=OutputFilter(0.3, 1, math.nan), **RANGE),
    "only_integral": HighOrderPID([0.4, 0.0], 0.0, 0).discretise(0.2, **RANGE),
    "integral_tustin": HighOrderPID([0.4, 0.0], 0.3, 1).discretise(0.2, "tustin", tunable=True, **RANGE),
    "fed": STANDARD.discretise(0.1, b=0.5, feedforward=True, rate_limit=50.0, **RANGE),
    "fed_clamping": STANDARD.discretise(0.1, anti_windup="clamping", feedforward=True, tunable=True, **RANGE),
    "fed_pd": PIDA(1.3, math.inf, 0.9).discretise(0.1, feedforward=True, **RANGE),
    "tuned_reset": SERIES.discretise(0.1, "tustin", tunable=True, **RANGE),
    "reset_weights": SERIES.discretise(0.1, b=0.6, c=0.0, **RANGE),
}  # fmt: skip


def record(k, seed=0, n=300):
    """Return random inputs, with periods in manual mode."""
    rng = np.random.default_rng(seed)
    jumps = np.repeat(rng.uniform(-1.0, 1.0, n // 20), 20)
    y = 0.7 * np.convolve(jumps, np.exp(-np.arange(40) / 8) / 8)[:n] + 0.02 * rng.normal(size=n)
    manual = np.repeat(rng.random(n // 10) < 0.2, 10)
    rows = {
        "setpoint": k.y_offset + jumps,
        "measurement": k.y_offset + y,
        "manual": manual,
        "manual_value": k.bias + rng.uniform(-6.0, 6.0, n),
        "tracking": rng.random(n) < 0.05,
        "track_value": k.bias + rng.uniform(-3.0, 3.0, n),
        "feedforward": np.repeat(rng.uniform(-2.0, 2.0, n // 30), 30),
        "retuned": rng.random(n) < 0.03,
    }
    rows = {name: rows[name] for name in program(k).inputs}
    # The numbers are exact in single precision.
    return {name: x if x.dtype == bool else x.astype(np.float32).astype(float) for name, x in rows.items()}


def reference(k, rows):
    """Return the control signals of `DigitalController.step`."""
    k.reset()
    signals = []
    for values in zip(*(x.tolist() for x in rows.values()), strict=True):
        now = dict(zip(rows, values, strict=True))
        if now.get("retuned"):
            k.retune(k)
        acts = (
            now[f"{way}_value"] if now[mode] else None
            for way, mode in (("manual", "manual"), ("track", "tracking"))
        )
        signals.append(k.step(now["setpoint"], now["measurement"], *acts, now.get("feedforward", 0.0)))
    return np.array(signals)
