"""Responses, which are numbers of a state over time: what is declared of each response, one record a response.

How a response is computed stands in `mdstopo.general`, in what its record names.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from mdstopo.case.keys.brought_records import Brought
from mdstopo.case.keys.common_keys import BODY, FRAME, GROUP, IN_SPACE, PAIR
from mdstopo.case.keys.kinds import Ref, Word, explained
from mdstopo.case.keys.records import ByShape, Key, Record
from mdstopo.case.methods.over_time import DEFAULT_REDUCTION, REDUCTIONS
from mdstopo.case.objects.frames import Frames
from mdstopo.case.objects.problem_parts import Response
from mdstopo.case.responses.expression_response import expression_keys, make_expression
from mdstopo.case.text.nodes import SCALAR, SEQUENCE, Node
from mdstopo.case.text.reading import BAD, Fields, Reading, found
from mdstopo.case.text.words import inside, listed, shown
from mdstopo.case.value import Value, frozen

Made = Callable[[str, Fields, Frames, Reading], Response | None]


@frozen(kw_only=True)
class ResponseKind(Value):
    """What is declared of a response: its name, keys and unit, and where its code is.

    word: as case files have it; doc: what of what, for the case reference; unit: of its values.
    keys: those that stand beside it, None where the word stands alone; made: the response from its keys, None where
    something is a mistake, which is noted.
    kernels: where its `ResponseKernels` are (`general.responses.response_kernels`), module:name; empty of an
    expression.
    order: how many derivatives by time it has of a position; is_position: whether it is a place or an angle of a body.
    of_point: whether it is the motion of a point, seen from a body, as a component or a norm.
    depends_on_rate: whether it needs velocities or accelerations; is_energy: whether it is the stored energy.
    of_members: whether it is the largest one of the members of a group. jumps: whether it jumps at half a turn.
    in_space: the word for the same in space, where a planar case is lifted there; empty where nobody has said which.
    is_component: whether that is a vector in space, of which the planar one is the component along the normal.
    of_axis: whether its numbers are a direction in body coordinates.
    never_negative: whether it is a length, an angle or a force without a sign, whatever its keys say.
    """

    word: str
    doc: str
    unit: str
    kernels: str
    keys: Record | None = None
    made: Made | None = None
    order: int = 0
    is_position: bool = False
    of_point: bool = False
    depends_on_rate: bool = True
    is_energy: bool = False
    of_members: bool = False
    jumps: bool = False
    in_space: str = ""
    is_component: bool = False
    of_axis: bool = False
    never_negative: bool = False


RELATIVE = Key("relative_to", BODY, "the body that the observer rides on", default="ground")
OF_BODY = Key("body", BODY, "whose motion it is", required=True)
_COMPONENTS = explained({"x": "along x", "y": "along y", "norm": "the length of the vector"})
SINCE = Key(
    "since",
    explained(
        {
            "stated": "where the case has it at the start",
            "settled": "where it is at rest, with each design anew; needs `solver: {settle: true}`",
        }
    ),
    "the place that a displacement counts from",
    default="stated",
)
_AT_POINT = Record(
    "the motion of a point",
    (
        OF_BODY,
        Key("at", PAIR, "the point, which rides on the body", unit="m", otherwise="the centre of mass"),
        FRAME,
        RELATIVE,
        Key("component", _COMPONENTS, "which part of the vector", default="norm"),
    ),
    doc="What an observer riding on `relative_to` sees: the change of the point's coordinates in that body's frame "
    "since the start, or their time derivatives.",
)
_OF_ANGLE = Record(
    "the rotation of a body",
    (OF_BODY, RELATIVE),
    doc="psi of the body less psi of `relative_to`, not wrapped, or its time derivatives.",
)
_OF_GROUP = Record(
    "forces in members",
    (Key("group", GROUP, "whose members are looked at", required=True),),
    doc="The largest |f*| in the group at each time.",
)
_OF_JOINT = Record(
    "what a joint transmits",
    (Key("joint", Ref("joint", index=True), "name of the joint, or its index", required=True),),
    doc="The norm of what the joint transmits. Not for joints that repeat others.",
)


def with_since(record: Record) -> Record:
    """The keys of a point's motion, and the key that says from which place a displacement counts."""
    return replace(record, keys=(*record.keys, SINCE))


def sees_itself(keys: Fields, reading: Reading) -> bool:
    """Whether the body is its own observer, which is a mistake."""
    if keys["body"] != keys["relative_to"]:
        return False
    message = f"found {shown(keys['relative_to'])}, the body itself; seen from there it never moves"
    reading.mistake(inside(keys.path, "relative_to"), message)
    return True


def _of_angle(word: str, keys: Fields, _: Frames, reading: Reading) -> Response | None:
    return None if sees_itself(keys, reading) else Response(word, body=keys["body"], relative_to=keys["relative_to"])


def _at_point(word: str, keys: Fields, frames: Frames, reading: Reading) -> Response | None:
    if sees_itself(keys, reading) or keys["body"] not in frames.bodies:
        return None
    at = frames.local_point(keys["body"], keys["at"], keys["frame"], inside(keys.path, "at"), reading)
    if at is BAD:
        return None
    return Response(
        word, body=keys["body"], at_local=at, relative_to=keys["relative_to"], component=keys["component"],
        since=keys.get("since"),
    )  # fmt: skip


def _of_group(word: str, keys: Fields, _: Frames, __: Reading) -> Response:
    return Response(word, group=keys["group"])


def _of_joint(word: str, keys: Fields, _: Frames, __: Reading) -> Response:
    return Response(word, joint=keys["joint"])


def _point(word: str, unit: str, order: int) -> ResponseKind:
    keys = _AT_POINT if order else with_since(_AT_POINT)
    return ResponseKind(
        word=word, doc="of a point", unit=unit, kernels="mdstopo.general.responses.general_responses:OF_POINT",
        keys=keys, made=_at_point,
        order=order, is_position=order == 0, of_point=True, depends_on_rate=order > 0, in_space=word,
    )  # fmt: skip


def _angle(word: str, unit: str, order: int) -> ResponseKind:
    return ResponseKind(
        word=word, doc="of a body", unit=unit, kernels="mdstopo.general.responses.general_responses:OF_ANGLE",
        keys=_OF_ANGLE, made=_of_angle, order=order, is_position=order == 0, depends_on_rate=order > 0,
        in_space="rotation" if order == 0 else word, is_component=True,
    )  # fmt: skip


def key_of(kind: ResponseKind) -> Key:
    """The key of the case file for a response that has keys of its own."""
    assert kind.keys is not None
    return Key(kind.word, kind.keys, f"{kind.doc}, in {kind.unit}" if kind.unit else kind.doc)


def enter_response(kind: Any) -> Key:
    """Add the response of another distribution to the known ones; TypeError where it is no response, or its word is
    taken."""
    if not isinstance(kind, ResponseKind) or kind.keys is None or kind.made is None:
        raise TypeError(f"found {kind!r}, needed is a ResponseKind with `keys` and `made`")
    if RESPONSES.setdefault(kind.word, kind) is not kind:
        raise TypeError(f"there is a response {kind.word!r} already")
    return key_of(kind)


#: responses of other distributions
OF_OTHERS = Brought("mdstopo.responses", enter_response)


#: words for material, which is bounded, and what is said of them as a response or an objective
MATERIAL = ("volume", "mass", "material")
NO_RESPONSE = (
    "material is no `response` of the motion but a sum over the design, which a constraint bounds, such as "
    "{volume: all, limit: 10}; how the least of it is found that keeps a limit, docs/least-material.md tells"
)


@frozen
class _WordAlone(Word):
    """The kind of a response that is a word alone; material is told where it belongs."""

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The word at a node of the file, or BAD with a mistake noted."""
        if node.scalar() not in MATERIAL:
            return Word(self.words, self.instead, self.meanings).read(node, path, reading)
        reading.mistake(path, f"found {found(node)}: {NO_RESPONSE}", node)
        return BAD


def response_kinds(
    kinds: Mapping[str, ResponseKind], elsewhere: tuple[tuple[str, str], ...], more: Brought[Key] | None = None
) -> ByShape:
    """The kind of a value that states a response: a word, or a mapping from a word to the response's keys.

    elsewhere: words of responses that are not of this dimension, and what stands in their place. more: those of other
    distributions.
    """
    worded = tuple(kind.word for kind in kinds.values() if kind.keys is not None)
    alone = {kind.word: kind.doc for kind in kinds.values() if kind.keys is None}
    mapping = f" | a mapping {{word: ...}} with one of the words {listed(worded)}"
    return ByShape(
        f"{' | '.join(alone)}{mapping}",
        scalar=_WordAlone(tuple(alone), mapping, tuple(alone.values())),
        mapping=Record(
            "a response", tuple(key_of(kinds[word]) for word in worded), one_of=(worded,), doc="Exactly one of these.",
            more=more, alone=tuple(alone),
            elsewhere=(
                *elsewhere, *((word, NO_RESPONSE) for word in MATERIAL),
                *((word, f"it stands alone: `response: {word}`") for word in alone),
            ),
        ),
    )  # fmt: skip


def _of_others(word: str, keys: Fields, frames: Frames, reading: Reading) -> Response | None:
    return make_expression(word, keys, response_of, frames, reading)


def of_expressions(response: ByShape) -> ResponseKind:
    """The record of the response that is an expression of others."""
    return ResponseKind(
        word="expression", doc="an expression of other responses", unit="", kernels="", keys=expression_keys(response),
        made=_of_others,
    )  # fmt: skip


#: responses in space that the plane has not, and what stands in their place
IN_SPACE_ALONE = (("rotation", f"in the plane it is `angle`; {IN_SPACE}"), ("tilt", IN_SPACE))
#: the responses by their word; their codes in kernels follow this order
RESPONSES: dict[str, ResponseKind] = {
    kind.word: kind
    for kind in (
        ResponseKind(
            word="energy",
            doc="stored energy, in J: the sum of alpha^mu V over the design members whose laws act",
            unit="J",
            kernels="mdstopo.general.responses.general_responses:OF_ENERGY",
            depends_on_rate=False,
            is_energy=True,
            in_space="energy",
        ),
        _point("displacement", "m", 0),
        _point("velocity", "m/s", 1),
        _point("acceleration", "m/s^2", 2),
        _angle("angle", "rad", 0),
        _angle("angular_velocity", "rad/s", 1),
        _angle("angular_acceleration", "rad/s^2", 2),
        ResponseKind(
            word="member_force",
            doc="the largest force in a group's members",
            unit="N",
            kernels="mdstopo.general.responses.general_responses:OF_MEMBERS",
            keys=_OF_GROUP,
            made=_of_group,
            of_members=True,
            never_negative=True,
            in_space="member_force",
        ),
        ResponseKind(
            word="joint_force",
            doc="the force that a joint transmits",
            unit="N",
            kernels="mdstopo.general.responses.general_responses:OF_JOINT_FORCE",
            keys=_OF_JOINT,
            made=_of_joint,
            never_negative=True,
            in_space="joint_force",
        ),
        ResponseKind(
            word="joint_moment",
            doc="the couple that a joint transmits",
            unit="N m",
            kernels="mdstopo.general.responses.general_responses:OF_JOINT_MOMENT",
            keys=_OF_JOINT,
            made=_of_joint,
            never_negative=True,
            in_space="joint_moment",
        ),
    )
}


RESPONSES["expression"] = of_expressions(response_kinds(dict(RESPONSES), IN_SPACE_ALONE, OF_OTHERS))


def responses_in(dimension: int) -> Mapping[str, ResponseKind]:
    """The responses of a plane (2) or of space (3) by their words."""
    if dimension == 3:
        from mdstopo.case.responses.spatial_responses import SPATIAL_RESPONSES  # most cases are planar

        return SPATIAL_RESPONSES
    return RESPONSES


def kind_of(response: Response) -> ResponseKind:
    """The record of a response; KeyError where there is none."""
    known = responses_in(response.dimension)
    if response.dimension == 2 and response.kind not in known:  # a process that has not read the case
        OF_OTHERS.find(response.kind)
    return known[response.kind]


def response_of(stated: Any, frames: Frames, reading: Reading) -> Response | None:
    """The response that is stated, as a word or as a mapping from it to its keys; None where that is a mistake."""
    if isinstance(stated, str):
        return Response(stated, dimension=frames.geometry.number)
    if not isinstance(stated, Fields) or len(stated.stated) != 1:
        return None
    (word,) = stated.stated
    keys = stated[word]
    if keys is BAD or not keys.good():
        return None
    made = responses_in(frames.geometry.number)[word].made
    return made(word, keys, frames, reading) if made is not None else Response(word, dimension=frames.geometry.number)


def unit_stated(node: Node) -> str:
    """The unit of the bounds of a constraint as the case file has it; empty where it bounds no known response."""
    entry = node.entries.get("response")
    if entry is None or entry[1].kind == SEQUENCE:
        return ""
    words = [entry[1].text] if entry[1].kind == SCALAR else list(entry[1].entries)[:1]
    kind = RESPONSES.get(words[0]) if words else None
    over_time = node.entries.get("over_time")
    stated = over_time[1].text if over_time is not None and over_time[1].kind == SCALAR else DEFAULT_REDUCTION
    reduction = REDUCTIONS.get(stated)
    unit = "" if kind is None else kind.unit
    return reduction.unit_from(unit) if unit and reduction is not None else unit
