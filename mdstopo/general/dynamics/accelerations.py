"""Accelerations and multipliers from forces, and the linear systems of everything that is derived from them.

    [M  Phi_q^T] [a  ]   [F     ]        Phi_q a + gamma = 0  is the second time derivative of Phi(q) = 0
    [Phi_q   0 ] [lam] = [-gamma]

for the free coordinates; what is driven has a known acceleration and moves to the right side. The unknowns stand in an
order in which the matrix is banded (`unknown_index`), so a chain of bodies costs what its length costs. With tangents
added,

    W(w_q, w_v) = [M + w_q K + w_v C,  Phi_q^T; Phi_q + w_q G_q + w_v G_v,  0]

is the matrix of an implicit step and, transposed, that of the reverse sweep. Without tangents, and without inerters,
only a matrix of the joints is factorised (`joint_matrix`). K holds the stiffness of members, loads,
joints (d(Phi_q^T lam)/dq) and inerters, G_q and G_v the slopes of Phi_q a + gamma.
"""

from typing import Any

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.general.dynamics.forces import add_inerters, add_tangents_of_inerters, general_forces
from mdstopo.general.dynamics.joint_matrix import (
    SINGULAR,
    factor_joints,
    set_inverse_masses,
    solve_joints,
    spread_masses,
)
from mdstopo.general.model.bundles import bundle
from mdstopo.general.model.general_model import JOINT_FIRST, JOINT_PAIR, JOINT_SECOND
from mdstopo.general.model.strides import (
    first_freedom,
    is_spatial,
    pair_freedoms,
    place_in_joint,
    place_in_pair,
    place_of_turn,
    sums_size,
)
from mdstopo.general.model.switches import (
    APART,
    BOTH,
    DAMPED,
    DIAGONAL,
    OF_JOINTS,
    SECOND,
    SWITCHES,
    THOROUGH,
    TURNING,
    movers_of,
    set_carriers,
    set_switches,
)
from mdstopo.integrators.banded import factorise, solve
from mdstopo.integrators.runge_kutta_tables import STAGES
from mdstopo.mechanics.kinematics.kinematics_interface import (
    attitude,
    drive_acceleration,
    drive_state,
    freedoms,
    joint_acceleration_slopes,
    joint_gamma,
    joint_is_point,
    joint_places,
    joint_rows,
    joint_stiffness,
    load_slopes,
    most_rows,
    pair_matrix_vjp,
    pair_pose_vjp,
    place_joint,
    places_points,
    point_joint_vjp,
    pose_size,
    rotations,
    shift_size,
    shift_tangents,
    slope_by_shift,
    turn_slope_by_shift,
)

#: what the solution at one state needs and leaves: attitudes, relative poses, sums, forces, K, C, slope
#: of turning loads, inerters' mass; of the joints Phi, Phi_q, gamma, G_q, G_v; the banded matrix with its pivots,
#: right side and the scales of its unknowns, which make every row about 1 whatever the masses; of the joints' matrix
#: the inverse masses, by coordinates and by slopes, Phi_q M^-1, the factors and the diagonal; of each joint its own
#: coordinates, their derivatives and multipliers, and its stiffness (`place_joints`), behind all room for those of one;
#: the known accelerations of what is driven; which bodies of each pair move, which pairs carry more than joints, and
#: the switches (`switches`); what kinematics keep of the stages of a step (`stage_state`); how turns change with a
#: shift of none, and with that of an implicit step (`shift_tangents`)
FIELDS = (
    "turned", "rel", "sums", "f", "k", "c", "turn", "mass", "phi", "jac", "gamma", "by_q", "by_v", "band", "pivots",
    "x", "scale", "inverse", "spread", "pull", "gram", "diagonal", "own", "stiffness", "known", "moves",
    "carries", "switches", "slopes", "tangents",
)  # fmt: skip


class Workspace:
    """The workspace for one state, whose arrays `FIELDS` names; made in kernels only, by `make_workspace`."""

    def __init__(self, *_arrays: Any) -> None: ...


bundle(Workspace, FIELDS)
#: of `tangents`: coordinates that change by themselves, and by the shift of an implicit step
NO_SHIFT, OF_STEP = range(2)


@kernel
def make_workspace(model):
    """A workspace for one state, in three pieces: forty would take two microseconds to make."""
    n = model.mass.shape[0]
    both = pair_freedoms(model)
    rows = most_rows(model)
    of_pair = pose_size(model) + sums_size(model) + 3 * both * both
    of_joint = (2 + 5 * both) * rows + both * both + 4 * joint_places(model)
    of_body = attitude(model) + 2 * shift_size(model)
    room = np.zeros(
        model.pair.shape[0] * of_pair
        + model.joint.shape[0] * of_joint
        + model.home.shape[0] * of_body
        + n * (3 + load_slopes(model) + _kept_stages(model))
        + 4 * joint_places(model)
        + model.size[3]
        + 2 * model.unknown_index.shape[0]
        + 2 * model.size[0]
    )
    solved = model.size[0]
    for d in range(n):
        solved += model.free[d]
    numbers = np.zeros(SWITCHES + 2 * model.pair.shape[0] + solved, np.int64)
    workspace = _carve_workspace(model, room, np.empty((solved, 3 * model.size[1] + 1)), numbers)
    _set_scales(model, workspace.scale)
    set_inverse_masses(model, workspace.inverse)
    spread_masses(model, workspace.inverse, workspace.spread)
    workspace.diagonal[:] = 1.0
    for p in range(model.pair.shape[0]):
        workspace.moves[p] = movers_of(model, p)
    set_carriers(model, workspace.carries)
    set_switches(model, workspace.switches)
    shift_tangents(model, model.q0, model.q0, workspace.tangents[NO_SHIFT])
    return workspace


@part
def _kept_stages(model):
    """Of how many stages of a step `Workspace.slopes` are."""
    return max(STAGES) if is_spatial(model) else 0


@kernel
def _carve_workspace(model, room, band, numbers):
    """A `Workspace` whose arrays but the band lie behind each other in `room`, those of integers in `numbers`.

    It is a function of its own because of compile time: no references are counted of arrays that are cut out of one
    that is given. Where the array is made, counting them would be most of the code.

    model: the compiled scene. room: zeros. band: the workspace's banded matrix. numbers: zeros.
    """
    n = model.mass.shape[0]
    bodies = model.home.shape[0]
    n_pair = model.pair.shape[0]
    n_joint = model.joint.shape[0]
    both = pair_freedoms(model)
    rows = most_rows(model)
    turned = bodies * attitude(model)
    rel = turned + n_pair * pose_size(model)
    sums = rel + n_pair * sums_size(model)
    f = sums + n
    k = f + n_pair * both * both
    c = k + n_pair * both * both
    mass = c + n_pair * both * both
    turn = mass + n * load_slopes(model)
    known = turn + n
    phi = known + n_joint * rows
    gamma = phi + n_joint * rows
    jac = gamma + n_joint * rows * both
    by_q = jac + n_joint * rows * both
    by_v = by_q + n_joint * rows * both
    pull = by_v + n_joint * rows * both
    stiffness = pull + n_joint * both * both
    own = stiffness + (n_joint + 1) * 4 * joint_places(model)
    gram = own + model.size[3]
    x = gram + model.unknown_index.shape[0]
    slopes = x + _kept_stages(model) * n
    tangents = slopes + 2 * bodies * shift_size(model)
    scale = tangents + model.unknown_index.shape[0]
    inverse = scale + n
    spread = inverse + n_joint * rows * both
    moves = SWITCHES + n_pair
    carries = moves + n_pair
    return Workspace(
        room[:turned].reshape((bodies, attitude(model))),
        room[turned:rel].reshape((n_pair, pose_size(model))),
        room[rel:sums].reshape((n_pair, sums_size(model))),
        room[sums:f],
        room[f:k].reshape((n_pair, both, both)),
        room[k:c].reshape((n_pair, both, both)),
        room[mass:turn].reshape((n, load_slopes(model))),
        room[c:mass].reshape((n_pair, both, both)),
        room[known:phi].reshape((n_joint, rows)),
        room[gamma:jac].reshape((n_joint, rows, both)),
        room[phi:gamma].reshape((n_joint, rows)),
        room[jac:by_q].reshape((n_joint, rows, both)),
        room[by_q:by_v].reshape((n_joint, rows, both)),
        band,
        numbers[carries:],
        room[gram:x],
        room[tangents:scale],
        room[scale:inverse],
        room[inverse:spread].reshape((n_joint, rows, both)),
        room[by_v:pull].reshape((n_joint, rows, both)),
        room[own:gram],
        room[spread:].reshape((2, model.size[0])),
        room[stiffness:own].reshape((n_joint + 1, 4, joint_places(model))),
        room[pull:stiffness].reshape((n_joint, both, both)),
        room[turn:known],
        numbers[SWITCHES:moves],
        numbers[moves:carries],
        numbers[:SWITCHES],
        room[x:slopes].reshape((_kept_stages(model), n)),
        room[slopes:tangents].reshape((2, bodies, shift_size(model))),
    )


@kernel
def _set_scales(model, scale):
    """scale (n_place,) = 1/sqrt(mass) of free coordinates, so that their diagonal is about 1; 1 of all else."""
    scale[:] = 1.0
    for d in range(model.mass.shape[0]):
        if model.free[d] != 0:
            scale[model.unknown_index[d]] = 1.0 / np.sqrt(model.mass[d])


@part
def gather(model, j, x, out):
    """Copy the entries of x (n,) that belong to the two bodies of joint j into out (2 D,)."""
    each = freedoms(model)
    a = first_freedom(model, model.joint[j, JOINT_FIRST])
    b = first_freedom(model, model.joint[j, JOINT_SECOND])
    for i in range(each):
        out[i] = x[a + i]
        out[each + i] = x[b + i]


@part
def gather_multipliers(model, j, lam, out):
    """Copy the multipliers of joint j from lam (n_row,) into out (rows,); 0 for rows that are left out."""
    for r in range(most_rows(model)):
        i = model.row[j, r]
        out[r] = lam[i] if i >= 0 else 0.0


@kernel
def joint_state(model, q, v, workspace):
    """Phi, Phi_q and gamma of all joints of bodies that are turned in the workspace (`forces.turn_bodies`)."""
    own = workspace.own[model.joint.shape[0]]
    w = own[0]
    wd = own[1]
    for j in range(model.joint.shape[0]):
        place_joint(model, j, q, workspace.turned, w)
        gather(model, j, v, wd)
        joint_rows(model, j, w, workspace.phi[j], workspace.jac[j])
        joint_gamma(model, j, w, wd, workspace.gamma[j])


@kernel
def joint_slopes(model, q, v, a, lam, workspace):
    """G_q and G_v of all joints, and their stiffness added to K.

    Constant:
      model: the compiled scene.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      lam (n_row,): multipliers (N, N m).
    In and out:
      workspace: the workspace, with the bodies turned (`forces.turn_bodies`); by_q, by_v are set, k is added to.
    """
    own = workspace.own[model.joint.shape[0]]
    w = own[0]
    wd = own[1]
    wdd = own[2]
    mine = own[3]
    for j in range(model.joint.shape[0]):
        place_joint(model, j, q, workspace.turned, w)
        gather(model, j, v, wd)
        gather(model, j, a, wdd)
        gather_multipliers(model, j, lam, mine)
        joint_acceleration_slopes(model, j, w, wd, wdd, workspace.by_q[j], workspace.by_v[j])
        joint_stiffness(model, j, w, mine, workspace.k[model.joint[j, JOINT_PAIR]])


@kernel
def factor_matrix(model, workspace, k, c, turn, mass, w_q, w_v, tangents, transposed):
    """Factorise W(w_q, w_v), or its transpose, for `solve_unknowns`.

    Constant:
      model: the compiled scene.
      k, c (n_pair, 2 D, 2 D): stiffness and damping of the balance; read where a weight is not zero, as turn is.
      turn (n, `load_slopes`): slopes of the turning loads by the turns of their bodies.
      mass (n_pair, 2 D, 2 D): mass of the inerters (kg, kg m, kg m^2).
      w_q, w_v: weights of K with G_q (s^2), and of C with G_v (s).
      tangents (n_body, SHIFT): K and G_q are those by a shift whose turns change so (`shift_tangents`).
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
    for j in range(model.joint.shape[0]):
        for r in range(most_rows(model)):
            if model.row[j, r] >= 0:
                size = 0.0
                for i in range(pair_freedoms(model)):
                    column = place_in_joint(model, j, i)
                    if model.free[column] != 0:
                        size += workspace.jac[j, r, i] ** 2 / model.mass[column]
                scale[model.unknown_index[n + model.row[j, r]]] = 1.0 / np.sqrt(size) if size > 0.0 else 1.0
    for d in range(n):
        if model.free[d] == 0:
            continue
        p = model.unknown_index[d]
        band[p, half] = 1.0
        if tangent:
            for r in range(rotations(model)):
                angle = place_of_turn(model, d, r)
                slope = turn_slope_by_shift(model, turn, d, r, tangents, d // freedoms(model))
                if model.free[angle] != 0 and slope != 0.0:
                    put(band, half, scale, p, model.unknown_index[angle], -w_q * slope, transposed)
            for r in range(rotations(model), load_slopes(model)):
                angle = place_of_turn(model, d, r - rotations(model))
                if model.free[angle] != 0 and turn[d, r] != 0.0:
                    put(band, half, scale, p, model.unknown_index[angle], -w_v * turn[d, r], transposed)
    each = freedoms(model)
    inertial = workspace.switches[DIAGONAL] == 0
    for p in range(model.pair.shape[0]):
        for one in range(2):
            for other in range(2):
                body = model.pair[p, other]
                row = first_freedom(model, model.pair[p, one])
                column = first_freedom(model, body)
                for i in range(each):
                    if model.free[row + i] == 0:
                        continue
                    row_at = each * one + i
                    for j in range(each):
                        if model.free[column + j] == 0:
                            continue
                        column_at = each * other + j
                        value = mass[p, row_at, column_at] if inertial else 0.0
                        if tangent:
                            value += w_q * slope_by_shift(model, k, p, row_at, column_at, tangents, body)
                            if damped:
                                value += w_v * c[p, row_at, column_at]
                        if value != 0.0:
                            at = model.unknown_index[row + i]
                            put(band, half, scale, at, model.unknown_index[column + j], value, transposed)
    for j in range(model.joint.shape[0]):
        for r in range(most_rows(model)):
            own = model.row[j, r]
            if own < 0:
                continue
            at = model.unknown_index[n + own]
            for i in range(pair_freedoms(model)):
                column = place_in_joint(model, j, i)
                if model.free[column] == 0:
                    continue
                there = model.unknown_index[column]
                force = workspace.jac[j, r, i]
                value = force
                if tangent:
                    body = column // freedoms(model)
                    by_q = slope_by_shift(model, workspace.by_q, j, r, i, tangents, body)
                    value += w_q * by_q + w_v * workspace.by_v[j, r, i]
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
        p = model.unknown_index[d]
        x[p] = a[d] * workspace.scale[p] if model.free[d] != 0 else 0.0
    for r in range(lam.shape[0]):
        p = model.unknown_index[n + r]
        x[p] = lam[r] * workspace.scale[p]
    solve(workspace.band, model.size[1], workspace.pivots, x)
    for d in range(n):
        p = model.unknown_index[d]
        a[d] = x[p] * workspace.scale[p]
    for r in range(lam.shape[0]):
        p = model.unknown_index[n + r]
        lam[r] = x[p] * workspace.scale[p]


@kernel
def apply_mass(model, workspace, x, out):
    """out (n,) = M x, the matrix of mass with that of inerters.

    model: the compiled scene.
    workspace: the workspace, with the inertances of the balance.
    x (n,): accelerations, or alike.
    """
    for d in range(x.shape[0]):
        out[d] = model.mass[d] * x[d]
    if workspace.switches[DIAGONAL] != 0:
        return
    for p in range(model.pair.shape[0]):
        for i in range(pair_freedoms(model)):
            total = 0.0
            for j in range(pair_freedoms(model)):
                total += workspace.mass[p, i, j] * x[place_in_pair(model, p, j)]
            out[place_in_pair(model, p, i)] += total


@kernel
def newton_correction(model, workspace, w_q, w_v, off, change, row):
    """The change of accelerations in Newton's iteration for an implicit stage: W x = M off, Phi_q x = Phi_q off.

    Constant:
      model: the compiled scene.
    In:
      w_q, w_v: by how much the stage's coordinates (s^2) and velocities (s) change with its accelerations.
      off (n,): accelerations of the balance, less those that the stage has.
    In place:
      workspace: the workspace, with the balance and its tangents, and those of the shift (`shift_tangents`); the
        factors of W come onto it.
    Out:
      change (n,), row (n_row,): what is added to accelerations and multipliers; driven parts are 0.
    """
    apply_mass(model, workspace, off, change)
    row[:] = 0.0
    for j in range(model.joint.shape[0]):
        for r in range(most_rows(model)):
            if model.row[j, r] >= 0:
                for i in range(pair_freedoms(model)):
                    row[model.row[j, r]] += workspace.jac[j, r, i] * off[place_in_joint(model, j, i)]
    factor_matrix(
        model, workspace, workspace.k, workspace.c, workspace.turn, workspace.mass, w_q, w_v,
        workspace.tangents[OF_STEP], np.bool_(False),
    )  # fmt: skip
    solve_unknowns(model, workspace, change, row)


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
      q (n_q,), v (n,): coordinates and velocities; their driven part is put in place first.
      workspace: the workspace; forces, poses, the joints' rows and the factors stay on it.
    Out:
      a (n,): accelerations (m/s^2, rad/s^2).
      lam (n_row,): multipliers (N, N m).

    Returns the place of the unknown at which the joints are singular, or -1.
    """
    n = v.shape[0]
    drive_state(model, segment, t, q, v)
    general_forces(model, member_state, segment, t, q, v, tangent, workspace)
    if workspace.switches[DIAGONAL] == 0:
        add_inerters(model, segment, member_state, q, v, workspace.mass, workspace.f)
    joint_state(model, q, v, workspace)
    singular = factor_matrix(
        model,
        workspace,
        workspace.k,
        workspace.c,
        workspace.turn,
        workspace.mass,
        0.0,
        0.0,
        workspace.tangents[NO_SHIFT],
        np.bool_(False),
    )
    if singular >= 0:
        return singular
    known = workspace.known  # zero but for what is driven
    drive_acceleration(model, segment, t, known)
    force = workspace.f
    for d in range(n):
        a[d] = force[d]
    if model.driven.shape[0] > 0 and workspace.switches[DIAGONAL] == 0:
        for p in range(model.pair.shape[0]):
            for i in range(pair_freedoms(model)):
                row = place_in_pair(model, p, i)
                for j in range(pair_freedoms(model)):
                    a[row] -= workspace.mass[p, i, j] * known[place_in_pair(model, p, j)]
    each = freedoms(model)
    joint = model.joint
    row = model.row
    gamma = workspace.gamma
    jac = workspace.jac
    for j in range(joint.shape[0]):
        one = each * joint[j, JOINT_FIRST]
        two = each * joint[j, JOINT_SECOND]
        for r in range(most_rows(model)):
            if row[j, r] >= 0:
                value = -gamma[j, r]
                if model.driven.shape[0] > 0:
                    for i in range(each):
                        value -= jac[j, r, i] * known[one + i] + jac[j, r, each + i] * known[two + i]
                lam[row[j, r]] = value
    solve_unknowns(model, workspace, a, lam)
    for i in range(model.driven.shape[0]):
        a[model.driven[i]] = known[model.driven[i]]
    if tangent:
        if workspace.switches[APART] == 0:
            joint_slopes(model, q, v, a, lam, workspace)
        if workspace.switches[DIAGONAL] == 0:
            add_tangents_of_inerters(model, segment, member_state, q, v, a, workspace.k, workspace.c)
    return -1


@kernel
def accelerations_vjp(model, workspace, k, c, turn, z, y, bar_q, bar_v):
    """Pull cotangents of accelerations and multipliers back to those of coordinates and velocities; z and y are
    their adjoint variables.

    bar_q -= K^T z + G_q^T y (turning loads with their sign), bar_v -= C^T z + G_v^T y.

    Constant:
      model: the compiled scene.
      workspace: the workspace, with G_q and G_v.
      k, c (n_pair, 2 D, 2 D): stiffness and damping of the balance.
      turn (n, `load_slopes`): slopes of the loads by turns and turning rates.
      z (n,), y (n_row,): adjoint variables of the equations of motion (virtual displacements, driven parts 0) and of
        the joints' rows.
    Out:
      bar_q, bar_v (n,): cotangents of coordinates and velocities, added to.
    """
    joint = model.joint
    each = freedoms(model)
    pairs_vjp(model, workspace, workspace.moves, k, c, z, bar_q, bar_v)
    if workspace.switches[TURNING] != 0:
        turns_vjp(model, turn, z, bar_q, bar_v)
    by_q = workspace.by_q
    by_v = workspace.by_v
    row = model.row
    for j in range(joint.shape[0]):
        one = each * joint[j, JOINT_FIRST]
        two = each * joint[j, JOINT_SECOND]
        for r in range(most_rows(model)):
            if row[j, r] >= 0:
                value = y[row[j, r]]
                for i in range(each):
                    bar_q[one + i] -= by_q[j, r, i] * value
                    bar_q[two + i] -= by_q[j, r, each + i] * value
                    bar_v[one + i] -= by_v[j, r, i] * value
                    bar_v[two + i] -= by_v[j, r, each + i] * value


@kernel
def matrices_vjp(model, k, z, bar):
    """bar (n,) -= K^T z, K by pairs (n_pair, 2 D, 2 D)."""
    for p in range(model.pair.shape[0]):
        pair_matrix_vjp(model, p, k[p], z, bar)


@part
def body_matrix_vjp(model, p, side, m, z, bar):
    """bar (n,) -= M^T z, of M of a pair the part of one of its bodies alone: the other one is held.

    model: the compiled scene.
    p, side: the pair, and which of its bodies moves (0, 1).
    m (2 D, 2 D): M.
    z (n,): what is multiplied.
    bar (n,): subtracted from.
    """
    at = first_freedom(model, model.pair[p, side])
    own = freedoms(model) * side
    for j in range(freedoms(model)):
        value = m[own, own + j] * z[at]
        for i in range(1, freedoms(model)):
            value += m[own + i, own + j] * z[at + i]
        bar[at + j] -= value


@kernel
def subtract_matrices(model, k, x, out):
    """out (n,) -= K x, K by pairs (n_pair, 2 D, 2 D)."""
    for p in range(model.pair.shape[0]):
        for i in range(pair_freedoms(model)):
            value = k[p, i, 0] * x[place_in_pair(model, p, 0)]
            for j in range(1, pair_freedoms(model)):
                value += k[p, i, j] * x[place_in_pair(model, p, j)]
            out[place_in_pair(model, p, i)] -= value


@kernel
def turns_vjp(model, turn, z, bar_q, bar_v):
    """bar_q, bar_v (n,) += (slopes of the loads)^T z, turn (n, `load_slopes`) by turns, then by turning rates."""
    turns = rotations(model)
    for first in range(0, z.shape[0], freedoms(model)):
        own = first + freedoms(model) - turns
        for r in range(turns):
            value = bar_q[own + r]
            for d in range(first, first + freedoms(model)):
                value += turn[d, r] * z[d]
            bar_q[own + r] = value
        for r in range(turns, load_slopes(model)):
            value = bar_v[own + r - turns]
            for d in range(first, first + freedoms(model)):
                value += turn[d, r] * z[d]
            bar_v[own + r - turns] = value


@kernel
def carried_vjp(model, workspace, k, c, turn, z, bar_q, bar_v):
    """`accelerations_vjp` without the joints, over the pairs between which members, bushings or contacts act.

    Constant:
      model: the compiled scene.
      workspace: the workspace (`carries`, `switches`).
      k, c (n_pair, 2 D, 2 D): stiffness and damping of these pairs, without the joints'.
      turn (n, `load_slopes`): slopes of the turning loads.
      z (n,): virtual displacements; driven parts are 0.
    Out:
      bar_q, bar_v (n,): cotangents of coordinates and velocities, added to.
    """
    pairs_vjp(model, workspace, workspace.carries, k, c, z, bar_q, bar_v)
    if workspace.switches[TURNING] != 0:
        turns_vjp(model, turn, z, bar_q, bar_v)


@kernel
def poses_vjp(model, workspace, rel, sums, z, bar_q):
    """`carried_vjp` without the loads, of poses and sums over members, where nothing is damped.

    Constant:
      model: the compiled scene.
      workspace: the workspace (`carries`).
      rel (n_pair, POSE), sums (n_pair, SUMS): of these pairs.
      z (n,): virtual displacements; driven parts are 0.
    Out:
      bar_q (n,): cotangents of coordinates, added to.
    """
    for p in range(model.pair.shape[0]):
        if workspace.carries[p] != 0:
            pair_pose_vjp(model, p, rel, sums, z, bar_q)


@kernel
def pairs_vjp(model, workspace, moves, k, c, z, bar_q, bar_v):
    """bar_q (n,) -= K^T z and, where anything is damped, bar_v (n,) -= C^T z, of the bodies that move.

    Constant:
      model: the compiled scene.
      workspace: the workspace (`switches`).
      moves (n_pair,): which bodies of each pair move (`switches.movers_of`); 0: the pair is left out.
      k, c (n_pair, 2 D, 2 D): K and C by pairs.
      z (n,): virtual displacements; driven parts are 0.
    Out:
      bar_q, bar_v (n,): subtracted from.
    """
    damped = workspace.switches[DAMPED] != 0
    for p in range(model.pair.shape[0]):
        if moves[p] == BOTH:
            pair_matrix_vjp(model, p, k[p], z, bar_q)
            if damped:
                pair_matrix_vjp(model, p, c[p], z, bar_v)
        elif moves[p] != 0:
            side = 1 if moves[p] == SECOND else 0
            body_matrix_vjp(model, p, side, k[p], z, bar_q)
            if damped:
                body_matrix_vjp(model, p, side, c[p], z, bar_v)


@kernel
def place_joints(model, workspace, q, v, a, lam):
    """Compute what `joints_vjp` needs of the joints at one state.

    model: the compiled scene.
    workspace: the workspace, with the bodies turned (`forces.turn_bodies`); own, stiffness, by_q and by_v are set.
    q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    lam (n_row,): multipliers (N, N m).
    """
    for j in range(model.joint.shape[0]):
        if joint_is_point(model, j) and not places_points(model):
            continue
        w = workspace.own[j, 0]
        wd = workspace.own[j, 1]
        wdd = workspace.own[j, 2]
        mine = workspace.own[j, 3]
        place_joint(model, j, q, workspace.turned, w)
        gather(model, j, v, wd)
        gather(model, j, a, wdd)
        gather_multipliers(model, j, lam, mine)
        if not joint_is_point(model, j):
            stiffness = workspace.stiffness[j]
            stiffness[:] = 0.0
            joint_acceleration_slopes(model, j, w, wd, wdd, workspace.by_q[j], workspace.by_v[j])
            joint_stiffness(model, j, w, mine, stiffness)


@kernel
def joints_vjp(model, workspace, v, a, lam, z, y, bar_q, bar_v):
    """`accelerations_vjp` of the joints alone.

    Constant:
      model: the compiled scene.
      workspace: the workspace, with the bodies turned and the joints placed (`place_joints`).
      v, a (n,), lam (n_row,): velocities, accelerations and multipliers at the state.
      z (n,), y (n_row,): adjoint variables of the equations of motion (virtual displacements, driven parts 0) and of
        the joints' rows.
    Out:
      bar_q, bar_v (n,): cotangents of coordinates and velocities, added to.
    """
    row = model.row
    for j in range(model.joint.shape[0]):
        if joint_is_point(model, j):
            point_joint_vjp(model, j, workspace.own[j], workspace.turned, v, a, lam, z, y, bar_q, bar_v)
            continue
        pair_matrix_vjp(model, model.joint[j, JOINT_PAIR], workspace.stiffness[j], z, bar_q)
        for r in range(most_rows(model)):
            if row[j, r] >= 0:
                value = y[row[j, r]]
                for i in range(pair_freedoms(model)):
                    d = place_in_joint(model, j, i)
                    bar_q[d] -= workspace.by_q[j, r, i] * value
                    bar_v[d] -= workspace.by_v[j, r, i] * value


@kernel
def accelerations_jvp(model, workspace, k, c, turn, dq, dv, force, row):
    """Push changes of coordinates and velocities to changes of the right side of the equations of motion.

    force -= K dq + C dv (turning loads with their sign), row -= G_q dq + G_v dv.

    Constant:
      model: the compiled scene.
      workspace: the workspace, with G_q and G_v.
      k, c (n_pair, 2 D, 2 D): stiffness and damping of the balance.
      turn (n, `load_slopes`): slopes of the loads by turns and turning rates.
      dq, dv (n,): changes of coordinates and velocities.
    Out:
      force (n,), row (n_row,): changes of the right side, added to.
    """
    damped = workspace.switches[DAMPED] != 0
    each = freedoms(model)
    for p in range(model.pair.shape[0]):
        for i in range(pair_freedoms(model)):
            value = 0.0
            for side in range(2):
                first = place_in_pair(model, p, side * each)
                for j in range(each):
                    value += k[p, i, side * each + j] * dq[first + j]
                    if damped:
                        value += c[p, i, side * each + j] * dv[first + j]
            force[place_in_pair(model, p, i)] -= value
    for d in range(dq.shape[0] if workspace.switches[TURNING] != 0 else 0):
        for r in range(rotations(model)):
            force[d] += turn[d, r] * dq[place_of_turn(model, d, r)]
        for r in range(rotations(model), load_slopes(model)):
            force[d] += turn[d, r] * dv[place_of_turn(model, d, r - rotations(model))]
    for j in range(model.joint.shape[0]):
        for r in range(most_rows(model)):
            own = model.row[j, r]
            if own >= 0:
                for i in range(pair_freedoms(model)):
                    column = place_in_joint(model, j, i)
                    row[own] -= workspace.by_q[j, r, i] * dq[column] + workspace.by_v[j, r, i] * dv[column]
