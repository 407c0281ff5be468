"""Format 1 of the case file: contacts of points with edges. See `schema_case`."""

from __future__ import annotations

from mdstopo.case.keys.common_keys import BODY, FRAME, PAIR
from mdstopo.case.keys.kinds import NOT_NEGATIVE, POSITIVE, Name, Ref
from mdstopo.case.keys.records import Key, Record

EDGE = Record(
    "an edge",
    (
        Key("body", BODY, "the body that has the edge", required=True),
        Key("from", PAIR, "its first end, [x, y]", required=True, unit="m"),
        Key("to", PAIR, "its second end; the side to the left of the way there is free", required=True, unit="m"),
        FRAME,
    ),
    doc="A straight edge of a body. Seen from `from` towards `to`, the left is free and the right is inside.",
)
CONTACT = Record(
    "a contact",
    (
        Key("name", Name(), "what messages call it", otherwise="its index in the list, from 0"),
        Key("points", Ref("point grid"), "the points that may touch, each by itself", required=True),
        Key("on", EDGE, "the edge of another body that they touch", required=True),
        Key("stiffness", POSITIVE, "k: normal force of each point by its depth", required=True, unit="N/m"),
        Key("damping", NOT_NEGATIVE, "c: of the rate; it never pulls", default=0.0, unit="N s/m"),
        Key("friction", NOT_NEGATIVE, "mu: sliding force by normal force", default=0.0),
        Key("slip", POSITIVE, "speed at which friction has 76 % of its full value", default=0.01, unit="m/s"),
    ),
    doc="Points of one body against an edge of another, with friction: one-sided, no design variable.",
)
