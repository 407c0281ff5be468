"""What Python asks of the start: joints assembled, and the linear equations of small motion about it."""

import numpy as np

from mdstopo.compiler.jit import entry
from mdstopo.general.dynamics.accelerations import joint_state, make_workspace, solve_accelerations
from mdstopo.general.dynamics.members import scale_general
from mdstopo.general.dynamics.projection import project
from mdstopo.general.model.general_model import JOINT_ROWS, unpack_general
from mdstopo.general.model.strides import pair_freedoms, place_in_joint, place_in_pair, place_of_turn
from mdstopo.general.steps.run_start import modes_at_start, scene_size
from mdstopo.mechanics.kinematics.kinematics_interface import drive_state, most_rows, rotations, turn_bodies


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
    modes_at_start(model, member_state, workspace, q, v, a, lam, np.int64(0))
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
