"""Keys and kinds of values that several sections of a case have in common."""

from __future__ import annotations

from mdstopo.case.keys.kinds import NUMBER, Number, Ref, explained
from mdstopo.case.keys.records import Direction, Key, Vector

COUNT = Number(minimum=1, whole=True)
BODY = Ref("body")
GROUP = Ref("member group")
#: a point or a vector in the plane
PAIR = Vector(2, NUMBER, ((3, "three are for a case with `dimension: 3`"),))
#: a point or a vector in space
TRIPLE = Vector(3, NUMBER, ((2, "two are for a case in the plane"),))
DIRECTION = Direction(TRIPLE)
#: what is told of keys and words that only cases in space have
IN_SPACE = "it is for a case with `dimension: 3`"
FRAMES = explained(
    {
        "global": "global coordinates in the configuration at the start",
        "body": "the body's own coordinates: from its centre of mass, along axes that turn with it",
    }
)
FRAME = Key("frame", FRAMES, "what the coordinates beside it are measured in", default="global")
