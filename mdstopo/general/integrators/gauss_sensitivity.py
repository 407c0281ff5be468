"""The interface functions of Gauss collocation in general scenes: the window's polynomial, reverse and tangent steps.

Both solve the linear equations of a window (`gauss_window`), transposed or not, by iterations that contract as the
forward ones did, with the slopes that were kept. A window takes over nothing but the state at its start.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.general.dynamics.accelerations import accelerations_jvp, matrices_vjp, turns_vjp
from mdstopo.general.integrators.gauss import TAG
from mdstopo.general.integrators.gauss_window import (
    DENSE,
    add_changes,
    add_rate_products,
    fill_slopes,
    has_rates,
    is_coupled,
    level_of,
    moving,
    pull_changes,
)
from mdstopo.general.steps.method_interface import implement
from mdstopo.general.steps.step_history import COEFFICIENT, FIRST, U, X, Y, copy_vector
from mdstopo.integrators.rows import (
    add_products,
    combine_rows,
    integrate_to_nodes,
    largest_difference,
    make_rows,
    renew_rows,
    row_width,
    take_rows,
)
from mdstopo.integrators.springs_gauss_linear import _point_weights, _polynomials
from mdstopo.integrators.steps import BODY_ITERATIONS, REVERSE
from mdstopo.mechanics.kinematics.kinematics_interface import (
    window_jvp,
    window_maps,
    window_size,
    window_start_jvp,
    window_start_vjp,
    window_state,
    window_turn,
    window_vjp,
)

#: iterations of the equations of a window at most
MOST_ITERATIONS = 200


@part
def stages_of(history, w):
    """First stage of window w, number of its nodes, and its length (s)."""
    o = history.index[w, FIRST]
    return o, history.index[w + 1, FIRST] - o, history.t[w + 1] - history.t[w]


@kernel
def state_at(model, history, w, c, x, y, q, v):
    """Coordinates and velocities at a fraction of window w, by its polynomial.

    Constant:
      model: the compiled scene.
      history, w, c: the history of steps, the window, and the fraction, which may be a little outside of it.
    Out:
      x, y (n,): of the window. q (n_q,), v (n,): coordinates and velocities.
    """
    o, s, h = stages_of(history, w)
    integral = np.empty((2, s))
    first = integral[0]
    second = integral[1]
    _polynomials(c, s, first, second)
    for d in range(moving(model)):
        x[d] = h * c * history.v[w, d]
        y[d] = history.v[w, d]
    for k in range(s):
        own = history.window[o + k, COEFFICIENT]
        for d in range(moving(model)):
            x[d] += h * h * second[k] * own[d]
            y[d] += h * first[k] * own[d]
    copy_vector(history.q[w], q)
    copy_vector(history.v[w], v)
    window_state(model, history.q[w], x, y, q, v)


@kernel
def point_of(tag, model, tables, member_state, history, count, k, c, keep, workspace, q, v, work):
    """Coordinates and velocities at fraction c of window k, by its polynomial; returns k.

    Constant:
      model: the compiled scene.
      history, k, c: the history of steps, the window, and the fraction.
    Out:
      q (n_q,), v (n,): coordinates and velocities.

    Not needed here: tag, tables, member_state, count, keep, workspace, work.
    """
    inside = np.empty((2, v.shape[0]))
    state_at(model, history, k, c, inside[0], inside[1], q, v)
    return k


@kernel
def state_at_offset(tag, model, history, k, c, e, q, v, a, q_out, v_out):
    """Coordinates and velocities of window k, a little later than at fraction c, by its polynomial.

    Constant:
      model: the compiled scene.
      history, k, c: the history of steps, the window, and the fraction.
      e: how much later (s); below 0: earlier.
    Out:
      q_out (n_q,), v_out (n,): coordinates and velocities then.

    Not needed here: tag; q, v, a, which are those at c.
    """
    inside = np.empty((2, v.shape[0]))
    state_at(model, history, k, c + e / (history.t[k + 1] - history.t[k]), inside[0], inside[1], q_out, v_out)


@kernel
def derivatives(tag):
    """How many derivatives of the motion are exact: velocities only; the polynomial's second derivative is not quite
    the acceleration between nodes."""
    return 1


@kernel
def is_continuous(tag):
    """Whether the state inside a window costs no forces: the polynomial is as accurate as the window."""
    return True


@kernel
def is_explicit(tag):
    """Whether stages follow from those before them: windows of collocation are implicit."""
    return False


@kernel
def ends_in_stage(tag):
    """Whether the last stage of a step is its end: Gauss's nodes lie inside."""
    return False


@kernel
def weights_of(tag, model, tables, history, w, out):
    """Weights of the stages in an integral: Gauss's weights, times the length of the window.

    Constant:
      tables (n_level, 7, s_max, s_max): of `gauss_tables`.
      history, w: the history of steps, and the window.
    Out:
      out (s or more,): the weights (s).

    Not needed here: tag, model.
    """
    _, s, h = stages_of(history, w)
    level = level_of(s)
    for j in range(s):
        out[j] = h * tables[level, 0, 1, j]


@kernel
def _weights_at(planes, s, c, beta_x, beta_y):
    """Weights (s,) of the nodes' u in x (times h^2) and y (times h) at fraction c of a window; 1: its end."""
    if c >= 1.0:
        for j in range(s):
            beta_x[j] = planes[0, 2, j]
            beta_y[j] = planes[0, 1, j]
    else:
        _point_weights(planes[3], s, c, beta_x, beta_y)


@kernel
def _maps_at(model, history, w, c, beta_x, beta_y, x, maps):
    """x and the maps at a fraction of a window.

    model: the compiled scene. history, w, c: the history of steps, the window, and the fraction.
    beta_x, beta_y (s,): of `_weights_at`.
    x (n,), maps (n_body, MAPS): out.
    """
    o, s, h = stages_of(history, w)
    y = np.zeros(x.shape[0])
    for d in range(moving(model)):
        x[d] = h * c * history.v[w, d]
        y[d] = history.v[w, d]
        for j in range(s):
            x[d] += h * h * beta_x[j] * history.window[o + j, U, d]
            y[d] += h * beta_y[j] * history.window[o + j, U, d]
    window_maps(model, x, y, np.zeros(x.shape[0]), maps)


@kernel
def _node_maps(model, history, w, maps):
    """maps (s, n_body, MAPS) of the nodes of window w."""
    o, s, _ = stages_of(history, w)
    for i in range(s):
        own = history.window[o + i]
        window_maps(model, own[X], own[Y], own[U], maps[i])


@kernel
def _inverse_masses(model):
    """(n,): inverse masses and inertias; 0 of ground."""
    inverse = np.zeros(model.mass.shape[0])
    for d in range(moving(model)):
        inverse[d] = 1.0 / model.mass[d]
    return inverse


@kernel
def _dense_slopes(model, workspace, history, w, inverse, maps, by_rows):
    """G_x and G_y (2, s, M, W) of the nodes of window w; no rows where slopes are multiplied by pairs.

    model: the compiled scene. workspace: the workspace, for its switches. history, w: the history of steps, the window.
    inverse (n,): inverse masses. maps (s, n_body, MAPS): of the nodes. by_rows: as of `fill_slopes`.
    """
    o, s, _ = stages_of(history, w)
    m = moving(model)
    size = m if m <= DENSE else 0
    dense = make_rows(2 * s * size, m).reshape((2, s, size, row_width(m)))
    if size > 0:
        scratch = np.zeros((2, size, row_width(m)))
        for i in range(s):
            fill_slopes(
                model, workspace, history, o + i, inverse, maps[i], by_rows, scratch[0], scratch[1], dense[0, i],
                dense[1, i],
            )  # fmt: skip
    return dense


@kernel
def step_back(tag, model, tables, history, w, c, lam_q, lam_v, lam_x, bars, rows_bar, z, y, workspace, work):
    """Pull R cotangents of window w back to its start, in place (`method_interface`).

    Constant:
      tag, tables (n_level, 7, s_max, s_max): the integrator; of `gauss_tables`.
      model: the compiled scene.
      history, w: the history of steps, and the window.
      c (R,): the fraction of the window to which each cotangent belongs; 1: its end.
      bars (s, 3, n): explicit cotangents of the nodes' q, v, a; no rows where there are none.
    In and out:
      lam_q, lam_v (R, n): cotangents of coordinates and velocities.
    Out:
      z (R, s or more, n): the virtual displacements of the nodes' balances.
      work (WORK,): counts of work, added to.

    Not needed here: lam_x, rows_bar, y; of the workspace only its switches.
    """
    rows = lam_q.shape[0]
    _, s, _ = stages_of(history, w)
    planes = tables[level_of(s)]
    m = moving(model)
    width = row_width(m)
    maps = np.zeros((s, model.home.shape[0], window_size(model)))
    _node_maps(model, history, w, maps)
    inverse = _inverse_masses(model)
    dense = _dense_slopes(model, workspace, history, w, inverse, maps, np.bool_(True))
    room = make_rows(9 * s, m).reshape((9, s, width))
    root = np.zeros(width)
    for d in range(m):
        root[d] = np.sqrt(inverse[d])
    back = np.empty((2, s, s))  # the integrations, transposed
    back_x = back[0]
    back_y = back[1]
    for i in range(s):
        for j in range(s):
            back_x[j, i] = planes[2][i, j]
            back_y[j, i] = planes[1][i, j]
    own_x = room[7]
    own_y = room[8]
    for i in range(bars.shape[0]):
        window_vjp(model, maps[i], bars[i, 0], bars[i, 1], bars[i, 2], own_x[i], own_y[i])
    work[REVERSE] += rows
    for r in range(rows):
        _row_back(
            model, planes, history, w, c[r], bars, workspace, inverse, maps, dense, back_x, back_y, root, room,
            lam_q[r], lam_v[r], z[r], work,
        )  # fmt: skip


@kernel
def _row_back(
    model, planes, history, w, c, bars, workspace, inverse, maps, dense, back_x, back_y, root, room, lam_q, lam_v, z,
    work,
):  # fmt: skip
    """`step_back` for one row of cotangents.

    Constant:
      model: the compiled scene.
      planes (7, s_max, s_max): of `gauss_tables`, for the window's number of nodes.
      history, w, c: the history of steps, the window, and the fraction of it.
      bars (s, 3, n): explicit cotangents of the nodes; no rows where there are none.
      workspace: the workspace, for its switches.
      inverse (n,): inverse masses; 0 of ground. root (W,): their roots, of the moving bodies.
      maps (s, n_body, MAPS), dense (2, s, M, W): of the nodes.
      back_x, back_y (s, s): the integrations, transposed.
    In and out:
      room (9, s, W): scratch but for rows 7 and 8, which have the explicit cotangents of x and y where there are any.
      lam_q, lam_v (n,): the cotangents.
    Out:
      z (s or more, n): the virtual displacements of the balances.
      work (WORK,): counts of work, added to.
    """
    n = lam_q.shape[0]
    o, s, h = stages_of(history, w)
    m = moving(model)
    rhs = room[0]
    x = room[1]
    bar_x = room[2]
    bar_y = room[3]
    value = room[4]
    none = room[5]
    spread = bars.shape[0] > 0
    beta = np.zeros((2, s))
    beta_x = beta[0]
    beta_y = beta[1]
    here = np.zeros((model.home.shape[0], window_size(model)))
    vectors = np.zeros((9, n))
    change = vectors[0:5]
    point = vectors[5:7]
    at = vectors[7]
    start = vectors[8]
    _weights_at(planes, s, c, beta_x, beta_y)
    _maps_at(model, history, w, c, beta_x, beta_y, at, here)
    window_vjp(model, here, lam_q, lam_v, change[2], point[0], point[1])
    for j in range(s):
        for d in range(m):
            rhs[j, d] = h * h * beta_x[j] * point[0, d] + h * beta_y[j] * point[1, d]
    if spread:
        for j in range(s):
            copy_vector(bars[j, 2], change[0])
            window_turn(model, maps[j], np.bool_(False), np.bool_(True), change[0])
            for d in range(m):
                rhs[j, d] += change[0, d]
        combine_rows(back_x, s, s, h * h, rhs, room[7], value)
        combine_rows(back_y, s, s, h, value, room[8], rhs)
    take_rows(rhs, s, x)
    rates = has_rates(model, workspace)
    take_rows(none, s, bar_y)
    last = np.inf
    for _ in range(MOST_ITERATIONS):
        work[BODY_ITERATIONS] += 1
        _pull(model, workspace, history, o, s, inverse, maps, dense, none, x, change, bar_x, bar_y)
        if rates:
            combine_rows(back_y, s, s, h, rhs, bar_y, value)
            moved, size = renew_rows(back_x, s, h * h, value, bar_x, root, x)
        else:
            moved, size = renew_rows(back_x, s, h * h, rhs, bar_x, root, x)
        if moved <= 4e-16 * size or (moved >= last and moved <= 1e-13 * size):
            break
        last = moved
    _pull(model, workspace, history, o, s, inverse, maps, dense, none, x, change, bar_x, bar_y)
    window_start_vjp(model, at, lam_q, start)
    for d in range(m):
        lam_v[d] = point[1, d] + h * c * point[0, d]
    for i in range(s):
        ahead = h * planes[0, 0, i]
        own = z[i]
        own[:] = 0.0
        for d in range(m):
            own[d] = x[i, d]
            seen = bar_x[i, d]
            rate = bar_y[i, d]
            if spread:
                seen += room[7, i, d]
                rate += room[8, i, d]
            lam_v[d] += rate + ahead * seen
        window_turn(model, maps[i], np.bool_(True), np.bool_(True), own)
        for d in range(n):
            own[d] *= inverse[d]
            change[0, d] = bars[i, 0, d] if spread else 0.0
        matrices_vjp(model, history.K[o + i], own, change[0])
        turns_vjp(model, history.turn[o + i], own, change[0], change[1])
        window_start_vjp(model, history.window[o + i, X], change[0], start)
    for d in range(m):
        lam_q[d] = start[d]
    for d in range(m, n):
        lam_q[d] = 0.0
        lam_v[d] = 0.0


@kernel
def _pull(model, workspace, history, o, s, inverse, maps, dense, none, x, change, bar_x, bar_y):
    """bar_x, bar_y (s, W) = G_x^T x, G_y^T x at the nodes.

    In:
      model: the compiled scene.
      workspace: the workspace, for its switches.
      history, o, s: the history of steps, the first stage, and the number of nodes.
      inverse (n,): inverse masses; 0 of ground. maps (s, n_body, MAPS), dense (2, s, M, W): of the nodes, by rows.
      none (s, W): zeros. x (s, W): cotangents of u.
    Out:
      bar_x, bar_y: overwritten; bar_y stays as it is where G does not depend on y. change (5, n): scratch.
    """
    if dense.shape[2] > 0:
        add_products(dense[0], x, s, none, bar_x)
        if not has_rates(model, workspace):
            return
        take_rows(none, s, bar_y)
        add_rate_products(model, dense[1], x, s, is_coupled(model, workspace), bar_y)
        return
    for i in range(s):
        pull_changes(model, workspace, history, o + i, maps[i], inverse, x[i], change, bar_x[i], bar_y[i])


@kernel
def step_forward(tag, model, tables, history, w, c, iterations, dq, dv, dx, force, changes, rows, workspace):
    """Push R changes through window w (`method_interface`).

    Constant:
      tag, tables (n_level, 7, s_max, s_max): the integrator; of `gauss_tables`.
      model: the compiled scene.
      history, w, c: the history of steps, the window, and the fraction of it at which it is taken to end.
      force (R, s or more, n): changes of the force at each node.
    In and out:
      dq, dv (R, n): changes of coordinates and velocities, of the start and then of the end.
    Out:
      changes (R, s or more, 3, n): changes of the nodes' q, v, a.

    Not needed here: iterations, dx, rows; of the workspace only its switches.

    Returns True: the iterations that solve the equations are not those of the iterative method.
    """
    _, s, _ = stages_of(history, w)
    planes = tables[level_of(s)]
    m = moving(model)
    maps = np.zeros((s, model.home.shape[0], window_size(model)))
    _node_maps(model, history, w, maps)
    inverse = _inverse_masses(model)
    dense = _dense_slopes(model, workspace, history, w, inverse, maps, np.bool_(False))
    room = make_rows(s * 6, m).reshape((6, s, row_width(m)))
    for r in range(dq.shape[0]):
        _row_forward(
            model, planes, history, w, c, workspace, inverse, maps, dense, room, dq[r], dv[r], force[r], changes[r]
        )
    return True


@kernel
def _row_forward(model, planes, history, w, c, workspace, inverse, maps, dense, room, dq, dv, force, changes):
    """`step_forward` for one of the R changes.

    Constant:
      model: the compiled scene.
      planes (7, s_max, s_max): of `gauss_tables`, for the window's number of nodes.
      history, w, c: the history of steps, the window, and the fraction of it at which it is taken to end.
      workspace: the workspace, for its switches.
      inverse (n,): inverse masses; 0 of ground. maps (s, n_body, MAPS), dense (2, s, M, W): of the nodes.
      force (s or more, n): changes of the force at each node.
    In and out:
      dq, dv (n,): changes of coordinates and velocities, of the start and then of the end.
    Out:
      changes (s or more, 3, n): changes of the nodes' q, v, a. room (6, s, W): scratch; its last row is of zeros.
    """
    n = dq.shape[0]
    o, s, h = stages_of(history, w)
    m = moving(model)
    width = room.shape[2]
    given = room[0]
    du = room[1]
    by_x = room[2]
    by_y = room[3]
    value = room[4]
    none = room[5]
    ends = np.zeros((3, width))
    change = np.zeros((5, n))
    no_row = np.zeros(model.size[0])
    for d in range(m):
        ends[0, d] = dv[d]
        ends[1, d] = h * dv[d]
        ends[2, d] = np.sqrt(model.mass[d])
    for i in range(s):
        # what forces and the change of the start, seen at the node, do to u
        change[:] = 0.0
        window_start_jvp(model, history.window[o + i, X], dq, change[0])
        copy_vector(force[i], change[3])
        accelerations_jvp(
            model, workspace, history.K[o + i], history.C[o + i], history.turn[o + i], change[0], change[1], change[3],
            no_row,
        )  # fmt: skip
        for d in range(n):
            change[3, d] *= inverse[d]
        window_turn(model, maps[i], np.bool_(True), np.bool_(False), change[3])
        for d in range(m):
            given[i, d] = change[3, d]
    take_rows(given, s, du)
    change[:] = 0.0
    last = np.inf
    for _ in range(MOST_ITERATIONS):
        integrate_to_nodes(planes[2], s, s, h * h, none[0], ends[1], planes[0, 0], du, by_x)
        integrate_to_nodes(planes[1], s, s, h, ends[0], none[0], planes[0, 0], du, by_y)
        if dense.shape[2] > 0:
            add_products(dense[0], by_x, s, given, value)
            if has_rates(model, workspace):
                add_rate_products(model, dense[1], by_y, s, is_coupled(model, workspace), value)
        else:
            take_rows(given, s, value)
            for i in range(s):
                add_changes(
                    model, workspace, history, o + i, maps[i], inverse, by_x[i], by_y[i], change, no_row, value[i]
                )
        moved = largest_difference(value, du, ends[2], s)
        size = largest_difference(value, none, ends[2], s)
        take_rows(value, s, du)
        if moved <= 4e-16 * size or (moved >= last and moved <= 1e-13 * size):
            break
        last = moved
    integrate_to_nodes(planes[2], s, s, h * h, none[0], ends[1], planes[0, 0], du, by_x)
    integrate_to_nodes(planes[1], s, s, h, ends[0], none[0], planes[0, 0], du, by_y)
    for i in range(s):
        changes[i] = 0.0
        window_jvp(model, maps[i], by_x[i], by_y[i], changes[i, 0], changes[i, 1], changes[i, 2])
        window_start_jvp(model, history.window[o + i, X], dq, changes[i, 0])
        change[0] = 0.0
        for d in range(m):
            change[0, d] = du[i, d]
        window_turn(model, maps[i], np.bool_(False), np.bool_(False), change[0])
        for d in range(m):
            changes[i, 2, d] += change[0, d]
    beta_x = np.zeros(s)
    beta_y = np.zeros(s)
    at = np.zeros(n)
    here = np.zeros((model.home.shape[0], window_size(model)))
    _weights_at(planes, s, c, beta_x, beta_y)
    _maps_at(model, history, w, c, beta_x, beta_y, at, here)
    point = np.zeros((2, n))
    for d in range(m):
        point[0, d] = h * c * dv[d]
        point[1, d] = dv[d]
        for j in range(s):
            point[0, d] += h * h * beta_x[j] * du[j, d]
            point[1, d] += h * beta_y[j] * du[j, d]
    change[:] = 0.0
    window_jvp(model, here, point[0], point[1], change[0], change[1], change[2])
    window_start_jvp(model, at, dq, change[0])
    copy_vector(change[0], dq)
    copy_vector(change[1], dv)


@kernel
def carried(tag):
    """A window takes nothing over but the state."""
    return 0


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
