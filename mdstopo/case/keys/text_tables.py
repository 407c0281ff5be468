"""Tables in text files: columns of numbers and words, found by the names in the header line or by their places.

Lines that begin with `#`, empty lines, and what follows a blank and `#` say nothing. Columns stand between semicolons,
tabs, commas or blanks, whichever most lines have.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.keys.number_rows import MOST_TOLD, number_in
from mdstopo.case.text.words import did_you_mean, listed, shown
from mdstopo.shown import counted

#: what may stand between columns, first to last choice; a blank stands for all blanks
SEPARATORS = {";": "semicolons", "\t": "tabs", ",": "commas", " ": "blanks"}
DECIMAL_COMMA = "numbers have a point, not a comma"
_QUOTED = r'"[^"]*"'


class TextTable(NamedTuple):
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


def text_table(text: str) -> TextTable:
    """The table in the text of a file. Raises ValueError with the line that has no cells."""
    return _columns(_written_lines(text))


def _written_lines(text: str) -> list[tuple[int, str]]:
    """The lines of a text that have cells, without remarks, each with its number from 1."""
    written = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    return [(number, _without_remark(line, k == 0)) for k, (number, line) in enumerate(written)]


def _without_remark(line: str, first: bool) -> str:
    """A line without what follows a blank and `#`, beside quotation marks; in the first, `force #2` may be a name."""
    behind = r"(?:\s.*|$)" if first else ".*"
    return re.sub(rf"({_QUOTED})|\s#{behind}", lambda found: found[1] or "", line)


def _columns(written: list[tuple[int, str]]) -> TextTable:
    """The table of lines with their numbers. Raises ValueError with the line that has no cells."""
    lines = [number for number, _ in written]
    separator = _separator_of(written[1:] or written)
    has_names = bool(written) and _names_columns(*written[0], separator)
    if not has_names:
        separator = _separator_of(written)
    there = written[has_names:]
    rows = [_cells_of(*each, separator) for each in there]
    names = _names(*written[0], separator, rows) if has_names else []
    if names and separator == "\t" and max(map(_filled, rows), default=0) > _filled(names):
        # tabs that only align: the header line has as many names as each row has cells if several tabs are one gap
        spaced = [_cells_of(*each, " ") for each in there]
        apart = _names(*written[0], " ", spaced)
        if {len(row) for row in spaced} == {len(apart)}:
            names, rows, separator = apart, spaced, " "
    if separator == "\t":  # a column without a name and without a cell is no column
        width = max(map(len, (names, *rows)), default=0)
        kept = [k for k in range(width) if any(row[k : k + 1] not in ([], [""]) for row in (names, *rows))]
        names, *rows = ([row[k] for k in kept if k < len(row)] for row in (names, *rows))
    return TextTable(tuple(each.strip("\"'") for each in names), rows, lines[has_names:], separator)


def _separator_of(lines: Sequence[tuple[int, str]]) -> str:
    """What stands between columns: the first of semicolon, tab and comma that most lines have, else blanks."""
    bare = [re.sub(_QUOTED, "q", line).strip() for _, line in lines]
    return next((each for each in SEPARATORS if 2 * sum(each in line for line in bare) > len(bare)), " ")


def _names_columns(number: int, line: str, separator: str) -> bool:
    """Whether the first line is a header line: no cell is a number, and neither are they all with other separators."""
    if any(number_in(cell) is not None for cell in _cells_of(number, line, separator)):
        return False
    return any(number_in(word) is None for word in re.split(r"[;,\s]+", line) if word)


def _cells_of(number: int, line: str, separator: str) -> list[str]:
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
    names = _cells_of(number, line, separator)
    if separator == " " and "\t" in line.strip():
        names = [cell for cell in _cells_of(number, line, "\t") if cell]
    width = max(map(_filled, rows), default=len(names))
    if len(names) != width > 1 and (len(names) == 1 or separator == " "):
        gaps = re.sub(r"\s{2,}", "\t", line.strip())
        for each, other in ((line, ";"), (line, "\t"), (line, ","), (gaps, "\t"), (line, " ")):
            if other == " " and "\t" in line:
                continue  # blanks between tabs belong to names
            found = [cell for cell in _cells_of(number, each, other) if cell]
            if len(found) == width:
                return found
    return names


def _filled(cells: Sequence[str]) -> int:
    """How many cells there are, without empty ones at the end."""
    return max((k for k, cell in enumerate(cells, start=1) if cell), default=0)


def odd_row(table: TextTable, last: int, named: bool) -> str:
    """A sentence on the first row whose number of cells is not that of the columns, so that it is open which cell is of
    which column; empty where there is none.

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


def place_of(column: str | int, table: TextTable) -> int | str:
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


def numbers_of(name: str, table: TextTable, columns: Sequence[int]) -> tuple[FloatArray, list[str]]:
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
