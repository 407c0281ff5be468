"""What is drawn of bodies in the plane, as a case states it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.geometry.coordinates import in_range
from mdstopo.case.geometry.rigid_bodies import AnyBody, Outline
from mdstopo.case.text.reading import Fields, Reading

CORNERS = 64
"""Of a polygon that stands for a circle."""
Faces = tuple[tuple[int, ...], ...]
#: from the keys of a shape and the middle of the body in its frame: corners, faces, edges
Shape = Callable[[Any, FloatArray], tuple[FloatArray, Faces, Faces]]


def build_outlines(
    fields: Fields,
    body: AnyBody,
    shapes: dict[str, Shape],
    to_local: Callable[[Any, FloatArray], FloatArray],
    reading: Reading,
) -> tuple[Outline, ...] | None:
    """The shapes drawn of a body; None where one cannot be, which is noted.

    fields: the keys of the body, read without a mistake.
    body: at the start, without outlines.
    shapes: by their words.
    to_local (body, global points): the points in body coordinates.
    reading: where mistakes are noted.
    """
    stated = fields["outline"]
    if stated is None:
        return ()
    made = []
    for each in stated if isinstance(stated, list) else [stated]:
        (word,) = each.stated - {"frame"}
        own = each["frame"] == "body"
        middle = np.zeros(len(body.position)) if own else np.array(body.position)
        with np.errstate(over="ignore", invalid="ignore"):
            corners, faces, edges = shapes[word](each[word], middle)
            corners = corners if own else to_local(body, corners)
        if not in_range(corners, each.path, reading):
            return None
        if word == "polygon" and not _flat(corners):
            reading.mistake(each.path, "the corners of the polygon do not lie in a plane")
            return None
        made.append(Outline(word, corners, faces, edges))
    return tuple(made)


def _flat(corners: FloatArray) -> bool:
    """Whether corners lie in a plane, to a millionth of their extent."""
    if corners.shape[1] == 2:
        return True
    away = corners - corners.mean(axis=0)
    spread = np.linalg.svd(away, compute_uv=False)
    return bool(len(spread) < 3 or spread[2] <= 1e-6 * spread[0])


def loop(count: int, first: int = 0) -> tuple[int, ...]:
    """The numbers of the corners of a closed line: `count` of them, from `first` on."""
    return tuple(range(first, first + count))


def polygon(corners: FloatArray, middle: FloatArray) -> tuple[FloatArray, Faces, Faces]:
    """A polygon through corners (n, 2) as they are stated: its points, its one face, and no further edges."""
    del middle
    return corners, (loop(len(corners)),), ()


def centre_of(keys: Any, middle: FloatArray) -> FloatArray:
    """The centre of a shape: as stated, or else the middle of the body."""
    return middle if keys["center"] is None else np.array(keys["center"])


def _rectangle(keys: Any, middle: FloatArray) -> tuple[FloatArray, Faces, Faces]:
    half = 0.5 * np.array(keys["size"])
    corners = centre_of(keys, middle) + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return corners, (loop(4),), ()


def _circle(keys: Any, middle: FloatArray) -> tuple[FloatArray, Faces, Faces]:
    angle = 2.0 * math.pi * np.arange(CORNERS) / CORNERS
    corners = centre_of(keys, middle) + keys["radius"] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return corners, (loop(CORNERS),), ()


def _path(keys: Any, middle: FloatArray) -> tuple[FloatArray, Faces, Faces]:
    at = middle if keys["at"] is None else np.array(keys["at"])
    counts = [len(each) for each in keys["d"]]
    corners = np.concatenate(keys["d"]) * np.array([1.0, -1.0]) * keys["scale"] + at
    starts = np.cumsum([0, *counts[:-1]]).tolist()
    return corners, tuple(loop(n, first) for n, first in zip(counts, starts, strict=True)), ()


PLANAR: dict[str, Shape] = {"polygon": polygon, "rectangle": _rectangle, "circle": _circle, "path": _path}
