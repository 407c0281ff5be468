"""Gauss collocation, linearised: dense output, the reverse step (`steps_interface`).

Both work on the stages that `springs_gauss` kept. The reverse step solves the transposed linear balance of a window by
iterations that contract as the forward ones did.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.integrators.rows import (
    combine_rows,
    copy_row,
    make_rows,
    renew_rows,
    row_width,
    take_rows,
)
from mdstopo.integrators.springs_gauss import COUNTS, TAG, GaussSteps
from mdstopo.integrators.springs_gauss_equations import accelerations_vjp, dense_rows, fill_dense
from mdstopo.integrators.steps import BODY_ITERATIONS, FIRST, LEVEL, REVERSE, Q, V
from mdstopo.integrators.steps_interface import implement


@kernel
def _polynomials(c, s, first, second):
    """first, second (s,) = I1_k, I2_k at c, by recurrence."""
    x = 2.0 * c - 1.0
    below = 1.0
    here = x
    i_below = 0.0
    i_here = c
    value = 0.5 * c * c
    for k in range(s):
        above = ((2 * k + 3) * x * here - (k + 1) * below) / (k + 2)
        i_above = (above - below) / (2 * (2 * k + 3))
        if k > 0:
            value = (i_above - i_below) / (2 * (2 * k + 1))
        first[k] = i_here
        second[k] = value
        below = here
        here = above
        i_below = i_here
        i_here = i_above


@kernel
def point_of(model, tables, strength, steps, count, k, c, damped, q, v, work):
    """The collocation polynomial of window k; see `steps_interface.point_of`. Returns k and c."""
    o = steps.index[k, FIRST]
    s = steps.index[k + 1, FIRST] - o
    h = steps.t[k + 1] - steps.t[k]
    state = steps.state[k]
    stage = steps.stage
    first = np.empty(s)
    second = np.empty(s)
    _polynomials(c, s, first, second)
    for d in range(q.shape[0]):
        q[d] = state[Q, d] + h * c * state[V, d]
        v[d] = state[V, d]
    for j in range(s):
        for d in range(q.shape[0]):
            v[d] += h * first[j] * stage[o + j, 2, d]
            q[d] += h * h * second[j] * stage[o + j, 2, d]
    return k, c


@kernel
def _point_weights(legendre, s, c, beta_q, beta_v):
    """Weights of the node accelerations in q(c) (times h^2) and v(c) (times h)."""
    first = np.empty(s)
    second = np.empty(s)
    _polynomials(c, s, first, second)
    for j in range(s):
        beta_q[j] = 0.0
        beta_v[j] = 0.0
        for k in range(s):
            beta_q[j] += second[k] * legendre[k, j]
            beta_v[j] += first[k] * legendre[k, j]


@kernel
def parent_of(steps, w):
    """The window before: windows follow one another."""
    return w - 1


@kernel
def stage_weights(tables, steps, w, out):
    """Gauss weights, times the length of the window."""
    level = steps.index[w, LEVEL]
    h = steps.t[w + 1] - steps.t[w]
    for j in range(COUNTS[level]):
        out[j] = h * tables[level, 0, 1, j]


@kernel
def carried(steps):
    """None: a window takes over nothing but q and v."""
    return 0


@part
def reverse_step(
    pair, inv_mass, tables, steps, w, c_point, mu_q, mu_v, stage_q_bar, lam_q, lam_v, lam_x, z, damped, turning,
    accuracy, work,
):  # fmt: skip
    """By iterations of the window's transposed equations; see `steps_interface.reverse_step`. Not used: lam_x."""
    level = steps.index[w, LEVEL]
    s = COUNTS[level]
    n = lam_q.shape[0]
    o = steps.index[w, FIRST]
    h = steps.t[w + 1] - steps.t[w]
    planes = tables[level]
    second = planes[2]
    first = planes[1]
    k = steps.K[o : o + s]
    c = steps.C[o : o + s] if damped else steps.C
    turn = steps.turn[o : o + s] if turning else steps.turn
    spread = stage_q_bar.shape[0] > 0
    work[REVERSE] += 1
    width = row_width(n)
    rows = make_rows(6 * s, n).reshape((6, s, width))
    rhs = rows[0]
    x = rows[1]
    u = rows[2]
    y = rows[3]
    z_row = rows[4]
    value = rows[5]
    inverse = np.zeros(width)  # of the masses
    root = np.zeros(width)
    copy_row(inv_mass, inverse)
    for d in range(n):
        root[d] = np.sqrt(inv_mass[d])
    back_q = np.empty((s, s))  # the integrations, transposed
    back_v = np.empty((s, s))
    for i in range(s):
        for j in range(s):
            back_q[j, i] = second[i, j]
            back_v[j, i] = first[i, j]
    beta_q = np.zeros(s)
    beta_v = np.zeros(s)
    if c_point >= 0.0:
        _point_weights(planes[3], s, c_point, beta_q, beta_v)
    for j in range(s):
        end_q = h * h * planes[0, 2, j]
        end_v = h * planes[0, 1, j]
        for d in range(n):
            rhs[j, d] = end_q * lam_q[d] + end_v * lam_v[d]
            rhs[j, d] += h * h * beta_q[j] * mu_q[d] + h * beta_v[j] * mu_v[d]
            if spread:
                for i in range(s):
                    rhs[j, d] += h * h * second[i, j] * stage_q_bar[i, d]
    take_rows(rhs, s, x)
    kinds = 2 if damped else 1
    dense = make_rows(kinds * s * dense_rows(n), n).reshape((kinds, s, dense_rows(n), width))
    if dense.shape[2] > 0:
        fill_dense(pair, k, turn, turning, inverse, s, np.bool_(True), dense[0])
        if damped:
            fill_dense(pair, c, turn, np.bool_(False), inverse, s, np.bool_(True), dense[1])
    last = np.inf
    for _ in range(200):
        work[BODY_ITERATIONS] += 1
        accelerations_vjp(pair, k, c, turn, dense, inverse, x, s, damped, turning, z_row, u, y)
        if damped:
            combine_rows(back_v, s, s, h, rhs, y, value)
            change, size = renew_rows(back_q, s, h * h, value, u, root, x)
        else:
            change, size = renew_rows(back_q, s, h * h, rhs, u, root, x)
        if change <= max(accuracy, 4e-16) * size or (change >= last and change <= 1e-13 * size):
            break
        last = change
    for d in range(n):
        position = lam_q[d] + mu_q[d]
        speed = lam_v[d] + h * lam_q[d] + mu_v[d] + h * max(c_point, 0.0) * mu_q[d]
        for i in range(s):
            z[i, d] = inv_mass[d] * x[i, d]
            reached = u[i, d] + (stage_q_bar[i, d] if spread else 0.0)
            position += reached
            speed += h * planes[0, 0, i] * reached + y[i, d]
        lam_q[d] = position
        lam_v[d] = speed


@kernel
def steps_of(tag, arrays):
    """The arrays as this method's steps."""
    return GaussSteps(*arrays)


implement(
    GaussSteps,
    TAG,
    steps_of=steps_of,
    point_of=point_of,
    parent_of=parent_of,
    stage_weights=stage_weights,
    reverse_step=reverse_step,
    carried=carried,
)
