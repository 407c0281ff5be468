"""Places between which everything is that a picture shows, and what lies so far off that it is left out of the view."""

from collections.abc import Callable, Mapping

import numpy as np

from mdstopo.case.model import GROUND, Case, MemberGroup
from mdstopo.plots.acting import Mask
from mdstopo.plots.body_shapes import planar_shapes
from mdstopo.plots.scenery import Floats, edge_at, ends_at, own_points, points_of
from mdstopo.plots.slack import belt_lengths, member_lines, spare_length
from mdstopo.plots.solids import Solid
from mdstopo.plots.surface_lines import surfaces_of
from mdstopo.scene.point_positions import points_at

#: how many times larger than what is looked at a scene may be before its far ends are left out of the view
FAR_SIZES = 2.0

#: which members (M,) of a group act at a state, by its number
Acts = Callable[[MemberGroup, int], Mask]


def planar_cloud(case: Case, states: Floats, acts: Acts | None = None) -> Floats:
    """(n, 2) places at states (T, 3 n_bodies). acts: which members act there, all where None; others do not hang.

    Contacts keep their direction by an end far off, and so do springs that stand for water or soil: edges, then
    whatever is neither a candidate nor a moving body, are left out where they would make the rest small.
    """
    moving, all_points = [], [_centres(case, states)]
    for name in [*(body.name for body in case.bodies), GROUND]:
        shapes = planar_shapes(case, name)
        lines = [line for shape in shapes for line in (*shape.areas, *shape.lines)]
        others = [line for shape in shapes for line in (*shape.arms, *([] if shape.border is None else [shape.border]))]
        if name != GROUND and lines:
            moving.append(points_at(case, name, np.concatenate(lines), states).reshape(-1, 2))
        corners = np.concatenate([own_points(case, name), *lines, *others])
        all_points.append(points_at(case, name, corners, states).reshape(-1, 2))
    everything = np.concatenate([*all_points, *_hanging(case, states, acts)])
    edges = [edge_at(case, contact, q) for contact in case.contacts for q in states]
    inner = everything
    if case.design_groups:
        inner = np.concatenate([_centres(case, states), *moving, *_designed(case, states, acts)])
    return without_far(inner, np.concatenate([everything, *edges]), everything)


def scene_cloud(case: Case, states: Floats, solids: Mapping[str, Solid], acts: Acts | None = None) -> Floats:
    """(n, 3) places at states (T, 7 n_bodies), without what is neither a candidate nor a moving body where it would
    make the rest small. solids: of each body and ground; acts: as of `planar_cloud`."""
    own = {name: np.concatenate([points_of(case, name), shape.corners]) for name, shape in solids.items()}
    for each in surfaces_of(case):
        if not each.endless:
            own[each.body] = np.concatenate([own[each.body], *each.lines])
    every = [points_at(case, name, own[name], states).reshape(-1, 3) for name in own]
    everything = np.concatenate([*every, *_hanging(case, states, acts)])
    if not case.design_groups:
        return everything
    moving = [points_at(case, name, each.corners, states) for name, each in solids.items() if name != GROUND]
    inner = [_centres(case, states), *(each.reshape(-1, 3) for each in moving), *_designed(case, states, acts)]
    found = np.concatenate(inner)
    return without_far(found, everything)


def without_far(inner: Floats, *wholes: Floats) -> Floats:
    """What a picture shows: the first of `wholes` (n, d) that is at most FAR_SIZES times as large as what is looked at.

    inner (m, d): what is looked at, which is shown alone where none is; where it is a single place, the first of
    `wholes` is shown.
    """
    size = _size(inner)
    return next((whole for whole in wholes if size == 0.0 or _size(whole) <= FAR_SIZES * size), inner)


def _size(cloud: Floats) -> float:
    return float(np.ptp(cloud, axis=0).max())


def _centres(case: Case, states: Floats) -> Floats:
    """Centres of mass of all bodies."""
    size, d = (3, 2) if case.dimension == 2 else (7, 3)
    return np.asarray(states.reshape(len(states), -1, size)[..., :d].reshape(-1, d))


def _designed(case: Case, states: Floats, acts: Acts | None) -> list[Floats]:
    """Ends of candidates, and where they hang through."""
    ends = [ends_at(case, group, q).reshape(-1, case.dimension) for q in states for group in case.design_groups]
    return ends + _hanging(case, states, acts, only_design=True)


def _hanging(case: Case, states: Floats, acts: Acts | None, only_design: bool = False) -> list[Floats]:
    """Corners of members that hang through; those that are taut are between their ends."""
    groups = case.design_groups if only_design else case.members
    found = []
    for group in groups:
        if belt_lengths(case, group) is None:
            continue
        for k, q in enumerate(states):
            slack = np.flatnonzero(spare_length(case, group, q) * (True if acts is None else acts(group, k)))
            lines, _ = member_lines(case, group, q, lambda places: places, slack)
            found.append(lines.reshape(-1, case.dimension))
    return found
