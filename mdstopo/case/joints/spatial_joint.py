"""What is declared of a joint in space, and what all of them have."""

from __future__ import annotations

from typing import ClassVar

from mdstopo.case.arrays import FloatArray, Triple, read_only
from mdstopo.case.joints.joint import Joint
from mdstopo.case.value import frozen


@frozen(kw_only=True)
class SpatialJoint(Joint):
    """A joint in space: a point and three axes on each body.

    rows: how many constraints it is, the rows of Phi.
    at_first, at_second: the joint's point on each body, in body coordinates.
    axes_first, axes_second (3, 3): right-handed unit vectors by rows, in coordinates of the first and of the second
    body; where a joint fits at the start the two coincide in space. Row 0 is the joint's own axis: that of a revolute,
    prismatic or cylindrical joint, the normal of a planar one. A universal joint has its first axis, which the first
    body carries, in row 0 of axes_first, and its second axis, which the second body carries, in row 0 of axes_second:
    there rows 0, 1 and 2 of axes_first coincide with minus row 1, row 0 and row 2 of axes_second. Spherical, fixed and
    distance joints have no axis of their own; theirs are the global ones at the start.
    """

    rows: ClassVar[int]

    at_first: Triple  # type: ignore[assignment]  # a Pair in the plane
    at_second: Triple  # type: ignore[assignment]
    axes_first: FloatArray
    axes_second: FloatArray

    def __post_init__(self) -> None:
        for name in ("axes_first", "axes_second"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
