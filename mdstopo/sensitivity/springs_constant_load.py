"""Constant dynamic loading: the sensitivity of the pose at one time, everything but the members' springs held fixed.

At t_n inertia, damping and applied loads count as constant, so that K dq/dalpha_i = -T^T b_i f_i, and

    dG/dalpha_i = V_i - f_i (b_i . T z),   z = K^+T dg/dq

at alpha^mu. K is singular for free bodies: least squares of least norm, singular values below 1e-10 of the largest
dropped. An approximation; the paper's Figure 6 shows how far it carries.
"""

import numpy as np

from mdstopo.compiler.jit import entry
from mdstopo.mechanics.kinematics.planar_forces import pair_tangents
from mdstopo.mechanics.kinematics.planar_poses import POSE, relative_pose
from mdstopo.mechanics.passes import (
    SUMS,
    design_gradient,
    member_sums,
    scale_members,
    springs_of,
    unscale_gradient,
)
from mdstopo.responses.energy import energy_slope
from mdstopo.scene.packing import FIELDS, Packed, unpack
from mdstopo.scene.springs_model import FloatArray

#: singular values below this times the largest are dropped
DROPPED = 1e-10


@entry
def _stiffness(ints, floats, alpha, states, strength, stiffness, slope):
    """Stiffness of the bodies at rest, and slope of the energy, at P poses.

    Constant:
      ints, floats: the packed model.
    In:
      alpha (N,): the design.
      states (P, 2, n): q of the poses, and v, which is zero.
    Out:
      stiffness (P, n, n): -dF/dq at rest, added to.
      slope (P, n): dg/dq, added to.
    Room:
      strength (3, M_padded): overwritten by `scale_members`.
    """
    model = unpack(ints, floats)
    pair = model.pair
    n_pair = pair.shape[0]
    rel = np.empty((1, n_pair, POSE))
    sums = np.empty((1, n_pair, SUMS))
    k = np.empty((n_pair, 6, 6))
    pull = np.empty((n_pair, 3))
    scale_members(model, alpha, strength)
    for i in range(states.shape[0]):
        relative_pose(pair, model.home, states[i, 0], states[i, 1], rel[0])
        springs = springs_of(model)
        member_sums(springs, strength, rel, np.int64(1), np.bool_(True), sums)
        pair_tangents(pair, rel[0], sums[0], np.bool_(False), k, k)
        for p in range(n_pair):
            for j in range(3):
                pull[p, j] = sums[0, p, 4 + j]
        energy_slope(pair, rel[0], pull, 1.0, slope[i])
        for p in range(n_pair):
            for r in range(6):
                for c in range(6):
                    stiffness[i, 3 * pair[p, r // 3] + r % 3, 3 * pair[p, c // 3] + c % 3] += k[p, r, c]


@entry
def _gradient(ints, floats, alpha, weights, states, z, padded, out):
    """Gradient by alpha of the sum over P poses of weight V_i - f_i (b_i . T z).

    Constant:
      ints, floats: the packed model.
    In:
      alpha (N,): the design.
      weights (P,): of the energies.
      states (P, 2, n): q of the poses, and v, which is zero.
      z (P, n): virtual displacements, with the weights in them.
    Out:
      out (N,): overwritten.
    Room:
      padded (M_padded,): overwritten.
    """
    model = unpack(ints, floats)
    used = np.ones(z.shape[0], np.int64)
    work = np.zeros(8, np.int64)
    padded[:] = 0.0
    poses = np.empty((0, model.pair.shape[0], POSE))
    design_gradient(model, states, poses, z, used, states, weights, padded, work)
    unscale_gradient(model, alpha, padded, out)


def constant_load(packed: Packed, alpha: FloatArray, poses: FloatArray, weights: FloatArray) -> FloatArray:
    """Gradient (N,) of sum_p weights_p g(q_p) with respect to alpha (N,), by constant dynamic loading.

    packed: the scene. poses (P, n): q at the time of the row (P = 1, weight 1), or at the nodes of a mean or integral
    with their weights (P,).
    """
    count, n = poses.shape
    moving = np.flatnonzero(packed.floats[:n] > 0.0)  # ground does not answer
    members = int(packed.ints[FIELDS.place_of("padded")])
    states = np.zeros((count, 2, n))
    states[:, 0] = poses
    stiffness, slope, z = np.zeros((count, n, n)), np.zeros((count, n)), np.zeros((count, n))
    _stiffness(packed.ints, packed.floats, alpha, states, np.zeros((3, members)), stiffness, slope)
    inverse = np.linalg.pinv(stiffness[:, moving[:, None], moving], rcond=DROPPED)
    z[:, moving] = weights[:, None] * np.einsum("pji,pj->pi", inverse, slope[:, moving])
    gradient = np.zeros(len(alpha))
    _gradient(packed.ints, packed.floats, alpha, weights, states, z, np.zeros(members), gradient)
    return gradient
