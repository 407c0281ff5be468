"""Responses in space. See `mdstopo.case.responses.response_kinds`."""

from __future__ import annotations

from dataclasses import replace

from mdstopo.case.geometry.start_rotations import unit
from mdstopo.case.keys.common_keys import DIRECTION, FRAME, TRIPLE
from mdstopo.case.keys.kinds import explained
from mdstopo.case.keys.records import Key, Record
from mdstopo.case.objects.frames import Frames
from mdstopo.case.objects.problem_parts import Response
from mdstopo.case.responses.response_kinds import (
    OF_BODY,
    RELATIVE,
    RESPONSES,
    ResponseKind,
    of_expressions,
    response_kinds,
    sees_itself,
    with_since,
)
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import inside

_COMPONENTS = explained({"x": "along x", "y": "along y", "z": "along z", "norm": "the length of the vector"})
_COMPONENT = Key("component", _COMPONENTS, "which part of the vector", default="norm")
_AT_POINT = Record(
    "the motion of a point",
    (
        OF_BODY,
        Key("at", TRIPLE, "the point, which rides on the body", unit="m", otherwise="the centre of mass"),
        FRAME,
        RELATIVE,
        _COMPONENT,
    ),
    doc="What an observer riding on `relative_to` sees: the change of the point's coordinates in that body's frame "
    "since the start, or their time derivatives.",
)
_OF_TURN = Record(
    "the rotation of a body",
    (OF_BODY, RELATIVE, _COMPONENT),
    doc="The rotation vector since the start in the axes of `relative_to`, its norm the angle from 0 to pi (at half a "
    "turn it jumps: then it has a value at the end alone); the angular velocity of the body less that of `relative_to` "
    "in these axes, or the time derivatives of its components.",
)
_OF_TILT = Record(
    "the tilt of a body",
    (
        OF_BODY,
        Key("axis", DIRECTION, "an axis that rides on the body, of any length", default=(0.0, 0.0, 1.0)),
        FRAME,
        RELATIVE,
    ),
    doc="The angle between an axis of the body now and at the start, seen from `relative_to`, from 0 to pi.",
)


def _of_turn(word: str, keys: Fields, _: Frames, reading: Reading) -> Response | None:
    if sees_itself(keys, reading):
        return None
    return Response(
        word, body=keys["body"], relative_to=keys["relative_to"], component=keys["component"], dimension=3
    )  # fmt: skip


def _of_tilt(word: str, keys: Fields, frames: Frames, reading: Reading) -> Response | None:
    if sees_itself(keys, reading) or keys["body"] not in frames.bodies:
        return None
    axis = unit(keys["axis"])
    if keys["frame"] == "global":
        axis = unit((axis @ frames.bodies[keys["body"]].rotation).tolist())
    return Response(
        word, body=keys["body"], relative_to=keys["relative_to"], numbers=tuple(axis.tolist()), dimension=3
    )  # fmt: skip


def _at_point(word: str, keys: Fields, frames: Frames, reading: Reading) -> Response | None:
    if sees_itself(keys, reading) or keys["body"] not in frames.bodies:
        return None
    at = frames.local_point(keys["body"], keys["at"], keys["frame"], inside(keys.path, "at"), reading)
    if at is BAD:
        return None
    observer, component, since = keys["relative_to"], keys["component"], keys.get("since")
    return Response(
        word, body=keys["body"], at_local=at, relative_to=observer, component=component, dimension=3, since=since
    )  # fmt: skip


def _of_others(word: str) -> ResponseKind:
    """A response that is the same in the plane but for the case that it belongs to."""
    planar = RESPONSES[word]
    made = planar.made

    def spatial(word: str, keys: Fields, frames: Frames, reading: Reading) -> Response | None:
        found = None if made is None else made(word, keys, frames, reading)
        return None if found is None else replace(found, dimension=3)

    return replace(planar, made=None if made is None else spatial)


def _point(word: str) -> ResponseKind:
    planar = RESPONSES[word]
    return replace(planar, keys=_AT_POINT if planar.order else with_since(_AT_POINT), made=_at_point)


def _turn(word: str, unit: str, order: int) -> ResponseKind:
    return ResponseKind(
        word=word, doc="of a body", unit=unit, kernels="mdstopo.general.responses.general_responses:OF_TURN",
        keys=_OF_TURN, made=_of_turn, order=order, is_position=order == 0, depends_on_rate=order > 0, jumps=order == 0,
    )  # fmt: skip


#: the responses in space by their word
SPATIAL_RESPONSES: dict[str, ResponseKind] = {
    kind.word: kind
    for kind in (
        _of_others("energy"),
        _point("displacement"),
        _point("velocity"),
        _point("acceleration"),
        _turn("rotation", "rad", 0),
        _turn("angular_velocity", "rad/s", 1),
        _turn("angular_acceleration", "rad/s^2", 2),
        ResponseKind(
            word="tilt",
            doc="of an axis of a body",
            unit="rad",
            kernels="mdstopo.general.responses.general_responses:OF_TILT",
            keys=_OF_TILT,
            made=_of_tilt,
            is_position=True,
            depends_on_rate=False,
            of_axis=True,
            never_negative=True,
        ),
        _of_others("member_force"),
        _of_others("joint_force"),
        _of_others("joint_moment"),
    )
}
#: responses in the plane that space has not, and what stands in their place
IN_PLANE_ALONE = (("angle", "in space it is `rotation`"),)
SPATIAL_RESPONSES["expression"] = of_expressions(response_kinds(dict(SPATIAL_RESPONSES), IN_PLANE_ALONE))
