"""A part of the tables computed anew at each run of a page, by the library, and compared."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pidalab
from pidalab.comparison import judged
from pidalab.comparison.candidates import judged_rules
from pidalab.simulation.settling import settled

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
    """Least IAE that the search finds now under the limits of a row, in units of the plant."""
    noise, sample = row.noise_limit * plant.ultimate_gain, plant.ultimate_period / 100
    found = pidalab.optimal.load(process(plant), row.order, row.ms_limit, None, noise, sample)
    return found.iae * plant.ultimate_gain / plant.ultimate_period


def stored(row: Any, plant: Any) -> float:
    """IAE of the stored controller of a row, in units of the plant; infinite where it does not keep the limit of Ms."""
    unit, period = plant.ultimate_gain, plant.ultimate_period
    gains = [row[f"k{k}"] * unit * period**k for k in range(-1, row["order"] + 1)]
    controller = pidalab.HighOrderPID(gains, row["filter_time"] * period, row["order"] + 1)
    loop = pidalab.Loop(process(plant), controller)
    if not pidalab.is_stable(loop) or pidalab.max_sensitivity(loop)[0] > row["ms_limit"] * (1 + DRIFT):
        return math.inf
    response = settled(pidalab.load_response, loop, 24 * period)
    return response.iae(horizon=math.inf) * unit / period


def drift(rules: int, optima: int, seed: int | None = None) -> str:
    """Compute random rows anew; raise where one is off.

    An optimum is off if its stored controller has another IAE or misses Ms, or if the search now finds a better one;
    a search that ends above it refutes nothing. The seed is drawn anew at each run, and named where a row is off.
    """
    drawn = int(np.random.SeedSequence(seed).generate_state(1)[0]) if seed is None else seed
    rng, plants = np.random.default_rng(drawn), tables.read("processes").set_index("plant")
    known = tables.read("comparison").query("terms == 'own' and iae_load > 0")
    for row in known.iloc[rng.permutation(len(known))[:rules]].itertuples():
        found = rule(row, plants.loc[row.plant])
        if not math.isclose(row.iae_load, found, rel_tol=DRIFT):
            raise _off(row.plant, "iae_load", found, row.iae_load, drawn)
    best = tables.optima().query("iae > 0 and order > 0")
    for _, row in best.iloc[rng.permutation(len(best))[:optima]].iterrows():
        again, found = (function(row, plants.loc[row.plant]) for function in (stored, optimum))
        if not math.isclose(row.iae, again, rel_tol=DRIFT) or found < row.iae * (1 - DRIFT_OPTIMUM):
            raise _off(row.plant, "iae", min(again, found), row.iae, drawn)
    return f"agree, drawn at random and computed anew: {rules} rows of rules, optima: {optima}"


def _off(plant: str, column: str, found: float, kept: float, seed: int) -> AssertionError:
    return AssertionError(f"{plant}: {column} is {found:.6g}, stored {kept:.6g} (seed {seed})")
