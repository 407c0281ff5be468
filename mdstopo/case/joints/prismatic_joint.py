"""A slide."""

from __future__ import annotations

import math
from typing import Any, ClassVar

from mdstopo.case.arrays import Pair
from mdstopo.case.joints.joint import POINT, Joint, Stated
from mdstopo.case.keys.common_keys import PAIR
from mdstopo.case.keys.records import Direction, Key
from mdstopo.case.text.reading import Reading
from mdstopo.case.value import frozen


@frozen(kw_only=True)
class PrismaticJoint(Joint):
    """The second body slides along `axis`, a unit vector in the first body's coordinates, without turning."""

    type: ClassVar[str] = "prismatic"
    doc: ClassVar[str] = "A slide: the second body moves along an axis of the first and does not turn against it."
    keys: ClassVar[tuple[Key, ...]] = (
        Key("at", POINT, "a point on the axis, or each body's own", required=True, unit="m"),
        Key("axis", Direction(PAIR), "direction of the slide at the start; the first body carries it", required=True),
    )
    kernels: ClassVar[str] = "mdstopo.mechanics.joints.prismatic"
    keeps_angle: ClassVar[bool] = True

    axis: Pair

    @classmethod
    def own_values(cls, stated: Stated, reading: Reading) -> dict[str, Any] | None:
        """The values of the joint from its keys: its axis in coordinates of the first body."""
        axis = stated.fields["axis"]
        longest = max(abs(axis[0]), abs(axis[1]))
        x, y = axis[0] / longest, axis[1] / longest
        norm = math.hypot(x, y)
        angle = stated.bodies[0].angle
        c, s = math.cos(angle) / norm, math.sin(angle) / norm
        return {"axis": (c * x + s * y, c * y - s * x)}

    def row(self) -> dict[int, float]:
        """Numbers of its own for the kernels, by their place in the parameters: the normal of the axis."""
        return {4: -self.axis[1], 5: self.axis[0]}

    @property
    def slide(self) -> Pair:
        """The direction in which the bodies slide: the axis of the joint."""
        return self.axis
