"""Back onto the joints after a step: the nearest state, by mass, that satisfies Phi(q) = 0 and Phi_q v = 0.

    M (q+ - q-) + Phi_q(q+)^T mu = 0,  Phi(q+) = 0;      M (v+ - v-) + Phi_q(q+)^T nu = 0,  Phi_q(q+) v+ = 0

where q- - q+ is the shift e that leads from q+ to q- (`difference`). What a step has drifted is of the order of its
error, so mu and nu are small; their terms are kept in the derivatives all the same, so that these belong to what was
computed. In space that includes how the shift itself turns: M de = M J(e)^-1 dq- - M J(e)^-T dq+ of its turns
(`add_shift_curvature`, `turn_back`). Driven coordinates are in place already and stay.
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.dynamics.accelerations import (
    NO_SHIFT,
    factor_matrix,
    gather,
    gather_multipliers,
    joint_state,
    matrices_vjp,
    solve_unknowns,
    subtract_matrices,
)
from mdstopo.general.model.general_model import JOINT_FIRST, JOINT_PAIR, JOINT_ROWS
from mdstopo.general.model.strides import pair_freedoms, place_in_joint
from mdstopo.general.model.switches import DIAGONAL
from mdstopo.mechanics.kinematics.kinematics_interface import (
    add_shift_curvature,
    difference,
    freedoms,
    joint_places,
    joint_stiffness,
    joint_velocity_slope,
    load_slopes,
    most_rows,
    moved_most,
    place_joint,
    retract,
    turn_back,
    turn_bodies,
)

#: misfit, relative to the scene, with which a joint counts as torn: its rows were taken for a repetition of others
MISFIT = 1e-7
#: corrections of the position at most; each squares the misfit
MOST_CORRECTIONS = 12
#: iterations of `solve_iteratively` at most, and the change of an iteration, relative and weighed by mass, at which
#: they have settled
ITERATIONS, SETTLED = 8, 1e-16


@kernel
def misfit(model, phi, rows):
    """Largest |Phi| of the joints (m or rad), and its place in `rows` of joint numbers."""
    worst = 0.0
    for j in range(model.joint.shape[0]):
        for r in range(model.joint[j, JOINT_ROWS]):
            if abs(phi[j, r]) > worst or np.isnan(phi[j, r]):
                worst = abs(phi[j, r])
                rows[0] = j
    return worst


@kernel
def project(model, scale, q, v, workspace, mu, nu):
    """Move a state onto the joints, to the nearest one by mass.

    Constant:
      model: the compiled scene.
      scale: size of the scene (m).
    In place:
      q (n_q,), v (n,): coordinates and velocities; driven ones are in place already.
    Out:
      workspace: workspace of a balance (`accelerations.Workspace`).
        It holds the joints at the state that was found, and the factors of their matrix.
      mu, nu (n_row,): multipliers that moved the coordinates and the velocities.

    Returns the place of the unknown at which the joints are singular, or -1; or, behind all places, the number of a
    joint that the others do not let fit.
    """
    n = v.shape[0]
    n_row = mu.shape[0]
    mu[:] = 0.0
    nu[:] = 0.0
    if n_row == 0:
        return -1
    start = q.copy()
    shift = np.empty(n)
    which = np.zeros(1, np.int64)
    none = workspace.mass
    if workspace.switches[DIAGONAL] == 0:
        none[:] = 0.0
    last = np.inf
    worst = np.inf
    moved = moved_most(model, q, scale)  # misfits are only known relative to it
    for _ in range(MOST_CORRECTIONS):
        turn_bodies(model, q, workspace.turned)
        joint_state(model, q, v, workspace)
        worst = misfit(model, workspace.phi, which)
        if worst <= 1e-15 * min(moved, scale) or not worst < last:
            break
        last = worst
        singular = factor_matrix(
            model, workspace, none, none, workspace.turn, none, 0.0, 0.0, workspace.tangents[NO_SHIFT], np.bool_(False)
        )
        if singular >= 0:
            return singular
        difference(model, start, q, shift)
        for d in range(n):
            shift[d] = model.mass[d] * shift[d]
        for j in range(model.joint.shape[0]):
            for r in range(most_rows(model)):
                if model.row[j, r] >= 0:
                    mu[model.row[j, r]] = -workspace.phi[j, r]
        solve_unknowns(model, workspace, shift, mu)
        retract(model, q, shift, q)
    else:
        turn_bodies(model, q, workspace.turned)
        joint_state(model, q, v, workspace)
    singular = factor_matrix(
        model, workspace, none, none, workspace.turn, none, 0.0, 0.0, workspace.tangents[NO_SHIFT], np.bool_(False)
    )
    if singular >= 0:
        return singular
    for d in range(n):
        shift[d] = 0.0
    for j in range(model.joint.shape[0]):
        for r in range(most_rows(model)):
            own = model.row[j, r]
            if own >= 0:
                value = 0.0
                for i in range(pair_freedoms(model)):
                    value -= workspace.jac[j, r, i] * v[place_in_joint(model, j, i)]
                nu[own] = value
    solve_unknowns(model, workspace, shift, nu)
    for d in range(n):
        v[d] += shift[d]
    return model.unknown_index.shape[0] + which[0] if worst > MISFIT * scale else -1


@kernel
def _stiffnesses(model, q, v, mu, nu, workspace, h_mu, h_nu, slope, shift):
    """How the products of Phi_q with mu, nu and v, and of the mass with the shift, change with the coordinates.

    Constant:
      model: the compiled scene.
    In:
      q, v (n,): the projected state (m, rad; m/s, rad/s).
      mu, nu (n_row,): multipliers that moved it there.
      workspace: workspace of a balance, with the bodies turned (`forces.turn_bodies`) and Phi_q.
    Out:
      h_mu, h_nu (n_pair, 2 D, 2 D): d(Phi_q^T mu)/dq and d(Phi_q^T nu)/dq of the joints of each pair; with the first
        what the shift's own turns add.
      slope (n_joint, rows, 2 D): d(Phi_q v)/dq.
      shift (n,): how far it is from here to where the state was before, M^-1 Phi_q^T mu.
    """
    w = np.empty(joint_places(model))
    wd = np.empty(pair_freedoms(model))
    mine = np.empty(most_rows(model))
    h_mu[:] = 0.0
    h_nu[:] = 0.0
    for j in range(model.joint.shape[0]):
        place_joint(model, j, q, workspace.turned, w)
        gather(model, j, v, wd)
        gather_multipliers(model, j, mu, mine)
        joint_stiffness(model, j, w, mine, h_mu[model.joint[j, JOINT_PAIR]])
        gather_multipliers(model, j, nu, mine)
        joint_stiffness(model, j, w, mine, h_nu[model.joint[j, JOINT_PAIR]])
        joint_velocity_slope(model, j, w, wd, slope[j])
    shift[:] = 0.0
    for j in range(model.joint.shape[0]):
        for r in range(most_rows(model)):
            own = model.row[j, r]
            if own >= 0:
                for i in range(pair_freedoms(model)):
                    shift[place_in_joint(model, j, i)] += workspace.jac[j, r, i] * mu[own]
    for d in range(shift.shape[0]):
        shift[d] = shift[d] / model.mass[d] if model.free[d] != 0 else 0.0
    seen = np.zeros(model.home.shape[0], np.bool_)
    for j in range(model.joint.shape[0]):
        for side in range(2):
            body = model.joint[j, JOINT_FIRST + side]
            if not seen[body] and body < shift.shape[0] // freedoms(model):  # ground stands behind the bodies
                seen[body] = True
                first = freedoms(model) * side
                add_shift_curvature(model, shift, model.mass, body, first, h_mu[model.joint[j, JOINT_PAIR]])


@kernel
def solve_iteratively(model, workspace, h, x, y):
    """Solve [M + H^T, Phi_q^T; Phi_q, 0] iteratively, with the factors for H = 0 that are in the workspace.

    H is as small as what a step has drifted, so few iterations do. Returns whether they have settled.

    h (n_pair, 2 D, 2 D): H by pairs of bodies.
    x (n,): right side, then the solution; as it was where the iterations have not settled.
    y (n_row,): right side of the rows, of the first iteration; zero afterwards.
    """
    n = x.shape[0]
    right = np.empty(n)
    last = np.empty(n)
    for d in range(n):
        right[d] = x[d]
        last[d] = 0.0
    for _ in range(ITERATIONS):
        solve_unknowns(model, workspace, x, y)
        size = 0.0
        change = 0.0
        for d in range(n):
            size = max(size, model.mass[d] * x[d] ** 2)
            change = max(change, model.mass[d] * (x[d] - last[d]) ** 2)
            last[d] = x[d]
            x[d] = right[d]
        for r in range(y.shape[0]):
            y[r] = 0.0
        if change <= SETTLED**2 * size:
            for d in range(n):
                x[d] = last[d]
            return True
        matrices_vjp(model, h, last, x)
    for d in range(n):
        x[d] = right[d]
    return False


@kernel
def project_back(model, q, v, mu, nu, workspace, bar_q, bar_v):
    """Pull cotangents of projected states back to the states before the projection.

    Constant:
      model: the compiled scene.
    In:
      q, v (n,): the projected state (m, rad; m/s, rad/s).
      mu, nu (n_row,): multipliers that moved it there.
    In place:
      bar_q, bar_v (R, n): R cotangents of coordinates and velocities.
    Out:
      workspace: workspace of a balance (`accelerations.Workspace`).
    """
    n = v.shape[0]
    count = bar_q.shape[0]
    if mu.shape[0] == 0:
        return
    n_pair = model.pair.shape[0]
    h_mu = np.empty((n_pair, pair_freedoms(model), pair_freedoms(model)))
    h_nu = np.empty((n_pair, pair_freedoms(model), pair_freedoms(model)))
    slope = np.zeros((model.joint.shape[0], most_rows(model), pair_freedoms(model)))
    y = np.zeros(mu.shape[0])
    none = workspace.mass
    if workspace.switches[DIAGONAL] == 0:
        none[:] = 0.0
    turn_bodies(model, q, workspace.turned)
    joint_state(model, q, v, workspace)
    shift = np.empty(n)
    _stiffnesses(model, q, v, mu, nu, workspace, h_mu, h_nu, slope, shift)
    factor_matrix(
        model, workspace, none, none, workspace.turn, none, 0.0, 0.0, workspace.tangents[NO_SHIFT], np.bool_(True)
    )
    left = 0
    unsettled = np.empty(count, np.int64)
    for m in range(count):
        y[:] = 0.0
        solve_unknowns(model, workspace, bar_v[m], y)
        matrices_vjp(model, h_nu, bar_v[m], bar_q[m])
        for j in range(model.joint.shape[0]):
            for r in range(most_rows(model)):
                own = model.row[j, r]
                if own >= 0:
                    for i in range(pair_freedoms(model)):
                        bar_q[m, place_in_joint(model, j, i)] -= slope[j, r, i] * y[own]
        y[:] = 0.0
        if not solve_iteratively(model, workspace, h_mu, bar_q[m], y):
            unsettled[left] = m
            left += 1
    if left > 0:
        workspace.by_q[:] = 0.0
        workspace.by_v[:] = 0.0
        factor_matrix(
            model,
            workspace,
            h_mu,
            none,
            np.zeros((n, load_slopes(model))),
            none,
            1.0,
            0.0,
            workspace.tangents[NO_SHIFT],
            np.bool_(True),
        )
        for i in range(left):
            y[:] = 0.0
            solve_unknowns(model, workspace, bar_q[unsettled[i]], y)
    for m in range(count):
        for d in range(n):
            bar_q[m, d] *= model.mass[d]
            bar_v[m, d] *= model.mass[d]
        turn_back(model, shift, np.bool_(True), bar_q[m])


@kernel
def project_forward(model, q, v, mu, nu, workspace, dq, dv):
    """Push R changes of a state through its projection.

    Constant:
      model: the compiled scene.
    In:
      q, v (n,): the projected state (m, rad; m/s, rad/s).
      mu, nu (n_row,): multipliers that moved it there.
    In place:
      dq, dv (R, n): changes of coordinates and velocities, before and then behind the projection.
    Out:
      workspace: workspace of a balance (`accelerations.Workspace`).
    """
    n = v.shape[0]
    if mu.shape[0] == 0:
        return
    n_pair = model.pair.shape[0]
    h_mu = np.empty((n_pair, pair_freedoms(model), pair_freedoms(model)))
    h_nu = np.empty((n_pair, pair_freedoms(model), pair_freedoms(model)))
    slope = np.zeros((model.joint.shape[0], most_rows(model), pair_freedoms(model)))
    y = np.zeros((dq.shape[0], mu.shape[0]))
    none = np.zeros((n_pair, pair_freedoms(model), pair_freedoms(model)))
    turn = np.zeros((n, load_slopes(model)))
    turn_bodies(model, q, workspace.turned)
    joint_state(model, q, v, workspace)
    shift = np.empty(n)
    _stiffnesses(model, q, v, mu, nu, workspace, h_mu, h_nu, slope, shift)
    workspace.by_q[:] = 0.0
    workspace.by_v[:] = 0.0
    factor_matrix(model, workspace, h_mu, none, turn, none, 1.0, 0.0, workspace.tangents[NO_SHIFT], np.bool_(False))
    for m in range(dq.shape[0]):
        turn_back(model, shift, np.bool_(False), dq[m])
        for d in range(n):
            dq[m, d] *= model.mass[d]
            dv[m, d] *= model.mass[d]
        solve_unknowns(model, workspace, dq[m], y[m])
    factor_matrix(model, workspace, none, none, turn, none, 0.0, 0.0, workspace.tangents[NO_SHIFT], np.bool_(False))
    for m in range(dq.shape[0]):
        subtract_matrices(model, h_nu, dq[m], dv[m])
        for j in range(model.joint.shape[0]):
            for r in range(most_rows(model)):
                own = model.row[j, r]
                if own >= 0:
                    value = 0.0
                    for i in range(pair_freedoms(model)):
                        value -= slope[j, r, i] * dq[m, place_in_joint(model, j, i)]
                    y[m, own] = value
        solve_unknowns(model, workspace, dv[m], y[m])
