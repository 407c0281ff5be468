"""The sensitivities of a general motion carried forward with it: the second way to the same gradients.

Each step is a linear map of changes of the state at its start, and of forces at its stages (`step_map`). It is found
once, and then applied to the derivatives of the state by every alpha^mu, whose forces are each member's own. At events
the derivatives jump by saltation. At the time of a row its cotangents meet them.

The derivatives stand in one array of W + 1 rows, `states`: a row for each number of the state (q, v, and what the
integrator carries from step to step, of the F free freedoms), and one for an integral. Its columns are the members
(padded), then the parameters.
"""

import numpy as np

from mdstopo.compiler.jit import entry, kernel
from mdstopo.compiler.vector import lanes
from mdstopo.general.design.balance_slopes import balance_slope, begin_velocities
from mdstopo.general.design.parameters import event_slope, parameter_slopes, time_jump
from mdstopo.general.dynamics.accelerations import make_workspace, solve_accelerations
from mdstopo.general.dynamics.members import SCALE, unscale_general
from mdstopo.general.events.permanent_sets import add_sets_of_rows, count_sets, sets_forward, time_forward
from mdstopo.general.model.general_model import (
    PAIR,
    VARIED_BLOCK,
    VARIED_FIRST,
    VARIED_PLACE,
    VARIED_STOP,
    VARIED_VALUE,
    unpack_general,
)
from mdstopo.general.model.strides import pair_freedoms, place_in_pair
from mdstopo.general.responses.extremes import COLUMNS, FRACTION, STEP, WHO
from mdstopo.general.sensitivity.adjoint import event_drops, integral_cotangents, row_cotangents
from mdstopo.general.sensitivity.row_sweep import add_share
from mdstopo.general.sensitivity.step_map import (
    STAGES,
    TOGETHER,
    add_forces,
    carry_states,
    find_step_map,
    make_step_map,
    map_back,
    start_changes,
)
from mdstopo.general.steps.method_interface import carried, step_forward
from mdstopo.general.steps.step_history import EVENTS, FIRST, SEGMENT, STATE, carve_history, restore_modes
from mdstopo.mechanics.laws.law_table import FREE_LENGTH


@kernel
def through_step(model, member_state, history, w, step, sets_bar, fresh, states, sets, work):
    """Carry the derivatives of the state through a step whose map has been found.

    Constant:
      model: the compiled scene.
      history, w: the history of steps, and the step.
      step: its map (`step_map.StepMap`).
      sets (slots, M_padded + P): derivatives of the permanent sets (`permanent_sets`).
      sets_bar (s, slots): cotangents of an integral by the sets at the stages; no rows where there is no integral.
    In and out:
      member_state (3, columns): state of the members; modes and sets become those of the step.
      states (W + 1, M_padded + P): the derivatives; the last row is left alone where there is no integral.
    Out:
      fresh (2 W + 4, lanes): scratch.
      work (WORK,): counts of work, added to.
    """
    width = step.by_state.shape[0]
    count = width + 1 if sets_bar.shape[0] > 0 else width
    restore_modes(history, history.index[w, EVENTS], member_state)
    carry_states(step, count, fresh, states)
    add_forces(model, history, w, member_state, step, step.by_force[:count], step.by_pose[:count], states[:count], work)
    if sets.shape[0] == 0:
        return
    by_set = np.zeros((count, sets.shape[0]))
    _sets_of_rows(model, history, w, member_state, step.by_force[:count], by_set)
    for m in range(sets.shape[0]):
        for j in range(sets_bar.shape[0]):
            by_set[width, m] += sets_bar[j, m]
        for d in range(count):
            if by_set[d, m] != 0.0:
                add_share(by_set[d, m], sets[m], states[d])


@kernel
def _sets_of_rows(model, history, w, member_state, by_force, out):
    """Add what unit permanent sets do in step w to R numbers of its end.

    model: the compiled scene.
    history, w: the history of steps, and the step.
    member_state (3, columns): state of the members, with the modes and sets of the step.
    by_force (R, STAGES, n): of the map of the step, for these numbers.
    out (R, slots): added to.
    """
    o = history.index[w, FIRST]
    for j in range(history.index[w + 1, FIRST] - o):
        add_sets_of_rows(model, history.index[w, SEGMENT], member_state, history, o + j, by_force, j, out)


@kernel
def add_state(model, member_state, history, w, step, bars, bar_set, states, sets, out, work):
    """Add the derivatives of what cotangents of a state are of, at the end of a step or at a fraction of it.

    Constant:
      model: the compiled scene.
      history, w: the history of steps, and the step.
      step: its map up to that state (`step_map.StepMap`).
      bars (2 or more, n), bar_set (slots,): cotangents of q and v there, and of the permanent sets.
      states (W + 1, M_padded + P), sets (slots, M_padded + P): derivatives of the state at the start of the step, and
        of the sets.
    In and out:
      member_state (3, columns): state of the members; modes and sets become those of the step.
    Out:
      out (M_padded + P,): added to.
      work (WORK,): counts of work, added to.
    """
    share = np.empty(step.by_state.shape[0])
    by_force = np.empty((min(1, step.by_force.shape[0]), STAGES, step.by_force.shape[2]))
    by_pose = np.empty((min(1, step.by_pose.shape[0]), STAGES, step.by_pose.shape[2], step.by_pose.shape[3]))
    rows = out.reshape((1, out.shape[0]))
    restore_modes(history, history.index[w, EVENTS], member_state)
    map_back(step, bars, share, by_force, by_pose)
    for b in range(share.shape[0]):
        if share[b] != 0.0:
            add_share(share[b], states[b], out)
    add_forces(model, history, w, member_state, step, by_force, by_pose, rows, work)
    if sets.shape[0] > 0:
        own = np.zeros((1, sets.shape[0]))
        _sets_of_rows(model, history, w, member_state, by_force, own)
        for m in range(sets.shape[0]):
            add_share(own[0, m] + bar_set[m], sets[m], out)


@kernel
def add_at_state(place, bars, bar_set, states, sets, out):
    """Do what `add_state` does where the derivatives are those of the very state that the cotangents belong to.

    place (F,): the free freedoms.
    bars, bar_set, states, sets, out: as of `add_state`.
    """
    free = place.shape[0]
    for k in range(free):
        add_share(bars[0, place[k]], states[k], out)
        add_share(bars[1, place[k]], states[free + k], out)
    for m in range(sets.shape[0]):
        add_share(bar_set[m], sets[m], out)


@kernel
def shift_times(model, history, member_state, count, state, j, square, place, states):
    """What shifting the times of laws that begin or end at a state does to the derivatives by them (`parameters`).

    Constant:
      model: the compiled scene.
      history, count: the history of steps, and how many steps it has.
      state: number of the state.
      j, square: the response whose integral (or that of its square) is meant, -1 for none.
      place (F,): the free freedoms.
    In and out:
      member_state (3, columns): state of the members; modes are not what they were before the call.
      states (W + 1, M_padded + P): as of `through_step`; velocities and the integral change.
    """
    free = place.shape[0]
    dv = np.empty(model.mass.shape[0])
    for e in range(model.varied.shape[0]):
        if model.varied[e, VARIED_PLACE] <= FREE_LENGTH:
            continue
        does, drop = time_jump(model, history, member_state, count, state, e, j, square, dv)
        if does:
            c = model.member.shape[1] + model.varied[e, VARIED_VALUE]
            for k in range(free):
                states[free + k, c] += dv[place[k]]
            states[states.shape[0] - 1, c] += drop


@kernel
def jump(model, history, member_state, count, state, step, states, sets, drops, j, square):
    """Saltation of the derivatives at the events of a state; a step that follows makes its own carried vectors.

    Constant:
      model: the compiled scene.
      history, count: the history of steps, and how many steps it has.
      state: number of the state.
      step: any map (`step_map.StepMap`), of which place and row_of are read.
      drops (E,): of `adjoint.event_drops`, which the derivative of the integral takes in; no rows where there is none.
      j, square: the response whose integral (or that of its square) is meant, -1 for none.
    In and out:
      member_state (3, columns): state of the members; modes are not what they were before the call.
      states (W + 1, M_padded + P), sets (slots, M_padded + P): as of `through_step`.
    """
    free = step.place.shape[0]
    members = model.member.shape[1]
    for e in range(history.index[state - 1, EVENTS], history.index[state, EVENTS]):
        if history.event[e, STATE] != state:
            continue
        later = np.zeros(states.shape[1])  # how much later the event happens
        for k in range(free):
            add_share(-history.saltation[e, 0, step.place[k]], states[k], later)
            add_share(-history.saltation[e, 1, step.place[k]], states[free + k], later)
        for varied in range(model.varied.shape[0]):
            later[members + model.varied[varied, VARIED_VALUE]] += event_slope(model, history, member_state, e, varied)
        if sets.shape[0] > 0:
            time_forward(model, history, e, sets, later)
        for k in range(free):
            add_share(history.saltation[e, 2, step.place[k]], later, states[free + k])
        if drops.shape[0] > 0:
            add_share(drops[e], later, states[states.shape[0] - 1])
        if sets.shape[0] > 0:
            sets_forward(model, history, e, step.row_of, states, sets)
    if model.varied.shape[0] > 0:
        shift_times(model, history, member_state, count, state, j, square, step.place, states)


@kernel
def begin(model, history, first, step, states, sets):
    """Derivatives of the state and the sets at the start, whose positions have first (M_padded + P, n), or none (no
    rows).

    The sets that members begin with depend on parameters besides, and velocities on numbers of the scene.

    model: the compiled scene.
    history: the history of steps.
    step: any map (`step_map.StepMap`), of which place and row_of are read.
    states (W + 1, M_padded + P), sets (slots, M_padded + P): out, zeros before.
    """
    for i in range(first.shape[0]):
        for k in range(step.place.shape[0]):
            states[k, i] = first[i, step.place[k]]
    begin_velocities(model, step.place, states)
    if (first.shape[0] > 0 or model.varied.shape[0] > 0) and sets.shape[0] > 0:
        for e in range(history.index[0, EVENTS]):
            sets_forward(model, history, e, step.row_of, states, sets)


@entry
def push(
    tag, ints, floats, tables, alpha, limits, count, which, rows, integral, iterations, room, room_ints, member_state,
    padded, out, first, work,
):  # fmt: skip
    """The derivatives of rows of `extremes`, or of one integral, by the design, carried forward with the motion.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      ints, floats: the packed scene (`general_model.pack_general`).
      alpha (N,): the design.
      limits: steps allowed, and the sizes of the history's arrays (`carve_history`).
      count: how many steps there are.
      which (R, 2): each row's response, and 1 where the component across its vector is meant
        (`adjoint.row_cotangents`), else 0. rows (R, COLUMNS): the rows, the earliest first; of an integral not read.
      integral: 0: the rows are meant; 1: the integral of the one response; 2: that of its square.
      iterations: above 0, by the iterative method, with so many iterations at most.
      first (M_padded + P, n): derivatives of the start's positions; no rows where it is as stated.
    In and out:
      room, room_ints: the history of steps; a partial step may come behind the others.
      member_state (3, columns): state of the members; modes and sets become those of the step in hand.
    Out:
      out (R, N + P): the derivatives by alpha, then by parameters. padded (R, M_padded + P): scratch.
      work (WORK,): counts of work, added to.

    Returns the step in which the iterations did not settle, or -1.
    """
    model = unpack_general(ints, floats)
    history = carve_history(model, limits, room, room_ints)
    workspace = make_workspace(model)
    n = model.mass.shape[0]
    slots = count_sets(model)
    step = make_step_map(model, carried(tag), slots + model.varied.shape[0] + model.apart.shape[0] == 0)
    states = np.zeros((step.end.shape[0], padded.shape[1]))
    fresh = np.empty((2 * step.end.shape[0] + 2, lanes()))
    sets = np.zeros((slots, padded.shape[1]))
    stages = history.index[count, FIRST] if integral > 0 else 0
    bars = np.zeros((stages, 3, n))
    rows_bar = np.zeros((stages, model.size[0]))
    sets_bar = np.zeros((stages, slots))
    begin(model, history, first, step, states, sets)
    drops = np.empty(0)
    integrated = which[0, 0] if integral > 0 else np.int64(-1)
    found = False  # whether the map of the whole step in hand is there
    r = 0
    if integral > 0:
        integral_cotangents(
            tag, model, tables, member_state, history, count, integrated, integral == 2, bars, rows_bar, sets_bar,
            np.empty(0), workspace, padded[0], work,
        )  # fmt: skip
        drops = event_drops(model, member_state, history, count, integrated, integral == 2, workspace)
    else:
        while r < rows.shape[0] and _step_of(rows[r]) < 0:
            add_row(
                tag, model, tables, member_state, history, count, which[r], rows[r], iterations, found, workspace, step,
                states, sets, padded[r], work,
            )  # fmt: skip
            r += 1
    if model.varied.shape[0] > 0 and (integral > 0 or r < rows.shape[0]):
        shift_times(model, history, member_state, count, np.int64(0), integrated, integral == 2, step.place, states)
    for k in range(count):
        if integral == 0 and r == rows.shape[0]:
            break
        o = history.index[k, FIRST] if integral > 0 else 0
        end = history.index[k + 1, FIRST] if integral > 0 else 0
        found = False
        while integral == 0 and r < rows.shape[0] and _step_of(rows[r]) == k:
            settled, found = add_row(
                tag, model, tables, member_state, history, count, which[r], rows[r], iterations, found, workspace, step,
                states, sets, padded[r], work,
            )  # fmt: skip
            if not settled:
                return k
            r += 1
        if integral == 0 and r == rows.shape[0]:
            break
        if not found and not find_step_map(
            tag, model, tables, history, k, 1.0, iterations, bars[o:end], rows_bar[o:end], workspace, step
        ):
            return k
        through_step(model, member_state, history, k, step, sets_bar[o:end], fresh, states, sets, work)
        jump(model, history, member_state, count, k + 1, step, states, sets, drops, integrated, integral == 2)
    for m in range(padded.shape[0]):
        if integral > 0:
            add_share(1.0, states[states.shape[0] - 1], padded[m])
        unscale_general(model.block, model.power, alpha, padded[m], out[m])
    return -1


@kernel
def _step_of(row):
    """The step at whose end or in which a row (COLUMNS,) is read; -1: the start of the motion."""
    return int(row[STEP]) - 1 if row[FRACTION] <= 0.0 else int(row[STEP])


@kernel
def add_row(
    tag, model, tables, member_state, history, count, own, row, iterations, found, workspace, step, states, sets, out,
    work,
):  # fmt: skip
    """Differentiate one row, with the derivatives of the state at the start of the step that it is read in.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      model: the compiled scene.
      count: how many steps there are.
      own (2,), row (COLUMNS,): as of `push`: which and rows of this one.
      iterations: as of `push`.
      found: whether `step` is the map of the whole step.
      states (W + 1, M_padded + P), sets (slots, M_padded + P): as of `through_step`.
    In and out:
      history: the history of steps; a partial step may come behind the others.
      member_state (3, columns): state of the members; modes and sets become those of the step.
      step: the map (`step_map.StepMap`), which becomes that up to the row.
    Out:
      out (M_padded + P,): the derivative by alpha^mu and by parameters.
      workspace: workspace of a balance, overwritten.
      work (WORK,): counts of work, added to.

    Returns whether all iterations settled, and whether `step` is now the map of the whole step.
    """
    n = model.mass.shape[0]
    bars = np.zeros((3, n))
    bar_set = np.zeros(sets.shape[0])
    w, c = row_cotangents(
        tag, model, tables, member_state, history, count, own[0], row, own[1] != 0, workspace, bars, bar_set, out, work
    )
    if w < 0:
        add_at_state(step.place, bars, bar_set, states, sets, out)
        return True, found
    whole = w < count and c >= 1.0
    if not (whole and found):
        none = np.empty((0, 3, n))
        no_rows = np.empty((0, model.size[0]))
        if not find_step_map(tag, model, tables, history, w, c, iterations, none, no_rows, workspace, step):
            return False, False
    add_state(model, member_state, history, w, step, bars, bar_set, states, sets, out, work)
    return True, whole


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
    tag, model, ints, shifted, apart, tables, member_state, history, w, workspace, step, states, f, slope
):  # fmt: skip
    """Carry the derivatives by parameters of laws and other numbers through step w, without those by alpha.

    What `through_step` does by the map of the step: this pushes a change for each number, that one for each freedom.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      model: the compiled scene. ints: of the packed scene.
      shifted (B, 2, L), apart (B,): as of `follow`.
      history, w: the history of steps, and the step.
    In and out:
      member_state (3, columns): state of the members; modes and sets are put to those of the step.
      states (W + 1, M_padded + P + B): as of `through_step`; the columns behind the members change.
    Out:
      step: room for changes that are pushed (`step_map.StepMap`).
      f, slope (n,): scratch. workspace: workspace of a balance, overwritten.
    """
    s = history.index[w + 1, FIRST] - history.index[w, FIRST]
    members = model.member.shape[1]
    restore_modes(history, history.index[w, EVENTS], member_state)
    for low in range(members, states.shape[1], TOGETHER):
        count = min(TOGETHER, states.shape[1] - low)
        for m in range(count):
            number_forces(
                model, ints, shifted, apart, member_state, history, w, low + m - members, step.force[m, :s], f, slope
            )
            _exchange(step, m, states, low + m, False)
        step_forward(
            tag, model, tables, history, w, 1.0, 0, step.dq[:count], step.dv[:count], step.dx[:count],
            step.force[:count], step.changes[:count], step.rows[:count], workspace,
        )  # fmt: skip
        for m in range(count):
            _exchange(step, m, states, low + m, True)


@kernel
def _exchange(step, m, states, i, back):
    """Copy the derivatives by variable i into place m of the changes that are pushed through a step, or `back`."""
    free = step.place.shape[0]
    if not back:
        start_changes(step, m)
    for k in range(free):
        d = step.place[k]
        if back:
            states[k, i] = step.dq[m, d]
            states[free + k, i] = step.dv[m, d]
        else:
            step.dq[m, d] = states[k, i]
            step.dv[m, d] = states[free + k, i]
        for vector in range(step.by_state.shape[0] // free - 2):
            row = (2 + vector) * free + k
            if back:
                states[row, i] = step.dx[m, vector, d]
            else:
                step.dx[m, vector, d] = states[row, i]


@kernel
def numbers_through_step(model, ints, shifted, apart, member_state, history, w, step, states, f, slope):
    """What the B numbers do in step w, added to the derivatives by them at its end that `through_step` has carried.

    Constant:
      model: the compiled scene. ints: of the packed scene.
      shifted (B, 2, L), apart (B,): as of `follow`.
      history, w: the history of steps, and the step.
      step: its map, by forces at the stages (`step_map.StepMap`).
    In:
      member_state (3, columns): state of the members, with the modes and sets of the step.
    In and out:
      states (W + 1, M_padded + P + B): as of `through_step`; its last B columns change.
    Out:
      f, slope (n,): scratch.
    """
    s = history.index[w + 1, FIRST] - history.index[w, FIRST]
    force = step.force[0, :s]
    for c in range(states.shape[1] - shifted.shape[0], states.shape[1]):
        number_forces(model, ints, shifted, apart, member_state, history, w, c - model.member.shape[1], force, f, slope)
        for e in range(step.by_state.shape[0]):
            for j in range(s):
                for d in range(slope.shape[0]):
                    states[e, c] += force[j, d] * step.by_force[e, j, d]


@entry
def follow(
    tag, ints, floats, tables, alpha, limits, count, responses, at, who, shifted, apart, with_alpha, room, room_ints,
    member_state, padded, out, first, work,
):  # fmt: skip
    """dg/d(design) of responses at states, the time held fixed; at events the derivatives of the values before them.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      ints, floats: the packed scene (`general_model.pack_general`).
      alpha (N,): the design.
      limits, room, room_ints: the history of steps, as of `carve_history`.
      count: how many steps there are.
      responses (R,): which ones. at (K,): the states, rising.
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
    slots = count_sets(model)
    by_poses = slots + model.varied.shape[0] + model.apart.shape[0] + numbers == 0
    step = make_step_map(model, carried(tag), by_poses)
    states = np.zeros((step.end.shape[0], padded.shape[0]))
    fresh = np.empty((2 * step.end.shape[0] + 2, lanes()))
    sets = np.zeros((slots, padded.shape[0]))
    bars = np.zeros((3, n))
    bar_set = np.zeros(slots)
    f = np.empty(n)
    slope = np.empty(n)
    none = np.empty((0, 3, n))
    no_rows = np.empty((0, model.size[0]))
    no_sets = np.empty((0, slots))
    begin(model, history, first, step, states, sets)
    for b in range(numbers):
        one = unpack_general(ints, shifted[b, 0])
        other = unpack_general(ints, shifted[b, 1])
        for k in range(step.place.shape[0]):
            d = step.place[k]
            states[step.place.shape[0] + k, states.shape[1] - numbers + b] = (one.v0[d] - other.v0[d]) / apart[b]
    row = np.zeros(COLUMNS)
    place = 0
    for k in range(count + 1):
        if place == at.shape[0]:
            break
        row[STEP] = max(k - 1, 0)
        row[FRACTION] = 1.0 if k > 0 else 0.0
        if k > 0 and slots == 0 and not with_alpha:
            numbers_alone(
                tag, model, ints, shifted, apart, tables, member_state, history, k - 1, workspace, step, states, f,
                slope,
            )  # fmt: skip
        elif k > 0:
            find_step_map(tag, model, tables, history, k - 1, 1.0, np.int64(0), none, no_rows, workspace, step)
            through_step(model, member_state, history, k - 1, step, no_sets, fresh, states, sets, work)
            numbers_through_step(model, ints, shifted, apart, member_state, history, k - 1, step, states, f, slope)
        while place < at.shape[0] and at[place] == k:
            for r in range(responses.shape[0]):
                row[WHO] = who[r, place]
                row_cotangents(
                    tag, model, tables, member_state, history, count, responses[r], row, np.bool_(False), workspace,
                    bars, bar_set, padded, work,
                )  # fmt: skip
                add_at_state(step.place, bars, bar_set, states, sets, padded)
                if numbers > 0:
                    _add_numbers_of_state(
                        model, ints, shifted, apart, member_state, history, k, int(row[STEP]), bars[2], workspace,
                        padded,
                    )  # fmt: skip
                unscale_general(model.block, model.power, alpha, padded, out[r, place])
            place += 1
        if k == 0 and model.varied.shape[0] > 0:
            shift_times(model, history, member_state, count, k, np.int64(-1), np.bool_(False), step.place, states)
        if k > 0:
            jump(model, history, member_state, count, k, step, states, sets, np.empty(0), np.int64(-1), np.bool_(False))


@kernel
def _add_numbers_of_state(model, ints, shifted, apart, member_state, history, k, w, z, workspace, out):
    """Add what the B numbers do to accelerations at a state, at fixed coordinates and velocities.

    Constant:
      model: the compiled scene. ints: of the packed scene.
      shifted (B, 2, L), apart (B,): as of `follow`.
      history, k, w: the history of steps, the state, and the step whose segment and modes hold there.
      z (n,): virtual displacement of the balance there.
    In and out:
      member_state (3, columns): state of the members; modes and sets become those of the step.
    Out:
      out (M_padded + P + B,): added to at its end. workspace: workspace of a balance, overwritten.
    """
    n = z.shape[0]
    a = np.empty(n)
    f = np.empty(n)
    slope = np.empty(n)
    segment = history.index[w, SEGMENT]
    restore_modes(history, history.index[w, EVENTS], member_state)
    q, v = history.q[k].copy(), history.v[k].copy()
    solve_accelerations(
        model, member_state, segment, history.t[k], q, v, np.bool_(False), workspace, a, np.empty(model.size[0])
    )
    numbers = shifted.shape[0]
    for b in range(numbers):
        balance_slope(
            unpack_general(ints, shifted[b, 0]), unpack_general(ints, shifted[b, 1]), apart[b], segment, history.t[k],
            q, v, a, f, slope,
        )  # fmt: skip
        for d in range(n):
            out[out.shape[0] - numbers + b] -= z[d] * slope[d]
