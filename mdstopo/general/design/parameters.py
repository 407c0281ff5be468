"""Derivatives by the laws' own parameters and by members' ends: what they add to the balance, at events, and where a
law begins or ends.

A parameter p of a law with force s f(Delta, dDelta/dt, t; p), s = alpha^mu, stands in the balance as

    d(M a + Phi_q^T lam - F)/dp = sum B^T s f_p,

so it is differentiated as s is, with s f_p in place of f (an inerter's f_p is d2Delta/dt2, a free length's -f_Delta).
Energy adds s V_p. Where an end of a member moves in its body, Delta, dDelta/dt and B change at a fixed motion, so that

    f_p = f_Delta Delta_p + f_d(dDelta/dt)_p,    d(B^T s f)/dp = s (B^T f_p + B_p^T f),    V_p = V_Delta Delta_p,

and where the free length is the length at the start, Delta_p = L_p - l0_p.

Where a member switches at a margin m(Delta, dDelta/dt; p) = 0, the time of the event varies by -m_p dp/m' besides
(`events`), with the saltation dv+ = (a- - a+) dt_e that follows from it.

A law that begins to act at tau (`active_from`) is a jump of the right side of the motion at a time that is given. Shift
tau by dtau: before it the motion is as it was, during dtau it goes on without the law, so behind it

    dv+ = (a_without - a_with) dtau,    dq+ = 0,    d(integral of g) = (g_without - g_with) dtau,

and a peak that stands at tau itself moves along the motion on its own side: dG = dg/dt dtau. Where it ceases
(`active_until`), with and without change places. Both accelerations are those of the balance at one state; joints and
inerters are in it. A pulse is smooth: its time is a parameter as any other.

With tau exactly at the start (at the end) it can move to one side only: that side's derivative is taken.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.general.dynamics.accelerations import make_workspace, solve_accelerations
from mdstopo.general.dynamics.members import MODE, SCALE, SET, level_of, rate_of_row
from mdstopo.general.model.general_model import (
    ALONG_FREE_LENGTH,
    CODE,
    DESIGN,
    GROUP,
    INERTER,
    MEMBER_FREE_LENGTH,
    OFFSET,
    PAIR,
    SECOND_END,
    START,
    VARIED_BLOCK,
    VARIED_END,
    VARIED_FIRST,
    VARIED_PLACE,
    VARIED_STOP,
    VARIED_VALUE,
)
from mdstopo.general.model.strides import pair_freedoms, place_in_pair
from mdstopo.general.responses.general_responses import value_at
from mdstopo.general.steps.step_history import EVENTS, GIVEN, MEMBER, OLD, SEGMENT, SET_BEFORE, STATE, restore_modes
from mdstopo.mechanics.kinematics.kinematics_interface import end_slopes, inerter_row, member_rows
from mdstopo.mechanics.laws.law_table import (
    ACTIVE_FROM,
    ACTIVE_UNTIL,
    FREE_LENGTH,
    law,
    law_has_pieces,
    law_margin_by_time,
    law_margin_slope,
    law_margin_slopes,
    law_slopes,
)


@part
def varies_member(model, e, i):
    """Whether entry e of `varied` is about member i (padded)."""
    return i >= model.varied[e, VARIED_FIRST] and i < model.varied[e, VARIED_STOP]


@part
def moved_side(model, e):
    """Which end of its members entry e of `varied` moves: 0 on the pair's first body, 1 on its second."""
    return 1 if model.varied[e, VARIED_PLACE] == SECOND_END else 0


@kernel
def parameter_slopes(model, e, i, segment, t, member_state, q, v, a, row, row_rate, moved):
    """Derivatives of the force and energy of one member, at unit strength, by entry e of `varied`.

    Constant:
      model: the compiled scene.
      e, i: the entry, and the member (padded).
    In:
      segment: number of the stretch of time between two breakpoints.
      t: time (s).
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    Out:
      row (2 D,): slopes dDelta/dq by the coordinates of the two bodies (m/m, m/rad).
      row_rate (2 D,): their rates in time; of inerters untouched.
      moved (2 D,): the force times the derivative of row; zero but where an end moves.

    Returns df/dp and dV/dp (N and J per unit of the parameter).
    """
    k = model.varied[e, VARIED_BLOCK]
    place = model.varied[e, VARIED_PLACE]
    if place < 0:
        return end_forces(model, e, i, segment, t, member_state, q, v, a, row, row_rate, moved)
    moved[:] = 0.0
    if model.block[k, CODE] == INERTER:
        return inerter_second_rate(model, k, i, q, v, a, row), 0.0
    x, rate = member_rows(model, model.block[k, PAIR], i, q, v, row, row_rate)
    x -= member_state[SET, i]
    level = level_of(model, segment, k, t)
    return law_slopes(
        model.block[k, CODE], model.law[k], place, x, rate, int(member_state[MODE, i]), t, level, model.curves,
        model.member[MEMBER_FREE_LENGTH, i],
    )  # fmt: skip


@kernel
def inerter_second_rate(model, k, i, q, v, a, row):
    """d2Delta/dt2 of an inerter (m/s^2).

    Constant:
      model: the compiled scene.
      k, i: the block, and the member (padded).
    In:
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    Out:
      row (2 D,): its B.
    """
    p = model.block[k, PAIR]
    bias = np.empty(1)
    inerter_row(model, q, v, i, p, row, bias)
    value = bias[0]
    for r in range(pair_freedoms(model)):
        value += row[r] * a[place_in_pair(model, p, r)]
    return value


@kernel
def end_forces(model, e, i, segment, t, member_state, q, v, a, row, row_rate, moved):
    """`parameter_slopes` where an entry is an end of the member that moves.

    Constant:
      model: the compiled scene.
      e, i: the entry, and the member (padded).
    In:
      segment: number of the stretch of time between two breakpoints.
      t: time (s).
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    Out:
      row, row_rate (2 D,): as there.
      moved (2 D,): the force times the derivative of row.
    """
    k = model.varied[e, VARIED_BLOCK]
    side = moved_side(model, e)
    p = model.block[k, PAIR]
    by_length, by_rate, by_second, second = end_slopes(model, p, i, side, model.along[e], q, v, a, moved)
    if model.block[k, CODE] == INERTER:
        inerter_second_rate(model, k, i, q, v, a, row)
        for r in range(moved.shape[0]):
            moved[r] *= model.law[k, 0] * second
        return model.law[k, 0] * by_second, 0.0
    x, rate = member_rows(model, p, i, q, v, row, row_rate)
    x -= member_state[SET, i]
    level = level_of(model, segment, k, t)
    code = model.block[k, CODE]
    mode = int(member_state[MODE, i])
    rest = model.member[MEMBER_FREE_LENGTH, i]
    f, f_x, f_rate, _, pull = law(code, model.law[k], x, rate, mode, t, level, model.curves, rest)
    by_force = f_x * by_length + f_rate * by_rate
    by_energy = pull * by_length
    grows = model.along[e, ALONG_FREE_LENGTH]
    if grows != 0.0:
        by_rest, energy_by_rest = law_slopes(
            code, model.law[k], FREE_LENGTH, x, rate, mode, t, level, model.curves, rest
        )
        by_force += grows * by_rest
        by_energy += grows * energy_by_rest
    for r in range(moved.shape[0]):
        moved[r] *= f
    return by_force, by_energy


@kernel
def add_parameters(model, segment, t, member_state, q, v, a, z, weight, out):
    """Add s (weight dV/dp - df/dp (B . z)) of all members to the derivatives by the laws' parameters p, at one state.

    Constant:
      model: the compiled scene.
    In:
      segment: number of the stretch of time between two breakpoints.
      t: time (s).
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      z (n,): virtual displacements at this state.
      weight: factor of the stored energy, that of design members.
    Out:
      out (M_padded + P,): added to behind the members.
    """
    row = np.empty(pair_freedoms(model))
    row_rate = np.empty(pair_freedoms(model))
    moved = np.empty(pair_freedoms(model))
    members = model.member.shape[1]
    for e in range(model.varied.shape[0]):
        k = model.varied[e, VARIED_BLOCK]
        if model.varied[e, VARIED_PLACE] > FREE_LENGTH or model.active[segment, k] == 0:
            continue
        own = weight if model.block[k, DESIGN] >= 0 else 0.0
        total = 0.0
        for i in range(model.varied[e, VARIED_FIRST], model.varied[e, VARIED_STOP]):
            by_force, by_energy = parameter_slopes(model, e, i, segment, t, member_state, q, v, a, row, row_rate, moved)
            pulled = rate_of_row(model, model.block[k, PAIR], row, z)
            total += member_state[SCALE, i] * (own * by_energy - by_force * pulled)
            if model.varied[e, VARIED_PLACE] < 0:
                total -= member_state[SCALE, i] * rate_of_row(model, model.block[k, PAIR], moved, z)
        out[members + model.varied[e, VARIED_VALUE]] += total


@kernel
def add_force_parameters(model, segment, group, who, t, member_state, q, v, a, scale, out):
    """Add the derivatives, at fixed motion, of the force of one member by the parameters of its laws.

    Constant:
      model: the compiled scene.
    In:
      segment: number of the stretch of time between two breakpoints.
      group, who: the group, and the number of the member in it.
      t: time (s).
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      scale: factor of the derivatives of f*.
    Out:
      out (M_padded + P,): added to behind the members.
    """
    row = np.empty(pair_freedoms(model))
    row_rate = np.empty(pair_freedoms(model))
    moved = np.empty(pair_freedoms(model))
    members = model.member.shape[1]
    for e in range(model.varied.shape[0]):
        k = model.varied[e, VARIED_BLOCK]
        i = who - model.block[k, OFFSET] + model.block[k, START]
        late = model.varied[e, VARIED_PLACE] > FREE_LENGTH
        if late or model.active[segment, k] == 0 or model.block[k, GROUP] != group:
            continue
        if varies_member(model, e, i):
            slope, _ = parameter_slopes(model, e, i, segment, t, member_state, q, v, a, row, row_rate, moved)
            out[members + model.varied[e, VARIED_VALUE]] += scale * member_state[SCALE, i] * slope


@kernel
def event_slope(model, history, member_state, event, e):
    """Derivative of the time of an event by the parameter of entry e of `varied`: dt_e/dp = -m_p/m' with the margin
    m (s per unit of p).

    0 where the parameter is not in the margin m of the member that switched, or where the time is given. The modes
    in member_state are perhaps changed to those just before the event.
    """
    k = model.varied[e, VARIED_BLOCK]
    place = model.varied[e, VARIED_PLACE]
    state = history.event[event, STATE]
    who = history.event[event, MEMBER]
    given = state == 0 or history.event[event, GIVEN] != 0
    if place > FREE_LENGTH or given or not varies_member(model, e, who) or law_has_pieces(model.block[k, CODE]):
        return 0.0
    segment = history.index[state - 1, SEGMENT]
    q = history.q[state]
    v = history.v[state]
    row = np.empty(pair_freedoms(model))
    row_rate = np.empty(pair_freedoms(model))
    x, rate = member_rows(model, model.block[k, PAIR], who, q, v, row, row_rate)
    x -= history.kept[event, SET_BEFORE]
    code = model.block[k, CODE]
    mode = int(history.event[event, OLD])
    t = history.t[state]
    rest = model.member[MEMBER_FREE_LENGTH, who]
    by_time = law_margin_by_time(code, model.law[k], x, rate, mode, t, model.curves, rest)
    by_x, by_rate = law_margin_slopes(code, model.law[k], x, rate, mode, t, model.curves, rest)
    if place < 0:
        by_p = _margin_by_end(model, e, who, q, v, x, rate, mode, t)
    else:
        by_p = law_margin_slope(code, model.law[k], place, x, rate, mode, t, model.curves, rest)
    if by_p == 0.0:
        return 0.0
    speed = by_x * rate + by_time
    if by_rate != 0.0:
        a = np.empty(model.mass.shape[0])
        lam = np.empty(model.size[0])
        restore_modes(history, event, member_state)
        workspace = make_workspace(model)
        solve_accelerations(
            model, member_state, segment, history.t[state], q.copy(), v.copy(), np.bool_(False), workspace, a, lam
        )
        for r in range(pair_freedoms(model)):
            d = place_in_pair(model, model.block[k, PAIR], r)
            speed += by_rate * (row[r] * a[d] + row_rate[r] * v[d])
    return -by_p / speed if speed != 0.0 else 0.0


@kernel
def _margin_by_end(model, e, i, q, v, x, rate, mode, t):
    """Derivative of the margin of member i by entry e of `varied`, an end that moves (m, or m/s, per m).

    Constant:
      model: the compiled scene.
    In:
      q (n_q,), v (n,): coordinates and velocities.
      x, rate: elongation, less the permanent set (m), and its rate (m/s).
      mode, t: the member's mode, and time (s).
    """
    k = model.varied[e, VARIED_BLOCK]
    side = moved_side(model, e)
    code = model.block[k, CODE]
    rest = model.member[MEMBER_FREE_LENGTH, i]
    spare = np.empty(pair_freedoms(model))
    length_by_end, rate_by_end, _, _ = end_slopes(model, model.block[k, PAIR], i, side, model.along[e], q, v, v, spare)
    by_x, by_rate = law_margin_slopes(code, model.law[k], x, rate, mode, t, model.curves, rest)
    by_rest = law_margin_slope(code, model.law[k], FREE_LENGTH, x, rate, mode, t, model.curves, rest)
    return by_x * length_by_end + by_rate * rate_by_end + model.along[e, ALONG_FREE_LENGTH] * by_rest


@kernel
def add_event(model, history, member_state, event, factor, out):
    """Add what the laws' parameters do to a value by shifting the time of an event.

    Constant:
      model: the compiled scene.
      history: the history of steps (`StepHistory`).
    In:
      event: number of the event.
      factor: derivative of the value by the time of the event (per s).
    In place:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
        The modes are perhaps changed to those just before the event.
    Out:
      out (M_padded + P,): factor dt_e/dp is added behind the members.
    """
    if factor == 0.0:
        return
    for e in range(model.varied.shape[0]):
        out[model.member.shape[1] + model.varied[e, VARIED_VALUE]] += factor * event_slope(
            model, history, member_state, event, e
        )


@kernel
def begins_or_ends(model, history, count, state, e):
    """Whether the law of entry e of `varied` begins (1) or ceases (-1) to act at a state; else 0.

    count is the number of steps: the number of the last state.
    """
    place = model.varied[e, VARIED_PLACE]
    if place < ACTIVE_FROM:
        return 0
    k = model.varied[e, VARIED_BLOCK]
    edge = model.varied[e, VARIED_END] != 0
    before = edge and state == count
    after = edge and state == 0
    if state > 0:
        before = model.active[history.index[state - 1, SEGMENT], k] != 0 and (before or state < count)
    if state < count:
        after = model.active[history.index[state, SEGMENT], k] != 0 and (after or state > 0)
    if place == ACTIVE_FROM and after and not before:
        return 1
    if place == ACTIVE_UNTIL and before and not after:
        return -1
    return 0


@kernel
def time_jump(model, history, member_state, count, state, e, j, square, dv):
    """The jump of the derivatives at one state by the time of entry e of `varied`, at which laws begin or end to
    act.

    Entries with the same value are shifted together: the first of them stands for all.

    Constant:
      model: the compiled scene.
        Its `active` is changed on the way and then as before.
      history: the history of steps (`StepHistory`).
      count: number of steps.
    In:
      state: number of the state.
      e: entry of `varied`, of a law's begin or end.
      j: a response whose integral is differentiated; -1: none.
      square: whether the integral is that of the response's square.
    In place:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
        The modes are perhaps changed to those of the step in which the laws act.
    Out:
      dv (n,): derivative of the velocities behind the state by that time (m/s^2, rad/s^2); 0 where it does nothing.

    Returns whether it does anything, and the derivative of the integral by that time (0 without one).
    """
    dv[:] = 0.0
    which = model.varied[e, VARIED_VALUE]
    if e > 0 and model.varied[e - 1, VARIED_VALUE] == which:
        return False, 0.0
    shifted = np.zeros(model.varied.shape[0], np.int64)
    way = 0
    for other in range(e, model.varied.shape[0]):
        if model.varied[other, VARIED_VALUE] == which:
            shifted[other] = begins_or_ends(model, history, count, state, other)
            way = shifted[other] if shifted[other] != 0 else way
    if way == 0:
        return False, 0.0
    step = state if way > 0 else state - 1
    segment = history.index[step, SEGMENT]
    restore_modes(history, history.index[step, EVENTS], member_state)
    workspace = make_workspace(model)
    a = np.empty(dv.shape[0])
    lam = np.empty(model.size[0])
    drop = 0.0
    for side in range(2):  # with the laws, then without them
        sign = -way if side == 0 else way
        for other in range(e, model.varied.shape[0]):
            if shifted[other] != 0:
                model.active[segment, model.varied[other, VARIED_BLOCK]] = 1 - side
        solve_accelerations(
            model, member_state, segment, history.t[state], history.q[state].copy(),
            history.v[state].copy(), np.bool_(False), workspace, a, lam,
        )  # fmt: skip
        for d in range(dv.shape[0]):
            if model.free[d] != 0:
                dv[d] += sign * a[d]
        if j >= 0:
            value = value_at(
                model, member_state, segment, history.t[state], history.q[state], history.v[state], j, workspace
            )
            drop += sign * (value * value if square else value)
    for other in range(e, model.varied.shape[0]):
        if shifted[other] != 0:
            model.active[segment, model.varied[other, VARIED_BLOCK]] = 1
    return True, drop


@kernel
def add_times(model, history, member_state, count, state, j, square, lam_v, rate, out):
    """Add the derivatives, at one state, by times at which laws begin or end to act.

    Constant:
      model: the compiled scene.
      history: the history of steps (`StepHistory`).
      count: number of steps.
    In:
      state: number of the state.
      j: a response whose integral is differentiated; -1: none.
      square: whether the integral is that of the response's square.
      lam_v (n,): cotangents of the velocities behind the state.
      rate: rate in time of a peak that stands at the state, and moves with the time (per s); 0 for none.
    In place:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
        The modes are perhaps changed to those of the steps beside the state.
    Out:
      out (M_padded + P,): added to behind the members.
    """
    dv = np.empty(lam_v.shape[0])
    for e in range(model.varied.shape[0]):
        if model.varied[e, VARIED_PLACE] < ACTIVE_FROM:
            continue
        does, drop = time_jump(model, history, member_state, count, state, e, j, square, dv)
        if not does:
            continue
        total = drop
        if state > 0 and state < count:
            total += rate
        for d in range(dv.shape[0]):
            total += lam_v[d] * dv[d]
        out[model.member.shape[1] + model.varied[e, VARIED_VALUE]] += total
