"""Constant dynamic loading in a general scene: the pose at one time, everything but springs and joints held fixed.

    [K Phi_q^T; Phi_q 0] (dq, dlam)/dalpha_i = -(B_i^T f_i, 0),     dG/dalpha_i = dg/dalpha_i - f_i (b_i . T z)

with z from the transposed system and (g_q, g_lam). K and f_i are those at rest, so dampers and inerters have no part in
them. Free bodies make the system singular: least squares of least norm.
"""

import numpy as np

from mdstopo.compiler.jit import entry, kernel
from mdstopo.general.design.gather import add_design, explicit_part, force_sign
from mdstopo.general.dynamics.accelerations import joint_slopes, make_workspace, solve_accelerations
from mdstopo.general.dynamics.forces import general_forces
from mdstopo.general.dynamics.members import unscale_general
from mdstopo.general.model.general_model import unpack_general
from mdstopo.general.model.strides import pair_freedoms, place_in_joint, place_in_pair
from mdstopo.general.responses.extremes import FRACTION, STEP, WHO
from mdstopo.general.responses.general_responses import design_slopes, energy_weight, response
from mdstopo.general.steps.method_interface import point_of
from mdstopo.general.steps.step_history import EVENTS, SEGMENT, carve_history, copy_vector, restore_modes
from mdstopo.mechanics.kinematics.kinematics_interface import most_rows


@entry
def hold(
    tag,
    ints,
    floats,
    tables,
    alpha,
    limits,
    count,
    j,
    row,
    room,
    room_ints,
    member_state,
    z,
    matrix,
    right,
    padded,
    out,
    work,
):
    """Set up the linear system of constant dynamic loading at a row of `extremes`; or, given its solution, compute
    the gradient.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      ints, floats: the packed scene (`general_model.pack_general`).
      alpha (N,): the design.
      limits, room, room_ints: the history of steps, as of `carve_history`.
      count, j: how many steps there are; the response.
      row (COLUMNS,): the row, as of `extremes`.
      z (n,): the virtual displacement that solves the transposed system; no length: the system is asked for.
    In and out:
      member_state (3, columns): state of the members; modes and sets become those of the step in hand.
    Out:
      matrix (n + n_row, n + n_row), right (n + n_row,): the system, and (g_q, g_lam); where z has no length.
      out (N,): the gradient by alpha; where z has a length. padded (M_padded,): scratch for it.
      work (WORK,): counts of work, added to.
    """
    model = unpack_general(ints, floats)
    history = carve_history(model, limits, room, room_ints)
    workspace = make_workspace(model)
    n = model.mass.shape[0]
    n_row = model.size[0]
    no = np.bool_(False)
    q = np.empty(model.q0.shape[0])
    v = np.empty(n)
    a = np.empty(n)
    lam = np.empty(n_row)
    row_bar = np.empty(n_row)
    bars = np.empty((3, n))
    rest = np.zeros(n)
    k = int(row[STEP])
    c = row[FRACTION]
    who = int(row[WHO])
    segment = history.index[k, SEGMENT]
    if c <= 0.0 or c >= 1.0:
        copy_vector(history.q[k if c <= 0.0 else k + 1], q)
        copy_vector(history.v[k if c <= 0.0 else k + 1], v)
    else:
        point_of(tag, model, tables, member_state, history, count, k, c, no, workspace, q, v, work)
    t = history.t[k] + c * (history.t[k + 1] - history.t[k])
    restore_modes(history, history.index[k, EVENTS], member_state)
    solve_accelerations(model, member_state, segment, t, q, v, no, workspace, a, lam)
    response(model, member_state, segment, j, who, t, q, v, a, lam, workspace, bars, row_bar)
    if z.shape[0] > 0:
        padded[:] = 0.0
        slopes = design_slopes(model, member_state, segment, j, who, t, q, v, a, lam, workspace)
        weight = energy_weight(model, j, slopes)
        add_design(model, segment, t, member_state, q, rest, rest, z, weight, padded, work)
        sign = force_sign(model, segment, j, who, t, member_state, q, v, a)
        explicit_part(model, segment, j, who, slopes, t, member_state, q, v, a, sign, padded)
        unscale_general(model.block, model.power, alpha, padded, out)
        return
    general_forces(model, member_state, segment, t, q, rest, np.bool_(True), workspace)
    joint_slopes(model, q, v, a, lam, workspace)
    _fill_system(model, workspace, bars[0], row_bar, matrix, right)


@kernel
def _fill_system(model, workspace, by_q, by_lam, matrix, right):
    """The linear system of a scene held at one state.

    In:
      model: the compiled scene.
      workspace: workspace of a balance (`accelerations.Workspace`), with stiffness and slopes of the joints.
      by_q (n,), by_lam (n_row,): slopes of the response by coordinates and multipliers.
    Out:
      matrix (n + n_row, n + n_row): [K Phi_q^T; Phi_q 0].
      right (n + n_row,): both slopes.
    """
    n = by_q.shape[0]
    n_row = by_lam.shape[0]
    matrix[:] = 0.0
    for d in range(n):
        right[d] = by_q[d]
    for r in range(n_row):
        right[n + r] = by_lam[r]
    for p in range(model.pair.shape[0]):
        for i in range(pair_freedoms(model)):
            for m in range(pair_freedoms(model)):
                line = place_in_pair(model, p, i)
                matrix[line, place_in_pair(model, p, m)] += workspace.k[p, i, m]
    for joint in range(model.joint.shape[0]):
        for r in range(most_rows(model)):
            own = model.row[joint, r]
            if own >= 0:
                for i in range(pair_freedoms(model)):
                    d = place_in_joint(model, joint, i)
                    matrix[n + own, d] += workspace.jac[joint, r, i]
                    matrix[d, n + own] += workspace.jac[joint, r, i]
