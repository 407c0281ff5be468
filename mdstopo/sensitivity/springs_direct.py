"""The sensitivities of the motion carried forward with it (the paper's time integration incorporated method).

Works on steps that are there already, of any integrator: the state's derivatives by every alpha^mu go through
each step's own linear map (`propagation`), and every objective is differentiated where the sweep passes its
time. O(N) memory; with the histories of the response, dg/dalpha at every step's end, O(N) a step.
"""

import numpy as np

from mdstopo.compiler.jit import entry, kernel
from mdstopo.integrators.steps import FIRST, carve
from mdstopo.integrators.steps_interface import carried, parent_of, stage_weights, steps_of
from mdstopo.mechanics.kinematics.planar_poses import POSE, relative_pose
from mdstopo.mechanics.passes import SUMS, energy_gradient, springs_of, unscale_gradient
from mdstopo.responses.energy import energy_at, energy_slope
from mdstopo.scene.packing import unpack
from mdstopo.sensitivity.propagation import apply_matrix, step_matrix
from mdstopo.sensitivity.reductions import INTEGRAL, MEAN
from mdstopo.sensitivity.state_in_step import state_in_step

#: in place of the step before, for what is at the start of the motion
NOWHERE = -2


@kernel
def slope_at(model, strength, q, v, rel, sums, out):
    """dg/dq of the stored energy in one state.

    Constant:
      model: the compiled scene.
      strength (3, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
    In:
      q, v (n,): coordinates and velocities (m, rad; m/s, rad/s).
    Out:
      rel (1, n_pair, POSE), sums (1, n_pair, SUMS): relative poses and sums of the members in that state.
      out (n,): dg/dq, overwritten.
    """
    springs = springs_of(model)
    energy_at(model.pair, model.home, springs, strength, q, v, rel, sums)
    pull = np.empty((rel.shape[1], 3))
    for p in range(rel.shape[1]):
        for j in range(3):
            pull[p, j] = sums[0, p, 4 + j]
    out[:] = 0.0
    energy_slope(model.pair, rel[0], pull, 1.0, out)


@kernel
def state_of_row(model, tables, strength, steps, count, damped, row, q, v, rel, sums, mu_q, work):
    """Find the state of a row that `evaluate_responses` found, and the slope of the stored energy there.

    Constant:
      model: the compiled scene.
      tables: constant arrays of the integrator.
      strength (3, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
    In:
      steps: what the integrator kept.
      count: steps that were taken.
      damped: whether any force depends on velocity.
      row (4,): time, value, step, fraction of it.
    Out:
      q, v (n,): the state (m, rad; m/s, rad/s).
      rel (1, n_pair, POSE), sums (1, n_pair, SUMS): relative poses and sums of the members in that state.
      mu_q (n,): dg/dq.
      work (WORK,): counts of work, added to.
      steps: where the interpolation is a partial step, this is kept behind the others.

    Returns the step that leads there, -1 for the start of the motion, and its fraction, -1 for its end.
    """
    k = int(row[2])
    c = row[3]
    w, c_w = state_in_step(model, tables, strength, steps, count, k, c, damped, q, v, work)
    slope_at(model, strength, q, v, rel, sums, mu_q)
    work[0] += 1
    if k == 0 and c == 0.0:
        w = -1  # the motion has not begun
    return w, c_w


@kernel
def integral_weights(model, tables, steps, count, weight, bar):
    """Weights of the stages in the integral of the stored energy over time.

    Constant:
      model: the compiled scene.
      tables: constant arrays of the integrator.
    In:
      steps: what the integrator kept.
      count: steps that were taken.
    Out:
      weight (S,): of the energies (s).
      bar (S, n): derivatives of the integral by the coordinates of the stages, added to.
    """
    rel = np.empty((model.pair.shape[0], POSE))
    for w in range(count):
        stage_weights(tables, steps, w, weight[steps.index[w, FIRST] : steps.index[w + 1, FIRST]])
    for i in range(weight.shape[0]):
        relative_pose(model.pair, model.home, steps.stage[i, 0], steps.stage[i, 1], rel)
        energy_slope(model.pair, rel, steps.pull[i], weight[i], bar[i])


@kernel
def finish_rows(model, alpha, steps, count, reductions, found, weight, states, padded, total, gradients):
    """Add the explicit derivatives by alpha^mu to those through the motion, and turn them into gradients by alpha.

    Constant:
      model: the compiled scene.
    In:
      alpha (N,): the design.
      steps: what the integrator kept.
      count: steps that were taken.
      reductions (n_obj,): codes of the objectives' reductions.
      found (n_obj,): how many rows each objective has.
      weight (S,): of the stages in an integral over time (s).
      states (n_obj, R, 3, n): q and v of the rows, and a vector that is not read.
      total (1, M_padded): of an integral over time, the derivatives through the motion.
    In and out:
      padded (n_obj, R, M_padded): of the rows, the derivatives through the motion; overwritten.
    Out:
      gradients (n_obj, R, N): by alpha, for the rows that were found.
    """
    one = np.ones(1)
    scaled = np.empty(weight.shape[0])
    for j in range(reductions.shape[0]):
        integral = reductions[j] == MEAN or reductions[j] == INTEGRAL
        for r in range(found[j]):
            out = padded[j, r]
            if integral:
                scale = 1.0 / (steps.t[count] - steps.t[0]) if reductions[j] == MEAN else 1.0
                for i in range(out.shape[0]):
                    out[i] = scale * total[0, i]
                for i in range(weight.shape[0]):
                    scaled[i] = scale * weight[i]
                energy_gradient(model, steps.stage, scaled, out)
            else:
                energy_gradient(model, states[j, r : r + 1], one, out)
            unscale_gradient(model, alpha, out, gradients[j, r])


@entry
def direct(
    tag,
    ints,
    floats,
    tables,
    alpha,
    damped,
    limits,
    count,
    reductions,
    room,
    room_ints,
    strength,
    rows,
    found,
    gradients,
    history,
    work,
):
    """Gradients of the rows that `evaluate_responses` found, by one forward sweep over the steps left in room, with
    tangents.

    Constant:
      tag: of the integrator (`steps_interface.steps_of`).
      ints, floats: the packed model.
      tables: constant arrays of the integrator.
    In:
      alpha (N,): the design.
      damped: whether any force depends on velocity.
      limits (3,): steps allowed, room for steps, room for stages.
      count: steps that were taken.
      reductions (n_obj,): codes of the objectives' reductions.
      room, room_ints: the steps, with tangents (`steps.carve`).
      strength (3 or more, M_padded): as the run left them (N/m, N s/m, N).
      rows (n_obj, R, 4): time, value, step, fraction of it, of what `evaluate_responses` found.
      found (n_obj,): how many rows each objective has.
    Out:
      gradients (n_obj, R, N): by alpha, for the rows that were found.
      history (count + 1, N): dg/dalpha of the stored energy at the times of the steps, or no rows.
      work (WORK,): counts of work, added to.
    """
    model = unpack(ints, floats)
    turning = model.load_body.shape[0] > 0
    n = model.q0.shape[0]
    n_pair = model.pair.shape[0]
    pair = model.pair
    steps = steps_of(tag, carve(room, room_ints, n, n_pair, limits[1], limits[2], damped, turning))
    n_obj = rows.shape[0]
    n_row = rows.shape[1]
    padded_size = model.member.shape[1]
    stages = steps.index[count, FIRST]
    width = (2 + carried(steps)) * n
    rel = np.empty((1, n_pair, POSE))
    sums = np.empty((1, n_pair, SUMS))
    S = np.zeros((width, padded_size))
    padded = np.zeros((n_obj, n_row, padded_size))
    total = np.zeros((1, padded_size))
    line = np.zeros((1, padded_size))
    mu = np.zeros((n_obj, n_row, n))
    states = np.zeros((n_obj, n_row, 3, n))
    before = np.empty((n_obj, n_row), np.int64)
    spread = np.zeros(n_obj, np.bool_)
    integral = False
    most = 0
    for j in range(n_obj):
        spread[j] = reductions[j] == MEAN or reductions[j] == INTEGRAL
        if spread[j]:
            integral = True
            continue
        for r in range(found[j]):
            w, _ = state_of_row(
                model, tables, strength, steps, count, damped, rows[j, r], states[j, r, 0], states[j, r, 1],
                rel, sums, mu[j, r], work,
            )  # fmt: skip
            before[j, r] = parent_of(steps, w) if w >= 0 else NOWHERE
            if w >= 0:
                most = max(most, steps.index[w + 1, FIRST] - steps.index[w, FIRST])
    weight = np.zeros(stages if integral else 0)
    bar = np.zeros((stages if integral else 0, n))
    if integral:
        integral_weights(model, tables, steps, count, weight, bar)
    for w in range(count):
        most = max(most, steps.index[w + 1, FIRST] - steps.index[w, FIRST])
    matrix = np.empty((width + 1, width + 3 * n_pair * most))
    none = np.zeros(n)
    no_bar = np.zeros((most, n))
    one = np.ones(1)
    jobs = n_obj * n_row
    for k in range(count + 1):
        if history.shape[0] > 0:
            state = steps.state[k]
            top = matrix[0]
            top[:] = 0.0
            slope_at(model, strength, state[0], state[1], rel, sums, top[:n])
            total_line = line[0]
            total_line[:] = 0.0
            apply_matrix(pair, model.home, model.block, model.member, steps.stage, 0, matrix, 0, 1, True, S, line)
            energy_gradient(model, steps.state[k : k + 1], one, total_line)
            unscale_gradient(model, alpha, total_line, history[k])
        if k == count:
            break
        # first the rows in this step, each by a linear map of its own, then the step itself
        for job in range(jobs + 1):
            row = job < jobs
            w = k
            c = -1.0
            if row:
                j = job // n_row
                r = job % n_row
                if r >= found[j] or spread[j] or before[j, r] != k - 1:
                    continue
                # found again: a partial step behind the others has been overwritten by that of the next row
                w, c = state_of_row(
                    model, tables, strength, steps, count, damped, rows[j, r], states[j, r, 0], states[j, r, 1],
                    rel, sums, mu[j, r], work,
                )  # fmt: skip
            o = steps.index[w, FIRST]
            end = steps.index[w + 1, FIRST]
            step_matrix(
                pair, model.home, model.inv_mass, tables, steps, w, c, mu[job // n_row, job % n_row] if row else none,
                bar[o:end] if integral and not row else no_bar, damped, turning, matrix,
            )  # fmt: skip
            work[5] += 1
            for out in range(2):
                # out = 0: the last row of the matrix, which is the response's; out = 1: the changes at the end
                if (row and out == 1) or (not row and out == 0 and not integral):
                    continue
                target = padded[job // n_row, job % n_row : job % n_row + 1] if row else total
                first = width if out == 0 else 0
                apply_matrix(
                    pair, model.home, model.block, model.member, steps.stage[o:end], end - o, matrix, first,
                    width + 1 if out == 0 else width, out == 0, S, target if out == 0 else S,
                )  # fmt: skip
    finish_rows(model, alpha, steps, count, reductions, found, weight, states, padded, total, gradients)
