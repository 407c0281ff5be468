"""Generalized-alpha, linearised: dense output, the reverse step (`steps_interface`).

Between two steps q is the cubic through both ends with their velocities, and v is its derivative, so that a peak of a
response is a stationary point of the very motion it is read from. What a step takes over from the one before beside
q and v are the acceleration and the auxiliary one (rows 0 and 1 of lam_x); a step that starts a segment of the loads
makes its own.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.integrators.banded import half_width, solve
from mdstopo.integrators.springs_generalized_alpha import TAG, AlphaSteps, effective_matrix, weights_of
from mdstopo.integrators.steps import ENERGY, ENERGY_RATE, FIRST, REVERSE, STARTS, TIME
from mdstopo.integrators.steps_interface import implement
from mdstopo.mechanics.assembly import (
    add_turning_transposed,
    subtract_transposed,
)
from mdstopo.mechanics.kinematics.planar_steps import hermite


@part
def cubic(start, end, h, c, q, v):
    """The cubic between the ends of a step, and its derivative, at a fraction of it.

    In:
      start, end (2 or more, n): q and q' at the ends of the step.
      h: its length (s).
      c: the fraction, 0 to 1.
    Out:
      q, v (n,): the cubic and its derivative.
    """
    q0, v0, q1, v1, dq0, dv0, dq1, dv1 = hermite(c)
    for d in range(q.shape[0]):
        q[d] = q0 * start[0, d] + q1 * end[0, d] + h * (v0 * start[1, d] + v1 * end[1, d])
        v[d] = (dq0 * start[0, d] + dq1 * end[0, d]) / h + dv0 * start[1, d] + dv1 * end[1, d]


@kernel
def point_of(model, tables, strength, steps, count, k, c, damped, q, v, work):
    """The cubic between the ends of step k, and its derivative; see `steps_interface.point_of`. Returns k and c."""
    cubic(steps.state[k], steps.state[k + 1], steps.t[k + 1] - steps.t[k], c, q, v)
    return k, c


@kernel
def sample(steps, count, damped, t, g, d):
    """Every end of a step: what else is a stage is there already, or off the motion; see `steps_interface.sample`."""
    for k in range(count - 1):
        o = steps.index[k + 1, FIRST] - 1
        t[k] = steps.scalar[o, TIME]
        g[k] = steps.scalar[o, ENERGY]
        d[k] = steps.scalar[o, ENERGY_RATE]
    return count - 1


@kernel
def parent_of(steps, w):
    """The step before: steps follow one another."""
    return w - 1


@kernel
def stage_weights(tables, steps, w, out):
    """The trapezoidal rule: half of each step next to it for an end, nothing for a stage off the motion."""
    h = steps.t[w + 1] - steps.t[w]
    out[:] = 0.0
    last = out.shape[0] - 1
    out[last] = 0.5 * h
    if last > 0:
        out[0] = 0.5 * h
    # a following step without a stage at its start leaves that half to this step's end
    if steps.index[w + 1, STARTS] == 0:
        out[last] += 0.5 * (steps.t[w + 2] - steps.t[w + 1])


@kernel
def carried(steps):
    """Two: a step takes over the acceleration and the auxiliary one, too."""
    return 2


@part
def reverse_step(
    pair, inv_mass, tables, steps, w, c_point, mu_q, mu_v, stage_q_bar, lam_q, lam_v, lam_x, z, damped, turning,
    accuracy, work,
):  # fmt: skip
    """By the transposed Newton matrix of the step's end; see `steps_interface.reverse_step`.

    lam_x (2, n) belongs to the accelerations and the auxiliary ones. Not used: accuracy.
    """
    n = lam_q.shape[0]
    o = steps.index[w, FIRST]
    last = steps.index[w + 1, FIRST] - 1 - o
    h = steps.t[w + 1] - steps.t[w]
    e1, e2, e3, beta, gamma, lag = weights_of(tables[0])
    spread = stage_q_bar.shape[0] > 0
    half = half_width(pair, inv_mass)
    band = np.empty((n, 3 * half + 1))
    pivots = np.empty(n, np.int64)
    bar_q = np.zeros((1, n))
    bar_v = np.zeros((1, n))
    bar_a = np.zeros(n)
    bar_x = np.zeros(n)
    start_q = np.zeros(n)
    start_v = np.zeros(n)
    work[REVERSE] += 1
    for d in range(n):
        bar_q[0, d] = lam_q[d]
        bar_v[0, d] = lam_v[d]
    if c_point >= 0.0:
        q0, v0, q1, v1, dq0, dv0, dq1, dv1 = hermite(c_point)
        for d in range(n):
            start_q[d] = q0 * mu_q[d] + dq0 / h * mu_v[d]
            start_v[d] = h * v0 * mu_q[d] + dv0 * mu_v[d]
            bar_q[0, d] += q1 * mu_q[d] + dq1 / h * mu_v[d]
            bar_v[0, d] += h * v1 * mu_q[d] + dv1 * mu_v[d]
    effective_matrix(
        pair, inv_mass, steps.K[o + last], steps.C[o + last] if damped else steps.K[o + last],
        steps.turn[o + last] if turning else start_q, h * h * beta * e1, h * gamma * e1, damped, turning,
        np.bool_(True), half, band, pivots,
    )  # fmt: skip
    # stages from the last to the first: the derivative by a stage's acceleration, its z, and then that by its state
    for j in range(last, -1, -1):
        x = z[j]
        if j == last:
            for d in range(n):
                if spread:
                    bar_q[0, d] += stage_q_bar[j, d]
                x[d] = lam_x[0, d] + e1 * (lam_x[1, d] + h * (h * beta * bar_q[0, d] + gamma * bar_v[0, d]))
            solve(band, half, pivots, x)
        else:
            for d in range(n):
                bar_q[0, d] = stage_q_bar[j, d] if spread else 0.0
                bar_v[0, d] = 0.0
                x[d] = bar_a[d] if j == 0 else -bar_x[d]
        for d in range(n):
            x[d] *= inv_mass[d]
        stage_z = z[j : j + 1]
        subtract_transposed(pair, steps.K[o + j : o + j + 1], stage_z, bar_q, 1)
        if turning:
            add_turning_transposed(steps.turn[o + j : o + j + 1], stage_z, bar_q, 1)
        if damped:
            subtract_transposed(pair, steps.C[o + j : o + j + 1], stage_z, bar_v, 1)
        for d in range(n):
            start_q[d] += bar_q[0, d]
            start_v[d] += bar_v[0, d]
            if j == last:
                reach_q = h * h * bar_q[0, d]
                reach_v = h * bar_v[0, d]
                start_v[d] += h * bar_q[0, d]
                bar_a[d] = e2 * (lam_x[1, d] + beta * reach_q + gamma * reach_v)
                bar_x[d] = (0.5 - beta) * reach_q + (1.0 - gamma) * reach_v
                bar_x[d] -= e3 * (lam_x[1, d] + beta * reach_q + gamma * reach_v)
                if last == 1:
                    bar_a[d] += bar_x[d]
                elif last == 2:
                    bar_a[d] += 2.0 * bar_x[d]
            elif j == 1:
                ahead = lag * h
                start_v[d] += ahead * bar_q[0, d]
                bar_a[d] += ahead * (0.5 * ahead * bar_q[0, d] + bar_v[0, d])
    for d in range(n):
        lam_q[d] = start_q[d]
        lam_v[d] = start_v[d]
        lam_x[0, d] = bar_a[d] if last == 0 else 0.0
        lam_x[1, d] = bar_x[d] if last == 0 else 0.0


@kernel
def steps_of(tag, arrays):
    """The arrays as this method's steps."""
    return AlphaSteps(*arrays)


implement(
    AlphaSteps,
    TAG,
    steps_of=steps_of,
    point_of=point_of,
    sample=sample,
    parent_of=parent_of,
    stage_weights=stage_weights,
    reverse_step=reverse_step,
    carried=carried,
)
