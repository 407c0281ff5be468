"""Surfaces of bodies in space that points of others may touch, from what a case states of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.geometry.coordinates import in_range
from mdstopo.case.geometry.spatial_point_grids import PERPENDICULAR
from mdstopo.case.geometry.start_rotations import frame_along, unit
from mdstopo.case.model import GROUND, Surface, SurfaceContact
from mdstopo.case.objects.frames import Frames
from mdstopo.case.schema.schema_surface import SHAPES
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import inside


def surface_contact(common: dict[str, Any], on: Fields, frames: Frames, reading: Reading) -> SurfaceContact | None:
    """The contact of points with a surface of a body; None where there is no such surface, which is noted."""
    stated = [shape for shape in SHAPES if shape in on.stated and on[shape] is not BAD]
    if len(stated) != 1 or not on.good() or not on[stated[0]].good():
        return None
    shape, keys = stated[0], on[stated[0]]
    found = _OF_SHAPE[shape](keys, reading)
    if found is None:
        return None
    place, axes, sizes = found
    local, world = frames.point(on["body"], place, on["frame"])
    ends = np.array([local, world, (*sizes, 0.0)])
    if not in_range(ends, inside(keys.path, _PLACE[shape]), reading):
        return None
    if on["frame"] == "global" and on["body"] != GROUND:
        axes = np.asarray(axes @ frames.bodies[on["body"]].rotation)
    hollow = "hollow" in keys and bool(keys["hollow"])
    return SurfaceContact(**common, edge_body=on["body"], surface=Surface(shape, local, axes, sizes, hollow))


#: place, axes (3, 3) by rows, and sizes, all as stated
_Found = tuple[tuple[float, ...], FloatArray, tuple[float, float]]
#: the key that says where a shape is
_PLACE = {"plane": "at", "rectangle": "center", "sphere": "center", "cylinder": "from"}


def _turned_to(axis: FloatArray) -> FloatArray:
    """Axes whose last one is a unit vector."""
    return np.asarray(np.roll(frame_along(axis), -1, axis=0))


def _plane(keys: Fields, reading: Reading) -> _Found | None:
    del reading
    return keys["at"], _turned_to(unit(keys["normal"])), (0.0, 0.0)


def _rectangle(keys: Fields, reading: Reading) -> _Found | None:
    one, two = (unit(axis) for axis in keys["axes"])
    if abs(float(one @ two)) > PERPENDICULAR:
        reading.mistake(inside(keys.path, "axes"), "the two axes are not perpendicular")
        return None
    two = unit((two - float(two @ one) * one).tolist())
    a, b = keys["size"]
    return keys["center"], np.array([one, two, np.cross(one, two)]), (0.5 * a, 0.5 * b)


def _sphere(keys: Fields, reading: Reading) -> _Found | None:
    del reading
    return keys["center"], np.eye(3), (keys["radius"], 0.0)


def _cylinder(keys: Fields, reading: Reading) -> _Found | None:
    if keys["from"] == keys["to"]:
        reading.mistake(inside(keys.path, "to"), "is where the axis begins, allowed is another point of it")
        return None
    if not in_range(np.array([keys["to"]]), inside(keys.path, "to"), reading):
        return None
    axis = 0.5 * np.array(keys["to"]) - 0.5 * np.array(keys["from"])
    return keys["from"], _turned_to(unit(axis.tolist())), (keys["radius"], 2.0 * float(np.linalg.norm(axis)))


_OF_SHAPE: dict[str, Callable[[Fields, Reading], _Found | None]] = {
    "plane": _plane,
    "rectangle": _rectangle,
    "sphere": _sphere,
    "cylinder": _cylinder,
}
