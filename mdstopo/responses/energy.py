"""Stored energy of the design members, g = sum alpha^mu V (Eq. 21), over time; its value, rate and derivatives.

Along the motion dg/dt = sum over pairs of E_xi . xi', and dg/dq = T^T E_xi: both from the sums of one force pass.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.mechanics.kinematics.planar_poses import VT, VX, VY, add_pair_force, relative_pose
from mdstopo.mechanics.passes import SLOPE_T, SLOPE_X, SLOPE_Y, STORED, member_sums


@part
def energy_at(pair, home, springs, strength, q, v, rel, sums):
    """Stored energy g and its rate dg/dt in one state.

    Constant:
      pair (n_pair, 2): the bodies of each pair.
      home (n_body, HOME): where bodies are when q is zero.
      springs: what a pass over the members needs (`Springs`).
      strength (3, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
    In:
      q, v (n,): coordinates and velocities (m, rad; m/s, rad/s).
    Out:
      rel (1, n_pair, POSE), sums (1, n_pair, SUMS): relative poses and sums of the members in that state.

    Returns g (J) and dg/dt (W).
    """
    relative_pose(pair, home, q, v, rel[0])
    member_sums(springs, strength, rel, np.int64(1), np.bool_(False), sums)
    return energy_of(rel[0], sums[0])


@kernel
def energy_of(rel, sums):
    """g and dg/dt from the relative poses (n_pair, POSE) of a state and their sums (n_pair, SUMS)."""
    value = 0.0
    rate = 0.0
    for p in range(rel.shape[0]):
        value += sums[p, STORED]
        rate += sums[p, SLOPE_X] * rel[p, VX] + sums[p, SLOPE_Y] * rel[p, VY] + sums[p, SLOPE_T] * rel[p, VT]
    return value, rate


@kernel
def energy_slope(pair, rel, pull, weight, out):
    """out (n,) += weight dg/dq from the relative poses and E_xi (n_pair, 3) of one state."""
    for p in range(pair.shape[0]):
        add_pair_force(pair, rel, p, weight * pull[p, 0], weight * pull[p, 1], weight * pull[p, 2], out)
