"""A window of Gauss collocation of a general scene: balances at its nodes, and the linear equations between them.

Within a window bodies are where x tells, what coordinates have changed by since its start, with y and u the first and
second derivatives of x by time (`kinematics_interface`: in a plane plain differences, in space places and rotation
vectors). The balance of forces says u = G(x, y, t), and u is a polynomial through its values at the Gauss nodes c_i:

    x_i = h c_i y_0 + h^2 sum_j (A A)_ij u_j,     y_i = y_0 + h sum_j A_ij u_j,     u_i = G(x_i, y_i, t + c_i h).

That is Gauss's method for (x, y)' = (y, G): of order 2 s, symmetric, A-stable (`integrators.gauss_tables`). What turns
do to G is in it, so the equations between nodes are those of numbers that are added. Linearised about (x, y)_ref,

    u_i = g_i + G_x (x_i - x_ref) + G_y (y_i - y_ref),

they are solved by iterations that touch no member, as are their transposes. Slopes of few bodies are multiplied as
dense matrices, in whole vectors; of many by pairs, with K, C and the slopes of loads that the history of steps has.
"""

from typing import Any

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.vector import lanes, load, store, zero
from mdstopo.general.dynamics.accelerations import accelerations_jvp, matrices_vjp, turns_vjp
from mdstopo.general.dynamics.forces import forces_of_sums, place_pairs
from mdstopo.general.dynamics.members import sums_at_poses
from mdstopo.general.model.bundles import bundle
from mdstopo.general.model.strides import is_spatial, sums_size
from mdstopo.general.model.switches import DAMPED, TURNING
from mdstopo.general.steps.step_history import copy_vector
from mdstopo.integrators.gauss_tables import LEVELS
from mdstopo.integrators.rows import (
    add_products,
    integrate_to_nodes,
    largest_difference,
    make_rows,
    move_to_nodes,
    row_width,
    subtract_rows,
    take_rows,
)
from mdstopo.integrators.steps import BODY_ITERATIONS, FORCES, TANGENTS
from mdstopo.mechanics.kinematics.kinematics_interface import (
    deflection,
    freedoms,
    load_slopes,
    pose_size,
    rotations,
    turned_pose,
    window_accelerations,
    window_jvp,
    window_rates_with_maps,
    window_size,
    window_slopes,
    window_state,
    window_turn,
    window_vjp,
)
from mdstopo.mechanics.kinematics.vectors import minus, put, times, vector_at

COUNTS = LEVELS
MOST_NODES = max(LEVELS)
#: freedoms of moving bodies up to which slopes are multiplied as dense matrices
DENSE = 24

#: relative change of an iteration that is rounding where it does not fall any more
ROUNDING = 1e-13

#: what the windows of a motion work in. Rows (nodes, W) of the moving bodies' numbers, W as of `rows`: x, y, u, g,
#: those about which the balance is linear, changes of x and y, coefficients, one to spare; vectors (W,): y at the
#: start, h y, zeros. Dense slopes G_x and G_y, by columns. At nodes coordinates, velocities, accelerations, relative
#: poses, maps (`window_maps`). Slopes before they are turned; changes (5, n) of a node's state, and of no rows of
#: joints; inverse masses (n,), 0 of ground; how far each pair has been from its pose at the start; at nodes the times
#: (s) and the sums over members
FIELDS = (
    "x", "y", "u", "g", "ref_x", "ref_y", "dx", "dy", "coef", "rest", "start", "ahead", "none", "by_x", "by_y", "q",
    "v", "a", "rel", "maps", "by_q", "by_v", "change", "row", "inverse", "reached",
    "when", "sums",
)  # fmt: skip


class Nodes:
    """The arrays of a window inside kernels, which `FIELDS` names; made by `make_nodes`."""

    def __init__(self, *_arrays: Any) -> None: ...


bundle(Nodes, FIELDS)


@part
def level_of(s):
    """The place of a window's number of nodes s in `COUNTS`."""
    level = 0
    while COUNTS[level] != s:
        level += 1
    return level


@part
def moving(model):
    """The number of freedoms of all bodies but ground, which is the last one."""
    return model.mass.shape[0] - freedoms(model)


@kernel
def make_nodes(model):
    """Arrays for the nodes of a window, in two pieces: rows of whole vectors, and all else."""
    n = model.mass.shape[0]
    n_pair = model.pair.shape[0]
    m = moving(model)
    size = m if m <= DENSE else 0
    rows = make_rows(10 * MOST_NODES + 3 + 2 * (MOST_NODES + 1) * size, m)
    of_node = model.q0.shape[0] + 2 * n + n_pair * (pose_size(model) + sums_size(model))
    of_node += model.home.shape[0] * window_size(model) + 1
    return _carve_nodes(model, rows, np.zeros(MOST_NODES * of_node + 6 * n + model.size[0] + n_pair))


@kernel
def _carve_nodes(model, rows, room):
    """The `Nodes`, whose arrays lie behind each other in two pieces.

    It is a function of its own because of compile time: no references are counted of arrays that are cut out of ones
    that are given. Where these are made, counting them would be most of the code.

    model: the compiled scene. rows (10 MOST_NODES + 3 + 2 (MOST_NODES + 1) M, W), room: zeros.
    """
    n = model.mass.shape[0]
    n_pair = model.pair.shape[0]
    m = moving(model)
    width = row_width(m)
    size = m if m <= DENSE else 0
    # where in `rows` the next part begins
    vectors = 10 * MOST_NODES
    by_x = vectors + 3
    by_y = by_x + MOST_NODES * size
    by_q = by_y + MOST_NODES * size
    by_v = by_q + size
    # where in `room` each part ends
    q = MOST_NODES * model.q0.shape[0]
    v = q + MOST_NODES * n
    a = v + MOST_NODES * n
    rel = a + MOST_NODES * n_pair * pose_size(model)
    maps = rel + MOST_NODES * model.home.shape[0] * window_size(model)
    change = maps + 5 * n
    row = change + model.size[0]
    inverse = row + n
    reached = inverse + n_pair
    when = reached + MOST_NODES
    each = rows[:vectors].reshape((10, MOST_NODES, width))
    for d in range(m):
        room[row + d] = 1.0 / model.mass[d]
    return Nodes(
        each[0], each[1], each[2], each[3], each[4], each[5], each[6], each[7], each[8], each[9], rows[vectors],
        rows[vectors + 1], rows[vectors + 2], rows[by_x:by_y].reshape((MOST_NODES, size, width)),
        rows[by_y:by_q].reshape((MOST_NODES, size, width)), room[:q].reshape((MOST_NODES, model.q0.shape[0])),
        room[q:v].reshape((MOST_NODES, n)), room[v:a].reshape((MOST_NODES, n)),
        room[a:rel].reshape((MOST_NODES, n_pair, pose_size(model))),
        room[rel:maps].reshape((MOST_NODES, model.home.shape[0], window_size(model))), rows[by_q:by_v], rows[by_v:],
        room[maps:change].reshape((5, n)), room[change:row], room[row:inverse], room[inverse:reached],
        room[reached:when],
        room[when:].reshape((MOST_NODES, n_pair, sums_size(model))),  # those of pairs without members stay zero
    )  # fmt: skip


@part
def is_dense(nodes):
    """Whether slopes are multiplied as dense matrices."""
    return nodes.by_q.shape[0] > 0


@kernel
def is_coupled(model, workspace):
    """Whether accelerations depend on velocities of other bodies than their own."""
    return workspace.switches[DAMPED] != 0


@part
def has_rates(model, workspace):
    """Whether accelerations at nodes depend on velocities: where anything is damped, and in space, where turning
    bodies have gyroscopic moments."""
    return is_coupled(model, workspace) or is_spatial(model)


@kernel
def balance_nodes(model, member_state, segment, s, energies, q0, rel0, workspace, history, o, nodes, work):
    """Compute accelerations G and their slopes at the first nodes, from their x and y, in one pass over the springs.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      segment, s: segment of `model.times`, and how many nodes.
      energies: whether sums have energies and their slopes, too.
      q0 (n_q,): coordinates at the start of the window.
      rel0 (n_pair, POSE): relative poses at the start of the motion.
    In and out:
      nodes: of each of these nodes x, y and the time are read, and q, v, a, g, relative poses, sums, maps and dense
        slopes written; how far each pair has been from its start is kept.
      workspace: workspace of a balance, overwritten.
      history, o: the history of steps, where K, C and the slopes of the loads are kept as those of stages from o on.
      work (WORK,): counts of work, added to.
    """
    for i in range(s):
        window_state(model, q0, nodes.x[i], nodes.y[i], nodes.q[i], nodes.v[i])
        place_pairs(model, nodes.q[i], nodes.v[i], np.bool_(True), workspace, nodes.rel[i], nodes.sums[i])
        for p in range(model.pair.shape[0]):
            if workspace.carries[p] == 0:  # bodies that are tied to nothing move, too
                turned_pose(model, p, workspace.turned, nodes.q[i], nodes.v[i], nodes.rel[i])
    sums_at_poses(model, segment, nodes.when, member_state, nodes.rel, s, energies, nodes.sums)
    work[FORCES] += s
    work[TANGENTS] += s
    for i in range(s):
        _balance(model, member_state, segment, i, rel0, workspace, history, o + i, nodes)


@kernel
def _balance(model, member_state, segment, i, rel0, workspace, history, o, nodes):
    """`balance_nodes` of one node, from its relative poses and sums over members.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      segment, i: segment of `model.times`, and the number of the node.
      rel0 (n_pair, POSE): relative poses at the start of the motion.
    In and out:
      nodes: of the node q, v, relative poses, sums and the time are read, the rest is written.
      workspace: workspace of a balance, overwritten.
      history, o: the history of steps, and the stage of it that is the node's.
    """
    q = nodes.q[i]
    v = nodes.v[i]
    a = nodes.a[i]
    rel = nodes.rel[i]
    forces_of_sums(
        model, member_state, segment, nodes.when[i], q, v, np.bool_(True), rel, nodes.sums[i], history.K[o],
        history.C[o], history.turn[o], workspace,
    )  # fmt: skip
    for d in range(a.shape[0]):
        a[d] = nodes.inverse[d] * workspace.f[d]
    if workspace.switches[TURNING] == 0:
        history.turn[o] = 0.0
    if is_coupled(model, workspace):
        for p in range(model.pair.shape[0]):
            if workspace.carries[p] == 0:
                history.C[o, p] = 0.0
    window_rates_with_maps(model, nodes.x[i], nodes.y[i], a, nodes.g[i], nodes.maps[i])
    for p in range(model.pair.shape[0]):
        nodes.reached[p] = max(nodes.reached[p], deflection(model, rel, rel0, p))
    if is_dense(nodes):
        fill_slopes(
            model, workspace, history, o, nodes.inverse, nodes.maps[i], np.bool_(False), nodes.by_q, nodes.by_v,
            nodes.by_x[i], nodes.by_y[i],
        )  # fmt: skip


@kernel
def fill_slopes(model, workspace, history, o, inverse, maps, by_rows, by_q, by_v, by_x, by_y):
    """Write G_x and G_y of a node as dense matrices, by columns, or by rows.

    In:
      model: the compiled scene.
      workspace: the workspace, for its switches.
      history, o: the history of steps, and the stage whose K, C and slopes of loads are meant.
      inverse (n,): inverse masses and inertias; 0 of ground.
      maps (n_body, MAPS): of the node.
      by_rows: whether by rows.
    Out:
      by_q, by_v (M, W): scratch.
      by_x, by_y (M, W): the slopes; by_y stays zero where there are none (`has_rates`).
    """
    coupled = is_coupled(model, workspace)
    rates = has_rates(model, workspace)
    m = by_q.shape[0]
    each = freedoms(model)
    for d in range(m):
        for e in range(0, by_q.shape[1], lanes()):
            store(by_q[d], e, zero())
            if rates:
                store(by_v[d], e, zero())
    for p in range(model.pair.shape[0]):
        for i in range(4):
            row = each * model.pair[p, i // 2]
            column = each * model.pair[p, i % 2]
            if row < m and column < m:
                first = each * (i // 2)
                _subtract_block(inverse, history.K[o, p], first, each * (i % 2), row, column, each, by_q)
                if coupled:
                    _subtract_block(inverse, history.C[o, p], first, each * (i % 2), row, column, each, by_v)
    turn = history.turn[o]
    turns = rotations(model)
    if workspace.switches[TURNING] != 0:
        for first in range(0, m, each):
            column = first + each - turns
            for d in range(first, first + each):
                for r in range(turns):
                    by_q[d, column + r] += inverse[d] * turn[d, r]
                for r in range(turns, load_slopes(model)):
                    by_v[d, column + r - turns] += inverse[d] * turn[d, r]
    window_slopes(model, maps, coupled, by_q, by_v)
    if by_rows:
        take_rows(by_q, np.int64(m), by_x)
        if rates:
            take_rows(by_v, np.int64(m), by_y)
        return
    for d in range(m):
        for e in range(m):
            by_x[e, d] = by_q[d, e]
        if not rates:
            continue
        first = 0 if coupled else d - d % each
        last = m if coupled else first + each
        for e in range(first, last):  # zero elsewhere, and always was
            by_y[e, d] = by_v[d, e]


@part
def _subtract_block(inverse, k, first, second, row, column, each, out):
    """out -= M^-1 k, of the block of one body's rows and another's columns.

    inverse (n,): inverse masses. k (2 D, 2 D): of a pair. first, second: where its rows and its columns begin there.
    row, column, each: where they begin in `out` (M, W), and how many they are.
    """
    for r in range(each):
        w = inverse[row + r]
        own = out[row + r]
        given = k[first + r]
        for c in range(0, each, 3):  # three at once, as no other number is read in between
            put(own, column + c, minus(vector_at(own, column + c), times(w, vector_at(given, second + c))))


@kernel
def add_changes(model, workspace, history, o, maps, inverse, dx, dy, change, row, u):
    """Add the changes of G at a node to u (W,): u += G_x dx + G_y dy, by pairs.

    In:
      model: the compiled scene.
      workspace: the workspace, for its switches.
      history, o: the history of steps, and the stage whose K, C and slopes of loads are meant.
      maps (n_body, MAPS): of the node.
      inverse (n,): inverse masses and inertias; 0 of ground.
      dx, dy (W,): changes.
    Out:
      u (W,): added to.
      change (4 or more, n), row (n_row,): scratch; zero at ground.
    """
    dq = change[0]
    dv = change[1]
    da = change[2]
    force = change[3]
    window_jvp(model, maps, dx, dy, dq, dv, da)
    force[:] = 0.0
    accelerations_jvp(model, workspace, history.K[o], history.C[o], history.turn[o], dq, dv, force, row)
    for d in range(force.shape[0]):
        force[d] = inverse[d] * force[d] - da[d]
    window_turn(model, maps, np.bool_(True), np.bool_(False), force)
    for d in range(moving(model)):
        u[d] += force[d]


@kernel
def pull_changes(model, workspace, history, o, maps, inverse, x, change, bar_x, bar_y):
    """The transpose of `add_changes`: bar_x, bar_y (W,) = G_x^T x, G_y^T x at a node, by pairs.

    In:
      model: the compiled scene.
      workspace: the workspace, for its switches.
      history, o: the history of steps, and the stage whose K, C and slopes of loads are meant.
      maps (n_body, MAPS): of the node.
      inverse (n,): inverse masses and inertias; 0 of ground.
      x (W,): cotangent of u.
    Out:
      bar_x, bar_y (W,): overwritten.
      change (5, n): scratch; its last row is the virtual displacement of the balance.
    """
    bar_q = change[0]
    bar_v = change[1]
    bar_a = change[2]
    z = change[4]
    change[:] = 0.0
    for d in range(moving(model)):
        z[d] = x[d]
    window_turn(model, maps, np.bool_(True), np.bool_(True), z)
    for d in range(z.shape[0]):
        bar_a[d] = -z[d]
        z[d] = inverse[d] * z[d]
    matrices_vjp(model, history.K[o], z, bar_q)
    if workspace.switches[DAMPED] != 0:
        matrices_vjp(model, history.C[o], z, bar_v)
    turns_vjp(model, history.turn[o], z, bar_q, bar_v)
    window_vjp(model, maps, bar_q, bar_v, bar_a, bar_x, bar_y)


@kernel
def spread_balance(model, history, o, s, workspace, nodes):
    """Copy accelerations and slopes of node 0 to nodes 1 to s - 1: as a prediction has them.

    model: the compiled scene. history, o: the history of steps, and its stage of node 0. s: number of nodes.
    workspace: the workspace, for its switches. nodes: the room of the window.
    """
    rates = has_rates(model, workspace)
    for i in range(1, s):
        copy_vector(nodes.g[0], nodes.g[i])
        if is_dense(nodes):
            take_rows(nodes.by_x[0], np.int64(nodes.by_x.shape[1]), nodes.by_x[i])
            if rates:
                take_rows(nodes.by_y[0], np.int64(nodes.by_y.shape[1]), nodes.by_y[i])
            continue
        copy_vector(nodes.maps[0].reshape(nodes.maps[0].size), nodes.maps[i].reshape(nodes.maps[i].size))
        copy_vector(history.K[o].reshape(history.K[o].size), history.K[o + i].reshape(history.K[o].size))
        copy_vector(history.C[o].reshape(history.C[o].size), history.C[o + i].reshape(history.C[o].size))
        copy_vector(history.turn[o].reshape(history.turn[o].size), history.turn[o + i].reshape(history.turn[o].size))


@part
def add_rate_products(model, matrix, x, s, coupled, out):
    """out[i] += sum_d x[i, d] matrix[i, d] for i < s, with slopes by y.

    model: the compiled scene. matrix (s or more, n, W): the slopes, or their transposes.
    x (s or more, W), s: rows, and how many.
    coupled: whether bodies' velocities are coupled; otherwise only turning rates have slopes.
    out (s or more, W): in and out.
    """
    each = freedoms(model)
    begin = 0 if coupled else each - rotations(model)
    for e in range(0, out.shape[1], lanes()):
        for i in range(s):
            y = load(out[i], e)
            for first in range(0, matrix.shape[1], each):
                for d in range(first + begin, first + each):
                    y += x[i, d] * load(matrix[i, d], e)
            store(out[i], e, y)


@kernel
def solve_nodes(model, planes, s, h, history, o, workspace, nodes, weight, share, accuracy, work):
    """Solve the linearised equations of a window for u at its nodes, by iterations.

    In:
      model: the compiled scene.
      planes (7, s_max, s_max), s: of `gauss_tables`, for this number of nodes.
      h: length of the window (s).
      history, o: the history of steps, and its stage of node 0: K, C and slopes of the loads.
      workspace: the workspace, for its switches.
      weight (W,): of `motion_weights`.
      share: of the square of the correction to which iterations go: what the linearisation is off by.
      accuracy: relative change of the states at which to stop at the latest.
    In and out:
      nodes: with g, slopes, ref_x and ref_y; u is a first guess, then the solution, and x and y are those of it.
      work (WORK,): counts of work, added to.

    Returns the relative correction of x against ref_x, or -1 where the iterations do not contract.
    """
    correction = 0.0
    last = np.inf
    growing = 0
    c = planes[0, 0]
    rates = has_rates(model, workspace)
    for iteration in range(81):
        change = move_to_nodes(
            planes[2], s, h * h, nodes.none, nodes.ahead, c, nodes.u, weight, nodes.ref_x, nodes.x, nodes.dx
        )
        if rates:
            integrate_to_nodes(planes[1], s, s, h, nodes.start, nodes.none, c, nodes.u, nodes.y)
        if iteration > 0:
            work[BODY_ITERATIONS] += 1
            if iteration == 1:
                correction = largest_difference(nodes.x, nodes.ref_x, weight, s)
            if not change <= 1e8:
                return -1.0
            if change <= max(share * correction * correction, accuracy, 1e-15):
                break
            if change >= last and change < ROUNDING:
                break
            growing = growing + 1 if change >= last else 0
            if growing >= 3 or iteration == 80:
                return -1.0
            last = change
        if rates:
            subtract_rows(nodes.y, nodes.ref_y, s, nodes.dy)
        if is_dense(nodes):
            add_products(nodes.by_x, nodes.dx, s, nodes.g, nodes.u)
            if rates:
                add_rate_products(model, nodes.by_y, nodes.dy, s, is_coupled(model, workspace), nodes.u)
            continue
        for i in range(s):
            copy_vector(nodes.g[i], nodes.u[i])
            add_changes(
                model, workspace, history, o + i, nodes.maps[i], nodes.inverse, nodes.dx[i], nodes.dy[i], nodes.change,
                nodes.row, nodes.u[i],
            )  # fmt: skip
    if not rates:
        integrate_to_nodes(planes[1], s, s, h, nodes.start, nodes.none, c, nodes.u, nodes.y)
    return largest_difference(nodes.x, nodes.ref_x, weight, s)


@kernel
def keep_nodes(model, q0, s, t, h, planes, history, o, nodes):
    """Keep the states, accelerations and coefficients of a window that is accepted.

    model: the compiled scene. q0 (n_q,): coordinates at its start. s: number of its nodes.
    t, h: time at its start, and its length (s). planes (7, s_max, s_max): of `gauss_tables`.
    history, o: the history of steps, and its stage of node 0.
    nodes: x, y, u and the coefficients; q, v and a become those that belong to them.
    """
    for i in range(s):
        window_state(model, q0, nodes.x[i], nodes.y[i], nodes.q[i], nodes.v[i])
        window_accelerations(model, nodes.x[i], nodes.y[i], nodes.u[i], nodes.a[i])
        history.when[o + i] = t + h * planes[0, 0, i]
        copy_vector(nodes.q[i], history.stage_q[o + i])
        copy_vector(nodes.v[i], history.stage_v[o + i])
        copy_vector(nodes.a[i], history.stage_a[o + i])
        own = history.window[o + i]
        for d in range(moving(model)):
            own[0, d] = nodes.coef[i, d]
            own[1, d] = nodes.x[i, d]
            own[2, d] = nodes.y[i, d]
            own[3, d] = nodes.u[i, d]
