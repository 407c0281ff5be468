"""What Python asks of the joints of bodies in a plane."""

import numpy as np

from mdstopo.compiler.jit import entry
from mdstopo.mechanics.joints.joint_table import joint_reaction, joint_rows
from mdstopo.mechanics.joints.revolute import PLACES, place_joint


@entry
def slopes_of(joint, joint_par, home, q, phi, jac):
    """Phi and Phi_q of joints at one configuration.

    joint (n_joint, 5), joint_par (n_joint, 12), home (n / 3, 5): as in `GeneralModel`.
    q (n,): coordinates (m, rad).
    phi (n_joint, rows), jac (n_joint, rows, 2 D): are written, as many rows as each joint has.
    """
    w = np.empty(PLACES)
    for j in range(joint.shape[0]):
        place_joint(home, joint[j, 1], joint[j, 2], q, w)
        joint_rows(joint[j, 0], joint_par[j], w, phi[j], jac[j])


@entry
def reactions(joint, joint_par, home, row, q, lam, out):
    """Force and moment of each joint on its first body, at many states.

    Constant:
      joint (n_joint, 5), joint_par (n_joint, 12), home (n / 3, 5), row (n_joint, rows): as in `GeneralModel`.
    In:
      q (T, n): coordinates (m, rad).
      lam (T, n_row): multipliers.
    Out:
      out (T, n_joint, D): Fx, Fy, M (N, N, N m).
    """
    w = np.empty(PLACES)
    mine = np.empty(row.shape[1])
    for k in range(q.shape[0]):
        for j in range(joint.shape[0]):
            for i in range(row.shape[1]):
                mine[i] = lam[k, row[j, i]] if row[j, i] >= 0 else 0.0
            place_joint(home, joint[j, 1], joint[j, 2], q[k], w)
            joint_reaction(joint[j, 0], joint[j, 4], joint_par[j], w, mine, out[k, j])
