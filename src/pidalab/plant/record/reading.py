"""Read columns of a text file as numbers; an error names the row and the remedy."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab._text import plain_text

MISSING = {"", "-", "?", "nan", "na", "n/a", "#n/a", "null", "none", "unavailable", "unknown"}
MISSING |= {"bad", "bad input", "no data", "i/o timeout"}
STATES = {"true": 1.0, "false": 0.0, "on": 1.0, "off": 0.0}
BRACKETS = " \t[]{}();'\""
# how dates and times of day begin
STAMP = re.compile(r"(\d{1,4}[-/.]\w{1,9}[-/.]\d{1,4}([T ]\d|$)|\d{1,2}:\d\d)")
GROUPED = re.compile(r"[-+]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?")  # commas after the thousands
BLANKS = re.compile(r"[-+]?[1-9]\d{0,2}([ '\u00a0\u202f]\d{3})+([.,]\d*)?")  # or blanks
# a number with a decimal comma: points stand after thousands, or it is another number
WITH_COMMA = re.compile(r"[^.]*|[-+]?[1-9]\d{0,2}(\.\d{3})+(,\d*)?")
# after a number; blanks before it are taken off separately, which takes no longer for more of them
SIGN = re.compile(r"(%|°\s{0,9}[CF]?)$")

DELIMITERS = (";", "\t", ",", "|", r"\s+")
DATES = ("%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%Y/%m/%d", "%Y-%m-%d", "%d-%b-%Y", "%d-%b-%y", "")
CLOCKS = ("%H:%M:%S.%f", "%H:%M", "%I:%M:%S.%f %p", "%I:%M %p")
STAMPS = ("ISO8601", *(f"{date} {clock}".strip() for date in DATES for clock in CLOCKS))
LONG_AGO = 1e8  # a number above it counts seconds since 1970
DAY = 86400.0  # seconds
# dates in finer units: as seconds since 1970 they would lie in the year 5138 and beyond
FINE_DATES = ((1e17, 1e9, "nanoseconds"), (1e14, 1e6, "microseconds"), (1e11, 1e3, "milliseconds"))
FINE_UNIT = re.compile(
    r"(?:^|[\W_])(ms|msec|millis|milliseconds?|us|µs|ns|min|minutes?|hours?|h)\W*$", re.IGNORECASE
)
QUOTED = 60  # characters of the file in a message
LOOKED_AT = 50  # lines from which the form of a file is told, and names of columns that a message has
LONGEST_ROW, MOST_COLUMNS = 100_000, 2000  # characters, columns


class Columns(NamedTuple):
    """Columns of a file: numbers, nan where a value is missing; the rows they came from; what was done on the way."""

    values: tuple[Array, ...]
    rows: Array
    names: tuple[str, ...]
    doubts: tuple[str, ...]


def read_columns(
    path: Path,
    wanted: Sequence[str | int],
    delimiter: str | None = None,
    skip: int = 0,
    timed: bool = True,
) -> Columns:
    """Read columns of a delimited text file.

    Parameters
    ----------
    path : pathlib.Path
        The file; UTF-8 or UTF-16 with or without a byte order mark, or Latin-1.
    wanted : sequence of str or int
        Names in the header, or numbers of columns from 0.
    delimiter : str or None
        Between the columns, as a regular expression if it is longer than a character; found out if None.
    skip : int
        Lines to leave out at the beginning.
    timed : bool
        Whether the first of the columns holds times, which may be dates.

    Returns
    -------
    Columns

    Raises
    ------
    ValueError
        For a file without such columns, or with an entry that is neither a number nor a word for a missing one.
    """
    try:
        re.compile(delimiter or "")
    except re.error as refusal:
        raise ValueError(
            f"delimiter must be a character or a regular expression, found {delimiter!r}: {refusal}"
        ) from None
    lines = _lines(path)[skip:]
    for row, line in enumerate(lines):
        if len(line) > LONGEST_ROW:
            raise ValueError(
                f"{path.name}, row {row + 1 + skip}, has {len(line)} characters, and a line of a record at most "
                f"{LONGEST_ROW}: is it a table of text with a line for each sample?"
            )
    if not any(line.strip() for line in lines):
        raise ValueError(f"{path.name} is empty")
    doubts: list[str] = []
    mark = delimiter or max(DELIMITERS, key=lambda mark: _numbered(lines, mark))
    joined = [re.sub(r"(:\d\d),(\d{3})(?=,)", r"\1.\2", line) if ":" in line else line for line in lines]
    if mark == "," and joined != lines:
        doubts.append("milliseconds after a comma belong to the time before them: both are one column")
        lines = joined
    rows = [_split(line, mark) for line in lines]
    if (width := sorted(map(len, rows))[len(rows) // 2]) > MOST_COLUMNS:
        raise ValueError(
            f"{path.name} must have at most {MOST_COLUMNS} columns, found more divided by {mark!r}: copy "
            "those of time, input and output into a file of their own"
        )
    header, first = _header(lines, rows, wanted, mark, path)
    width = max(map(len, [header, *rows[first : first + LOOKED_AT]]))
    places = [_place(name, header, width, path) for name in wanted]
    numbers = np.array([k for k in range(first, len(rows)) if any(rows[k])])
    entries = [[rows[k][place] if place < len(rows[k]) else "" for k in numbers] for place in places]
    comma = mark != "," and _has_decimal_commas(entries)
    columns = [_numbers(column, comma) for column in entries]
    if timed and 2 * columns[0][1].sum() > numbers.size:
        columns[0] = _stamps(entries[0], columns[0], doubts)
    if timed:
        title = header[places[0]] if places[0] < len(header) else ""
        columns[0] = _in_seconds(columns[0], title, doubts)
    if any(entry.lower() in STATES for column in entries for entry in column[:LOOKED_AT]):
        doubts.append("true or on was read as 1, false or off as 0")
    good = ~np.any([wrong for _, wrong in columns], axis=0)
    end = int(np.flatnonzero(good)[-1]) + 1 if good.any() else numbers.size
    if end < numbers.size:
        doubts.append(
            f"{numbers.size - end} row(s) after the last row of numbers were left out: "
            f"{plain_text(lines[numbers[end]], QUOTED)}"
        )
    for name, column, (_, wrong) in zip(wanted, entries, columns, strict=True):
        if wrong[:end].any():
            k = int(np.argmax(wrong))
            where, again = f"{path.name}, row {numbers[k] + 1 + skip}", k + int(np.argmax(good[k:]))
            if again > k + 1:
                raise ValueError(
                    f"{where}: words, such as {column[k][:QUOTED]!r}, and numbers again from row "
                    f"{numbers[again] + 1 + skip} on: several traces lie one below the other; put them side by side, "
                    "with one column of times, or cut out the part that has time, input and output"
                )
            kind = "a number or a date" if timed and column is entries[0] else "a number"
            raise ValueError(
                f"{where}, column {name!r}: expected {kind}{' with a decimal comma' * comma}, found "
                f"{column[k][:QUOTED]!r}; correct it, or leave it empty if the value is missing"
            )
    names = tuple(header[place] if place < len(header) else "" for place in places)
    return Columns(
        tuple(values[:end] for values, _ in columns), numbers[:end] + 1 + skip, names, tuple(doubts)
    )


def _lines(path: Path) -> list[str]:
    raw = path.read_bytes()
    wide = raw[:2] in (b"\xff\xfe", b"\xfe\xff")
    try:
        return raw.decode("utf-16" if wide else "utf-8-sig").splitlines()
    except UnicodeDecodeError:
        return raw.decode("latin-1").splitlines()


def _split(line: str, mark: str) -> list[str]:
    """Return the entries of a line without blanks around them; a quote that is not closed ends with its line."""
    if mark == r"\s+":
        line = line.strip()
        # brackets of an exported matrix stand apart from its numbers
        return (line.strip(BRACKETS) if line[:1] in "[({" or line[-1:] in "])};" else line).split(
            None, MOST_COLUMNS
        )
    if len(mark) > 1:
        return [entry.strip() for entry in re.split(mark, line.strip(), maxsplit=MOST_COLUMNS)]
    if '"' in line:
        return [entry.strip() for entry in next(csv.reader([line], delimiter=mark, skipinitialspace=True))]
    return [entry.strip() for entry in line.split(mark, MOST_COLUMNS)]


def bare(entry: str) -> str:
    """Return an entry without blanks and brackets around it and a sign of per cent or degrees."""
    return SIGN.sub("", entry.strip(BRACKETS)).rstrip()


def number(entry: str, comma: bool = False) -> float:
    """Return an entry as a number, nan where it is none."""
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
    """Return an entry as a number with a decimal point or comma, nan where it is neither."""
    value = number(entry)
    return value if math.isfinite(value) else number(entry, comma=True)


def is_value(entry: str) -> bool:
    """Return True for a number, a date, or a word for a missing value."""
    text = bare(entry) or entry.strip()
    return text.lower() in MISSING or STAMP.match(text) is not None or not math.isnan(_either(text))


def _numbers(entries: Sequence[str], comma: bool) -> tuple[Array, Array]:
    """Return entries as numbers, nan where one is missing, and where there is neither a number nor a word for none."""
    values, wrong = np.full(len(entries), np.nan), np.zeros(len(entries), dtype=bool)
    for k, entry in enumerate(entries):
        values[k] = number(entry, comma)
        wrong[k] = math.isnan(values[k]) and bare(entry).lower() not in MISSING
    return values, wrong


def _numbered(lines: Sequence[str], mark: str) -> float:
    """Return how well a delimiter serves: columns of numbers at the end of the file, times their share of all."""
    rows = [_split(line, mark) for line in [line for line in lines if line.strip()][-LOOKED_AT:]]
    half = sorted(map(len, rows), reverse=True)[
        len(rows) // 2
    ]  # columns beyond are in half of the rows at most
    served = [
        k for k in range(half) if 2 * sum(k < len(row) and is_value(row[k]) for row in rows) > len(rows)
    ]
    return len(served) ** 2 / max(1, *map(len, rows))


def _header(
    lines: Sequence[str], rows: Sequence[Sequence[str]], wanted: Sequence[str | int], mark: str, path: Path
) -> tuple[list[str], int]:
    """Return the names of the columns, and the index of the first row of data."""
    last = [row for row in rows if any(row)][-LOOKED_AT:]
    columns = []  # entries that no row has are no column, though a missing value may be blank
    for k in range(max(map(len, last))):
        entries = [row[k] for row in last if k < len(row) and row[k]]
        if 2 * sum(map(is_value, entries)) > max(len(entries), 1):
            columns.append(k)
    for index, row in enumerate(rows[:LOOKED_AT]):
        filled = [row[k] for k in columns if k < len(row) and row[k]]
        if len(columns) > 1 and 2 * len(filled) > len(columns) and all(map(is_value, filled)):
            above = [
                _names(line, row, len(columns), mark)
                for line, row in zip(lines, rows[:index], strict=False)
                if any(row)
            ]
            # a row of units may follow that of the names
            named = [names for names in above if all(isinstance(x, int) or _places(x, names) for x in wanted)]
            return next(iter(reversed(named or above)), []), index
    raise ValueError(
        f"{path.name} has no row of numbers in two columns or more among its first {LOOKED_AT} lines (columns divided "
        f"by {mark!r}); its first line is {' '.join(rows[0])[:QUOTED]!r}"
    )


def _names(line: str, row: Sequence[str], count: int, mark: str) -> list[str]:
    """Return the names of a header, which may contain single blanks where blanks divide the columns."""
    wide = re.split(r"\s{2,9}", line.strip()) if mark == r"\s+" else []
    return [name.strip('" ') for name in (wide if len(wide) == count else row)]


def _place(name: str | int, header: Sequence[str], width: int, path: Path) -> int:
    places = [name] if isinstance(name, int) else _places(name, header)
    if places and (len(places) == 1 or name in header) and places[0] < width:
        return places[0]
    named = [repr(name[:QUOTED]) for name in header if name]
    further = f" and {len(named) - LOOKED_AT} more" if len(named) > LOOKED_AT else ""
    known = ", ".join(named[:LOOKED_AT]) + further or f"{width}, without names: give numbers from 0"
    raise ValueError(f"{path.name} has no column {name!r}; its columns are {known}")


def _places(name: str, header: Sequence[str]) -> list[int]:
    """Return the columns of that name; where there is none, those that have it before a unit."""
    return [k for k, known in enumerate(header) if known == name] or [
        k for k, known in enumerate(header) if re.split(r"[\[(]", known)[0].strip().lower() == name.lower()
    ]


def _has_decimal_commas(columns: Sequence[Sequence[str]]) -> bool:
    """Return True if commas appear in the numbers and points in none; dates may have either."""
    entries = [bare(x) for column in columns for x in column[:200]]
    entries = [entry for entry in entries if not math.isnan(_either(entry))]
    return any("," in entry for entry in entries) and not any(
        "." in entry and not GROUPED.fullmatch(entry.replace(".", ",")) for entry in entries
    )


def _in_seconds(column: tuple[Array, Array], name: str, doubts: list[str]) -> tuple[Array, Array]:
    """Return times that count from 1970 in a finer unit in seconds; say in which unit others are, by their name."""
    times, wrong = column
    latest = float(np.nanmax(times, initial=0.0))
    for beyond, share, unit in FINE_DATES:
        if latest > beyond:
            doubts.append(f"the times are {unit} since 1970: they were read as seconds")
            return (times - np.nanmin(times)) / share, wrong
    if named := FINE_UNIT.search(name):
        doubts.append(
            f"the times are in {named[1]}, by the name of their column, and so is every other time, the sample time too"
        )
    return column


def _stamps(column: Sequence[str], plain: tuple[Array, Array], doubts: list[str]) -> tuple[Array, Array]:
    """Return a column of dates or times of day in seconds since the earliest.

    Of the ways to write them the one counts that reads the most and, of these, makes the least span: day and month may
    be either way around, and a record that runs past midnight tells.
    """
    import pandas as pd

    text = pd.Series([bare(entry) for entry in column]).str.replace(r"(:\d\d),(\d)", r"\1.\2", regex=True)
    text = text.str.replace(r"(:\d\d:\d\d)(?![.\d])", r"\1.0", regex=True)
    text = text.str.replace(r"\s{0,9}([AaPp])\.?[Mm]\.?$", r" \1M", regex=True)

    def read(form: str, text: pd.Series) -> pd.Series:
        return pd.to_datetime(text, format=form, errors="coerce", utc=True)

    sample = text[plain[1]].head(LOOKED_AT)
    counts = {form: int(read(form, sample).notna().sum()) for form in STAMPS}
    readings = [read(form, text) for form in STAMPS if counts[form] == max(counts.values())]
    best = max(readings, key=lambda times: (times.notna().sum(), times.min() - times.max()))
    if best.notna().sum() == 0:
        return plain
    seconds = (best - best.min()).dt.total_seconds().to_numpy(dtype=float, copy=True)
    midnights = np.cumsum(np.diff(seconds, prepend=seconds[0]) < -DAY / 2)
    if best.max().year == 1900 and midnights[-1]:  # no date
        doubts.append(f"the time of day passes midnight {midnights[-1]} time(s): days were added")
        seconds += DAY * midnights - np.nanmin(seconds + DAY * midnights)
    return seconds, np.isnan(seconds) & plain[1]
