"""Measured series from files: columns of numbers in text, found by the names in the header line or by their places."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mdstopo.case.arrays import FloatArray, IndexArray
from mdstopo.case.keys.number_rows import MOST_TOLD, number_in
from mdstopo.case.model import Case
from mdstopo.case.objects.fitting import Column, Series
from mdstopo.case.text.errors import CaseError, Mistake
from mdstopo.case.text.reading import Reading
from mdstopo.case.text.words import did_you_mean, inside, listed, number_text, shown
from mdstopo.shown import counted

#: what may stand between columns, first to last choice; a blank stands for all blanks
SEPARATORS = {";": "semicolons", "\t": "tabs", ",": "commas", " ": "blanks"}
DECIMAL_COMMA = "numbers have a point, not a comma"
_QUOTED = r'"[^"]*"'


class Measured(NamedTuple):
    """One series as it was recorded, scaled: t, y (n,), deviation (n,) or None where it is not known."""

    series: Series
    t: FloatArray
    y: FloatArray
    deviation: FloatArray | None


class _Table(NamedTuple):
    """A file: the names of its columns (none without a header line), its rows of cells, their lines, the separator."""

    names: tuple[str, ...]
    rows: list[list[str]]
    lines: list[int]
    separator: str

    @property
    def width(self) -> int:
        """How many columns the rows have; without rows those that are named."""
        return max(map(_filled, self.rows), default=len(self.names))

    def title(self, column: int) -> str:
        """What a column is called in messages: its number where the header line names others than there are."""
        return self.names[column] if column < len(self.names) >= self.width else str(column)


def read_measured(case: Case) -> list[Measured]:
    """All series of a case with a section `fit`. Raises CaseError with every mistake in the files."""
    assert case.fit is not None
    reading = Reading(Path() if case.path is None else case.path.parent)
    mistakes: list[Mistake] = []
    found: list[Measured] = []
    for series in case.fit.series:
        place = inside("fit.measured", series.name)
        told = list(_series(case, series, reading, found))
        mistakes += [case.marks.mistake(inside(place, key), message) for key, message in told]
    if not mistakes:
        estimates = len(case.fit.numbers) + sum(s.offset.is_free + s.delay.is_free for s in case.fit.series)
        count = sum(len(each.t) for each in found)
        if count <= estimates:
            message = f"found {count} measured values for {estimates} estimates, needed are more values than estimates"
            mistakes.append(case.marks.mistake("fit.measured", message))
    if mistakes:
        raise CaseError(mistakes, str(case.path or case.name))
    return found


def _series(case: Case, series: Series, reading: Reading, found: list[Measured]) -> Iterator[tuple[str, str]]:
    """Appends one series to `found`, or yields what is wrong with it: the key, and a sentence."""
    table = _table(series.file, reading)
    if isinstance(table, str):
        yield "file", table
        return
    columns: dict[str, int] = {}
    for key, column in (("time", series.time), ("value", series.value), ("deviation", series.deviation)):
        if isinstance(column, float) or column is None:
            continue
        place = _place(column, table)
        if isinstance(place, str):
            yield key, f"{place} ({series.file})"
        else:
            columns[key] = place
    if len(columns) < 2 + isinstance(series.deviation, str):
        return
    named = any(isinstance(each, str) for each in (series.time, series.value, series.deviation))
    odd = _odd_row(table, max(columns.values()), named)
    if odd:
        yield "file", f"{series.file}, {odd}"
        return
    numbers, told = _numbers(series.file, table, list(columns.values()))
    yield from (("file", each) for each in told)
    if told:
        return
    read = dict(zip(columns, numbers.T, strict=True))
    t, y = read["time"] * series.time_scale, read["value"] * series.value_scale
    inside_window = np.ones(len(t), dtype=bool)
    rounded = 2.0 * np.spacing(np.abs(t))  # 2300 times 0.001 is above 2.3
    if series.begin is not None:
        inside_window &= t >= series.begin - rounded
    if series.end is not None:
        inside_window &= t <= series.end + rounded
    lines = np.array(table.lines)[inside_window]
    t, y = t[inside_window], y[inside_window]
    if not len(t):
        between = ", between `from` and `to`" if len(inside_window) else ""
        yield "file", f"found no row in {shown(series.file)}{between}, needed is at least one"
        return
    deviation = None
    if isinstance(series.deviation, float):
        deviation = np.full(len(t), series.deviation)
    elif series.deviation is not None:
        deviation = read["deviation"][inside_window] * abs(series.value_scale)
        for i in np.flatnonzero(~(deviation > 0.0))[:MOST_TOLD]:
            value = number_text(float(deviation[i]))
            yield "deviation", f"{series.file}, line {lines[i]}: found {value}, allowed is a number > 0"
            return
    outside = list(_outside(case, series, t, lines))
    yield from outside
    if not outside:
        found.append(Measured(series, t, y, deviation))


def _outside(case: Case, series: Series, t: FloatArray, lines: IndexArray) -> Iterator[tuple[str, str]]:
    """Times at which there is no motion, whatever the delay is."""
    window = case.load_case(series.load_case)
    first, last = window.start + series.delay.upper, window.end + series.delay.lower
    slack = 1e-9 * (window.end - window.start)
    wrong = np.flatnonzero((t < first - slack) | (t > last + slack))
    if len(wrong):
        allowed = f"{number_text(first)} to {number_text(last)}"
        why = f"the motion of load case {series.load_case} is from {number_text(window.start)} to "
        why += f"{number_text(window.end)} s"
        if series.delay.upper != 0.0 or series.delay.lower != 0.0:
            why += ", and what is recorded is later by the delay"
        more = f", and {len(wrong) - 1} more such times" if len(wrong) > 1 else ""
        at = f"{series.file}, line {lines[wrong[0]]}"
        message = f"{at}: found the time {number_text(float(t[wrong[0]]))}{more}, allowed is {allowed} s: {why}"
        yield "time", f"{message}; `from` and `to` choose a part"


def _table(name: str, reading: Reading) -> _Table | str:
    """The cells of a file, or the sentence why there are none."""
    data = reading.include(name)
    if isinstance(data, str):
        return data
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return f"the file {shown(name)} is not text in UTF-8"
    written = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    try:
        return _columns([(number, _without_remark(line, k == 0)) for k, (number, line) in enumerate(written)])
    except ValueError as error:
        return f"{name}, {error}"


def _without_remark(line: str, first: bool) -> str:
    """A line without what follows a blank and `#`, beside quotation marks; in the first, `force #2` may be a name."""
    behind = r"(?:\s.*|$)" if first else ".*"
    return re.sub(rf"({_QUOTED})|\s#{behind}", lambda found: found[1] or "", line)


def _columns(written: list[tuple[int, str]]) -> _Table:
    """The table of lines with their numbers. Raises ValueError with the line that has no cells."""
    lines = [number for number, _ in written]
    separator = _separator(written[1:] or written)
    has_names = bool(written) and _names_columns(*written[0], separator)
    if not has_names:
        separator = _separator(written)
    there = written[has_names:]
    rows = [_cells(*each, separator) for each in there]
    names = _names(*written[0], separator, rows) if has_names else []
    if names and separator == "\t" and max(map(_filled, rows), default=0) > _filled(names):
        # tabs that only align: the header line has as many names as each row has cells if several tabs are one gap
        spaced = [_cells(*each, " ") for each in there]
        apart = _names(*written[0], " ", spaced)
        if {len(row) for row in spaced} == {len(apart)}:
            names, rows, separator = apart, spaced, " "
    if separator == "\t":  # a column without a name and without a cell is no column
        width = max(map(len, (names, *rows)), default=0)
        kept = [k for k in range(width) if any(row[k : k + 1] not in ([], [""]) for row in (names, *rows))]
        names, *rows = ([row[k] for k in kept if k < len(row)] for row in (names, *rows))
    return _Table(tuple(each.strip("\"'") for each in names), rows, lines[has_names:], separator)


def _separator(lines: Sequence[tuple[int, str]]) -> str:
    """What stands between columns: the first of semicolon, tab and comma that most lines have, else blanks."""
    bare = [re.sub(_QUOTED, "q", line).strip() for _, line in lines]
    return next((each for each in SEPARATORS if 2 * sum(each in line for line in bare) > len(bare)), " ")


def _names_columns(number: int, line: str, separator: str) -> bool:
    """Whether the first line is a header line: no cell is a number, and neither are they all with other separators."""
    if any(number_in(cell) is not None for cell in _cells(number, line, separator)):
        return False
    return any(number_in(word) is None for word in re.split(r"[;,\s]+", line) if word)


def _cells(number: int, line: str, separator: str) -> list[str]:
    """The cells of a line. Raises ValueError with its number."""
    if separator == " ":
        found = re.findall(rf"(?:{_QUOTED}|\S)+", line)
        return [cell[1:-1].strip() if re.fullmatch(_QUOTED, cell) else cell for cell in found]
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    try:
        # the end of a line may go, but not a tab in front, behind which the second cell stands
        found = next(csv.reader([line.strip(" \r\n")], delimiter=separator, skipinitialspace=True))
    except csv.Error as error:
        raise ValueError(f"line {number}: a cell in quotation marks cannot be read: {error}") from None
    return [cell.strip() for cell in found]


def _names(number: int, line: str, separator: str, rows: Sequence[Sequence[str]]) -> list[str]:
    """The names in a header line: between what separates rows, or, where that is not in it, what gives as many."""
    names = _cells(number, line, separator)
    if separator == " " and "\t" in line.strip():
        names = [cell for cell in _cells(number, line, "\t") if cell]
    width = max(map(_filled, rows), default=len(names))
    if len(names) != width > 1 and (len(names) == 1 or separator == " "):
        gaps = re.sub(r"\s{2,}", "\t", line.strip())
        for each, other in ((line, ";"), (line, "\t"), (line, ","), (gaps, "\t"), (line, " ")):
            if other == " " and "\t" in line:
                continue  # blanks between tabs belong to names
            found = [cell for cell in _cells(number, each, other) if cell]
            if len(found) == width:
                return found
    return names


def _filled(cells: Sequence[str]) -> int:
    """How many cells there are, without empty ones at the end."""
    return max((k for k, cell in enumerate(cells, start=1) if cell), default=0)


def _odd_row(table: _Table, last: int, named: bool) -> str:
    """Which row has other cells than there are columns, so that nobody knows which cell belongs to which; empty: none.

    last: the last column that is read. named: whether a column is found by its name; else places in the rows count,
    and between semicolons and tabs these are never in doubt.
    """
    names, rows, separator = table.names, table.rows, table.separator
    if not rows or (not named and separator in ";\t"):
        return ""
    header = named or (separator == "," and len(names) > 1)  # a title above the rows counts no columns
    width = _filled(names if header and names else rows[0])
    there = f"the {'header line' if header and names else 'first row'} has {width}"
    all_short = named and bool(names) and max(map(len, rows)) < width
    short = separator == " " or (separator == "," and not names) or all_short
    whole = [row for row in rows if len(row) == width]
    for row, line in zip(rows, table.lines, strict=True):
        found = _filled(row)
        if found > width:
            remark = width - 1 > last and _is_text(row[width - 1]) and _no_numbers(whole, width - 1)
            if remark or (not named and separator == " " and _is_text(row[width])):
                continue  # a remark behind the last column that is read, with separators in it
        elif len(row) >= width or not short or (found > last and _no_numbers(whole, found)):
            continue
        advice = _advice(row, separator, found > width, bool(names))
        return f"line {line}: the row has {counted(found, 'cell')}, {there}; {advice}"
    return ""


def _is_text(cell: str) -> bool:
    """Whether a cell has something that is no number."""
    return bool(cell) and number_in(cell) is None


def _no_numbers(rows: Sequence[Sequence[str]], first: int) -> bool:
    """Whether there are rows, and none has a number in a column from one on: remarks, which a row may lack."""
    return bool(rows) and all(number_in(cell) is None for row in rows for cell in row[first:])


def _advice(row: Sequence[str], separator: str, more: bool, names: bool) -> str:
    """What separates columns here, and what to do about a row with more or fewer cells than columns."""
    advice = f"columns are taken to stand between {SEPARATORS[separator]}"
    if (more or not names) and separator == "," and re.search(r"\d,\d", ",".join(row)):
        return f"{advice}, and {DECIMAL_COMMA}"
    if not more and separator == " ":
        return f"{advice}; commas between columns say which is empty"
    if not more and names and separator == ",":
        return f"{advice}; names with commas stand in quotation marks"
    return advice


def _place(column: Column, table: _Table) -> int | str:
    """Where a column stands, or the sentence why it does not."""
    if isinstance(column, int):
        if column < max(table.width, len(table.names)):
            return column
        return f"found the column number {column}, the file has {counted(table.width, 'column')}, numbered from 0"
    if table.names.count(column) > 1:
        return f"found {table.names.count(column)} columns called {shown(column)}: state the number of one, from 0"
    if column in table.names:
        return table.names.index(column)
    if not table.names:
        return f"found the column {shown(column)}, the file has no header line: state the number of the column, from 0"
    hint = did_you_mean(column, table.names)
    return f"found the column {shown(column)}{hint or ','} the file has {listed(table.names)}"


def _numbers(name: str, table: _Table, columns: Sequence[int]) -> tuple[FloatArray, list[str]]:
    """(rows, columns) the numbers in some columns of a file, and what is wrong with it."""
    told: list[str] = []
    numbers = np.empty((len(table.rows), len(columns)))
    for i, (cells, line) in enumerate(zip(table.rows, table.lines, strict=True)):
        for c, column in enumerate(columns):
            cell = cells[column] if column < len(cells) else ""
            value = number_in(cell)
            if value is None or not math.isfinite(value):
                what = shown(cell) if cell else "nothing"
                hint = f"; {DECIMAL_COMMA}" if re.fullmatch(r"[-+]?\d+,\d+", cell) else ""
                if len(told) < MOST_TOLD:
                    title = table.title(column)
                    told.append(f"{name}, line {line}: found {what}, allowed is a finite number (column {title}){hint}")
                value = math.nan
            numbers[i, c] = value
    return numbers, told
