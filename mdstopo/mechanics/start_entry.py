"""Compiled entry: the tangents at the start, for natural frequencies."""

import numpy as np

from mdstopo.compiler.jit import entry
from mdstopo.mechanics.assembly import forces
from mdstopo.mechanics.geometry import POSE
from mdstopo.mechanics.passes import SUMS
from mdstopo.scene.packing import unpack


@entry
def start_tangents(ints, floats, strength, damped, k, turn):
    """k (1, n_pair, 6, 6) = -dF/dq of each pair and turn (1, n), the loads' derivative by the angles, at the start."""
    model = unpack(ints, floats)
    n = model.q0.shape[0]
    n_pair = model.pair.shape[0]
    forces(
        model, strength, np.int64(0), np.int64(1), model.times[:1], model.q0.reshape((1, n)),
        model.v0.reshape((1, n)), np.bool_(True), damped, np.empty((1, n_pair, POSE)),
        np.empty((1, n_pair, SUMS)), np.empty((1, n)), k, np.empty((1, n_pair, 6, 6)), turn,
    )  # fmt: skip
