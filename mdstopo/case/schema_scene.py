"""Format 1 of the case file: bodies, joints, motions, points, members, loads. See `mdstopo.case.schema_case`."""

from __future__ import annotations

from mdstopo.case.kinds import Flag, Kind, Name, Number, NumberOrWord, Ref, Word, explained
from mdstopo.case.number_rows import Rows, Signals
from mdstopo.case.records import ByName, ByShape, Key, ListOf, Record, Tagged, Vector

NUMBER = Number()
POSITIVE = Number(above=0)
NOT_NEGATIVE = Number(minimum=0)
COUNT = Number(minimum=1, whole=True)
PAIR = Vector(2, NUMBER)
FRAMES = explained(
    {
        "global": "global coordinates in the configuration at the start",
        "body": "the body's own coordinates: from its centre of mass, along axes that turn with it",
    }
)
FRAME = Key("frame", FRAMES, "what the coordinates beside it are measured in", default="global")
BODY = Ref("body")
GROUP = Ref("member group")

BODY_KEYS = Record(
    "a body",
    (
        Key("mass", POSITIVE, "mass", required=True, unit="kg"),
        Key("inertia", POSITIVE, "moment of inertia about the centre of mass", required=True, unit="kg m^2"),
        Key("position", PAIR, "centre of mass at the start, [x, y]", required=True, unit="m"),
        Key("angle", NUMBER, "rotation at the start, counter-clockwise", default=0.0, unit="rad"),
        Key("velocity", PAIR, "of the centre of mass at the start, [vx, vy]", default=(0.0, 0.0), unit="m/s"),
        Key("angular_velocity", NUMBER, "at the start, counter-clockwise", default=0.0, unit="rad/s"),
    ),
    doc="A rigid body at the start. The fixed body `ground` is there without being declared.",
)

# Joints and bushings.
_BODIES = Key("bodies", Vector(2, BODY), "the first and the second of the two bodies", required=True)
_NAME = Key("name", Name(), "what responses and results call the joint", otherwise="its index in the list, from 0")
_OWN = ByName("body", PAIR, "[x, y]")
_POINT = ByShape("[x, y] or {body: [x, y], body: [x, y]}", sequence=PAIR, mapping=_OWN)
_TWO = ByShape("[[x, y], [x, y]] or {body: [x, y], body: [x, y]}", sequence=Vector(2, PAIR), mapping=_OWN)


def _joint(word: str, doc: str, *keys: Key) -> Record:
    tag = Key("type", Word((word,)), "which joint it is", required=True)
    return Record(f"a {word} joint", (tag, _NAME, _BODIES, *keys), doc=doc)


JOINT = Tagged(
    "a joint",
    "type",
    {
        "revolute": _joint(
            "revolute",
            "A pin: a point of the one body and a point of the other stay together; the bodies turn freely.",
            Key("at", _POINT, "the common point, or each body's own, which may then misfit", required=True, unit="m"),
        ),
        "prismatic": _joint(
            "prismatic",
            "A slide: the second body moves along an axis of the first and does not turn against it.",
            Key("at", _POINT, "a point on the axis, or each body's own", required=True, unit="m"),
            Key("axis", PAIR, "direction of the slide at the start; the first body carries it", required=True),
        ),
        "fixed": _joint(
            "fixed",
            "A weld: the two bodies move as one.",
            Key(
                "at",
                _POINT,
                "where the reaction is taken, or each body's own point",
                unit="m",
                otherwise="the second body's centre of mass",
            ),
        ),
        "distance": _joint(
            "distance",
            "A rigid link without mass: two points keep their distance, which is that at the start.",
            Key("at", _TWO, "a point on the first body and a point on the second", required=True, unit="m"),
        ),
    },
)
_THREE = Vector(3, NOT_NEGATIVE)
BUSHING = Record(
    "a bushing",
    (
        _BODIES,
        Key("at", _POINT, "the point that the two bodies share at the start", required=True, unit="m"),
        Key(
            "stiffness",
            _THREE,
            "along the first body's x, along its y, in rotation",
            required=True,
            unit="N/m, N/m, N m/rad",
        ),
        Key(
            "damping",
            _THREE,
            "the same of the rates",
            default=(0.0, 0.0, 0.0),
            unit="N s/m, N s/m, N m s/rad",
        ),
    ),
    doc="An elastic joint: forces along the first body's axes and a couple, proportional to displacement and rotation.",
)

# Prescribed motion.
_COORDINATE = Record(
    "a prescribed coordinate",
    (
        Key(
            "acceleration",
            Signals(("a",)),
            "acceleration, integrated from the body's own position and velocity",
            unit="m/s^2 or rad/s^2",
        ),
        Key(
            "velocity",
            Signals(("v",)),
            "velocity; the body's own, where stated, must agree at the start",
            unit="m/s or rad/s",
        ),
        Key(
            "position",
            Signals(("x",), constant=False, order="rising", at_least=4),
            "position, a table of at least 4 rows from start to end without repeated times; a cubic spline joins them",
            unit="m or rad",
        ),
    ),
    one_of=(("acceleration", "velocity", "position"),),
    doc="One coordinate over time: exactly one of its acceleration, velocity and position.",
)
MOTION = Record(
    "a motion",
    (
        Key("body", BODY, "whose coordinates are prescribed; a body is listed once", required=True),
        Key("x", _COORDINATE, "of the centre of mass", otherwise="free"),
        Key("y", _COORDINATE, "of the centre of mass", otherwise="free"),
        Key("angle", _COORDINATE, "of the rotation", otherwise="free"),
    ),
    any_of=("x", "y", "angle"),
    doc="What a body's coordinates do is given; they carry no unknowns, and loads on them change only the reaction.",
)

# Points.
_CENTER = Key("center", PAIR, "centre, [x, y]", required=True, unit="m")
_RADIUS = Key("radius", POSITIVE, "radius", required=True, unit="m")
_COUNT = Key("count", COUNT, "how many points", required=True)
_GRIDS: dict[str, tuple[Kind, str]] = {
    "list": (Rows(("x", "y"), "free"), "the points themselves, rows [x, y]"),
    "line": (
        Record(
            "a line",
            (
                Key("from", PAIR, "first point, [x, y]", required=True, unit="m"),
                Key("to", PAIR, "last point, [x, y]", required=True, unit="m"),
                _COUNT,
            ),
            doc="Points evenly spaced from one end to the other, both included; a count of 1 is the first.",
        ),
        "points on a straight line",
    ),
    "arc": (
        Record(
            "an arc",
            (
                _CENTER,
                _RADIUS,
                Key("from", NUMBER, "angle of the first point, from the x axis", required=True, unit="rad"),
                Key("to", NUMBER, "angle of the last point; may be the smaller one", required=True, unit="rad"),
                _COUNT,
            ),
            doc="Points evenly spaced on a part of a circle, both ends included.",
        ),
        "points on an arc",
    ),
    "circle": (
        Record(
            "a circle",
            (_CENTER, _RADIUS, _COUNT),
            doc="Points evenly spaced on a whole circle, counter-clockwise from angle 0; the first is not repeated.",
        ),
        "points on a circle",
    ),
    "rectangle": (
        Record(
            "a rectangle",
            (_CENTER, Key("size", Vector(2, POSITIVE), "[width, height]", required=True, unit="m"), _COUNT),
            doc="Points evenly spaced along the perimeter, counter-clockwise from the lower left corner.",
        ),
        "points on the sides of a rectangle",
    ),
    "lattice": (
        Record(
            "a lattice",
            (
                Key("from", PAIR, "lower left point, [x, y]", required=True, unit="m"),
                Key("to", PAIR, "upper right point, [x, y]", required=True, unit="m"),
                Key("count", Vector(2, COUNT), "how many along x and along y", required=True),
            ),
            doc="Points that fill a rectangle evenly, borders included; the order runs fastest along x.",
        ),
        "points that fill a rectangle",
    ),
}
_GRID = Record(
    "a grid",
    tuple(Key(name, kind, doc, unit="m" if name == "list" else "") for name, (kind, doc) in _GRIDS.items()),
    one_of=(tuple(_GRIDS),),
    doc="Points of one kind: exactly one of these.",
)
POINTS = Record(
    "a point grid",
    (
        Key("body", BODY, "the body that the points ride on", required=True),
        FRAME,
        Key(
            "grid",
            ByShape("a grid or a list of grids", sequence=ListOf(_GRID, 1, "grids"), mapping=_GRID),
            "where the points are: one grid, or a list whose points follow each other",
            required=True,
        ),
    ),
    doc="Named points on one body, where members may be fixed.",
)

# Members.
_ACTIVE = (
    Key("active_from", NUMBER, "acts from this time on", unit="s", otherwise="always"),
    Key("active_until", NUMBER, "acts until this time, not at it", unit="s", otherwise="always"),
)
_STIFFNESS = Key("stiffness", NOT_NEGATIVE, "k at alpha = 1", required=True, unit="N/m")
_DAMPING = Key("damping", NOT_NEGATIVE, "c at alpha = 1", default=0.0, unit="N s/m")
_FREE_LENGTH = Key(
    "free_length", POSITIVE, "l0, the length at which Delta = 0", unit="m", otherwise="each member's initial length"
)
_SIDES = explained(
    {
        "tension": "closes where the member has become longer: Delta >= gap",
        "compression": "closes where it has become shorter: k (Delta + gap) + c dDelta/dt for Delta <= -gap",
    }
)


_CRUSHED = explained(
    {
        "compression": "it is crushed where the member becomes shorter, and pushes",
        "tension": "it is drawn out where the member becomes longer, and pulls",
    }
)


def _law(word: str, doc: str, *keys: Key) -> Record:
    tag = Key("type", Word((word,)), "which law it is", required=True)
    article = "an" if word[0] in "aeiou" else "a"
    return Record(f"{article} {word} law", (tag, *keys, *_ACTIVE), doc=doc)


LAW = Tagged(
    "a member law",
    "type",
    {
        "spring": _law(
            "spring",
            "Passive: f = k Delta + c dDelta/dt + preload (Eq. 2); energy k Delta^2 / 2.",
            _STIFFNESS,
            _DAMPING,
            _FREE_LENGTH,
            Key("preload", NUMBER, "tension at Delta = 0, at alpha = 1", default=0.0, unit="N"),
        ),
        "gap": _law(
            "gap",
            "Reactive, a belt with slack or a contact: f = 0 until Delta >= gap, then k (Delta - gap) + c dDelta/dt "
            "(Eq. 3); energy k (Delta - gap)^2 / 2 while closed.",
            _STIFFNESS,
            _DAMPING,
            Key("gap", NUMBER, "elongation at which it closes", default=0.0, unit="m"),
            _FREE_LENGTH,
            Key("side", _SIDES, "on which side it acts", default="tension"),
            Key("clip", Flag(), "true: damping cannot reverse the force; false: Eq. 3 to the letter", default=False),
        ),
        "cubic": _law(
            "cubic",
            "Passive: f = k1 Delta + k3 Delta^3; energy k1 Delta^2 / 2 + k3 Delta^4 / 4.",
            Key("stiffness", NOT_NEGATIVE, "k1 at alpha = 1", required=True, unit="N/m"),
            Key("cubic", NUMBER, "k3 at alpha = 1; negative: it softens", required=True, unit="N/m^3"),
            _FREE_LENGTH,
        ),
        "curve": _law(
            "curve",
            "Passive: f follows a monotone cubic (PCHIP) through rows [Delta, f], linear outside them; its integral "
            "from Delta = 0 is the energy.",
            Key("curve", Rows(("Delta", "f"), "rising", 2), "rows of rising Delta", required=True, unit="m and N"),
            _FREE_LENGTH,
        ),
        "pulse": _law(
            "pulse",
            "Active: f = f0 exp(-sigma (t - t0)^2) (Eq. 4); stores no energy.",
            Key("peak", NUMBER, "f0, the largest tension at alpha = 1", required=True, unit="N"),
            Key("rate", NOT_NEGATIVE, "sigma; larger is shorter", required=True, unit="1/s^2"),
            Key("time", NUMBER, "t0, when the peak is", required=True, unit="s"),
        ),
        "table": _law(
            "table",
            "Active: f is a table of time; stores no energy.",
            Key("table", Rows(("t", "f")), "tension over time at alpha = 1", required=True, unit="s and N"),
        ),
        "actuator": _law(
            "actuator",
            "Active: f = kp (Delta - target) + kd dDelta/dt, kept between -limit and limit; stores no energy.",
            Key("proportional", NOT_NEGATIVE, "kp at alpha = 1", required=True, unit="N/m"),
            Key("derivative", NOT_NEGATIVE, "kd at alpha = 1", default=0.0, unit="N s/m"),
            Key("target", NUMBER, "the elongation that it steers to", default=0.0, unit="m"),
            Key("limit", NOT_NEGATIVE, "largest force at alpha = 1", unit="N", otherwise="none"),
        ),
        "crush": _law(
            "crush",
            "Reactive, a crushable leg or an energy absorber: f rises with k (Delta - gap) up to F, stays F while it "
            "is crushed further, falls with k on the way back to 0 and leaves a permanent set; energy f^2 / (2 k).",
            Key("stiffness", POSITIVE, "k at alpha = 1", required=True, unit="N/m"),
            Key("force", POSITIVE, "F, the plateau, at alpha = 1", required=True, unit="N"),
            Key("gap", NUMBER, "elongation, or shortening, at which contact begins", default=0.0, unit="m"),
            _FREE_LENGTH,
            Key("side", _CRUSHED, "the way in which it is crushed", default="compression"),
        ),
        "inerter": _law(
            "inerter",
            "Passive: f = b d2Delta/dt2, the acceleration of Eq. 1; stores no energy.",
            Key("inertance", NOT_NEGATIVE, "b at alpha = 1", required=True, unit="kg"),
        ),
    },
)


def parameter_words() -> dict[str, str]:
    """The numbers that laws have, each with its unit and the laws that have it."""
    found: dict[str, tuple[str, list[str]]] = {}
    for law, record in LAW.variants.items():
        for key in record.keys:
            if isinstance(key.kind, Number):
                found.setdefault(key.name, (key.unit, []))[1].append(law)
    return {
        name: f"of {'every law' if len(laws) == len(LAW.variants) else ', '.join(laws)}, in {unit}"
        for name, (unit, laws) in found.items()
    }


_END = ByShape(
    "the name of a point grid or {body: name, at: [x, y]}",
    scalar=Ref("point grid"),
    mapping=Record(
        "an end in place",
        (
            Key("body", BODY, "the body that it is on", required=True),
            Key("at", PAIR, "the point, [x, y]", required=True, unit="m"),
            FRAME,
        ),
        doc="A single point, given where it is used.",
    ),
)
_CONNECT = explained(
    {
        "all": "every point P with every point Q",
        "pairs": "the first P with the first Q, the second with the second; needs equal counts",
    }
)
_COST = explained({"length": "the member's initial length in m"}, " | a number >= 0")
GROUP_KEYS = Record(
    "a member group",
    (
        Key("from", _END, "P, the first ends: a point grid, or one point in place", required=True),
        Key("to", _END, "Q, the second ends, on another body", required=True),
        Key("connect", _CONNECT, "which points are joined", default="all"),
        Key("min_length", NOT_NEGATIVE, "shorter members are left out, by initial length", default=0.0, unit="m"),
        Key("max_length", NOT_NEGATIVE, "longer members are left out", unit="m", otherwise="none"),
        Key(
            "law",
            ByShape("a law or a list of laws", sequence=ListOf(LAW, 1, "laws"), mapping=LAW),
            "how force follows from motion and time: one law, or a list whose forces add",
            required=True,
        ),
        Key("cost", NumberOrWord(NOT_NEGATIVE, _COST), "V_i, what a whole member adds to the volume", default=1.0),
        Key(
            "design",
            Flag(),
            "true: each member is a design variable; false: ordinary force elements, alpha = 1, without cost",
            default=True,
        ),
    ),
    doc="Candidate members between two bodies. Groups in order, P slow and Q fast, give the design variables' order.",
)

# Loads and load cases.
LOAD = Record(
    "a load",
    (
        Key("body", BODY, "the body that it acts on", required=True),
        Key("force", Signals(("fx", "fy")), "force", unit="N"),
        Key("moment", Signals(("moment",)), "couple, counter-clockwise", unit="N m"),
        Key("acceleration", Signals(("ax", "ay")), "stands for the force mass times this", unit="m/s^2"),
        Key("angular_acceleration", Signals(("value",)), "stands for the couple inertia times this", unit="rad/s^2"),
        Key("at", PAIR, "where the force acts; rides on the body", unit="m", otherwise="the centre of mass"),
        Key("frame", FRAMES, "of `at` and of the force; body: a follower load", default="global"),
    ),
    any_of=("force", "moment", "acceleration", "angular_acceleration"),
    never_both=(("force", "acceleration"), ("moment", "angular_acceleration")),
    doc="A force and a couple on a body, constant or over time.",
)
LOADS = Key("loads", ListOf(LOAD, what="loads"), "what acts in every load case, besides gravity", default=())
MOTIONS = Key("motions", ListOf(MOTION, what="motions"), "prescribed motions, in every load case", default=())
LOAD_CASE = Record(
    "a load case",
    (
        Key("gravity", PAIR, "in place of the common one", unit="m/s^2", otherwise="the common one"),
        Key(
            "time",
            Record(
                "times",
                (
                    Key("start", NUMBER, "when it begins", unit="s", otherwise="the common one"),
                    Key("end", NUMBER, "when it ends", unit="s", otherwise="the common one"),
                ),
                doc="Times of this load case.",
            ),
            "in place of the common times, key by key",
        ),
        Key("loads", LOADS.kind, "added to the common ones", default=()),
        Key("motions", MOTIONS.kind, "a body's entry replaces its common one as a whole", default=()),
    ),
    doc="One loading: what it adds to the common part of the case. Each is simulated by itself.",
)
