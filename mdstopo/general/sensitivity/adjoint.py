"""The exact gradient of a discretised objective of a general scene: one reverse sweep over steps, joints and events.

A row of `extremes` (or an integral over all stages) has slopes by states, accelerations and multipliers: the first
cotangents. Those of accelerations and multipliers go through the transposed balance and leave a virtual displacement z;
so does every stage of every step on the way back. Then dG/dalpha_i = dg/dalpha_i - mu alpha_i^(mu-1) sum f_i (b_i .
T z). An event on the way changes the cotangents by saltation (`events`); a peak at an event is not stationary and adds
(dg/dt) dt_e/dalpha; an integral of what jumps there adds (g- - g+) dt_e/dalpha.
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.design.across_knots import add_across_knots, add_energies_across_knots
from mdstopo.general.design.gather import add_design, add_designs, explicit_part, force_sign
from mdstopo.general.design.parameters import add_event, add_times, event_slope
from mdstopo.general.dynamics.accelerations import (
    NO_SHIFT,
    accelerations_vjp,
    factor_matrix,
    solve_accelerations,
    solve_unknowns,
)
from mdstopo.general.dynamics.forces import general_forces
from mdstopo.general.events.permanent_sets import (
    add_response_sets,
    add_sets,
    count_sets,
    keep_start,
    sets_back,
    time_back,
)
from mdstopo.general.model.general_model import KIND, MEMBER_FORCE, SUBJECT
from mdstopo.general.responses.extremes import FRACTION, RATE, STEP, WHO
from mdstopo.general.responses.general_responses import (
    across_rate,
    across_slopes,
    chosen_part,
    design_slopes,
    energy_weight,
    equal_forces,
    has_energy,
    has_forces,
    kinked,
    members_of,
    response,
    response_switches,
    value_at,
)
from mdstopo.general.steps.method_interface import point_of, step_back, weights_of
from mdstopo.general.steps.step_history import EVENTS, FIRST, PARENT, SEGMENT, STATE, copy_vector, restore_modes
from mdstopo.integrators.steps import FORCES
from mdstopo.mechanics.kinematics.kinematics_interface import difference, retract

#: at a stage where an integrand has a kink, its limit from inside the step is taken. Shares of its value at a stage
#: inside: a norm below NO_DIRECTION has none and is given that of a state KINK_OFFSET of the way to that stage; below
#: KINK_THRESHOLD a norm or an absolute value may have turned round since, and two forces may differ by that much where
#: one takes over from the other as the largest
NO_DIRECTION, KINK_OFFSET, KINK_THRESHOLD = 1e-6, 4e-6, 0.02


@kernel
def free_only(model, x):
    """Set the entries of driven coordinates in x (n,) to zero: no design changes these coordinates."""
    for i in range(model.driven.shape[0]):
        x[model.driven[i]] = 0.0


@kernel
def apply_saltation_transposed(model, history, state, lam_q, lam_v, bar_set, drops, member_state, out):
    """Pull cotangents behind the events of a state back to before them (saltation transposed), in place.

    Constant:
      model: the compiled scene.
      history, state: the history of steps, and the number of the state.
      drops (E,): by how much an integrand falls at each event (`event_drops`); no rows where no integral is meant.
    In and out:
      lam_q, lam_v (n,): cotangents of the state's coordinates and velocities.
      bar_set (slots,): those of the permanent sets (`permanent_sets`).
      member_state (3, columns): state of the members; modes are not what they were before the call.
    Out:
      out (M_padded + P,): what parameters do to the events' times and to the sets made there, added behind the members.
    """
    last = history.index[state, EVENTS]
    first = history.index[state - 1, EVENTS] if state > 0 else last
    for back in range(last - first):
        e = last - 1 - back
        if history.event[e, STATE] != state:
            continue
        pulled = 0.0
        for d in range(lam_v.shape[0]):
            pulled += lam_v[d] * history.saltation[e, 2, d]
        if model.varied.shape[0] > 0:
            add_event(model, history, member_state, e, pulled + (drops[e] if drops.shape[0] > 0 else 0.0), out)
        for d in range(lam_v.shape[0]):
            lam_q[d] -= pulled * history.saltation[e, 0, d]
            lam_v[d] -= pulled * history.saltation[e, 1, d]
        if drops.shape[0] > 0:
            for d in range(lam_v.shape[0]):
                lam_q[d] -= drops[e] * history.saltation[e, 0, d]
                lam_v[d] -= drops[e] * history.saltation[e, 1, d]
        if bar_set.shape[0] > 0:
            sets_back(model, history, e, bar_set, lam_q, out)
            time_back(model, history, e, pulled + (drops[e] if drops.shape[0] > 0 else 0.0), bar_set)
    free_only(model, lam_q)
    free_only(model, lam_v)


@kernel
def sweep(
    tag, model, tables, member_state, history, count, w, c, lam_q, lam_v, bar_set, bars, rows_bar, sets_bar, drops,
    integrated, square, workspace, virtual, out, work,
):  # fmt: skip
    """Pull cotangents at fraction c of step w back to the start, and add up the gradient at every stage.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      model: the compiled scene.
      history, count: the history of steps, and how many steps it has.
      w, c: the step to begin with, and the fraction of it at which the cotangents are given.
      bars (S, 3, n), rows_bar (S, n_row): explicit cotangents of q, v, a and of the multipliers of all stages; no rows
        where there are none.
      sets_bar (S, slots): explicit cotangents of the permanent sets at all stages.
      drops (E,): as `event_drops` returns them; no rows where no integral is meant.
      integrated, square: the response whose integral (or that of its square) is meant, -1 for none.
    In and out:
      lam_q, lam_v (n,): cotangents of coordinates and velocities; at the end those of the start.
      bar_set (slots,): cotangents of the permanent sets.
      member_state (3, columns): state of the members; modes and sets become those of the step in hand.
    Out:
      virtual (S, n): virtual displacements of the stages that are gone through; no rows: not wanted.
      out (M_padded + P,): the derivative by alpha^mu and, behind the members, by parameters, added to.
      workspace: workspace of a balance, overwritten.
      work (WORK,): counts of work, added to.
    """
    n = lam_q.shape[0]
    z = np.empty((1, 17, n))
    y = np.empty(model.size[0])
    lam_x = np.zeros((1, 2, n))
    fraction = np.empty(1)
    fraction[0] = c
    spread = bars.shape[0] > 0
    while w >= 0:
        o = history.index[w, FIRST]
        end = history.index[w + 1, FIRST]
        b = bars[o:end] if spread else bars
        r = rows_bar[o:end] if spread else rows_bar
        step_back(
            tag, model, tables, history, w, fraction, lam_q.reshape((1, n)), lam_v.reshape((1, n)), lam_x, b, r, z, y,
            workspace, work,
        )  # fmt: skip
        restore_modes(history, history.index[w, EVENTS], member_state)
        segment = history.index[w, SEGMENT]
        add_designs(model, segment, history, o, member_state, z[0, : end - o], out, work)
        add_across_knots(model, history, w, member_state, z, out.reshape((1, out.shape[0])))
        if virtual.shape[0] > 0:
            virtual[o:end] = z[0, : end - o]
        if bar_set.shape[0] > 0:
            for j in range(end - o):
                add_sets(
                    model, segment, member_state, history.stage_q[o + j], history.stage_v[o + j], z[0, j], 0.0, bar_set
                )
                if spread:
                    for i in range(bar_set.shape[0]):
                        bar_set[i] += sets_bar[o + j, i]
        fraction[0] = 1.0
        before = history.index[w, PARENT]
        if model.varied.shape[0] > 0:
            add_times(model, history, member_state, count, before + 1, integrated, square, lam_v, 0.0, out)
        if before >= 0:
            apply_saltation_transposed(model, history, before + 1, lam_q, lam_v, bar_set, drops, member_state, out)
        w = before


@kernel
def state_of_row(tag, model, tables, member_state, history, count, row, workspace, q, v, work):
    """The state at which a row of `extremes` is read.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      model: the compiled scene.
      count: how many steps there are.
      row (COLUMNS,): the row.
    In and out:
      history: the history of steps; a partial step is kept behind the others where the integrator needs one.
      member_state (3, columns): state of the members; modes and sets are put to those of the step.
    Out:
      q (n_q,), v (n,): coordinates and velocities.
      workspace: workspace of a balance, overwritten.
      work (WORK,): counts of work, added to.

    Returns the step that the state is an end of or in (-1: the start).
    """
    k = int(row[STEP])
    c = row[FRACTION]
    if c > 0.0 and c < 1.0:
        return point_of(tag, model, tables, member_state, history, count, k, c, np.bool_(True), workspace, q, v, work)
    copy_vector(history.q[k if c <= 0.0 else k + 1], q)
    copy_vector(history.v[k if c <= 0.0 else k + 1], v)
    return k - 1 if c <= 0.0 else k


@kernel
def row_cotangents(
    tag, model, tables, member_state, history, count, j, row, across, workspace, bars, bar_set, out, work
):
    """Cotangents of the state at which a row of `extremes` is read, and its derivatives by the design at that state.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      model: the compiled scene.
      count, j: how many steps there are; the response.
      row (COLUMNS,): the row.
      across: instead of the norm that g_j is (`general_responses.is_norm`), the component perpendicular to its vector
        is differentiated, the direction held.
    In and out:
      history: the history of steps; a partial step is kept behind the others where the integrator needs one.
      member_state (3, columns): state of the members; modes and sets become those of the step in hand.
    Out:
      bars (3, n): cotangents of q and v; its last row is overwritten.
      bar_set (slots,): cotangents of the permanent sets.
      out (M_padded + P,): derivative by alpha^mu and, behind the members, by parameters, at that state.
      workspace: workspace of a balance, overwritten.
      work (WORK,): counts of work, added to.

    Returns the step (-1: the start) and its fraction to which the cotangents belong.
    """
    n = model.mass.shape[0]
    n_row = model.size[0]
    q = np.empty(model.q0.shape[0])
    v = np.empty(n)
    a = np.empty(n)
    lam = np.empty(n_row)
    row_bar = np.empty(n_row)
    out[:] = 0.0
    k = int(row[STEP])
    c = row[FRACTION]
    segment = history.index[k, SEGMENT]
    w = state_of_row(tag, model, tables, member_state, history, count, row, workspace, q, v, work)
    t = history.t[k] + c * (history.t[k + 1] - history.t[k])
    restore_modes(history, history.index[k, EVENTS], member_state)
    rate = row[RATE]
    if across:
        at_end = c <= 0.0 or c >= 1.0  # a row inside a step needs no rate
        rate = across_rate(tag, model, member_state, history, k, c, j, t, q, v, workspace, a, lam) if at_end else 0.0
    solve_accelerations(model, member_state, segment, t, q, v, np.bool_(True), workspace, a, lam)
    work[FORCES] += 1
    who = int(row[WHO])
    if across:
        across_slopes(model, j, q, v, a, lam, bars, row_bar)
    else:
        response(model, member_state, segment, j, who, t, q, v, a, lam, workspace, bars, row_bar)
    slopes = design_slopes(model, member_state, segment, j, who, t, q, v, a, lam, workspace)
    weight = energy_weight(model, j, slopes)
    if bar_set.shape[0] > 0:
        bar_set[:] = 0.0
        add_response_sets(model, member_state, segment, j, who, slopes, t, q, v, a, bars, 1.0, bar_set)
    z = bars[2]
    factor_matrix(
        model,
        workspace,
        workspace.k,
        workspace.c,
        workspace.turn,
        workspace.mass,
        0.0,
        0.0,
        workspace.tangents[NO_SHIFT],
        np.bool_(True),
    )
    solve_unknowns(model, workspace, z, row_bar)
    accelerations_vjp(model, workspace, workspace.k, workspace.c, workspace.turn, z, row_bar, bars[0], bars[1])
    free_only(model, bars[0])
    free_only(model, bars[1])
    add_design(model, segment, t, member_state, q, v, a, z, weight, out, work)
    sign = force_sign(model, segment, j, who, t, member_state, q, v, a)
    explicit_part(model, segment, j, who, slopes, t, member_state, q, v, a, sign, out)
    if bar_set.shape[0] > 0:
        add_sets(model, segment, member_state, q, v, z, 0.0, bar_set)
    if c <= 0.0 or c >= 1.0:
        _add_times_of_row(model, history, member_state, count, k, c, rate, bars, bar_set, out)
    return w, (c if w == k else 1.0)


@kernel
def _add_times_of_row(model, history, member_state, count, k, c, rate, bars, bar_set, out):
    """What times that vary add where a row is read at the start or the end of a step, which may be one of them.

    In:
      model: the compiled scene.
      history, count: the history of steps, and how many steps there are.
      member_state (3, columns): state of the members.
      k, c: the step, and 0 or 1.
      rate: of the response there.
    In and out:
      bars (3, n): cotangents of q and v; those at the end of a step, or in front of the event at its start.
      bar_set (slots,): cotangents of the permanent sets, likewise.
      out (M_padded + P,): derivative by alpha^mu and by parameters.
    """
    at = k if c <= 0.0 else k + 1
    if model.varied.shape[0] > 0:
        # what lies behind the state does nothing to a value before it
        behind = bars[1] if c <= 0.0 or at == count else np.zeros(bars.shape[1])
        add_times(model, history, member_state, count, at, np.int64(-1), np.bool_(False), behind, rate, out)
    if c <= 0.0 and k > 0:
        apply_saltation_transposed(model, history, k, bars[0], bars[1], bar_set, np.empty(0), member_state, out)
    if (c <= 0.0 and k > 0) or c >= 1.0:
        event = _first_event(model, history, member_state, at)
        if event >= 0:
            if model.varied.shape[0] > 0:
                add_event(model, history, member_state, event, rate, out)
            for d in range(bars.shape[1]):
                bars[0, d] -= rate * history.saltation[event, 0, d]
                bars[1, d] -= rate * history.saltation[event, 1, d]
            if bar_set.shape[0] > 0:
                time_back(model, history, event, rate, bar_set)


@kernel
def _first_event(model, history, member_state, state):
    """The first event of a state whose time varies, or -1."""
    if state == 0:
        return -1
    for e in range(history.index[state - 1, EVENTS], history.index[state, EVENTS]):
        if history.event[e, STATE] != state:
            continue
        for part in range(2):
            for d in range(history.saltation.shape[2]):
                if history.saltation[e, part, d] != 0.0:
                    return e
        for entry in range(model.varied.shape[0]):
            if event_slope(model, history, member_state, e, entry) != 0.0:
                return e
    return -1


@kernel
def integral_gradient(
    tag, model, tables, member_state, history, count, j, square, gradient, workspace, start, out, work
):
    """The integral over time of g_j (or of its square), and on demand its derivative by alpha^mu.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      model: the compiled scene.
      history, count: the history of steps, and how many steps it has.
      j, square: the response; whether its square is integrated.
      gradient: whether the derivative is asked for.
    In and out:
      member_state (3, columns): state of the members; modes and sets become those of the step in hand.
    Out:
      out (M_padded + P,): the derivative, behind the members by parameters.
      start (n,), or no length: cotangents of the start's positions.
      workspace: workspace of a balance, overwritten.
      work (WORK,): counts of work, added to.

    Returns the integral ([g] s, or [g]^2 s).
    """
    n = model.mass.shape[0]
    stages = history.index[count, FIRST] if gradient else 0
    bars = np.zeros((stages, 3, n))
    rows_bar = np.zeros((stages, model.size[0]))
    sets_bar = np.zeros((stages, count_sets(model)))
    total = integral_cotangents(
        tag, model, tables, member_state, history, count, j, square, bars, rows_bar, sets_bar, np.empty(0), workspace,
        out, work,
    )  # fmt: skip
    if gradient:
        lam_q = np.zeros(n)
        lam_v = np.zeros(n)
        drops = event_drops(model, member_state, history, count, j, square, workspace)
        if model.varied.shape[0] > 0:
            add_times(model, history, member_state, count, count, j, square, lam_v, 0.0, out)
        bar_set = np.zeros(sets_bar.shape[1])
        sweep(
            tag, model, tables, member_state, history, count, count - 1, 1.0, lam_q, lam_v, bar_set, bars, rows_bar,
            sets_bar, drops, j, square, workspace, np.empty((0, n)), out, work,
        )  # fmt: skip
        keep_start(model, history, lam_q, lam_v, bar_set, start, out)
    return total


@kernel
def event_drops(model, member_state, history, count, j, square, workspace):
    """(E,) by how much g_j (or its square) falls at each event: the slope of an integral by the event's time.

    Constant:
      model: the compiled scene.
      history, count: the history of steps, and how many steps it has.
      j, square: the response; whether its square is meant.
    In and out:
      member_state (3, columns): state of the members; modes and sets become those of the step in hand.
      workspace: workspace of a balance, overwritten.
    """
    events = history.index[count, EVENTS]
    drops = np.zeros(events)
    values = np.empty(2)
    for e in range(events):
        state = history.event[e, STATE]
        if state <= 0 or state >= count:
            continue
        for side in range(2):
            restore_modes(history, e + side, member_state)
            values[side] = value_at(
                model,
                member_state,
                history.index[state - 1, SEGMENT],
                history.t[state],
                history.q[state],
                history.v[state],
                j,
                workspace,
            )
        if square:
            values *= values
        drops[e] = values[0] - values[1]
    return drops


@kernel
def at_stage(model, member_state, segment, history, at, j, who, workspace, own, own_rows):
    """g_j at a stage, and its slopes.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      segment: segment of `model.times` in which the stage lies.
      history, at: the history of steps, and the number of the stage.
      j, who: the response; the member whose force is meant, where it is one of members, below 0 the largest.
    Out:
      own (3, n), own_rows (n_row,): slopes by q, v, a and by the multipliers.
      workspace: workspace of a balance, overwritten.

    Returns g_j, and the member.
    """
    q = history.stage_q[at]
    v = history.stage_v[at]
    a = history.stage_a[at]
    t = history.when[at]
    if has_energy(model, j):
        general_forces(model, member_state, segment, t, q, v, np.bool_(False), workspace)
    who = chosen_part(model, member_state, segment, j, who, t, q, v, a, history.lam[at], workspace)
    value = response(model, member_state, segment, j, who, t, q, v, a, history.lam[at], workspace, own, own_rows)
    return value, who


@kernel
def sides_inside(model, member_state, segment, history, o, stages, j, workspace):
    """The bits that say on which sides the switches of expression j are inside a step.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      segment: segment of `model.times` in which the step lies.
      history: the history of steps.
      o, stages: number of the step's first stage, and how many it has; of two the first is where the step begins, and
        one that has its end alone begins where the last one ended.
      j: the response, an expression with switches.
    Out:
      workspace: workspace of a balance, overwritten.
    """
    if stages > 2:
        at = o + (stages - 1) // 2
        q, v, a, t = history.stage_q[at].copy(), history.stage_v[at], history.stage_a[at], history.when[at]
        lam = history.lam[at]
    else:
        last = o + stages - 1
        first = max(last - 1, 0)
        way = np.empty(model.mass.shape[0])
        q = np.empty(model.q0.shape[0])
        difference(model, history.stage_q[last], history.stage_q[first], way)
        for d in range(way.shape[0]):
            way[d] *= 0.5
        retract(model, history.stage_q[first], way, q)
        v = _midway(history.stage_v, first, last)
        a = _midway(history.stage_a, first, last)
        t = 0.5 * (history.when[first] + history.when[last])
        lam = _midway(history.lam, first, last)
    if has_energy(model, j):
        general_forces(model, member_state, segment, t, q, v, np.bool_(False), workspace)
    return chosen_part(model, member_state, segment, j, np.int64(-1), t, q, v, a, lam, workspace)


@kernel
def _midway(rows, first, last):
    """The mean of two rows."""
    mean = np.empty(rows.shape[1])
    for d in range(mean.shape[0]):
        mean[d] = 0.5 * (rows[first, d] + rows[last, d])
    return mean


@kernel
def sign_at_stage(model, segment, j, who, member_state, history, at):
    """`gather.force_sign` at a stage.

    model: the compiled scene.
    segment: segment of `model.times` in which the stage lies.
    j, who: the response, and the number of the member in its group.
    member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
    history, at: the history of steps, and the number of the stage.
    """
    return force_sign(
        model, segment, j, who, history.when[at], member_state, history.stage_q[at], history.stage_v[at],
        history.stage_a[at],
    )  # fmt: skip


@kernel
def one_sided_limit(
    model, member_state, segment, history, at, inside, j, who, value, mine, size, slopes, rows, workspace, own, own_rows
):
    """g_j and its slopes at the end of a step, as limits from inside the step, where g_j has a kink at that end.

    An absolute value or a norm that all but vanishes at the stage may have turned round there, and the largest force
    may be another's, by what the stage is off by; then the integrand is followed as the smooth function that it is
    inside.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      segment: segment of `model.times` in which the step lies.
      history, at, inside: the history of steps, the number of the stage, and of one inside the step.
      j, who, value: the response; at the stage its member and its value.
      mine, size, slopes (3, n), rows (n_row,): of the stage inside its member, its value, and its slopes by q, v, a and
        by the multipliers.
    In and out:
      own (3, n), own_rows (n_row,): the slopes at the stage.
      workspace: workspace of a balance, overwritten.

    Returns the value, whose force it is, and whether it has turned round.
    """
    same = np.bool_(False)
    n = model.mass.shape[0]
    if mine != who:  # nearly as large as the largest here: it is the largest inside
        others = np.empty((3, n))
        others_rows = np.empty(model.size[0])
        other, _ = at_stage(model, member_state, segment, history, at, j, mine, workspace, others, others_rows)
        if other < (1.0 - KINK_THRESHOLD) * value:
            return value, who, same
        own[:] = others
        own_rows[:] = others_rows
        value = other
        who = mine
    if value > KINK_THRESHOLD * size:
        return value, who, same
    if model.response[j, KIND] == MEMBER_FORCE:
        here = sign_at_stage(model, segment, j, who, member_state, history, at)
        if here == sign_at_stage(model, segment, j, who, member_state, history, inside):
            return value, who, same
        _turn(own, own_rows)
        return -value, who, np.bool_(True)
    if value <= NO_DIRECTION * size:  # no direction of its own: that of a state a little inside
        q = np.empty(model.q0.shape[0])
        v = np.empty(n)
        a = np.empty(n)
        lam = np.empty(model.size[0])
        way = np.empty(n)
        difference(model, history.stage_q[inside], history.stage_q[at], way)
        for d in range(n):
            way[d] *= KINK_OFFSET
            v[d] = history.stage_v[at, d] + KINK_OFFSET * (history.stage_v[inside, d] - history.stage_v[at, d])
            a[d] = history.stage_a[at, d] + KINK_OFFSET * (history.stage_a[inside, d] - history.stage_a[at, d])
        retract(model, history.stage_q[at], way, q)
        for r in range(model.size[0]):
            lam[r] = history.lam[at, r] + KINK_OFFSET * (history.lam[inside, r] - history.lam[at, r])
        t = history.when[at]
        response(model, member_state, segment, j, who, t, q, v, a, lam, workspace, own, own_rows)
        return value, who, same
    turned = 0.0
    for i in range(slopes.shape[0]):
        for d in range(n):
            turned += own[i, d] * slopes[i, d]
    for r in range(model.size[0]):
        turned += own_rows[r] * rows[r]
    if turned >= 0.0:
        return value, who, same
    _turn(own, own_rows)
    return -value, who, np.bool_(True)


@kernel
def _turn(slopes, rows):
    """Change the sign of slopes (3, n) and rows (n_row,), in place."""
    for i in range(slopes.shape[0]):
        for d in range(slopes.shape[1]):
            slopes[i, d] = -slopes[i, d]
    for r in range(rows.shape[0]):
        rows[r] = -rows[r]


@kernel
def integral_cotangents(
    tag, model, tables, member_state, history, count, j, square, bars, rows_bar, sets_bar, energies, workspace, out,
    work,
):  # fmt: skip
    """The integral over time of g_j (or of its square) by the weights of the stages, and its cotangents of all stages.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      model: the compiled scene.
      history, count: the history of steps, and how many steps it has.
      j, square: the response; whether its square is integrated.
    In and out:
      member_state (3, columns): state of the members; modes and sets become those of the step in hand.
    Out; no derivative is formed where bars has no rows:
      bars (S, 3, n), rows_bar (S, n_row), sets_bar (S, slots): cotangents of the stages' q, v, a, of their multipliers
        and of the permanent sets; zeros before the call.
      energies (S,): the derivatives by the energy that is stored at each stage; no length: not wanted.
      out (M_padded + P,): the explicit derivative by alpha^mu and by parameters.
      workspace: workspace of a balance, overwritten.
      work (WORK,): counts of work, added to.

    Returns the integral ([g] s, or [g]^2 s).
    """
    n = model.mass.shape[0]
    n_row = model.size[0]
    gradient = bars.shape[0] > 0
    own = np.zeros((3, n))
    own_rows = np.zeros(n_row)
    weight = np.zeros(17)
    of_energy = np.zeros(17)
    total = 0.0
    out[:] = 0.0
    none = np.zeros(n)
    of_parts = np.zeros(0)
    kind = model.response[j, KIND]
    designed = has_energy(model, j) or has_forces(model, j)
    bends = kinked(model, j)
    switches = response_switches(model, j)
    slopes = np.zeros((3, n))
    rows = np.zeros(n_row)
    mine = np.int64(-1)
    size = 0.0
    tied = np.empty(members_of(model, model.response[j, SUBJECT]) if kind == MEMBER_FORCE else 1, np.int64)
    ties = 1
    for w in range(count):
        restore_modes(history, history.index[w, EVENTS], member_state)
        segment = history.index[w, SEGMENT]
        weights_of(tag, model, tables, history, w, weight)
        o = history.index[w, FIRST]
        stages = history.index[w + 1, FIRST] - o
        # of two stages the first is where the step begins; one that has its end alone begins where the last one ended
        inside = o + (stages - 1) // 2 if stages > 1 else o - 1
        if switches:  # the step ends where one changes: all stages are on the sides of its inside
            mine = sides_inside(model, member_state, segment, history, o, stages, j, workspace)
        if bends:
            asked = mine if switches else np.int64(-1)
            size, mine = at_stage(model, member_state, segment, history, inside, j, asked, workspace, slopes, rows)
            if gradient and kind == MEMBER_FORCE:
                ties = equal_forces(
                    model,
                    member_state,
                    segment,
                    history.when[inside],
                    model.response[j, SUBJECT],
                    history.stage_q[inside],
                    history.stage_v[inside],
                    history.stage_a[inside],
                    size,
                    tied,
                )
        of_energy[:] = 0.0
        for i in range(stages):
            if weight[i] == 0.0:
                continue
            q = history.stage_q[o + i]
            v = history.stage_v[o + i]
            a = history.stage_a[o + i]
            t = history.when[o + i]
            asked = mine if switches else np.int64(-1)
            value, who = at_stage(model, member_state, segment, history, o + i, j, asked, workspace, own, own_rows)
            turned = np.bool_(False)
            if bends and o + i != inside:
                value, who, turned = one_sided_limit(
                    model, member_state, segment, history, o + i, inside, j, who, value, mine, size, slopes, rows,
                    workspace, own, own_rows,
                )  # fmt: skip
            factor = weight[i] * (2.0 * value if square else 1.0)
            total += weight[i] * (value * value if square else value)
            if not gradient:
                continue
            if designed:
                of_parts = design_slopes(
                    model, member_state, segment, j, who, t, q, v, a, history.lam[o + i], workspace
                )  # fmt: skip
                for m in range(of_parts.shape[0]):
                    of_parts[m] = -of_parts[m] if turned else of_parts[m]
                weighed = energy_weight(model, j, of_parts)
                if weighed != 0.0:
                    add_design(model, segment, t, member_state, q, v, a, none, factor * weighed, out, work)
                    of_energy[i] = factor * weighed
                    if energies.shape[0] > 0:
                        energies[o + i] = factor * weighed
            shares = ties if who == mine and ties > 1 else 1
            factor /= shares
            bars[o + i] = 0.0
            for m in range(shares):
                if shares > 1:
                    who = tied[m]
                    at_stage(model, member_state, segment, history, o + i, j, who, workspace, own, own_rows)
                    if turned:
                        _turn(own, own_rows)
                for part in range(own.shape[0]):
                    for d in range(n):
                        bars[o + i, part, d] += factor * own[part, d]
                for r in range(n_row):
                    rows_bar[o + i, r] = factor * own_rows[r]
                sign = force_sign(model, segment, j, who, t, member_state, q, v, a)
                if turned and kind == MEMBER_FORCE:
                    sign = -sign
                explicit_part(model, segment, j, who, of_parts, t, member_state, q, v, a, factor * sign, out)
                if sets_bar.shape[1] > 0:
                    add_response_sets(
                        model, member_state, segment, j, who, of_parts, t, q, v, a, own, factor, sets_bar[o + i]
                    )  # fmt: skip
        if of_energy.any():
            add_energies_across_knots(model, history, w, member_state, of_energy[:stages], out)
    return total
