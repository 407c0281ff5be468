"""What Python asks of a scene at rest: forces without rates, their stiffness, each member's own."""

import numpy as np

from mdstopo.compiler.jit import entry, kernel
from mdstopo.general.design.parameters import parameter_slopes
from mdstopo.general.dynamics.accelerations import joint_slopes, joint_state, make_workspace
from mdstopo.general.dynamics.forces import general_forces
from mdstopo.general.dynamics.members import MODE, SCALE, SET, level_of, scale_general, set_modes
from mdstopo.general.model.general_model import (
    CODE,
    COUNT,
    DESIGN,
    INERTER,
    MEMBER_FREE_LENGTH,
    PAIR,
    START,
    VARIED_BLOCK,
    VARIED_FIRST,
    VARIED_PLACE,
    VARIED_STOP,
    VARIED_VALUE,
    unpack_general,
)
from mdstopo.general.model.strides import pair_freedoms, place_in_joint, place_in_pair, place_of_turn
from mdstopo.mechanics.kinematics.kinematics_interface import (
    drive_state,
    freedoms,
    member_rows,
    most_rows,
    pose_size,
    relative_pose,
    rotations,
)
from mdstopo.mechanics.laws.law_table import FREE_LENGTH, law


@kernel
def rest(model, alpha, member_state, q, v):
    """Put scales, modes and sets of members at rest at q (n,): v (n,) becomes 0, what is driven is put in place."""
    scale_general(model.block, model.power, alpha, member_state)
    drive_state(model, np.int64(0), model.times[0], q, v)
    v[:] = 0.0
    n_pair = model.pair.shape[0]
    rel = np.empty((n_pair, pose_size(model)))
    relative_pose(model, q, v, rel)
    set_modes(model, member_state, rel, np.zeros((n_pair, freedoms(model))), np.int64(0))


@entry
def statics(ints, floats, alpha, member_state, q, lam, force, stiffness, rows, phi):
    """Forces and their stiffness at rest; damping, rates and inerters have no part in it.

    Constant:
      ints, floats: the packed scene (`pack_general`).
      alpha (N,): the design.
    In:
      lam (n_row,): multipliers of the joints.
    In place:
      q (n,): coordinates (m, rad); the driven ones are put in place.
    Out:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      force (n,): F without the joints' part (N, N m).
      stiffness (n, n): -dF/dq + d(Phi_q^T lam)/dq.
      rows (n_row, n): Phi_q.
      phi (n_row,): Phi (m or rad).
    """
    model = unpack_general(ints, floats)
    workspace = make_workspace(model)
    n = model.mass.shape[0]
    v = np.zeros(n)
    rest(model, alpha, member_state, q, v)
    general_forces(model, member_state, np.int64(0), model.times[0], q, v, np.bool_(True), workspace)
    joint_state(model, q, v, workspace)
    joint_slopes(model, q, v, np.zeros(n), lam, workspace)
    for d in range(n):
        force[d] = workspace.f[d]
        for c in range(n):
            stiffness[d, c] = 0.0
    for d in range(n):
        for r in range(rotations(model)):
            stiffness[d, place_of_turn(model, d, r)] -= workspace.turn[d, r]
    for p in range(model.pair.shape[0]):
        for i in range(pair_freedoms(model)):
            for j in range(pair_freedoms(model)):
                row = place_in_pair(model, p, i)
                stiffness[row, place_in_pair(model, p, j)] += workspace.k[p, i, j]
    rows[:] = 0.0
    for j in range(model.joint.shape[0]):
        for r in range(most_rows(model)):
            own = model.row[j, r]
            if own >= 0:
                phi[own] = workspace.phi[j, r]
                for i in range(pair_freedoms(model)):
                    rows[own, place_in_joint(model, j, i)] += workspace.jac[j, r, i]


@kernel
def _own_force(model, k, i, member_state, q, v, row, row_rate):
    """The force f_i of a member at unit strength (N), no inerter, and its row B_i.

    Constant:
      model: the compiled scene.
      k, i: the block, and the member (padded).
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q (n_q,), v (n,): coordinates, velocities.
    Out:
      row (2 D,): B_i over the freedoms of both bodies. row_rate (2 D,): its derivative by time.
    """
    x, rate = member_rows(model, model.block[k, PAIR], i, q, v, row, row_rate)
    x -= member_state[SET, i]
    t = model.times[0]
    value = level_of(model, np.int64(0), k, t)
    f, _, _, _, _ = law(
        model.block[k, CODE], model.law[k], x, rate, int(member_state[MODE, i]), t, value, model.curves,
        model.member[MEMBER_FREE_LENGTH, i],
    )  # fmt: skip
    return f


@entry
def unit_forces(ints, floats, alpha, member_state, q, out):
    """The slopes of the forces at rest by alpha^mu of each design member: -f_i B_i^T.

    Constant:
      ints, floats: the packed scene (`pack_general`).
      alpha (N,): the design.
    In place:
      q (n,): coordinates (m, rad); the driven ones are put in place.
    Out:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      out (M_padded, n): dF/d(alpha^mu) (N, N m); zero for what is no design member, does not act, or is an inerter.
    """
    model = unpack_general(ints, floats)
    n = model.mass.shape[0]
    v = np.zeros(n)
    row = np.empty(pair_freedoms(model))
    row_rate = np.empty(pair_freedoms(model))
    rest(model, alpha, member_state, q, v)
    for i in range(out.shape[0]):
        for d in range(n):
            out[i, d] = 0.0
    for k in range(model.block.shape[0]):
        if model.block[k, DESIGN] < 0 or model.active[0, k] == 0 or model.block[k, CODE] == INERTER:
            continue
        p = model.block[k, PAIR]
        for i in range(model.block[k, START], model.block[k, START] + model.block[k, COUNT]):
            f = _own_force(model, k, i, member_state, q, v, row, row_rate)
            for r in range(pair_freedoms(model)):
                out[i, place_in_pair(model, p, r)] -= f * row[r]


@entry
def value_forces(ints, floats, alpha, member_state, q, out):
    """The slopes of the forces at rest by each value of variables: -sum s (f_p B^T + f B_p^T) over its members.

    Times at which laws begin or end to act add nothing, nor does what multiplies rates.

    Constant:
      ints, floats: the packed scene (`pack_general`).
      alpha (N,): the design.
    In place:
      q (n,): coordinates (m, rad); the driven ones are put in place.
    Out:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      out (P, n): dF/dp (N, N m by the unit of each value).
    """
    model = unpack_general(ints, floats)
    n = model.mass.shape[0]
    start = np.int64(0)
    v = np.zeros(n)
    row = np.empty(pair_freedoms(model))
    row_rate = np.empty(pair_freedoms(model))
    moved = np.empty(pair_freedoms(model))
    rest(model, alpha, member_state, q, v)
    out[:] = 0.0
    for e in range(model.varied.shape[0]):
        k = model.varied[e, VARIED_BLOCK]
        place = model.varied[e, VARIED_PLACE]
        if place > FREE_LENGTH or model.active[0, k] == 0 or model.block[k, CODE] == INERTER:
            continue
        p = model.block[k, PAIR]
        for i in range(model.varied[e, VARIED_FIRST], model.varied[e, VARIED_STOP]):
            slope, _ = parameter_slopes(model, e, i, start, model.times[0], member_state, q, v, v, row, row_rate, moved)
            slope *= member_state[SCALE, i]
            for r in range(pair_freedoms(model)):
                force = slope * row[r] + member_state[SCALE, i] * moved[r]
                out[model.varied[e, VARIED_VALUE], place_in_pair(model, p, r)] -= force
