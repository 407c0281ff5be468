"""Bodies in space: what is drawn of them from the points that stand on them."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import ConvexHull

from mdstopo.case.model import GROUND, Case
from mdstopo.plots.body_shapes import BORDER, line_shape, others
from mdstopo.plots.scenery import Floats, hull, own_points, start_state
from mdstopo.scene.point_positions import points_at
from mdstopo.scene.quaternions import principal

#: of the size of a cloud of points: what is thinner is flat, or a line, or a point
THIN = 1e-6
#: normals of facets whose scalar product is not below 1 by more than this are one face
FLAT = 1e-9


@dataclass(frozen=True)
class Solid:
    """A body: corners (n, 3) in body coordinates, faces and edges by numbers of corners.

    faces: corners in order, counterclockwise seen from outside; one where the body is flat, none where it is lines.
    convex: whether it is the hull of its corners.
    """

    corners: Floats
    faces: tuple[tuple[int, ...], ...] = ()
    edges: tuple[tuple[int, int], ...] = ()
    convex: bool = True


def solid(case: Case, body: str) -> Solid:
    """What is drawn of a body: its outlines; else the convex hull of its points, where nothing of others lies in it.

    Otherwise lines from its centre of mass to its points, or those that its points follow. A body whose only point is
    its centre of mass, or that has none, is the box of equal inertia. Of ground only what is flat is drawn: the hull of
    posts around a scene would hide it.
    """
    if body != GROUND and case.body(body).outline:
        return joined([Solid(each.corners, each.faces, _pairs(each.edges)) for each in case.body(body).outline])
    points = own_points(case, body)
    if body == GROUND:
        found = convex(points) if len(points) else Solid(points)
        return found if len(found.faces) < 2 else Solid(np.zeros((0, 3)))
    if not np.any(points):
        return equal_box(case.body(body).mass, case.body(body).inertia)
    found = convex(points)
    if found.faces and not _others_within(case, body, found):
        return found
    return _lines(points, [grid.local for grid in case.points.values() if grid.body == body])


def joined(parts: list[Solid]) -> Solid:
    """Several solids as one."""
    if len(parts) == 1:
        return Solid(parts[0].corners, parts[0].faces, parts[0].edges, convex=False)
    first = np.cumsum([0, *(len(part.corners) for part in parts)]).tolist()
    faces = [tuple(n + k for k in face) for n, part in zip(first, parts, strict=False) for face in part.faces]
    edges = [(n + a, n + b) for n, part in zip(first, parts, strict=False) for a, b in part.edges]
    return Solid(np.concatenate([part.corners for part in parts]), tuple(faces), tuple(edges), convex=False)


def _pairs(edges: tuple[tuple[int, ...], ...]) -> tuple[tuple[int, int], ...]:
    return tuple((edge[0], edge[1]) for edge in edges)


def _others_within(case: Case, body: str, shape: Solid) -> bool:
    """Whether a point of anything else is inside a hull at the start; on a face is outside."""
    if len(shape.faces) < 2:
        return False
    state = start_state(case)[None]
    corners = points_at(case, body, shape.corners, state)[0]
    normals, reach = [], []
    for face in shape.faces:
        own = corners[list(face)]
        way = np.cross(own - own[0], np.roll(own, -1, axis=0) - own[0]).sum(axis=0)
        normals.append(way / max(float(np.linalg.norm(way)), 1e-300))
        reach.append(float(normals[-1] @ own[0]))
    inside = np.array(reach) - BORDER * float(np.ptp(corners, axis=0).max())
    return any(bool((cloud @ np.array(normals).T < inside).all(axis=1).any()) for cloud in others(case, body))


def _lines(points: Floats, grids: list[Floats]) -> Solid:
    """Lines that grids follow; arms from the centre of mass to other points."""
    shape = line_shape(points, grids)
    if not shape.lines and not shape.arms:  # many points that show no shape: the edges of their hull
        return replace(convex(points), faces=())
    parts = [Solid(line, (), tuple((k, k + 1) for k in range(len(line) - 1))) for line in (*shape.lines, *shape.arms)]
    return joined(parts)


def convex(points: Floats) -> Solid:
    """The convex hull of points (n, 3), as a solid."""
    points = np.unique(points, axis=0)
    middle = points.mean(axis=0)
    size = float(np.abs(points - middle).max())
    if size == 0.0:
        return Solid(points[:1])
    _, spread, axes = np.linalg.svd((points - middle) / size, full_matrices=False)
    rank = int((spread > THIN * spread[0]).sum())
    if rank == 1:
        along = (points - middle) @ axes[0]
        return Solid(points[[along.argmin(), along.argmax()]], (), ((0, 1),))
    if rank == 2:
        flat = hull((points - middle) @ axes[:2].T)
        face = tuple(range(len(flat)))
        return Solid(middle + flat @ axes[:2], (face,), _sides([face]))
    return _full(points)


def _full(points: Floats) -> Solid:
    """The convex hull of points that are not flat: facets of one plane become one face."""
    found = ConvexHull(points)
    normals = found.equations[:, :3]
    face_of = np.full(len(normals), -1)
    groups: list[list[int]] = []
    for first in range(len(normals)):
        if face_of[first] >= 0:
            continue
        waiting, members = [first], []
        face_of[first] = len(groups)
        while waiting:
            k = waiting.pop()
            members.append(k)
            for other in found.neighbors[k]:
                if face_of[other] < 0 and normals[other] @ normals[first] > 1.0 - FLAT:
                    face_of[other] = len(groups)
                    waiting.append(other)
        groups.append(members)
    number = {int(old): new for new, old in enumerate(found.vertices)}
    faces = []
    for members in groups:
        corners = np.unique(found.simplices[members])
        normal = normals[members[0]]
        away = points[corners] - points[corners].mean(axis=0)
        first_axis = away[np.argmax((away**2).sum(axis=1))]
        angle = np.arctan2(away @ np.cross(normal, first_axis), away @ first_axis)
        faces.append(tuple(number[int(k)] for k in corners[np.argsort(angle)]))
    return Solid(points[found.vertices], tuple(faces), _sides(faces))


def _sides(faces: list[tuple[int, ...]]) -> tuple[tuple[int, int], ...]:
    pairs = {(min(a, b), max(a, b)) for face in faces for a, b in zip(face, (*face[1:], face[0]), strict=True)}
    return tuple(sorted(pairs))


def equal_box(mass: float, inertia: Floats) -> Solid:
    """The homogeneous box with the mass and the inertia tensor (3, 3) of a body.

    Along principal axis i half a side is sqrt(3 (J_1 + J_2 + J_3 - 2 J_i) / (2 m)), from J_1 = m (b^2 + c^2) / 12 with
    sides a, b, c.
    """
    moments, axes = principal(inertia)
    half = np.sqrt(np.maximum(1.5 * (moments.sum() - 2.0 * moments) / mass, 0.0))
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
    return convex((signs * half) @ axes.T)
