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
        assert set(paths) <= set(mutants.judges())
    assert mutants.tests_of(Path("simulation/ladder.py")) == mutants.tests_of(Path("simulation/exact.py"))
    assert "tests/simulation/test_exact_oracle.py" in mutants.tests_of(Path("simulation/ladder.py"))


def test_what_judges_no_mutant_is_there_and_left_out():
    assert [name for name in mutants.NO_JUDGES if not (mutants.TESTS / name).exists()] == []
    paths = mutants.judges()
    assert [path for path in paths if not (ROOT / path).is_file()] == []
    assert {"tests/test_cli.py", "tests/lab/test_model.py"} < set(paths)
    assert {Path(path).parts[1] for path in paths}.isdisjoint(mutants.NO_JUDGES)


def test_places_are_drawn_outside_types_and_give_programs():
    pytest.importorskip("cosmic_ray", reason="no cosmic_ray: pip install cosmic-ray")
    module = Path("algebra.py")
    text = (mutants.SRC / module).read_text()
    found = [mutants.changed(place, place.changes[0]) for place in mutants.places(module)]
    assert len(found) > 10
    for one in filter(None, found):
        assert one.text != text
        assert mutants.stands(dict(zip(mutants.COLUMNS, one.key, strict=False)))


def test_no_place_asks_whether_types_are_imported():
    pytest.importorskip("cosmic_ray", reason="no cosmic_ray: pip install cosmic-ray")
    module = Path("rules/haalman.py")
    lines = (mutants.SRC / module).read_text().splitlines()
    found = {lines[place.start[0] - 1].strip() for place in mutants.places(module)}
    assert "if TYPE_CHECKING:" in {line.strip() for line in lines}
    assert found
    assert "if TYPE_CHECKING:" not in found


SCALED = "tests/test_algebra.py::test_a_number_multiplies_the_gain_and_nothing_else"
SERIES = "tests/test_algebra.py::test_processes_in_series"  # divides nothing


def test_a_changed_copy_passes_what_does_not_see_the_change_and_fails_what_does(tmp_path, monkeypatch):
    (tmp_path / "pidalab").symlink_to(mutants.SRC)
    module = Path("algebra.py")
    monkeypatch.setattr(mutants, "tests_of", lambda _: [SERIES])
    monkeypatch.setattr(mutants, "doctests", lambda *_: [])
    text = (mutants.SRC / module).read_text().replace("1 / divisor", "2 / divisor")
    mutant = mutants.Mutant(module, "Block.__truediv__", "1 / divisor", "2 / divisor", text)
    assert mutants.outcome(tmp_path, {SCALED: 1.0, SERIES: 1.0}, mutant) == "killed elsewhere"


@pytest.mark.parametrize(("statement", "code"), [("bytearray(9)", 0), ("bytearray(9 * 10**9)", 1)])
def test_a_run_that_asks_for_too_much_memory_fails(tmp_path, statement, code):
    path = tmp_path / "test_greed.py"
    path.write_text(f"def test_greed():\n    {statement}\n")
    assert mutants.run(mutants.SRC.parent, [str(path)], 60.0) == code


def test_a_run_that_ends_without_a_failed_test_is_shown(tmp_path, capsys):
    """Its mutant counts as noticed; whether it was, a person has to see."""
    path = tmp_path / "test_end.py"
    path.write_text("import os\ndef test_end():\n    os._exit(1)\ndef test_fails():\n    assert False\n")
    assert mutants.run(mutants.SRC.parent, [str(path)], 60.0) == 1
    assert capsys.readouterr().out.startswith("status 1: ")
    assert mutants.run(mutants.SRC.parent, [f"{path}::test_fails"], 60.0) == 1
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("failing", "outcome"),
    [("algebra.py", "killed"), ("quick.py", "killed elsewhere"), ("pidalab", "killed elsewhere"), ("no", "survived")],
)  # fmt: skip
def test_all_others_are_asked_last_the_quick_ones_first(monkeypatch, failing, outcome):
    own, quick, slow = (f"tests/test_{name}.py" for name in ("algebra", "quick", "slow"))
    stages = [
        ([own, "--doctest-modules", "copy/pidalab/algebra.py"], 2 * mutants.PATIENCE + mutants.COMPILING),
        ([quick, slow, "--doctest-modules", "copy/pidalab"], 8 * mutants.PATIENCE + mutants.COMPILING),
    ]
    asked = []

    def run(source, paths, patience, *more):
        asked.append((paths, patience))
        if failing == "quick.py" and quick in paths:
            raise mutants.subprocess.TimeoutExpired("pytest", patience)  # it hangs
        return int(any(path.endswith(failing) for path in paths))

    monkeypatch.setattr(mutants, "run", run)
    seconds = {slow: 7.0, own: 2.0, quick: 1.0}
    assert mutants.judged(Path("copy"), seconds, Path("algebra.py")) == outcome
    assert asked == stages[: 1 if outcome == "killed" else 2]


def test_the_table_keeps_reasons_of_survivors_and_forgets_places_that_are_gone(tmp_path, monkeypatch):
    monkeypatch.setattr(mutants, "TABLE", tmp_path / "mutants.csv")
    same = {
        "module": "algebra.py",
        "function": "Block.__truediv__",
        "was": "return self._scaled(1 / divisor)",
    }

    def row(becomes, outcome, reason="", drawn="2026-11-22", **other):
        return same | {"becomes": becomes, "outcome": outcome, "drawn": drawn, "reason": reason} | other

    with mutants.TABLE.open("w", newline="") as file:
        writer = csv.DictWriter(file, mutants.COLUMNS)
        writer.writeheader()
        writer.writerows(
            [
                row("1.0 / divisor", "survived", "the same number"),
                row("a", "survived", "none"),
                row("b", "killed", was="this text is nowhere"),
                row("d", "killed"),
            ]
        )
    mutants.store(
        [
            row("1.0 / divisor", "survived", drawn="2026-11-23"),
            row("a", "killed elsewhere", drawn="2026-11-23"),
            row("c", "survived", drawn="2026-11-23"),
            row("e", "killed elsewhere", drawn="2026-11-23"),
        ]
    )
    assert [(one["becomes"], one["outcome"], one["drawn"][-2:], one["reason"]) for one in mutants.rows()] == [
        ("1.0 / divisor", "survived", "22", "the same number"),
        ("a", "killed later", "22", ""),
        ("c", "survived", "23", ""),
        ("d", "killed", "22", ""),
        ("e", "killed elsewhere", "23", ""),
    ]
    monkeypatch.setattr(evidence, "DATA", tmp_path)
    assert evidence.mutants().splitlines()[-1] == "| all | 5 | 1 | 1 | 1 | 1 | 1 | 25 % | 50 % |"
    assert evidence.samples().splitlines()[-2:] == [
        "| 2026-11-22 | 3 | 2 | 1 | 0 | 50 % | 50 % |",
        "| 2026-11-23 | 2 | 2 | 0 | 1 | 0 % | 50 % |",
    ]


def test_only_survivors_have_reasons():
    for row in mutants.rows():
        assert row["outcome"] in (mutants.KILLED, mutants.ELSEWHERE, mutants.LATER, mutants.SURVIVED)
        assert row["outcome"] == "survived" or not row["reason"]


def test_the_word_may_stand_behind_the_options(monkeypatch):
    seen = []
    monkeypatch.setattr(sys, "argv", ["mutants.py", "3", "--seed", "2", "simulation"])
    monkeypatch.setattr(mutants, "sample", lambda *given: seen.append(given) or sys.exit())
    with pytest.raises(SystemExit):
        mutants.main()
    assert seen == [(3, 2, "simulation")]
