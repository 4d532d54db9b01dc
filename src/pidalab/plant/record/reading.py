"""Columns of a text file as numbers; an error names the row."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab._text import plain_text

if TYPE_CHECKING:
    import pandas as pd

# What takes the place of a value that was not recorded.
MISSING = ["", "-", "?", "nan", "na", "n/a", "#n/a", "null", "none"]
MISSING += ["bad", "bad input", "no data", "i/o timeout"]
# how dates and times of day begin
STAMP = re.compile(r"(\d{1,4}[-/.]\w{1,9}[-/.]\d{1,4}([T ]\d|$)|\d{1,2}:\d\d)")
GROUPED = r"[-+]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?"  # a number with a comma after the thousands
# a number with a decimal comma: points stand after thousands, or it is another number
WITH_COMMA = r"[^.]*|[-+]?[1-9]\d{0,2}(\.\d{3})+(,\d*)?"
# what may be behind a number; blanks before it are taken off apart, which takes no longer for more of them
SIGN = r"(%|°\s{0,9}[CF]?)$"


def is_value(entry: str) -> bool:
    """Whether an entry is a number, a date, or a word for a missing one."""
    text = bare(entry) or entry.strip()
    return text.lower() in MISSING or STAMP.match(text) is not None or not math.isnan(number(text))


def bare(entry: Any) -> Any:
    """Return an entry, or a Series of them, without blanks and brackets around it and a sign of per cent or degrees."""
    if isinstance(entry, str):
        return re.sub(SIGN, "", entry.strip(" \t[]{}();'\"")).rstrip()
    return entry.str.strip(" \t[]{}();'\"").str.replace(SIGN, "", regex=True).str.rstrip()


def number(text: str) -> float:
    """Return a bare entry as a number, with a decimal point or comma; nan where it is none."""
    if re.fullmatch(GROUPED, text):
        return float(text.replace(",", ""))
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


def numbers(column: pd.Series, comma: bool) -> tuple[Array, Array]:
    """Return a column as numbers, nan where one is missing, and where there is neither a number nor a word for none."""
    import pandas as pd

    values = pd.to_numeric(column, errors="coerce").to_numpy(dtype=float, copy=True)
    # what reads as it stands needs no more; of decimal commas none does for sure
    left = np.isnan(values) | comma
    column = column[left]
    text = bare(column)
    if comma:
        text = text.where(text.str.fullmatch(WITH_COMMA), "")
        text = text.str.replace(".", "", regex=False).str.replace(",", ".", regex=False)
    else:
        text = text.mask(text.str.fullmatch(GROUPED), text.str.replace(",", "", regex=False))
    values[left] = pd.to_numeric(text, errors="coerce").to_numpy(dtype=float)
    values[~np.isfinite(values)] = np.nan
    wrong = np.isnan(values)
    wrong[left] &= ~bare(column).str.lower().isin(MISSING).to_numpy(dtype=bool)
    return values, wrong


DELIMITERS = (";", "\t", ",", "|", r"\s+")
DATES = ("%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%Y/%m/%d", "%Y-%m-%d", "%d-%b-%Y", "%d-%b-%y", "")
CLOCKS = ("%H:%M:%S.%f", "%H:%M", "%I:%M:%S.%f %p", "%I:%M %p")
STAMPS = ("ISO8601", *(f"{date} {clock}".strip() for date in DATES for clock in CLOCKS))
LONG_AGO = 1e8  # a number above it counts seconds since then
DAY = 86400.0  # seconds
# how dates in finer units are told: as seconds since 1970 they would lie in the year 5138 and beyond
FINE_DATES = ((1e17, 1e9, "nanoseconds"), (1e14, 1e6, "microseconds"), (1e11, 1e3, "milliseconds"))
FINE_UNIT = re.compile(
    r"(?:^|[\W_])(ms|msec|millis|milliseconds?|us|µs|ns|min|minutes?|hours?|h)\W*$", re.IGNORECASE
)
QUOTED = 60  # characters of the file in a message
LOOKED_AT = 50  # lines from which the form of a file is told, and names of columns that a message has
LONGEST_ROW = 100_000  # characters
MOST_COLUMNS = 2000
ALWAYS_READ = 64  # columns that are read of any file
WIDER = 8.0  # times the columns of the mean line, up to which a longer one widens the table


class Columns(NamedTuple):
    """Columns of a file: numbers, nan where a value is missing; the rows they came from; what was done on the way."""

    values: tuple[Array, ...]
    rows: Array
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
        Between the columns, as a regular expression if it is longer than a character; None finds out.
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
    doubts = []
    mark = delimiter or max(DELIMITERS, key=lambda mark: _numbered(lines, mark))
    joined = [re.sub(r"(:\d\d),(\d{3})(?=,)", r"\1.\2", line) if ":" in line else line for line in lines]
    if mark == "," and joined != lines:
        doubts.append("milliseconds after a comma belong to the time before them: both are one column")
        lines = joined
    table = _table(lines, mark, path)
    header, first = _header(table, wanted, mark, path)
    places = [_place(name, header, table.shape[1], path) for name in wanted]
    data = table.iloc[first:]
    data = data[(data != "").any(axis=1)]
    comma = mark != "," and _has_decimal_commas(data, places)
    columns = [numbers(data[place], comma) for place in places]
    if timed and 2 * columns[0][1].sum() > len(data):
        columns[0] = _stamps(data[places[0]], columns[0], doubts)
    if timed:
        columns[0] = _in_seconds(columns[0], header[places[0]] if places[0] < len(header) else "", doubts)
    good = ~np.any([wrong for _, wrong in columns], axis=0)
    end = int(np.flatnonzero(good)[-1]) + 1 if good.any() else len(data)
    if end < len(data):
        doubts.append(
            f"{len(data) - end} row(s) after the last row of numbers were left out: "
            f"{plain_text(lines[data.index[end]], QUOTED)}"
        )
    for name, place, (_, wrong) in zip(wanted, places, columns, strict=True):
        if wrong[:end].any():
            place_in_data = int(np.argmax(wrong))
            row = data.index[place_in_data]
            found = table.at[row, place]
            again = place_in_data + int(np.argmax(good[place_in_data:]))
            if again > place_in_data + 1:
                raise ValueError(
                    f"{path.name}, row {row + 1 + skip}: words, such as {found[:QUOTED]!r}, and numbers again from row "
                    f"{data.index[again] + 1 + skip} on: several traces lie one below the other; put them beside each "
                    "other, with one column of times, or cut out the part that has time, input and output"
                )
            kind = "a number or a date" if timed and place == places[0] else "a number"
            kind += " with a decimal comma" * comma
            raise ValueError(
                f"{path.name}, row {row + 1 + skip}, column {name!r}: expected {kind}, "
                f"found {found[:QUOTED]!r}"
            )
    rows = data.index.to_numpy()[:end] + 1 + skip
    return Columns(tuple(values[:end] for values, _ in columns), rows, tuple(doubts))


def _lines(path: Path) -> list[str]:
    raw = path.read_bytes()
    wide = raw[:2] in (b"\xff\xfe", b"\xfe\xff")
    try:
        return raw.decode("utf-16" if wide else "utf-8-sig").splitlines()
    except UnicodeDecodeError:
        return raw.decode("latin-1").splitlines()


def _numbered(lines: Sequence[str], mark: str) -> float:
    """Return how well a delimiter serves: columns of numbers at the end of the file, times their share of all."""
    last = [line.strip() for line in lines if line.strip()][-LOOKED_AT:]
    # each line for itself: a quote that is not closed ends with its line
    entries = (line.split() if mark == r"\s+" else next(csv.reader([line], delimiter=mark)) for line in last)
    rows = [row[: MOST_COLUMNS + 1] for row in entries]
    return len(_columns_of_numbers(rows)) ** 2 / max(map(len, rows))


def _columns_of_numbers(rows: Sequence[Sequence[str]]) -> list[int]:
    """Return the columns that hold numbers and dates in more than half of the rows; one of words does not count."""
    half = sorted(map(len, rows), reverse=True)[
        len(rows) // 2
    ]  # columns beyond are in half of the rows at most
    return [k for k in range(half) if 2 * sum(k < len(row) and is_value(row[k]) for row in rows) > len(rows)]


def _table(lines: Sequence[str], mark: str, path: Path) -> pd.DataFrame:
    """Return all entries as text; its index counts the lines from 0."""
    import pandas as pd

    plain = (len(mark) == 1 and mark.isascii()) or mark == r"\s+"
    between = re.compile(mark if len(mark) > 1 else re.escape(mark))
    counts = [len(between.split(line.strip())) for line in lines]
    # one long line does not widen all others: the table has a few times the entries of the file
    width = min(max(counts), max(ALWAYS_READ, round(WIDER * sum(counts) / len(counts))))
    if width > MOST_COLUMNS:
        raise ValueError(
            f"{path.name} must have at most {MOST_COLUMNS} columns, found {width} divided by {mark!r}: copy those of "
            "time, input and output into a file of their own"
        )
    kept = [
        line if count <= width else _cut(line, between, width)
        for line, count in zip(lines, counts, strict=True)
    ]
    try:
        table = pd.read_csv(
            io.StringIO("\n".join(kept)),
            sep=mark,
            header=None,
            names=range(width),
            index_col=False,
            dtype=str,
            na_filter=False,
            skip_blank_lines=False,
            skipinitialspace=True,
            engine="c" if plain else "python",
        )
    except ValueError as refusal:  # pandas' own kinds of it, too
        raise ValueError(f"{path.name} is no table of columns divided by {mark!r}: {refusal}") from None
    return table.fillna("").apply(lambda column: column.str.strip())


def _cut(line: str, between: re.Pattern[str], width: int) -> str:
    """Return the first entries of a line that has too many; no quote of it runs on into the next line."""
    line = line.strip().replace('"', " ")
    end = next(match for k, match in enumerate(between.finditer(line), 1) if k == width)
    return line[: end.start()]


def _header(table: pd.DataFrame, wanted: Sequence[str | int], mark: str, path: Path) -> tuple[list[str], int]:
    """Return the names of the columns, and the index of the first row of data."""
    full = table[(table != "").any(axis=1)]
    last = full.tail(LOOKED_AT).to_numpy().tolist()
    # entries that no row has are no column, though a missing value may be blank
    filled_in = [[row[k] for row in last if row[k]] for k in range(table.shape[1])]
    columns = [
        k for k, entries in enumerate(filled_in) if 2 * sum(map(is_value, entries)) > max(len(entries), 1)
    ]
    for index, row in enumerate(table.head(LOOKED_AT).to_numpy().tolist()):
        filled = [row[k] for k in columns if row[k]]
        if len(columns) > 1 and 2 * len(filled) > len(columns) and all(map(is_value, filled)):
            above = [
                [name.strip('"') for name in names]
                for names in table.iloc[:index].to_numpy().tolist()
                if any(names)
            ]
            # a row of units may follow that of the names
            named = [
                row for row in above if all(isinstance(name, int) or _places(name, row) for name in wanted)
            ]
            names: list[str] = next(iter(reversed(named or above)), [])
            return names, index
    raise ValueError(
        f"{path.name} has no row of numbers in two columns or more among its first {LOOKED_AT} lines (columns divided "
        f"by {mark!r}); its first line is {' '.join(table.iloc[0])[:QUOTED]!r}"
    )


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


def _has_decimal_commas(data: pd.DataFrame, places: Sequence[int]) -> bool:
    """Whether commas appear in the numbers and points in none; dates may have either."""
    entries = [bare(entry) for place in places for entry in data[place].head(200)]
    commas = [entry for entry in entries if "," in entry and not math.isnan(number(entry))]
    return bool(commas) and not any(
        "." in entry and not math.isnan(number(entry)) and not re.fullmatch(GROUPED, entry.replace(".", ","))
        for entry in entries
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


def _stamps(column: pd.Series, plain: tuple[Array, Array], doubts: list[str]) -> tuple[Array, Array]:
    """Return a column of dates or times of day in seconds since the earliest.

    Of the ways to write them the one counts that reads the most and, of these, makes the least span: day and month may
    be either way around, and a record that runs past midnight tells.
    """
    import pandas as pd

    text = bare(column).str.replace(r"(:\d\d),(\d)", r"\1.\2", regex=True)
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
