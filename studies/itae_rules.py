"""Evaluate the rules for second-order models over their range, and write book/data/itae_rules.csv.

Ms is computed on a grid of models. On models with a known optimum, four numbers are computed for every rule: the ITAE
divided by the least ITAE, Ms, and for a set-point step the overshoot in per cent and u(0+). The rules and the measures
are those of book/papers/heo2023.py. The study takes a minute on one core::

    python studies/itae_rules.py
"""

import csv
import math
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from tqdm import tqdm

from pidalab import NonInteractivePIDA
from pidalab.rules import itae

BOOK = Path(__file__).parents[1] / "book"
sys.path.insert(0, str(BOOK))
from papers import heo2023  # noqa: E402

DATA = BOOK / "data"
COLUMNS = ("role", "kind", "rule", "damping", "ratio", "itae", "ms", "overshoot", "kick")
BOUNDS = {"setpoint": math.inf, "load": 2.0}  # largest Ms of the optima with which the rules are compared


def on_grid() -> Iterator[tuple]:
    """Yield the rows of the grid, with Ms only."""
    grid = product(np.linspace(0.3, 2, 15).round(6), np.geomspace(0.1, 2, 15).round(6))
    for kind, rule, (xi, r) in product(heo2023.RULES, ("ITAE-2", "Table 1"), list(grid)):
        model = heo2023.unit(xi, r)
        cost, ms, *_ = heo2023.measures(model, heo2023.RULES[kind][rule](model), kind)
        yield "grid", kind, rule, xi, r, cost if math.isinf(cost) else math.nan, ms, math.nan, math.nan


def on_optima() -> Iterator[tuple]:
    """Yield the rows of the models with a known optimum."""
    optima = pd.read_csv(DATA / "itae_optima.csv").query("role in ('fit', 'validation')")
    for one in optima.itertuples():
        if one.ms_bound != BOUNDS[one.kind]:
            continue
        model = heo2023.unit(one.damping, one.ratio)
        tried = {name: rule(model) for name, rule in heo2023.RULES[one.kind].items()}
        tried["least"] = NonInteractivePIDA(one.kc, one.tau_i, one.tau_d, one.tau_a)
        if (one.role, one.kind) == ("fit", "setpoint"):
            pair = one.f_d, one.f_a
            tried["best factors"] = itae.pida_setpoint(model, factors=pair)
        for name, controller in tried.items():
            cost, *others = heo2023.measures(model, controller, one.kind)
            yield one.role, one.kind, name, one.damping, one.ratio, cost / one.itae, *others


def main() -> None:
    """Compute and write all rows, with eight digits."""
    rows = [*tqdm(on_grid(), total=900), *tqdm(on_optima())]
    with (DATA / "itae_rules.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows([f"{v:.8g}" if isinstance(v, float) else v for v in row] for row in rows)


if __name__ == "__main__":
    main()
