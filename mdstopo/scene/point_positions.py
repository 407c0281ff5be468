"""Where points of bodies are at given states, with NumPy: for pictures, tables and histories."""

import numpy as np

from mdstopo.case.model import GROUND, Case, MemberGroup
from mdstopo.scene.bodies import is_spatial
from mdstopo.scene.quaternions import rotations_of
from mdstopo.scene.springs_model import FloatArray

#: numbers of a body in q
PLANAR, SPATIAL = 3, 7


def member_lengths(case: Case, group: MemberGroup, q: FloatArray) -> FloatArray:
    """Lengths (T, M) of a group's members at states q (T, 3 n_bodies or 7 n_bodies)."""
    p = points_at(case, group.body_from, group.from_local, q)[:, group.from_index]
    return np.asarray(np.linalg.norm(points_at(case, group.body_to, group.to_local, q)[:, group.to_index] - p, axis=2))


def points_at(case: Case, body: str, local: FloatArray, q: FloatArray) -> FloatArray:
    """Global places (T, K, d) of points (K, d) of a body at states q (T, 3 n_bodies or 7 n_bodies)."""
    if body == GROUND:
        return np.broadcast_to(local, (len(q), *local.shape))
    number = [each.name for each in case.bodies].index(body)
    if is_spatial(case):
        place, turned = seats_at(q, number)
        return np.asarray(place[:, None] + np.einsum("tij,kj->tki", turned, local))
    i = PLANAR * number
    cos, sin = np.cos(q[:, i + 2, None]), np.sin(q[:, i + 2, None])
    x = q[:, i, None] + cos * local[:, 0] - sin * local[:, 1]
    y = q[:, i + 1, None] + sin * local[:, 0] + cos * local[:, 1]
    return np.stack([x, y], axis=2)


def seats_at(q: FloatArray, number: int) -> tuple[FloatArray, FloatArray]:
    """Position (T, 3) and rotation matrix (T, 3, 3) of a body in space at states q (T, 7 n_bodies)."""
    i = SPATIAL * number
    return q[:, i : i + 3], rotations_of(q[:, i + 3 : i + SPATIAL])


def point_rates(case: Case, body: str, local: FloatArray, q: FloatArray, v: FloatArray) -> FloatArray:
    """Global velocities (T, K, d) in m/s of points (K, d) of a body at states q and rates v of a trajectory."""
    if body == GROUND:
        return np.zeros((len(q), *local.shape))
    number = [each.name for each in case.bodies].index(body)
    if is_spatial(case):
        arm = points_at(case, body, local, q) - seats_at(q, number)[0][:, None]
        rates = v[:, None, 6 * number : 6 * number + 6]
        return np.asarray(rates[..., :3] + np.cross(rates[..., 3:], arm))
    i = PLANAR * number
    arm = points_at(case, body, local, q) - q[:, None, i : i + 2]
    turned = np.stack([-arm[..., 1], arm[..., 0]], axis=2)
    return np.asarray(v[:, None, i : i + 2] + v[:, i + 2, None, None] * turned)
