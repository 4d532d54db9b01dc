"""An error of 1 to 2 % in responses, measures or Ms turns every chapter red that computes such a thing.

`make faults` plants more of them, and writes down what each chapter noticed first.
"""

import faults
import pytest


@pytest.mark.parametrize(
    "fault",
    ["output y of every response 1 % too high", "IAE, ITAE and ISE 1.5 % too high", "Ms 1 % too high"],
)
def test_every_chapter_notices(fault):
    seen = faults.planted(fault, faults.chapters())
    assert any(found["met"] for found in seen.values())
    assert [paper for paper, found in seen.items() if bool(found["red"]) != found["met"]] == []


def test_every_fault_can_be_planted(tmp_path):
    for fault in faults.FAULTS:
        for change in faults.FAULTS[fault]:
            name = change.partition(": ")[0]
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_bytes((faults.ROOT / "src" / "pidalab" / name).read_bytes())
        faults.plant(fault, tmp_path)


def test_numbers_that_differ():
    assert faults.differing("Ms 1.59 at 2", "Ms  1.61 at 2") == [("1.59", "1.61")]
    assert faults.differing("Ms 1.590 at 2", "Ms 1.59 at 2") == []
    assert faults.differing("Ms 1.59", "infinite") == []
