"""A rigid link."""

from __future__ import annotations

import math
from typing import Any, ClassVar

from mdstopo.case.joints.joint import TWO_POINTS, Joint, Stated
from mdstopo.case.keys.records import Key
from mdstopo.case.text.reading import Reading
from mdstopo.case.text.words import inside
from mdstopo.case.value import frozen


@frozen(kw_only=True)
class DistanceJoint(Joint):
    """A rigid massless link of `length` in m between the two points."""

    type: ClassVar[str] = "distance"
    doc: ClassVar[str] = "A rigid link without mass: two points keep their distance, which is that at the start."
    keys: ClassVar[tuple[Key, ...]] = (
        Key("at", TWO_POINTS, "a point on the first body and a point on the second", required=True, unit="m"),
    )
    kernels: ClassVar[str] = "mdstopo.mechanics.joints.distance"
    is_link: ClassVar[bool] = True

    length: float

    @classmethod
    def own_values(cls, stated: Stated, reading: Reading) -> dict[str, Any] | None:
        """The length (m): the distance of the two points at the start. Where that is zero, a mistake is noted."""
        length = math.hypot(stated.second[0] - stated.first[0], stated.second[1] - stated.first[1])
        if not length > 0.0:
            reading.mistake(inside(stated.fields.path, "at"), "the two points coincide; a link needs a length")
            return None
        return {"length": length}

    def row(self) -> dict[int, float]:
        """Numbers of its own for the kernels, by their place in the parameters: the length (m)."""
        return {7: self.length}
