"""Accelerations and multipliers from forces, and the linear systems of everything that is derived from them.

    [M  Phi_q^T] [a  ]   [F     ]        Phi_q a + gamma = 0  is the second time derivative of Phi(q) = 0
    [Phi_q   0 ] [lam] = [-gamma]

for the free coordinates; what is driven has a known acceleration and moves to the right side. The unknowns stand in an
order in which the matrix is banded (`place`), so a chain of bodies costs what its length costs. With tangents added,

    W(w_q, w_v) = [M + w_q K + w_v C,  Phi_q^T; Phi_q + w_q G_q + w_v G_v,  0]

is the matrix of an implicit step and, transposed, that of the reverse sweep. Without tangents, and without inerters,
only a matrix of the joints is factorised (`joint_matrix`). K holds the stiffness of members, loads,
joints (d(Phi_q^T lam)/dq) and inerters, G_q and G_v the slopes of Phi_q a + gamma.
"""

from typing import Any

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.general.forces import (
    add_inerter_tangents,
    add_inerters,
    drive_acceleration,
    drive_state,
    general_forces,
)
from mdstopo.general.joint_matrix import SINGULAR, factor_joints, inverse_masses, solve_joints, spread_masses
from mdstopo.general.structures import bundle
from mdstopo.general.switches import APART, DAMPED, DIAGONAL, OF_JOINTS, THOROUGH, carriers, switches_of
from mdstopo.integrators.banded import factorise, solve
from mdstopo.mechanics.joints.revolute import PLACES, place_turned, revolute_vjp
from mdstopo.mechanics.joints.table import (
    joint_acceleration_slopes,
    joint_gamma,
    joint_is_point,
    joint_rows,
    joint_stiffness,
)
from mdstopo.mechanics.kinematics.planar_poses import POSE, turned_from
from mdstopo.mechanics.passes import SUMS

#: what the solution at one state needs and leaves: cos and sin of angles, relative poses, sums, forces, K, C, slope
#: of turning loads, inerters' mass; of the joints Phi, Phi_q, gamma, G_q, G_v; the banded matrix with its pivots,
#: right side and the scales of its unknowns, which make every row about 1 whatever the masses; of the joints' matrix
#: the inverse masses, by coordinates and by slopes, Phi_q M^-1, the factors and the diagonal; one joint's own
#: coordinates, their derivatives and multipliers; the known accelerations of what is driven; which pairs carry more
#: than joints, and the switches (`switches`)
FIELDS = (
    "turned", "rel", "sums", "f", "k", "c", "turn", "mass", "phi", "jac", "gamma", "by_q", "by_v", "band", "pivots",
    "x", "scale", "inverse", "spread", "pull", "gram", "diagonal", "own", "known", "carries", "switches",
)  # fmt: skip


class Workspace:
    """The workspace for one state, whose arrays `FIELDS` names; made in kernels only, by `make_workspace`."""

    def __init__(self, *_arrays: Any) -> None: ...


bundle(Workspace, FIELDS)


@kernel
def make_workspace(model):
    """A workspace for one state."""
    n = model.mass.shape[0]
    n_pair = model.pair.shape[0]
    n_joint = model.joint.shape[0]
    total = model.place.shape[0]
    return Workspace(
        np.zeros((n // 3, 2)),
        np.zeros((n_pair, POSE)),
        np.zeros((n_pair, SUMS)),
        np.zeros(n),
        np.zeros((n_pair, 6, 6)),
        np.zeros((n_pair, 6, 6)),
        np.zeros(n),
        np.zeros((n_pair, 6, 6)),
        np.zeros((n_joint, 3)),
        np.zeros((n_joint, 3, 6)),
        np.zeros((n_joint, 3)),
        np.zeros((n_joint, 3, 6)),
        np.zeros((n_joint, 3, 6)),
        np.empty((total, 3 * model.size[1] + 1)),
        np.zeros(total, np.int64),
        np.zeros(total),
        np.ones(total),
        inverse_masses(model),
        spread_masses(model),
        np.zeros((n_joint, 3, 6)),
        np.zeros(model.size[3]),
        np.ones((2, model.size[0])),
        np.zeros((4, PLACES)),
        np.zeros(n),
        carriers(model),
        switches_of(model),
    )


@part
def gather(model, j, x, out):
    """out (6,) = the entries of x (n,) of the two bodies of joint j."""
    a = 3 * model.joint[j, 1]
    b = 3 * model.joint[j, 2]
    for i in range(3):
        out[i] = x[a + i]
        out[3 + i] = x[b + i]


@part
def gather_turned(model, j, q, turned, w):
    """w (PLACES,) of joint j from q (n,) and the turns of `forces.turn_bodies`."""
    one = model.joint[j, 1]
    two = model.joint[j, 2]
    turns_one = turned_from(model.home, one, turned[one, 0], turned[one, 1])
    place_turned(model.home, one, two, q, turns_one, turned_from(model.home, two, turned[two, 0], turned[two, 1]), w)


@part
def gather_multipliers(model, j, lam, out):
    """out (3,) = multipliers of joint j from lam (n_row,); 0 for rows that are left out."""
    for r in range(3):
        i = model.row[j, r]
        out[r] = lam[i] if i >= 0 else 0.0


@kernel
def joint_state(model, q, v, workspace):
    """Phi, Phi_q and gamma of all joints of bodies that are turned in the workspace (`forces.turn_bodies`)."""
    w = workspace.own[0]
    wd = workspace.own[1]
    for j in range(model.joint.shape[0]):
        gather_turned(model, j, q, workspace.turned, w)
        gather(model, j, v, wd)
        joint_rows(model.joint[j, 0], model.joint_par[j], w, workspace.phi[j], workspace.jac[j])
        joint_gamma(model.joint[j, 0], model.joint_par[j], w, wd, workspace.gamma[j])


@kernel
def joint_slopes(model, q, v, a, lam, workspace):
    """G_q and G_v of all joints, and their stiffness added to K.

    Constant:
      model: the compiled scene.
      q, v, a (n,): coordinates, velocities, accelerations (m, rad; per s; per s^2).
      lam (n_row,): multipliers (N, N m).
    In and out:
      workspace: the workspace, with the bodies turned (`forces.turn_bodies`); by_q, by_v are set, k is added to.
    """
    w = workspace.own[0]
    wd = workspace.own[1]
    wdd = workspace.own[2]
    mine = workspace.own[3]
    for j in range(model.joint.shape[0]):
        gather_turned(model, j, q, workspace.turned, w)
        gather(model, j, v, wd)
        gather(model, j, a, wdd)
        gather_multipliers(model, j, lam, mine)
        code = model.joint[j, 0]
        par = model.joint_par[j]
        joint_acceleration_slopes(code, par, w, wd, wdd, workspace.by_q[j], workspace.by_v[j])
        joint_stiffness(code, par, w, mine, workspace.k[model.joint[j, 3]])


@kernel
def factor_matrix(model, workspace, k, c, turn, mass, w_q, w_v, transposed):
    """Factorise W(w_q, w_v), or its transpose, for `solve_unknowns`.

    Constant:
      model: the compiled scene.
      k, c (n_pair, 6, 6): stiffness and damping of the balance; read where a weight is not zero, as turn is.
      turn (n,): slopes of the turning loads by the angles of their bodies.
      mass (n_pair, 6, 6): mass of the inerters (kg, kg m, kg m^2).
      w_q, w_v: weights of K with G_q (s^2), and of C with G_v (s).
      transposed: whether the transpose is meant.
    In and out:
      workspace: the workspace, with the joints' Phi_q, G_q and G_v; the factors come onto it.

    Returns the place of the unknown at which the matrix is singular, or -1.
    """
    tangent = w_q != 0.0 or w_v != 0.0
    alone = not tangent and workspace.switches[DIAGONAL] != 0
    workspace.switches[OF_JOINTS] = 1 if alone else 0
    if alone:
        thorough = workspace.switches[THOROUGH] != 0
        return factor_joints(
            model,
            workspace.spread,
            workspace.jac,
            workspace.pull,
            workspace.gram,
            workspace.diagonal,
            thorough,
            workspace.x,
        )
    band = workspace.band
    half = model.size[1]
    n = model.mass.shape[0]
    damped = workspace.switches[DAMPED] != 0
    band[:] = 0.0
    scale = workspace.scale
    for d in range(n):
        scale[model.place[d]] = 1.0 / np.sqrt(model.mass[d]) if model.free[d] != 0 else 1.0
    for j in range(model.joint.shape[0]):
        for r in range(3):
            if model.row[j, r] >= 0:
                size = 0.0
                for i in range(6):
                    column = 3 * model.joint[j, 1 + i // 3] + i % 3
                    if model.free[column] != 0:
                        size += workspace.jac[j, r, i] ** 2 / model.mass[column]
                scale[model.place[n + model.row[j, r]]] = 1.0 / np.sqrt(size) if size > 0.0 else 1.0
    for d in range(n):
        p = model.place[d]
        band[p, half] = 1.0
        if tangent and model.free[d] != 0:
            angle = d - d % 3 + 2
            if model.free[angle] != 0 and turn[d] != 0.0:
                put(band, half, scale, p, model.place[angle], -w_q * turn[d], transposed)
    for p in range(model.pair.shape[0]):
        for i in range(6):
            row = 3 * model.pair[p, i // 3] + i % 3
            if model.free[row] == 0:
                continue
            for j in range(6):
                column = 3 * model.pair[p, j // 3] + j % 3
                if model.free[column] == 0:
                    continue
                value = mass[p, i, j]
                if tangent:
                    value += w_q * k[p, i, j]
                    if damped:
                        value += w_v * c[p, i, j]
                if value != 0.0:
                    put(band, half, scale, model.place[row], model.place[column], value, transposed)
    for j in range(model.joint.shape[0]):
        for r in range(3):
            own = model.row[j, r]
            if own < 0:
                continue
            at = model.place[n + own]
            for i in range(6):
                column = 3 * model.joint[j, 1 + i // 3] + i % 3
                if model.free[column] == 0:
                    continue
                there = model.place[column]
                force = workspace.jac[j, r, i]
                value = force
                if tangent:
                    value += w_q * workspace.by_q[j, r, i] + w_v * workspace.by_v[j, r, i]
                put(band, half, scale, there, at, force, transposed)
                put(band, half, scale, at, there, value, transposed)
    return factorise_at(band, half, workspace.pivots, tangent)


@kernel
def put(band, half, scale, row, column, value, transposed):
    """Add a value to an entry of the matrix, or to the mirrored one.

    band (places, 3 half + 1): the banded matrix, added to; half: half width of the band.
    scale (places,): of the unknowns. row, column: places of the entry.
    value: in unscaled unknowns. transposed: whether the mirrored entry is meant.
    """
    value *= scale[row] * scale[column]
    if transposed:
        band[column, row - column + half] += value
    else:
        band[row, column - row + half] += value


@kernel
def factorise_at(band, half, pivots, tangent):
    """Factorise; -1, or the place at which the matrix is singular (without tangents: to rounding)."""
    regular = factorise(band, half, pivots)
    for p in range(band.shape[0]):
        size = abs(band[p, half])
        if (size == 0.0 and not regular) or (size < SINGULAR and not tangent):
            return p
    return -1


@kernel
def solve_unknowns(model, workspace, a, lam):
    """Solve with the factors in the workspace for the right side a (n,), lam (n_row,), in place; driven parts become
    0."""
    if workspace.switches[OF_JOINTS] != 0:
        solve_joints(model, workspace.inverse, workspace.pull, workspace.gram, workspace.diagonal, workspace.x, a, lam)
        return
    n = model.mass.shape[0]
    x = workspace.x
    for d in range(n):
        p = model.place[d]
        x[p] = a[d] * workspace.scale[p] if model.free[d] != 0 else 0.0
    for r in range(lam.shape[0]):
        p = model.place[n + r]
        x[p] = lam[r] * workspace.scale[p]
    solve(workspace.band, model.size[1], workspace.pivots, x)
    for d in range(n):
        p = model.place[d]
        a[d] = x[p] * workspace.scale[p]
    for r in range(lam.shape[0]):
        p = model.place[n + r]
        lam[r] = x[p] * workspace.scale[p]


@kernel
def solve_accelerations(model, member_state, segment, t, q, v, tangent, workspace, a, lam):
    """Accelerations and multipliers at one state.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      segment, t: segment of `model.times`, and time in it (s).
      tangent: whether workspace.k, .c, .turn, .by_q, .by_v are to hold the tangents of the whole balance (with the
        switch APART those of members and loads alone).
    In and out:
      q, v (n,): coordinates and velocities (m, rad; m/s, rad/s); their driven part is put in place first.
      workspace: the workspace; forces, poses, the joints' rows and the factors stay on it.
    Out:
      a (n,): accelerations (m/s^2, rad/s^2).
      lam (n_row,): multipliers (N, N m).

    Returns the place of the unknown at which the joints are singular, or -1.
    """
    n = q.shape[0]
    drive_state(model, segment, t, q, v)
    general_forces(model, member_state, segment, t, q, v, tangent, workspace)
    if workspace.switches[DIAGONAL] == 0:
        add_inerters(model, segment, member_state, q, v, workspace.mass, workspace.f)
    joint_state(model, q, v, workspace)
    singular = factor_matrix(
        model, workspace, workspace.k, workspace.c, workspace.turn, workspace.mass, 0.0, 0.0, np.bool_(False)
    )
    if singular >= 0:
        return singular
    known = workspace.known  # zero but for what is driven
    drive_acceleration(model, segment, t, known)
    for d in range(n):
        a[d] = workspace.f[d]
    if model.driven.shape[0] > 0 and workspace.switches[DIAGONAL] == 0:
        for p in range(model.pair.shape[0]):
            for i in range(6):
                row = 3 * model.pair[p, i // 3] + i % 3
                for j in range(6):
                    a[row] -= workspace.mass[p, i, j] * known[3 * model.pair[p, j // 3] + j % 3]
    joint = model.joint
    row = model.row
    gamma = workspace.gamma
    jac = workspace.jac
    for j in range(joint.shape[0]):
        one = 3 * joint[j, 1]
        two = 3 * joint[j, 2]
        for r in range(3):
            if row[j, r] >= 0:
                value = -gamma[j, r]
                for i in range(3):
                    value -= jac[j, r, i] * known[one + i] + jac[j, r, 3 + i] * known[two + i]
                lam[row[j, r]] = value
    solve_unknowns(model, workspace, a, lam)
    for i in range(model.driven.shape[0]):
        a[model.driven[i]] = known[model.driven[i]]
    if tangent:
        if workspace.switches[APART] == 0:
            joint_slopes(model, q, v, a, lam, workspace)
        if workspace.switches[DIAGONAL] == 0:
            add_inerter_tangents(model, segment, member_state, q, v, a, workspace.k, workspace.c)
    return -1


@kernel
def accelerations_vjp(model, workspace, k, c, turn, z, y, bar_q, bar_v):
    """Cotangents of a state from those of its balance, which z and y hold.

    bar_q -= K^T z + G_q^T y (turning loads with their sign), bar_v -= C^T z + G_v^T y.

    Constant:
      model: the compiled scene.
      workspace: the workspace, with G_q and G_v.
      k, c (n_pair, 6, 6): stiffness and damping of the balance. turn (n,): slopes of the turning loads.
      z (n,), y (n_row,): adjoint variables of the equations of motion (virtual displacements, driven parts 0) and of
        the joints' rows.
    Out:
      bar_q, bar_v (n,): cotangents of coordinates and velocities, added to.
    """
    pair = model.pair
    joint = model.joint
    matrices_vjp(pair, k, z, bar_q)
    if workspace.switches[DAMPED] != 0:
        matrices_vjp(pair, c, z, bar_v)
    turns_vjp(turn, z, bar_q)
    by_q = workspace.by_q
    by_v = workspace.by_v
    row = model.row
    for j in range(joint.shape[0]):
        one = 3 * joint[j, 1]
        two = 3 * joint[j, 2]
        for r in range(3):
            if row[j, r] >= 0:
                value = y[row[j, r]]
                for i in range(3):
                    bar_q[one + i] -= by_q[j, r, i] * value
                    bar_q[two + i] -= by_q[j, r, 3 + i] * value
                    bar_v[one + i] -= by_v[j, r, i] * value
                    bar_v[two + i] -= by_v[j, r, 3 + i] * value


@kernel
def matrices_vjp(pair, k, z, bar):
    """bar (n,) -= K^T z, K by pairs (n_pair, 6, 6)."""
    for p in range(pair.shape[0]):
        _matrix_vjp(pair, p, k[p], z, bar)


@part
def _matrix_vjp(pair, p, m, z, bar):
    """bar (n,) -= m^T z of pair p, m (6, 6)."""
    one = 3 * pair[p, 0]
    two = 3 * pair[p, 1]
    z0 = z[one]
    z1 = z[one + 1]
    z2 = z[one + 2]
    z3 = z[two]
    z4 = z[two + 1]
    z5 = z[two + 2]
    for j in range(6):
        d = one + j if j < 3 else two + j - 3
        bar[d] -= (m[0, j] * z0 + m[1, j] * z1 + m[2, j] * z2) + (m[3, j] * z3 + m[4, j] * z4 + m[5, j] * z5)


@kernel
def turns_vjp(turn, z, bar):
    """bar (n,) += (slope of the turning loads)^T z."""
    for d in range(z.shape[0]):
        bar[d - d % 3 + 2] += turn[d] * z[d]


@kernel
def carried_vjp(model, workspace, k, c, turn, z, bar_q, bar_v):
    """`accelerations_vjp` without the joints, over the pairs between which members, bushings or contacts act.

    Constant:
      model: the compiled scene.
      workspace: the workspace (`carries`, `switches`).
      k, c (n_pair, 6, 6): stiffness and damping of these pairs, without the joints'. turn (n,): slopes of the turning
        loads.
      z (n,): virtual displacements; driven parts are 0.
    Out:
      bar_q, bar_v (n,): cotangents of coordinates and velocities, added to.
    """
    damped = workspace.switches[DAMPED] != 0
    for p in range(model.pair.shape[0]):
        if workspace.carries[p] != 0:
            _matrix_vjp(model.pair, p, k[p], z, bar_q)
            if damped:
                _matrix_vjp(model.pair, p, c[p], z, bar_v)
    turns_vjp(turn, z, bar_q)


@kernel
def joints_vjp(model, workspace, q, v, a, lam, z, y, bar_q, bar_v):
    """`accelerations_vjp` of the joints alone.

    Constant:
      model: the compiled scene.
      q, v, a (n,): coordinates, velocities, accelerations (m, rad; per s; per s^2).
      lam (n_row,): multipliers (N, N m).
      z (n,), y (n_row,): adjoint variables of the equations of motion (virtual displacements, driven parts 0) and of
        the joints' rows.
    In and out:
      workspace: the workspace, with the bodies turned (`forces.turn_bodies`); k of the joints' pairs and by_q, by_v are
        overwritten.
    Out:
      bar_q, bar_v (n,): cotangents of coordinates and velocities, added to.
    """
    w = workspace.own[0]
    wd = workspace.own[1]
    wdd = workspace.own[2]
    mine = workspace.own[3]
    row = model.row
    for j in range(model.joint.shape[0]):
        code = model.joint[j, 0]
        par = model.joint_par[j]
        one = 3 * model.joint[j, 1]
        two = 3 * model.joint[j, 2]
        gather_turned(model, j, q, workspace.turned, w)
        gather(model, j, v, wd)
        gather(model, j, a, wdd)
        gather_multipliers(model, j, lam, mine)
        if joint_is_point(code):  # what other rows have is constant
            y0 = y[row[j, 0]] if row[j, 0] >= 0 else 0.0
            y1 = y[row[j, 1]] if row[j, 1] >= 0 else 0.0
            first, second, rate_first, rate_second = revolute_vjp(par, w, wd, wdd, mine, y0, y1, z[one + 2], z[two + 2])
            bar_q[one + 2] -= first
            bar_q[two + 2] -= second
            bar_v[one + 2] -= rate_first
            bar_v[two + 2] -= rate_second
            continue
        stiffness = workspace.k[model.joint[j, 3]]
        stiffness[:] = 0.0
        joint_acceleration_slopes(code, par, w, wd, wdd, workspace.by_q[j], workspace.by_v[j])
        joint_stiffness(code, par, w, mine, stiffness)
        _matrix_vjp(model.pair, model.joint[j, 3], stiffness, z, bar_q)
        for r in range(3):
            if row[j, r] >= 0:
                value = y[row[j, r]]
                for i in range(6):
                    d = one + i if i < 3 else two + i - 3
                    bar_q[d] -= workspace.by_q[j, r, i] * value
                    bar_v[d] -= workspace.by_v[j, r, i] * value


@kernel
def accelerations_jvp(model, workspace, k, c, turn, dq, dv, force, row):
    """What changes of a state do to the right side of the balance.

    force -= K dq + C dv (turning loads with their sign), row -= G_q dq + G_v dv.

    Constant:
      model: the compiled scene.
      workspace: the workspace, with G_q and G_v.
      k, c (n_pair, 6, 6): stiffness and damping of the balance. turn (n,): slopes of the turning loads.
      dq, dv (n,): changes of coordinates and velocities.
    Out:
      force (n,), row (n_row,): changes of the right side, added to.
    """
    damped = workspace.switches[DAMPED] != 0
    for p in range(model.pair.shape[0]):
        for i in range(6):
            value = 0.0
            for j in range(6):
                column = 3 * model.pair[p, j // 3] + j % 3
                value += k[p, i, j] * dq[column]
                if damped:
                    value += c[p, i, j] * dv[column]
            force[3 * model.pair[p, i // 3] + i % 3] -= value
    for d in range(dq.shape[0]):
        force[d] += turn[d] * dq[d - d % 3 + 2]
    for j in range(model.joint.shape[0]):
        for r in range(3):
            own = model.row[j, r]
            if own >= 0:
                for i in range(6):
                    column = 3 * model.joint[j, 1 + i // 3] + i % 3
                    row[own] -= workspace.by_q[j, r, i] * dq[column] + workspace.by_v[j, r, i] * dv[column]
