"""What points and directions of joints in space look like in a case file."""

from __future__ import annotations

from mdstopo.case.keys.common_keys import DIRECTION, TRIPLE
from mdstopo.case.keys.records import ByName, ByShape, Key, Vector

_OWN = ByName("body", TRIPLE, "[x, y, z]")
_OWN_DIRECTION = ByName("body", DIRECTION, "[x, y, z]")
#: a point that both bodies share, or each body's own
POINT = ByShape("[x, y, z] or {body: [x, y, z], body: [x, y, z]}", sequence=TRIPLE, mapping=_OWN)
#: a point of each body
TWO_POINTS = ByShape(
    "[[x, y, z], [x, y, z]] or {body: [x, y, z], body: [x, y, z]}", sequence=Vector(2, TRIPLE), mapping=_OWN
)
_AXIS = ByShape("[x, y, z] or {body: [x, y, z], body: [x, y, z]}", sequence=DIRECTION, mapping=_OWN_DIRECTION)
_TWO_AXES = ByShape(
    "[[x, y, z], [x, y, z]] or {body: [x, y, z], body: [x, y, z]}",
    sequence=Vector(2, DIRECTION),
    mapping=_OWN_DIRECTION,
)


def at(doc: str) -> Key:
    """The key for a joint's point, described by `doc`."""
    return Key("at", POINT, f"{doc}, or each body's own, which may then misfit", required=True, unit="m")


def axis(name: str, doc: str) -> Key:
    """A key for a direction of a joint, as it is at the start, described by `doc`."""
    return Key(name, _AXIS, f"{doc} at the start, of any length, or each body's own", required=True)


AXES = Key(
    "axes",
    _TWO_AXES,
    "the axis that rides on the first body, and the one that rides on the second; of any length",
    required=True,
)
