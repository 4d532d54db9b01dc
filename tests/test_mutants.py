"""Mutants: every module has tests to face, and what survives is told from what is killed."""

from pathlib import Path

import mutants
import pytest

ALGEBRA = Path("algebra.py")
TEXT = (mutants.SRC / mutants.place_of(ALGEBRA)).read_text(encoding="utf-8")
SERIES = "tests/test_algebra.py::test_processes_in_series"  # divides nothing
SCALED = "tests/test_algebra.py::test_a_number_multiplies_the_gain_and_nothing_else"


def test_every_room_has_tests_that_face_its_mutants():
    modules = mutants.modules()
    assert {mutants.room_of(path) for path in modules} == set(mutants.ROOMS)
    doors = [path for path in modules if mutants.room_of(path).startswith(("plant/", "comparison", "paper"))]
    assert len(doors) > 20
    assert [path for path in doors if not mutants.tests_of(path)] == []
    assert [name for name in mutants.NO_JUDGES if not (mutants.TESTS / name).exists()] == []
    assert "tests/simulation/test_exact_oracle.py" in mutants.tests_of(Path("simulation/ladder.py"))
    assert mutants.tests_of(ALGEBRA) == ["tests/test_algebra.py"]
    assert "tests/test_response_oracle.py" in mutants.tests_of(Path("response.py"))
    assert "tests/plant/test_cli.py" in mutants.tests_of(Path("plant/cli/dialogue.py"))
    assert mutants.tests_of(Path("plant/safety.py")) == ["tests/plant/test_safety.py"]
    assert "tests/paperledger/test_rows.py" in mutants.tests_of(Path("paperledger/rows.py"))


def test_the_table_names_files_that_are():
    """The text of a place may change, and its row goes with the next sample; a file that moves takes its rows along."""
    files = {mutants.SRC / mutants.place_of(Path(row["module"])) for row in mutants.rows().values()}
    assert [path for path in files if not path.is_file()] == []


def test_places_are_drawn_outside_types_and_give_programs():
    pytest.importorskip("cosmic_ray", reason="no cosmic_ray: pip install cosmic-ray")
    found = [mutants.changed(ALGEBRA, name, some[0]) for name, some in mutants.places(ALGEBRA)]
    assert len(found) > 10
    for one in filter(None, found):
        assert one.text != TEXT
        assert mutants.exists(dict(zip(mutants.COLUMNS, one.key, strict=False)))
    haalman = Path("rules/haalman.py")
    drawn = (mutants.changed(haalman, name, some[0]) for name, some in mutants.places(haalman))
    assert not any("TYPE_CHECKING" in one.was for one in drawn if one)


def test_a_sample_can_be_of_some_modules_or_folders_alone():
    """Whole names count: plant/record is no beginning of plant/recorded."""
    assert mutants.chosen_modules([]) == mutants.modules()
    assert mutants.chosen_modules(["plant/safety"]) == [Path("plant/safety.py")]
    both = mutants.chosen_modules(["simulation/ring", "plant/cli"])
    assert Path("simulation/ring.py") in both
    assert {mutants.room_of(path) for path in both} == {"simulation", "plant/cli"}
    assert len(both) == 1 + len(mutants.chosen_modules(["plant/cli"]))
    for name in ("plant/saf", "plant/safety.py", "none"):
        with pytest.raises(SystemExit, match=f"no module or folder '{name}'"):
            mutants.chosen_modules([name])


def test_a_changed_copy_passes_what_does_not_see_the_change_and_fails_what_does(tmp_path, monkeypatch):
    (tmp_path / "pidalab").symlink_to(mutants.SRC / "pidalab")
    monkeypatch.setattr(mutants, "tests_of", lambda _: [SERIES])
    monkeypatch.setattr(mutants, "judges", lambda: [SERIES, SCALED])
    monkeypatch.setattr(mutants, "OPTIONS", f"{mutants.OPTIONS} --ignore-glob=*/pidalab/*")  # no doctests
    text = TEXT.replace("1 / divisor", "2 / divisor")
    mutant = mutants.Mutant(ALGEBRA, "", "1 / divisor", "2 / divisor", text)
    assert mutants.outcome(tmp_path, mutant, 100.0) == "killed elsewhere"


def test_what_a_survivor_meets_can_be_chosen(tmp_path, monkeypatch):
    """Here one test notices everything, and is not of the room."""
    monkeypatch.setattr(mutants, "tests_of", lambda _: [SERIES])
    monkeypatch.setattr(mutants, "judges", lambda: [SERIES, SCALED])
    monkeypatch.setattr(mutants, "run", lambda copy, tests, seconds: SCALED not in tests)
    (tmp_path / "pidalab").mkdir()
    mutant = mutants.Mutant(ALGEBRA, "", "a", "b", TEXT)
    found = [mutants.outcome(tmp_path, mutant, 1.0, others) for others in (None, [], [SERIES], [SCALED])]
    assert found == ["killed elsewhere", "survived", "survived", "killed elsewhere"]


def test_a_module_without_tests_of_its_own_is_not_killed_by_that(tmp_path):
    path = tmp_path / "empty.py"
    path.write_text("", encoding="utf-8")
    assert mutants.run(mutants.SRC, [str(path)], 60.0)
    path.write_text("1 / 0", encoding="utf-8")
    assert not mutants.run(mutants.SRC, [str(path)], 60.0)


def test_the_table_keeps_reasons_of_survivors(tmp_path, monkeypatch):
    monkeypatch.setattr(mutants, "TABLE", tmp_path / "mutants.csv")
    was = "return self._scaled(1 / divisor)"
    head = f"{','.join(mutants.COLUMNS)}\n"
    mutants.TABLE.write_text(
        f"{head}algebra.py,f,{was},a,survived,2026-11-22,the same number\n"
        f"algebra.py,f,{was},b,survived,2026-11-22,none\n"
        "algebra.py,f,this text is nowhere,c,killed,2026-11-22,\n",
        encoding="utf-8",
    )
    for becomes, result in (("a", "survived"), ("b", "killed elsewhere"), ("d", "survived")):
        mutants.store(("algebra.py", "f", was, becomes), result)
    rows = [(row["becomes"], row["outcome"], row["reason"]) for row in mutants.rows().values()]
    assert rows == [("a", "survived", "the same number"), ("b", "killed later", ""), ("d", "survived", "")]


def test_only_survivors_have_reasons():
    for row in mutants.rows().values():
        assert row["outcome"] in (mutants.KILLED, mutants.ELSEWHERE, mutants.LATER, mutants.SURVIVED)
        assert row["outcome"] == mutants.SURVIVED or not row["reason"]
