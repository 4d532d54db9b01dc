"""Compute a random part of the tables again with the library, and compare. The tests of the pages call `drift`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pidalab
from pidalab.comparison import designs
from pidalab.requirements import Requirements
from pidalab.simulation.exact import simulate_until_settled

import tables

DRIFT = 2e-3  # allowed relative difference; the tables have five digits
DRIFT_OPTIMUM = 1e-2  # the same for a new search, which may end slightly elsewhere on a flat optimum


def process(row: Any) -> pidalab.Process:
    """Return the plant of a row of processes.csv."""
    num, den = ([float(c) for c in text.split()] for text in (str(row.num), str(row.den)))
    return pidalab.Process(num, den, row.delay)


def rule(row: Any, plant: Any) -> float:
    """Return the IAE of a load step with the rule of a row, in units of the plant."""
    model = process(plant)
    noise, sample = tables.NOISE["loud"] * plant.ultimate_gain, plant.ultimate_period / 100
    makers = designs(model, Requirements(ms=tables.MS, noise_gain=noise, sample_time=sample), [row.rule])
    make = next(make for _, kind, make in makers if kind == row.kind)
    return load_iae(make().loop(model), plant)


def optimum(row: Any, plant: Any) -> float:
    """Return the least IAE of a new search under the limits of a row, in units of the plant."""
    noise, sample = row.noise_limit * plant.ultimate_gain, plant.ultimate_period / 100
    found = pidalab.optimal.load(
        process(plant), row.order, ms=row.ms_limit, noise_gain=noise, sample_time=sample
    )
    return found.iae * plant.ultimate_gain / plant.ultimate_period


def stored(row: Any, plant: Any) -> float:
    """Return the IAE of the stored controller of a row, in units of the plant, infinite if it violates the Ms limit."""
    unit, period = plant.ultimate_gain, plant.ultimate_period
    gains = [row[f"k{k}"] * unit * period**k for k in range(-1, row["order"] + 1)]
    controller = pidalab.HighOrderPID(gains, row["filter_time"] * period, row["order"] + 1)
    loop = pidalab.Loop(process(plant), controller)
    if not pidalab.is_stable(loop) or pidalab.max_sensitivity(loop)[0] > row["ms_limit"] * (1 + DRIFT):
        return math.inf
    return load_iae(loop, plant)


def load_iae(loop: pidalab.Loop, plant: Any) -> float:
    """Return the IAE of a load step, in units of the plant."""
    response = simulate_until_settled(pidalab.load_response, loop, 24 * plant.ultimate_period)
    return response.iae(horizon=math.inf) * plant.ultimate_gain / plant.ultimate_period


def drift(share: float, searched: int, seed: int | None = None) -> str:
    """Compute a random share of the rows and a few optima again. Raise if one is wrong.

    An optimum is wrong if its stored controller has another IAE or violates the limit of Ms, or if a new search finds
    a smaller IAE. A search that ends at a larger IAE proves nothing. Without `seed` each run draws a new seed, which
    the error names.
    """
    drawn = int(np.random.SeedSequence(seed).generate_state(1)[0]) if seed is None else seed
    rng, plants = np.random.default_rng(drawn), tables.read("processes").set_index("plant")
    rules = _drawn(tables.read("comparison").query("terms == 'own' and iae_load > 0"), share, rng)
    optima = _drawn(tables.optima().query("iae > 0 and order > 0"), share, rng)
    for table, column, function in ((rules, "iae_load", rule), (optima, "iae", stored)):
        for _, row in table.iterrows():
            found = function(row, plants.loc[row["plant"]])
            if not math.isclose(row[column], found, rel_tol=DRIFT):
                raise _off(row["plant"], column, found, row[column], drawn)
    for _, row in optima.head(searched).iterrows():
        found = optimum(row, plants.loc[row["plant"]])
        if found < row["iae"] * (1 - DRIFT_OPTIMUM):
            raise _off(row["plant"], "iae", found, row["iae"], drawn)
    return (
        f"agree, drawn at random and computed anew: {len(rules)} rows of rules and {len(optima)} optima, "
        f"{share:.0%} of all; searched for again: {searched}"
    )


def _drawn(table: pd.DataFrame, share: float, rng: np.random.Generator) -> pd.DataFrame:
    """Return a random share of the rows, at least one."""
    return table.iloc[rng.permutation(len(table))[: math.ceil(share * len(table))]]


def _off(plant: str, column: str, found: float, kept: float, seed: int) -> AssertionError:
    return AssertionError(f"{plant}: {column} is {found:.6g}, stored {kept:.6g} (seed {seed})")
