"""A pin."""

from __future__ import annotations

from typing import ClassVar

from mdstopo.case.joints.joint import POINT, Joint
from mdstopo.case.keys.records import Key
from mdstopo.case.value import frozen


@frozen(kw_only=True)
class RevoluteJoint(Joint):
    """A pin joint: a point of each body coincides with one of the other."""

    type: ClassVar[str] = "revolute"
    doc: ClassVar[str] = (
        "A pin: a point of the one body and a point of the other stay together; the bodies turn freely."
    )
    keys: ClassVar[tuple[Key, ...]] = (
        Key("at", POINT, "the common point, or each body's own, which may then misfit", required=True, unit="m"),
    )
    kernels: ClassVar[str] = "mdstopo.mechanics.joints.revolute"
    keeps_point: ClassVar[bool] = True
    turns_about_normal: ClassVar[bool] = True
