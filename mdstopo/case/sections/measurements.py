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
from mdstopo.case.keys.number_rows import MOST_TOLD, cells_of, number_in
from mdstopo.case.model import Case
from mdstopo.case.objects.fitting import Column, Series
from mdstopo.case.text.errors import CaseError, Mistake
from mdstopo.case.text.reading import Reading
from mdstopo.case.text.words import did_you_mean, inside, listed, number_text, shown


class Measured(NamedTuple):
    """One series as it was recorded, scaled: t, y (n,), deviation (n,) or None where it is not known."""

    series: Series
    t: FloatArray
    y: FloatArray
    deviation: FloatArray | None


class _Table(NamedTuple):
    """A file: the names of its columns (none without a header line), its rows of cells, and their lines."""

    names: tuple[str, ...]
    rows: list[list[str]]
    lines: list[int]


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
    tabs = bool(written) and _has_tabs(written[0][1])
    rows = [_cells(line, tabs) for _, line in written]
    lines = [number for number, _ in written]
    names: tuple[str, ...] = ()
    if rows and all(number_in(cell) is None for cell in rows[0]):
        names, rows, lines = tuple(cell.strip("\"'") for cell in rows[0]), rows[1:], lines[1:]
    blanks = bool(written) and not tabs and _separator(written[-1][1]) == " "
    odd = _odd_width(names, rows, lines, blanks)
    return f"{name}, {odd}" if odd else _Table(names, rows, lines)


def _has_tabs(first: str) -> bool:
    """Whether tabs stand between columns, by the first line: not where several in a row only align them."""
    return "\t" in first and _separator(first) == " " and all(cell.strip() for cell in first.rstrip().split("\t"))


def _separator(line: str) -> str:
    """What stands between the cells of a line, beside quoted ones; a blank for all blanks."""
    bare = re.sub(r'"[^"]*"', "", line)
    return next((each for each in ",;" if each in bare), " ")


def _cells(line: str, tabs: bool) -> list[str]:
    """The cells of a line."""
    if '"' in line:
        between = "\t" if tabs else _separator(line)
        cells = next(csv.reader([line.strip()], delimiter=between, skipinitialspace=True))
    else:
        cells = line.split("\t") if tabs else cells_of(line)
    return [cell.strip() for cell in cells]


def _filled(cells: Sequence[str]) -> int:
    """How many cells there are, without empty ones at the end."""
    return max((k for k, cell in enumerate(cells, start=1) if cell), default=0)


def _odd_width(names: Sequence[str], rows: Sequence[Sequence[str]], lines: Sequence[int], blanks: bool) -> str:
    """Which row has other cells than there are columns, so that nobody knows which cell belongs to which; empty: none.

    That is one with more, one with fewer between blanks, and the first where all have fewer than the header line names.
    names: of that line, none without one. rows, lines: the others, and where they stand. blanks: whether nothing but
    blanks is between cells.
    """
    if not rows:
        return ""
    width = _filled(names or rows[0])
    there = f"the {'header line' if names else 'first row'} has {width}"
    short = blanks or (bool(names) and max(map(len, rows)) < width)
    for row, line in zip(rows, lines, strict=True):
        found = _filled(row)
        if found > width or (short and found < width):
            why = "numbers have a point, not a comma" if found > width else "commas between columns say which is empty"
            return f"line {line}: the row has {found} cells, {there}; {why}"
    return ""


def _place(column: Column, table: _Table) -> int | str:
    """Where a column stands, or the sentence why it does not."""
    width = len(table.names) or (len(table.rows[0]) if table.rows else 0)
    if isinstance(column, int):
        if column < width:
            return column
        return f"found the column number {column}, the file has {width} columns, numbered from 0"
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
                title = table.names[column] if table.names else str(column)
                if len(told) < MOST_TOLD:
                    told.append(f"{name}, line {line}: found {what}, allowed is a finite number (column {title})")
                value = math.nan
            numbers[i, c] = value
    return numbers, told
