"""A scene that stands far from the origin, moved close to it before it is compiled.

No response depends on where a scene stands, but digits do. Elongations come from displacements, which
know no origin; but directions, contacts and what joints leave come from coordinates, of which 1e6 m leave 1e-10 m, and
a member that is tied to `ground` has an arm of 1e6 m, whose square stands in the moments' derivatives. So a scene is
compiled in coordinates from a point of its own, and places are told in the file's (`Trajectory`).

The point is a multiple of a power of two above the scene's size: differences from it are exact, scenes about the origin
stay where they are to the last bit, and a scene that is moved by such a multiple is computed with the same numbers.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from mdstopo.case.arrays import TimeFormula
from mdstopo.case.model import (
    GROUND,
    AnyContact,
    Body,
    Bushing,
    Case,
    Contact,
    Joint,
    LoadCase,
    MemberGroup,
    Motion,
    Objective,
    Prescribed,
    Response,
    ResponseRow,
    SurfaceContact,
    Table,
)
from mdstopo.scene.bodies import distances, placed
from mdstopo.scene.springs_model import FloatArray

#: the grid of origins is at least so many times as wide as half the scene
GRID_WIDER = 4.0

#: a point, x and y in a plane, x, y and z in space
Point = tuple[float, ...]

_Row = TypeVar("_Row", Objective, ResponseRow)
_Tie = TypeVar("_Tie", Joint, Bushing)


def origin_of(case: Case) -> Point:
    """The point that the scene is computed from, in the file's coordinates; zeros for scenes about the origin."""
    low, high = _corners(case)
    half = 0.5 * float((high - low).max())
    if half == 0.0:
        return (0.0,) * len(low)  # one body that nothing is tied to
    grid = 2.0 ** math.ceil(math.log2(GRID_WIDER * half))
    return tuple(grid * round(middle / grid) for middle in (0.5 * low + 0.5 * high).tolist())


def extent_of(case: Case) -> float:
    """The largest side of the box around bodies and what ties them, m."""
    low, high = _corners(case)
    return float((high - low).max())


def _corners(case: Case) -> tuple[FloatArray, FloatArray]:
    cloud = np.concatenate(list(_places(case)))
    return cloud.min(axis=0), cloud.max(axis=0)


def ends_of(group: MemberGroup, as_stated: bool = False) -> tuple[str, str, FloatArray, FloatArray]:
    """First and second body of a group, and its members' ends (M, d) on each, in body coordinates; ground comes first.

    Poses are told in the first body's frame: from a body that turns, a far point of ground moves fast, and the square
    of its distance stands in what has to cancel. as_stated: keep the ends as they are (members in rows of a grid).
    """
    if group.body_to == GROUND and not as_stated:
        return group.body_to, group.body_from, group.q_local, group.p_local
    return group.body_from, group.body_to, group.p_local, group.q_local


def _places(case: Case) -> Iterator[FloatArray]:
    """Where bodies and what ties them are at the start, (any, d) each."""
    yield np.array([body.position for body in case.bodies])
    for group in case.members:
        yield group.from_world
        yield group.to_world
    ties: tuple[Joint | Bushing, ...] = (*case.joints, *case.bushings)
    for tie in ties:
        for name, at in zip(tie.bodies, (tie.at_first, tie.at_second), strict=True):
            if name == GROUND:
                yield np.array([at])
    for contact in case.contacts:
        if contact.edge_body == GROUND:
            yield _ends(contact)
        if contact.body == GROUND:
            yield contact.points


def _ends(contact: AnyContact) -> FloatArray:
    """Points (any, d) that tell where an edge or a surface is, and how far it goes."""
    if isinstance(contact, Contact):
        return np.array([contact.edge_from, contact.edge_to])
    surface, place = contact.surface, np.array(contact.surface.place)
    axes = surface.axes * np.array([*surface.sizes, 0.0])[:, None]  # of a rectangle
    if surface.shape in ("plane", "rectangle"):
        return np.array([place + one * axes[0] + two * axes[1] for one in (-1, 1) for two in (-1, 1)])
    radius, length = surface.sizes  # a sphere has no length
    ends = np.array([place, place + length * surface.axes[2]])
    return np.concatenate([ends - radius, ends + radius])


def seen_from(case: Case, origin: Point) -> Case:
    """The same scene in coordinates from `origin`; the case itself where that is zero.

    What only words are made of (`from_world`, `points`) stays as in the file.
    """
    if not any(origin):
        return case
    bodies = _bodies(case.bodies, origin)
    return replace(
        case,
        bodies=bodies,
        members=tuple(_group(group, bodies, origin) for group in case.members),
        contacts=tuple(_contact(contact, origin) for contact in case.contacts),
        load_cases=tuple(_load_case(load_case, origin) for load_case in case.load_cases),
        objectives=tuple(_aim_from(objective, origin) for objective in case.objectives),
        constraints=tuple(_aim_from(row, origin) if isinstance(row, ResponseRow) else row for row in case.constraints),
        joints=tuple(_tie(joint, origin) for joint in case.joints),
        bushings=tuple(_tie(bushing, origin) for bushing in case.bushings),
        movable=tuple(
            replace(each, base=each.base - np.array(origin)) if each.body == GROUND else each for each in case.movable
        ),
    )


def _from(at: Point, origin: Point) -> Any:
    return tuple(along - zero for along, zero in zip(at, origin, strict=True))


def _bodies(bodies: tuple[Body, ...], origin: Point) -> tuple[Body, ...]:
    return tuple(replace(body, position=_from(body.position, origin)) for body in bodies)


def _tie(tie: _Tie, origin: Point) -> _Tie:
    """A joint or bushing; its end on ground, where it has one, from `origin`."""
    first, second = tie.bodies
    if first == GROUND:
        tie = replace(tie, at_first=_from(tie.at_first, origin))
    if second == GROUND:
        tie = replace(tie, at_second=_from(tie.at_second, origin))
    return tie


def _group(group: MemberGroup, bodies: Sequence[Body], origin: Point) -> MemberGroup:
    """A group with ends on ground from `origin`, and with lengths that its own coordinates have."""
    ends = {
        f"{side}_local": getattr(group, f"{side}_local") - np.array(origin)
        for side, name in (("from", group.body_from), ("to", group.body_to))
        if name == GROUND
    }
    moved = replace(group, **ends)
    first, second = starting_places(bodies, moved)
    return replace(moved, length=distances(second[group.to_index] - first[group.from_index]))


def starting_places(bodies: Sequence[Body], group: MemberGroup) -> tuple[FloatArray, FloatArray]:
    """Where the points P and Q of a group are at the start, (n, d) each, in the coordinates of the bodies."""
    stands = {body.name: body for body in bodies}
    ends = ((group.body_from, group.from_local), (group.body_to, group.to_local))
    first, second = (local if name == GROUND else placed(stands[name], local) for name, local in ends)
    return first, second


def _contact(contact: AnyContact, origin: Point) -> AnyContact:
    if contact.edge_body == GROUND and isinstance(contact, SurfaceContact):
        surface = replace(contact.surface, place=_from(contact.surface.place, origin))
        contact = replace(contact, surface=surface)
    elif contact.edge_body == GROUND:
        edge_from, edge_to = _from(contact.edge_from, origin), _from(contact.edge_to, origin)
        contact = replace(contact, edge_from=edge_from, edge_to=edge_to)
    if contact.body == GROUND:
        contact = replace(contact, points=contact.points - np.array(origin))
    return contact


def _aim_from(row: _Row, origin: Point) -> _Row:
    """An objective or constraint; the place of its point, if that is on ground, counts from `origin`."""
    return replace(row, response=_seen(row.response, origin))


def _seen(seen: Response, origin: Point) -> Response:
    if seen.of:
        return replace(seen, of=tuple((name, _seen(each, origin)) for name, each in seen.of))
    if seen.body != GROUND or seen.at_local is None:
        return seen
    return replace(seen, at_local=_from(seen.at_local, origin))


def _load_case(load_case: LoadCase, origin: Point) -> LoadCase:
    motions = tuple(_motion(motion, origin) for motion in load_case.motions)
    return replace(load_case, bodies=_bodies(load_case.bodies, origin), motions=motions)


def _motion(motion: Motion, origin: Point) -> Motion:
    """A motion whose positions, where it prescribes such, are from `origin`."""
    axes = zip(("x", "y", "z"), origin, strict=False)
    moved: dict[str, Any] = {axis: _along(getattr(motion, axis), along) for axis, along in axes}
    return replace(motion, **moved)


def _along(part: Prescribed | None, along: float) -> Prescribed | None:
    if part is None or part.kind != "position":
        return part
    if isinstance(part.signal, TimeFormula):
        return Prescribed("position", part.signal.shifted(-along))
    assert isinstance(part.signal, Table)
    return Prescribed("position", Table(part.signal.times, part.signal.values - along))
