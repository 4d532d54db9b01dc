"""An error of 1.5 % in a measure turns a chapter red that computes such a thing.

`make faults` plants gross errors in every part and shows what each chapter noticed first; that every number moves with
the library, on every page, is for `make shake`.
"""

import faults


def test_a_chapter_notices():
    chapters = {"haalman2024": faults.chapters()["haalman2024"]}
    assert faults.planted("IAE, ITAE and ISE 1.5 % too high", chapters)["haalman2024"]["red"]


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
