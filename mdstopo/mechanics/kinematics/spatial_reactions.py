"""What joints in space transmit: the norms of their force and moment on the first body, with slopes.

With the pull p = -Phi_q^T lam on the first body, F = p_0..2 is the force (global), and its moment at the joint's point
s is m = p_3..5 - s x g, g = R_A^T F, in the body's axes, in which it is as long as in global ones. With e = m / |m|,
and u = e x s,

    d|m| = e . dp_3..5 - (R_A u) . dF - (u x g) . dtheta_A,      dp = -d(Phi_q^T lam)/dq dq - Phi_q^T dlam
"""

import math

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.mechanics.kinematics.kinematics_interface import FORCE
from mdstopo.mechanics.kinematics.spatial_joints import (
    FIRST_POINT,
    ONE,
    PLACES,
    ROWS,
    joint_rows,
    joint_stiffness,
    place_joint_alone,
    rows_of,
)
from mdstopo.mechanics.kinematics.spatial_poses import FREEDOMS, TURN
from mdstopo.mechanics.kinematics.vectors import cross, dot, minus, times, turned, turned_back, vector_at


@kernel
def transmitted(model, j, which, q, lam, by_lam, by_q):
    """The norms above; see `kinematics_interface.transmitted`."""
    w = np.empty(PLACES)
    phi = np.zeros(ROWS)
    jac = np.zeros((ROWS, 2 * FREEDOMS))
    stiffness = np.zeros((2 * FREEDOMS, 2 * FREEDOMS))
    by_lam[:] = 0.0
    by_q[:] = 0.0
    place_joint_alone(model, j, q, w)
    joint_rows(model, j, w, phi, jac)
    joint_stiffness(model, j, w, lam, stiffness)
    rows = rows_of(model.joint[j, 0])
    force = (0.0, 0.0, 0.0)
    moment = (0.0, 0.0, 0.0)
    for r in range(rows):
        force = minus(force, times(lam[r], vector_at(jac[r], 0)))
        moment = minus(moment, times(lam[r], vector_at(jac[r], 3)))
    if which == FORCE:
        size = math.sqrt(dot(force, force))
        along = times(1.0 / size if size > 0.0 else 0.0, force)
        turning = (0.0, 0.0, 0.0)
    else:
        s = vector_at(model.joint_par[j], FIRST_POINT)
        seen = turned_back(w, ONE + TURN, force)
        moment = minus(moment, cross(s, seen))
        size = math.sqrt(dot(moment, moment))
        turning = times(1.0 / size if size > 0.0 else 0.0, moment)
        u = cross(turning, s)
        along = times(-1.0, turned(w, ONE + TURN, u))
        x = cross(u, seen)
        by_q[3] = -x[0]
        by_q[4] = -x[1]
        by_q[5] = -x[2]
    for r in range(rows):
        by_lam[r] = -dot(along, vector_at(jac[r], 0)) - dot(turning, vector_at(jac[r], 3))
    for c in range(2 * FREEDOMS):
        for i in range(3):
            by_q[c] -= along[i] * stiffness[i, c] + turning[i] * stiffness[3 + i, c]
    return size
