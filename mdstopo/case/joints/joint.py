"""What is declared of a joint, and what follows from it."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

from mdstopo.case.arrays import Components, Pair
from mdstopo.case.geometry.rigid_bodies import AnyBody
from mdstopo.case.keys.common_keys import PAIR
from mdstopo.case.keys.kinds import Name, Ref, Word
from mdstopo.case.keys.records import ByName, ByShape, Key, Record, Vector
from mdstopo.case.text.reading import Fields, Reading
from mdstopo.case.value import Value, frozen

_OWN = ByName("body", PAIR, "[x, y]")
#: a point that both bodies share, or each body's own
POINT = ByShape("[x, y] or {body: [x, y], body: [x, y]}", sequence=PAIR, mapping=_OWN)
#: a point of each body
TWO_POINTS = ByShape("[[x, y], [x, y]] or {body: [x, y], body: [x, y]}", sequence=Vector(2, PAIR), mapping=_OWN)
BODIES = Key("bodies", Vector(2, Ref("body")), "the first and the second of the two bodies", required=True)
_NAME = Key("name", Name(), "what responses and results call the joint", otherwise="its index in the list, from 0")


class Stated(NamedTuple):
    """A joint as a case file states it.

    fields: its keys; first, second: its point on each body in global coordinates; bodies: the two at the start.
    """

    fields: Fields
    first: Components
    second: Components
    bodies: tuple[AnyBody, AnyBody]


@frozen(kw_only=True)
class Joint(Value):
    """What all joints have in common.

    type: the word of the YAML key ``type``; doc: a sentence for the case reference; keys: beside type, name and bodies.
    kernels: the module with the joint's `KERNELS` (`mechanics.joints.joint_kernels`). keeps_angle: whether the bodies
    do not turn against each other; keeps_point: whether its points stay together. is_link: whether they lie apart, as
    the ends of a link do. turns_about_normal: whether the joint of this type in space has an axis, which is the normal
    of a plane that is lifted there.
    index: its place in the file, from 0; name: as stated, else the index as text.
    bodies: first and second; at_first, at_second: the joint's point on each, in body coordinates.
    """

    type: ClassVar[str]
    doc: ClassVar[str]
    keys: ClassVar[tuple[Key, ...]]
    kernels: ClassVar[str]
    keeps_angle: ClassVar[bool] = False
    keeps_point: ClassVar[bool] = False
    is_link: ClassVar[bool] = False
    turns_about_normal: ClassVar[bool] = False

    name: str
    index: int
    bodies: tuple[str, str]
    at_first: Pair
    at_second: Pair

    @classmethod
    def own_values(cls, stated: Stated, reading: Reading) -> dict[str, Any] | None:
        """Values of the fields that a subclass adds; None where something is a mistake, which is noted."""
        del stated, reading
        return {}

    @property
    def slide(self) -> Pair | None:
        """The direction in which a point of the second body slides in the first, a unit vector in the first body's
        coordinates; None where it does not."""
        return None

    def row(self) -> dict[int, float]:
        """Numbers of its own for the kernels, by their place in the joint's parameters: places 4 to 7."""
        return {}


def record_of(joint: type[Joint]) -> Record:
    """The keys of a joint in the case file, from its class."""
    tag = Key("type", Word((joint.type,)), "which joint it is", required=True)
    return Record(f"a {joint.type} joint", (tag, _NAME, BODIES, *joint.keys), doc=joint.doc)
