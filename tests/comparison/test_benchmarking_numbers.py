"""A benchmark in other units of a plant, and its ranking, table, figure and text recomputed from the rows."""

import numpy as np
import pandas as pd
import pytest

import pidalab
from pidalab.comparison.benchmarking import (
    TABLES,
    judge,
    kind_of,
)
from pidalab.controllers import HighOrderPID
from pidalab.rules import Design
from pidalab.rules.classical import simc

PLANTS = ["P2 T=1", "P4 n=4", "P8 a=0.5"]
QUANTILES = (0.1, 0.5, 0.9)
PLAIN = pidalab.lags(3, delay=1.0)


def mine(process):
    if process.num.size > 1:
        raise ValueError("no zeros")
    return simc(pidalab.reduction.to_fopdt(process).process, "PI")


@pytest.fixture(scope="module")
def found():
    return pidalab.benchmark(mine, "mi_ne", plants=PLANTS)


@pytest.fixture(scope="module")
def expected(found):
    """IAE over the least of a kind and of all, of this rule and of all others, by plain dictionaries."""
    optima = pd.read_csv(TABLES / "optima.csv")
    others = pd.read_csv(TABLES / "comparison.csv")
    table = {}
    for terms, noise in (("loud", 1.5), ("quiet", 0.3)):
        least = {}
        for row in optima[(optima.ms_limit == 1.4) & (optima.noise_limit == noise)].itertuples():
            for key in ((row.plant, ("PI", "PID", "PIDA")[row.order]), (row.plant, "any")):
                least[key] = min(least.get(key, np.inf), row.iae)
        for rows, name in ((others, None), (found.rows, "mi_ne")):
            for row in rows[(rows.terms == terms) & rows.iae_load.notna()].itertuples():
                if (row.plant, "any") in least:
                    shares = [row.iae_load / least.get((row.plant, one), np.nan) for one in (row.kind, "any")]
                    table.setdefault((terms, name or row.rule, row.kind), []).append(shares)
    return {key: np.array(shares) for key, shares in table.items()}


@pytest.mark.parametrize("terms", ["loud", "quiet"])
def test_the_ranking_by_hand(found, expected, terms):
    table = found.ranking(terms)
    own = {key[1:]: shares for key, shares in expected.items() if key[0] == terms}
    assert set(table.index) == set(own)
    for key, shares in own.items():
        row = table.loc[key].to_numpy(float)
        by_hand = [len(shares), np.nanmedian(shares[:, 0]), *np.quantile(shares[:, 1], (0.5, 0.9))]
        assert row == pytest.approx(by_hand), key
    assert table["of all"].is_monotonic_increasing
    assert table.loc[("mi_ne", "PI"), "plants"] == 2


@pytest.mark.parametrize("terms", ["loud", "quiet"])
def test_the_table_for_a_paper_has_the_numbers_of_the_ranking(found, terms):
    table, lines = found.ranking(terms), found.latex(terms).splitlines()
    rows = [line.removesuffix(r" \\").split(" & ") for line in lines if line.endswith(r" \\")][1:]
    assert len(rows) == len(table)
    for cells, ((rule, kind), row) in zip(rows, table.iterrows(), strict=True):
        name = rule.replace("_", r"\_")
        assert cells[:2] == [rf"\textbf{{{name}}}" if rule == "mi_ne" else name, kind]
        assert [float(x) for x in cells[2:]] == pytest.approx(row.to_numpy(float), abs=0.0051)
    assert "%" not in rows[0][0]


def test_a_plant_in_other_units_has_the_same_rows():
    """A gain of 40, and minutes in place of seconds."""
    other = pidalab.Process([40.0], np.array(PLAIN.den) * 60.0 ** np.arange(3.0, -1.0, -1.0), 60.0)
    rows = [
        list(judge("simc", "", lambda p=process: simc(p, "PI"), process, pidalab.noise_scale(process)))
        for process in (PLAIN, other)
    ]
    assert [row["terms"] for row in rows[0]] == ["own", "loud", "quiet"]
    for one, two in zip(*rows, strict=True):
        assert one.keys() == two.keys()
        for name, value in one.items():
            assert two[name] == (value if isinstance(value, str) else pytest.approx(value, rel=1e-4)), name


@pytest.mark.parametrize(
    ("controller", "kind"),
    [
        (pidalab.PIDA(1.0, 2.0), "PI"),
        (pidalab.PIDA(1.0, 2.0, 0.5), "PID"),
        (pidalab.PIDA(1.0, 2.0, 0.5, 0.1), "PIDA"),
        (HighOrderPID([1.0, 1.0, 1.0, 1.0, 1.0], 0.1, 4), ""),
        (HighOrderPID([1.0, 0.0], 0.1, 1), "PI"),
    ],
)
def test_a_kind_is_read_off_the_highest_derivative(controller, kind):
    assert kind_of(Design(PLAIN, controller)) == kind
    assert kind_of(None) == ""


@pytest.mark.parametrize("terms", ["loud", "quiet"])
def test_figure_draws_quantiles_of_each_rule_best_first(found, expected, terms):
    (axes,) = found.plot(terms).axes
    labels = [label.get_text() for label in axes.get_yticklabels()]
    bars, medians = axes.get_lines()[::2], axes.get_lines()[1::2]
    own = {f"{key[1]} {key[2]}": x[:, 1] for key, x in expected.items() if (key[0], key[2]) == (terms, "PI")}
    assert set(labels) == set(own)
    for label, bar, median in zip(labels, bars, medians, strict=True):
        low, middle, high = np.quantile(own[label], (0.1, 0.5, 0.9))
        assert (*bar.get_xdata(), *median.get_xdata()) == pytest.approx((low, high, middle))
    assert np.all(np.diff([median.get_xdata()[0] for median in medians]) <= 0)  # the best is at the top
