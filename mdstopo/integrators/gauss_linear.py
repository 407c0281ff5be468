"""Gauss collocation, linearised: dense output, the reverse step, the tangent step (`contract`).

All three work on the stages that `gauss.simulate` kept. Reverse and tangent steps solve the same linear balance of a
window, transposed or not, by sweeps that contract as the forward ones did.
"""

import numpy as np

from mdstopo.integrators.contract import implement
from mdstopo.integrators.gauss import COUNTS, TAG, GaussSteps, integrate_to_nodes
from mdstopo.integrators.steps import REVERSE, SWEEPS
from mdstopo.jit import kernel
from mdstopo.mechanics.assembly import (
    add_turning,
    add_turning_transposed,
    subtract_products,
    subtract_transposed,
)


@kernel
def _polynomials(c, s, first, second):  # type: ignore[no-untyped-def]
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
def point_of(model, tables, strength, steps, count, k, c, damped, q, v, work):  # type: ignore[no-untyped-def]
    """The collocation polynomial at fraction c of window k."""
    o = steps.index[k, 0]
    s = steps.index[k + 1, 0] - o
    h = steps.t[k + 1] - steps.t[k]
    state = steps.state[k]
    stage = steps.stage
    first = np.empty(s)
    second = np.empty(s)
    _polynomials(c, s, first, second)
    for d in range(q.shape[0]):
        q[d] = state[0, d] + h * c * state[1, d]
        v[d] = state[1, d]
    for j in range(s):
        for d in range(q.shape[0]):
            v[d] += h * first[j] * stage[o + j, 2, d]
            q[d] += h * h * second[j] * stage[o + j, 2, d]
    return k, c


@kernel
def _point_weights(legendre, s, c, beta_q, beta_v):  # type: ignore[no-untyped-def]
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
def parent_of(steps, w):  # type: ignore[no-untyped-def]
    """Windows follow one another."""
    return w - 1


@kernel
def stage_weights(tables, steps, w, out):  # type: ignore[no-untyped-def]
    """Gauss weights."""
    level = steps.index[w, 1]
    h = steps.t[w + 1] - steps.t[w]
    for j in range(COUNTS[level]):
        out[j] = h * tables[level, 0, 1, j]


@kernel
def carried(steps):  # type: ignore[no-untyped-def]
    """Nothing but q and v."""
    return 0


@kernel
def reverse_step(  # type: ignore[no-untyped-def]
    pair, inv_mass, tables, steps, w, c_point, mu_q, mu_v, stage_q_bar, lam_q, lam_v, lam_x, z, damped, turning, work
):
    """Duty 5 of the contract."""
    level = steps.index[w, 1]
    s = COUNTS[level]
    n = lam_q.shape[0]
    o = steps.index[w, 0]
    h = steps.t[w + 1] - steps.t[w]
    planes = tables[level]
    second = planes[2]
    first = planes[1]
    k = steps.K[o : o + s]
    c = steps.C[o : o + s] if damped else steps.C
    turn = steps.turn[o : o + s] if turning else steps.turn
    spread = stage_q_bar.shape[0] > 0
    work[REVERSE] += 1
    rhs = np.zeros((s, n))
    x = np.empty((s, n))
    u = np.empty((s, n))
    y = np.zeros((s, n))
    value = np.empty(n)
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
            x[j, d] = rhs[j, d]
    last = np.inf
    for _ in range(200):
        work[SWEEPS] += 1
        for i in range(s):
            for d in range(n):
                z[i, d] = inv_mass[d] * x[i, d]
                u[i, d] = 0.0
                y[i, d] = 0.0
        subtract_transposed(pair, k, z, u, s)
        if turning:
            add_turning_transposed(turn, z, u, s)
        if damped:
            subtract_transposed(pair, c, z, y, s)
        change = 0.0
        size = 0.0
        for j in range(s):
            for d in range(n):
                value[d] = rhs[j, d]
            for i in range(s):
                w_q = h * h * second[i, j]
                for d in range(n):
                    value[d] += w_q * u[i, d]
            if damped:
                for i in range(s):
                    w_v = h * first[i, j]
                    for d in range(n):
                        value[d] += w_v * y[i, d]
            for d in range(n):
                root = np.sqrt(inv_mass[d])
                change = max(change, root * abs(value[d] - x[j, d]))
                size = max(size, root * abs(value[d]))
                x[j, d] = value[d]
        if change <= 4e-16 * size or (change >= last and change <= 1e-13 * size):
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
def tangent_step(pair, inv_mass, tables, steps, w, c_point, dq, dv, dx, force, dq_stage, damped, turning):  # type: ignore[no-untyped-def]
    """Duty 6 of the contract."""
    level = steps.index[w, 1]
    s = COUNTS[level]
    n = dq.shape[0]
    o = steps.index[w, 0]
    h = steps.t[w + 1] - steps.t[w]
    planes = tables[level]
    k = steps.K[o : o + s]
    c = steps.C[o : o + s] if damped else steps.C
    turn = steps.turn[o : o + s] if turning else steps.turn
    da = np.zeros((s, n))
    dv_stage = np.empty((s, n))
    rhs = np.empty((s, n))
    none = np.zeros(n)
    hdv = h * dv
    last = np.inf
    for _ in range(200):
        integrate_to_nodes(planes[2], s, h * h, dq, hdv, planes[0, 0], da, dq_stage)
        rhs[:] = force
        subtract_products(pair, k, dq_stage, rhs, s)
        if turning:
            add_turning(turn, dq_stage, rhs, s)
        if damped:
            integrate_to_nodes(planes[1], s, h, dv, none, planes[0, 0], da, dv_stage)
            subtract_products(pair, c, dv_stage, rhs, s)
        change = 0.0
        size = 0.0
        for i in range(s):
            for d in range(n):
                value = inv_mass[d] * rhs[i, d]
                weight = 1.0 / np.sqrt(inv_mass[d]) if inv_mass[d] > 0.0 else 0.0
                change = max(change, weight * abs(value - da[i, d]))
                size = max(size, weight * abs(value))
                da[i, d] = value
        if change <= 4e-16 * size or (change >= last and change <= 1e-13 * size):
            break
        last = change
    integrate_to_nodes(planes[2], s, h * h, dq, hdv, planes[0, 0], da, dq_stage)
    beta_q = np.empty(s)
    beta_v = np.empty(s)
    reached = 1.0
    if c_point >= 0.0:
        reached = c_point
        _point_weights(planes[3], s, c_point, beta_q, beta_v)
    else:
        for j in range(s):
            beta_v[j] = planes[0, 1, j]
            beta_q[j] = planes[0, 2, j]
    for d in range(n):
        dq[d] += h * reached * dv[d]
        for j in range(s):
            dq[d] += h * h * beta_q[j] * da[j, d]
            dv[d] += h * beta_v[j] * da[j, d]


@kernel
def steps_of(tag, arrays):  # type: ignore[no-untyped-def]
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
    tangent_step=tangent_step,
    carried=carried,
)
