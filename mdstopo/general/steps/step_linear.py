"""Stages and Runge-Kutta steps of a general scene, linearised: what reverse and tangent steps are made of."""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.general.dynamics.accelerations import (
    NO_SHIFT,
    OF_STEP,
    accelerations_jvp,
    accelerations_vjp,
    carried_vjp,
    factor_matrix,
    joint_slopes,
    joint_state,
    joints_vjp,
    place_joints,
    poses_vjp,
    solve_unknowns,
)
from mdstopo.general.dynamics.joint_matrix import solve_joints
from mdstopo.general.dynamics.projection import project_back, project_forward
from mdstopo.general.model.switches import DAMPED, TURNING
from mdstopo.general.steps.method_interface import is_explicit
from mdstopo.general.steps.step_history import FIRST, SEGMENT, copy_carried, has_factors, has_poses, mass_of
from mdstopo.general.steps.step_inside import table_of_step
from mdstopo.integrators.runge_kutta_tables import AA, A
from mdstopo.integrators.steps import REVERSE
from mdstopo.mechanics.kinematics.kinematics_interface import (
    add_shift,
    end_jvp,
    load_tangent,
    loads_vjp,
    pair_tangent,
    stage_jvp,
    stage_vjp,
    start_vjp,
    turn_bodies,
)
from mdstopo.mechanics.kinematics.planar_poses import copy_rows

#: change of an iteration of the iterative method, relative, at which it has settled
SETTLED = 1e-12


@kernel
def lay_out(model, history, segment, o, workspace):
    """Put the joints of stage o, with their slopes, into the workspace. Returns K and C of the stage.

    model: the compiled scene. history: the history of steps (`StepHistory`).
    segment, o: the segment of `model.times` that the stage is in, and its number.
    workspace: workspace of a balance, which takes slopes of the loads, too, where they are not kept (`load_slopes_of`).
    """
    q = history.stage_q[o]
    v = history.stage_v[o]
    if has_factors(history):
        copy_rows(history.turned[o], workspace.turned)
        workspace.k[:] = 0.0
        workspace.c[:] = 0.0
        for p in range(model.pair.shape[0]):
            if has_poses(history):
                if workspace.carries[p] != 0:
                    no = np.bool_(False)
                    pair_tangent(model, p, history.rel[o], history.sums[o], no, workspace.k, workspace.c)
                continue
            copy_carried(workspace.carries[p], history.K[o, p], workspace.k[p])
            if workspace.switches[DAMPED] != 0:
                copy_carried(workspace.carries[p], history.C[o, p], workspace.c[p])
        k = workspace.k
        c = workspace.c
        if has_poses(history) and workspace.switches[TURNING] != 0:
            load_tangent(model, segment, history.when[o], q, v, workspace.turn)
    else:
        k = history.K[o]
        c = history.C[o]
        turn_bodies(model, q, workspace.turned)
        joint_state(model, q, v, workspace)
    joint_slopes(model, q, v, history.stage_a[o], history.lam[o], workspace)
    return k, c


@part
def load_slopes_of(history, o, workspace):
    """(n, `load_slopes`): slopes of the loads at stage o, which `lay_out` has put into the workspace.

    history: the history of steps (`StepHistory`). workspace: workspace of a balance.
    """
    return workspace.turn if has_poses(history) else history.turn[o]


@kernel
def prepare_stage_back(model, history, segment, o, w_q, w_v, workspace):
    """Prepare a stage for `stage_back`: once for any number of rows.

    model: the compiled scene.
    history: the history of steps (`StepHistory`).
    segment, o: the segment of `model.times` that the stage is in, and its number.
    w_q, w_v: weights of the stiffness (s^2) and the damping (s); 0 where factors are kept.
    workspace: workspace of a balance, which takes what is prepared.
    """
    if has_factors(history):
        copy_rows(history.turned[o], workspace.turned)
        place_joints(model, workspace, history.stage_q[o], history.stage_v[o], history.stage_a[o], history.lam[o])
        return
    k, c = lay_out(model, history, segment, o, workspace)
    factor_matrix(
        model, workspace, k, c, history.turn[o], mass_of(history, o), w_q, w_v,
        workspace.tangents[OF_STEP], np.bool_(True),
    )  # fmt: skip


@kernel
def stage_back(model, history, segment, o, workspace, z, y, bar_q, bar_v):
    """Pull cotangents of a stage's accelerations and multipliers back to its coordinates and velocities.

    Constant:
      model: the compiled scene.
      history: the history of steps (`StepHistory`).
    In:
      segment, o: the segment of `model.times` that the stage is in, and its number; it was prepared last
        (`prepare_stage_back`).
      workspace: workspace of a balance, with what was prepared.
    In place:
      z (n,), y (n_row,): cotangents of accelerations and multipliers, then the virtual displacement of the balance and
        what belongs to it in the rows.
    Out:
      bar_q, bar_v (n,): cotangents of coordinates and velocities, added to.
    """
    if has_factors(history):
        solve_joints(model, workspace.inverse, history.pull[o], history.gram[o], history.diagonal[o], workspace.x, z, y)
        if has_poses(history):
            poses_vjp(model, workspace, history.rel[o], history.sums[o], z, bar_q)
            if workspace.switches[TURNING] != 0:
                q = history.stage_q[o]
                loads_vjp(model, segment, history.when[o], q, history.stage_v[o], z, bar_q, bar_v)
        else:
            carried_vjp(model, workspace, history.K[o], history.C[o], history.turn[o], z, bar_q, bar_v)
        v = history.stage_v[o]
        joints_vjp(model, workspace, v, history.stage_a[o], history.lam[o], z, y, bar_q, bar_v)
        return
    solve_unknowns(model, workspace, z, y)
    accelerations_vjp(model, workspace, history.K[o], history.C[o], history.turn[o], z, y, bar_q, bar_v)


@kernel
def own_weights(tag, table, j, h):
    """By how much coordinates (s^2) and velocities (s) of stage j change with its own accelerations: 0 if explicit.

    tag: the method of integration (`method_interface`).
    table (3, 17, 17): coefficients of the method.
    j, h: the stage, and the length of the step (s).
    """
    if is_explicit(tag):
        return 0.0, 0.0
    return h * h * table[AA, j, j], h * table[A, j, j]


@kernel
def steps_back(tag, model, tables, history, w, bars, rows_bar, lam_q, lam_v, z, y, workspace, work):
    """Pull R cotangents of the end of a Runge-Kutta step back to its start.

    Constant:
      tag: the method of integration (`method_interface`).
      model: the compiled scene.
      tables (2, 3, 17, 17): coefficients of both methods (`integrators.runge_kutta_tables`).
      history: the history of steps (`StepHistory`).
    In:
      w: number of the step.
      bars (s, 3, n), rows_bar (s, n_row): explicit cotangents of the stages' q, v, a and multipliers, the same for
        all R; no rows: none.
    In place:
      lam_q, lam_v (R, n): cotangents of coordinates and velocities.
    Out:
      z (R, s or more, n): virtual displacements of the stages' balances.
      y (n_row,): scratch.
      workspace: workspace of a balance (`accelerations.Workspace`).
      work (WORK,): counts of work, added to.
    """
    count, n = lam_q.shape
    table, s = table_of_step(tag, model, tables, history, w)
    o = history.index[w, FIRST]
    segment = history.index[w, SEGMENT]
    h = history.t[w + 1] - history.t[w]
    work[REVERSE] += count
    push = history.push[w + 1]
    project_back(model, history.q[w + 1], history.v[w + 1], push[0], push[1], workspace, lam_q, lam_v)
    q = history.stage_q[o : o + s]
    v = history.stage_v[o : o + s]
    u = np.zeros((count, s, n))
    g = np.zeros((count, s, n))
    turns = np.empty((s, n))
    for back in range(s):
        j = s - 1 - back
        w_q, w_v = own_weights(tag, table, j, h)
        prepare_stage_back(model, history, segment, o + j, w_q, w_v, workspace)
        for m in range(count):
            _runge_kutta_stage_back(
                tag, model, table, history, segment, o, j, h, q, v, bars, rows_bar, lam_q[m], lam_v[m], z[m], y,
                u[m], g[m], turns, workspace,
            )  # fmt: skip
    for m in range(count):
        start_vjp(model, table, s, h, q, v, u[m], g[m], lam_q[m], lam_v[m])
        for i in range(model.driven.shape[0]):
            lam_q[m, model.driven[i]] = 0.0
            lam_v[m, model.driven[i]] = 0.0


@part
def _runge_kutta_stage_back(
    tag, model, table, history, segment, o, j, h, q, v, bars, rows_bar, lam_q, lam_v, z, y, u, g, turns, workspace
):  # fmt: skip
    """One stage of `steps_back`, for one row of cotangents.

    Constant:
      tag: the method of integration (`method_interface`).
      model: the compiled scene.
      table (3, 17, 17): coefficients of the method.
      history: the history of steps (`StepHistory`).
    In:
      segment: the segment of `model.times` that the step is in.
      o, j: number of the step's first stage, and of this one counted from it; it has been prepared.
      h: length of the step (s).
      q (s, n_q), v (s, n): coordinates and velocities of its stages.
      bars (s, 3, n), rows_bar (s, n_row): explicit cotangents of the stages' q, v, a and multipliers; no rows: none.
      lam_q, lam_v (n,): cotangents of the end's coordinates and velocities.
      workspace: workspace of a balance, with what was prepared.
    Out:
      z (s or more, n): z[j], the virtual displacement of the stage's balance.
      y (n_row,), turns (s, n): scratch (`stage_vjp`).
      u, g (s, n): u[j] and g[j], cotangents of the stage's coordinates and velocities; those of later stages are read.
    """
    n = u.shape[1]
    y[:] = 0.0
    stage_vjp(model, table, h, j, q, v, lam_q, lam_v, u, g, turns, z[j])
    if bars.shape[0] > 0:
        for d in range(n):
            z[j, d] += bars[j, 2, d]
            u[j, d] = bars[j, 0, d]
            g[j, d] = bars[j, 1, d]
        if not is_explicit(tag):
            w_q, w_v = own_weights(tag, table, j, h)
            for d in range(n):
                z[j, d] += w_q * u[j, d] + w_v * g[j, d]
        for r in range(y.shape[0]):
            y[r] = rows_bar[j, r]
    stage_back(model, history, segment, o + j, workspace, z[j], y, u[j], g[j])
    for i in range(model.driven.shape[0]):
        u[j, model.driven[i]] = 0.0
        g[j, model.driven[i]] = 0.0


@kernel
def changes_forward(tag, model, tables, history, w, dq, dv, force, stage_changes, row_changes, workspace):
    """Push R changes of the start of a Runge-Kutta step, and of the forces at its stages, to its end.

    Constant:
      tag: the method of integration (`method_interface`).
      model: the compiled scene.
      tables (2, 3, 17, 17): coefficients of both methods (`integrators.runge_kutta_tables`).
      history: the history of steps (`StepHistory`).
    In:
      w: number of the step.
      force (R, s or more, n): changes of the forces at the stages (N, N m).
    In place:
      dq, dv (R, n): changes of coordinates and velocities.
    Out:
      stage_changes (R, s or more, 3, n): of the stages' coordinates, velocities, accelerations.
      row_changes (R, s or more, n_row): of their multipliers.
      workspace: workspace of a balance (`accelerations.Workspace`).
    """
    count = dq.shape[0]
    table, s = table_of_step(tag, model, tables, history, w)
    o = history.index[w, FIRST]
    h = history.t[w + 1] - history.t[w]
    q = history.stage_q[o : o + s]
    v = history.stage_v[o : o + s]
    first = np.empty(count, np.int64)  # the first stage that changes; -1: the start does
    for m in range(count):
        first[m] = 0 if is_zero(dq[m]) and is_zero(dv[m]) else -1
    for i in range(s):
        w_q, w_v = own_weights(tag, table, i, h)
        k, c = prepare_stage_forward(model, history, history.index[w, SEGMENT], o + i, w_q, w_v, 0, workspace)
        for m in range(count):
            if first[m] == i and is_zero(force[m, i]):
                stage_changes[m, i] = 0.0
                row_changes[m, i] = 0.0
                first[m] += 1
                continue
            _runge_kutta_stage_forward(
                tag, model, table, history, o, first[m], i, h, q, v, k, c, dq[m], dv[m], force[m, i], stage_changes[m],
                row_changes[m, i], workspace,
            )  # fmt: skip
    for m in range(count):
        end_jvp(model, table, s, h, q, v, stage_changes[m], dq[m], dv[m])
        keep_free(model, dq[m])
        keep_free(model, dv[m])
    push = history.push[w + 1]
    project_forward(model, history.q[w + 1], history.v[w + 1], push[0], push[1], workspace, dq, dv)


@part
def _runge_kutta_stage_forward(
    tag, model, table, history, o, first, i, h, q, v, k, c, dq, dv, force, changes, row, workspace
):  # fmt: skip
    """One stage of `changes_forward`, which is prepared, for one of the R changes.

    Constant:
      tag: the method of integration (`method_interface`).
      model: the compiled scene.
      table (3, 17, 17): coefficients of the method.
      history: the history of steps (`StepHistory`).
    In:
      o, i: number of the step's first stage, and of this one counted from it.
      first: the first stage that changes, or -1.
      h: length of the step (s).
      q (s, n_q), v (s, n): coordinates and velocities of its stages.
      k, c (n_pair, 2 D, 2 D): of `prepare_stage_forward`.
      dq, dv, force (n,): changes of the start's coordinates and velocities, and of the forces at this stage.
      workspace: workspace of a balance, with what was prepared.
    Out:
      changes (s or more, 3, n): changes[i] of this stage; those of the stages before are read.
      row (n_row,): changes of the multipliers.
    """
    x = changes[i]
    stage_jvp(model, table, h, max(first, 0), i, q, v, dq, dv, changes)
    keep_free(model, x[0])
    keep_free(model, x[1])
    for d in range(force.shape[0]):
        x[2, d] = force[d]
    row[:] = 0.0
    w_q, w_v = own_weights(tag, table, i, h)
    stage_forward(model, history, o + i, k, c, workspace, x[0], x[1], x[2], row)
    if not is_explicit(tag):
        for d in range(force.shape[0]):
            x[0, d] += w_q * x[2, d]
            x[1, d] += w_v * x[2, d]


@part
def is_zero(x):
    """Whether x (n,) is zero throughout."""
    zero = True
    for d in range(x.shape[0]):
        zero = zero and x[d] == 0.0
    return zero


@part
def keep_free(model, x):
    """Make x (n,) zero where a freedom is no unknown."""
    for d in range(x.shape[0]):
        if model.free[d] == 0:
            x[d] = 0.0


@kernel
def free_places(model):
    """(F,): which of the freedoms are unknowns."""
    place = np.empty(model.free.shape[0], np.int64)
    count = 0
    for d in range(place.shape[0]):
        if model.free[d] != 0:
            place[count] = d
            count += 1
    return place[:count]


@kernel
def prepare_stage_forward(model, history, segment, o, w_q, w_v, iterations, workspace):
    """Prepare a stage for `stage_forward`: once for any number of changes. Returns its K and C.

    model: the compiled scene.
    history: the history of steps (`StepHistory`).
    segment, o: the segment of `model.times` that the stage is in, and its number.
    w_q, w_v: by how much the stage's coordinates (s^2) and velocities (s) change with its own accelerations.
    iterations: above 0 where those of the iterative method account for that (`iterate`), 0 where the matrix W does.
    workspace: workspace of a balance, which takes what is prepared.
    """
    k, c = lay_out(model, history, segment, o, workspace)
    if not has_factors(history):
        of_matrix = 0.0 if iterations > 0 else 1.0  # iterations account for the stage's own accelerations
        factor_matrix(
            model, workspace, k, c, history.turn[o], mass_of(history, o), of_matrix * w_q, of_matrix * w_v,
            workspace.tangents[OF_STEP if iterations == 0 else NO_SHIFT], np.bool_(False),
        )  # fmt: skip
    return k, c


@kernel
def stage_forward(model, history, o, k, c, workspace, dq, dv, force, row):
    """Changes of a stage's accelerations and multipliers from those of its state and of the forces on it.

    Constant:
      model: the compiled scene.
      history: the history of steps (`StepHistory`).
    In:
      o: number of the stage, the one that was prepared last (`prepare_stage_forward`).
      k, c (n_pair, 2 D, 2 D): its K and C.
      dq, dv (n,): changes of coordinates and velocities, without those by the stage's own accelerations, for which the
        matrix W accounts; where it was prepared for iterations, these do (`iterate`).
    In place:
      force (n,): changes of the forces, then of the accelerations.
      row (n_row,): changes of the right side of the rows, then of the multipliers.
      workspace: workspace of a balance, with what was prepared.
    """
    accelerations_jvp(model, workspace, k, c, load_slopes_of(history, o, workspace), dq, dv, force, row)
    if has_factors(history):
        solve_joints(
            model, workspace.inverse, history.pull[o], history.gram[o], history.diagonal[o], workspace.x, force, row
        )
    else:
        solve_unknowns(model, workspace, force, row)


@kernel
def find_iteration(model, history, o, k, c, w_q, w_v, workspace, by_change):
    """Find what an iteration of the iterative method makes of changes of an implicit stage's accelerations.

    Constant:
      model: the compiled scene.
      history: the history of steps (`StepHistory`).
    In:
      o: number of the stage, which is prepared for iterations (`prepare_stage_forward`).
      k, c (n_pair, 2 D, 2 D): its K and C.
      w_q, w_v: by how much the stage's coordinates (s^2) and velocities (s) change with its own accelerations.
    Out:
      workspace: workspace of a balance, with the stage; the way from shifts to coordinates is read.
      by_change (n + n_row, n): those of accelerations and multipliers, by changes of each acceleration.
    """
    n = by_change.shape[1]
    unit = np.zeros(n)
    dq = np.empty(n)
    dv = np.zeros(n)
    made = np.empty(by_change.shape[0])
    for d in range(n):
        unit[d] = 1.0
        dv[d] = w_v
        dq[:] = 0.0
        made[:] = 0.0
        add_shift(model, workspace.tangents[OF_STEP], w_q, unit, dq)
        stage_forward(model, history, o, k, c, workspace, dq, dv, made[:n], made[n:])
        by_change[:, d] = made
        unit[d] = 0.0
        dv[d] = 0.0


@kernel
def iterate(by_change, iterations, room, force, row):
    """Solve x = b + S x by fixed-point iterations, which begin at zero; S is what an iteration makes of accelerations.

    by_change (n + n_row, n): S (`find_iteration`). iterations: how many at most. room (2, n + n_row): scratch.
    force (n,), row (n_row,): b, of accelerations and multipliers; then x. In place.

    Returns whether the iterations have settled.
    """
    n = force.shape[0]
    x = room[0]
    new = room[1]
    x[:] = 0.0
    last = np.inf
    for _ in range(iterations):
        change = 0.0
        size = 0.0
        for i in range(new.shape[0]):
            value = force[i] if i < n else row[i - n]
            for d in range(n):
                value += by_change[i, d] * x[d]
            new[i] = value
            change = max(change, abs(value - x[i]))
            size = max(size, abs(value))
        x[:] = new
        if not change < np.inf or change > 1e6 * last:
            return False
        if change <= SETTLED * size:
            force[:] = x[:n]
            row[:] = x[n:]
            return True
        last = min(last, change)
    return False
