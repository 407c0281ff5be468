"""Format 1 of the case file: every key, its type, limits, words, default and meaning.

The single source of the reader's checks and of the JSON Schema. What cannot be said of one value alone (names
that must be declared, sums, lengths) is checked where the case is built.
"""

from __future__ import annotations

from typing import Any

from mdstopo.case.kinds import Flag, Number, Ref, Text, Version, Word
from mdstopo.case.records import ByName, ByShape, Key, ListOf, Named, Record
from mdstopo.case.schema_scene import (
    BODY,
    BODY_KEYS,
    BUSHING,
    FRAME,
    GROUP,
    GROUP_KEYS,
    JOINT,
    LOAD_CASE,
    LOADS,
    MOTIONS,
    NOT_NEGATIVE,
    NUMBER,
    PAIR,
    POINTS,
    POSITIVE,
)
from mdstopo.optimizer.options import OPTIONS
from mdstopo.optimizer.presets import PRESETS

# Design, objectives, constraints.


def _design(name: str, number: Number, doc: str, default: float) -> Key:
    by_group = ByName("member group", number, "number")
    kind = ByShape("a number or {group: number}", scalar=number, mapping=by_group)
    return Key(name, kind, doc + "; a number or {group: number}", default=default)


DESIGN = Record(
    "design settings",
    (
        _design("initial", Number(minimum=0, maximum=1), "start of the design variables", 0.1),
        _design("lower", Number(minimum=0, maximum=1), "lower bound", 0.001),
        _design("upper", Number(minimum=0, maximum=1), "upper bound", 1.0),
        _design("power", POSITIVE, "mu of Eq. 12", 1.0),
    ),
)
_RELATIVE = Key("relative_to", BODY, "the observer's body", default="ground")
_AT_POINT = Record(
    "the motion of a point",
    (
        Key("body", BODY, required=True),
        Key("at", PAIR, "default the centre of mass"),
        FRAME,
        _RELATIVE,
        Key("component", Word(("x", "y", "norm")), default="norm"),
    ),
)
_OF_ANGLE = Record("the rotation of a body", (Key("body", BODY, required=True), _RELATIVE))
_OF_GROUP = Record("forces in members", (Key("group", GROUP, required=True),))
_OF_JOINT = Record("what a joint transmits", (Key("joint", Ref("joint", index=True), required=True),))
RESPONSES = {
    "displacement": _AT_POINT,
    "velocity": _AT_POINT,
    "acceleration": _AT_POINT,
    "angle": _OF_ANGLE,
    "angular_velocity": _OF_ANGLE,
    "angular_acceleration": _OF_ANGLE,
    "member_force": _OF_GROUP,
    "joint_force": _OF_JOINT,
    "joint_moment": _OF_JOINT,
}
_RESPONSE = ByShape(
    "energy | a mapping such as {displacement: {body: b}}",
    scalar=Word(("energy",), " | a mapping such as {displacement: {body: b}}"),
    mapping=Record(
        "a response", tuple(Key(name, kind) for name, kind in RESPONSES.items()), one_of=(tuple(RESPONSES),)
    ),
)
_OVER_TIME = Key("over_time", Word(("max", "min", "max_abs", "mean", "rms", "integral", "final")), default="max")
_LOAD_CASE = Key("load_case", Ref("load case", also=("default",)), "may be left out where there is one or none")
OBJECTIVE = Record(
    "an objective",
    (
        Key("response", _RESPONSE, "what is looked at", required=True),
        _OVER_TIME,
        _LOAD_CASE,
        Key("sense", Word(("minimize", "maximize")), default="minimize"),
    ),
)
COMBINE = Record(
    "how objectives are combined",
    (
        Key(
            "method",
            Word(("weighted_exponential", "weighted_sum", "weighted_min_max", "weighted_product")),
            default="weighted_exponential",
        ),
        Key("weights", ByName("objective", NOT_NEGATIVE, "number"), "of every objective", required=True),
        Key("exponent", Number(minimum=1), "p of Eq. 23", default=2.0),
        Key("normalize", Flag(), "Eq. 24", default=True),
    ),
)
SENSES = ("limit", "fraction", "equals", "at_least")
CONSTRAINT = Record(
    "a constraint",
    (
        Key(
            "volume",
            ByShape(
                "all, a member group or a list of member groups",
                scalar=Ref("member group", also=("all",)),
                sequence=ListOf(GROUP, 1, "member groups"),
            ),
            "sum of alpha_i V_i over these members (Eq. 14)",
        ),
        Key("response", _RESPONSE, "what is looked at"),
        Key("over_time", _OVER_TIME.kind, "of the response, default max"),
        _LOAD_CASE,
        Key("limit", NUMBER, "at most"),
        Key("fraction", NUMBER, "at most, as a fraction of sum V_i"),
        Key("equals", NUMBER, "an equality"),
        Key("at_least", NUMBER, "at least"),
    ),
    one_of=(("volume", "response"), SENSES),
    needs=(("over_time", "response"), ("load_case", "response"), ("fraction", "volume")),
)


def _option(name: str) -> Key:
    """A single setting of the optimiser; its default is the preset's."""
    option = OPTIONS[name]
    if option.type is bool:
        return Key(name, Flag(), option.doc)
    return Key(name, Number(option.minimum, None, option.maximum, None, option.type is int), option.doc)


OPTIMIZER = Record(
    "optimizer settings",
    (
        Key("name", Word(("gsao",)), default="gsao"),
        Key("preset", Word(tuple(PRESETS)), default="default"),
        Key("max_iterations", Number(minimum=0, maximum=10**9, whole=True), default=50),
        Key("tolerance", NOT_NEGATIVE, "of the projected KKT residual, relative", default=1e-6),
        Key("starts", Number(minimum=1, maximum=10**6, whole=True), "how many starting designs", default=1),
        Key("seed", Number(minimum=0, maximum=2**53, whole=True), "of the random starts", default=0),
        *(_option(name) for name in OPTIONS),
    ),
)
SOLVER = Record(
    "solver settings",
    (
        Key("integrator", Word(("auto", "gauss", "runge_kutta", "generalized_alpha")), default="auto"),
        Key("tolerance", Number(above=0, below=1), "relative error of G and its gradient", default=1e-8),
        Key("step", POSITIVE, "fixed step in s, default chosen from tolerance"),
        Key("spectral_radius", Number(minimum=0, maximum=1), "of generalized_alpha, default 0.8"),
        Key("sensitivity", Word(("auto", "adjoint", "direct", "iterative", "constant_load")), default="auto"),
        Key("assemble", Flag(), "move the start to the nearest consistent one", default=False),
    ),
)

FORMAT = Record(
    "a case",
    (
        Key("format", Version(1), "version of the format", required=True),
        Key("title", Text(), default=""),
        Key("gravity", PAIR, "in m/s^2", default=(0.0, 0.0)),
        Key(
            "time",
            Record("times", (Key("start", NUMBER, "in s", default=0.0), Key("end", NUMBER, "in s", True))),
            required=True,
        ),
        Key("bodies", Named(BODY_KEYS, "body", 1), "by name; `ground` is there without being declared", True),
        Key("joints", ListOf(JOINT, what="joints"), "ideal constraints between two bodies", default=()),
        Key("bushings", ListOf(BUSHING, what="bushings"), "elastic joints", default=()),
        MOTIONS,
        Key("points", Named(POINTS, "point grid"), "point grids by name"),
        Key("members", Named(GROUP_KEYS, "member group"), "groups of candidate members by name"),
        LOADS,
        Key("load_cases", Named(LOAD_CASE, "load case"), "each adds to the common part"),
        Key("design", DESIGN, "of the design variables"),
        Key("objectives", Named(OBJECTIVE, "objective"), "by name"),
        Key("combine", COMBINE, "needed where there is more than one objective"),
        Key("constraints", ListOf(CONSTRAINT, what="constraints"), "rows", default=()),
        Key("optimizer", OPTIMIZER),
        Key("solver", SOLVER),
    ),
)


def json_schema() -> dict[str, Any]:
    """The format as JSON Schema, draft 2020-12: completes and checks a case as it is typed."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "mdstopo case file, format 1",
        "description": "One design problem. SI units; coordinates are global, at the start.",
        **FORMAT.schema(),
    }
