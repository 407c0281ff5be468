"""Where points of bodies are at given states, with NumPy: for pictures, tables and histories."""

import numpy as np

from mdstopo.case.model import GROUND, Case, MemberGroup
from mdstopo.scene.model import FloatArray


def member_lengths(case: Case, group: MemberGroup, q: FloatArray) -> FloatArray:
    """Lengths (T, M) of a group's members at states q (T, 3 n_bodies)."""
    p = points_at(case, group.body_from, group.from_local, q)[:, group.from_index]
    return np.asarray(np.linalg.norm(points_at(case, group.body_to, group.to_local, q)[:, group.to_index] - p, axis=2))


def points_at(case: Case, body: str, local: FloatArray, q: FloatArray) -> FloatArray:
    """Global places (T, K, 2) of points (K, 2) of a body at states q (T, 3 n_bodies)."""
    if body == GROUND:
        return np.broadcast_to(local, (len(q), *local.shape))
    i = 3 * [each.name for each in case.bodies].index(body)
    cos, sin = np.cos(q[:, i + 2, None]), np.sin(q[:, i + 2, None])
    x = q[:, i, None] + cos * local[:, 0] - sin * local[:, 1]
    y = q[:, i + 1, None] + sin * local[:, 0] + cos * local[:, 1]
    return np.stack([x, y], axis=2)
