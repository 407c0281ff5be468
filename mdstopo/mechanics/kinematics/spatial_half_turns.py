"""Half a turn of one body in space seen from another, where the rotation vector jumps: of bushings and responses."""

import numpy as np

from mdstopo.compiler.fields import FloatArray, IndexArray
from mdstopo.mechanics.kinematics.spatial_poses import COORDINATES, HOME_AXES, HOME_TURN, ROTATIONS

#: of the quaternion's scalar part: an integrator that cannot get across the jump ends this near
_AT = 1e-3


def half_turn(pairs: IndexArray, home: FloatArray, q: FloatArray) -> tuple[int, int] | None:
    """The first of the states q (T, n_q) at which a pair has turned so far, and which; None where none has.

    pairs (K, 2): the bodies of bushings, or of rotations that are responses. home (n_bodies, HOME): where these start.

    The turn S S_home^T of the second body seen from the first, with R = R_home E(e) of each, is
    E(e_a)^T M E(e_b) M^T, M = R_home,a^T R_home,b: its quaternion conj(e_a) (M e_b M^T) is continuous in its sign, as
    e_a and e_b are, and 1 at home. So its scalar part cos(|theta|/2) = w_a w_b + u_a . M u_b is zero at half a turn.
    """
    found: list[tuple[int, int]] = []
    for number, pair in enumerate(pairs):
        turns = [_turns(q, int(body)) for body in pair]
        starts = [home[body, HOME_TURN:HOME_AXES].reshape(3, 3) for body in pair]
        between = starts[0].T @ starts[1]
        cosine = turns[0][:, 0] * turns[1][:, 0] + np.sum(turns[0][:, 1:] * (turns[1][:, 1:] @ between.T), axis=1)
        beyond = np.flatnonzero(cosine <= _AT)
        if len(beyond):
            found.append((int(beyond[0]), number))
    return min(found, default=None)


def _turns(q: FloatArray, body: int) -> FloatArray:
    """(T, 4): quaternions of a body since home; ground does not turn."""
    end = (body + 1) * COORDINATES
    if end > q.shape[1]:
        return np.tile([1.0, 0.0, 0.0, 0.0], (len(q), 1))
    return q[:, end - ROTATIONS - 1 : end]
