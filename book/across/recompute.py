"""A part of the tables computed anew at each run of a page, by the library, and compared."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pidalab
from pidalab.comparison import judged
from pidalab.comparison.candidates import judged_rules

import tables

DRIFT = 2e-3  # share; the tables have five digits
DRIFT_OPTIMUM = 1e-2  # an optimum is flat: a search may end a little elsewhere


def process(row: Any) -> pidalab.Process:
    """The plant of a row of processes.csv."""
    num, den = ([float(c) for c in text.split()] for text in (str(row.num), str(row.den)))
    return pidalab.Process(num, den, row.delay)


def rule(row: Any, plant: Any) -> float:
    """IAE of a load step with the rule of a row, in units of the plant."""
    model = process(plant)
    noise, sample = tables.NOISE["loud"] * plant.ultimate_gain, plant.ultimate_period / 100
    makers = judged_rules(model, tables.MS, noise, sample)
    make = next(make for rule, kind, make in makers if (rule, kind) == (row.rule, row.kind))
    return (
        judged(row.rule, row.kind, make, model, sample).iae_load * plant.ultimate_gain / plant.ultimate_period
    )


def optimum(row: Any, plant: Any) -> float:
    """Least IAE of a row, in units of the plant."""
    noise, sample = row.noise_limit * plant.ultimate_gain, plant.ultimate_period / 100
    found = pidalab.optimal.load(process(plant), row.order, row.ms_limit, None, noise, sample)
    return found.iae * plant.ultimate_gain / plant.ultimate_period


def drift(rules: int, optima: int, seed: int | None = None) -> str:
    """Compute random rows anew; raise where one is off.

    The seed is drawn anew at each run, and named where a row is off.
    """
    drawn = int(np.random.SeedSequence(seed).generate_state(1)[0]) if seed is None else seed
    rng, plants = np.random.default_rng(drawn), tables.read("processes").set_index("plant")
    known = tables.read("comparison").query("terms == 'own' and iae_load > 0")
    best = tables.optima().query("iae > 0 and order > 0")
    checks = [(known, "iae_load", rules, rule, DRIFT), (best, "iae", optima, optimum, DRIFT_OPTIMUM)]
    for table, column, count, again, allowed in checks:
        for row in table.iloc[rng.permutation(len(table))[:count]].itertuples():
            stored, found = getattr(row, column), again(row, plants.loc[row.plant])
            if not math.isclose(stored, found, rel_tol=allowed):
                raise AssertionError(
                    f"{row.plant}: {column} is {found:.6g}, stored {stored:.6g} (seed {drawn})"
                )
    return f"agree, drawn at random and computed anew: {rules} rows of rules, optima: {optima}"
