"""Rows of numbers, in place or from a CSV file: tables of time, curves, lists of points; signals of them."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray, Table, read_only
from mdstopo.case.keys.kinds import Number, Schema, expressible, has_unit, with_unit
from mdstopo.case.keys.records import Key, Record
from mdstopo.case.keys.time_formula import formula_record, is_expression, is_formula, read_formulas
from mdstopo.case.text.nodes import MAPPING, SCALAR, SEQUENCE, Node
from mdstopo.case.text.reading import BAD, Bad, Fields, Reading, found
from mdstopo.case.text.scalars import resolve, to_float
from mdstopo.case.text.words import inside, number_text, shown
from mdstopo.case.value import Value, frozen

MOST_TOLD = 10
"""Mistakes told of one set of rows; more would only repeat themselves."""


@frozen
class FileName(Value):
    """The kind of a path of a file, relative to the case file."""

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The path at a node of the file, or BAD with a mistake noted."""
        value = node.scalar() if node.kind == SCALAR else None
        if isinstance(value, str) and value and "\0" not in value:
            return value
        reading.mistake(path, f"found {found(node)}, allowed is the path of a file", node)
        return BAD

    def schema(self) -> Schema:
        """The JSON Schema: a text that is not empty."""
        return {"type": "string", "minLength": 1}


FILE = Record(
    "a file of rows",
    (Key("file", FileName(), "path, relative to the case file: columns of numbers, one header line allowed", True),),
    doc="Rows from a file instead of in place.",
)


@frozen
class Rows(Value):
    """The kind of a table: rows of finite numbers, or {file: path} of a file with such rows.

    columns: what stands in each. order of the first column: ``time`` (may not fall, two rows at most share a
    value), ``rising`` (no repeats), ``free``. at_least: how many rows are needed.
    """

    columns: tuple[str, ...]
    order: str = "time"
    at_least: int = 1

    @property
    def row_text(self) -> str:
        """The columns of a row in words, for messages."""
        return f"[{', '.join(self.columns)}]"

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The table (n, columns) at a node of the file, or BAD with a mistake noted."""
        if node.kind == SEQUENCE:
            return self._listed(node, path, reading)
        if node.kind == MAPPING:
            fields = FILE.read(node, path, reading)
            if fields["file"] is BAD:
                return BAD
            name = fields["file"]
            return self._file(name, node.entries["file"][1], inside(path, "file"), reading)
        message = f"found {found(node)}, allowed is a list of rows {self.row_text} or {{file: path}}"
        reading.mistake(path, message, node)
        return BAD

    def _listed(self, node: Node, path: str, reading: Reading) -> Any:
        width = len(self.columns)
        values = np.empty((len(node.items), width))
        wrong = 0
        for index, row in enumerate(node.items):
            if row.kind == SEQUENCE and len(row.items) == width:
                for column, cell in enumerate(row.items):
                    number: Any = _number(cell)
                    if has_unit(cell):
                        number = self._measured(cell, f"{path}[{index}]", column, reading)
                        if number is BAD:
                            wrong += 1
                            continue
                    values[index, column] = number
                    if not math.isfinite(number):
                        wrong += 1
                        if wrong <= MOST_TOLD:
                            what = self.columns[column]
                            message = f"found {found(cell)}, allowed is a finite number ({what})"
                            reading.mistake(f"{path}[{index}][{column}]", message, cell)
            else:
                wrong += 1
                if wrong <= MOST_TOLD:
                    message = f"found {found(row)}, allowed is a row {self.row_text}"
                    reading.mistake(f"{path}[{index}]", message, row)
        if wrong:
            return BAD
        rows = node.items
        return self._checked(values, path, node, reading, lambda index: (f"{path}[{index}]", rows[index], ""))

    def _measured(self, cell: Node, path: str, column: int, reading: Reading) -> float | Bad:
        """The number of a cell that has a unit: times are in s, whatever the others are in."""
        around = reading.unit
        if column == 0 and self.columns[0] == "t":
            reading.unit = "s"
        try:
            return with_unit(cell, f"{path}[{column}]", reading)
        finally:
            reading.unit = around

    def _file(self, name: str, node: Node, path: str, reading: Reading) -> Any:
        data = reading.include(name)
        if isinstance(data, str):
            reading.mistake(path, data, node)
            return BAD
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            reading.mistake(path, f"the file {shown(name)} is not text in UTF-8", node)
            return BAD
        rows: list[list[float]] = []
        numbers: list[int] = []
        wrong, first = 0, True
        for number, line in enumerate(text.splitlines(), start=1):
            cells = cells_of(line)
            if not cells:
                continue
            row = [number_in(cell) for cell in cells]
            header, first = first and all(cell is None for cell in row), False
            if header:
                continue
            if len(row) != len(self.columns) or not all(c is not None and math.isfinite(c) for c in row):
                wrong += 1
                if wrong <= MOST_TOLD:
                    message = (
                        f"{name}, line {number}: found {shown(line.strip())}, "
                        f"allowed are {len(self.columns)} finite numbers ({', '.join(self.columns)})"
                    )
                    reading.mistake(path, message, node)
                continue
            rows.append([c for c in row if c is not None])
            numbers.append(number)
        if wrong:
            return BAD
        values = np.array(rows, dtype=np.float64).reshape(len(rows), len(self.columns))
        return self._checked(
            values, path, node, reading, lambda index: (path, node, f"{name}, line {numbers[index]}: ")
        )

    def _checked(self, values: FloatArray, path: str, node: Node, reading: Reading, place: Any) -> Any:
        """`values` where count and order are right, else BAD. place(i): path, node and prefix of row i."""
        if len(values) < self.at_least:
            count = "one row" if len(values) == 1 else f"{len(values)} rows"
            needed = "one" if self.at_least == 1 else str(self.at_least)
            verb = "is" if self.at_least == 1 else "are"
            reading.mistake(path, f"found {count}, needed {verb} at least {needed}", node)
            return BAD
        if self.order == "free":
            return values
        first = values[:, 0]
        steps = np.diff(first)
        if self.order == "rising":
            wrong, rule = np.flatnonzero(steps <= 0) + 1, "each must be larger than the one before"
        else:
            falls = steps < 0
            falls[1:] |= (steps[1:] == 0) & (steps[:-1] == 0)
            wrong, rule = np.flatnonzero(falls) + 1, "times may not fall, and at most two rows share one"
        for index in wrong[:MOST_TOLD]:
            where, at, prefix = place(int(index))
            now, before = number_text(float(first[index])), number_text(float(first[index - 1]))
            reading.mistake(where, f"{prefix}found {self.columns[0]} {now} after {before}; {rule}", at)
        if len(wrong):
            return BAD
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            slopes = np.diff(values[:, 1:], axis=0) / steps[:, None]
        for index in np.flatnonzero(~np.isfinite(slopes).all(axis=1) & (steps > 0))[:MOST_TOLD] + 1:
            where, at, prefix = place(int(index))
            reading.mistake(where, f"{prefix}the slope from the row before is too large for a number", at)
            return BAD
        return values

    def schema(self) -> Schema:
        """The JSON Schema: rows of numbers, or the name of a file with them."""
        width = len(self.columns)
        row = {"type": "array", "items": expressible("number"), "minItems": width, "maxItems": width}
        title = f"rows {self.row_text}"
        rows = {"type": "array", "title": title, "items": row, "minItems": self.at_least}
        return {"anyOf": [rows, FILE.schema()]}


def _number(node: Node) -> float:
    """The number at a node; infinite or NaN where it is none."""
    if node.kind != SCALAR or not node.plain:
        return math.nan
    value = resolve(node.text)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return math.nan
    return to_float(value)


def cells_of(line: str) -> list[str]:
    """The cells of a line: between commas, else semicolons, else blanks; none in a blank line."""
    if not line.strip():
        return []
    for separator in (",", ";"):
        if separator in line:
            return line.split(separator)
    return line.split()


def number_in(text: str) -> float | None:
    """The number in a cell, NaN or infinite where it says so, None where it is no number."""
    text = text.strip()
    value = resolve(text) if text else None
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return math.nan if re.fullmatch(r"[-+]?(nan|inf|infinity)", text.lower()) else None
    return to_float(value)


def rows_in(text: str) -> list[list[float]]:
    """The rows of an included file that has been read without a mistake: its numbers, without the header line."""
    rows = [[number_in(cell) for cell in cells_of(line)] for line in text.removeprefix("\ufeff").splitlines()]
    return [[cell for cell in row if cell is not None] for row in rows if any(cell is not None for cell in row)]


@frozen
class Signals(Value):
    """The kind of quantities over time: constants, a table, or formulas.

    One quantity: a number, {table: rows} or the rows. Two: a list of two such values, {table: rows [t, x, y]}
    or the rows. Read as a tuple with one Signal for each name (or BAD). constant: whether a number will do;
    order, at_least: as in `Rows`. formula: whether formulas of time will do, in place of a number or of all.
    """

    names: tuple[str, ...]
    constant: bool = True
    order: str = "time"
    at_least: int = 1
    formula: bool = False

    @property
    def rows(self) -> Rows:
        """The kind of a table whose rows are a time and the values of all quantities."""
        return Rows(("t", *self.names), self.order, self.at_least)

    @property
    def table(self) -> Record:
        """The kind of a mapping with the key `table`: rows of a time and the values of all quantities."""
        rows = Key("table", self.rows, f"rows {self.rows.row_text}, linear between them", True)
        return Record("a table of time", (rows,), doc="A quantity over time.")

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The quantities over time at a node of the file, a signal each, or BAD with a mistake noted."""
        if self.formula and (is_formula(node) or self._is_text(node)):
            number = "a number, " if self.constant else ""
            own = "; numbers of its own have names in {formula: ..., parameters: {...}}"
            instead = f"allowed is {number}an expression of t, or {{table: rows {self.rows.row_text}}}{own}"
            return read_formulas(node, self.names, path, reading, instead)
        if node.kind == MAPPING and "table" not in node.entries and "file" in node.entries:
            return self._split(self.rows.read(node, path, reading))
        if node.kind == MAPPING:
            fields: Fields = self.table.read(node, path, reading)
            return self._split(fields["table"])
        if node.kind == SEQUENCE and self._is_rows(node):
            return self._split(self.rows.read(node, path, reading))
        if len(self.names) == 1:
            text = node.kind == SCALAR and isinstance(node.scalar(), (str, type(None))) and not has_unit(node)
            if not self.constant or node.kind != SCALAR or text:
                others = ("a number or " if self.constant else "") + ("an expression of t or " if self.formula else "")
                allowed = f"{others}{{table: rows {self.rows.row_text}}}"
                reading.mistake(path, f"found {found(node)}, allowed is {allowed}", node)
                return BAD
            value = Number().read(node, path, reading)
            return BAD if value is BAD else (value,)
        if node.kind != SEQUENCE or len(node.items) != len(self.names):
            formula = ", {formula: expressions of t}" if self.formula else ""
            allowed = f"[{', '.join(self.names)}]{formula} or {{table: rows {self.rows.row_text}}}"
            reading.mistake(path, f"found {found(node)}, allowed is {allowed}", node)
            return BAD
        parts = [
            Signals((name,), formula=self.formula).read(item, f"{path}[{index}]", reading)
            for index, (name, item) in enumerate(zip(self.names, node.items, strict=True))
        ]
        return BAD if any(part is BAD for part in parts) else tuple(part[0] for part in parts)

    def _is_text(self, node: Node) -> bool:
        """Whether one quantity is stated as text that is no number with a unit."""
        text = len(self.names) == 1 and node.kind == SCALAR and isinstance(node.scalar(), str)
        return text and (not has_unit(node) or is_expression(node.text))

    def _is_rows(self, node: Node) -> bool:
        if len(self.names) == 1:
            return True
        return bool(node.items) and all(item.kind == SEQUENCE for item in node.items)

    @staticmethod
    def _split(values: Any) -> Any:
        if values is BAD:
            return BAD
        times = read_only(values[:, 0])  # one copy for all
        return tuple(Table(times, values[:, column : column + 1]) for column in range(1, values.shape[1]))

    def schema(self) -> Schema:
        """The JSON Schema: a constant, a table of time, or formulas."""
        tables = [self.table.schema(), self.rows.schema()]
        if self.formula:
            tables.append(formula_record(self.names).schema())
        n = len(self.names)
        if not self.constant:
            return {"anyOf": [*([{"type": "string"}] if self.formula and n == 1 else []), *tables]}
        if n == 1:
            return {"anyOf": [expressible("number"), *tables]}
        part = Signals(("value",), formula=self.formula).schema()
        return {"anyOf": [{"type": "array", "items": part, "minItems": n, "maxItems": n}, *tables]}
