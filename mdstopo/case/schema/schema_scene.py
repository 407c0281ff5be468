"""Format 1 of the case file: bodies, joints, motions, points, members, loads. See `schema_case`."""

from __future__ import annotations

import contextlib

from mdstopo.case.joints import JOINTS
from mdstopo.case.joints.joint import BODIES, POINT
from mdstopo.case.joints.joint import record_of as record_of_joint
from mdstopo.case.keys.brought_records import Brought, BroughtError
from mdstopo.case.keys.common_keys import BODY, COUNT, FRAME, FRAMES, IN_SPACE, PAIR
from mdstopo.case.keys.kinds import (
    NOT_NEGATIVE,
    NUMBER,
    POSITIVE,
    Flag,
    Kind,
    Number,
    NumberOrWord,
    Ref,
    ScalarInPlane,
    explained,
)
from mdstopo.case.keys.number_rows import Rows, Signals
from mdstopo.case.keys.records import ByShape, Key, ListOf, Record, Tagged, Vector
from mdstopo.case.laws import LAWS, enter_law
from mdstopo.case.laws.law import record_of as record_of_law
from mdstopo.case.schema.schema_movable import MOVABLE
from mdstopo.case.schema.schema_outline import OUTLINE

MASS = Key("mass", POSITIVE, "mass", required=True, unit="kg")
BODY_KEYS = Record(
    "a body",
    (
        MASS,
        Key(
            "inertia",
            ScalarInPlane(above=0),
            "moment of inertia about the centre of mass",
            required=True,
            unit="kg m^2",
        ),
        Key("position", PAIR, "centre of mass at the start, [x, y]", required=True, unit="m"),
        Key("angle", NUMBER, "rotation at the start, counter-clockwise", default=0.0, unit="rad"),
        Key("velocity", PAIR, "of the centre of mass at the start, [vx, vy]", default=(0.0, 0.0), unit="m/s"),
        Key("angular_velocity", ScalarInPlane(), "at the start, counter-clockwise", default=0.0, unit="rad/s"),
        OUTLINE,
    ),
    doc="A rigid body at the start. The fixed body `ground` is there without being declared.",
    elsewhere=(("orientation", f"in the plane it is `angle`; {IN_SPACE}"),),
)

# Joints and bushings.
JOINT = Tagged(
    "a joint",
    "type",
    {word: record_of_joint(joint) for word, joint in JOINTS.items()},
    elsewhere=tuple((word, IN_SPACE) for word in ("spherical", "universal", "cylindrical", "planar")),
)
_THREE = Vector(3, NOT_NEGATIVE)
BUSHING = Record(
    "a bushing",
    (
        BODIES,
        Key("at", POINT, "the point that the two bodies share at the start", required=True, unit="m"),
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
COORDINATE = Record(
    "a prescribed coordinate",
    (
        Key(
            "acceleration",
            Signals(("a",), formula=True),
            "acceleration, integrated from the body's own position and velocity",
            unit="m/s^2 or rad/s^2",
        ),
        Key(
            "velocity",
            Signals(("v",), formula=True),
            "velocity; the body's own, where stated, must agree at the start",
            unit="m/s or rad/s",
        ),
        Key(
            "position",
            Signals(("x",), constant=False, order="rising", at_least=4, formula=True),
            "position, a table of at least 4 rows from start to end without repeated times, which a cubic spline "
            "joins, or an expression of t",
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
        Key("x", COORDINATE, "of the centre of mass", otherwise="free"),
        Key("y", COORDINATE, "of the centre of mass", otherwise="free"),
        Key("angle", COORDINATE, "of the rotation", otherwise="free"),
    ),
    any_of=("x", "y", "angle"),
    doc="What a body's coordinates do is given; they carry no unknowns, and loads on them change only the reaction.",
    elsewhere=(("z", IN_SPACE), ("rotation", f"in the plane it is `angle`; {IN_SPACE}")),
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
            elsewhere=(("normal", IN_SPACE), ("start", IN_SPACE)),
        ),
        "points on an arc",
    ),
    "circle": (
        Record(
            "a circle",
            (_CENTER, _RADIUS, _COUNT),
            doc="Points evenly spaced on a whole circle, counter-clockwise from angle 0; the first is not repeated.",
            elsewhere=(("normal", IN_SPACE), ("start", IN_SPACE)),
        ),
        "points on a circle",
    ),
    "rectangle": (
        Record(
            "a rectangle",
            (_CENTER, Key("size", Vector(2, POSITIVE), "[width, height]", required=True, unit="m"), _COUNT),
            doc="Points evenly spaced along the perimeter, counter-clockwise from the lower left corner.",
            elsewhere=(("axes", IN_SPACE),),
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
    elsewhere=tuple((word, IN_SPACE) for word in ("plane", "box", "cylinder", "file")),
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
        MOVABLE,
    ),
    doc="Named points on one body, where members may be fixed.",
)

# Members.
LAW = Tagged(
    "a member law", "type", {word: record_of_law(law) for word, law in LAWS.items()}, Brought("mdstopo.laws", enter_law)
)


def parameter_words(from_everywhere: bool = False) -> dict[str, str]:
    """The numbers that laws have, each with its unit and the laws that have it.

    from_everywhere: other distributions are asked for their laws.
    """
    if from_everywhere and LAW.more is not None:
        with contextlib.suppress(BroughtError):  # whoever names such a law is told
            LAW.more.find_all()
    found: dict[str, tuple[str, list[str]]] = {}
    for law, record in LAW.known.items():
        for key in record.keys:
            if isinstance(key.kind, Number):
                found.setdefault(key.name, (key.unit, []))[1].append(law)
    return {
        name: f"of {'every law' if len(laws) == len(LAW.known) else ', '.join(laws)}, in {unit}"
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
_CANDIDATES = explained(
    {
        "enumerated": "each is a member from the start",
        "priced": "none is built until its price says that it would lower the objective",
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
        Key("candidates", _CANDIDATES, "whether all are built, or only those that pay", default="enumerated"),
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
        Key("force", Signals(("fx", "fy"), formula=True), "force", unit="N"),
        Key("moment", Signals(("moment",), formula=True), "couple, counter-clockwise", unit="N m"),
        Key("acceleration", Signals(("ax", "ay"), formula=True), "stands for the force mass times this", unit="m/s^2"),
        Key(
            "angular_acceleration",
            Signals(("value",), formula=True),
            "stands for the couple inertia times this",
            unit="rad/s^2",
        ),
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
