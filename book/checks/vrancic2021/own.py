"""The example record of a heater, simulated: what it supports, and how its controllers do on the process behind it."""

from __future__ import annotations

import warnings
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pidalab
from pidalab import areas
from pidalab.ledger import Ledger
from pidalab.rules import magnitude_optimum as mo

from .names import typeset

NOISE_GAIN, SAMPLE_TIME = 5.0, 0.2  # % per degree, s
RECORD = Path(__file__).parents[2] / "data" / "step_record.csv"
CUT = 60.0  # s, where a record is cut off too early


def heater() -> pidalab.Process:
    """The process behind the record, see `studies/step_record.py`."""
    return pidalab.Process([1.8], 800 * np.poly([-1 / 20, -1 / 8, -1 / 5]), delay=4.0)


@cache
def measured(until: float = np.inf) -> areas.MeasuredAreas:
    """Areas of the record up to a time."""
    record = pd.read_csv(RECORD, comment="#").to_numpy()
    with warnings.catch_warnings(action="ignore", category=areas.RecordWarning):
        t, u, y = record[record[:, 0] <= until].T
        return areas.from_record(t, u, y, count=10)


@cache
def three_points() -> pidalab.Process:
    """A model with few parameters, from three points of the record."""
    t, _, y = pd.read_csv(RECORD, comment="#").to_numpy().T
    found = measured()
    after = t >= found.span[0]
    step = found.input_levels[1] - found.input_levels[0]
    rise = y[after] - found.output_levels[0]
    return pidalab.identification.three_point(t[after] - found.span[0], rise, step=step).process


@typeset
def record(book: Ledger) -> pd.DataFrame:
    """What the record says of itself, cut off too early and whole."""
    rows = {}
    for name, until in ((f"up to {CUT:g} s", CUT), ("all of it", np.inf)):
        found = measured(until)
        rows[name] = {
            "changes from, s": f"{found.span[0]:g}",
            "to, s": f"{found.span[1]:g}",
            "at rest at the end": "yes" if found.settled else "no",
            "gain": f"{found.gain:.4f}",
            "noise": f"{found.noise:.4f}",
        }
    return pd.DataFrame(rows).T


@typeset
def controllers(book: Ledger) -> pd.DataFrame:
    """Controllers from the true process, the record and three points of it, on the true process."""
    sources: dict[str, Any] = {"true process": heater(), "record": measured(), "three points": three_points()}
    rows = {}
    for m, (name, source) in product((1, 2, 3), sources.items()):
        try:
            design = mo.tune_for_exact_noise(source, m, m + 2, NOISE_GAIN, SAMPLE_TIME)
        except ValueError as reason:
            rows[f"m = {m}, {name}"] = {"K_-1": "refused", "why": str(reason).partition(";")[0]}
            continue
        loop = pidalab.Loop(heater(), design.controller)
        values = {
            "K_-1": design.gains[0],
            "T_F": design.filter_time,
            "Ms": pidalab.max_sensitivity(loop)[0],
            "noise gain": pidalab.noise_gain(loop, SAMPLE_TIME),
            "IAE, load": pidalab.load_response(loop, np.linspace(0, 600, 6001)).iae(),
        }
        rows[f"m = {m}, {name}"] = {key: f"{value:.3g}" for key, value in values.items()}
    return pd.DataFrame(rows).T.drop(columns="why").fillna("–")
