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


def steps(k):
    """Time, input and output of the row k: a step at 10."""
    return k, 40.0 if k < 10 else 47.0, 1020.0 + max(0, k - 12)


def lines(form, count=40):
    return "\n".join(form.format(*steps(k)) for k in range(count))


def minutes(k):
    return f"{datetime(2026, 3, 5, 11, 59, 40) + timedelta(seconds=k):%m/%d/%Y %I:%M:%S %p}"


@pytest.mark.parametrize(
    ("text", "options"),
    [
        (lines(" {} {}  {}"), {}),  # blanks, leading ones too
        (lines("{:.3E}\t{:.3E}\t{:.5E}"), {}),
        ("run = [\n" + lines(" {} {} {}") + "\n];", {}),
        (lines("[{} {} {}];"), {}),
        (lines("{}; {} %; {}"), {}),
        (lines('{},{},"{:,.1f}"'), {}),
        (lines("{};{};{:,.1f}"), {}),
        (lines("{},{},{}") + "\n-----\nEnd log file\nTotal, 3", {}),
        ("a comment, with 3 commas, and more,\n" + lines("{},{},{}"), {"skip": 1}),
        (lines("{}::{}::{}"), {"delimiter": "::"}),
        (lines("{} {} {}"), {"delimiter": r"\s+"}),
        ("u v\n" + "\n".join(f"{steps(k)[1]} {steps(k)[2]}" for k in range(40)), {"u": "u", "y": "v", "period": 1.0}),
        ("\n".join(f"{minutes(k)},{steps(k)[1]},{steps(k)[2]}" for k in range(40)), {}),
        ("\n".join(f"2026-03-05 11:00:{k:02},250,{steps(k)[1]},{steps(k)[2]}" for k in range(40)), {}),
        ("\n".join(f"{datetime(2026, 3, 5, 23, 59, 40) + timedelta(seconds=k):%H:%M:%S},{steps(k)[1]},{steps(k)[2]}"
                   for k in range(40)), {}),
    ],
)  # fmt: skip
def test_files_that_hold_a_trap(text, options, tmp_path):
    record = Record.read_csv(write(tmp_path, text), **options)
    assert record.t.tolist() == list(range(40))
    assert record.steps == ((10.0, 40.0, 47.0),)
    assert record.y[-1] == 1047.0


def test_utf_16(tmp_path):
    record = Record.read_csv(write(tmp_path, "Zeit\tu\tüber\n" + lines("{}\t{}\t{}"), "utf-16"), y="über")
    assert record.steps == ((10.0, 40.0, 47.0),)


def test_what_was_done_to_a_file_is_said(tmp_path):
    text = "\n".join(f"2026-03-05 11:00:{k:02},250,{steps(k)[1]},{steps(k)[2]}" for k in range(40))
    doubts = Record.read_csv(write(tmp_path, text + "\nTotal 40")).doubts
    assert doubts[0].startswith("milliseconds after a comma")
    assert doubts[1] == "1 row(s) after the last row of numbers were left out: 'Total 40'"


def test_two_roles_on_one_column_are_refused(tmp_path):
    path = write(tmp_path, lines("{},{},{}"))
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
    rows = ("time,u,y\n" + lines("{},{},{}", 80)).splitlines()
    rows[60] = "59,47,-9999"
    path = write(tmp_path, "\n".join(rows))
    assert "far from its neighbours: row 61 (y = -9999)" in Record.read_csv(path).doubts
    dropped = Record.read_csv(path, outliers="drop")
    assert (dropped.t.size, dropped.apart) == (79, "")
    assert "left out: row 61 (y = -9999)" in dropped.doubts
