"""Generalized-alpha steps of a general scene, fixed, with joints and events (Arnold and Bruels' form).

    (1 - alpha_m) x' + alpha_m x = (1 - alpha_f) a' + alpha_f a
    q* = q + h v + h^2 ((1/2 - beta) x + beta x'),  v* = v + h ((1 - gamma) x + gamma x'),  a' = a(q*, v*, t')

as in `integrators.springs_generalized_alpha`, with a(q, v, t) from the balance with its joints: accelerations and
multipliers are of second order like the motion. Then q*, v* are moved onto the joints (`projection`) by what they are
off, which is of third order: no drift, and no transient at the start, because x begins where it belongs. Newton's
iteration takes the exact tangent of the whole balance. A step that a switching member's margin does not survive ends at
the event; what is left of the segment is divided anew. Steps do not end at the knots of curves: where the second
derivative of a force jumps, a method of second order loses nothing, and steps that stay as they are have derivatives
that are exact.
"""

import numpy as np

from mdstopo.compiler.jit import entry
from mdstopo.general.dynamics.accelerations import make_workspace, solve_accelerations
from mdstopo.general.dynamics.members import MODE, SET, may_meet, meeting, scale_general, shortest_at_start
from mdstopo.general.events.event_log import CHATTER, log_at_breakpoint, log_switches
from mdstopo.general.events.events import has_switches, room_for_watched, watch_all
from mdstopo.general.events.permanent_sets import begins_divided
from mdstopo.general.integrators.generalized_alpha_step import AUXILIARY, VELOCITY, make_step_room, rate_of
from mdstopo.general.integrators.generalized_alpha_switch import (
    FixedRun,
    close_in,
    first_piece,
    make_step,
    make_switch_room,
)
from mdstopo.general.model.general_model import unpack_general
from mdstopo.general.steps.run_start import ROUNDING, log_start, modes_at_start, motion_at_start, scene_size
from mdstopo.general.steps.step_history import (
    EVENTS,
    FIRST,
    carve_history,
    copy_vector,
    keep_state,
    keep_step,
)
from mdstopo.integrators.springs_generalized_alpha import FEWEST
from mdstopo.integrators.steps import (
    ACCEPTED,
    CHATTERING,
    NEEDS_ROOM,
    NON_FINITE,
    OK,
    SINGULAR,
    STEP_LIMIT,
    STEP_TOO_SMALL,
)
from mdstopo.mechanics.kinematics.kinematics_interface import (
    deflection,
    drive_state,
    pose_size,
    relative_pose,
)
from mdstopo.mechanics.kinematics.planar_poses import copy_rows

TAG = (0, 0)


@entry
def simulate(ints, floats, tables, alpha, tangent, settings, limits, room, room_ints, member_state, work, where):
    """Integrate a design over `model.times` in fixed steps.

    Constant:
      ints, floats: the packed scene (`general_model.pack_general`).
      tables (1,): the spectral radius.
      alpha (N,): the design.
      tangent: not read; tangents are always kept.
      settings: tolerance of the case, relative (it tells which touches count as doubtful); Newton tolerance, relative
        to the motion; the step (s), or, where negative, so many radians of the fastest vibration at the start.
      limits: steps allowed, and the sizes of the arrays (`carve_history`).
    Out:
      room, room_ints: the history of steps, as of `carve_history`.
      member_state (3, columns): state of the members; scales are set from alpha, modes and sets are those at the end.
      work (WORK,): counts of work, added to.
      where (3,): each -1 where there is none: the member or the unknown that is to blame for an early end; a member
        whose ends have met; one that grazes so that the motion has no derivative.

    Returns code (`integrators.steps`; NEEDS_ROOM: the arrays are too small), number of steps, number of events, time
    reached (s).
    """
    model = unpack_general(ints, floats)
    newton_tolerance = settings[1]
    n_q = model.q0.shape[0]
    n = model.v0.shape[0]
    n_pair = model.pair.shape[0]
    n_row = model.size[0]
    history = carve_history(model, limits, room, room_ints)
    history.mass[0] = 0.0
    scale_general(model.block, model.power, alpha, member_state)
    member_state[MODE] = 0.0
    member_state[SET] = 0.0
    times = model.times
    workspace = make_workspace(model)
    no = np.bool_(False)
    size = scene_size(model)
    rounding = ROUNDING * size
    rel = np.empty((n_pair, pose_size(model)))
    rel0 = np.empty((n_pair, pose_size(model)))
    before = np.empty((n_pair, pose_size(model)))
    q = np.zeros(n_q)
    state = np.zeros((3, n))
    end_q = np.zeros(n_q)
    ends = np.zeros((3, n))
    guess = np.zeros((3, n))
    push = np.zeros((2, n_row))
    lam = np.zeros(n_row)
    a0 = np.zeros(n)
    v = state[VELOCITY]
    copy_vector(model.q0, q)
    copy_vector(model.v0, v)
    for i in range(where.shape[0]):
        where[i] = -1
    graze = settings[0] * size
    t = times[0]
    drive_state(model, np.int64(0), t, q, v)
    switching = has_switches(model, no)
    watched = room_for_watched(model)
    watch_all(model, np.int64(0), watched)
    if switching:
        singular = modes_at_start(model, member_state, workspace, q, v, a0, lam, np.int64(0))
        if singular >= 0:
            where[0] = singular
            return SINGULAR, 0, 0, t
        if model.varied.shape[0] > 0:
            where[2] = begins_divided(model, member_state, q, v, graze)
    singular = solve_accelerations(model, member_state, np.int64(0), t, q, v, np.bool_(True), workspace, a0, lam)
    if singular >= 0:
        where[0] = singular
        return SINGULAR, 0, 0, t
    relative_pose(model, q, v, rel0)
    extent = np.zeros((2, n_pair))
    motion = extent[0]
    noise = extent[1]
    stiffness = np.empty(n_pair)
    motion_at_start(model, member_state, workspace, rel0, v, stiffness, motion, noise)
    shortest = np.empty(n_pair)
    shortest_at_start(model, rel0, shortest)
    span = times[times.shape[0] - 1] - t
    run = FixedRun(
        model, tables[0], member_state, newton_tolerance, size, rounding, graze, watched, workspace, history, q, state,
        guess, extent, rel0, make_step_room(model), rel, before, lam, where, work,
    )  # fmt: skip
    switch_room = make_switch_room(model)
    step = settings[2]
    if not step > 0.0:
        rate = rate_of(model, workspace)
        step = min(-step / rate, span / FEWEST) if rate > 0.0 else span / FEWEST
    events = log_start(member_state, history) if switching else np.int64(0)
    if events < 0:
        return NEEDS_ROOM, 0, 0, t
    keep_state(history, 0, t, q, v, push[0], push[1])
    history.index[0, FIRST] = 0
    count = np.int64(0)
    stages = np.int64(0)
    crowd_time = t
    crowd = 0
    for segment in range(times.shape[0] - 1):
        end = times[segment + 1]
        if segment > 0:
            drive_state(model, segment, t, q, v)
            keep_state(history, count, t, q, v, history.push[count, 0], history.push[count, 1])
            if switching:
                events = log_at_breakpoint(
                    model, member_state, segment, t, q, v, watched, workspace, a0, lam, history, count, events,
                    rounding, work, where,
                )  # fmt: skip
                if events < 0:
                    return NEEDS_ROOM, count, 0, t
        begin = t
        pieces = max(np.ceil((end - begin) / step - 1e-9), 1.0)
        done = 0.0
        known = 0
        while t < end:
            h = (end - begin) / pieces
            if not count + pieces - done <= limits[0]:
                return STEP_LIMIT, count, events, t
            if count + 3 > history.t.shape[0] or stages + 3 > history.when.shape[0]:
                return NEEDS_ROOM, count, events, t
            if not h > 1e-15 * max(abs(begin), abs(end)):
                return STEP_TOO_SMALL, count, events, t
            lands = done + 1.0 >= pieces
            starting = np.bool_(known == 0)
            code, used, singular = make_step(run, segment, t, h, starting, stages, state, end_q, ends, push)
            if code != OK:
                where[0] = singular
                return code, count, events, t
            relative_pose(model, end_q, ends[VELOCITY], rel)
            happens = False
            who = np.int64(-1)
            if switching:
                code, singular, margin, who, low, high, top = first_piece(
                    run, switch_room, segment, t, h, starting, end_q, ends
                )
                happens = margin < -rounding
                if happens and code == OK:
                    code, singular, h, who = close_in(
                        run, switch_room, segment, t, h, starting, low, high, top, margin, who
                    )
                if code != OK:
                    where[0] = singular
                    return code, count, events, t
                if happens:
                    lands = lands and t + h >= end
                    code, used, singular = make_step(run, segment, t, h, starting, stages, state, end_q, ends, push)
                relative_pose(model, end_q, ends[VELOCITY], rel)
            finite = True
            for d in range(n_q):
                finite = finite and np.isfinite(end_q[d])
            for d in range(n):
                finite = finite and np.isfinite(ends[VELOCITY, d])
            if not finite:
                return NON_FINITE, count, events, t
            for p in range(n_pair):
                motion[p] = max(motion[p], deflection(model, rel, rel0, p))
            if where[1] < 0 and may_meet(shortest, motion):
                relative_pose(model, q, v, before)
                where[1] = meeting(model, segment, t, member_state, before, rel)
            done += 1.0
            known += 1
            t = end if lands else (t + h if happens else begin + h * done)
            # x of the steps before; in the first ones it counts as having been constant
            for d in range(n):
                guess[2, d] = guess[1, d]
                guess[1, d] = guess[0, d]
                guess[0, d] = state[AUXILIARY, d]
            if known <= 3:
                for d in range(n):
                    slope = ends[AUXILIARY, d] - state[AUXILIARY, d]
                    guess[0, d] = ends[AUXILIARY, d] - slope
                    guess[1, d] = ends[AUXILIARY, d] - 2.0 * slope
                    guess[2, d] = ends[AUXILIARY, d] - 3.0 * slope
            copy_vector(end_q, q)
            copy_rows(ends, state)
            stages += used
            keep_step(history, count, segment, events, stages, t, q, v, push)
            count += 1
            work[ACCEPTED] += 1
            if happens:
                solve_accelerations(model, member_state, segment, t, q, v, no, workspace, a0, lam)
                events = log_switches(
                    model, member_state, segment, t, q, v, watched, workspace, a0, lam, history, count, events, graze,
                    rounding, work, where,
                )  # fmt: skip
                if events < 0:
                    return NEEDS_ROOM, count, 0, t
                crowd = crowd + 1 if t - crowd_time < 1e-6 * span else 0
                if crowd == 0:
                    crowd_time = t
                if crowd > CHATTER:
                    where[0] = who
                    return CHATTERING, count, events, t
                begin = t
                done = 0.0
                known = 0
                pieces = max(np.ceil((end - begin) / step - 1e-9), 1.0)
            history.index[count, EVENTS] = events
    history.index[count + 1, FIRST] = stages  # no step follows (`weights_of`)
    return OK, count, events, t
