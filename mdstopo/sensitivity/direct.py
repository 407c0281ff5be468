"""The sensitivities of the motion carried forward with it (the paper's time integration incorporated method).

Works on steps that are there already, of any integrator: the state's derivatives by every alpha^mu go through
each step's own linear map (`propagation`), and every objective is differentiated where the sweep passes its
time. O(N) memory; with the histories of the response, dg/dalpha at every step's end, O(N) a step.
"""

import numpy as np

from mdstopo.compiler.jit import entry, kernel
from mdstopo.integrators.contract import carried, parent_of, reach, stage_weights, steps_of
from mdstopo.integrators.steps import carve
from mdstopo.mechanics.geometry import POSE, relative_pose
from mdstopo.mechanics.passes import SUMS, energy_gradient, springs_of, unscale_gradient
from mdstopo.responses.energy import energy_at, energy_slope
from mdstopo.scene.packing import unpack
from mdstopo.sensitivity.propagation import apply_matrix, step_matrix
from mdstopo.sensitivity.reductions import INTEGRAL, MEAN

#: the step before one that the motion never takes
NOWHERE = -2


@kernel
def slope_at(model, strength, q, v, rel, sums, out):
    """out (n,) = dg/dq at one state."""
    springs = springs_of(model)
    energy_at(model.pair, model.home, springs, strength, q, v, rel, sums)
    pull = np.empty((rel.shape[1], 3))
    for p in range(rel.shape[1]):
        for j in range(3):
            pull[p, j] = sums[0, p, 4 + j]
    out[:] = 0.0
    energy_slope(model.pair, rel[0], pull, 1.0, out)


@kernel
def look_at_row(model, tables, strength, steps, count, damped, row, q, v, rel, sums, mu_q, work):
    """Step and fraction (-1: its end) of a found row (4,), the state there, and the slope dg/dq into mu_q (n,)."""
    k = int(row[2])
    c = row[3]
    w = k
    c_w = -1.0
    if c >= 1.0 or (k == 0 and c == 0.0):
        state = steps.state[k + 1 if c >= 1.0 else 0]
        for d in range(q.shape[0]):
            q[d] = state[0, d]
            v[d] = state[1, d]
    else:
        w, c_w = reach(model, tables, strength, steps, count, k, c, damped, q, v, work)
    slope_at(model, strength, q, v, rel, sums, mu_q)
    work[0] += 1
    if k == 0 and c == 0.0:
        w = -1  # the motion has not begun
    return w, c_w


@kernel
def integral_weights(model, tables, steps, count, weight, bar):
    """weight (S,) of the stages in the integral of g over time, and bar (S, n), that of their positions."""
    rel = np.empty((model.pair.shape[0], POSE))
    for w in range(count):
        stage_weights(tables, steps, w, weight[steps.index[w, 0] : steps.index[w + 1, 0]])
    for i in range(weight.shape[0]):
        relative_pose(model.pair, model.home, steps.stage[i, 0], steps.stage[i, 1], rel)
        energy_slope(model.pair, rel, steps.pull[i], weight[i], bar[i])


@kernel
def finish_rows(model, alpha, steps, count, reductions, found, weight, states, padded, total, gradients):
    """Add the explicit parts and turn derivatives by alpha^mu into those by alpha: gradients (n_obj, R, N).

    In: states (n_obj, R, 3, n) of the rows, padded (n_obj, R, M_padded) their implicit parts, total (1, M_padded)
    that of the integral over time with its weights (S,).
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
    """Gradients of the rows that `look` found, by one forward sweep over the steps left in room, with tangents.

    Arguments as `look`'s. In: reductions (n_obj,), rows (n_obj, R, 4), found (n_obj,). Out: gradients
    (n_obj, R, N); history (count + 1, N) = dg/dalpha at the times of the steps, or no rows.
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
    stages = steps.index[count, 0]
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
            w, _ = look_at_row(
                model, tables, strength, steps, count, damped, rows[j, r], states[j, r, 0], states[j, r, 1],
                rel, sums, mu[j, r], work,
            )  # fmt: skip
            before[j, r] = parent_of(steps, w) if w >= 0 else NOWHERE
            if w >= 0:
                most = max(most, steps.index[w + 1, 0] - steps.index[w, 0])
    weight = np.zeros(stages if integral else 0)
    bar = np.zeros((stages if integral else 0, n))
    if integral:
        integral_weights(model, tables, steps, count, weight, bar)
    for w in range(count):
        most = max(most, steps.index[w + 1, 0] - steps.index[w, 0])
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
        # the rows whose look begins where this step does, then the step itself
        for job in range(jobs + 1):
            row = job < jobs
            w = k
            c = -1.0
            if row:
                j = job // n_row
                r = job % n_row
                if r >= found[j] or spread[j] or before[j, r] != k - 1:
                    continue
                # again, because one that is kept behind the steps gives way to the next
                w, c = look_at_row(
                    model, tables, strength, steps, count, damped, rows[j, r], states[j, r, 0], states[j, r, 1],
                    rel, sums, mu[j, r], work,
                )  # fmt: skip
            o = steps.index[w, 0]
            end = steps.index[w + 1, 0]
            step_matrix(
                pair, model.home, model.inv_mass, tables, steps, w, c, mu[job // n_row, job % n_row] if row else none,
                bar[o:end] if integral and not row else no_bar, damped, turning, matrix,
            )  # fmt: skip
            work[5] += 1
            for out in range(2):
                # out = 0: what the last row of the matrix looks at; out = 1: the changes at the end
                if (row and out == 1) or (not row and out == 0 and not integral):
                    continue
                target = padded[job // n_row, job % n_row : job % n_row + 1] if row else total
                first = width if out == 0 else 0
                apply_matrix(
                    pair, model.home, model.block, model.member, steps.stage[o:end], end - o, matrix, first,
                    width + 1 if out == 0 else width, out == 0, S, target if out == 0 else S,
                )  # fmt: skip
    finish_rows(model, alpha, steps, count, reductions, found, weight, states, padded, total, gradients)
