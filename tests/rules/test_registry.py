"""Check the registry: an entry makes a rule known to tune, compare, report and the command line."""

import csv

import numpy as np
import pytest
from click.testing import CliRunner

import pidalab
from pidalab.comparison import benchmarking, designs
from pidalab.controllers import PIDA
from pidalab.plant.cli import main
from pidalab.requirements import Requirements
from pidalab.rules import Design, registry
from pidalab.rules.registry import RULES, Rule, find

PLANT = pidalab.fopdt(1.0, lag=4.0, delay=1.0)


def test_a_new_entry_is_known_to_all_functions_and_commands(monkeypatch, tmp_path):
    def fixed(model, kind, limits):
        return Design(model, PIDA(0.5, 3.0), source="nobody (2026)")

    monkeypatch.setitem(RULES, "mine", Rule("mine", "nobody (2026)", {"PI": "process"}, fixed))
    design = pidalab.tune(PLANT, "PI", rule="mine")
    assert design.source == RULES["mine"].source
    (row,) = [row for row in pidalab.compare(PLANT, rules=["mine"]).rows if row.kind == "PI"]
    assert (row.rule, row.ms) == ("mine", pytest.approx(design.ms))
    assert pidalab.report(PLANT, rule="mine", kinds="PI").rows[0].ms == pytest.approx(design.ms)
    t = np.arange(0.0, 40.0, 0.25)
    y = 1 - np.exp(-np.maximum(t - 6.0, 0.0) / 4)  # the plant after a step at 5
    np.savetxt(
        tmp_path / "step.csv", np.column_stack([t, t >= 5.0, y]), delimiter=",", comments="", header="t,u,y"
    )
    plant = ["--den", "4,1", "--delay", "1"]
    record = [tmp_path / "step.csv", "--model", "fopdt", "--sample-time", "0.25", "--rule", "mine"]
    for command in (
        ["rules"],
        ["compare", *plant, "--rule", "mine"],
        ["tune", *record, "--kind", "PI"],
        ["report", *record],
    ):
        result = CliRunner().invoke(main, [str(word) for word in command])
        assert result.exit_code == 0, result.output
        assert "mine" in result.output or command[0] in ("tune", "report")
    assert "mine" in registry._table()


def test_the_default_comparison_is_that_of_the_book():
    with (benchmarking.TABLES / "comparison.csv").open(encoding="utf-8") as file:
        stored = {(row["rule"], row["kind"]) for row in csv.DictReader(file)}
    default = {
        (rule, kind) for rule, kind, _ in designs(PLANT, Requirements(noise_gain=10.0, sample_time=0.01))
    }
    assert default - stored == {("optimal", kind) for kind in registry.KINDS}
    assert stored <= default


@pytest.mark.parametrize("rule", RULES.values(), ids=lambda rule: rule.name)
def test_an_entry_names_the_source_of_its_designs(rule):
    """The entry names the paper. Tables and equations may depend on the kind."""
    for name, kind, make in designs(pidalab.lags(3, delay=1.0), Requirements(), [rule.name]):
        design = make()
        assert name == rule.name
        assert design.source.split(",")[0] in (
            rule.source.split(",")[0],
            f"pidalab.rules.{rule.name.replace(' ', '.')}: fitted to optima",
        )
        assert (design.controller.gains().ka != 0) == (kind == "PIDA")


@pytest.mark.parametrize("rule", RULES)
def test_rules_do_not_depend_on_units(rule):
    """Time, gain and sign of the process change. Filters and prefilter change with the controller."""
    process, s = pidalab.lags(3, delay=1.0), 1j * np.geomspace(0.05, 20.0, 20)
    other = pidalab.lags(3, lag=60.0, gain=-0.02, delay=60.0)
    for entry, scaled in zip(
        *(designs(plant, Requirements(), [rule]) for plant in (process, other)), strict=True
    ):
        expected = entry[2]().loop(process).transfer("u", "r", s)
        response = scaled[2]().loop(other).transfer("u", "r", s / 60)
        np.testing.assert_allclose(-0.02 * response, expected, rtol=1e-6)


def test_rules_are_found_by_any_spelling():
    assert find("ZIEGLER-NICHOLS") is RULES["Ziegler-Nichols ultimate"]
    assert (find("itae").name, find("direct").name) == ("itae load", "direct load")
