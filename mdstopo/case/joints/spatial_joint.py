"""What is declared of a joint in space, and what all of them have."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from mdstopo.case.arrays import FloatArray, Triple, read_only
from mdstopo.case.geometry.start_rotations import frame_along, turning, unit
from mdstopo.case.joints.joint import Joint, Stated
from mdstopo.case.text.reading import BAD, Reading
from mdstopo.case.text.words import inside, listed, shown
from mdstopo.case.value import frozen


@frozen(kw_only=True)
class SpatialJoint(Joint):
    """A joint in space: a point and three axes on each body.

    rows: how many constraints it is, the rows of Phi. axis_key: the key of its axis; empty where it has none.
    at_first, at_second: the joint's point on each body, in body coordinates.
    axes_first, axes_second (3, 3): right-handed unit vectors by rows, in coordinates of the first and of the second
    body; where a joint fits at the start the two coincide in space. Row 0 is the joint's own axis: that of a revolute,
    prismatic or cylindrical joint, the normal of a planar one. A universal joint has its first axis, which the first
    body carries, in row 0 of axes_first, and its second axis, which the second body carries, in row 0 of axes_second:
    there rows 0, 1 and 2 of axes_first coincide with minus row 1, row 0 and row 2 of axes_second. Spherical, fixed and
    distance joints have no axis of their own; theirs are the global ones at the start.
    """

    rows: ClassVar[int]
    axis_key: ClassVar[str] = ""

    at_first: Triple  # type: ignore[assignment]  # a Pair in the plane
    at_second: Triple  # type: ignore[assignment]
    axes_first: FloatArray
    axes_second: FloatArray

    def __post_init__(self) -> None:
        for name in ("axes_first", "axes_second"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @classmethod
    def own_values(cls, stated: Stated, reading: Reading) -> dict[str, Any] | None:
        """The axes on both bodies, and what a subclass adds."""
        both = _directions(cls.axis_key, stated, reading) if cls.axis_key else None
        if cls.axis_key and both is None:
            return None
        triads, further = cls.triads(both, stated, reading), cls.further_values(stated, reading)
        if triads is None or further is None:
            return None
        first, second = (triad @ body.rotation for triad, body in zip(triads, stated.bodies, strict=True))
        return {"axes_first": first, "axes_second": second, **further}

    @classmethod
    def further_values(cls, stated: Stated, reading: Reading) -> dict[str, Any] | None:
        """Values of the fields that a subclass adds; None where something is a mistake, which is noted."""
        del stated, reading
        return {}

    @classmethod
    def triads(
        cls, axes: tuple[FloatArray, FloatArray] | None, stated: Stated, reading: Reading
    ) -> tuple[FloatArray, FloatArray] | None:
        """The axes on both bodies at the start, global, by rows; None where they are a mistake, which is noted.

        Where each body has an axis of its own, the second one's triad is the first one's, turned on the shortest way
        from axis to axis; opposite axes are one line.
        """
        del stated, reading
        if axes is None:
            return np.eye(3), np.eye(3)
        first, second = axes
        if float(first @ second) < 0.0:
            second = -second
        triad = frame_along(first)
        return triad, triad @ turning(first, second).T


def _directions(key: str, stated: Stated, reading: Reading) -> tuple[FloatArray, FloatArray] | None:
    """Unit vectors of the first and the second body; None where they are a mistake, which is noted."""
    value, path = stated.fields[key], inside(stated.fields.path, key)
    if not isinstance(value, dict):
        own = value if isinstance(value[0], tuple) else (value, value)
        return unit(own[0]), unit(own[1])
    names = (stated.bodies[0].name, stated.bodies[1].name)
    strangers = [name for name in value if name not in names]
    missing = [name for name in names if name not in value]
    for name in strangers:
        if reading.knows("body", name):
            reading.mistake(inside(path, name), f"{shown(name)} is none of the joint's bodies {listed(names)}")
    if missing:
        reading.mistake(path, f"the direction on {listed(missing)} is missing")
    if strangers or missing or any(each is BAD for each in value.values()):
        return None
    return unit(value[names[0]]), unit(value[names[1]])
