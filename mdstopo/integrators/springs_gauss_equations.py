"""The linearised balance of a window of Gauss collocation, solved by iterations that touch no member.

    a_j = M^-1 (F_j - K_j (q_j(a) - q_j) - C_j (v_j(a) - v_j))

and its transpose. Tangents of few coordinates are multiplied as dense matrices, in whole vectors; others by pairs.
"""

from collections import namedtuple

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.vector import lanes, store, zero
from mdstopo.integrators.rows import (
    add_products,
    integrate_to_nodes,
    largest_difference,
    move_to_nodes,
    scale_rows,
    subtract_rows,
    take_rows,
)
from mdstopo.integrators.steps import BODY_ITERATIONS
from mdstopo.mechanics.assembly import (
    add_turning,
    add_turning_transposed,
    subtract_products,
    subtract_transposed,
)

#: what the windows of one simulation work in: at nodes (first index), of pairs, of the state at the start; rows (10,
#: nodes, W) and vectors (11, W) as in `rows`: those that `solve_accelerations` works in are rows 2 to 4,
#: `springs_gauss` names the others. Made once, by a function of its own: arrays that a kernel is given cost it no
#: counting of references
Room = namedtuple("Room", "t rel sums K C turn dense rows vectors motion noise scale rel0 K0 C0")

#: relative change at which the estimate of the fastest rate is settled: closely, and for a first window's length
CLOSELY, ABOUT = 1e-3, 1e-2

#: coordinates up to which tangents are multiplied as dense matrices
DENSE = 24


@part
def solve_nodes(
    pair, inv_mass, planes, s, q0, v0, hv0, none, h, f, own, damped, turning, alike, weight, accuracy, ref, a,
    q, v, work,
):  # fmt: skip
    """Solve the linearised balance of a window for the accelerations at its nodes by iterations. Rows as in `rows`.

    In:
      pair (n_pair, 2): the bodies of each pair.
      inv_mass (W,): inverse masses and inertias (1/kg, 1/(kg m^2)).
      planes (7, s_max, s_max): of `gauss_tables`, for this number of nodes.
      s: number of nodes.
      q0, v0 (W,): coordinates and velocities at the start of the window.
      hv0 (W,): h v0.
      none (W,): zeros.
      h: length of the window (s).
      f (s or more, W): forces at ref (N, N m).
      own: room (`Room`), with the tangents at ref; its rows 2 to 4 and its dense matrices are overwritten.
      damped: whether any force depends on velocity.
      turning: whether loads turn.
      alike: whether the tangents are the same at all nodes, as in a prediction.
      weight (W,): of `motion_weights`.
      accuracy: relative change of the states at which to stop.
      ref (2, s or more, W): q and v at the nodes, about which the balance is linear.
    In and out:
      a (s or more, W): accelerations at the nodes; a first guess before.
    Out:
      q, v (s or more, W): the states at the nodes that belong to a.
      work (WORK,): counts of work, added to.

    Returns the relative correction of the states against ref, or -1 where the iterations do not contract.
    """
    k = own.K
    c = own.C
    turn = own.turn
    rest = own.rows[2]  # M^-1 f, to which dense products are added; rhs is f and the products by pairs
    dx = own.rows[3]
    rhs = own.rows[4]
    dense = own.dense.shape[2] > 0
    if dense:
        scale_rows(inv_mass, f, s, rest)
        different = np.int64(1) if alike else s
        fill_dense(pair, k, turn, turning, inv_mass, different, np.bool_(False), own.dense[0])
        if damped:
            fill_dense(pair, c, turn, np.bool_(False), inv_mass, different, np.bool_(False), own.dense[1])
        for kind in range(own.dense.shape[0]):
            for i in range(different, s):
                take_rows(own.dense[kind, 0], np.int64(own.dense.shape[2]), own.dense[kind, i])
    q_ref = ref[0]
    v_ref = ref[1]
    nodes = planes[0, 0]
    first = planes[1]
    second = planes[2]
    # what the linearisation is off by grows with the square of what it corrects; a prediction is off by more
    share = 1e-2 if alike else 1e-3
    # what rounding of the positions leaves in an iteration's change, where bodies move by little of where they are
    rounding = 1e-13
    for d in range(q0.shape[0]):
        rounding = max(rounding, min(1e-14 * weight[d] * abs(q0[d]), 1e-6))
    correction = 0.0
    last = np.inf
    growing = 0
    for iteration in range(81):
        change = move_to_nodes(second, s, h * h, q0, hv0, nodes, a, weight, q_ref, q, dx)
        if damped:
            integrate_to_nodes(first, s, s, h, v0, none, nodes, a, v)
        if iteration > 0:
            work[BODY_ITERATIONS] += 1
            if iteration == 1:
                correction = largest_difference(q, q_ref, weight, s)
            if not change <= 1e8:
                return -1.0
            enough = max(share * correction * correction, accuracy, 1e-15)
            if change <= enough or (change >= last and change < rounding):
                break
            growing = growing + 1 if change >= last else 0
            if growing >= 3 or iteration == 80:
                return -1.0
            last = change
        if dense:
            add_products(own.dense[0], dx, s, rest, a)
            if damped:
                subtract_rows(v, v_ref, s, dx)
                add_products(own.dense[1], dx, s, a, a)
            continue
        take_rows(f, s, rhs)
        subtract_products(pair, k, dx, rhs, s)
        if turning:
            add_turning(turn, dx, rhs, s)
        if damped:
            subtract_rows(v, v_ref, s, dx)
            subtract_products(pair, c, dx, rhs, s)
        scale_rows(inv_mass, rhs, s, a)
    if not damped:
        integrate_to_nodes(first, s, s, h, v0, none, nodes, a, v)
    return largest_difference(q, q_ref, weight, s)


@kernel
def dense_rows(n):
    """Rows of a dense matrix of n coordinates; none where pairs are multiplied one by one."""
    return n if n <= DENSE else 0


@part
def fill_dense(pair, k, turn, turning, inverse, s, transposed, out):
    """Write the tangents of all nodes as dense matrices M^-1 (load tangent - K), by columns.

    The few numbers of a few bodies are multiplied faster in whole vectors than pair by pair.

    In:
      pair (n_pair, 2): the bodies of each pair.
      k (s or more, n_pair, 6, 6): K of each pair.
      turn (s or more, n): derivative of the loads by the angle of their body, read if they turn.
      turning: whether loads turn.
      inverse (n or more,): inverse masses and inertias (1/kg, 1/(kg m^2)).
      s: number of nodes.
      transposed: by rows instead.
    Out:
      out (s or more, n, W): overwritten, with zeros at and beyond n in each row.
    """
    for i in range(s):
        m = out[i]
        for d in range(m.shape[0]):
            for e in range(0, m.shape[1], lanes()):
                store(m[d], e, zero())
        for p in range(pair.shape[0]):
            a = 3 * pair[p, 0]
            b = 3 * pair[p, 1]
            for r in range(6):
                d = a + r if r < 3 else b + r - 3
                for j in range(6):
                    e = a + j if j < 3 else b + j - 3
                    if transposed:
                        m[d, e] -= inverse[d] * k[i, p, r, j]
                    else:
                        m[e, d] -= inverse[d] * k[i, p, r, j]
        if turning:
            for d in range(m.shape[0]):
                e = d - d % 3 + 2
                if transposed:
                    m[d, e] += inverse[d] * turn[i, d]
                else:
                    m[e, d] += inverse[d] * turn[i, d]


@part
def fastest_rate(pair, inv_mass, k, c, damped, settled):
    """Estimate the largest |eigenvalue| of the first-order system at one state by power iteration (1/s).

    pair (n_pair, 2): the bodies of each pair.
    inv_mass (n,): inverse masses and inertias (1/kg, 1/(kg m^2)).
    k, c (1 or more, n_pair, 6, 6): -dF/dq and -dF/dv of each pair; c is read if damped.
    damped: whether any force depends on velocity.
    settled: relative change at which the iteration ends.
    """
    n = inv_mass.shape[0]
    x = np.empty((1, n))
    y = np.empty((1, n))
    rate = 0.0
    for kind in range(2 if damped else 1):
        for d in range(n):
            x[0, d] = np.sqrt(inv_mass[d]) * (1.0 + 0.1 * (d % 7))
        value = 0.0
        for _ in range(12):
            last = value
            size = 0.0
            for d in range(n):
                if inv_mass[d] > 0.0:
                    size += x[0, d] * x[0, d] / inv_mass[d]
            value = np.sqrt(size)
            if value == 0.0 or abs(value - last) <= settled * value:
                break
            for d in range(n):
                x[0, d] /= value
                y[0, d] = 0.0
            subtract_products(pair, k if kind == 0 else c, x, y, np.int64(1))
            for d in range(n):
                x[0, d] = inv_mass[d] * y[0, d]
        rate = np.sqrt(value) if kind == 0 else max(rate, 1.5 * value)
    return rate


@part
def accelerations_vjp(pair, k, c, turn, dense, inverse, x, s, damped, turning, z, u, y):
    """Multiply by the transposed tangents: u = (load tangent - K)^T M^-1 x and, if damped, y = -C^T M^-1 x, at s nodes.

    In:
      pair (n_pair, 2): the bodies of each pair.
      k, c (s, n_pair, 6, 6): -dF/dq and -dF/dv of each pair; c is read if damped.
      turn (s, n): derivative of the loads by the angle of their body, read if they turn.
      dense (1 or 2, s, n, W): the same of `fill_dense`, transposed, or (.., 0, W): then pair by pair.
      inverse (W,): inverse masses and inertias (1/kg, 1/(kg m^2)).
      x (s, W): what is multiplied.
      s: number of nodes.
      damped: whether any force depends on velocity.
      turning: whether loads turn.
    Out:
      u, y (s, W): the products.
    Room:
      z (s, W).
    """
    u[:] = 0.0
    if damped:
        y[:] = 0.0
    if dense.shape[2] > 0:
        add_products(dense[0], x, s, u, u)
        if damped:
            add_products(dense[1], x, s, y, y)
        return
    scale_rows(inverse, x, s, z)
    subtract_transposed(pair, k, z, u, s)
    if turning:
        add_turning_transposed(turn, z, u, s)
    if damped:
        subtract_transposed(pair, c, z, y, s)
