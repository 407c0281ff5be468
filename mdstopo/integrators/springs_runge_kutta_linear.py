"""Explicit Runge-Kutta methods: partial steps, the reverse step (`steps_interface`)."""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.integrators.runge_kutta_tables import STAGES, B
from mdstopo.integrators.springs_runge_kutta import MOST_STAGES, TAG, RungeKuttaSteps, advance
from mdstopo.integrators.steps import ENERGY, ENERGY_RATE, FIRST, PARENT, REVERSE, SEGMENT, TIME
from mdstopo.integrators.steps_interface import implement
from mdstopo.mechanics.assembly import (
    add_turning_transposed,
    subtract_transposed,
)
from mdstopo.mechanics.kinematics.planar_poses import POSE
from mdstopo.mechanics.passes import SUMS


@kernel
def _partial(model, tables, strength, steps, count, k, c, damped, keep, q, v, work):
    """Take a step of length c h from the start of step k.

    Constant:
      model: the compiled scene.
      tables (2, 3, s_max, s_max): of `runge_kutta_tables`.
      strength (3, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
    In:
      steps: what the integrator kept.
      count: steps that were taken.
      k: number of the step.
      c: fraction of it, 0 to 1.
      damped: whether any force depends on velocity.
      keep: whether to keep its stages behind all others, as step count + 1 of `steps`, and its tangents.
    Out:
      q, v (n,): coordinates and velocities there (m, rad; m/s, rad/s).
      work (WORK,): counts of work, added to.
    """
    n = q.shape[0]
    n_pair = model.pair.shape[0]
    method = 1 if damped else 0
    s = STAGES[method]
    h = c * (steps.t[k + 1] - steps.t[k])
    o = steps.index[count, FIRST]
    ends = np.empty((2, n))
    advance(
        model, tables[method], s, strength, steps.index[k, SEGMENT], steps.t[k], h, steps.state[k, 0],
        steps.state[k, 1], keep, damped, o if keep else -1, np.empty((1, n_pair, POSE)), np.empty((1, n_pair, SUMS)),
        np.empty((1, n)), np.empty((1, n_pair, 6, 6)), np.empty((1, n_pair, 6, 6)), np.zeros((1, n)),
        np.empty((MOST_STAGES, n)), np.empty((MOST_STAGES, n)), np.empty((MOST_STAGES, n)), steps, ends, work,
    )  # fmt: skip
    for d in range(n):
        q[d] = ends[0, d]
        v[d] = ends[1, d]
    if keep:
        w = count + 1
        steps.t[w] = steps.t[k]
        steps.t[w + 1] = steps.t[k] + h
        steps.index[w, FIRST] = o
        steps.index[w, PARENT] = k - 1
        steps.index[w, SEGMENT] = steps.index[k, SEGMENT]
        steps.index[w + 1, FIRST] = o + s


@kernel
def point_of(model, tables, strength, steps, count, k, c, damped, q, v, work):
    """The state after a partial step, which is not kept; see `steps_interface.point_of`. Returns k and c."""
    _partial(model, tables, strength, steps, count, k, c, damped, np.bool_(False), q, v, work)
    return k, c


@kernel
def reach(model, tables, strength, steps, count, k, c, damped, q, v, work):
    """The state after a partial step, which is kept as step count + 1; see `steps_interface.reach`.

    Returns count + 1 and -1: a reverse sweep starts at the end of the partial step.
    """
    _partial(model, tables, strength, steps, count, k, c, damped, np.bool_(True), q, v, work)
    return count + 1, -1.0


@kernel
def sample(steps, count, damped, t, g, d):
    """Starts of steps with rates, other stages without: they have no velocity; see `steps_interface.sample`."""
    s = STAGES[1 if damped else 0]
    m = 0
    for w in range(count):
        o = steps.index[w, FIRST]
        h = steps.t[w + 1] - steps.t[w]
        last = steps.t[w]
        if w > 0:
            t[m] = last
            g[m] = steps.scalar[o, ENERGY]
            d[m] = steps.scalar[o, ENERGY_RATE]
            m += 1
        # stages by rising time; of several at one time the last, which is the most accurate
        while True:
            best = -1
            for i in range(1, s):
                time = steps.scalar[o + i, TIME]
                inside = time > last + 1e-3 * h and time < steps.t[w + 1] - 1e-3 * h
                if inside and (best < 0 or time <= steps.scalar[o + best, TIME]):
                    best = i
            if best < 0:
                break
            last = steps.scalar[o + best, TIME]
            t[m] = last
            g[m] = steps.scalar[o + best, ENERGY]
            d[m] = np.nan
            m += 1
    return m


@kernel
def parent_of(steps, w):
    """The step before, which is kept with each step: a partial step stands behind all others."""
    return steps.index[w, PARENT]


@kernel
def stage_weights(tables, steps, w, out):
    """The weights of the velocity: an integral is the velocity of one more coordinate."""
    s = steps.index[w + 1, FIRST] - steps.index[w, FIRST]
    vectors = tables[0 if s == STAGES[0] else 1, 2]
    for j in range(s):
        out[j] = (steps.t[w + 1] - steps.t[w]) * vectors[B, j]


@kernel
def carried(steps):
    """None: a step takes over nothing but q and v."""
    return 0


@part
def reverse_step(
    pair, inv_mass, tables, steps, w, c_point, mu_q, mu_v, stage_q_bar, lam_q, lam_v, lam_x, z, damped, turning,
    accuracy, work,
):  # fmt: skip
    """Stage after stage, the last one first; see `steps_interface.reverse_step`.

    Not used: c_point, mu_q, mu_v (a point inside a step is a partial step's end), lam_x, accuracy.
    """
    n = lam_q.shape[0]
    o = steps.index[w, FIRST]
    s = steps.index[w + 1, FIRST] - o
    table = tables[1 if damped else 0]
    one = np.int64(1)
    h = steps.t[w + 1] - steps.t[w]
    spread = stage_q_bar.shape[0] > 0
    work[REVERSE] += 1
    u = np.zeros((s, n))
    y = np.zeros((s, n))
    for back in range(s):
        j = s - 1 - back
        for d in range(n):
            value = h * h * table[2, 1, j] * lam_q[d] + h * table[2, 2, j] * lam_v[d]
            for i in range(j + 1, s):
                value += h * h * table[0, i, j] * u[i, d]
                if damped:
                    value += h * table[1, i, j] * y[i, d]
            z[j, d] = inv_mass[d] * value
            u[j, d] = stage_q_bar[j, d] if spread else 0.0
        subtract_transposed(pair, steps.K[o + j :], z[j:], u[j:], one)
        if turning:
            add_turning_transposed(steps.turn[o + j :], z[j:], u[j:], one)
        if damped:
            subtract_transposed(pair, steps.C[o + j :], z[j:], y[j:], one)
    for d in range(n):
        position = lam_q[d]
        speed = lam_v[d] + h * lam_q[d]
        for i in range(s):
            position += u[i, d]
            speed += h * table[2, 0, i] * u[i, d] + y[i, d]
        lam_q[d] = position
        lam_v[d] = speed


@kernel
def steps_of(tag, arrays):
    """The arrays as this method's steps."""
    return RungeKuttaSteps(*arrays)


implement(
    RungeKuttaSteps,
    TAG,
    steps_of=steps_of,
    point_of=point_of,
    reach=reach,
    sample=sample,
    parent_of=parent_of,
    stage_weights=stage_weights,
    reverse_step=reverse_step,
    carried=carried,
)
