"""Format 1 of the case file in space: what differs from the plane. See `schema_case`."""

from __future__ import annotations

from dataclasses import replace

from mdstopo.case.geometry.mesh_files import MeshFile
from mdstopo.case.joints.joint import record_of
from mdstopo.case.joints.joints_in_space import SPATIAL_JOINTS
from mdstopo.case.joints.spatial_keys import POINT
from mdstopo.case.keys.common_keys import BODY, COUNT, DIRECTION, FRAME, FRAMES, TRIPLE
from mdstopo.case.keys.kinds import NOT_NEGATIVE, NUMBER, POSITIVE, Kind
from mdstopo.case.keys.number_rows import Rows, Signals
from mdstopo.case.keys.records import ByDepth, ByShape, Key, ListOf, Named, Record, Tagged, Vector
from mdstopo.case.responses.response_kinds import response_kinds
from mdstopo.case.responses.spatial_responses import IN_PLANE_ALONE, SPATIAL_RESPONSES
from mdstopo.case.schema.schema_case import CONSTRAINT, FORMAT, LOAD_CASE_KEY, OBJECTIVE
from mdstopo.case.schema.schema_contact import CONTACT
from mdstopo.case.schema.schema_fit import fit_record
from mdstopo.case.schema.schema_movable import along_line, movable
from mdstopo.case.schema.schema_outline import OUTLINE_IN_SPACE
from mdstopo.case.schema.schema_scene import (
    BUSHING,
    COORDINATE,
    GROUP_KEYS,
    LOAD,
    LOAD_CASE,
    LOADS,
    MASS,
    MOTIONS,
    POINTS,
)
from mdstopo.case.schema.schema_surface import SURFACE

ZERO = (0.0, 0.0, 0.0)


def with_keys(record: Record, *new: Key) -> Record:
    """A record with some of its keys replaced by others of the same names."""
    known = {key.name: key for key in record.keys}
    return replace(record, keys=tuple((known | {key.name: key for key in new}).values()))


def with_kind(record: Record, name: str, kind: Kind) -> Key:
    """One key of a record, with another kind of value."""
    (key,) = (key for key in record.keys if key.name == name)
    return replace(key, kind=kind)


# Bodies.
_TENSOR = Vector(3, Vector(3, NUMBER))
INERTIA = ByDepth("[Jxx, Jyy, Jzz] or the symmetric tensor of three rows", Vector(3, POSITIVE), _TENSOR)
_AXIS = Key("axis", DIRECTION, "axis of the turn, of any length, through the centre of mass")
_ANGLE = Key("angle", NUMBER, "by how much, right-handed about the axis", unit="rad")
_TURN = Record(
    "a turn",
    (replace(_AXIS, required=True), replace(_ANGLE, required=True)),
    doc="A turn about an axis of global components.",
)
ORIENTATION = Record(
    "an orientation",
    (
        _AXIS,
        _ANGLE,
        Key("quaternion", Vector(4, NUMBER), "[w, x, y, z], of norm 1 to 1e-6"),
        Key("matrix", _TENSOR, "three rows; its columns are the body axes, orthonormal to 1e-6"),
    ),
    one_of=(("axis", "quaternion", "matrix"),),
    needs=(("axis", "angle"), ("angle", "axis")),
    doc="What turns body axes into global ones: a turn, a quaternion or a matrix.",
)
BODY_KEYS = Record(
    "a body",
    (
        MASS,
        Key(
            "inertia",
            INERTIA,
            "moments about the centre of mass along the body axes, or the tensor there; no principal moment is above "
            "the sum of the others",
            required=True,
            unit="kg m^2",
        ),
        Key("position", TRIPLE, "centre of mass at the start, [x, y, z]", required=True, unit="m"),
        Key(
            "orientation",
            ByShape(
                "{axis, angle}, {quaternion}, {matrix} or a list of {axis, angle}",
                sequence=ListOf(_TURN, 1, "turns"),
                mapping=ORIENTATION,
            ),
            "of the body axes at the start; turns of a list are done one after the other",
            otherwise="body axes are global ones",
        ),
        Key("velocity", TRIPLE, "of the centre of mass at the start, [vx, vy, vz]", default=ZERO, unit="m/s"),
        Key(
            "angular_velocity",
            TRIPLE,
            "at the start, global components; where the scene settles it turns with the body",
            default=ZERO,
            unit="rad/s",
        ),
        OUTLINE_IN_SPACE,
    ),
    doc="A rigid body at the start. The fixed body `ground` is there without being declared.",
    elsewhere=(("angle", "in space it is `orientation`"),),
)

# Joints and bushings.
JOINT = Tagged("a joint", "type", {word: record_of(joint) for word, joint in SPATIAL_JOINTS.items()})
_SIX = Vector(6, NOT_NEGATIVE, ((3, "in space it is six: along the first body's x, y and z, about them"),))
BUSHING_KEYS = with_keys(
    BUSHING,
    with_kind(BUSHING, "at", POINT),
    Key(
        "stiffness",
        _SIX,
        "along the first body's x, y and z, then of the rotation vector's components in its axes",
        required=True,
        unit="N/m, N m/rad",
    ),
    Key("damping", _SIX, "the same of the rates", default=(*ZERO, *ZERO), unit="N s/m, N m s/rad"),
)

# Prescribed motion.
_MOVED = "of the centre of mass"
_ANGLE_KEYS = (
    Key(
        "acceleration",
        Signals(("a",), formula=True),
        "integrated from the body's own angular velocity",
        unit="rad/s^2",
    ),
    Key(
        "velocity",
        Signals(("v",), formula=True),
        "rate; the body's own, where stated, must agree at the start",
        unit="rad/s",
    ),
    Key(
        "position",
        Signals(("x",), constant=False, order="rising", at_least=4, formula=True),
        "the angle itself, 0 at the start: a table of at least 4 rows from start to end without repeated times, which "
        "a cubic spline joins, or an expression of t",
        unit="rad",
    ),
)
_KINDS = tuple(key.name for key in _ANGLE_KEYS)
DRIVEN_ANGLE = Record(
    "a prescribed angle",
    _ANGLE_KEYS,
    one_of=(_KINDS,),
    doc="An angle over time: exactly one of its acceleration, velocity and position.",
)
DRIVEN_ROTATION = Record(
    "a prescribed rotation",
    (
        *(
            Key(name, DRIVEN_ANGLE, f"angle about the global {axis}")
            for name, axis in (("roll", "x"), ("pitch", "y"), ("yaw", "z"))
        ),
        Key("axis", DIRECTION, "global, of any length: all turning is about it, by what stands beside it"),
        *_ANGLE_KEYS,
        Key("angular_velocity", Signals(("wx", "wy", "wz")), "global components", unit="rad/s"),
    ),
    one_of=(("roll", "axis", "angular_velocity"),),
    needs=(
        ("roll", "pitch"),
        ("roll", "yaw"),
        ("pitch", "roll"),
        ("yaw", "roll"),
        *((kind, "axis") for kind in _KINDS),
    ),
    doc="All of a body's rotation: roll, pitch and yaw, done in this order about global axes and 0 at the start; or an "
    "axis with one of acceleration, velocity and position; or the angular velocity.",
)
MOTION = Record(
    "a motion",
    (
        Key("body", BODY, "whose coordinates are prescribed; a body is listed once", required=True),
        *(Key(axis, COORDINATE, _MOVED, otherwise="free") for axis in "xyz"),
        Key("rotation", DRIVEN_ROTATION, "all of the rotation", otherwise="free"),
    ),
    any_of=("x", "y", "z", "rotation"),
    doc="What a body's coordinates do is given; they carry no unknowns, and loads on them change only the reaction.",
    elsewhere=(("angle", "in space it is `rotation`"),),
)

# Points.
_CENTER = Key("center", TRIPLE, "centre", required=True, unit="m")
_RADIUS = Key("radius", POSITIVE, "radius", required=True, unit="m")
_COUNT = Key("count", COUNT, "how many points", required=True)
_NORMAL = Key("normal", DIRECTION, "normal of its plane, of any length", required=True)
_START = Key("start", DIRECTION, "where angles begin: made perpendicular to the normal", required=True)
_FROM = Key("from", TRIPLE, "one end", required=True, unit="m")
_TO = Key("to", TRIPLE, "the other end", required=True, unit="m")
_COUNTS = Key("count", Vector(3, COUNT), "how many along x, y and z", required=True)
_GRIDS: dict[str, tuple[Kind, str]] = {
    "list": (Rows(("x", "y", "z"), "free"), "the points themselves, rows [x, y, z]"),
    "line": (
        Record(
            "a line",
            (_FROM, _TO, _COUNT),
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
                _NORMAL,
                _START,
                Key("from", NUMBER, "angle of the first point, right-handed about the normal", True, unit="rad"),
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
            (_CENTER, _RADIUS, _NORMAL, _START, _COUNT),
            doc="Points evenly spaced on a whole circle, from `start`, right-handed about the normal.",
        ),
        "points on a circle",
    ),
    "rectangle": (
        Record(
            "a rectangle",
            (
                _CENTER,
                Key("axes", Vector(2, DIRECTION), "directions of its sides, perpendicular", required=True),
                Key("size", Vector(2, POSITIVE), "[a, b], along the first axis and along the second", True, unit="m"),
                _COUNT,
            ),
            doc="Points evenly spaced along the perimeter, from the corner at -a/2, -b/2, along the first axis first.",
        ),
        "points on the sides of a rectangle",
    ),
    "plane": (
        Record(
            "a part of a plane",
            (
                Key("corner", TRIPLE, "the first point", required=True, unit="m"),
                Key("edges", Vector(2, DIRECTION), "the two sides from there, with their lengths", True, unit="m"),
                Key("count", Vector(2, COUNT), "how many along the first edge and along the second", required=True),
            ),
            doc="Points that fill a parallelogram evenly, borders included; the order runs fastest along the first "
            "edge.",
        ),
        "points that fill a parallelogram",
    ),
    "lattice": (
        Record(
            "a lattice",
            (_FROM, _TO, _COUNTS),
            doc="Points that fill a box evenly, sides included; the order runs fastest along x, then along y.",
        ),
        "points that fill a box",
    ),
    "box": (
        Record(
            "a box",
            (_FROM, _TO, _COUNTS),
            doc="Those points of the lattice that lie on the surface, in its order.",
        ),
        "points on the surface of a box",
    ),
    "cylinder": (
        Record(
            "a cylinder",
            (
                Key("from", TRIPLE, "centre of the first circle", required=True, unit="m"),
                Key("to", TRIPLE, "centre of the last circle", required=True, unit="m"),
                _RADIUS,
                Key("start", DIRECTION, "where angles begin: made perpendicular to the axis", required=True),
                Key("count", Vector(2, COUNT), "how many around and along", required=True),
            ),
            doc="Circles from one end of an axis to the other, right-handed about it; the order runs fastest around.",
        ),
        "points on a cylinder",
    ),
    "file": (MeshFile(), "path of an STL or OBJ file, relative to the case file: its vertices, each once"),
}
_GRID = Record(
    "a grid",
    tuple(Key(name, kind, doc, unit="m" if name in ("list", "file") else "") for name, (kind, doc) in _GRIDS.items()),
    one_of=(tuple(_GRIDS),),
    doc="Points of one kind: exactly one of these.",
)
_WITHIN_RECTANGLE = Record(
    "a rectangle",
    (
        _CENTER,
        Key("axes", Vector(2, DIRECTION), "directions of its sides, perpendicular", required=True),
        Key("size", Vector(2, POSITIVE), "[a, b], along the first axis and the second", True, unit="m"),
    ),
    doc="All that lies in a rectangle; a point in it has two variables, u and v: how far it is from the centre along "
    "the first axis and along the second.",
)
_WITHIN_BOX = Record(
    "a box",
    (
        Key("from", TRIPLE, "the corner with the smallest coordinates", required=True, unit="m"),
        Key("to", TRIPLE, "the corner with the largest", required=True, unit="m"),
    ),
    doc="All that lies in a box along the axes; a point in it has three variables, x, y and z.",
)
POINTS_KEYS = with_keys(
    POINTS,
    with_kind(POINTS, "grid", ByShape("a grid or a list of grids", sequence=ListOf(_GRID, 1, "grids"), mapping=_GRID)),
    movable(
        along_line(_FROM, _TO),
        Key("rectangle", _WITHIN_RECTANGLE, "the points move within a rectangle"),
        Key("box", _WITHIN_BOX, "the points move within a box"),
    ),
)

# Members and loads.
_IN_PLACE = Record(
    "an end in place",
    (
        Key("body", BODY, "the body that it is on", required=True),
        Key("at", TRIPLE, "the point, [x, y, z]", required=True, unit="m"),
        FRAME,
    ),
    doc="A single point, given where it is used.",
)


def _end(name: str) -> Key:
    (key,) = (key for key in GROUP_KEYS.keys if key.name == name)
    assert isinstance(key.kind, ByShape)
    what = "the name of a point grid or {body: name, at: [x, y, z]}"
    return replace(key, kind=replace(key.kind, what=what, mapping=_IN_PLACE))


GROUP = with_keys(GROUP_KEYS, _end("from"), _end("to"))
LOAD_KEYS = with_keys(
    LOAD,
    with_kind(LOAD, "force", Signals(("fx", "fy", "fz"), formula=True)),
    Key("moment", Signals(("mx", "my", "mz"), formula=True), "couple, in the same frame", unit="N m"),
    with_kind(LOAD, "acceleration", Signals(("ax", "ay", "az"), formula=True)),
    Key(
        "angular_acceleration",
        Signals(("x", "y", "z"), formula=True),
        "stands for the couple J times this, J as the body has turned by then",
        unit="rad/s^2",
    ),
    with_kind(LOAD, "at", TRIPLE),
    Key("frame", FRAMES, "of `at`, force and moment; body: a follower load", default="global"),
)
_LOADS = replace(LOADS, kind=ListOf(LOAD_KEYS, what="loads"))
_MOTIONS = replace(MOTIONS, kind=ListOf(MOTION, what="motions"))
_CASE = with_keys(
    LOAD_CASE,
    with_kind(LOAD_CASE, "gravity", TRIPLE),
    with_kind(LOAD_CASE, "loads", _LOADS.kind),
    with_kind(LOAD_CASE, "motions", _MOTIONS.kind),
)

# Responses.
_RESPONSE = response_kinds(SPATIAL_RESPONSES, IN_PLANE_ALONE)
_OBJECTIVE = with_keys(OBJECTIVE, with_kind(OBJECTIVE, "response", _RESPONSE))
_CONSTRAINT = with_keys(CONSTRAINT, with_kind(CONSTRAINT, "response", _RESPONSE))

# Contacts.
_ON = Key("on", SURFACE, "the surface of another body that they touch", required=True)
_CONTACT = replace(
    with_keys(CONTACT, _ON),
    doc="Points of one body against a surface of another, with friction: one-sided, no design variable.",
)
SPACE_FORMAT = with_keys(
    FORMAT,
    Key("gravity", TRIPLE, "acceleration of free fall, [x, y, z]", default=ZERO, unit="m/s^2"),
    with_kind(FORMAT, "bodies", Named(BODY_KEYS, "body", 1)),
    with_kind(FORMAT, "joints", ListOf(JOINT, what="joints")),
    with_kind(FORMAT, "bushings", ListOf(BUSHING_KEYS, what="bushings")),
    _MOTIONS,
    with_kind(FORMAT, "points", Named(POINTS_KEYS, "point grid")),
    Key("contacts", ListOf(_CONTACT, what="contacts"), "points of one body against a surface of another", default=()),
    with_kind(FORMAT, "members", Named(GROUP, "member group")),
    _LOADS,
    with_kind(FORMAT, "load_cases", Named(_CASE, "load case")),
    with_kind(FORMAT, "objectives", Named(_OBJECTIVE, "objective")),
    with_kind(FORMAT, "constraints", ListOf(_CONSTRAINT, what="constraints")),
    with_kind(FORMAT, "fit", fit_record(_RESPONSE, LOAD_CASE_KEY)),
)
