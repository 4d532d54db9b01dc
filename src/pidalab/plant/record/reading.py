"""Read columns of a text file as numbers. Errors name the row and the remedy."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab._text import plain_text

MISSING = {"", "-", "?", "nan", "na", "n/a", "#n/a", "null", "none", "unavailable", "unknown"}
MISSING |= {"bad", "bad input", "no data", "i/o timeout"}
STATES = {"true": 1.0, "false": 0.0, "on": 1.0, "off": 0.0}
BRACKETS = " \t[]{}();'\""
# This matches the beginning of a date or a time of day.
STAMP = re.compile(r"(\d{1,4}[-/.]\w{1,9}[-/.]\d{1,4}([T ]\d|$)|\d{1,2}:\d\d)")
GROUPED = re.compile(r"[-+]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?")  # commas separate thousands
BLANKS = re.compile(r"[-+]?[1-9]\d{0,2}([ '\u00a0\u202f]\d{3})+([.,]\d*)?")  # blanks separate thousands
# In a number with a decimal comma, points may only separate thousands.
WITH_COMMA = re.compile(r"[^.]*|[-+]?[1-9]\d{0,2}(\.\d{3})+(,\d*)?")
# A per cent or degree sign after a number. The pattern leaves out blanks before the sign, since matching them is slow.
SIGN = re.compile(r"(%|°\s{0,9}[CF]?)$")

DELIMITERS = (";", "\t", ",", "|", r"\s+")
DATES = ("%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%Y/%m/%d", "%Y-%m-%d", "%d-%b-%Y", "%d-%b-%y", "")
CLOCKS = ("%H:%M:%S.%f", "%H:%M", "%I:%M:%S.%f %p", "%I:%M %p")
STAMPS = ("ISO8601", *(f"{date} {clock}".strip() for date in DATES for clock in CLOCKS))
DAY = 86400.0  # seconds
# Units of time, and their number in a second, in the order in which they are tried. If the largest time exceeds 1e8 s
# (the year 1973) in a unit, the times are assumed to count from 1970 in this unit. For seconds, the smallest time must
# also exceed 1e8 s, and the column must not name another unit.
EPOCHS = {"nanoseconds": 1e9, "microseconds": 1e6, "milliseconds": 1e3, "s": 1.0}
UNIT = re.compile(
    r"(?:^|[\W_])(?:(s|sec|secs|seconds?)|(ms|msec|millis|milliseconds?|us|µs|ns|min|minutes?|hours?|h))\W*$",
    re.IGNORECASE,
)
QUOTED = 60  # largest number of characters of the file that a message quotes
# Number of lines from which the format is detected, and largest number of column names that a message lists.
SAMPLE = 50
LONGEST_ROW, MOST_COLUMNS = 100_000, 2000  # most characters in a row, and most columns in a file


# Column of each role, which is used if the header has no column with the name of the role, or several.
PLACES = {"time": 0, "u": 1, "y": 2}


class Columns(NamedTuple):
    """Columns of a file as numbers, with nan for missing values.

    `rows` are the row numbers in the file, from 1, and `places` are the column numbers, from 0. `date` is the date of
    the first sample. `time_unit` and `date` are empty if unknown.
    """

    values: tuple[Array, ...]
    rows: Array
    names: tuple[str, ...]
    places: tuple[int, ...]
    doubts: tuple[str, ...]
    time_unit: str = ""
    date: str = ""


def read_columns(
    path: Path, wanted: Mapping[str, str | int | None], delimiter: str | None = None, skip: int = 0
) -> Columns:
    """Read columns of a delimited text file.

    Parameters
    ----------
    path : pathlib.Path
        The file in UTF-8 or UTF-16, with or without a byte order mark, or in Latin-1.
    wanted : mapping of str to str, int or None
        The keys are the roles "time", "u" and "y". Each value is the name of a column in the header, or its number from
        0. If the value is None, the column named like the role is used. If no column or several columns have this name,
        column 0 (time), 1 (u) or 2 (y) is used. If the file has more than three columns, an entry of `doubts` then
        names the assumed column.
    delimiter : str or None
        Text between the columns. A text of several characters is a regular expression. If None, the delimiter is
        detected.
    skip : int
        Number of lines to skip at the beginning.

    Returns
    -------
    Columns

    Raises
    ------
    ValueError
        If the file is empty or is not a table, if a wanted column is missing, or if an entry is neither a number nor a
        word for a missing value.
    """
    try:
        re.compile(delimiter or "")
    except re.error as refusal:
        said = f"delimiter must be a character or a regular expression, found {delimiter!r}: {refusal}"
        raise ValueError(said) from None
    lines = _lines(path)[skip:]
    if not any(line.strip() for line in lines):
        raise ValueError(f"{path.name} is empty")
    longest = max(range(len(lines)), key=lambda row: len(lines[row]))
    if len(lines[longest]) > LONGEST_ROW:
        raise ValueError(
            f"{path.name}, row {longest + 1 + skip}, has {len(lines[longest])} characters, and at most "
            f"{LONGEST_ROW} are allowed: is the file a table with one line for each sample?"
        )
    doubts: list[str] = []
    mark = delimiter or max(DELIMITERS, key=lambda mark: _numbered(lines, mark))
    joined = [re.sub(r"(:\d\d),(\d{3})(?=,)", r"\1.\2", line) if ":" in line else line for line in lines]
    if mark == "," and joined != lines:
        doubts.append("milliseconds after a comma were read as part of the time before the comma")
        lines = joined
    rows = [_split(line, mark) for line in lines]
    if sorted(map(len, rows))[len(rows) // 2] > MOST_COLUMNS:
        raise ValueError(
            f"{path.name} must have at most {MOST_COLUMNS} columns, found more, separated by {mark!r}: "
            "copy the columns of time, input and output into a file of their own"
        )
    header, first = _header(lines, rows, wanted.values(), mark, path)
    width = max(map(len, [header, *rows[first : first + SAMPLE]]))
    header = header + [""] * (width - len(header))
    places = [_place(role, name, header, path) for role, name in wanted.items()]
    guessed = [
        f"{role} is column {header[place] or place!r}"
        for (role, name), place in zip(wanted.items(), places, strict=True)
        if name is None and place not in _places(role, header)
    ]
    if guessed and (count := sum(map(bool, header)) or width) > len(PLACES):
        doubts.append(f"{', '.join(guessed)}: assumed, since not specified; the file has {count} columns")
    numbers = np.array([k for k in range(first, len(rows)) if any(rows[k])])
    entries = [[rows[k][place] if place < len(rows[k]) else "" for k in numbers] for place in places]
    comma = mark != "," and _has_decimal_commas(entries)
    columns = [_numbers(column, comma) for column in entries]
    names, timed, time_unit, date = tuple(header[place] for place in places), "time" in wanted, "", ""
    if timed:
        columns[0], time_unit, date = _clock(entries[0], columns[0], names[0], doubts)
    if any(entry.lower() in STATES for column in entries for entry in column[:SAMPLE]):
        doubts.append("true or on was read as 1, false or off as 0")
    good = ~np.any([wrong for _, wrong in columns], axis=0)
    end = int(np.flatnonzero(good)[-1]) + 1 if good.any() else numbers.size
    if end < numbers.size:
        doubts.append(
            f"{numbers.size - end} row(s) after the last row of numbers were left out: "
            f"{plain_text(lines[numbers[end]], QUOTED)}"
        )
    row = numbers + 1 + skip
    for place, column, (_, wrong) in zip(places, entries, columns, strict=True):
        if not wrong[:end].any():
            continue
        k = int(np.argmax(wrong))
        where, again = f"{path.name}, row {row[k]}", k + int(np.argmax(good[k:]))
        if again > k + 1:
            raise ValueError(
                f"{where}: found words, such as {column[k][:QUOTED]!r}, and numbers again from row {row[again]} on. "
                "The file has several traces, one below the other: put them side by side, with one column of times, or "
                "keep only the part that has time, input and output"
            )
        kind = "a number or a date" if timed and column is entries[0] else "a number"
        raise ValueError(
            f"{where}, column {header[place] or place!r}: expected {kind}{' with a decimal comma' * comma}, found "
            f"{column[k][:QUOTED]!r}; correct it, or leave it empty if the value is missing"
        )
    values = tuple(values[:end] for values, _ in columns)
    return Columns(values, row[:end], names, tuple(places), tuple(doubts), time_unit, date)


def _lines(path: Path) -> list[str]:
    raw = path.read_bytes()
    wide = raw[:2] in (b"\xff\xfe", b"\xfe\xff")
    try:
        return raw.decode("utf-16" if wide else "utf-8-sig").splitlines()
    except UnicodeDecodeError:
        return raw.decode("latin-1").splitlines()


def _split(line: str, mark: str) -> list[str]:
    """Return the entries of a line without surrounding blanks. A quote that is not closed ends with the line."""
    if mark == r"\s+":
        line = line.strip()
        # Remove brackets only at the ends of a line, where an exported matrix has them.
        bracketed = line[:1] in "[({" or line[-1:] in "])};"
        return (line.strip(BRACKETS) if bracketed else line).split(None, MOST_COLUMNS)
    if len(mark) > 1:
        return [entry.strip() for entry in re.split(mark, line.strip(), maxsplit=MOST_COLUMNS)]
    if '"' in line:
        return [entry.strip() for entry in next(csv.reader([line], delimiter=mark, skipinitialspace=True))]
    return [entry.strip() for entry in line.split(mark, MOST_COLUMNS)]


def bare(entry: str) -> str:
    """Remove blanks, brackets and quotes around an entry, and a per cent or degree sign at its end."""
    return SIGN.sub("", entry.strip(BRACKETS)).rstrip()


def number(entry: str, comma: bool = False) -> float:
    """Convert an entry to a number, or to nan if it is not a number."""
    text = bare(entry)
    if text.lower() in STATES:
        return STATES[text.lower()]
    if BLANKS.fullmatch(text):
        text = re.sub(r"[ '\u00a0\u202f]", "", text)
    if comma:
        text = text.replace(".", "").replace(",", ".") if WITH_COMMA.fullmatch(text) else ""
    elif GROUPED.fullmatch(text):
        text = text.replace(",", "")
    try:
        value = math.nan if "_" in text else float(text)
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


def _either(entry: str) -> float:
    """Convert an entry with a decimal point or comma to a number, or to nan if it is not a number."""
    value = number(entry)
    return value if math.isfinite(value) else number(entry, comma=True)


def is_value(entry: str) -> bool:
    """Return True for a number, a date, or a word for a missing value."""
    text = bare(entry) or entry.strip()
    return text.lower() in MISSING or STAMP.match(text) is not None or not math.isnan(_either(text))


def _numbers(entries: Sequence[str], comma: bool) -> tuple[Array, Array]:
    """Convert entries to numbers, with nan for missing values. Also mark the entries that are neither."""
    values = np.array([number(entry, comma) for entry in entries], dtype=float)
    wrong = [
        math.isnan(value) and bare(x).lower() not in MISSING for x, value in zip(entries, values, strict=True)
    ]
    return values, np.array(wrong, dtype=bool)


def _numbered(lines: Sequence[str], mark: str) -> float:
    """Rate a delimiter by the last rows of the file: number of numeric columns, times their share of all columns."""
    rows = [_split(line, mark) for line in [line for line in lines if line.strip()][-SAMPLE:]]
    half = sorted(map(len, rows), reverse=True)[len(rows) // 2]  # median number of columns
    counts = [sum(k < len(row) and is_value(row[k]) for row in rows) for k in range(half)]
    return sum(2 * count > len(rows) for count in counts) ** 2 / max(1, *map(len, rows))


def _header(
    lines: Sequence[str], rows: Sequence[Sequence[str]], wanted: Iterable[Any], mark: str, path: Path
) -> tuple[list[str], int]:
    """Return the names of the columns, and the index of the first row of data."""
    last = [row for row in rows if any(row)][-SAMPLE:]
    columns = []  # columns of numbers
    for k in range(max(map(len, last))):
        entries = [row[k] for row in last if k < len(row) and row[k]]
        if 2 * sum(map(is_value, entries)) > max(len(entries), 1):
            columns.append(k)
    for index, row in enumerate(rows[:SAMPLE]):
        filled = [row[k] for k in columns if k < len(row) and row[k]]
        if len(columns) > 1 and 2 * len(filled) > len(columns) and all(map(is_value, filled)):
            pairs = zip(lines, rows[:index], strict=False)
            above = [_names(line, row, len(columns), mark) for line, row in pairs if any(row)]
            # A row of units may stand between the names and the data. Use the last row that has all wanted names.
            asked = [name for name in wanted if isinstance(name, str)]
            named = [names for names in above if all(_places(name, names) for name in asked)]
            return next(iter(reversed(named or above)), []), index
    raise ValueError(
        f"{path.name} has no row of numbers in two columns or more among its first {SAMPLE} lines (columns divided "
        f"by {mark!r}); its first line is {' '.join(rows[0])[:QUOTED]!r}"
    )


def _names(line: str, row: Sequence[str], count: int, mark: str) -> list[str]:
    """Return the names of a header. A name may contain single blanks."""
    wide = re.split(r"\s{2,9}", line.strip()) if mark == r"\s+" else []
    return [name.strip('" ') for name in (wide if len(wide) == count else row)]


def _place(role: str, name: str | int | None, header: Sequence[str], path: Path) -> int:
    """Find a column by its number or name, or by its role if `name` is None. Return its number."""
    places = [name] if isinstance(name, int) else _places(name or role, header)
    if name is None and len(places) != 1:
        places = [name := PLACES[role]]
    if places and (len(places) == 1 or name in header) and places[0] < len(header):
        return places[0]
    named = [repr(name[:QUOTED]) for name in header if name]
    further = f" and {len(named) - SAMPLE} more" if len(named) > SAMPLE else ""
    known = ", ".join(named[:SAMPLE]) + further or f"{len(header)}, without names: give numbers from 0"
    raise ValueError(f"{path.name} has no column {name!r}; its columns are {known}")


def _places(name: str, header: Sequence[str]) -> list[int]:
    """Return the columns with exactly this name. If there are none, ignore case and units in brackets."""
    bare_names = [re.split(r"[\[(]", known)[0].strip().lower() for known in header]
    exact = [k for k, known in enumerate(header) if known == name]
    return exact or [k for k, known in enumerate(bare_names) if known == name.lower()]


def _has_decimal_commas(columns: Sequence[Sequence[str]]) -> bool:
    """Return True if some numbers have commas and none has a decimal point. Ignore dates."""
    entries = [bare(x) for column in columns for x in column[:200]]
    entries = [entry for entry in entries if not math.isnan(_either(entry))]
    pointed = any("." in entry and not GROUPED.fullmatch(entry.replace(".", ",")) for entry in entries)
    return not pointed and any("," in entry for entry in entries)


def _clock(
    entries: Sequence[str], column: tuple[Array, Array], title: str, doubts: list[str]
) -> tuple[tuple[Array, Array], str, str]:
    """Convert numbers or dates to times. Return the times, their unit, and the date of the first time."""
    times, wrong = column
    if 2 * wrong.sum() > wrong.size:
        return _stamps(entries, column, doubts)
    named = UNIT.search(title)
    unit = (named[1] and "s") or named[2] if named else ""
    first, last = float(np.nanmin(times, initial=math.inf)), float(np.nanmax(times, initial=-math.inf))
    for word, share in EPOCHS.items():
        if last / share > 1e8 and (share > 1 or (unit in ("", "s") and first > 1e8)):
            if share > 1:
                doubts.append(f"the times are {word} since 1970: they were converted to seconds")
            date = f"{datetime.fromtimestamp(first / share, UTC):%Y-%m-%d %H:%M}"
            return ((times - first) / share, wrong), "s", date
    if unit not in ("", "s"):
        doubts.append(
            f"the times are in {unit}, by the name of their column: give all other times in {unit}, too"
        )
    return column, unit, ""


def _stamps(
    column: Sequence[str], plain: tuple[Array, Array], doubts: list[str]
) -> tuple[tuple[Array, Array], str, str]:
    """Convert dates or times of day to seconds since the earliest. Return the seconds, their unit, and the first date.

    The format that reads the most entries is used. If several formats read equally many, the format with the smallest
    span of time is used. In a record that runs past midnight, the wrong order of day and month gives a longer span.
    """
    import pandas as pd

    text = pd.Series([bare(entry) for entry in column]).str.replace(r"(:\d\d),(\d)", r"\1.\2", regex=True)
    text = text.str.replace(r"(:\d\d:\d\d)(?![.\d])", r"\1.0", regex=True)
    text = text.str.replace(r"\s{0,9}([AaPp])\.?[Mm]\.?$", r" \1M", regex=True)

    def read(form: str, text: pd.Series) -> pd.Series:
        return pd.to_datetime(text, format=form, errors="coerce", utc=True)

    sample = text[plain[1]].head(SAMPLE)
    counts = {form: int(read(form, sample).notna().sum()) for form in STAMPS}
    readings = [read(form, text) for form in STAMPS if counts[form] == max(counts.values())]
    best = max(readings, key=lambda times: (times.notna().sum(), times.min() - times.max()))
    if best.notna().sum() == 0:
        return plain, "", ""
    seconds = (best - best.min()).dt.total_seconds().to_numpy(dtype=float, copy=True)
    dated = best.max().year != 1900
    midnights = np.cumsum(np.diff(seconds, prepend=seconds[0]) < -DAY / 2)
    if not dated and midnights[-1]:
        doubts.append(f"the time of day passes midnight {midnights[-1]} time(s): days were added")
        seconds += DAY * midnights - np.nanmin(seconds + DAY * midnights)
    wrong = np.isnan(seconds) & plain[1]
    return (seconds, wrong), "s", f"{best.min():%Y-%m-%d %H:%M}" if dated else ""
