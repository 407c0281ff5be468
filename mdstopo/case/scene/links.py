"""Joints and bushings: what ties two bodies besides members.

Whether joints fit at the start is checked where scenes are built.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mdstopo.case.geometry.coordinates import in_range
from mdstopo.case.joints import Joint
from mdstopo.case.joints.joint import Stated
from mdstopo.case.model import Bushing, Components
from mdstopo.case.objects.frames import Frames
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import inside, listed, shown


def declare_joints(entries: Any, reading: Reading) -> None:
    """Make the joints' names known: as stated, else the index. Two of one name are a mistake."""
    first: dict[str, int] = {}
    for index, fields in enumerate(entries if isinstance(entries, list) else ()):
        name = None if fields is BAD else fields["name"]
        if name is None or name is BAD:
            reading.declare("joint", str(index))
        elif name in first:
            message = f"the name {shown(name)} is given to joints[{first[name]}] already"
            reading.mistake(inside(fields.path, "name"), message)
        else:
            first[name] = index
            reading.declare("joint", name)


def build_joints(entries: Any, frames: Frames, reading: Reading) -> tuple[Joint, ...]:
    """The joints of the case, without those that cannot be made; mistakes are noted."""
    built = []
    for index, fields in enumerate(entries if isinstance(entries, list) else ()):
        joint = None if fields is BAD else _build_joint(index, fields, frames, reading)
        if joint is not None:
            built.append(joint)
    return tuple(built)


def build_bushings(entries: Any, frames: Frames, reading: Reading) -> tuple[Bushing, ...]:
    """The bushings of the case, without those that cannot be made; mistakes are noted."""
    built = []
    for index, fields in enumerate(entries if isinstance(entries, list) else ()):
        if fields is BAD:
            continue
        bodies = _two_bodies(fields, frames, reading)
        ends = None if bodies is None else _points(fields, bodies, frames, reading)
        if bodies is not None and ends is not None and fields.good():
            built.append(Bushing(index, bodies, ends[0][0], ends[1][0], fields["stiffness"], fields["damping"]))
    return tuple(built)


def _build_joint(index: int, fields: Fields, frames: Frames, reading: Reading) -> Joint | None:
    bodies = _two_bodies(fields, frames, reading)
    ends = None if bodies is None else _points(fields, bodies, frames, reading)
    if bodies is None or ends is None or not fields.good():
        return None
    (first, first_world), (second, second_world) = ends
    joint = frames.geometry.joints[fields["type"]]
    both = (frames.bodies[bodies[0]], frames.bodies[bodies[1]])
    own = joint.own_values(Stated(fields, first_world, second_world, both), reading)
    if own is None:
        return None
    name = fields["name"] or str(index)
    return joint(name=name, index=index, bodies=bodies, at_first=first, at_second=second, **own)


def _two_bodies(fields: Fields, frames: Frames, reading: Reading) -> tuple[str, str] | None:
    bodies = fields["bodies"]
    if bodies is BAD:
        return None
    first, second = bodies
    if first == second:
        message = f"found {shown(first)} twice, allowed are two bodies"
        reading.mistake(inside(fields.path, "bodies"), message)
        return None
    return (first, second) if first in frames.bodies and second in frames.bodies else None


def _points(
    fields: Fields, bodies: tuple[str, str], frames: Frames, reading: Reading
) -> tuple[tuple[Components, Components], tuple[Components, Components]] | None:
    """(local, world) of the point on each body."""
    at = fields["at"]
    path = inside(fields.path, "at")
    if at is BAD:
        return None
    if isinstance(at, dict):
        strangers = [name for name in at if name not in bodies]
        missing = [name for name in bodies if name not in at]
        for name in strangers:
            if reading.knows("body", name):
                message = f"{shown(name)} is none of the joint's bodies {listed(bodies)}"
                reading.mistake(inside(path, name), message)
        if missing:
            reading.mistake(path, f"the point on {listed(missing)} is missing")
        if strangers or missing or any(point is BAD for point in at.values()):
            return None
        stated = (at[bodies[0]], at[bodies[1]])
    elif at is None:  # only a fixed joint may leave it out
        center = frames.geometry.default_at(frames.bodies[bodies[0]], frames.bodies[bodies[1]])
        stated = (center, center)
    elif isinstance(at[0], tuple):
        stated = (at[0], at[1])
    else:
        stated = (at, at)
    ends = (frames.point(bodies[0], stated[0]), frames.point(bodies[1], stated[1]))
    return ends if in_range(np.array(ends), path, reading) else None
