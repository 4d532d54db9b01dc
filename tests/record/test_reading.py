"""Files as historians write them; an error names the row."""

import time
from datetime import datetime, timedelta

import pytest

from pidalab import Record


def write(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "step.csv"
    path.write_bytes(text.encode(encoding))
    return path


def rows(mark=",", number=str, stamp=str, count=40):
    return "\n".join(
        mark.join([stamp(k), number(40.0 if k < 10 else 47.0), number(20.0 + max(0, k - 12))])
        for k in range(count)
    )


@pytest.mark.parametrize(
    ("text", "columns"),
    [
        ("time,u,y\n" + rows(), {}),
        (
            "\ufefftime;valve;level\n" + rows(";", lambda x: str(x).replace(".", ",")),
            {"u": "valve", "y": "level"},
        ),
        (
            "exported by a historian\n\ntime\tVALVE [%]\tLevel [mm]\n" + rows("\t"),
            {"u": "valve", "y": "level"},
        ),
        (rows(stamp=lambda k: f"2026-03-01T12:00:{k:02d}"), {}),
        ("t,u,y\n" + rows(stamp=lambda k: f"01.03.2026 12:00:{k:02d}"), {"time": "t"}),
        (
            "t;u;y\n"
            + rows(";", lambda x: str(x).replace(".", ","), lambda k: f"2026-03-01 12:00:{k:02d}.000"),
            {"time": "t"},
        ),
        ("t,u,y\n" + rows(stamp=lambda k: f"03/01/2026 02:10:{k:02d} PM"), {"time": "t"}),
        ("t;u;y\n" + rows(";", stamp=lambda k: f"01.03.2026 12:00:{k:02d},000"), {"time": "t"}),
        ("t,u,y\n" + rows(stamp=lambda k: f"01-Mar-26 12:00:{k:02d}"), {"time": "t"}),
        ("t,u,y\n" + rows(stamp=lambda k: f"2026/03/01 12:00:{k:02d}.0"), {"time": "t"}),
        ("t,u,y,status\n" + rows().replace("\n", ",Good\n") + ",Good", {}),
        (
            "tag,t,u,y\n" + "\n".join(f"FIC 7,{row}" for row in rows().split("\n")),
            {"time": "t", "u": "u", "y": "y"},
        ),
        ("t,valve,level\ns,%,mm\n" + rows(), {"time": "t", "u": "valve", "y": "level"}),
        ("rate,1\ntime,u,y\n" + rows(), {}),
        ("t,u,y,u\n" + rows().replace("\n", ",1\n") + ",1", {"u": "u"}),  # the first of two
    ],
)
def test_files_as_historians_write_them(text, columns, tmp_path):
    record = Record.read_csv(write(tmp_path, text), **columns)
    assert record.t.tolist() == list(range(40))
    assert record.steps == ((10.0, 40.0, 47.0),)


@pytest.mark.parametrize("order", ["%d/%m/%Y", "%m/%d/%Y", "%d.%m.%Y"])
def test_day_and_month_are_told_apart_by_a_record_past_midnight(order, tmp_path):
    def stamp(k):
        return f"{datetime(2026, 3, 5, 23, 59, 40) + timedelta(seconds=k):{order} %H:%M:%S}"

    assert Record.read_csv(write(tmp_path, "t,u,y\n" + rows(stamp=stamp)), time="t").t.tolist() == list(
        range(40)
    )


def test_a_clock_that_is_set_forward_leaves_no_gap(tmp_path, monkeypatch):
    """A record through the night in which the clocks of Berlin change, in a time without a change."""
    monkeypatch.setenv("TZ", "Europe/Berlin")
    time.tzset()
    text = "t,u,y\n" + rows(stamp=lambda k: f"2026-03-29 0{1 if k < 20 else 2}:{(40 + k) % 60:02d}:00")
    found = Record.read_csv(write(tmp_path, text), time="t").t
    monkeypatch.undo()
    time.tzset()
    assert found.tolist() == [60.0 * k for k in range(40)]


def test_an_error_names_the_row_and_words_for_missing_values_are_known(tmp_path):
    lines = ("time,u,y\n" + rows()).splitlines()
    lines[5] = "4,40,bad"
    assert Record.read_csv(write(tmp_path, "\n".join(lines))).t.size == 39
    lines[7] = "6,fourty,20"
    with pytest.raises(ValueError, match=r"row 8, column 1: expected a number, found 'fourty'"):
        Record.read_csv(write(tmp_path, "\n".join(lines)))
    with pytest.raises(ValueError, match="no column 'valve'; its columns are 'time', 'u', 'y'"):
        Record.read_csv(write(tmp_path, "\n".join(lines)), u="valve")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("\n\n", "is empty"),
        ("a,b\nc,d\n", "has no row of numbers"),
        ("time,state\n1,on\n2,off\n", "has no row of numbers"),
    ],
)
def test_a_file_without_a_record_is_named(text, said, tmp_path):
    path = write(tmp_path, text)
    with pytest.raises(ValueError, match=f"{path.name} {said}"):
        Record.read_csv(path)
