"""Where bodies are at the start: global coordinates become body coordinates, and back."""

from __future__ import annotations

from typing import Any

import numpy as np

from mdstopo.case.arrays import Components, FloatArray
from mdstopo.case.geometry.coordinates import in_range
from mdstopo.case.geometry.rigid_bodies import AnyBody
from mdstopo.case.objects.plane_or_space import Geometry
from mdstopo.case.text.reading import BAD, Reading
from mdstopo.case.text.words import GROUND
from mdstopo.case.value import Value, frozen


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
