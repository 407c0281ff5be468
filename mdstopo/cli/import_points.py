"""Points in drawings: tables of numbers (CSV), DXF and SVG. What comes out is points by the name of their layer."""

import csv
import io
import math
import re
import xml.etree.ElementTree as Xml
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import chain, pairwise
from pathlib import Path

from mdstopo.case.text.words import DECIMAL_SIGN
from mdstopo.shown import counted

Point = tuple[float, ...]
Layers = dict[str, list[Point]]

#: metres in the units of a DXF file's header ($INSUNITS); 0: it does not say; from 21 on those of the US survey
DXF_UNITS = {
    1: 0.0254, 2: 0.3048, 3: 1609.344, 4: 1e-3, 5: 1e-2, 6: 1.0, 7: 1e3, 8: 2.54e-8, 9: 2.54e-5, 10: 0.9144, 11: 1e-10,
    12: 1e-9, 13: 1e-6, 14: 0.1, 15: 10.0, 16: 100.0, 17: 1e9, 21: 1200 / 3937, 22: 100 / 3937, 23: 3600 / 3937,
    24: 6336000 / 3937,
}  # fmt: skip
#: SVG commands of a path and how many numbers each takes; the last two are where it ends
SVG_COMMANDS = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}
_LENGTH = r"(?:-|[nuµμmcdk]?m|in|inch|inches|ft|feet|yd|mi|px|pt|pixels?|met(?:er|re)s?|millimet(?:er|re)s?)"
#: a letter with its unit in the name of a column, and a unit that blanks have made a cell of its own
_WITH_UNIT = re.compile(rf"([xyz])(?:\s*\[{_LENGTH}\]|\s*\({_LENGTH}\)|\s*/\s*{_LENGTH}|[_ ]{_LENGTH})")
_UNIT_ALONE = re.compile(rf"\[{_LENGTH}\]|\({_LENGTH}\)", re.IGNORECASE)
#: a number with a decimal comma, and what is left between two commas of two such numbers behind a blank
_DECIMAL = re.compile(r"[-+]?\d+,\d+|\d+\s+[-+]?\d+")
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
#: an arc of a path: its two flags are one digit each, which the next number may follow at once
_ARC = r"[\s,]*".join(f"({each})" for each in (*[_NUMBER] * 3, "[01]", "[01]", *[_NUMBER] * 2))


class ImportedError(ValueError):
    """The file cannot be taken; a sentence that says why. `exit_status` as of a bad case."""

    exit_status = 2


@contextmanager
def mistakes_in(place: str) -> Iterator[None]:
    """Tell values that cannot be read with the place in which they stand; what has been told already stays."""
    try:
        yield
    except ImportedError:
        raise
    except ValueError as error:
        raise ImportedError(f"{place}: {error}") from None


def points_in(path: Path, data: str) -> tuple[Layers, float | None]:
    """Points (x, y) or (x, y, z) by layer, as the file has them, and metres in its unit where it says so.

    Raises ImportedError.
    """
    readers = {".csv": _csv, ".txt": _csv, ".dxf": _dxf, ".svg": _svg}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise ImportedError(f"{path}: points are read from {', '.join(readers)}")
    layers, unit = reader(data, path)
    found = {name: _once(points) for name, points in layers.items() if points}
    if not found:
        raise ImportedError(f"{path}: there are no points in it")
    return found, unit


def _once(points: list[Point]) -> list[Point]:
    """Each point once, in order."""
    return list(dict.fromkeys(points))


def _csv(data: str, path: Path) -> tuple[Layers, None]:
    """Columns x, y or x, y, z, with a line of names or without; a column of text names the layer.

    Where a line of names has an x and a y, these are the columns; other numbers, as those that count rows, are no
    coordinates.
    """
    layers: Layers = {}
    names: list[str] = []
    sample = data[:4096]
    delimiter = next((each for each in (";", "\t", ",") if each in sample), " ")
    rows = csv.reader(io.StringIO(data), delimiter=delimiter, skipinitialspace=True)
    try:
        for number, row in enumerate(rows, start=1):
            cells = [cell.strip() for cell in row]
            there = [cell for cell in cells if cell]
            if not there or there[0].startswith("#"):
                continue
            if not layers and not any(map(_is_number, there)):
                if _decimal(there):
                    told = f"found {delimiter.join(there)}{_decimal(there)}, allowed are numbers"
                    raise ImportedError(f"{path}, line {number}: {told}")
                if not _coordinates(names):  # a second line, as one of units, leaves the first
                    names = [cell for cell in there if not _UNIT_ALONE.fullmatch(cell)] if delimiter == " " else cells
                continue
            with mistakes_in(f"{path}, line {number}"):
                if delimiter in " \t" and len(there) == len([name for name in names if name]) != len(cells):
                    cells = there  # blanks and tabs that only align
                named = bool(_coordinates(names))
                layer, point = _named_point(names, cells, delimiter) if named else _point(names, there)
            layers.setdefault(layer or path.stem, []).append(point)
    except csv.Error as error:
        raise ImportedError(f"{path}, line {rows.line_num}: a cell cannot be read: {error}") from None
    return layers, None


def _is_number(cell: str) -> bool:
    return re.fullmatch(_NUMBER, cell) is not None and math.isfinite(float(cell))


def _decimal(cells: list[str]) -> str:
    """What is said of numbers with a decimal comma, empty where there is none."""
    return f" ({DECIMAL_SIGN})" if any(_DECIMAL.fullmatch(cell) for cell in cells) else ""


def _named_point(names: list[str], cells: list[str], delimiter: str) -> tuple[str, Point]:
    """The layer (empty: none) and the coordinates in the columns that names call x, y and perhaps z."""
    columns = _coordinates(names)
    filled = max(k for k, cell in enumerate(cells, start=1) if cell)
    last = len(names) - 1  # may be a remark with separators in it
    more = filled > len(names) and (last in columns or not cells[last] or _is_number(cells[last]))
    if more or (delimiter == " " and filled < len(names)):
        hint = f" ({DECIMAL_SIGN})" if delimiter == "," and re.search(r"\d,\d", ",".join(cells)) else ""
        told = f"found {delimiter.join(cells)}{hint}, which has {counted(filled, 'cell')}"
        raise ValueError(f"{told}; the line of names has {len(names)}")
    for column in columns:
        cell = cells[column] if column < len(cells) else ""
        if not _is_number(cell):
            told = f"found {cell or 'nothing'}{_decimal([cell])} in column {names[column]}"
            raise ValueError(f"{told}, allowed is a number")
    texts = {k: cell for k, cell in enumerate(cells) if cell and k not in columns and not _is_number(cell)}
    titles = [name.lower() for name in names]
    layer = texts.get(titles.index("layer")) if "layer" in titles else None
    return layer or next(iter(texts.values()), ""), tuple(float(cells[k]) for k in columns)


def _point(names: list[str], cells: list[str]) -> tuple[str, Point]:
    """The layer (empty: none) and all numbers of a row, in order: columns have no names, or others than x and y."""
    words = [cell for cell in cells if not _is_number(cell)]
    numbers = tuple(float(cell) for cell in cells if _is_number(cell))
    if len(numbers) not in (2, 3) or len(words) > 1 or _decimal(words):
        raise ValueError(f"found {', '.join(cells)}{_decimal(cells)}, allowed are x, y or x, y, z and a name")
    if len(numbers) == 3 and len(names) == len(cells):
        told = (
            f"found {', '.join(cells)} in columns called {', '.join(names)}, which may be x, y, z or a number and x, y"
        )
        raise ValueError(f"{told}: call the coordinates x, y and z")
    return words[0] if words else "", numbers


def _coordinates(names: list[str]) -> list[int]:
    """The places of x, y and perhaps z among names of columns; empty without x and y.

    These are `x`, else the letter with a unit of length, such as `x_mm`, `x/mm` or `X [m]`; `x_std` is none.
    """
    titles = [name.lower() for name in names]
    found: dict[str, int] = {}
    for place, title in enumerate(titles):
        letter = _WITH_UNIT.fullmatch(title)
        if letter is not None:
            found.setdefault(letter[1], place)
    found |= {axis: titles.index(axis) for axis in "xyz" if axis in titles}
    return [found[axis] for axis in "xyz" if axis in found] if {"x", "y"} <= set(found) else []


def _dxf(data: str, path: Path) -> tuple[Layers, float | None]:
    """Ends of lines, vertices of polylines, points, and centres of circles and arcs, by layer; x and y alone."""
    lines = [line.strip() for line in data.splitlines()]
    if len(lines) < 2 or lines[0].startswith("AutoCAD Binary"):
        raise ImportedError(f"{path}: only DXF in text is read; save it as ASCII")
    try:
        pairs = [(int(code), value) for code, value in zip(lines[::2], lines[1::2], strict=False)]
    except ValueError as error:
        raise ImportedError(f"{path}: this is no DXF: {error}") from None
    with mistakes_in(f"{path}"):
        return _dxf_layers(pairs), _dxf_unit(pairs)


def _dxf_layers(pairs: list[tuple[int, str]]) -> Layers:
    layers: Layers = {}
    for kind, fields in _entities(pairs):
        xs = [float(value) for code, value in fields if code in (10, 11) and (code == 10 or kind == "LINE")]
        ys = [float(value) for code, value in fields if code in (20, 21) and (code == 20 or kind == "LINE")]
        layer = next((value for code, value in fields if code == 8), "0")
        layers.setdefault(layer, []).extend(zip(xs, ys, strict=False))
    return layers


def _dxf_unit(pairs: list[tuple[int, str]]) -> float | None:
    """Metres in the file's unit, None where it does not say."""
    unit = next((int(value) for (code, name), (_, value) in pairwise(pairs) if (code, name) == (9, "$INSUNITS")), 0)
    if unit and unit not in DXF_UNITS:
        raise ValueError(f"its unit is number {unit} of DXF, which is not known here; save it in another one")
    return DXF_UNITS.get(unit)


def _entities(pairs: list[tuple[int, str]]) -> Iterator[tuple[str, list[tuple[int, str]]]]:
    """The entities of a DXF file that have points: their kind, and their group codes with values."""
    inside, kind = False, ""
    fields: list[tuple[int, str]] = []
    for place, (code, value) in enumerate(pairs):
        if code == 0:
            if kind in ("LINE", "LWPOLYLINE", "VERTEX", "POINT", "CIRCLE", "ARC"):
                yield kind, fields
            kind, fields = "", []
            if value == "SECTION":
                inside = pairs[place + 1 : place + 2] == [(2, "ENTITIES")]
            elif value == "ENDSEC":
                inside = False
            elif inside:
                kind = value
        elif kind:
            fields.append((code, value))


def _svg(data: str, path: Path) -> tuple[Layers, float | None]:
    """Vertices of shapes and paths, ends of their curves, and centres of circles, by the id of the shape or its group.

    y points up in what comes out. A unit is known where width is given as a length and a viewBox stands beside it.
    """
    try:
        root = Xml.fromstring(data)
    except Xml.ParseError as error:
        raise ImportedError(f"{path}: this is no SVG: {error}") from None
    layers: Layers = {}
    _svg_node(root, path.stem, layers, path)
    return {name: [(x, 0.0 - y) for x, y in points] for name, points in layers.items()}, _svg_unit(root)


def _svg_node(node: Xml.Element, name: str, layers: Layers, path: Path) -> None:
    kind = node.tag.rpartition("}")[2]
    name = node.get("id", name)
    if node.get("transform"):
        raise ImportedError(f"{path}: {kind} {name!r} has a transform, which is not read; ungroup or flatten it first")
    if kind in ("defs", "clipPath", "mask", "symbol"):
        return
    with mistakes_in(f"{path}: {kind} {name!r}"):
        layers.setdefault(name, []).extend(_svg_points(kind, node))
    for child in node:
        _svg_node(child, name, layers, path)


def _svg_points(kind: str, node: Xml.Element) -> list[Point]:
    def number(key: str) -> float:
        stated = node.get(key, "0").strip().removesuffix("px")
        if not re.fullmatch(_NUMBER, stated):
            raise ValueError(f"{key} is {stated!r}, allowed is a number of the drawing's units")
        return float(stated)

    if kind in ("polygon", "polyline"):
        values = [float(each) for each in re.findall(_NUMBER, node.get("points", ""))]
        return list(zip(values[::2], values[1::2], strict=False))
    if kind == "line":
        return [(number("x1"), number("y1")), (number("x2"), number("y2"))]
    if kind == "rect":
        x, y, w, h = (number(key) for key in ("x", "y", "width", "height"))
        return [(x, y), (x + w, y), (x + w, y + h), (x, y + h)]
    if kind in ("circle", "ellipse"):
        return [(number("cx"), number("cy"))]
    return path_points(node.get("d", "")) if kind == "path" else []


def path_points(text: str) -> list[Point]:
    """Where the pieces of an SVG path begin and end."""
    found: list[Point] = []
    x = y = x0 = y0 = 0.0
    for command, rest in re.findall(r"([MLHVCSQTAZmlhvcsqtaz])([^MLHVCSQTAZmlhvcsqtaz]*)", text):
        letter = command.upper()
        stated = chain.from_iterable(re.findall(_ARC, rest)) if letter == "A" else re.findall(_NUMBER, rest)
        values = [float(each) for each in stated]
        count = SVG_COMMANDS[letter]
        if letter == "Z":
            x, y = x0, y0
            continue
        for at in range(0, len(values) - count + 1, count):
            own = values[at : at + count]
            dx, dy = (x, y) if command.islower() else (0.0, 0.0)
            x, y = (
                (own[0] + dx, y)
                if letter == "H"
                else (x, own[0] + dy)
                if letter == "V"
                else (own[-2] + dx, own[-1] + dy)
            )
            if letter == "M" and at == 0:
                x0, y0 = x, y
            found.append((x, y))
    return found


def _svg_unit(root: Xml.Element) -> float | None:
    """Metres in a unit of the drawing, where its width is a length and a viewBox says how many units that is."""
    width = re.fullmatch(rf"({_NUMBER})(mm|cm|in)", root.get("width", "").strip())
    box = [float(each) for each in re.findall(_NUMBER, root.get("viewBox", ""))]
    if width is None or len(box) != 4 or box[2] <= 0.0:
        return None
    unit = float(width[1]) * {"mm": 1e-3, "cm": 1e-2, "in": 0.0254}[width[2]] / box[2]
    return float(f"{unit:.12g}") if math.isfinite(unit) else None
