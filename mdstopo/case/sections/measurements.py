"""Measured series from files with columns of numbers (`text_tables`)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mdstopo.case.arrays import FloatArray, IndexArray
from mdstopo.case.keys.number_rows import MOST_TOLD
from mdstopo.case.keys.text_tables import TextTable, numbers_of, odd_row, place_of, text_table
from mdstopo.case.model import Case
from mdstopo.case.objects.fitting import Series
from mdstopo.case.text.errors import CaseError, Mistake
from mdstopo.case.text.reading import Reading
from mdstopo.case.text.words import inside, number_text, shown


class Measured(NamedTuple):
    """One series as it was recorded, scaled: t, y (n,), deviation (n,) or None where it is not known."""

    series: Series
    t: FloatArray
    y: FloatArray
    deviation: FloatArray | None


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
        place = place_of(column, table)
        if isinstance(place, str):
            yield key, f"{place} ({series.file})"
        else:
            columns[key] = place
    if len(columns) < 2 + isinstance(series.deviation, str):
        return
    named = any(isinstance(each, str) for each in (series.time, series.value, series.deviation))
    odd = odd_row(table, max(columns.values()), named)
    if odd:
        yield "file", f"{series.file}, {odd}"
        return
    numbers, told = numbers_of(series.file, table, list(columns.values()))
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


def _table(name: str, reading: Reading) -> TextTable | str:
    """The cells of a file, or the sentence why there are none."""
    data = reading.include(name)
    if isinstance(data, str):
        return data
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return f"the file {shown(name)} is not text in UTF-8"
    try:
        return text_table(text)
    except ValueError as error:
        return f"{name}, {error}"
