"""Bodies and members: the points that stand on bodies, places of ends at any time."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import GROUND, Case, Contact, MemberGroup
from mdstopo.scene.point_positions import points_at
from mdstopo.scene.quaternions import quaternions_of

Floats = NDArray[np.float64]

#: design values above which a member counts as present, as a share of the group's range
PRESENT = 0.5


def sizes(group: MemberGroup, alpha: Floats) -> Floats:
    """(M,) how much there is of each member of a group of design members, from 0 to 1, as a share of the group's range.

    alpha (M,). Members that have no range (lower = upper, as in the cases that `finalize` writes) are as much there as
    alpha says.
    """
    width = group.upper - group.lower
    share: Floats = (alpha - group.lower) / width if width > 0.0 else alpha
    return np.clip(share, 0.0, 1.0)


def points_of(case: Case, body: str) -> Floats:
    """(K, d) a body's points and its centre of mass, in body coordinates; of ground its points only."""
    middle = np.zeros((1 if body != GROUND else 0, case.dimension))
    return np.concatenate([middle, own_points(case, body)])


def own_points(case: Case, body: str) -> Floats:
    """(K, d) a body's points, in body coordinates: of grids, of members, joints, bushings, loads and contacts."""
    pieces = [np.zeros((0, case.dimension))]
    pieces += [grid.local for grid in case.points.values() if grid.body == body]
    for group in case.members:
        pieces += [group.from_local] if group.body_from == body else []
        pieces += [group.to_local] if group.body_to == body else []
    ties: list[Any] = [*case.joints, *case.bushings]
    for tie in ties:
        ends = zip(tie.bodies, (tie.at_first, tie.at_second), strict=True)
        pieces += [np.array([at]) for name, at in ends if name == body]
    pieces += [contact.points for contact in case.contacts if contact.body == body]
    return np.concatenate(pieces)


def hull(points: Floats) -> Floats:
    """Corners (K, 2) of the convex hull of points (n, 2), counterclockwise (Andrew's monotone chain)."""
    order = sorted(set(map(tuple, points.tolist())))
    if len(order) < 3:
        return np.array(order).reshape(-1, 2)

    def half(sequence: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
        chain: list[tuple[float, ...]] = []
        for x, y in sequence:
            while len(chain) > 1:
                (ax, ay), (bx, by) = chain[-2], chain[-1]
                if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0:
                    break
                chain.pop()
            chain.append((x, y))
        return chain[:-1]

    return np.array(half(order) + half(order[::-1]))


def ends_at(case: Case, group: MemberGroup, q: Floats) -> Floats:
    """(M, 2, d) both ends of a group's members at a state q (3 n_bodies or 7 n_bodies,)."""
    state = q[None]
    p = points_at(case, group.body_from, group.from_local, state)[0][group.from_index]
    return np.stack([p, points_at(case, group.body_to, group.to_local, state)[0][group.to_index]], axis=1)


def edge_at(case: Case, contact: Contact, q: Floats) -> Floats:
    """(2, 2) both ends of a contact's edge at a state q (3 n_bodies,)."""
    ends: Floats = points_at(case, contact.edge_body, np.array([contact.edge_from, contact.edge_to]), q[None])[0]
    return ends


def start_state(case: Case) -> Floats:
    """q (3 n_bodies,), in space (7 n_bodies,), as the case draws it."""
    if case.dimension > 2:
        return np.concatenate([(*body.position, *quaternions_of(body.rotation)) for body in case.bodies])
    return np.array([value for body in case.bodies for value in (*body.position, body.angle)])
