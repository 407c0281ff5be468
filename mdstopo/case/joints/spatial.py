"""The eight joints in space."""

from __future__ import annotations

from typing import ClassVar

from mdstopo.case.joints.spatial_joint import SpatialJoint
from mdstopo.case.value import frozen


@frozen(kw_only=True)
class SphericalJoint(SpatialJoint):
    """The two points coincide."""

    type: ClassVar[str] = "spherical"
    rows: ClassVar[int] = 3


@frozen(kw_only=True)
class SpatialRevoluteJoint(SpatialJoint):
    """The two points and the two axes coincide."""

    type: ClassVar[str] = "revolute"
    rows: ClassVar[int] = 5


@frozen(kw_only=True)
class UniversalJoint(SpatialJoint):
    """The two points coincide, and an axis of the first body stays perpendicular to one of the second."""

    type: ClassVar[str] = "universal"
    rows: ClassVar[int] = 4


@frozen(kw_only=True)
class SpatialPrismaticJoint(SpatialJoint):
    """The second body slides along an axis of the first without turning."""

    type: ClassVar[str] = "prismatic"
    rows: ClassVar[int] = 5


@frozen(kw_only=True)
class CylindricalJoint(SpatialJoint):
    """The second body slides along an axis of the first and turns about it."""

    type: ClassVar[str] = "cylindrical"
    rows: ClassVar[int] = 4


@frozen(kw_only=True)
class PlanarJoint(SpatialJoint):
    """The second body's point stays in a plane of the first; the normals stay parallel."""

    type: ClassVar[str] = "planar"
    rows: ClassVar[int] = 3


@frozen(kw_only=True)
class SpatialFixedJoint(SpatialJoint):
    """The two points coincide and neither body turns against the other."""

    type: ClassVar[str] = "fixed"
    rows: ClassVar[int] = 6


@frozen(kw_only=True)
class SpatialDistanceJoint(SpatialJoint):
    """A rigid massless link of `length` in m between the two points."""

    type: ClassVar[str] = "distance"
    rows: ClassVar[int] = 1

    length: float


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
