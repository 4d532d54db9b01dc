"""Columns of a text file as numbers, whatever a historian makes of them; an error names the row."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from pidalab._check import Array

# What stands in place of a value that was not recorded.
MISSING = {
    "",
    "nan",
    "na",
    "n/a",
    "null",
    "none",
    "-",
    "bad",
    "bad input",
    "no data",
    "#n/a",
    "i/o timeout",
    "?",
}
ISO = "ISO 8601"
STAMPS = (
    ISO,
    "%d.%m.%Y %H:%M:%S.%f",
    "%d.%m.%Y %H:%M:%S",
    "%d.%m.%Y %H:%M",
    "%d/%m/%Y %H:%M:%S.%f",
    "%d/%m/%Y %H:%M:%S",
    "%d/%m/%Y %H:%M",
    "%m/%d/%Y %H:%M:%S.%f",
    "%m/%d/%Y %H:%M:%S",
    "%m/%d/%Y %H:%M",
    "%m/%d/%Y %I:%M:%S %p",
    "%Y/%m/%d %H:%M:%S.%f",
    "%Y/%m/%d %H:%M:%S",
    "%d-%b-%Y %H:%M:%S.%f",
    "%d-%b-%Y %H:%M:%S",
    "%d-%b-%y %H:%M:%S.%f",
    "%d-%b-%y %H:%M:%S",
    "%H:%M:%S.%f",
    "%H:%M:%S",
)
DELIMITERS = ";\t,|"


def read_columns(
    path: Path, wanted: Sequence[str | int], delimiter: str | None, decimal: str | None
) -> tuple[Array, ...]:
    """Read columns of a delimited text file; the first of them holds times.

    Parameters
    ----------
    path : pathlib.Path
        The file; UTF-8, with or without a byte order mark, or Latin-1.
    wanted : sequence of str or int
        Names in the header, or numbers of columns from 0; the first is the time.
    delimiter : str or None
        Between the columns; None finds out.
    decimal : str or None
        "." or ","; None finds out.

    Returns
    -------
    tuple of ndarray
        One array for each column, nan where a value is missing.

    Raises
    ------
    ValueError
        For a file without such columns, or with an entry that is neither a number nor a word for a missing one.
    """
    lines = _lines(path)
    if not any(line.strip() for line in lines):
        raise ValueError(f"{path.name} is empty")
    mark = delimiter or _delimiter(lines)
    table = list(csv.reader(lines, delimiter=mark))
    header, first = _header(table, wanted, mark, path)
    places = [_place(name, header, path) for name in wanted]
    comma = decimal == "," if decimal is not None else _has_decimal_commas(table[first:], places, mark)
    rows = [(k, row) for k, row in enumerate(table[first:], start=first + 1) if any(x.strip() for x in row)]
    for number, row in rows:
        if max(places) >= len(row):
            raise ValueError(
                f"{path.name}, row {number}: expected {max(places) + 1} columns or more, found {len(row)}"
            )
    pattern = _pattern([row[places[0]].strip() for _, row in rows], comma)
    return tuple(
        np.array(
            [
                _value(
                    row[place],
                    comma,
                    pattern if k == 0 else None,
                    f"{path.name}, row {number}, column {name!r}",
                )
                for number, row in rows
            ]
        )
        for k, (name, place) in enumerate(zip(wanted, places, strict=True))
    )


def _lines(path: Path) -> list[str]:
    raw = path.read_bytes()
    try:
        return raw.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        return raw.decode("latin-1").splitlines()


def _delimiter(lines: Sequence[str]) -> str:
    """Return the delimiter that stands equally often in the most of the first lines."""
    sample = [line for line in lines[:50] if line.strip()]

    def steady(mark: str) -> tuple[int, int]:
        counts = [line.count(mark) for line in sample]
        usual = max(set(counts), key=counts.count)
        return (counts.count(usual) if usual else 0, usual)

    return max(DELIMITERS, key=steady)


def _header(
    table: Sequence[Sequence[str]], wanted: Sequence[str | int], mark: str, path: Path
) -> tuple[list[str], int]:
    """Return the names of the columns, and the index of the first row of data.

    Columns of words, such as a status, do not count: those of numbers and dates are told from the rows at the end.
    """
    last = [row for row in table if any(entry.strip() for entry in row)][-50:]
    columns = [
        k
        for k in range(max(map(len, last)))
        if 2 * sum(k < len(row) and _is_value(row[k].strip()) for row in last) > len(last)
    ]
    for index, row in enumerate(table[:50]):
        if len(columns) > 1 and max(columns) < len(row) and all(_is_value(row[k].strip()) for k in columns):
            above = [[entry.strip().strip('"') for entry in names] for names in table[:index]]
            # a row of units may stand below the names
            named = [
                row for row in above if all(isinstance(name, int) or _places(name, row) for name in wanted)
            ]
            return (named or above or [[]])[-1], index
    raise ValueError(
        f"{path.name} has no row of numbers in its first 50 lines (columns divided by {mark!r}); "
        f"its first line is {mark.join(table[0])[:60]!r}"
    )


def _is_value(entry: str) -> bool:
    return (
        entry.lower() in MISSING
        or _stamp(entry) is not None
        or not math.isnan(_number(entry.replace(",", ".")))
    )


def _place(name: str | int, header: Sequence[str], path: Path) -> int:
    if isinstance(name, int):
        return name
    places = _places(name, header)
    if len(places) == 1 or name in header:
        return places[0]
    known = ", ".join(map(repr, header)) or "none: give numbers of columns, from 0"
    raise ValueError(f"{path.name} has no column {name!r}; its columns are {known}")


def _places(name: str, header: Sequence[str]) -> list[int]:
    """Return the columns of that name; where there is none, those that have it before a unit."""
    return [k for k, known in enumerate(header) if known == name] or [
        k
        for k, known in enumerate(header)
        if known.lower().split("[")[0].split("(")[0].strip() == name.lower()
    ]


def _has_decimal_commas(rows: Sequence[Sequence[str]], places: Sequence[int], mark: str) -> bool:
    """Whether commas stand in the numbers and points in none; dates may have either."""
    entries = [row[place].strip() for row in rows[:200] for place in places if place < len(row)]
    return (
        mark != ","
        and any("," in entry and not math.isnan(_number(entry.replace(",", "."))) for entry in entries)
        and not any("." in entry and not math.isnan(_number(entry)) for entry in entries)
    )


def _value(entry: str, comma: bool, pattern: str | None, where: str) -> float:
    text = entry.strip()
    if text.lower() in MISSING:
        return math.nan
    number = _number(text.replace(",", ".") if comma else text)
    if not math.isnan(number):
        return number
    stamp = None if pattern is None else _read(text, pattern)
    if stamp is None:
        raise ValueError(
            f"{where}: expected a number{'' if pattern is None else ' or a date'}, found {entry!r}"
        )
    return stamp


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


def _stamp(text: str) -> float | None:
    """Return a date and time in seconds, by the first pattern that reads it."""
    return next((value for value in (_read(text, pattern) for pattern in STAMPS) if value is not None), None)


def _pattern(entries: Sequence[str], comma: bool) -> str:
    """Return how the times are written: of the patterns that read the most, the one that makes the least span.

    Day and month may stand either way around; a record that runs past midnight tells by its span.
    """
    texts = [
        x
        for x in entries
        if x.lower() not in MISSING and math.isnan(_number(x.replace(",", ".") if comma else x))
    ]

    def merit(pattern: str) -> tuple[int, float]:
        read = [value for value in (_read(text, pattern) for text in texts) if value is not None]
        return len(read), min(read, default=0.0) - max(read, default=0.0)

    return max(STAMPS, key=merit) if texts else STAMPS[0]


def _read(text: str, pattern: str) -> float | None:
    """Return a date and time in seconds; only differences are used, so its zero means nothing."""
    try:
        point = text.replace(",", ".")
        found = datetime.fromisoformat(point) if pattern == ISO else datetime.strptime(point, pattern)
    except ValueError:
        return None
    # without a zone as in universal time, which no clock is set forward in
    return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()
