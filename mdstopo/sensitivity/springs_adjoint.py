"""The exact gradient of the discretised objective: one reverse sweep over the steps, one pass over the members.

The sweep starts at the step that holds the time of the row (or spreads over all stages, for integrals), pulls the
cotangents of the state back step by step at body level, and keeps the virtual displacement z of every stage's force
balance. Then dG/dalpha_i = dg/dalpha_i - mu alpha_i^(mu-1) sum_s f_i (b_i . T z_s): one pass, members outside, stages
inside. The peak's time is held fixed (envelope theorem).
"""

import numpy as np

from mdstopo.compiler.jit import part
from mdstopo.integrators.steps import ENERGY, FIRST
from mdstopo.integrators.steps_interface import carried, parent_of, reverse_step, stage_weights
from mdstopo.mechanics.kinematics.planar_poses import POSE, relative_pose
from mdstopo.mechanics.passes import SUMS, design_gradient, springs_of
from mdstopo.responses.energy import energy_at, energy_slope
from mdstopo.responses.peaks import find_peaks
from mdstopo.sensitivity.reductions import FINAL, INTEGRAL, MAX, MEAN
from mdstopo.sensitivity.state_in_step import state_in_step

#: where energies are evaluated: at both ends `find_peaks` has done it already
AT_START, AT_END, ELSEWHERE = range(3)


@part
def reverse_sweep(pair, inv_mass, tables, steps, w, c, mu_q, stage_q_bar, z, used, damped, turning, accuracy, work):
    """Carry the derivative of a response by the coordinates at one time back over all steps before it.

    Constant:
      pair (n_pair, 2): the bodies of each pair.
      inv_mass (n,): inverse masses and inertias (1/kg, 1/(kg m^2)).
      tables: constant arrays of the integrator.
    In:
      steps: what the integrator kept.
      w: number of the step in which that time is.
      c: fraction of it; negative: its end.
      mu_q (n,): derivative by the coordinates then.
      stage_q_bar (S, n): explicit derivatives by the coordinates of the stages, or no rows.
      damped: whether any force depends on velocity.
      turning: whether loads turn.
      accuracy: relative, to which an iteration has to go; 0: to rounding.
    Out:
      z (S, n): virtual displacements at the stages that the sweep goes through; other rows are left as they are.
      used (S,): 1 is written for these stages.
      work (WORK,): counts of work, added to.
    """
    n = mu_q.shape[0]
    lam_q = np.zeros(n)
    lam_v = np.zeros(n)
    lam_x = np.zeros((carried(steps), n))
    none = np.zeros(n)
    point = np.zeros(n)
    for d in range(n):
        if c < 0.0:
            lam_q[d] = mu_q[d]
        else:
            point[d] = mu_q[d]
    while w >= 0:
        o = steps.index[w, FIRST]
        end = steps.index[w + 1, FIRST]
        bar = stage_q_bar[o:end] if stage_q_bar.shape[0] > 0 else stage_q_bar
        reverse_step(
            pair, inv_mass, tables, steps, w, c, point, none, bar, lam_q, lam_v, lam_x, z[o:end], damped, turning,
            accuracy, work,
        )  # fmt: skip
        used[o:end] = 1
        point[:] = 0.0
        c = -1.0
        w = parent_of(steps, w)


@part
def energy_rows(
    model,
    motion,
    tables,
    strength,
    steps,
    count,
    pose,
    damped,
    reduction,
    closeness,
    gradient,
    accuracy,
    rows,
    padded,
    work,
):
    """Value, time and gradient of the stored energy reduced over time.

    Constant:
      model: the compiled scene, with all members.
      motion: the same with the members that the motion was computed with (`active_members`).
      tables: constant arrays of the integrator.
      strength (3, M_padded): of the members of `motion`, times alpha^mu (N/m, N s/m, N).
    In:
      steps: what the integrator kept.
      count: steps that were taken.
      pose (S, n_pair, POSE): relative poses of the stages.
      damped: whether any force depends on velocity.
      reduction: MAX, MIN, MEAN, INTEGRAL or FINAL.
      closeness: how near to the highest a peak competes, relative.
      gradient: whether gradients are wanted.
      accuracy: relative, to which an iteration of the reverse sweep has to go; 0: to rounding.
    Out:
      rows (R, 4): time (s; NaN for mean and integral), value (J; J s for integral), step, fraction of it.
      padded (R, M_padded): gradients by alpha^mu.
      work (WORK,): counts of work, added to.

    Returns how many rows there are.
    """
    n = model.q0.shape[0]
    n_pair = model.pair.shape[0]
    pair = model.pair
    springs = springs_of(motion)
    turning = model.load_body.shape[0] > 0
    integral = reduction in (MEAN, INTEGRAL)
    stages = steps.index[count, FIRST]
    point = np.empty((1, 3, n))
    q = point[0, 0]
    v = point[0, 1]
    rel = np.empty((1, n_pair, POSE))
    sums = np.empty((1, n_pair, SUMS))
    weight = np.zeros(stages if integral else 1)
    bar = np.zeros((stages if integral else 0, n))
    mu_q = np.empty(n)
    pull = np.empty((3, n_pair, 3))  # E_xi at AT_START, AT_END, ELSEWHERE
    found = 1
    watched = not integral and reduction != FINAL
    if integral:
        scale = 1.0 / (steps.t[count] - steps.t[0]) if reduction == MEAN else 1.0
        value = 0.0
        for w in range(count):
            stage_weights(tables, steps, w, weight[steps.index[w, FIRST] : steps.index[w + 1, FIRST]])
        for i in range(stages):
            weight[i] *= scale
            value += weight[i] * steps.scalar[i, ENERGY]
            energy_slope(pair, pose[i], steps.pull[i], weight[i], bar[i])
        rows[0, 0] = np.nan
        rows[0, 1] = value
        rows[0, 2] = count - 1
        rows[0, 3] = 1.0
    elif reduction == FINAL:
        rows[0, 0] = steps.t[count]
        rows[0, 2] = count - 1
        rows[0, 3] = 1.0
    else:
        sign = 1.0 if reduction == MAX else -1.0
        found = find_peaks(motion, tables, strength, steps, count, damped, sign, closeness, rows, pull, work)
    if not gradient and reduction != FINAL:
        return found
    for r in range(found):
        k = int(rows[r, 2])
        c = rows[r, 3]
        w = k
        c_w = -1.0
        mu_q[:] = 0.0
        if not integral:
            weight[0] = 1.0
            w, c_w = state_in_step(motion, tables, strength, steps, count, k, c, damped, q, v, work)
            at = ELSEWHERE
            if watched and k == 0 and c == 0.0:
                at = AT_START
            elif watched and k + 1 == count and c >= 1.0:
                at = AT_END
            if at == ELSEWHERE:
                value, _ = energy_at(pair, model.home, springs, strength, q, v, rel, sums)
                work[0] += 1
                if reduction == FINAL:
                    rows[0, 1] = value
                for p in range(n_pair):
                    for j in range(3):
                        pull[ELSEWHERE, p, j] = sums[0, p, 4 + j]
            else:
                relative_pose(pair, model.home, q, v, rel[0])
            energy_slope(pair, rel[0], pull[at], weight[0], mu_q)
        if not gradient:
            continue
        out = padded[r]
        out[:] = 0.0
        passed = 0
        if integral or not (k == 0 and c == 0.0):  # a peak at the start is not passed by the motion
            passed = max(stages, steps.index[w + 1, FIRST])
        z = np.empty((passed, n))
        used = np.zeros(passed, np.int64)
        if passed > 0:
            reverse_sweep(
                pair, model.inv_mass, tables, steps, w, c_w, mu_q, bar, z, used, damped, turning, accuracy, work
            )
        where = steps.stage if integral else point
        design_gradient(model, steps.stage, pose, z, used, where, weight, out, work)
    return found
