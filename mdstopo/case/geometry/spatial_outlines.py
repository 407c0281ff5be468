"""What is drawn of bodies in space, as a case states it. Faces go counterclockwise, seen from outside."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.geometry.outlines import Faces, Shape, centre_of, loop, polygon

ROUND, RINGS = 24, 12
"""Corners of a circle, and parts from pole to pole."""


def _polygon(corners: FloatArray, middle: FloatArray) -> tuple[FloatArray, Faces, Faces]:
    corners, faces, _ = polygon(corners, middle)
    return corners, faces, _closed(faces[0])


def _closed(face: tuple[int, ...]) -> Faces:
    return tuple(zip(face, (*face[1:], face[0]), strict=True))


def _box(keys: Any, middle: FloatArray) -> tuple[FloatArray, Faces, Faces]:
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
    faces = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    edges = tuple((a, b) for a in range(8) for b in range(a + 1, 8) if (a ^ b) in (1, 2, 4))
    return centre_of(keys, middle) + 0.5 * np.array(keys["size"]) * signs, faces, edges


def _sphere(keys: Any, middle: FloatArray) -> tuple[FloatArray, Faces, Faces]:
    """Circles of latitude between the poles, about z; the equator and two meridians are drawn."""
    rise = math.pi * (np.arange(1, RINGS) / RINGS - 0.5)
    turn = 2.0 * math.pi * np.arange(ROUND) / ROUND
    rings = np.stack(
        [
            np.outer(np.cos(rise), np.cos(turn)),
            np.outer(np.cos(rise), np.sin(turn)),
            np.outer(np.sin(rise), np.ones(ROUND)),
        ],
        axis=-1,
    )
    unit = np.concatenate([rings.reshape(-1, 3), [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]])
    foot, top = len(unit) - 2, len(unit) - 1
    faces: list[tuple[int, ...]] = []
    edges: list[tuple[int, int]] = []
    for k in range(ROUND):
        n = (k + 1) % ROUND
        faces.append((foot, n, k))
        faces += [(r * ROUND + k, r * ROUND + n, (r + 1) * ROUND + n, (r + 1) * ROUND + k) for r in range(RINGS - 2)]
        faces.append(((RINGS - 2) * ROUND + k, (RINGS - 2) * ROUND + n, top))
        edges.append(((RINGS // 2 - 1) * ROUND + k, (RINGS // 2 - 1) * ROUND + n))
        if k % (ROUND // 4) == 0:
            way = [foot, *(r * ROUND + k for r in range(RINGS - 1)), top]
            edges += itertools.pairwise(way)
    return centre_of(keys, middle) + keys["radius"] * unit, tuple(faces), tuple(edges)


def _cylinder(keys: Any, middle: FloatArray) -> tuple[FloatArray, Faces, Faces]:
    del middle
    start, end = np.array(keys["from"], dtype=np.float64), np.array(keys["to"], dtype=np.float64)
    length = float(np.linalg.norm(end - start))
    axis = (end - start) / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    turn = 2.0 * math.pi * np.arange(ROUND)[:, None] / ROUND
    ring = keys["radius"] * (np.cos(turn) * first + np.sin(turn) * np.cross(axis, first))
    feet, tops = loop(ROUND), loop(ROUND, ROUND)
    sides = tuple((a, b, b + ROUND, a + ROUND) for a, b in _closed(feet))
    lines = tuple((k, k + ROUND) for k in range(0, ROUND, ROUND // 4))
    return (
        np.concatenate([start + ring, end + ring]),
        (*sides, feet[::-1], tops),
        (*_closed(feet), *_closed(tops), *lines),
    )


def _file(mesh: tuple[FloatArray, Faces, Faces], middle: FloatArray) -> tuple[FloatArray, Faces, Faces]:
    del middle
    return mesh


SPATIAL: dict[str, Shape] = {
    "polygon": _polygon, "box": _box, "sphere": _sphere, "cylinder": _cylinder, "file": _file,
}  # fmt: skip
