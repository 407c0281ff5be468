"""The eight joints in space."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.geometry.start_rotations import frame_with, parallel
from mdstopo.case.joints.joint import Stated
from mdstopo.case.joints.spatial_joint import SpatialJoint
from mdstopo.case.joints.spatial_keys import AXES, POINT, TWO_POINTS, at, axis
from mdstopo.case.keys.records import Key
from mdstopo.case.text.reading import Reading
from mdstopo.case.text.words import inside
from mdstopo.case.value import frozen


@frozen(kw_only=True)
class SphericalJoint(SpatialJoint):
    """A ball joint: a point of each body coincides with one of the other."""

    type: ClassVar[str] = "spherical"
    doc: ClassVar[str] = "A ball: a point of the one body and a point of the other stay together; 3 rows."
    keys: ClassVar[tuple[Key, ...]] = (at("the common point"),)
    rows: ClassVar[int] = 3
    keeps_point: ClassVar[bool] = True


@frozen(kw_only=True)
class SpatialRevoluteJoint(SpatialJoint):
    """A hinge: a point and an axis of each body coincide with those of the other."""

    type: ClassVar[str] = "revolute"
    doc: ClassVar[str] = "A hinge: the bodies share a point and an axis, about which they turn; 5 rows."
    keys: ClassVar[tuple[Key, ...]] = (at("the common point"), axis("axis", "the axis of the hinge"))
    rows: ClassVar[int] = 5
    axis_key: ClassVar[str] = "axis"
    keeps_point: ClassVar[bool] = True


@frozen(kw_only=True)
class UniversalJoint(SpatialJoint):
    """The two points coincide, and an axis of the first body stays perpendicular to one of the second."""

    type: ClassVar[str] = "universal"
    doc: ClassVar[str] = (
        "A cross: the bodies share a point, and an axis of the first stays perpendicular to one of the second; 4 rows."
    )
    keys: ClassVar[tuple[Key, ...]] = (at("the common point"), AXES)
    rows: ClassVar[int] = 4
    axis_key: ClassVar[str] = "axes"
    keeps_point: ClassVar[bool] = True

    @classmethod
    def triads(
        cls, axes: tuple[FloatArray, FloatArray] | None, stated: Stated, reading: Reading
    ) -> tuple[FloatArray, FloatArray] | None:
        """The axes of the joint in both bodies; see `SpatialJoint.triads`. Two axes on one line are a mistake."""
        assert axes is not None
        first, second = axes
        if parallel(first, second):
            reading.mistake(
                inside(stated.fields.path, "axes"), "the two axes are parallel, allowed are perpendicular ones"
            )
            return None
        return frame_with(first, second), frame_with(second, -first)


@frozen(kw_only=True)
class SpatialPrismaticJoint(SpatialJoint):
    """The second body slides along an axis of the first without turning."""

    type: ClassVar[str] = "prismatic"
    doc: ClassVar[str] = (
        "A slide: the second body moves along an axis of the first and does not turn against it; 5 rows."
    )
    keys: ClassVar[tuple[Key, ...]] = (
        at("a point on the axis"),
        axis("axis", "direction of the slide, which the first body carries,"),
    )
    rows: ClassVar[int] = 5
    axis_key: ClassVar[str] = "axis"
    keeps_angle: ClassVar[bool] = True


@frozen(kw_only=True)
class CylindricalJoint(SpatialJoint):
    """The second body slides along an axis of the first and turns about it."""

    type: ClassVar[str] = "cylindrical"
    doc: ClassVar[str] = "A sleeve: the second body moves along an axis of the first and turns about it; 4 rows."
    keys: ClassVar[tuple[Key, ...]] = (
        at("a point on the axis"),
        axis("axis", "the axis, which the first body carries,"),
    )
    rows: ClassVar[int] = 4
    axis_key: ClassVar[str] = "axis"


@frozen(kw_only=True)
class PlanarJoint(SpatialJoint):
    """The second body's point stays in a plane of the first; the normals stay parallel."""

    type: ClassVar[str] = "planar"
    doc: ClassVar[str] = (
        "Flat on flat: the second body's point stays in a plane of the first, and the normals stay parallel; 3 rows."
    )
    keys: ClassVar[tuple[Key, ...]] = (
        at("a point in the plane"),
        axis("normal", "the normal of the plane, which the first body carries,"),
    )
    rows: ClassVar[int] = 3
    axis_key: ClassVar[str] = "normal"


@frozen(kw_only=True)
class SpatialFixedJoint(SpatialJoint):
    """The two points coincide and neither body turns against the other."""

    type: ClassVar[str] = "fixed"
    doc: ClassVar[str] = "A weld: the two bodies move as one; 6 rows."
    keys: ClassVar[tuple[Key, ...]] = (
        Key(
            "at",
            POINT,
            "where the reaction is taken, or each body's own point",
            unit="m",
            otherwise="the second body's centre of mass, the first's where the second is ground",
        ),
    )
    rows: ClassVar[int] = 6
    keeps_angle: ClassVar[bool] = True
    keeps_point: ClassVar[bool] = True


@frozen(kw_only=True)
class SpatialDistanceJoint(SpatialJoint):
    """A rigid massless link of `length` in m between the two points."""

    type: ClassVar[str] = "distance"
    doc: ClassVar[str] = "A rigid link without mass: two points keep their distance, which is that at the start; 1 row."
    keys: ClassVar[tuple[Key, ...]] = (
        Key("at", TWO_POINTS, "a point on the first body and a point on the second", required=True, unit="m"),
    )
    rows: ClassVar[int] = 1
    is_link: ClassVar[bool] = True

    length: float

    @classmethod
    def further_values(cls, stated: Stated, reading: Reading) -> dict[str, Any] | None:
        """The length (m): the distance of the two points at the start. Where that is zero, a mistake is noted."""
        length = math.hypot(*(np.array(stated.second) - np.array(stated.first)).tolist())
        if not length > 0.0:
            reading.mistake(inside(stated.fields.path, "at"), "the two points coincide; a link needs a length")
            return None
        return {"length": length}


#: the joints in space by their word; their codes in kernels follow this order
SPATIAL_JOINTS: dict[str, type[SpatialJoint]] = {
    joint.type: joint
    for joint in (
        SphericalJoint,
        SpatialRevoluteJoint,
        UniversalJoint,
        SpatialPrismaticJoint,
        CylindricalJoint,
        PlanarJoint,
        SpatialFixedJoint,
        SpatialDistanceJoint,
    )
}
