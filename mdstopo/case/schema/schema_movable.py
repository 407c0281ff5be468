"""Format 1 of the case file: where points may move that are design variables. See `schema_case`."""

from __future__ import annotations

from mdstopo.case.keys.common_keys import PAIR
from mdstopo.case.keys.kinds import POSITIVE
from mdstopo.case.keys.records import Key, Record, Vector

_AROUND = Key(
    "around",
    POSITIVE,
    "by how much each coordinate may change, up and down, from where the grid has it; variables dx, dy, dz are by how "
    "much it has",
    unit="m",
)

_IN_SPACE = "it is for a case with `dimension: 3`; in the plane there is the rectangle"
_RECTANGLE = Record(
    "a rectangle",
    (
        Key("center", PAIR, "centre, [x, y]", required=True, unit="m"),
        Key("size", Vector(2, POSITIVE), "[width, height]", required=True, unit="m"),
    ),
    doc="All that lies in a rectangle; a point in it has two variables, x and y.",
)


def along_line(first: Key, last: Key) -> Key:
    """The keys of a region that is a straight line between two points."""
    doc = "A straight line between two points; a point on it has one variable, its distance from the first."
    return Key("line", Record("a line", (first, last), doc=doc), "the points move along a straight line")


def movable(*regions: Key) -> Key:
    """The key `movable` of a point grid, for points that move within one of these regions."""
    regions = (*regions, _AROUND)
    within = Record(
        "a region",
        regions,
        one_of=(tuple(key.name for key in regions),),
        doc="Where the points may be, in the frame of their grid: exactly one of these.",
        elsewhere=() if any(key.name == "box" for key in regions) else (("box", _IN_SPACE),),
    )
    return Key(
        "movable",
        Record(
            "where points may move",
            (Key("within", within, "where each of the points may be", required=True),),
            doc="The coordinates of the points, at which members end, are design variables; the grid says where they "
            "begin.",
        ),
        "the points are design variables, within a region",
        otherwise="the points stay where they are on their body",
    )


MOVABLE = movable(
    along_line(
        Key("from", PAIR, "one end, [x, y]", required=True, unit="m"),
        Key("to", PAIR, "the other end, [x, y]", required=True, unit="m"),
    ),
    Key("rectangle", _RECTANGLE, "the points move within a rectangle"),
)
