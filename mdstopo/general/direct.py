"""The sensitivities of a general motion carried forward with it: the second way to the same gradients.

Each step is a linear map of changes of the state and of a force at each stage. It is built once, by pushing unit
changes through the step (`method_interface`), and then applied to the derivatives of the state by every alpha^mu, whose
forces are each member's own. At events the derivatives jump by saltation. At the row's time its cotangents meet them.
"""

import numpy as np

from mdstopo.compiler.jit import entry, kernel
from mdstopo.general.accelerations import make_workspace, solve_accelerations
from mdstopo.general.adjoint import event_drops, integral_cotangents, row_cotangents
from mdstopo.general.extremes import COLUMNS, FRACTION, STEP, WHO
from mdstopo.general.forces import inerter_force
from mdstopo.general.general_model import (
    CODE,
    COUNT,
    DESIGN,
    INERTER,
    MEMBER_FREE_LENGTH,
    PAIR,
    START,
    VARIED_BLOCK,
    VARIED_FIRST,
    VARIED_PLACE,
    VARIED_STOP,
    VARIED_VALUE,
    unpack_general,
)
from mdstopo.general.members import MODE, SCALE, SET, level_of, unscale_general
from mdstopo.general.method_interface import step_forward
from mdstopo.general.parameters import event_slope, parameter_slopes, time_jump
from mdstopo.general.permanent_sets import count_sets, sets_forward, through_sets, time_forward
from mdstopo.general.scene_numbers import balance_slope, begin_velocities, number_through_step
from mdstopo.general.step_history import EVENTS, FIRST, PARENT, SEGMENT, STATE, carve_history, restore_modes
from mdstopo.general.strides import pair_freedoms, place_in_pair
from mdstopo.mechanics.kinematics.kinematics_interface import member_rows
from mdstopo.mechanics.laws.law_table import FREE_LENGTH, law


@kernel
def step_map(tag, model, tables, history, w, c, sweeps, bars, rows_bar, workspace, out):
    """What unit changes of the state at the start of step w, and of the force at each of its stages, do at its end.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      model: the compiled scene.
      history, w: the history of steps, and the step.
      c: fraction of the step at which it is taken to end.
      sweeps: above 0, implicit stages are solved by so many fixed-point sweeps at most (`iterative`).
      bars (s, 3, n), rows_bar (s, n_row): cotangents of an integral by q, v, a and the multipliers of the stages; no
        rows where there is none.
    Out:
      out (4 n + s n or more, 4 n + 1): a row for each unit change of q, of v, of the two vectors that the integrator
        carries from step to step, and of each stage's force; its columns are what becomes of q, v and the carried
        vectors, and of the integral.
      workspace: workspace of a balance, overwritten.

    Returns whether all sweeps settled.
    """
    n = model.mass.shape[0]
    s = history.index[w + 1, FIRST] - history.index[w, FIRST]
    dq = np.empty(n)
    dv = np.empty(n)
    dx = np.empty((2, n))
    force = np.empty((s, n))
    changes = np.empty((s, 3, n))
    rows = np.empty((s, model.size[0]))
    settled = True
    for b in range((4 + s) * n):
        dq[:] = 0.0
        dv[:] = 0.0
        dx[:] = 0.0
        force[:] = 0.0
        out[b] = 0.0
        if model.free[b % n] == 0:
            continue
        part = b // n
        if part == 0:
            dq[b % n] = 1.0
        elif part == 1:
            dv[b % n] = 1.0
        elif part < 4:
            dx[part - 2, b % n] = 1.0
        else:
            force[part - 4, b % n] = 1.0
        if not step_forward(tag, model, tables, history, w, c, sweeps, dq, dv, dx, force, changes, rows, workspace):
            settled = False
        for d in range(n):
            out[b, d] = dq[d]
            out[b, n + d] = dv[d]
            for carried in range(2):
                out[b, (2 + carried) * n + d] = dx[carried, d]
        if bars.shape[0] > 0:
            for j in range(s):
                for part in range(bars.shape[1]):
                    for d in range(n):
                        out[b, 4 * n] += bars[j, part, d] * changes[j, part, d]
                for r in range(model.size[0]):
                    out[b, 4 * n] += rows_bar[j, r] * rows[j, r]
    return settled


@kernel
def own_force(model, k, i, segment, t, member_state, q, v, a, row, row_rate):
    """The force f_i of a member at unit strength (N), and its row B_i.

    Constant:
      model: the compiled scene.
      k, i: the block, and the member (padded).
      segment, t: segment of `model.times`, and time in it (s).
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    Out:
      row (2 D,): B_i over the freedoms of both bodies.
      row_rate (2 D,): its derivative by time; not set for an inerter.
    """
    if model.block[k, CODE] == INERTER:
        return inerter_force(model, k, i, q, v, a, row)
    x, rate = member_rows(model, model.block[k, PAIR], i, q, v, row, row_rate)
    x -= member_state[SET, i]
    value = level_of(model, segment, k, t)
    f, _, _, _, _ = law(
        model.block[k, CODE], model.law[k], x, rate, int(member_state[MODE, i]), t, value, model.curves,
        model.member[MEMBER_FREE_LENGTH, i],
    )  # fmt: skip
    return f


@kernel
def through_step(
    tag,
    model,
    tables,
    member_state,
    history,
    w,
    c,
    sweeps,
    bars,
    rows_bar,
    sets_bar,
    workspace,
    column,
    sets,
    matrix,
    spare,
):
    """Carry the derivatives of the state by every alpha^mu, and by parameters, through step w to its fraction c.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      model: the compiled scene.
      history, w, c: the history of steps, the step, and the fraction of it.
      sweeps, bars (s, 3, n), rows_bar (s, n_row): as of `step_map`.
      sets (slots, M_padded + P): derivatives of the permanent sets (`permanent_sets`).
      sets_bar (s, slots): cotangents of an integral by the sets at the stages; no rows where there is none.
    In and out:
      member_state (3, columns): state of the members; modes and sets become those of the step in hand.
      column (M_padded + P, 4 n + 1): derivatives of q, v and the two carried vectors; the last column sums up that of
        the integral.
    Out:
      matrix (4 n + s n or more, 4 n + 1): of `step_map`. spare (4 n + 1,): scratch.
      workspace: workspace of a balance, overwritten.

    Returns whether all sweeps settled.
    """
    n = model.mass.shape[0]
    o = history.index[w, FIRST]
    s = history.index[w + 1, FIRST] - o
    segment = history.index[w, SEGMENT]
    row = np.empty(pair_freedoms(model))
    row_rate = np.empty(pair_freedoms(model))
    restore_modes(history, history.index[w, EVENTS], member_state)
    settled = step_map(tag, model, tables, history, w, c, sweeps, bars, rows_bar, workspace, matrix)
    width = 4 * n + 1
    slots = sets.shape[0]
    by_set = np.empty((slots, width))
    if slots > 0:
        through_sets(model, member_state, history, w, matrix, by_set)
        for m in range(slots):
            for j in range(sets_bar.shape[0]):
                by_set[m, 4 * n] += sets_bar[j, m]
    for k in range(model.block.shape[0]):
        if model.block[k, DESIGN] < 0:
            continue
        for i in range(model.block[k, START], model.block[k, START] + model.block[k, COUNT]):
            spare[:] = 0.0
            for b in range(4 * n):
                value = column[i, b]
                if value != 0.0:
                    for d in range(width):
                        spare[d] += value * matrix[b, d]
            if model.active[segment, k] != 0:
                for j in range(s):
                    f = own_force(
                        model, k, i, segment, history.when[o + j], member_state, history.stage_q[o + j],
                        history.stage_v[o + j], history.stage_a[o + j], row, row_rate,
                    )  # fmt: skip
                    for r in range(pair_freedoms(model)):
                        b = (4 + j) * n + place_in_pair(model, model.block[k, PAIR], r)
                        for d in range(width):
                            spare[d] -= f * row[r] * matrix[b, d]
            for m in range(slots):
                if sets[m, i] != 0.0:
                    for d in range(width):
                        spare[d] += sets[m, i] * by_set[m, d]
            for d in range(4 * n):
                column[i, d] = spare[d]
            column[i, 4 * n] += spare[4 * n]
    if column.shape[0] > model.member.shape[1]:
        _parameters_through_step(model, member_state, history, w, column, sets, by_set, matrix, spare)
    return settled


@kernel
def _parameters_through_step(model, member_state, history, w, column, sets, by_set, matrix, spare):
    """Carry the derivatives by parameters, the rows of `column` behind the members, through step w.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      history, w: the history of steps, and the step.
      sets (slots, M_padded + P): derivatives of the permanent sets. by_set (slots, 4 n + 1): what unit sets do at the
        end.
      matrix (4 n + s n or more, 4 n + 1): of `step_map`.
    In and out:
      column (M_padded + P, 4 n + 1): as of `through_step`.
    Out:
      spare (4 n + 1,): scratch.
    """
    n = model.mass.shape[0]
    o = history.index[w, FIRST]
    segment = history.index[w, SEGMENT]
    row = np.empty(pair_freedoms(model))
    row_rate = np.empty(pair_freedoms(model))
    moved = np.empty(pair_freedoms(model))
    width = 4 * n + 1
    members = model.member.shape[1]
    for c in range(members, column.shape[0]):
        spare[:] = 0.0
        for b in range(4 * n):
            value = column[c, b]
            if value != 0.0:
                for d in range(width):
                    spare[d] += value * matrix[b, d]
        for e in range(model.varied.shape[0]):
            k = model.varied[e, VARIED_BLOCK]
            place = model.varied[e, VARIED_PLACE]
            if model.varied[e, VARIED_VALUE] != c - members or place > FREE_LENGTH or model.active[segment, k] == 0:
                continue
            for j in range(history.index[w + 1, FIRST] - o):
                for i in range(model.varied[e, VARIED_FIRST], model.varied[e, VARIED_STOP]):
                    slope, _ = parameter_slopes(
                        model, e, i, segment, history.when[o + j], member_state, history.stage_q[o + j],
                        history.stage_v[o + j], history.stage_a[o + j], row, row_rate, moved,
                    )  # fmt: skip
                    slope *= member_state[SCALE, i]
                    for r in range(pair_freedoms(model)):
                        b = (4 + j) * n + place_in_pair(model, model.block[k, PAIR], r)
                        force = slope * row[r] + member_state[SCALE, i] * moved[r]
                        for d in range(width):
                            spare[d] -= force * matrix[b, d]
        number_through_step(model, c - column.shape[0] + model.apart.shape[0], history, w, segment, matrix, spare)
        for m in range(sets.shape[0]):
            for d in range(width):
                spare[d] += sets[m, c] * by_set[m, d]
        for d in range(4 * n):
            column[c, d] = spare[d]
        column[c, 4 * n] += spare[4 * n]


@kernel
def shift_times(model, history, member_state, count, state, j, square, column):
    """What shifting the times of laws that begin or end at a state does to the derivatives by them (`parameters`).

    Constant:
      model: the compiled scene.
      history, count: the history of steps, and how many steps it has.
      state: number of the state.
      j, square: the response whose integral (or that of its square) is meant, -1 for none.
    In and out:
      member_state (3, columns): state of the members; modes are not what they were before the call.
      column (M_padded + P, 4 n + 1): as of `through_step`; velocities and the integral change.
    """
    n = model.mass.shape[0]
    dv = np.empty(n)
    for e in range(model.varied.shape[0]):
        if model.varied[e, VARIED_PLACE] <= FREE_LENGTH:
            continue
        does, drop = time_jump(model, history, member_state, count, state, e, j, square, dv)
        if does:
            c = model.member.shape[1] + model.varied[e, VARIED_VALUE]
            for d in range(n):
                column[c, n + d] += dv[d]
            column[c, 4 * n] += drop


@kernel
def jump(model, history, member_state, count, state, column, sets, drops, j, square):
    """Saltation of the derivatives at the events of a state; a step that follows makes its own carried vectors.

    Constant:
      model: the compiled scene.
      history, count: the history of steps, and how many steps it has.
      state: number of the state.
      drops (E,): of `adjoint.event_drops`, which the derivative of the integral takes in; no rows where there is none.
      j, square: the response whose integral (or that of its square) is meant, -1 for none.
    In and out:
      member_state (3, columns): state of the members; modes are not what they were before the call.
      column (M_padded + P, 4 n + 1), sets (slots, M_padded + P): as of `through_step`.
    """
    n = model.mass.shape[0]
    if state == 0:
        return
    members = model.member.shape[1]
    for e in range(history.index[state - 1, EVENTS], history.index[state, EVENTS]):
        if history.event[e, STATE] != state:
            continue
        for i in range(column.shape[0]):
            later = 0.0
            for d in range(n):
                later -= history.saltation[e, 0, d] * column[i, d] + history.saltation[e, 1, d] * column[i, n + d]
            if i >= members:
                for entry in range(model.varied.shape[0]):
                    if model.varied[entry, VARIED_VALUE] == i - members:
                        later += event_slope(model, history, member_state, e, entry)
            if sets.shape[0] > 0:
                later += time_forward(model, history, e, sets, i)
            for d in range(n):
                column[i, n + d] += history.saltation[e, 2, d] * later
            if drops.shape[0] > 0:
                column[i, 4 * n] += drops[e] * later
        if sets.shape[0] > 0:
            sets_forward(model, history, e, column, sets)
    if model.varied.shape[0] > 0:
        shift_times(model, history, member_state, count, state, j, square, column)


@kernel
def begin(model, history, first, column, sets):
    """Column and sets at the start, whose positions have the derivatives first (M_padded, n), or none (no rows).

    The sets that members begin with depend on parameters besides, and velocities on numbers of the scene.
    """
    for i in range(first.shape[0]):
        for d in range(first.shape[1]):
            column[i, d] = first[i, d]
    begin_velocities(model, column)
    if (first.shape[0] > 0 or model.varied.shape[0] > 0) and sets.shape[0] > 0:
        for e in range(history.index[0, EVENTS]):
            sets_forward(model, history, e, column, sets)


@entry
def push(
    tag,
    ints,
    floats,
    tables,
    alpha,
    limits,
    count,
    j,
    integral,
    sweeps,
    row,
    across,
    room,
    room_ints,
    member_state,
    padded,
    out,
    first,
    work,
):
    """The derivative of one row of `extremes`, or of an integral, by the design, carried forward with the motion.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      ints, floats: the packed scene (`general_model.pack_general`).
      alpha (N,): the design.
      limits: steps allowed, and the sizes of the history's arrays (`carve_history`).
      count, j: how many steps there are; the response.
      integral: 0: the row is meant; 1: the integral of g_j; 2: that of its square.
      sweeps: above 0, by the iterative method, with so many sweeps at most.
      row (COLUMNS,), across: as of `adjoint.row_cotangents`; not read for integrals.
      first (M_padded + P, n): derivatives of the start's positions; no rows where it is as stated.
    In and out:
      room, room_ints: the history of steps; a partial step may come behind the others.
      member_state (3, columns): state of the members; modes and sets become those of the step in hand.
    Out:
      out (N + P,): the derivative by alpha, then by parameters. padded (M_padded + P,): scratch.
      work (WORK,): counts of work, added to.

    Returns the step in which the sweeps did not settle, or -1.
    """
    model = unpack_general(ints, floats)
    history = carve_history(model, limits, room, room_ints)
    workspace = make_workspace(model)
    n = model.mass.shape[0]
    n_row = model.size[0]
    column = np.zeros((padded.shape[0], 4 * n + 1))
    matrix = np.empty((21 * n, 4 * n + 1))
    spare = np.empty(4 * n + 1)
    bars = np.zeros((3, n))
    stages = history.index[count, FIRST] if integral > 0 else 0
    stage_bars = np.zeros((stages, 3, n))
    rows_bar = np.zeros((stages, n_row))
    slots = count_sets(model)
    sets = np.zeros((slots, padded.shape[0]))
    bar_set = np.zeros(slots)
    sets_bar = np.zeros((stages, slots))
    begin(model, history, first, column, sets)
    drops = np.empty(0)
    w = count
    c = 1.0
    last = count
    if integral > 0:
        integral_cotangents(
            tag, model, tables, member_state, history, count, j, integral == 2, stage_bars, rows_bar, sets_bar,
            np.empty(0), workspace, padded, work,
        )  # fmt: skip
        drops = event_drops(model, member_state, history, count, j, integral == 2, workspace)
    else:
        w, c = row_cotangents(
            tag, model, tables, member_state, history, count, j, row, across, workspace, bars, bar_set, padded, work
        )
        last = w if w <= count else history.index[w, PARENT] + 1  # a partial step lies behind the others
    looked = j if integral > 0 else np.int64(-1)
    if model.varied.shape[0] > 0 and last >= 0 and w >= 0:
        shift_times(model, history, member_state, count, np.int64(0), looked, integral == 2, column)
    for k in range(last):
        o = history.index[k, FIRST]
        end = history.index[k + 1, FIRST]
        own = stage_bars[o:end] if integral > 0 else stage_bars
        own_rows = rows_bar[o:end] if integral > 0 else rows_bar
        own_sets = sets_bar[o:end] if integral > 0 else sets_bar
        settled = through_step(
            tag, model, tables, member_state, history, k, 1.0, sweeps, own, own_rows, own_sets, workspace, column, sets,
            matrix, spare,
        )  # fmt: skip
        if not settled:
            return k
        jump(model, history, member_state, count, k + 1, column, sets, drops, looked, integral == 2)
    if integral == 0 and w >= 0:
        settled = through_step(
            tag, model, tables, member_state, history, w, c, sweeps, stage_bars, rows_bar, sets_bar, workspace, column,
            sets, matrix, spare,
        )  # fmt: skip
        if not settled:
            return last
    for i in range(padded.shape[0]):
        padded[i] += column[i, 4 * n]
        for d in range(n):
            padded[i] += bars[0, d] * column[i, d] + bars[1, d] * column[i, n + d]
        for m in range(slots):
            padded[i] += bar_set[m] * sets[m, i]
    unscale_general(model.block, model.power, alpha, padded, out)
    return -1


@kernel
def number_forces(model, ints, shifted, apart, member_state, history, w, c, force, f, slope):
    """Forces at the stages of step w that do what a parameter of laws, or another number of the scene, does.

    Constant:
      model: the compiled scene. ints: of the packed scene.
      shifted (B, 2, L), apart (B,): as of `follow`.
      history, w: the history of steps, and the step.
      c: which number: parameters of laws first, then the B numbers.
    In:
      member_state (3, columns): state of the members, with the modes and sets of the step.
    Out:
      force (s, n): the forces (N, N m per unit of the number). f, slope (n,): scratch.
    """
    n = slope.shape[0]
    o = history.index[w, FIRST]
    segment = history.index[w, SEGMENT]
    row = np.empty(pair_freedoms(model))
    row_rate = np.empty(pair_freedoms(model))
    moved = np.empty(pair_freedoms(model))
    force[:] = 0.0
    for e in range(model.varied.shape[0]):
        k = model.varied[e, VARIED_BLOCK]
        place = model.varied[e, VARIED_PLACE]
        if model.varied[e, VARIED_VALUE] != c or place > FREE_LENGTH or model.active[segment, k] == 0:
            continue
        for j in range(force.shape[0]):
            for i in range(model.varied[e, VARIED_FIRST], model.varied[e, VARIED_STOP]):
                by_value, _ = parameter_slopes(
                    model, e, i, segment, history.when[o + j], member_state, history.stage_q[o + j],
                    history.stage_v[o + j], history.stage_a[o + j], row, row_rate, moved,
                )  # fmt: skip
                for r in range(pair_freedoms(model)):
                    d = place_in_pair(model, model.block[k, PAIR], r)
                    force[j, d] -= by_value * member_state[SCALE, i] * row[r] + member_state[SCALE, i] * moved[r]
    b = c - values_of(model)
    if b < 0:
        return
    one = unpack_general(ints, shifted[b, 0])
    other = unpack_general(ints, shifted[b, 1])
    for j in range(force.shape[0]):
        balance_slope(
            one, other, apart[b], segment, history.when[o + j], history.stage_q[o + j], history.stage_v[o + j],
            history.stage_a[o + j], f, slope,
        )  # fmt: skip
        for d in range(n):
            force[j, d] -= slope[d]


@kernel
def values_of(model):
    """P, how many values of laws vary."""
    last = model.varied.shape[0] - 1
    return model.varied[last, VARIED_VALUE] + 1 if last >= 0 else 0


@kernel
def numbers_alone(
    tag, model, ints, shifted, apart, tables, member_state, history, w, workspace, column, force, changes, rows, f,
    slope,
):  # fmt: skip
    """Carry the derivatives by parameters of laws and other numbers through step w, without those by alpha.

    What `through_step` does by the map of the step: this takes a push for each number, that one for each freedom.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      model: the compiled scene. ints: of the packed scene.
      shifted (B, 2, L), apart (B,): as of `follow`.
      history, w: the history of steps, and the step.
    In and out:
      member_state (3, columns): state of the members; modes and sets are put to those of the step.
      column (M_padded + P + B, 4 n + 1): as of `through_step`; the rows behind the members change.
    Out:
      force (most, n), changes (most, 3, n), rows (most, n_row): scratch for the stages of a step.
      f, slope (n,): scratch. workspace: workspace of a balance, overwritten.
    """
    n = slope.shape[0]
    s = history.index[w + 1, FIRST] - history.index[w, FIRST]
    members = model.member.shape[1]
    dq = np.empty(n)
    dv = np.empty(n)
    dx = np.empty((2, n))
    restore_modes(history, history.index[w, EVENTS], member_state)
    for i in range(members, column.shape[0]):
        number_forces(model, ints, shifted, apart, member_state, history, w, i - members, force[:s], f, slope)
        for d in range(n):
            dq[d] = column[i, d]
            dv[d] = column[i, n + d]
            for carried in range(2):
                dx[carried, d] = column[i, (2 + carried) * n + d]
        step_forward(tag, model, tables, history, w, 1.0, 0, dq, dv, dx, force[:s], changes[:s], rows[:s], workspace)
        for d in range(n):
            column[i, d] = dq[d]
            column[i, n + d] = dv[d]
            for carried in range(2):
                column[i, (2 + carried) * n + d] = dx[carried, d]


@kernel
def numbers_through_step(model, ints, shifted, apart, member_state, history, w, matrix, column, force, f, slope):
    """What the B numbers do in step w, added to the derivatives by them at its end that `through_step` has carried.

    Constant:
      model: the compiled scene. ints: of the packed scene.
      shifted (B, 2, L), apart (B,): as of `follow`.
      history, w: the history of steps, and the step.
      matrix (4 n + s n or more, 4 n + 1): of `step_map`.
    In:
      member_state (3, columns): state of the members, with the modes and sets of the step.
    In and out:
      column (M_padded + P + B, 4 n + 1): as of `through_step`; its last B rows change.
    Out:
      force (most, n), f, slope (n,): scratch.
    """
    n = slope.shape[0]
    s = history.index[w + 1, FIRST] - history.index[w, FIRST]
    first = column.shape[0] - shifted.shape[0]
    for c in range(first, column.shape[0]):
        number_forces(
            model, ints, shifted, apart, member_state, history, w, c - model.member.shape[1], force[:s], f, slope
        )
        for j in range(s):
            for d in range(n):
                for e in range(4 * n):
                    column[c, e] += force[j, d] * matrix[(4 + j) * n + d, e]


@entry
def follow(
    tag,
    ints,
    floats,
    tables,
    alpha,
    limits,
    count,
    looked,
    at,
    who,
    shifted,
    apart,
    with_alpha,
    room,
    room_ints,
    member_state,
    padded,
    out,
    first,
    work,
):
    """dg/d(design) of responses at states, the time held fixed; at events the derivatives of the values before them.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      ints, floats: the packed scene (`general_model.pack_general`).
      alpha (N,): the design.
      limits, room, room_ints: the history of steps, as of `carve_history`.
      count: how many steps there are.
      looked (R,): the responses. at (K,): the states, rising.
      who (R, K): the member whose force is meant.
      shifted (B, 2, L), apart (B,): for each of B numbers the floats of the packed scene with a larger and with a
        smaller one, and by how much these differ; only masses, loads and velocities at the start may depend on it.
      with_alpha: whether derivatives by alpha are wanted; else they may mean nothing, and it takes much less time.
      first (M_padded + P, n): derivatives of the start's positions; no rows where it is as stated.
    In and out:
      member_state (3, columns): state of the members; modes and sets become those of the step in hand.
    Out:
      out (R, K, N + P + B): the derivatives by alpha, by parameters, by the B numbers. padded (M_padded + P + B,):
        scratch.
      work (WORK,): counts of work, added to.
    """
    model = unpack_general(ints, floats)
    history = carve_history(model, limits, room, room_ints)
    workspace = make_workspace(model)
    n = model.mass.shape[0]
    numbers = shifted.shape[0]
    most = 17  # stages of a step, as of `step_map`
    force = np.empty((most, n))
    changes = np.empty((most, 3, n))
    stage_rows = np.empty((most, model.size[0]))
    column = np.zeros((padded.shape[0], 4 * n + 1))
    matrix = np.empty((21 * n, 4 * n + 1))
    spare = np.empty(4 * n + 1)
    bars = np.zeros((3, n))
    a = np.empty(n)
    f = np.empty(n)
    slope = np.empty(n)
    lam = np.empty(model.size[0])
    nothing = np.zeros((0, 3, n))
    no_rows = np.zeros((0, model.size[0]))
    slots = count_sets(model)
    sets = np.zeros((slots, padded.shape[0]))
    bar_set = np.zeros(slots)
    no_sets = np.zeros((0, slots))
    begin(model, history, first, column, sets)
    for b in range(numbers):
        one = unpack_general(ints, shifted[b, 0])
        other = unpack_general(ints, shifted[b, 1])
        for d in range(n):
            column[column.shape[0] - numbers + b, n + d] = (one.v0[d] - other.v0[d]) / apart[b]
    row = np.zeros(COLUMNS)
    place = 0
    for k in range(count + 1):
        if place == at.shape[0]:
            break
        row[STEP] = max(k - 1, 0)
        row[FRACTION] = 1.0 if k > 0 else 0.0
        if k > 0 and slots == 0 and not with_alpha:
            numbers_alone(
                tag, model, ints, shifted, apart, tables, member_state, history, k - 1, workspace, column, force,
                changes, stage_rows, f, slope,
            )  # fmt: skip
        elif k > 0:
            through_step(
                tag, model, tables, member_state, history, k - 1, 1.0, 0, nothing, no_rows, no_sets, workspace, column,
                sets, matrix, spare,
            )  # fmt: skip
            numbers_through_step(
                model, ints, shifted, apart, member_state, history, k - 1, matrix, column, force, f, slope
            )
        while place < at.shape[0] and at[place] == k:
            for r in range(looked.shape[0]):
                row[WHO] = who[r, place]
                row_cotangents(
                    tag,
                    model,
                    tables,
                    member_state,
                    history,
                    count,
                    looked[r],
                    row,
                    np.bool_(False),
                    workspace,
                    bars,
                    bar_set,
                    padded,
                    work,
                )
                for i in range(padded.shape[0]):
                    for d in range(n):
                        padded[i] += bars[0, d] * column[i, d] + bars[1, d] * column[i, n + d]
                    for m in range(slots):
                        padded[i] += bar_set[m] * sets[m, i]
                if numbers > 0:
                    segment = history.index[int(row[STEP]), SEGMENT]
                    restore_modes(history, history.index[int(row[STEP]), EVENTS], member_state)
                    q, v = history.q[k].copy(), history.v[k].copy()
                    no = np.bool_(False)
                    solve_accelerations(model, member_state, segment, history.t[k], q, v, no, workspace, a, lam)
                for b in range(numbers):
                    balance_slope(
                        unpack_general(ints, shifted[b, 0]), unpack_general(ints, shifted[b, 1]), apart[b], segment,
                        history.t[k], q, v, a, f, slope,
                    )  # fmt: skip
                    for d in range(n):
                        padded[padded.shape[0] - numbers + b] -= bars[2, d] * slope[d]
                unscale_general(model.block, model.power, alpha, padded, out[r, place])
            place += 1
        if k == 0 and model.varied.shape[0] > 0:
            shift_times(model, history, member_state, count, k, np.int64(-1), np.bool_(False), column)
        if k > 0:
            jump(model, history, member_state, count, k, column, sets, np.empty(0), np.int64(-1), np.bool_(False))
