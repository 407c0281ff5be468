"""What Python asks of the joints before anything moves."""

import numpy as np

from mdstopo.compiler.jit import entry
from mdstopo.general.accelerations import joint_state, make_workspace, solve_accelerations
from mdstopo.general.members import scale_general
from mdstopo.general.model import JOINT_ROWS, unpack_general
from mdstopo.general.projection import project
from mdstopo.general.runge_kutta import scene_size, start_modes
from mdstopo.general.strides import pair_freedoms, place_in_joint, place_in_pair, place_of_turn
from mdstopo.mechanics.joints.revolute import PLACES, place_joint
from mdstopo.mechanics.joints.table import joint_reaction, joint_rows
from mdstopo.mechanics.kinematics.kinematics_interface import drive_state, most_rows, rotations, turn_bodies


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
def assemble(ints, floats, q, v, move, phi, rates):
    """Phi and Phi_q v of the joints at the start, which is put on the joints first where asked.

    Constant:
      ints, floats: the packed scene (`pack_general`).
    In:
      move: whether the start is moved onto the joints.
    In place:
      q, v (n,): the start (m, rad; m/s, rad/s); the driven ones are put in place.
    Out:
      phi, rates (n_joint, rows): Phi (m or rad) and Phi_q v (m/s or rad/s), as many rows as each joint has.
    """
    model = unpack_general(ints, floats)
    workspace = make_workspace(model)
    drive_state(model, 0, model.times[0], q, v)
    if move:
        push = np.zeros((2, model.size[0]))
        for _ in range(20):
            project(model, scene_size(model), q, v, workspace, push[0], push[1])
    turn_bodies(model, q, workspace.turned)
    joint_state(model, q, v, workspace)
    for j in range(model.joint.shape[0]):
        for r in range(model.joint[j, JOINT_ROWS]):
            phi[j, r] = workspace.phi[j, r]
            rates[j, r] = 0.0
            for i in range(pair_freedoms(model)):
                rates[j, r] += workspace.jac[j, r, i] * v[place_in_joint(model, j, i)]


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


@entry
def linearise(ints, floats, alpha, member_state, stiffness, mass, rows):
    """Stiffness, mass and constraints of small undamped motion about the start.

    Constant:
      ints, floats: the packed scene (`pack_general`).
    In:
      alpha (N,): the design.
    Out:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      stiffness, mass (n, n): zero before.
      rows (n_row, n): Phi_q; zero before.
    """
    model = unpack_general(ints, floats)
    workspace = make_workspace(model)
    n = model.mass.shape[0]
    q = model.q0.copy()
    v = model.v0.copy()
    a = np.zeros(n)
    lam = np.zeros(model.size[0])
    scale_general(model.block, model.power, alpha, member_state)
    start_modes(model, member_state, workspace, q, v, a, lam, np.bool_(True))
    solve_accelerations(model, member_state, np.int64(0), model.times[0], q, v, np.bool_(True), workspace, a, lam)
    for d in range(n):
        mass[d, d] = model.mass[d]
        for r in range(rotations(model)):
            stiffness[d, place_of_turn(model, d, r)] -= workspace.turn[d, r]
    for p in range(model.pair.shape[0]):
        for i in range(pair_freedoms(model)):
            for j in range(pair_freedoms(model)):
                row = place_in_pair(model, p, i)
                column = place_in_pair(model, p, j)
                stiffness[row, column] += workspace.k[p, i, j]
                mass[row, column] += workspace.mass[p, i, j]
    for j in range(model.joint.shape[0]):
        for r in range(most_rows(model)):
            if model.row[j, r] >= 0:
                for i in range(pair_freedoms(model)):
                    rows[model.row[j, r], place_in_joint(model, j, i)] += workspace.jac[j, r, i]
