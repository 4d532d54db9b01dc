"""Read files in the formats of historians."""

import contextlib
import time
import tracemalloc
from datetime import datetime, timedelta

import numpy as np
import pytest

from pidalab import Record


def write(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "step.csv"
    path.write_bytes(text.encode(encoding))
    return path


def steps(k):
    """Return time, input and output of row k of a record with a step at 10."""
    return k, 40.0 if k < 10 else 47.0, 1020.0 + max(0, k - 12)


def lines(form="{},{},{}", count=40):
    return "\n".join(form.format(*steps(k)) for k in range(count))


def stamped(form, begin=datetime(2026, 3, 5, 11, 59, 40)):
    """Return rows with clock times."""
    moments = (begin + timedelta(seconds=k) for k in range(40))
    return "\n".join(f"{now:{form}},{steps(k)[1]},{steps(k)[2]}" for k, now in enumerate(moments))


LATE = datetime(2026, 3, 5, 23, 59, 40)


@pytest.mark.parametrize(
    ("text", "options"),
    [
        ("time,u,y\n" + lines(), {}),
        ("\ufefftime;valve;level\n" + lines("{};{};{}").replace(".", ","), {"u": "valve", "y": "level"}),
        (
            "by a historian\n\ntime\tVALVE [%]\tLevel [mm]\n" + lines("{}\t{}\t{}"),
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
def test_formats_of_historians(text, options, tmp_path):
    record = Record.read_csv(write(tmp_path, text), **options)
    assert record.t.tolist() == list(range(40))
    assert record.steps == ((10.0, 40.0, 47.0),)
    assert record.y[-1] == 1047.0


@pytest.mark.parametrize("order", ["%d/%m/%Y", "%m/%d/%Y", "%d.%m.%Y"])
def test_day_and_month_are_identified_by_midnight(order, tmp_path):
    path = write(tmp_path, "t,u,y\n" + stamped(f"{order} %H:%M:%S", LATE))
    assert Record.read_csv(path, time="t").t.tolist() == list(range(40))


def test_daylight_saving_leaves_no_gap(tmp_path, monkeypatch):
    """A record spans the night of the clock change in Berlin."""
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


def test_error_names_row_and_column(tmp_path):
    rows = ("time,u,y\n" + lines()).splitlines()
    rows[5] = "4,40,bad"
    assert Record.read_csv(write(tmp_path, "\n".join(rows))).t.size == 39
    rows[7] = "6,fourty,20"
    with pytest.raises(ValueError, match=r"row 8, column 'u': expected a number, found 'fourty'"):
        Record.read_csv(write(tmp_path, "\n".join(rows)))
    with pytest.raises(ValueError, match="no column 'valve'; its columns are 'time', 'u', 'y'"):
        Record.read_csv(write(tmp_path, "\n".join(rows)), u="valve")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("\n\n", "is empty"),
        ("a,b\nc,d\n", "has no row of numbers"),
        ("time,state\n1,open\n2,shut\n", "has no row of numbers"),
        ("1\n2\n3\n", "has no row of numbers in two columns or more among its first 50 lines"),
    ],
)
def test_file_without_numbers_is_refused(text, said, tmp_path):
    path = write(tmp_path, text)
    with pytest.raises(ValueError, match=f"{path.name} {said}"):
        Record.read_csv(path)


def test_changes_of_a_file_are_doubts(tmp_path):
    text = lines("2026-03-05 11:00:{:02},250,{},{}")
    doubts = Record.read_csv(write(tmp_path, text + "\nTotal 40")).doubts
    assert doubts[0].startswith("milliseconds after a comma")
    assert doubts[1] == "1 row(s) after the last row of numbers were left out: Total 40"


def test_columns_and_delimiters_are_checked(tmp_path):
    path = write(tmp_path, lines())
    with pytest.raises(ValueError, match="must be different columns, found time = 0, u = 2, y = 2"):
        Record.read_csv(path, u=2)
    with pytest.raises(ValueError, match=r"has no column 'u'; its columns are 3, without names"):
        Record.read_csv(path, u="u")
    for delimiter in ("([", "*", "(?P<", "\\"):
        with pytest.raises(ValueError, match=r"delimiter must be a character or a regular expression, found"):
            Record.read_csv(path, delimiter=delimiter)
    assert Record.read_csv(write(tmp_path, lines("{}¦{}¦{}")), delimiter="¦").t.size == 40
    head = ",".join("name " * 20 + str(k) for k in range(900))
    with pytest.raises(ValueError, match=r"has no column 'u'; its columns are .* and 850 more$") as refusal:
        Record.read_csv(write(tmp_path, head + "\n" + lines(",".join(["{}"] * 3) + ",1" * 897)), u="u")
    assert len(str(refusal.value)) < 5000


def test_outliers_are_named_by_row(tmp_path):
    rows = ("time,u,y\n" + lines(count=80)).splitlines()
    rows[60] = "59,47,-9999"
    path = write(tmp_path, "\n".join(rows))
    assert "far from its neighbours: row 61 (y = -9999)" in Record.read_csv(path).doubts
    dropped = Record.read_csv(path, outliers="drop")
    assert (dropped.t.size, dropped.outlier_note) == (79, "")
    assert "left out: far from its neighbours: row 61 (y = -9999)" in dropped.doubts


def step_lines(count=5000):
    """Return `count` rows of a first-order step response."""
    y = 20 + 7 * -np.expm1(-np.maximum(np.arange(count) - count // 10, 0) * 20 / count)
    return [f"{k},{40 if k < count // 10 else 47},{value:.4f}" for k, value in enumerate(y)]


@pytest.mark.parametrize("where", [0, 1, 2500, 5001])
@pytest.mark.parametrize(
    "line", ["," * 5000, '"' + "," * 5000, ",x" * 5000], ids=["commas", "quote", "words"]
)
def test_long_line_needs_little_memory(tmp_path, where, line):
    """Memory grows only with the file size. A table of 5,000 rows and 5,000 columns would fill gigabytes."""
    lines = ["t,u,y", *step_lines()]
    lines.insert(where, line)
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    tracemalloc.start()
    try:
        refusal = ""
        try:
            assert Record.read_csv(path, u="u" if where else 1, y="y" if where else 2, time=0).t.size == 5000
        except ValueError as found:
            refusal = str(found)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 60e6
    assert not refusal or (line != "," * 5000 and f"row {where + 1}" in refusal)


def test_too_long_line_is_refused(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["t,u,y", *step_lines(200), "x" * 140_000]), encoding="utf-8")
    with pytest.raises(ValueError, match=r"log\.csv, row 202, has 140000 characters.*at most 100000"):
        Record.read_csv(path)


# Each has about 100,000 characters, on which a quadratic search takes minutes.
LONG_ENTRIES = {
    "blanks in a row": "60,47,1" + " " * 99_000 + "x",
    "blanks in a time": "6" + " " * 99_000 + "a,47,1020",
    "blanks before a sign": "60,47,1" + " " * 99_000 + "%x",
    "signs": "60,47,1" + "°" * 49_000 + "x",
    "a quote over many lines": '60,47,"' + "x" * 90_000,
    "columns": "," * 99_000,
    "numbers": ",".join(["1"] * 49_000),
}


@pytest.mark.parametrize("line", LONG_ENTRIES.values(), ids=LONG_ENTRIES)
@pytest.mark.parametrize("head", ["", "t,u,y\n"])
def test_long_lines_are_fast(tmp_path, line, head):
    path = write(tmp_path, head + lines(count=60) + ("\n" + line) * 12)
    begun = time.process_time()
    with contextlib.suppress(ValueError):
        Record.read_csv(path)
    assert time.process_time() - begun < 10.0


def test_too_many_columns_are_refused(tmp_path):
    rows = "\n".join(",".join([str(k)] * 3000) for k in range(30))
    with pytest.raises(ValueError, match=r"step\.csv must have at most 2000 columns"):
        Record.read_csv(write(tmp_path, rows))


def test_ambiguous_decimals_are_refused(tmp_path):
    """With decimal commas, points separate thousands. Without its point, 57.5 would become 575."""
    rows = [f"{t:.1f};{u:.1f};{y:.1f}".replace(".", ",") for t, u, y in map(steps, range(300))]
    assert Record.read_csv(write(tmp_path, "\n".join(rows))).y[-1] == 1307.0
    grouped = [row.replace("1307,0", "1.307,0") for row in rows]
    assert Record.read_csv(write(tmp_path, "\n".join(grouped))).y[-1] == 1307.0
    rows[250] = rows[250].replace(",", ".")
    with pytest.raises(ValueError, match=r"row 251, column 0: .* with a decimal comma, found '250\.0'"):
        Record.read_csv(write(tmp_path, "\n".join(rows)))


def test_reading_time_is_linear(tmp_path):
    path = tmp_path / "log.csv"
    seconds = []
    for count in (2_000, 20_000, 200_000):
        path.write_text("\n".join(["t,u,y", *step_lines(count)]), encoding="utf-8")
        begun = time.process_time()
        assert Record.read_csv(path).t.size == count
        seconds.append(time.process_time() - begun)
    assert seconds[2] < 30 * seconds[1] + 1.0


@pytest.mark.parametrize(
    ("share", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds"), (1, "")]
)
def test_epoch_times_are_seconds(tmp_path, share, unit):
    rows = [f"{(1_700_000_000 + k) * int(share)},{u},{y}" for k, u, y in map(steps, range(60))]
    record = Record.read_csv(write(tmp_path, "\n".join(["stamp,u,y", *rows])))
    assert record.t == pytest.approx(np.arange(60.0))
    assert (record.time_unit, record.date) == ("s", "2023-11-14 22:13")
    assert any(f"{unit} since 1970" in doubt for doubt in record.doubts) is bool(unit)


@pytest.mark.parametrize(
    ("name", "unit"),
    [("t [ms]", "ms"), ("time_ms", "ms"), ("Time (min)", "min"), ("t", ""), ("terms", ""), ("time (s)", "")],
)
def test_unit_in_the_name_of_the_times(tmp_path, name, unit):
    rows = [f"{1000 * k},{u},{y}" for k, u, y in map(steps, range(60))]
    record = Record.read_csv(write(tmp_path, "\n".join([f"{name},u,y", *rows])))
    assert any(f"the times are in {unit}, by the name" in doubt for doubt in record.doubts) is bool(unit)


@pytest.mark.parametrize("columns", [{}, {"time": 1, "u": 2, "y": 0}], ids=["in order", "others"])
def test_several_traces_are_refused(tmp_path, columns):
    """A PLC writes a table with a head for each signal."""
    head = ["Variable; {}", "Address; 0", "Class; 14", "GraphColor; 4282811060", "Data; "]
    rows = [f"; {20 * k}; {value}" for k, value in enumerate([25.0] * 30 + [50.0] * 30)]
    text = "\n".join(
        line for name in ("Set point", "Speed") for line in [head[0].format(name), *head[1:], *rows]
    )
    with pytest.raises(
        ValueError, match=r"row 66: found words.*numbers again from row 71 on.*several traces"
    ):
        Record.read_csv(write(tmp_path, text), **columns)


@pytest.mark.parametrize(
    ("header", "doubted"),
    [("time,setpoint,u,y", ""), ("Time (s),SP,U [V],Y", ""), ("time,sp,co,pv", "u is column 'sp'")],
)
def test_columns_called_u_and_y_are_taken_by_default(tmp_path, header, doubted):
    """A set point in an earlier column is not taken for the input."""
    path = tmp_path / "log.csv"
    rows = [f"{k},{k // 20},{k // 30},{k / 7:.3f}" for k in range(60)]
    path.write_text("\n".join([header, *rows]))
    record = Record.read_csv(path)
    assert record.u[25] == (1 if doubted else 0)
    assert doubted in "".join(record.doubts)
