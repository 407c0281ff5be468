"""Point grids in space: how many points a grid has, where they are, and what is wrong with one."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.geometry.point_grids import evenly, rectangle_sides
from mdstopo.case.geometry.start_rotations import frame_with, parallel, unit
from mdstopo.case.text.reading import Fields, Reading
from mdstopo.case.text.words import inside

PERPENDICULAR = 1e-6
"""The largest scalar product of unit vectors that count as perpendicular."""


def grid_count(kind: str, grid: Any) -> int:
    """The number of points, exact however large; nothing is allocated."""
    if isinstance(grid, np.ndarray):
        return int(grid.shape[0])
    count = grid["count"]
    if not isinstance(count, tuple):
        return int(count)
    hidden = math.prod(max(int(n) - 2, 0) for n in count) if kind == "box" else 0
    return math.prod(int(n) for n in count) - hidden


def grid_points(kind: str, grid: Any) -> FloatArray:
    """The points (n, 3) in the order of the format; non-finite where numbers overflow."""
    if isinstance(grid, np.ndarray):
        return grid
    with np.errstate(over="ignore", invalid="ignore"):
        return _POINTS[kind](grid)


def check_grid(kind: str, grid: Any, reading: Reading) -> bool:
    """Whether directions and ends of a grid go together; notes the mistake where not."""
    wrong: tuple[str, str] | None = None
    if kind in ("circle", "arc") and parallel(unit(grid["normal"]), unit(grid["start"])):
        wrong = "start", "is along the normal, allowed is a direction from the centre to a point of the circle"
    elif kind == "rectangle" and abs(float(np.dot(*map(unit, grid["axes"])))) > PERPENDICULAR:
        wrong = "axes", "the two axes are not perpendicular"
    elif kind == "plane" and parallel(unit(grid["edges"][0]), unit(grid["edges"][1])):
        wrong = "edges", "the two edges are parallel, allowed are two sides of a parallelogram"
    elif kind == "cylinder" and grid["from"] == grid["to"]:
        wrong = "to", "is where the cylinder begins, allowed is another point of its axis"
    elif kind == "cylinder" and parallel(_axis(grid), unit(grid["start"])):
        wrong = "start", "is along the axis, allowed is a direction from the axis to a point of the cylinder"
    if wrong is None:
        return True
    reading.mistake(inside(grid.path, wrong[0]), wrong[1])
    return False


def _axis(grid: Fields) -> FloatArray:
    """The direction of a cylinder; halves, so that far ends do not overflow."""
    return unit([0.5 * b - 0.5 * a for a, b in zip(grid["from"], grid["to"], strict=True)])


def _line(grid: Fields) -> FloatArray:
    count = grid["count"]
    ends = zip(grid["from"], grid["to"], strict=True)
    return np.stack([evenly(a, b, count) for a, b in ends], axis=1)


def _lattice(grid: Fields) -> FloatArray:
    """x fastest, then y."""
    x, y, z = (evenly(a, b, n) for a, b, n in zip(grid["from"], grid["to"], grid["count"], strict=True))
    points = np.empty((len(z), len(y), len(x), 3))
    points[..., 0], points[..., 1], points[..., 2] = x, y[:, None], z[:, None, None]
    return points.reshape(-1, 3)


def _box(grid: Fields) -> FloatArray:
    """The points of the lattice on its surface, layer by layer: inner ones have only their rim."""
    x, y, z = (evenly(a, b, n) for a, b, n in zip(grid["from"], grid["to"], grid["count"], strict=True))
    j, i = (each.ravel() for each in np.meshgrid(np.arange(len(y)), np.arange(len(x)), indexing="ij"))
    rim = (i == 0) | (i == len(x) - 1) | (j == 0) | (j == len(y) - 1)
    whole = np.stack([x[i], y[j]], axis=1)
    inner = whole[rim]
    last = [whole] if len(z) > 1 else []
    layers = [whole, *[inner] * max(len(z) - 2, 0), *last]
    heights = np.repeat(z, [len(layer) for layer in layers])
    return np.column_stack([np.concatenate(layers), heights])


def _around(center: FloatArray, frame: FloatArray, radius: float, angles: FloatArray) -> FloatArray:
    """Points of a circle; frame: its normal, the direction of angle 0, and the one a quarter further, by rows."""
    turned = np.cos(angles)[:, None] * frame[1] + np.sin(angles)[:, None] * frame[2]
    points: FloatArray = center + radius * turned
    return points


def _whole(count: int) -> FloatArray:
    return np.asarray(2 * math.pi * (np.arange(count) / count))


def _circle(grid: Fields) -> FloatArray:
    frame = frame_with(unit(grid["normal"]), unit(grid["start"]))
    return _around(np.array(grid["center"]), frame, grid["radius"], _whole(grid["count"]))


def _arc(grid: Fields) -> FloatArray:
    frame = frame_with(unit(grid["normal"]), unit(grid["start"]))
    angles = evenly(grid["from"], grid["to"], grid["count"])
    return _around(np.array(grid["center"]), frame, grid["radius"], angles)


def _cylinder(grid: Fields) -> FloatArray:
    """Circles from one end to the other, around fastest."""
    around, along = grid["count"]
    frame = frame_with(_axis(grid), unit(grid["start"]))
    circle = _around(np.zeros(3), frame, grid["radius"], _whole(around))
    ends = zip(grid["from"], grid["to"], strict=True)
    centers = np.stack([evenly(a, b, along) for a, b in ends], axis=1)
    return (centers[:, None, :] + circle).reshape(-1, 3)


def _rectangle(grid: Fields) -> FloatArray:
    """The perimeter from the corner at -a/2, -b/2, along the first axis first."""
    first, second = map(unit, grid["axes"])
    frame = frame_with(first, second)
    plane = rectangle_sides((0.0, 0.0), grid["size"], grid["count"])
    points: FloatArray = np.array(grid["center"]) + plane[:, :1] * frame[0] + plane[:, 1:] * frame[1]
    return points


def _plane(grid: Fields) -> FloatArray:
    """A lattice on a parallelogram, the first edge fastest; the far side is the corner and the edge, as given."""
    (n, m), (first, second) = grid["count"], (np.array(edge) for edge in grid["edges"])
    along = evenly(0.0, 1.0, n)[None, :, None] * first
    across = evenly(0.0, 1.0, m)[:, None, None] * second
    points: FloatArray = (np.array(grid["corner"]) + along + across).reshape(-1, 3)
    return points


_POINTS: dict[str, Callable[[Fields], FloatArray]] = {
    "line": _line,
    "lattice": _lattice,
    "box": _box,
    "circle": _circle,
    "arc": _arc,
    "cylinder": _cylinder,
    "rectangle": _rectangle,
    "plane": _plane,
}
