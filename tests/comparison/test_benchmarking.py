"""Benchmark a user's rule on the stored plants, and recompute its tables and figure."""

import io

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

import pidalab
from pidalab.comparison.benchmarking import TABLES, judge, kind_of, stored
from pidalab.comparison.plants import batch
from pidalab.controllers import HighOrderPID
from pidalab.plant.cli import main
from pidalab.requirements import Requirements
from pidalab.rules import Design
from pidalab.rules.classical import simc

DRIFT = 2e-3  # the study computes noise to 1e-7 of its square, and stores five digits
PLANTS = ["P2 T=1", "P4 n=4", "P8 a=0.5"]
PLAIN = pidalab.lags(3, delay=1.0)


def without_zeros(process):
    """Tune the PI of SIMC for a process without zeros."""
    if process.num.size > 1:
        raise ValueError("no zeros")
    return simc(pidalab.reduction.to_fopdt(process).process, "PI")


@pytest.fixture(scope="module")
def benchmark():
    return pidalab.benchmark(without_zeros, "mi_ne", plants=PLANTS)


def test_a_rule_of_the_library_gets_its_stored_rows():
    """The study that stored the table measured the designs with the same function."""
    rule = pidalab.rules.registry.RULES["simc"]
    again = pidalab.benchmark(
        lambda p: rule.tune(p, "PI", Requirements(ms=1.4)), "simc", rule.models["PI"], PLANTS
    )
    old = stored("comparison").query("rule == 'simc' and kind == 'PI' and plant in @PLANTS")
    both = again.rows.merge(old, on=["plant", "terms"], suffixes=("", "_stored"))
    assert len(both) == 9
    for name in ("iae_load", "ms", "mks", "noise_gain", "factor"):
        new, stored_ones = both[name].to_numpy(float), both[f"{name}_stored"].to_numpy(float)
        assert new == pytest.approx(stored_ones, rel=DRIFT, nan_ok=True), name
    assert again.ranking().loc[("simc", "PI"), "plants"] > 90


def test_a_refusal_is_kept_and_counted(benchmark):
    assert benchmark.refusals().to_dict() == {"no zeros": 1}
    assert benchmark.rows.query("terms == 'own'")["ms"].isna().sum() == 1
    back = pd.read_csv(io.StringIO(benchmark.csv()))["iae_load"].to_numpy()
    assert back == pytest.approx(benchmark.rows["iae_load"].to_numpy(float), rel=1e-4, nan_ok=True)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: pidalab.benchmark(3), TypeError, "rule.*int"),
        (lambda: pidalab.benchmark(without_zeros, model="best"), ValueError, "model.*best"),
        (lambda: pidalab.benchmark(without_zeros, plants=["P77"]), ValueError, "plants.*P77"),
        (lambda: pidalab.benchmark(without_zeros, plants=PLANTS, executor=2), TypeError, "executor.*int"),
        (lambda: pidalab.benchmark(lambda p: 1.0, plants=PLANTS[:1]), TypeError, "rule.*float"),
    ],
)
def test_refusals(call, error, message):
    with pytest.raises(error, match=message):
        call()


def test_from_the_command_line(tmp_path):
    rule = tmp_path / "rule.py"
    text = "import pidalab\n\n\ndef tune(process):\n    return pidalab.rules.classical.simc(process, 'PI')\n"
    rule.write_text(text, encoding="utf-8")

    def run(name, *words):
        words = [f"{rule}:{name}", "--plant", PLANTS[0], "--workers", "1", *words]
        return CliRunner().invoke(main, ["benchmark", *words])

    result = run("tune", "--out", str(tmp_path / "out"))
    assert result.exit_code == 0, result.output
    files = {path.suffix: path for path in (tmp_path / "out").iterdir()}
    assert sorted(files) == [".csv", ".svg", ".tex"]
    assert set(pd.read_csv(files[".csv"])["plant"]) == {PLANTS[0]}
    refused = run("absent")
    assert refused.exit_code == 1
    assert "absent" in refused.output


def test_plants_match_the_stored_tables():
    """Each plant has the name and the polynomials that are stored with its optima."""
    table = stored("processes").set_index("plant")
    cases = list(batch())
    assert len(cases) == len({case.name for case in cases}) == 134
    assert [case.name for case in cases] == [name for name in table.index if name in {x.name for x in cases}]
    for case in cases:
        row = table.loc[case.name]
        assert row["family"] == case.family
        for side in ("num", "den"):
            expected = [float(x) for x in str(row[side]).split()]
            assert getattr(case.process, side) == pytest.approx(expected, rel=2e-5), case.name
        assert case.process.delay == pytest.approx(row["delay"], rel=2e-5)


@pytest.fixture(scope="module")
def expected(benchmark):
    """Return the IAE of all rules, divided by the least IAE of the kind and of all kinds, by plain dictionaries."""
    optima = pd.read_csv(TABLES / "optima.csv")
    others = pd.read_csv(TABLES / "comparison.csv")
    table = {}
    for terms, noise in (("loud", 1.5), ("quiet", 0.3)):
        least = {}
        for row in optima[(optima.ms_limit == 1.4) & (optima.noise_limit == noise)].itertuples():
            for key in ((row.plant, ("PI", "PID", "PIDA")[row.order]), (row.plant, "any")):
                least[key] = min(least.get(key, np.inf), row.iae)
        for rows, name in ((others, None), (benchmark.rows, "mi_ne")):
            for row in rows[(rows.terms == terms) & rows.iae_load.notna()].itertuples():
                if (row.plant, "any") in least:
                    shares = [row.iae_load / least.get((row.plant, k), np.nan) for k in (row.kind, "any")]
                    table.setdefault((terms, name or row.rule, row.kind), []).append(shares)
    return {key: np.array(shares) for key, shares in table.items()}


@pytest.mark.parametrize("terms", ["loud", "quiet"])
def test_ranking_matches_plain_dictionaries(benchmark, expected, terms):
    table = benchmark.ranking(terms)
    by_rule = {key[1:]: shares for key, shares in expected.items() if key[0] == terms}
    assert set(table.index) == set(by_rule)
    for key, shares in by_rule.items():
        row = table.loc[key].to_numpy(float)
        by_hand = [len(shares), np.nanmedian(shares[:, 0]), *np.quantile(shares[:, 1], (0.5, 0.9))]
        assert row == pytest.approx(by_hand), key
    assert table["of all"].is_monotonic_increasing
    assert table.loc[("mi_ne", "PI"), "plants"] == 2


@pytest.mark.parametrize("terms", ["loud", "quiet"])
def test_latex_table_has_the_numbers_of_the_ranking(benchmark, terms):
    table, lines = benchmark.ranking(terms), benchmark.latex(terms).splitlines()
    rows = [line.removesuffix(r" \\").split(" & ") for line in lines if line.endswith(r" \\")][1:]
    assert len(rows) == len(table)
    for cells, ((rule, kind), row) in zip(rows, table.iterrows(), strict=True):
        name = rule.replace("_", r"\_")
        assert cells[:2] == [rf"\textbf{{{name}}}" if rule == "mi_ne" else name, kind]
        assert [float(x) for x in cells[2:]] == pytest.approx(row.to_numpy(float), abs=0.0051)
    assert "%" not in rows[0][0]


def test_a_plant_in_other_units_has_the_same_rows():
    """The plant has 40 times the gain, and time in minutes."""
    other = pidalab.Process([40.0], np.array(PLAIN.den) * 60.0 ** np.arange(3.0, -1.0, -1.0), 60.0)
    rows = [
        list(judge("simc", "", lambda p=process: simc(p, "PI"), process, pidalab.noise_scale(process)))
        for process in (PLAIN, other)
    ]
    assert [row["terms"] for row in rows[0]] == ["own", "loud", "quiet"]
    for row, other in zip(*rows, strict=True):
        assert row.keys() == other.keys()
        for name, value in row.items():
            assert other[name] == (value if isinstance(value, str) else pytest.approx(value, rel=1e-4)), name


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
def test_kind_follows_the_highest_derivative(controller, kind):
    assert kind_of(Design(PLAIN, controller)) == kind
    assert kind_of(None) == ""


@pytest.mark.parametrize("terms", ["loud", "quiet"])
def test_figure_draws_quantiles_of_each_rule_best_first(benchmark, expected, terms):
    (axes,) = benchmark.plot(terms).axes
    labels = [label.get_text() for label in axes.get_yticklabels()]
    bars, medians = axes.get_lines()[::2], axes.get_lines()[1::2]
    shares = {f"{rule} PI": x[:, 1] for (t, rule, kind), x in expected.items() if (t, kind) == (terms, "PI")}
    assert set(labels) == set(shares)
    for label, bar, median in zip(labels, bars, medians, strict=True):
        low, middle, high = np.quantile(shares[label], (0.1, 0.5, 0.9))
        assert (*bar.get_xdata(), *median.get_xdata()) == pytest.approx((low, high, middle))
    assert np.all(np.diff([median.get_xdata()[0] for median in medians]) <= 0)  # the best is at the top
