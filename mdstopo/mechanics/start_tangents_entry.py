"""Compiled entry: the tangents at the start, for natural frequencies."""

import numpy as np

from mdstopo.compiler.jit import entry
from mdstopo.mechanics.assembly import forces
from mdstopo.mechanics.kinematics.planar_poses import POSE
from mdstopo.mechanics.passes import SUMS
from mdstopo.scene.packing import unpack


@entry
def start_tangents(ints, floats, strength, damped, k, turn):
    """Tangents of the forces at the start of the motion.

    Constant:
      ints, floats: the packed model.
    In:
      strength (3, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
      damped: whether any force depends on velocity.
    Out:
      k (1, n_pair, 6, 6): -dF/dq of each pair.
      turn (1, n): derivative of the loads by the angle of their body, if loads turn.
    """
    model = unpack(ints, floats)
    n = model.q0.shape[0]
    n_pair = model.pair.shape[0]
    forces(
        model, strength, np.int64(0), np.int64(1), model.times[:1], model.q0.reshape((1, n)),
        model.v0.reshape((1, n)), np.bool_(True), damped, np.empty((1, n_pair, POSE)),
        np.empty((1, n_pair, SUMS)), np.empty((1, n)), k, np.empty((1, n_pair, 6, 6)), turn,
    )  # fmt: skip
