"""Points at the start: global coordinates become body coordinates."""

from __future__ import annotations

from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.geometry import Geometry, geometry_of
from mdstopo.case.memory import BYTES_PER_POINT, total_memory
from mdstopo.case.model import GROUND, AnyBody, Case, Components, PointGrid
from mdstopo.case.reading import BAD, Fields, Reading
from mdstopo.case.value import Value, frozen
from mdstopo.case.words import count_text, inside

LARGEST = 1e150
"""Lengths and coordinates above it overflow when they are squared."""


@frozen
class Frames(Value):
    """Positions and rotations of the bodies at the start. bodies: those that could be read, ground included."""

    bodies: dict[str, AnyBody]
    geometry: Geometry

    def to_local(self, body: str, world: FloatArray) -> FloatArray:
        """Body coordinates (n, dimension) of global points (n, dimension)."""
        return world if body == GROUND else self.geometry.to_local(self.bodies[body], world)

    def to_world(self, body: str, local: FloatArray) -> FloatArray:
        """Global coordinates (n, dimension) of points (n, dimension) of a body."""
        return local if body == GROUND else self.geometry.to_world(self.bodies[body], local)

    def both(self, body: str, points: FloatArray, frame: str) -> tuple[FloatArray, FloatArray]:
        """Points in the coordinates of their body and in global ones, from points stated in `frame`: global or body."""
        with np.errstate(over="ignore", invalid="ignore"):
            if frame == "body":
                return points, self.to_world(body, points)
            return self.to_local(body, points), points

    def point(self, body: str, point: Components, frame: str = "global") -> tuple[Components, Components]:
        """A point at the start, in the coordinates of its body and in global ones."""
        local, world = self.both(body, np.array([point], dtype=np.float64), frame)
        return tuple(local[0].tolist()), tuple(world[0].tolist())

    def local_point(self, body: str, at: Any, frame: str, path: str, reading: Reading) -> Any:
        """Body coordinates of one point (None: the centre of mass), or BAD where they are too large."""
        if at is None:
            return (0.0,) * self.geometry.number
        local, world = self.point(body, at, frame)
        return local if in_range(np.array([local, world]), path, reading) else BAD


def frames_of(case: Case) -> Frames:
    """Where the bodies of a case stand at the start."""
    geometry = geometry_of(case.dimension)
    return Frames({GROUND: geometry.ground, **{body.name: body for body in case.bodies}}, geometry)


def in_range(values: FloatArray, path: str, reading: Reading) -> bool:
    """Whether all coordinates can be computed with; notes the mistake where not."""
    if values.size and not (np.abs(values) < LARGEST).all():
        reading.mistake(path, f"a coordinate is not below {LARGEST:g} m: too large to compute with")
        return False
    return True


def build_points(sections: Any, frames: Frames, reading: Reading) -> dict[str, PointGrid]:
    """The grids of points by name, without those that cannot be made; mistakes are noted."""
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
    geometry = frames.geometry
    checked = [geometry.check_grid(kind, grid, reading) for kind, grid in kinds]  # all, so that all is told
    if not all(checked):
        return None
    path = inside(fields.path, "grid")
    count = sum(geometry.grid_count(kind, grid) for kind, grid in kinds)
    most = total_memory() // BYTES_PER_POINT
    if count > most:
        reading.mistake(path, f"{count_text(count)} points are more than memory holds; allowed are {count_text(most)}")
        return None
    points = np.concatenate([geometry.grid_points(kind, grid) for kind, grid in kinds])
    local, world = frames.both(fields["body"], points, fields["frame"])
    if not (in_range(local, path, reading) and in_range(world, path, reading)):
        return None
    return PointGrid(name, fields["body"], local, world)
