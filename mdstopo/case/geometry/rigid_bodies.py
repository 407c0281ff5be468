"""Rigid bodies as they are at the start, in the plane and in space, and what is drawn of them."""

from __future__ import annotations

from typing import Any, TypeAlias

from mdstopo.case.arrays import FloatArray, Pair, Triple, read_only
from mdstopo.case.value import Value, frozen


@frozen
class Outline(Value):
    """The outline by which pictures show a body; nothing is computed from it.

    shape: the word of the case. corners (n, 2), in space (n, 3): in body coordinates. faces: numbers of corners; in the
    plane each is a closed line, and what lies within two of them is a hole; in space each is a flat piece of the
    surface, counterclockwise seen from outside. edges: pairs of corners that are drawn, in space.
    """

    shape: str
    corners: FloatArray
    faces: tuple[tuple[int, ...], ...]
    edges: tuple[tuple[int, ...], ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "corners", read_only(self.corners))


@frozen
class Body(Value):
    """A rigid body at the start.

    mass in kg, inertia about the centre of mass in kg m^2, position of the centre of mass in m, angle in rad.
    stated: those of ``angle``, ``velocity``, ``angular_velocity`` that the file gives (others are defaults).
    outline: what pictures show of it; empty where the file says nothing of it.
    """

    name: str
    mass: float
    inertia: float
    position: Pair
    angle: float = 0.0
    velocity: Pair = (0.0, 0.0)
    angular_velocity: float = 0.0
    stated: frozenset[str] = frozenset()
    outline: tuple[Outline, ...] = ()


@frozen
class SpatialBody(Value):
    """A rigid body in space at the start.

    mass in kg; inertia (3, 3): the tensor about the centre of mass along the body axes in kg m^2; position of the
    centre of mass in m; rotation (3, 3): its columns are the body axes in global coordinates; velocity in m/s and
    angular_velocity in rad/s, global components.
    stated: those of ``orientation``, ``velocity``, ``angular_velocity`` that the file gives (others are defaults).
    outline: what pictures show of it; empty where the file says nothing of it.
    """

    name: str
    mass: float
    inertia: FloatArray
    position: Triple
    rotation: FloatArray
    velocity: Triple = (0.0, 0.0, 0.0)
    angular_velocity: Triple = (0.0, 0.0, 0.0)
    stated: frozenset[str] = frozenset()
    outline: tuple[Outline, ...] = ()

    def __post_init__(self) -> None:
        for name in ("inertia", "rotation"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


#: a Body in the plane, a SpatialBody in space: what `Case.dimension` says no type can tell
AnyBody: TypeAlias = Any
