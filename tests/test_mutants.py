"""Mutants: every module has tests to face, what survives is told from what is killed, and reasons stay."""

import csv
import importlib.util
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def loaded(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / "tools" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


mutants, evidence = loaded("mutants"), loaded("evidence")


def test_every_module_has_tests_that_face_its_mutants():
    modules = mutants.modules()
    assert {str(path.parts[0]).removesuffix(".py") for path in modules} == set(mutants.ROOMS)
    for module in modules:
        paths = mutants.tests_of(module)
        assert paths, module
        assert [path for path in paths if not (ROOT / path).is_file()] == []
    assert mutants.tests_of(Path("simulation/ladder.py")) == mutants.tests_of(Path("simulation/exact.py"))
    assert "tests/simulation/test_exact_oracle.py" in mutants.tests_of(Path("simulation/ladder.py"))


def test_places_are_drawn_outside_types_and_give_programs():
    pytest.importorskip("cosmic_ray")
    module = Path("algebra.py")
    text = (mutants.SRC / module).read_text()
    found = [mutants.changed(place, place.changes[0]) for place in mutants.places(module)]
    assert len(found) > 10
    for one in filter(None, found):
        assert one.text != text
        assert mutants.stands(dict(zip(mutants.COLUMNS, one.key, strict=False)))


@pytest.mark.parametrize(("becomes", "outcome"), [("1 / divisor", "survived"), ("2 / divisor", "killed")])
def test_a_changed_copy_meets_the_tests(tmp_path, monkeypatch, becomes, outcome):
    (tmp_path / "pidalab").symlink_to(mutants.SRC)
    module = Path("algebra.py")
    test = "tests/test_algebra.py::test_a_number_multiplies_the_gain_and_nothing_else"
    monkeypatch.setattr(mutants, "tests_of", lambda _: [test])
    text = (mutants.SRC / module).read_text().replace("1 / divisor", becomes)
    mutant = mutants.Mutant(module, "Block.__truediv__", "1 / divisor", becomes, text)
    assert mutants.outcome(tmp_path, {test: 1.0}, mutant) == outcome


def test_the_table_keeps_reasons_of_survivors_and_forgets_places_that_are_gone(tmp_path, monkeypatch):
    monkeypatch.setattr(mutants, "TABLE", tmp_path / "mutants.csv")
    same = {
        "module": "algebra.py",
        "function": "Block.__truediv__",
        "was": "return self._scaled(1 / divisor)",
    }

    def row(becomes, outcome, reason="", **other):
        return same | {"becomes": becomes, "outcome": outcome, "reason": reason} | other

    with mutants.TABLE.open("w", newline="") as file:
        writer = csv.DictWriter(file, mutants.COLUMNS)
        writer.writeheader()
        writer.writerows(
            [
                row("1.0 / divisor", "survived", "the same number"),
                row("a", "survived", "none"),
                row("b", "killed", was="this text is nowhere"),
            ]
        )
    mutants.store([row("1.0 / divisor", "survived"), row("a", "killed"), row("c", "survived")])
    assert [(one["becomes"], one["outcome"], one["reason"]) for one in mutants.rows()] == [
        ("1.0 / divisor", "survived", "the same number"),
        ("a", "killed later", ""),
        ("c", "survived", ""),
    ]
    monkeypatch.setattr(evidence, "DATA", tmp_path)
    assert evidence.mutants().splitlines()[-1] == "| all | 3 | 0 | 1 | 1 | 1 | 0 % |"


def test_only_survivors_have_reasons():
    for row in mutants.rows():
        assert row["outcome"] in ("killed", mutants.LATER, "survived")
        assert row["outcome"] == "survived" or not row["reason"]


def test_the_word_may_stand_behind_the_options(monkeypatch):
    seen = []
    monkeypatch.setattr(sys, "argv", ["mutants.py", "3", "--seed", "2", "simulation"])
    monkeypatch.setattr(mutants, "sample", lambda *given: seen.append(given) or sys.exit())
    with pytest.raises(SystemExit):
        mutants.main()
    assert seen == [(3, 2, "simulation")]
