"""Files as historians write them; an error names the row."""

import time
from datetime import datetime, timedelta

import pytest

from pidalab import Record


def write(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "step.csv"
    path.write_bytes(text.encode(encoding))
    return path


def steps(k):
    """Time, input and output of the row k: a step at 10."""
    return k, 40.0 if k < 10 else 47.0, 1020.0 + max(0, k - 12)


def lines(form="{},{},{}", count=40):
    return "\n".join(form.format(*steps(k)) for k in range(count))


def stamped(form, begin=datetime(2026, 3, 5, 11, 59, 40)):
    """Rows with the times of a clock."""
    moments = (begin + timedelta(seconds=k) for k in range(40))
    return "\n".join(f"{now:{form}},{steps(k)[1]},{steps(k)[2]}" for k, now in enumerate(moments))


LATE = datetime(2026, 3, 5, 23, 59, 40)


@pytest.mark.parametrize(
    ("text", "options"),
    [
        ("time,u,y\n" + lines(), {}),
        ("\ufefftime;valve;level\n" + lines("{};{};{}").replace(".", ","), {"u": "valve", "y": "level"}),
        (
            "exported by a historian\n\ntime\tVALVE [%]\tLevel [mm]\n" + lines("{}\t{}\t{}"),
            {"u": "valve", "y": "level"},
        ),
        (stamped("%Y-%m-%dT%H:%M:%S"), {}),
        ("t,u,y\n" + stamped("%d.%m.%Y %H:%M:%S"), {"time": "t"}),
        ("t;u;y\n" + lines("2026-03-01 12:00:{:02d}.000;{:.0f},0;{:.0f},0"), {"time": "t"}),
        ("t,u,y\n" + stamped("%m/%d/%Y %I:%M:%S %p"), {"time": "t"}),
        ("t;u;y\n" + lines("01.03.2026 12:00:{:02d},000;{};{}"), {"time": "t"}),
        ("t,u,y\n" + stamped("%d-%b-%y %H:%M:%S"), {"time": "t"}),
        ("t,u,y\n" + stamped("%Y/%m/%d %H:%M:%S.0"), {"time": "t"}),
        ("t,u,y,status\n" + lines("{},{},{},Good"), {}),
        ("tag,t,u,y\n" + lines("FIC 7,{},{},{}"), {"time": "t", "u": "u", "y": "y"}),
        ("t,valve,level\ns,%,mm\n" + lines(), {"time": "t", "u": "valve", "y": "level"}),
        ("rate,1\ntime,u,y\n" + lines(), {}),
        ("t,u,y,u\n" + lines("{},{},{},1"), {"u": "u"}),  # the first of two
        (lines(" {} {}  {}"), {}),  # blanks, leading ones too
        (lines("{:.3E}\t{:.3E}\t{:.5E}"), {}),
        ("run = [\n" + lines(" {} {} {}") + "\n];", {}),
        (lines("[{} {} {}];"), {}),
        (lines("{}; {} %; {}"), {}),
        (lines('{},{},"{:,.1f}"'), {}),
        (lines("{};{};{:,.1f}"), {}),
        (lines() + "\n-----\nEnd log file\nTotal, 3", {}),
        ("a comment, with 3 commas, and more,\n" + lines(), {"skip": 1}),
        (lines("{}::{}::{}"), {"delimiter": "::"}),
        (lines("{} {} {}"), {"delimiter": r"\s+"}),
        ("u v\n" + lines("{1} {2}"), {"u": "u", "y": "v", "period": 1.0}),
        (stamped("%m/%d/%Y %I:%M:%S %p"), {}),
        (lines("2026-03-05 11:00:{:02},250,{},{}"), {}),
        (stamped("%H:%M:%S", LATE), {}),
    ],
)
def test_files_as_historians_write_them(text, options, tmp_path):
    record = Record.read_csv(write(tmp_path, text), **options)
    assert record.t.tolist() == list(range(40))
    assert record.steps == ((10.0, 40.0, 47.0),)
    assert record.y[-1] == 1047.0


@pytest.mark.parametrize("order", ["%d/%m/%Y", "%m/%d/%Y", "%d.%m.%Y"])
def test_day_and_month_are_told_apart_by_a_record_past_midnight(order, tmp_path):
    path = write(tmp_path, "t,u,y\n" + stamped(f"{order} %H:%M:%S", LATE))
    assert Record.read_csv(path, time="t").t.tolist() == list(range(40))


def test_a_clock_that_is_set_forward_leaves_no_gap(tmp_path, monkeypatch):
    """A record through the night in which the clocks of Berlin change, in a time without a change."""
    monkeypatch.setenv("TZ", "Europe/Berlin")
    time.tzset()
    text = "t,u,y\n" + "\n".join(
        f"2026-03-29 0{1 if k < 20 else 2}:{(40 + k) % 60:02d}:00,{u},{y}"
        for k, u, y in map(steps, range(40))
    )
    found = Record.read_csv(write(tmp_path, text), time="t").t
    monkeypatch.undo()
    time.tzset()
    assert found.tolist() == [60.0 * k for k in range(40)]


def test_an_offset_that_changes_with_the_clock_leaves_no_gap(tmp_path):
    text = "t,u,y\n" + "\n".join(
        f"2026-03-29T0{1 if k < 20 else 3}:{(40 + k) % 60:02d}:00+0{1 if k < 20 else 2}:00,{u},{y}"
        for k, u, y in map(steps, range(40))
    )
    assert Record.read_csv(write(tmp_path, text), time="t").t.tolist() == [60.0 * k for k in range(40)]


def test_an_error_names_the_row_and_words_for_missing_values_are_known(tmp_path):
    rows = ("time,u,y\n" + lines()).splitlines()
    rows[5] = "4,40,bad"
    assert Record.read_csv(write(tmp_path, "\n".join(rows))).t.size == 39
    rows[7] = "6,fourty,20"
    with pytest.raises(ValueError, match=r"row 8, column 1: expected a number, found 'fourty'"):
        Record.read_csv(write(tmp_path, "\n".join(rows)))
    with pytest.raises(ValueError, match="no column 'valve'; its columns are 'time', 'u', 'y'"):
        Record.read_csv(write(tmp_path, "\n".join(rows)), u="valve")


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


def test_utf_16(tmp_path):
    record = Record.read_csv(write(tmp_path, "Zeit\tu\tüber\n" + lines("{}\t{}\t{}"), "utf-16"), y="über")
    assert record.steps == ((10.0, 40.0, 47.0),)


def test_what_was_done_to_a_file_is_said(tmp_path):
    text = lines("2026-03-05 11:00:{:02},250,{},{}")
    doubts = Record.read_csv(write(tmp_path, text + "\nTotal 40")).doubts
    assert doubts[0].startswith("milliseconds after a comma")
    assert doubts[1] == "1 row(s) after the last row of numbers were left out: 'Total 40'"


def test_two_roles_on_one_column_are_refused(tmp_path):
    path = write(tmp_path, lines())
    with pytest.raises(
        ValueError, match="time, u and y must be different columns, found time = 0, u = 2, y = 2"
    ):
        Record.read_csv(path, u=2)
    with pytest.raises(ValueError, match=r"has no column 'u'; its columns are 3, without names"):
        Record.read_csv(path, u="u")


def test_an_output_as_time_is_refused_by_its_name(tmp_path):
    wave = "y,u\n" + "\n".join(f"{[3, 1, 4, 1, 5, 9, 2, 6][k % 8]},{steps(k)[1]}" for k in range(80))
    with pytest.raises(ValueError, match=r"step.csv \(time = 'y', u = 'u', y = 0\)|must be different"):
        Record.read_csv(write(tmp_path, wave), time="y", u="u", y=0)
    wide = "\n".join(f"{row},{k}" for k, row in enumerate(wave.splitlines()[1:]))
    with pytest.raises(
        ValueError, match=r"step.csv \(time = 0, u = 1, y = 2\): t is no time, or its clock was set"
    ):
        Record.read_csv(write(tmp_path, wide))


def test_a_wild_output_is_named_by_its_row_and_left_out_with_a_word(tmp_path):
    rows = ("time,u,y\n" + lines(count=80)).splitlines()
    rows[60] = "59,47,-9999"
    path = write(tmp_path, "\n".join(rows))
    assert "far from its neighbours: row 61 (y = -9999)" in Record.read_csv(path).doubts
    dropped = Record.read_csv(path, outliers="drop")
    assert (dropped.t.size, dropped.apart) == (79, "")
    assert "left out: row 61 (y = -9999)" in dropped.doubts
