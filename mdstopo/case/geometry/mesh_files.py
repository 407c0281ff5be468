"""STL and OBJ files: their vertices as points of a grid, their faces as what is drawn of a body."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray, read_only
from mdstopo.case.keys.number_rows import FileName
from mdstopo.case.text.nodes import Node
from mdstopo.case.text.reading import BAD, Reading
from mdstopo.case.text.words import shown

_HEAD, _FACET = 84, 50
"""Bytes of a binary STL file before its facets, and of each of these."""
MOST_FACES = 20_000
"""Faces of a file that is drawn; pages with more of them do not turn smoothly."""
SHARP = math.cos(math.radians(30.0))
"""Edges are drawn where faces meet at more than this angle (its cosine)."""
Numbers = tuple[tuple[int, ...], ...]


class MeshError(ValueError):
    """The file is no mesh that can be read; a sentence without a full stop."""


class _OfMesh(FileName):
    """The path of an STL or OBJ file, relative to the case file, and what is made of it."""

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """What is made of the file that a node names, or BAD with a mistake noted."""
        name = super().read(node, path, reading)
        if name is BAD:
            return BAD
        data = reading.include(name)
        try:
            if isinstance(data, str):
                raise MeshError(data)
            return self._made(name, data)
        except MeshError as error:
            reading.mistake(path, str(error), node)
            return BAD

    def _made(self, name: str, data: bytes) -> Any:
        """What is made of a file of that name; raises MeshError."""
        raise NotImplementedError


class MeshFile(_OfMesh):
    """The path of an STL or OBJ file, relative to the case file: its vertices (n, 3), each once, in its order."""

    def _made(self, name: str, data: bytes) -> Any:
        return read_only(vertices(name, data))


class MeshFaces(_OfMesh):
    """The path of an STL or OBJ file, relative to the case file: corners (n, 3), faces and sharp edges of its mesh."""

    def _made(self, name: str, data: bytes) -> Any:
        return surface(name, data)


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


def surface(name: str, data: bytes) -> tuple[FloatArray, Numbers, Numbers]:
    """Corners (n, 3), each once; faces; edges where faces end or meet at an angle. Raises MeshError."""
    if not is_mesh(name):
        raise MeshError(f"found {shown(name)}, allowed is a file that ends in .stl or .obj")
    if name.lower().endswith(".stl"):
        points = _binary(data)
        if points is None:
            points = _text(name, data, "vertex")
        if len(points) % 3:
            raise MeshError(f"the file {shown(name)} has {len(points)} vertices, which are no whole triangles")
        faces: list[tuple[int, ...]] = [(k, k + 1, k + 2) for k in range(0, len(points), 3)]
    else:
        points = _text(name, data, "v")
        faces = list(_obj_faces(name, data, len(points)))
    if not faces:
        raise MeshError(f"the file {shown(name)} has no faces")
    if len(faces) > MOST_FACES:
        raise MeshError(f"the file {shown(name)} has {len(faces)} faces; pictures draw up to {MOST_FACES}: simplify it")
    if not np.isfinite(points).all():
        raise MeshError(f"the file {shown(name)} has vertices that are not finite")
    corners, number = np.unique(points + 0.0, axis=0, return_inverse=True)
    number = number.reshape(-1)
    whole = [tuple(int(number[k]) for k in face) for face in faces]
    whole = [face for face in whole if len(set(face)) == len(face)]
    return read_only(corners), tuple(whole), _sharp(corners, whole)


def _obj_faces(name: str, data: bytes, count: int) -> Iterator[tuple[int, ...]]:
    """The faces of an OBJ file, by numbers of vertices from 0; negative ones count back from the last so far."""
    seen = 0
    for number, line in enumerate(data.decode("utf-8-sig").splitlines(), start=1):
        cells = line.split()
        seen += bool(cells) and cells[0] == "v"
        if not cells or cells[0] != "f":
            continue
        try:
            given = [int(cell.split("/")[0]) for cell in cells[1:]]
        except ValueError:
            given = []
        face = tuple(k - 1 if k > 0 else seen + k for k in given)
        if len(face) < 3 or not all(0 <= k < count for k in face):
            raise MeshError(f"{name}, line {number}: found {shown(line.strip())}, allowed are three vertices at least")
        yield face


def _sharp(corners: FloatArray, faces: list[tuple[int, ...]]) -> Numbers:
    """Edges of one face only, and between faces whose normals differ by more than the angle of SHARP."""
    normals: dict[tuple[int, int], list[FloatArray]] = {}
    for face in faces:
        own = corners[list(face)]
        way = np.cross(own - own[0], np.roll(own, -1, axis=0) - own[0]).sum(axis=0)
        size = float(np.linalg.norm(way))
        if size > 0.0:
            for a, b in zip(face, (*face[1:], face[0]), strict=True):
                normals.setdefault((min(a, b), max(a, b)), []).append(way / size)
    return tuple(edge for edge, ways in normals.items() if len(ways) != 2 or float(ways[0] @ ways[1]) < SHARP)


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
