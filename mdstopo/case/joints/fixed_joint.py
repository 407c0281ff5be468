"""A weld."""

from __future__ import annotations

from typing import ClassVar

from mdstopo.case.joints.joint import POINT, Joint
from mdstopo.case.keys.records import Key
from mdstopo.case.value import frozen


@frozen(kw_only=True)
class FixedJoint(Joint):
    """The two points coincide and neither body turns against the other."""

    type: ClassVar[str] = "fixed"
    doc: ClassVar[str] = "A weld: the two bodies move as one."
    keys: ClassVar[tuple[Key, ...]] = (
        Key(
            "at",
            POINT,
            "where the reaction is taken, or each body's own point",
            unit="m",
            otherwise="the second body's centre of mass",
        ),
    )
    kernels: ClassVar[str] = "mdstopo.mechanics.joints.fixed"
    keeps_angle: ClassVar[bool] = True
    keeps_point: ClassVar[bool] = True
