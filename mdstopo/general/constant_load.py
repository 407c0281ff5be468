"""Constant dynamic loading in a general scene: the pose at one time, everything but springs and joints held fixed.

    [K Phi_q^T; Phi_q 0] (dq, dlam)/dalpha_i = -(B_i^T f_i, 0),     dG/dalpha_i = dg/dalpha_i - f_i (b_i . T z)

with z from the transposed system and (g_q, g_lam). Free bodies make it singular: least squares of least norm.
"""

import numpy as np

from mdstopo.compiler.jit import entry
from mdstopo.general.balance import balance, joint_slopes, make_desk
from mdstopo.general.duties import point_of
from mdstopo.general.forces import general_forces
from mdstopo.general.gather import add_design, explicit_part, force_sign
from mdstopo.general.members import unscale_general
from mdstopo.general.model import unpack_general
from mdstopo.general.responses import ENERGY, response
from mdstopo.general.track import carve_track, copy_vector, restore_modes


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
    strength,
    z,
    matrix,
    right,
    padded,
    out,
    work,
):
    """The linear system of constant dynamic loading at a row of `extremes`; or, once it is solved, the gradient.

    Constant:
      tag, tables: the integrator (`duties`) and its coefficients.
      ints, floats: the packed scene (`model.pack_general`).
      alpha (N,): the design.
      limits, room, room_ints: the history of steps, as of `track.carve_track`.
      count, j: how many steps there are; the response.
      row (COLUMNS,): the row, as of `extremes`.
      z (n,): the virtual displacement that solves the transposed system; no length: the system is asked for.
    In and out:
      strength (3, columns): state of the members; modes and sets are put to those of the steps that are looked at.
    Out:
      matrix (n + n_row, n + n_row), right (n + n_row,): the system, and (g_q, g_lam); where z has no length.
      out (N,): the gradient by alpha; where z has a length. padded (M_padded,): scratch for it.
      work (WORK,): counts of work, added to.
    """
    model = unpack_general(ints, floats)
    track = carve_track(model, limits, room, room_ints)
    desk = make_desk(model)
    n = model.mass.shape[0]
    n_row = model.size[0]
    no = np.bool_(False)
    q = np.empty(n)
    v = np.empty(n)
    a = np.empty(n)
    lam = np.empty(n_row)
    row_bar = np.empty(n_row)
    bars = np.empty((3, n))
    k = int(row[2])
    c = row[3]
    who = int(row[6])
    segment = track.index[k, 2]
    if c <= 0.0 or c >= 1.0:
        copy_vector(track.state[k if c <= 0.0 else k + 1, 0], q)
        copy_vector(track.state[k if c <= 0.0 else k + 1, 1], v)
    else:
        point_of(tag, model, tables, strength, track, count, k, c, no, desk, q, v, work)
    t = track.t[k] + c * (track.t[k + 1] - track.t[k])
    restore_modes(track, track.index[k, 3], strength)
    balance(model, strength, segment, t, q, v, no, desk, a, lam)
    response(model, strength, segment, j, who, t, q, v, a, lam, desk, bars, row_bar)
    if z.shape[0] > 0:
        padded[:] = 0.0
        weight = 1.0 if model.response[j, 0] == ENERGY else 0.0
        add_design(model, segment, t, strength, q, v, a, z, weight, padded, work)
        sign = force_sign(model, segment, j, who, t, strength, q, v, a)
        explicit_part(model, segment, j, who, t, strength, q, v, a, sign, padded)
        unscale_general(model.block, model.power, alpha, padded, out)
        return
    general_forces(model, strength, segment, t, q, v, np.bool_(True), desk)
    joint_slopes(model, q, v, a, lam, desk)
    matrix[:] = 0.0
    for d in range(n):
        right[d] = bars[0, d]
    for r in range(n_row):
        right[n + r] = row_bar[r]
    for p in range(model.pair.shape[0]):
        for i in range(6):
            for m in range(6):
                line = 3 * model.pair[p, i // 3] + i % 3
                matrix[line, 3 * model.pair[p, m // 3] + m % 3] += desk.k[p, i, m]
    for joint in range(model.joint.shape[0]):
        for r in range(3):
            own = model.row[joint, r]
            if own >= 0:
                for i in range(6):
                    d = 3 * model.joint[joint, 1 + i // 3] + i % 3
                    matrix[n + own, d] += desk.jac[joint, r, i]
                    matrix[d, n + own] += desk.jac[joint, r, i]
