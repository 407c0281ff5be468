"""The interface functions of generalized-alpha in general scenes: cubic motion between steps, reverse and tangent
steps, weights.

Between two steps q is the cubic through both ends with their velocities, and v its derivative. What a step takes over
beside q and v are the acceleration and the auxiliary one (rows 0 and 1 of lam_x and dx), unless it makes its own.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.general.dynamics.accelerations import OF_STEP
from mdstopo.general.dynamics.projection import project_back, project_forward
from mdstopo.general.integrators.generalized_alpha import TAG
from mdstopo.general.steps.method_interface import implement
from mdstopo.general.steps.step_history import FIRST, SEGMENT, copy_vector
from mdstopo.general.steps.step_linear import (
    find_iteration,
    iterate,
    keep_free,
    prepare_stage_back,
    prepare_stage_forward,
    stage_back,
    stage_forward,
)
from mdstopo.integrators.springs_generalized_alpha import weights_of as alpha_weights
from mdstopo.integrators.steps import REVERSE
from mdstopo.mechanics.kinematics.kinematics_interface import (
    add_shift,
    cubic,
    cubic_jvp,
    cubic_vjp,
    retract_jvp,
    retract_vjp,
    shift_tangents,
)


@kernel
def point_of(tag, model, tables, member_state, history, count, k, c, keep, workspace, q, v, work):
    """The cubic between the ends of step k, and its derivative; see `method_interface.point_of`. Returns k."""
    h = history.t[k + 1] - history.t[k]
    cubic(model, c, h, history.q[k], history.v[k], history.q[k + 1], history.v[k + 1], q, v)
    return k


@kernel
def state_at_offset(tag, model, history, k, c, e, q, v, a, q_out, v_out):
    """The cubic of step k, a little later than at fraction c; see `method_interface.state_at_offset`."""
    h = history.t[k + 1] - history.t[k]
    cubic(model, c + e / h, h, history.q[k], history.v[k], history.q[k + 1], history.v[k + 1], q_out, v_out)


@kernel
def derivatives(tag):
    """How many derivatives of the motion are exact: velocities only; the cubic's second derivative is not the
    acceleration."""
    return 1


@kernel
def is_continuous(tag):
    """Whether samples are taken on the method's own cubic: no, the quintic through both accelerations is closer to the
    motion."""
    return False


@kernel
def is_explicit(tag):
    """Whether stages follow from those before them: steps of generalized-alpha are implicit."""
    return False


@kernel
def ends_in_stage(tag):
    """Whether the last stage of a step is its end: the balance is imposed there."""
    return True


@kernel
def weights_of(tag, model, tables, history, w, out):
    """Weights of the stages in an integral, by the trapezoidal rule; see `method_interface.weights_of`.

    For an end half of each step next to it, for a stage off the motion nothing.
    """
    h = history.t[w + 1] - history.t[w]
    out[:] = 0.0
    last = history.index[w + 1, FIRST] - history.index[w, FIRST] - 1
    out[last] = 0.5 * h
    if last > 0:
        out[0] = 0.5 * h
    # a following step without a stage at its start leaves that half to this step's end
    if history.index[w + 2, FIRST] - history.index[w + 1, FIRST] == 1:
        out[last] += 0.5 * (history.t[w + 2] - history.t[w + 1])


@kernel
def step_back(tag, model, tables, history, w, c, lam_q, lam_v, lam_x, bars, rows_bar, z, y, workspace, work):
    """Pull cotangents of the end of step w back through its stages to its start; see `method_interface.step_back`.

    lam_x (R, 2, n) belongs to the acceleration and the auxiliary one; tables (1,): the spectral radius.
    """
    count, n = lam_q.shape
    o = history.index[w, FIRST]
    last = history.index[w + 1, FIRST] - 1 - o
    h = history.t[w + 1] - history.t[w]
    weights = alpha_weights(tables[0])
    bar = np.zeros((6, count, n))
    bar_q = bar[0]
    bar_v = bar[1]
    bar_a = bar[2]
    bar_x = bar[3]
    start_q = bar[4]
    start_v = bar[5]
    work[REVERSE] += count
    for m in range(count):
        cubic_vjp(
            model, c[m], h, history.q[w], history.v[w], history.q[w + 1], history.v[w + 1], lam_q[m], lam_v[m],
            start_q[m], start_v[m], bar_q[m], bar_v[m],
        )  # fmt: skip
    pulled = np.empty((2, n))
    push = history.push[w + 1]
    project_back(model, history.q[w + 1], history.v[w + 1], push[0], push[1], workspace, bar_q, bar_v)
    for j in range(last, -1, -1):
        e1, _, _, beta, gamma, _ = weights
        w_q = h * h * beta * e1 if j == last else 0.0
        w_v = h * gamma * e1 if j == last else 0.0
        if j == last:
            shift_tangents(model, history.q[w], history.stage_q[o + j], workspace.tangents[OF_STEP])
        prepare_stage_back(model, history, history.index[w, SEGMENT], o + j, w_q, w_v, workspace)
        for m in range(count):
            _stage_row_back(
                model, history, w, o, j, last, h, weights, bars, rows_bar, lam_x[m], z[m, j], y, bar_q[m], bar_v[m],
                bar_a[m], bar_x[m], start_q[m], start_v[m], pulled, workspace,
            )  # fmt: skip
    for m in range(count):
        for d in range(n):
            free = model.free[d] != 0
            lam_q[m, d] = start_q[m, d] if free else 0.0
            lam_v[m, d] = start_v[m, d] if free else 0.0
            lam_x[m, 0, d] = bar_a[m, d] if last == 0 and free else 0.0
            lam_x[m, 1, d] = bar_x[m, d] if last == 0 and free else 0.0


@part
def _stage_row_back(
    model, history, w, o, j, last, h, weights, bars, rows_bar, lam_x, x, y, bar_q, bar_v, bar_a, bar_x, start_q,
    start_v, pulled, workspace,
):  # fmt: skip
    """Stage j of `step_back`, which is prepared, for one row of cotangents.

    Constant:
      model: the compiled scene.
      history, w, o, j, last: the history of steps, the step, its first stage, the number of this stage in it, and of
        its last.
      h: length of the step (s).
      weights: of the method (`integrators.springs_generalized_alpha.weights_of`).
      bars (s, 3, n), rows_bar (s, n_row): explicit cotangents of the stages' q, v, a and multipliers, or no rows.
      lam_x (2, n): cotangents of the acceleration and the auxiliary one at the end of the step.
    In and out:
      bar_q, bar_v, bar_a, bar_x (n,): cotangents of the stage's coordinates and velocities, and of the acceleration and
        the auxiliary one with which the step begins.
      start_q, start_v (n,): cotangents of the start of the step, added to.
      workspace: the workspace, with the stage prepared (`step_linear.prepare_stage_back`).
    Out:
      x (n,): the virtual displacement of the stage's balance.
      y (n_row,): adjoint variables of the joints' rows.
      pulled (2, n): scratch.
    """
    n = x.shape[0]
    e1, e2, e3, beta, gamma, lag = weights
    y[:] = 0.0
    if j < last:
        bar_q[:] = 0.0
        bar_v[:] = 0.0
    spread = bars.shape[0] > 0
    if spread:
        for d in range(n):
            bar_q[d] += bars[j, 0, d]
            bar_v[d] += bars[j, 1, d]
        for r in range(y.shape[0]):
            y[r] = rows_bar[j, r]
    at_start = history.q[w]
    at_stage = history.stage_q[o + j]
    from_q = pulled[0]
    from_shift = pulled[1]
    if j == last:
        retract_vjp(model, at_start, at_stage, bar_q, from_q, from_shift)
    for d in range(n):
        if j == last:
            x[d] = lam_x[0, d] + e1 * (lam_x[1, d] + h * (h * beta * from_shift[d] + gamma * bar_v[d]))
        else:
            x[d] = bar_a[d] if j == 0 else -bar_x[d]
        if spread:
            x[d] += bars[j, 2, d]
    stage_back(model, history, history.index[w, SEGMENT], o + j, workspace, x, y, bar_q, bar_v)
    for i in range(model.driven.shape[0]):
        bar_q[model.driven[i]] = 0.0
        bar_v[model.driven[i]] = 0.0
    retract_vjp(
        model, at_start, at_stage, bar_q, from_q, from_shift
    )  # of the first stage, which is not shifted: as it is
    for d in range(n):
        start_q[d] += from_q[d]
        start_v[d] += bar_v[d]
        if j == last:
            reach_q = h * h * from_shift[d]
            reach_v = h * bar_v[d]
            start_v[d] += h * from_shift[d]
            carried = lam_x[1, d] + beta * reach_q + gamma * reach_v
            bar_a[d] = e2 * carried
            bar_x[d] = (0.5 - beta) * reach_q + (1.0 - gamma) * reach_v - e3 * carried
            if last == 1:
                bar_a[d] += bar_x[d]
            elif last == 2:
                bar_a[d] += 2.0 * bar_x[d]
        elif j == 1:
            ahead = lag * h
            start_v[d] += ahead * from_shift[d]
            bar_a[d] += ahead * (0.5 * ahead * from_shift[d] + bar_v[d])


@kernel
def step_forward(tag, model, tables, history, w, c, iterations, dq, dv, dx, force, changes, rows, workspace):
    """Push changes at the start of step w through its stages to its end; see `method_interface.step_forward`.

    dx (R, 2, n) belongs to the acceleration and the auxiliary one; tables (1,): the spectral radius.
    """
    count, n = dq.shape
    o = history.index[w, FIRST]
    last = history.index[w + 1, FIRST] - 1 - o
    h = history.t[w + 1] - history.t[w]
    weights = alpha_weights(tables[0])
    e1, _, _, beta, gamma, _ = weights
    shift = np.empty(n)
    unknowns = n + rows.shape[2] if iterations > 0 else 0
    by_change = np.empty((unknowns, n))
    room = np.empty((2, unknowns))
    settled = True
    for j in range(last + 1):
        w_q = h * h * beta * e1 if j == last else 0.0
        w_v = h * gamma * e1 if j == last else 0.0
        if j == last:
            shift_tangents(model, history.q[w], history.stage_q[o + j], workspace.tangents[OF_STEP])
        segment = history.index[w, SEGMENT]
        k, c_stage = prepare_stage_forward(model, history, segment, o + j, w_q, w_v, iterations, workspace)
        iterating = iterations > 0 and j == last
        if iterating:
            find_iteration(model, history, o + j, k, c_stage, w_q, w_v, workspace, by_change)
        for m in range(count):
            _reach_of_stage(
                model, history, w, o, j, last, h, weights, dq[m], dv[m], dx[m], force[m, j], changes[m, j], shift
            )
            rows[m, j] = 0.0
            x = changes[m, j, 0]
            u = changes[m, j, 1]
            f = changes[m, j, 2]
            stage_forward(model, history, o + j, k, c_stage, workspace, x, u, f, rows[m, j])
            if iterating:
                settled = iterate(by_change, iterations, room, f, rows[m, j]) and settled
            if j == last:
                add_shift(model, workspace.tangents[OF_STEP], w_q, f, x)
                for d in range(n):
                    u[d] += w_v * f[d]
            _hand_over(weights, j, last, f, dx[m])
    end_q = np.empty((count, n))
    end_v = np.empty((count, n))
    for m in range(count):
        copy_vector(changes[m, last, 0], end_q[m])
        copy_vector(changes[m, last, 1], end_v[m])
    push = history.push[w + 1]
    project_forward(model, history.q[w + 1], history.v[w + 1], push[0], push[1], workspace, end_q, end_v)
    for m in range(count):
        cubic_jvp(
            model, c, h, history.q[w], history.v[w], history.q[w + 1], history.v[w + 1], dq[m], dv[m], end_q[m],
            end_v[m],
        )  # fmt: skip
    return settled


@part
def _reach_of_stage(model, history, w, o, j, last, h, weights, dq, dv, dx, force, changes, shift):
    """Changes of the coordinates and velocities of stage j of `step_forward`, without those by its own accelerations.

    Constant:
      model: the compiled scene.
      history, w, o, j, last: the history of steps, the step, its first stage, the number of this stage in it, and of
        its last.
      h: length of the step (s).
      weights: of the method (`integrators.springs_generalized_alpha.weights_of`).
      dq, dv (n,), dx (2, n): changes of the start; of the acceleration and the auxiliary one, as the stages before have
        left them.
      force (n,): changes of the forces.
    Out:
      changes (3, n): those of coordinates and velocities, and `force`.
      shift (n,): scratch.
    """
    _, e2, e3, beta, gamma, lag = weights
    x = changes[0]
    u = changes[1]
    for d in range(dq.shape[0]):
        changes[2, d] = force[d]
        if j == last:
            carry = e2 * dx[0, d] - e3 * dx[1, d]
            shift[d] = h * (dv[d] + h * ((0.5 - beta) * dx[1, d] + beta * carry))
            u[d] = dv[d] + h * ((1.0 - gamma) * dx[1, d] + gamma * carry)
        elif j == 0:
            shift[d] = 0.0
            u[d] = dv[d]
        else:
            shift[d] = lag * h * (dv[d] + 0.5 * lag * h * dx[0, d])
            u[d] = dv[d] + lag * h * dx[0, d]
    retract_jvp(model, history.q[w], history.stage_q[o + j], dq, shift, x)
    keep_free(model, x)
    keep_free(model, u)


@part
def _hand_over(weights, j, last, f, dx):
    """Changes dx (2, n) of the acceleration and the auxiliary one behind stage j, whose accelerations change by f (n,).

    weights: of the method. last: number of the step's last stage.
    """
    e1, e2, e3, _, _, _ = weights
    for d in range(f.shape[0]):
        if j == last:
            dx[1, d] = e1 * f[d] + e2 * dx[0, d] - e3 * dx[1, d]
            dx[0, d] = f[d]
        elif j == 0:
            dx[0, d] = f[d]
            dx[1, d] = f[d]
        else:
            dx[1, d] = 2.0 * dx[0, d] - f[d]


@kernel
def carried(tag):
    """The acceleration and the auxiliary one."""
    return 2


implement(
    TAG,
    point_of=point_of,
    step_back=step_back,
    step_forward=step_forward,
    state_at_offset=state_at_offset,
    carried=carried,
    derivatives=derivatives,
    is_continuous=is_continuous,
    is_explicit=is_explicit,
    ends_in_stage=ends_in_stage,
    weights_of=weights_of,
)
