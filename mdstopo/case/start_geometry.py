"""Bodies and points at the start: global coordinates become body coordinates."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.memory import BYTES_PER_POINT, total_memory
from mdstopo.case.model import GROUND, Body, Pair, PointGrid
from mdstopo.case.point_grids import grid_count, grid_points
from mdstopo.case.reading import BAD, Fields, Reading
from mdstopo.case.value import Value, frozen
from mdstopo.case.words import count_text, inside, number_text

LARGEST = 1e150
"""Lengths and coordinates above it overflow when they are squared."""


@frozen
class Frames(Value):
    """Where the bodies stand at the start. bodies: those that could be read, ground included."""

    bodies: dict[str, Body]

    def to_local(self, body: str, world: FloatArray) -> FloatArray:
        """Body coordinates (n, 2) of global points (n, 2)."""
        if body == GROUND:
            return world
        b = self.bodies[body]
        d: FloatArray = world - np.array(b.position)
        c, s = math.cos(b.angle), math.sin(b.angle)
        if b.angle == 0.0:
            return d
        return np.stack([c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0]], axis=1)

    def to_world(self, body: str, local: FloatArray) -> FloatArray:
        """Global coordinates (n, 2) of points (n, 2) of a body."""
        if body == GROUND:
            return local
        b = self.bodies[body]
        c, s = math.cos(b.angle), math.sin(b.angle)
        x, y = local[:, 0], local[:, 1]
        turned = local if b.angle == 0.0 else np.stack([c * x - s * y, s * x + c * y], axis=1)
        moved: FloatArray = turned + np.array(b.position)
        return moved

    def both(self, body: str, points: FloatArray, frame: str) -> tuple[FloatArray, FloatArray]:
        """(local, world) of points given in `frame`: global or body."""
        with np.errstate(over="ignore", invalid="ignore"):
            if frame == "body":
                return points, self.to_world(body, points)
            return self.to_local(body, points), points

    def point(self, body: str, point: Pair, frame: str = "global") -> tuple[Pair, Pair]:
        """(local, world) of one point."""
        local, world = self.both(body, np.array([point], dtype=np.float64), frame)
        return (float(local[0, 0]), float(local[0, 1])), (float(world[0, 0]), float(world[0, 1]))

    def local_point(self, body: str, at: Any, frame: str, path: str, reading: Reading) -> Any:
        """Body coordinates of one point (None: the centre of mass), or BAD where they are too large."""
        if at is None:
            return (0.0, 0.0)
        local, world = self.point(body, at, frame)
        return local if in_range(np.array([local, world]), path, reading) else BAD


def in_range(values: FloatArray, path: str, reading: Reading) -> bool:
    """Whether all coordinates can be computed with; notes the mistake where not."""
    if values.size and not (np.abs(values) < LARGEST).all():
        reading.mistake(path, f"a coordinate is not below {LARGEST:g} m: too large to compute with")
        return False
    return True


def build_body(name: str, fields: Any, path: str, angle: float | None, reading: Reading) -> Body | None:
    """The body at the start, or None where it cannot be read. angle: what a motion prescribes, else None."""
    if fields is BAD or not fields.good():
        return None
    mass, inertia = fields["mass"], fields["inertia"]
    good = True
    for key, value in (("mass", mass), ("inertia", inertia)):
        if not (math.isfinite(1.0 / value) and value * value > 0.0 and math.isfinite(value * value)):
            reading.mistake(inside(path, key), f"found {number_text(value)}, too extreme to compute with")
            good = False
    good &= in_range(np.array(fields["position"]), inside(path, "position"), reading)
    for key in ("velocity", "angular_velocity"):
        good &= in_range(np.array(fields[key]), inside(path, key), reading)
    if not good:
        return None
    return Body(
        name,
        mass,
        inertia,
        fields["position"],
        fields["angle"] if angle is None else angle,
        fields["velocity"],
        fields["angular_velocity"],
        fields.stated & {"angle", "velocity", "angular_velocity"},
    )


def build_points(sections: Any, frames: Frames, reading: Reading) -> dict[str, PointGrid]:
    """The grids that can be made, by name."""
    grids: dict[str, PointGrid] = {}
    for name, fields in (sections or {}).items():
        grid = None if fields is BAD else _build_grid(name, fields, frames, reading)
        if grid is not None:
            grids[name] = grid
    return grids


def _build_grid(name: str, fields: Fields, frames: Frames, reading: Reading) -> PointGrid | None:
    parts = fields["grid"] if isinstance(fields["grid"], list) else [fields["grid"]]
    if fields["body"] not in frames.bodies or not fields.good("frame"):
        return None
    kinds = []
    for part in parts:
        if part is BAD:
            return None
        stated = [kind for kind in part.stated if part[kind] is not BAD]
        if len(stated) != 1 or (isinstance(part[stated[0]], Fields) and not part[stated[0]].good()):
            return None
        kinds.append((stated[0], part[stated[0]]))
    path = inside(fields.path, "grid")
    count = sum(grid_count(kind, grid) for kind, grid in kinds)
    most = total_memory() // BYTES_PER_POINT
    if count > most:
        reading.mistake(path, f"{count_text(count)} points are more than memory holds; allowed are {count_text(most)}")
        return None
    points = np.concatenate([grid_points(kind, grid) for kind, grid in kinds])
    local, world = frames.both(fields["body"], points, fields["frame"])
    if not (in_range(local, path, reading) and in_range(world, path, reading)):
        return None
    return PointGrid(name, fields["body"], local, world)
