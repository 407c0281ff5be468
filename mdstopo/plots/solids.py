"""Bodies in space: what is drawn of them from the points that stand on them."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from mdstopo.case.model import GROUND, Case
from mdstopo.plots.scenery import Floats, hull, points_of
from mdstopo.scene.quaternions import principal

#: of the size of a cloud of points: what is thinner is flat, or a line, or a point
THIN = 1e-6
#: normals of facets whose scalar product is not below 1 by more than this are one face
FLAT = 1e-9


@dataclass(frozen=True)
class Solid:
    """A convex body: corners (n, 3) in body coordinates, faces and edges by numbers of corners.

    faces: corners in order, counterclockwise seen from outside; one where the body is flat, none where it is a line.
    """

    corners: Floats
    faces: tuple[tuple[int, ...], ...] = ()
    edges: tuple[tuple[int, int], ...] = ()


def solid(case: Case, body: str) -> Solid:
    """The convex hull of a body's points and its centre of mass; where these are one point, the box of equal inertia.

    Of ground only what is flat is drawn: the hull of posts around a scene would hide it.
    """
    points = points_of(case, body)
    if body != GROUND:
        found = convex(points)
        if len(found.corners) == 1:
            return equal_box(case.body(body).mass, case.body(body).inertia)
        return found
    found = convex(points) if len(points) else Solid(points)
    return found if len(found.faces) < 2 else Solid(np.zeros((0, 3)))


def convex(points: Floats) -> Solid:
    """The convex hull of points (n, 3)."""
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
