"""The vertices of STL and OBJ files, as points of a grid."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray, read_only
from mdstopo.case.nodes import Node
from mdstopo.case.number_rows import FileName
from mdstopo.case.reading import BAD, Reading
from mdstopo.case.words import shown

_HEAD, _FACET = 84, 50
"""Bytes of a binary STL file before its facets, and of each of these."""


class MeshError(ValueError):
    """The file is no mesh that can be read; a sentence without a full stop."""


class MeshFile(FileName):
    """The path of an STL or OBJ file, relative to the case file: its vertices, each once, in the file's order."""

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """(n, 3) array or BAD."""
        name = super().read(node, path, reading)
        if name is BAD:
            return BAD
        data = reading.include(name)
        try:
            if isinstance(data, str):
                raise MeshError(data)
            return read_only(vertices(name, data))
        except MeshError as error:
            reading.mistake(path, str(error), node)
            return BAD


def is_mesh(name: str) -> bool:
    """Whether a file's name says that it is a mesh."""
    return name.lower().endswith((".stl", ".obj"))


def vertices(name: str, data: bytes) -> FloatArray:
    """The vertices (n, 3) in the order of a file, each once. Raises MeshError where it is none that can be read."""
    if not is_mesh(name):
        raise MeshError(f"found {shown(name)}, allowed is a file that ends in .stl or .obj")
    ending = name.lower().rpartition(".")[2]
    points = _binary(data) if ending == "stl" else None
    if points is None:
        points = _text(name, data, "vertex" if ending == "stl" else "v")
    if not len(points):
        raise MeshError(f"the file {shown(name)} has no vertices")
    if not np.isfinite(points).all():
        raise MeshError(f"the file {shown(name)} has vertices that are not finite")
    points = points + 0.0  # -0 is 0
    _, first = np.unique(points, axis=0, return_index=True)
    return np.asarray(points[np.sort(first)])


def _binary(data: bytes) -> FloatArray | None:
    """The corners of all facets of a binary STL file; None where its length is not that of one.

    A head of 80 bytes, the number of facets, then for each normal, three corners (all float32) and two bytes.
    """
    if len(data) < _HEAD or len(data) != _HEAD + _FACET * int.from_bytes(data[80:84], "little"):
        return None
    facets = np.frombuffer(data, dtype=[("numbers", "<f4", (4, 3)), ("more", "<u2")], offset=_HEAD)
    return facets["numbers"][:, 1:].reshape(-1, 3).astype(np.float64)


def _text(name: str, data: bytes, word: str) -> FloatArray:
    """What follows a word in a file's lines: x, y, z; further numbers (weights, colours) are left out."""
    try:
        lines = data.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise MeshError(f"the file {shown(name)} is neither text in UTF-8 nor a whole binary STL file") from None
    rows = []
    for number, line in enumerate(lines, start=1):
        cells = line.split()
        if not cells or cells[0] != word:
            continue
        row = [_number(cell) for cell in cells[1:4]]
        if len(row) < 3 or not all(math.isfinite(value) for value in row):
            raise MeshError(f"{name}, line {number}: found {shown(line.strip())}, allowed are three finite numbers")
        rows.append(row)
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan
