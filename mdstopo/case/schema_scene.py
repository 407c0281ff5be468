"""Format 1 of the case file: bodies, joints, motions, points, members, loads. See `mdstopo.case.schema`."""

from __future__ import annotations

from mdstopo.case.kinds import Flag, Kind, Name, Number, NumberOrWord, Ref, Word
from mdstopo.case.records import ByName, ByShape, Key, ListOf, Record, Tagged, Vector
from mdstopo.case.rows import Rows, Signals

NUMBER = Number()
POSITIVE = Number(above=0)
NOT_NEGATIVE = Number(minimum=0)
COUNT = Number(minimum=1, whole=True)
PAIR = Vector(2, NUMBER)
FRAME = Key("frame", Word(("global", "body")), "whose coordinates these are, at the start", default="global")
BODY = Ref("body")
GROUP = Ref("member group")

BODY_KEYS = Record(
    "a body",
    (
        Key("mass", POSITIVE, "in kg", required=True),
        Key("inertia", POSITIVE, "about the centre of mass, in kg m^2", required=True),
        Key("position", PAIR, "of the centre of mass, in m", required=True),
        Key("angle", NUMBER, "in rad", default=0.0),
        Key("velocity", PAIR, "of the centre of mass, in m/s", default=(0.0, 0.0)),
        Key("angular_velocity", NUMBER, "in rad/s", default=0.0),
    ),
)

# Joints and bushings.
_BODIES = Key("bodies", Vector(2, BODY), "first and second", required=True)
_NAME = Key("name", Name(), "optional, else the index")
_OWN = ByName("body", PAIR, "[x, y]")
_POINT = ByShape("[x, y] or {body: [x, y], body: [x, y]}", sequence=PAIR, mapping=_OWN)
_TWO = ByShape("[[x, y], [x, y]] or {body: [x, y], body: [x, y]}", sequence=Vector(2, PAIR), mapping=_OWN)


def _joint(word: str, *keys: Key) -> Record:
    return Record(f"a {word} joint", (Key("type", Word((word,)), required=True), _NAME, _BODIES, *keys))


JOINT = Tagged(
    "a joint",
    "type",
    {
        "revolute": _joint("revolute", Key("at", _POINT, "the common point", required=True)),
        "prismatic": _joint(
            "prismatic",
            Key("at", _POINT, "a point on the axis", required=True),
            Key("axis", PAIR, "direction, carried by the first body", required=True),
        ),
        "fixed": _joint("fixed", Key("at", _POINT, "default: the second body's centre of mass")),
        "distance": _joint("distance", Key("at", _TWO, "a point on each body", required=True)),
    },
)
_THREE = Vector(3, NOT_NEGATIVE)
BUSHING = Record(
    "a bushing",
    (
        _BODIES,
        Key("at", _POINT, "the common point", required=True),
        Key("stiffness", _THREE, "along the first body's axes and in rotation", required=True),
        Key("damping", _THREE, "the same of the rates", default=(0.0, 0.0, 0.0)),
    ),
)

# Prescribed motion.
_COORDINATE = Record(
    "a prescribed coordinate",
    (
        Key("acceleration", Signals(("a",)), "number or table of time, integrated from the body's own start"),
        Key("velocity", Signals(("v",)), "number or table of time"),
        Key(
            "position",
            Signals(("x",), constant=False, order="rising", at_least=4),
            "table of at least 4 rows from start to end, interpolated by a cubic spline",
        ),
    ),
    one_of=(("acceleration", "velocity", "position"),),
)
MOTION = Record(
    "a motion",
    (
        Key("body", BODY, required=True),
        Key("x", _COORDINATE, "of the centre of mass"),
        Key("y", _COORDINATE, "of the centre of mass"),
        Key("angle", _COORDINATE),
    ),
    any_of=("x", "y", "angle"),
)

# Points.
_CENTER = Key("center", PAIR, required=True)
_COUNT = Key("count", COUNT, "how many points", required=True)
_GRIDS: dict[str, Kind] = {
    "list": Rows(("x", "y"), "free"),
    "line": Record(
        "a line", (Key("from", PAIR, required=True), Key("to", PAIR, required=True), _COUNT)
    ),
    "arc": Record(
        "an arc",
        (
            _CENTER,
            Key("radius", POSITIVE, required=True),
            Key("from", NUMBER, "angle in rad", required=True),
            Key("to", NUMBER, "angle in rad", required=True),
            _COUNT,
        ),
    ),
    "circle": Record("a circle", (_CENTER, Key("radius", POSITIVE, required=True), _COUNT)),
    "rectangle": Record(
        "a rectangle", (_CENTER, Key("size", Vector(2, POSITIVE), "width, height", required=True), _COUNT)
    ),
    "lattice": Record(
        "a lattice",
        (
            Key("from", PAIR, required=True),
            Key("to", PAIR, required=True),
            Key("count", Vector(2, COUNT), "along x, along y", required=True),
        ),
    ),
}  # fmt: skip
_GRID = Record("a grid", tuple(Key(name, kind) for name, kind in _GRIDS.items()), one_of=(tuple(_GRIDS),))
POINTS = Record(
    "a point grid",
    (
        Key("body", BODY, required=True),
        FRAME,
        Key(
            "grid",
            ByShape("a grid or a list of grids", sequence=ListOf(_GRID, 1, "grids"), mapping=_GRID),
            "one, or a list that concatenates",
            required=True,
        ),
    ),
)

# Members.
_ACTIVE = (
    Key("active_from", NUMBER, "in s: acts from then on"),
    Key("active_until", NUMBER, "in s: acts until then, not at it"),
)
_DAMPING = Key("damping", NOT_NEGATIVE, "c in N s/m", default=0.0)
_FREE_LENGTH = Key("free_length", POSITIVE, "l0 in m, default the initial length")


def _law(word: str, *keys: Key) -> Record:
    return Record(f"a {word} law", (Key("type", Word((word,)), required=True), *keys, *_ACTIVE))


LAW = Tagged(
    "a member law",
    "type",
    {
        "spring": _law(
            "spring",
            Key("stiffness", NOT_NEGATIVE, "k in N/m at alpha = 1", required=True),
            _DAMPING,
            _FREE_LENGTH,
            Key("preload", NUMBER, "in N", default=0.0),
        ),
        "gap": _law(
            "gap",
            Key("stiffness", NOT_NEGATIVE, "k in N/m at alpha = 1", required=True),
            _DAMPING,
            Key("gap", NUMBER, "elongation in m at which it closes", default=0.0),
            _FREE_LENGTH,
            Key("side", Word(("tension", "compression")), default="tension"),
            Key("clip", Flag(), "damping cannot reverse the force", default=False),
        ),
        "cubic": _law(
            "cubic",
            Key("stiffness", NOT_NEGATIVE, "k1 in N/m", required=True),
            Key("cubic", NUMBER, "k3 in N/m^3", required=True),
            _FREE_LENGTH,
        ),
        "curve": _law(
            "curve",
            Key("curve", Rows(("Delta", "f"), "rising", 2), "rows [Delta, f] in m and N", required=True),
            _FREE_LENGTH,
        ),
        "pulse": _law(
            "pulse",
            Key("peak", NUMBER, "f0 in N", required=True),
            Key("rate", NOT_NEGATIVE, "sigma in 1/s^2", required=True),
            Key("time", NUMBER, "t0 in s", required=True),
        ),
        "table": _law("table", Key("table", Rows(("t", "f")), "rows [t, f] in s and N", required=True)),
        "actuator": _law(
            "actuator",
            Key("proportional", NOT_NEGATIVE, "kp in N/m", required=True),
            Key("derivative", NOT_NEGATIVE, "kd in N s/m", default=0.0),
            Key("target", NUMBER, "elongation in m", default=0.0),
            Key("limit", NOT_NEGATIVE, "of the force in N, default none"),
        ),
        "inerter": _law("inerter", Key("inertance", NOT_NEGATIVE, "b in kg", required=True)),
    },
)
_END = ByShape(
    "the name of a point grid or {body: name, at: [x, y]}",
    scalar=Ref("point grid"),
    mapping=Record(
        "an end in place", (Key("body", BODY, required=True), Key("at", PAIR, required=True), FRAME)
    ),
)  # fmt: skip
GROUP_KEYS = Record(
    "a member group",
    (
        Key("from", _END, "P, on MDS-1: a point grid or {body: ground, at: [0, 1]}", required=True),
        Key("to", _END, "Q, on MDS-2", required=True),
        Key("connect", Word(("all", "pairs")), "every P with every Q, or first with first", default="all"),
        Key("min_length", NOT_NEGATIVE, "of the initial length in m, itself included", default=0.0),
        Key("max_length", NOT_NEGATIVE, "of the initial length in m, itself included"),
        Key(
            "law",
            ByShape("a law or a list of laws", sequence=ListOf(LAW, 1, "laws"), mapping=LAW),
            "one law, or a list whose forces add",
            required=True,
        ),
        Key("cost", NumberOrWord(NOT_NEGATIVE, Word(("length",), " | a number >= 0")), "V_i", default=1.0),
        Key("design", Flag(), "false: an ordinary force element, alpha = 1", default=True),
    ),
)

# Loads and load cases.
LOAD = Record(
    "a load",
    (
        Key("body", BODY, required=True),
        Key("force", Signals(("fx", "fy")), "in N"),
        Key("moment", Signals(("moment",)), "in N m"),
        Key("acceleration", Signals(("ax", "ay")), "stands for the force mass x acceleration"),
        Key("angular_acceleration", Signals(("value",)), "stands for the moment inertia x this"),
        Key("at", PAIR, "where the force acts, default the centre of mass; rides on the body"),
        Key("frame", FRAME.kind, "body: at and force in body axes, a follower load", default="global"),
    ),
    any_of=("force", "moment", "acceleration", "angular_acceleration"),
    never_both=(("force", "acceleration"), ("moment", "angular_acceleration")),
)
LOADS = Key("loads", ListOf(LOAD, what="loads"), "act in every load case", default=())
MOTIONS = Key("motions", ListOf(MOTION, what="motions"), "prescribed motions, a body once", default=())
LOAD_CASE = Record(
    "a load case",
    (
        Key("gravity", PAIR, "replaces the common one"),
        Key("time", Record("times", (Key("start", NUMBER, "in s"), Key("end", NUMBER, "in s")))),
        Key("loads", LOADS.kind, "added to the common ones", default=()),
        Key("motions", MOTIONS.kind, "a body's entry replaces the common one whole", default=()),
    ),
)
