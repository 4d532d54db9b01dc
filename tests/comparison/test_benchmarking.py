"""A rule of the user on the stored plants: the same judge as for the library's rules, wherever it is computed."""

import io

import pandas as pd
import pytest
from click.testing import CliRunner

import pidalab
from pidalab.comparison.benchmarking import stored
from pidalab.comparison.plants import batch
from pidalab.plant.cli import main
from pidalab.requirements import Requirements

DRIFT = 2e-3  # as on the page: the study follows noise to 1e-7 of its square, and stores five digits
PLANTS = ["P2 T=1", "P4 n=4", "P8 a=0.5"]


def mine(process):
    return pidalab.rules.classical.simc(process, "PI")


@pytest.fixture(scope="module")
def found():
    return pidalab.benchmark(mine, plants=PLANTS)


def test_a_rule_of_the_library_gets_its_stored_rows(found):
    """The stored table was made by the same judge, from another model of the plant only where the rule asks for one."""
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


def test_a_refusal_is_kept_and_counted(found):
    assert found.refusals().sum() == found.rows.query("terms == 'own'")["ms"].isna().sum()
    back = pd.read_csv(io.StringIO(found.csv()))["iae_load"].to_numpy()
    assert back == pytest.approx(found.rows["iae_load"].to_numpy(float), rel=1e-4, nan_ok=True)

    def picky(process):
        raise ValueError("not for me")

    assert pidalab.benchmark(picky, plants=PLANTS).refusals().to_dict() == {"not for me": 3}


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: pidalab.benchmark(3), TypeError, "rule.*int"),
        (lambda: pidalab.benchmark(mine, model="best"), ValueError, "model.*best"),
        (lambda: pidalab.benchmark(mine, plants=["P77"]), ValueError, "plants.*P77"),
        (lambda: pidalab.benchmark(mine, plants=PLANTS, executor=2), TypeError, "executor.*int"),
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

    def benchmark(name, *words):
        words = [f"{rule}:{name}", "--plant", PLANTS[0], "--workers", "1", *words]
        return CliRunner().invoke(main, ["benchmark", *words])

    result = benchmark("tune", "--out", str(tmp_path / "out"))
    assert result.exit_code == 0, result.output
    files = {path.suffix: path for path in (tmp_path / "out").iterdir()}
    assert sorted(files) == [".csv", ".svg", ".tex"]
    assert set(pd.read_csv(files[".csv"])["plant"]) == {PLANTS[0]}
    refused = benchmark("absent")
    assert refused.exit_code == 1
    assert "absent" in refused.output


def test_the_plants_are_those_of_the_stored_tables():
    """Each by the polynomials that were stored when its optima were found; names say the parameter."""
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
