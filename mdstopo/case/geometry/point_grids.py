"""Point grids: how many points a grid has, and where they are."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from mdstopo.case.arrays import FloatArray, Pair
from mdstopo.case.text.reading import Fields


def grid_count(kind: str, grid: Fields | FloatArray) -> int:
    """The number of points, exact however large; nothing is allocated."""
    if isinstance(grid, np.ndarray):
        return int(grid.shape[0])
    count = grid["count"]
    return int(count[0]) * int(count[1]) if kind == "lattice" else int(count)


def grid_points(kind: str, grid: Fields | FloatArray) -> FloatArray:
    """The points (n, 2) in the order of the format; non-finite where numbers overflow."""
    if isinstance(grid, np.ndarray):
        return grid
    with np.errstate(over="ignore", invalid="ignore"):
        return _POINTS[kind](grid)


def evenly(first: float, last: float, count: int) -> FloatArray:
    """`count` values from `first` to `last`, both exactly included; a count of 1 is `first`."""
    values = first + (last - first) * (np.arange(count) / max(count - 1, 1))
    if count > 1:
        values[-1] = last
    return values


def _line(grid: Fields) -> FloatArray:
    (x0, y0), (x1, y1), count = grid["from"], grid["to"], grid["count"]
    return np.stack([evenly(x0, x1, count), evenly(y0, y1, count)], axis=1)


def _lattice(grid: Fields) -> FloatArray:
    (x0, y0), (x1, y1), (nx, ny) = grid["from"], grid["to"], grid["count"]
    points = np.empty((ny, nx, 2))
    points[:, :, 0] = evenly(x0, x1, nx)
    points[:, :, 1] = evenly(y0, y1, ny)[:, None]
    return points.reshape(nx * ny, 2)


def _on_circle(grid: Fields, angles: FloatArray) -> FloatArray:
    (x, y), radius = grid["center"], grid["radius"]
    return np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], axis=1)


def _arc(grid: Fields) -> FloatArray:
    return _on_circle(grid, evenly(grid["from"], grid["to"], grid["count"]))


def _circle(grid: Fields) -> FloatArray:
    count = grid["count"]
    return _on_circle(grid, 2 * math.pi * (np.arange(count) / count))


def _rectangle(grid: Fields) -> FloatArray:
    return rectangle_sides(grid["center"], grid["size"], grid["count"])


def rectangle_sides(center: Pair, size: Pair, count: int) -> FloatArray:
    """Counter-clockwise along the perimeter from the lower left corner, the start not repeated: (count, 2)."""
    (x, y), (width, height) = center, size
    left, right, low, high = x - width / 2, x + width / 2, y - height / 2, y + height / 2
    walked = 2 * (width + height) * (np.arange(count) / count)
    starts = np.cumsum([0.0, width, height, width])
    # A corner that is a point is the start of a side: rounding must not leave it at the one before.
    snap = 1e-12 * (width + height)
    side = np.searchsorted(starts, walked + snap, side="right") - 1
    along = np.clip(walked - starts[side], 0.0, None)
    px = np.choose(side, [left + along, np.full(count, right), right - along, np.full(count, left)])
    py = np.choose(side, [np.full(count, low), low + along, np.full(count, high), high - along])
    points: FloatArray = np.stack([px, py], axis=1)
    return points


_POINTS: dict[str, Callable[[Fields], FloatArray]] = {
    "line": _line,
    "lattice": _lattice,
    "arc": _arc,
    "circle": _circle,
    "rectangle": _rectangle,
}
