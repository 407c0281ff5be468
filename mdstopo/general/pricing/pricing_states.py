"""The states from which prices of members follow, of a weighted sum of rows and integrals.

A member adds to the derivative a sum over states that knows of the motion only the relative pose of its two bodies with
its rates, the virtual change of that pose, and the weight of the stored energy. These are few numbers: here they are
written down for some pairs. From them `candidate_prices` forms the sum of any member between the bodies of a pair,
whether it is built or not. States are all stages of the motion, then those of each row: the state it is read at, and
the stages of the partial step that leads there where there is one.
"""

import numpy as np

from mdstopo.compiler.jit import entry, kernel, part
from mdstopo.general.dynamics.accelerations import make_workspace, solve_accelerations
from mdstopo.general.events.permanent_sets import count_sets
from mdstopo.general.model.general_model import unpack_general
from mdstopo.general.responses.extremes import FRACTION, STEP, WHO
from mdstopo.general.responses.general_responses import design_slopes, energy_weight
from mdstopo.general.sensitivity.adjoint import event_drops, integral_cotangents, row_cotangents, state_of_row, sweep
from mdstopo.general.sensitivity.row_sweep import add_share, step_of_rows
from mdstopo.general.steps.step_history import EVENTS, FIRST, SEGMENT, carve_history, copy_vector, restore_modes
from mdstopo.mechanics.kinematics.kinematics_interface import (
    freedoms,
    pair_displacement,
    pose_acceleration,
    pose_size,
    relative_pose,
)

#: stages of a step at most (`step_history`), and so states of a row beside those of the motion: one more
MOST_STAGES = 17
OF_A_ROW = 1 + MOST_STAGES


@entry
def states_of_sum(
    tag,
    ints,
    floats,
    tables,
    limits,
    count,
    which,
    rows,
    factor,
    integrals,
    share,
    pairs,
    room,
    room_ints,
    member_state,
    padded,
    pose,
    change,
    pose_a,
    energy,
    when,
    segment,
    work,
):
    """The pricing states of a weighted sum of R rows and K integrals, for members between some pairs of bodies.

    Constant:
      tag: the method of integration (`method_interface`).
      ints, floats: the packed scene (`pack_general`).
      tables: coefficients of the method.
      limits (6,): sizes of the history of steps (`carve_history`).
    In:
      count: number of steps.
      which (R, 2): number of each row's response, and 0.
      rows (R, COLUMNS), factor (R,): rows of `extremes`, the latest first, and their weights.
      integrals (K, 2), share (K,): number of a response, and whether its square is integrated; their weights.
      pairs (G,): the pairs.
    In place:
      room, room_ints: flat arrays of the history of steps (`carve_history`); partial steps are kept behind it.
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    Out; all of the states, of which there are the stages and OF_A_ROW for each row, zeros before the call:
      pose (T, G, POSE), change (T, G, D), pose_a (T, G, D): relative poses, minus their virtual changes, and their
        second derivatives in time.
      energy (T,), when (T,), segment (T,): weight of the stored energy; time (s), and the segment of it, which is not
        touched where there is no state.
      padded (1, M_padded + P): scratch.
      work (WORK,): counts of work, added to.
    """
    model = unpack_general(ints, floats)
    history = carve_history(model, limits, room, room_ints)
    workspace = make_workspace(model)
    states = pose, pose_a, when, segment
    for w in range(count):
        for o in range(history.index[w, FIRST], history.index[w + 1, FIRST]):
            _keep_stage(model, history, o, history.index[w, SEGMENT], pairs, states, o)
    if rows.shape[0] > 0:
        _states_of_rows(
            tag, model, tables, member_state, history, count, which, rows, factor, workspace, pairs, states, change,
            energy, padded, work,
        )  # fmt: skip
    for k in range(integrals.shape[0]):
        _states_of_integral(
            tag, model, tables, member_state, history, count, integrals[k, 0], integrals[k, 1] != 0, share[k],
            workspace, pairs, change, energy, padded[0], work,
        )  # fmt: skip


@entry
def keep_states(ints, floats, q, v, a, pairs, pose, pose_a):
    """Store relative poses of pairs at states, and their second derivatives in time.

    In:
      ints, floats: the packed scene (`pack_general`).
      q (T, n_q), v, a (T, n): coordinates, velocities, accelerations.
      pairs (G,): the pairs.
    Out:
      pose (T, G, POSE), pose_a (T, G, D): set.
    """
    model = unpack_general(ints, floats)
    states = pose, pose_a, np.empty(q.shape[0]), np.empty(q.shape[0], np.int64)
    for i in range(q.shape[0]):
        _keep(model, q[i], v[i], a[i], 0.0, np.int64(0), pairs, states, i)


@part
def _keep_stage(model, history, o, segment, pairs, states, at):
    """Write down stage o of a segment as state `at`.

    model: the compiled scene.
    history: the history of steps (`StepHistory`).
    pairs (G,): the pairs.
    states: poses, second derivatives, times and segments, as of `states_of_sum`.
    """
    _keep(
        model, history.stage_q[o], history.stage_v[o], history.stage_a[o], history.when[o], segment, pairs, states, at
    )  # fmt: skip


@kernel
def _keep(model, q, v, a, t, segment, pairs, states, at):
    """Write down a state.

    model: the compiled scene.
    q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    t, segment: time (s), and the segment of it.
    pairs (G,): the pairs.
    states: poses, second derivatives, times and segments, as of `states_of_sum`.
    at: the number of the state.
    """
    pose, pose_a, when, segments = states
    rel = np.empty((model.pair.shape[0], pose_size(model)))
    relative_pose(model, q, v, rel)
    for g in range(pairs.shape[0]):
        copy_vector(rel[pairs[g]], pose[at, g])
        pose_acceleration(model, rel, pairs[g], a, pose_a[at, g])
    when[at] = t
    segments[at] = segment


@kernel
def _add_change(model, q, v, z, factor, pairs, out):
    """Subtract the virtual changes of pairs at a state, times a factor.

    model: the compiled scene.
    q (n_q,), v, z (n,): coordinates, velocities, virtual displacements.
    factor: of these. pairs (G,): the pairs.
    out (G, D): added to.
    """
    rel = np.empty((model.pair.shape[0], pose_size(model)))
    u = np.empty(freedoms(model))
    relative_pose(model, q, v, rel)
    for g in range(pairs.shape[0]):
        pair_displacement(model, rel, pairs[g], z, u)
        for i in range(freedoms(model)):
            out[g, i] -= factor * u[i]


@kernel
def _states_of_rows(
    tag, model, tables, member_state, history, count, which, rows, factor, workspace, pairs, states, change, energy,
    padded, work,
):  # fmt: skip
    """The pricing states of rows: the sum of their cotangents goes back through the steps, each joining with its weight
    where its row begins.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      model: the compiled scene.
      count: number of steps.
    In:
      which (R, 2): number of each row's response, and 0.
      rows (R, COLUMNS), factor (R,): the rows, the latest first, and their weights.
      pairs (G,): the pairs.
    In place:
      member_state (3, columns): state of the members.
      history: the history of steps (`StepHistory`); partial steps are kept behind it.
    Out:
      states: poses, second derivatives, times and segments. change (T, G, D), energy (T,): added to.
      workspace: workspace of a balance (`accelerations.Workspace`).
      padded (1, M_padded + P): scratch. work (WORK,): counts of work, added to.
    """
    n = model.mass.shape[0]
    total = rows.shape[0]
    stages = history.index[count, FIRST]
    scratch = padded[:1]
    bars = np.empty((3, n))
    # of each row, then, in the last line, of all that have begun
    bar_set = np.zeros((total + 1, count_sets(model)))
    lam_q = np.zeros((total + 1, n))
    lam_v = np.zeros((total + 1, n))
    lam_x = np.zeros((total + 1, 2, n))
    begins = np.empty(total, np.int64)
    fraction = np.ones(total + 1)
    z = np.empty((1, MOST_STAGES, n))
    y = np.empty(model.size[0])
    for m in range(total):
        w, fraction[m] = row_cotangents(
            tag, model, tables, member_state, history, count, which[m, 0], rows[m], np.bool_(False), workspace, bars,
            bar_set[m], scratch[0], work,
        )  # fmt: skip
        lam_q[m] = bars[0]
        lam_v[m] = bars[1]
        at = stages + OF_A_ROW * m
        energy[at] = factor[m] * _keep_row(
            tag, model, tables, member_state, history, count, which[m, 0], rows[m], workspace, pairs, states, at,
            bars[2], factor[m], change[at], work,
        )  # fmt: skip
        begins[m] = w
        if w > count or fraction[m] < 1.0:
            own = slice(m, m + 1)
            first = history.index[w, FIRST]
            begins[m] = step_of_rows(
                tag, model, tables, member_state, history, count, w, fraction[own], lam_q[own], lam_v[own], lam_x[own],
                bar_set[own], z, y, workspace, scratch, work,
            )  # fmt: skip
            if w > count:
                for j in range(history.index[w + 1, FIRST] - first):
                    _keep_stage(model, history, first + j, history.index[w, SEGMENT], pairs, states, at + 1 + j)
            to = at + 1 if w > count else first
            _add_changes(model, history, w, z[0], factor[m], pairs, change[to:])
    w = begins[0]
    joined = 0
    every = slice(total, total + 1)
    while w >= 0:
        while joined < total and begins[joined] >= w:
            add_share(factor[joined], lam_q[joined], lam_q[total])
            add_share(factor[joined], lam_v[joined], lam_v[total])
            for carried in range(2):
                add_share(factor[joined], lam_x[joined, carried], lam_x[total, carried])
            add_share(factor[joined], bar_set[joined], bar_set[total])
            joined += 1
        before = step_of_rows(
            tag, model, tables, member_state, history, count, w, fraction[every], lam_q[every], lam_v[every],
            lam_x[every], bar_set[every], z, y, workspace, scratch, work,
        )  # fmt: skip
        _add_changes(model, history, w, z[0], 1.0, pairs, change[history.index[w, FIRST] :])
        w = before


@kernel
def _add_changes(model, history, w, z, factor, pairs, out):
    """`_add_change` at the stages of step w: z (s or more, n) the virtual displacements there, out (s or more, G, D).

    model, history: the compiled scene, and the history of steps (`StepHistory`).
    factor, pairs (G,): as of `_add_change`.
    """
    first = history.index[w, FIRST]
    for j in range(history.index[w + 1, FIRST] - first):
        _add_change(model, history.stage_q[first + j], history.stage_v[first + j], z[j], factor, pairs, out[j])


@kernel
def _keep_row(
    tag, model, tables, member_state, history, count, j, row, workspace, pairs, states, at, z, factor, change, work
):
    """Write down the state that a row is read at; returns the weight of the stored energy there.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      model: the compiled scene.
      count: number of steps.
    In:
      j, row (COLUMNS,): the response, and the row.
      pairs (G,): the pairs.
      at: the number of the state.
      z (n,), factor: virtual displacements there, and their factor.
    In place:
      member_state (3, columns): state of the members.
      history: the history of steps (`StepHistory`); a partial step is kept behind it.
    Out:
      states: poses, second derivatives, times and segments, as of `states_of_sum`.
      change (G, D): added to.
      workspace: workspace of a balance (`accelerations.Workspace`).
      work (WORK,): counts of work, added to.
    """
    n = model.mass.shape[0]
    q = np.empty(model.q0.shape[0])
    v = np.empty(n)
    a = np.empty(n)
    lam = np.empty(model.size[0])
    k = int(row[STEP])
    segment = history.index[k, SEGMENT]
    state_of_row(tag, model, tables, member_state, history, count, row, workspace, q, v, work)
    t = history.t[k] + row[FRACTION] * (history.t[k + 1] - history.t[k])
    restore_modes(history, history.index[k, EVENTS], member_state)
    solve_accelerations(model, member_state, segment, t, q, v, np.bool_(False), workspace, a, lam)
    _keep(model, q, v, a, t, segment, pairs, states, at)
    _add_change(model, q, v, z, factor, pairs, change)
    slopes = design_slopes(model, member_state, segment, j, int(row[WHO]), t, q, v, a, lam, workspace)
    return energy_weight(model, j, slopes)


@kernel
def _states_of_integral(
    tag, model, tables, member_state, history, count, j, square, factor, workspace, pairs, change, energy, scratch,
    work,
):  # fmt: skip
    """The pricing states of an integral, as `states_of_sum` has them.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      model: the compiled scene.
      history, count: the history of steps, and how many steps it has.
    In:
      j, square, factor: the response; whether its square is integrated; the weight.
      pairs (G,): the pairs.
    In place:
      member_state (3, columns): state of the members.
    Out:
      change (T, G, D), energy (T,): added to.
      workspace: workspace of a balance (`accelerations.Workspace`).
      scratch (M_padded + P,). work (WORK,): counts of work, added to.
    """
    n = model.mass.shape[0]
    stages = history.index[count, FIRST]
    bars = np.zeros((stages, 3, n))
    rows_bar = np.zeros((stages, model.size[0]))
    sets_bar = np.zeros((stages, count_sets(model)))
    energies = np.zeros(stages)
    virtual = np.zeros((stages, n))
    integral_cotangents(
        tag, model, tables, member_state, history, count, j, square, bars, rows_bar, sets_bar, energies, workspace,
        scratch, work,
    )  # fmt: skip
    drops = event_drops(model, member_state, history, count, j, square, workspace)
    sweep(
        tag, model, tables, member_state, history, count, count - 1, 1.0, np.zeros(n), np.zeros(n),
        np.zeros(sets_bar.shape[1]), bars, rows_bar, sets_bar, drops, j, square, workspace, virtual, scratch, work,
    )  # fmt: skip
    for o in range(stages):
        energy[o] += factor * energies[o]
        _add_change(model, history.stage_q[o], history.stage_v[o], virtual[o], factor, pairs, change[o])
