"""Format 1 of the case file in space: surfaces that points of other bodies touch. See `schema_case`."""

from __future__ import annotations

from mdstopo.case.keys.common_keys import BODY, DIRECTION, FRAME, TRIPLE
from mdstopo.case.keys.kinds import POSITIVE, Flag
from mdstopo.case.keys.records import Key, Record, Vector

_CENTER = Key("center", TRIPLE, "centre", required=True, unit="m")
_RADIUS = Key("radius", POSITIVE, "radius", required=True, unit="m")
_PLANE = Record(
    "a plane",
    (
        Key("at", TRIPLE, "any point of it", required=True, unit="m"),
        Key("normal", DIRECTION, "of any length; it points to the free side", required=True),
    ),
    doc="A plane without ends.",
)
_RECTANGLE = Record(
    "a rectangle",
    (
        _CENTER,
        Key(
            "axes",
            Vector(2, DIRECTION),
            "directions of its sides, perpendicular; the free side is that of the first one times the second one, "
            "right-handed",
            required=True,
        ),
        Key("size", Vector(2, POSITIVE), "[a, b], along the first axis and along the second", True, unit="m"),
    ),
    doc="A part of a plane: points that are beside it do not touch it.",
)
_SPHERE = Record(
    "a sphere",
    (_CENTER, _RADIUS, Key("hollow", Flag(), "points are free inside, as in a bowl, and not outside", default=False)),
    doc="A sphere, from outside or from inside.",
)
_CYLINDER = Record(
    "a cylinder",
    (
        Key("from", TRIPLE, "one end of its axis", required=True, unit="m"),
        Key("to", TRIPLE, "the other end", required=True, unit="m"),
        _RADIUS,
        Key("hollow", Flag(), "points are free inside, as in a pipe, and not outside", default=False),
    ),
    doc="The round side of a cylinder, from outside or from inside; its flat ends are no part of it.",
)
SHAPES = {
    "plane": (_PLANE, "a plane, without ends"),
    "rectangle": (_RECTANGLE, "a rectangle"),
    "sphere": (_SPHERE, "a sphere"),
    "cylinder": (_CYLINDER, "the round side of a cylinder"),
}
SURFACE = Record(
    "a surface",
    (
        Key("body", BODY, "the body that has the surface", required=True),
        *(Key(name, record, doc) for name, (record, doc) in SHAPES.items()),
        FRAME,
    ),
    one_of=(tuple(SHAPES),),
    elsewhere=(
        ("from", "an edge is for a case in the plane; in space it is `plane`, `rectangle`, `sphere` or `cylinder`"),
        ("to", "an edge is for a case in the plane; in space it is `plane`, `rectangle`, `sphere` or `cylinder`"),
    ),
    doc="A surface of a body, of one shape; one side of it is free.",
)
