"""Adaptive Runge-Kutta steps of a general scene, explicit or diagonally implicit, with joints and events.

The stages, and what estimates a step's error, are those of the method that is chosen by its tag (`method_interface`).
The end of a step is moved onto the joints (`projection`), by no more than the step's error, so the order stays. A step
that a switching member's margin does not survive is shortened until it ends at the event. Where slopes of a force begin
or end with a root, as those of x^1.5, a step is of low order for derivatives: there steps become shorter and longer by
shares of the time to and from the event, and the last one is made anew, so that no stage lies behind the root.
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.dynamics.accelerations import make_workspace, solve_accelerations
from mdstopo.general.dynamics.members import (
    MODE,
    SET,
    knotted_at,
    may_meet,
    meeting,
    scale_general,
    shortest_at_start,
)
from mdstopo.general.dynamics.projection import project
from mdstopo.general.dynamics.singular_poses import (
    CLOSE,
    NEAR,
    crosses,
    error_along,
    least_singular_value,
    step_beside,
    way_to_pose,
)
from mdstopo.general.events.event_log import CHATTER, log_at_breakpoint, log_switches
from mdstopo.general.events.events import (
    has_switches,
    is_doubtful,
    room_for_watched,
    smallest_margin,
    watch_near,
)
from mdstopo.general.events.landing import CORRECTIONS, first_event, landing_of
from mdstopo.general.events.locate import (
    AIM,
    NEAREST,
    RESOLUTION,
    is_sharp,
    step_beside_sharp,
    time_to_sharp,
    time_to_switch,
)
from mdstopo.general.events.locate import NEAR as NEAR_SWITCH
from mdstopo.general.events.permanent_sets import begins_divided
from mdstopo.general.integrators.braking import HELD, HOPELESS, brake_rate, friction_error
from mdstopo.general.steps.first_step import first_step, motion_scale
from mdstopo.general.steps.method_interface import UNSOLVED, is_explicit, make_stages, scheme, step_error
from mdstopo.general.steps.run_start import ROUNDING, log_start, modes_at_start, motion_at_start, scene_size
from mdstopo.general.steps.step_history import (
    EVENTS,
    FIRST,
    copy_vector,
    keep_state,
    keep_step,
)
from mdstopo.integrators.runge_kutta_tables import INSIDE
from mdstopo.integrators.springs_runge_kutta import MOST
from mdstopo.integrators.steps import (
    ACCEPTED,
    CHATTERING,
    FORCES,
    HELD_SHORT,
    LIMITED,
    NEEDS_ROOM,
    NEWTON_FAILED,
    NON_FINITE,
    OF_REJECTED,
    OF_STARTS,
    OF_SWITCHES,
    OK,
    REJECTED,
    SINGULAR,
    STABLE,
    STEP_LIMIT,
    STEP_TOO_SMALL,
    TURN,
    decay_rate,
)
from mdstopo.mechanics.kinematics.kinematics_interface import (
    deflection,
    drive_state,
    end_state,
    largest_turn,
    motion_weights,
    pose_size,
    relative_pose,
)

#: error of a step relative to the tolerance of the motion: errors of many steps add up, and projection adds its own.
#: Above LOOSE the estimate is larger than the error by more and more (in long steps it is not the next term of a
#: series), and MARGIN (tolerance / LOOSE)^SLACK is as safe: over 110 scenes with joints, all laws, motions and events
#: errors are below ten tolerances in 98 to 99 of a hundred objectives and gradients, at every tolerance
MARGIN, LOOSE, SLACK = 0.02, 1e-5, 1.0 / 3.0
#: a step that may grow does so by this power of what the order allows: where steps are long the estimate rises faster
#: than the order says, and a step that is rejected costs more than one that could have been longer
GROWTH = 2.0 / 3.0


@kernel
def advance(
    tag,
    model,
    table,
    s,
    member_state,
    segment,
    t,
    h,
    q0,
    v0,
    tangent,
    o,
    workspace,
    lam,
    q,
    v,
    a,
    history,
    end_q,
    end_v,
    push,
    size,
    work,
):
    """Make one step, and put its end onto the joints.

    Constant:
      tag: the method of integration (`method_interface`).
      model: the compiled scene.
      table (3, 17, 17): coefficients of the method (`integrators.runge_kutta_tables`).
      s: number of its stages.
      size: size of the scene (m).
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      t, h: time at the start, and length of the step (s).
      q0 (n_q,), v0 (n,): coordinates and velocities at the start.
      tangent: whether the tangents of the stages are wanted.
      o: number of the first stage as which they are kept in `history`; -1: they are not kept.
    Out:
      workspace: workspace of a balance (`accelerations.Workspace`).
      lam (n_row,): multipliers of the joints at the last stage.
      q (s or more, n_q), v, a (s or more, n): coordinates, velocities, accelerations of the stages.
      history: the history of steps (`StepHistory`), where stages are kept.
      end_q (n_q,), end_v (n,): coordinates and velocities at the end; NaN where a stage is not found.
      push (2, n_row): the multipliers of the projection there.
      work (WORK,): counts of work, added to.

    Returns -1; UNSOLVED of a stage that is not found; or what `projection.project` returns of joints that are singular
    or do not fit.
    """
    singular = make_stages(
        tag, model, table, 0, s, member_state, segment, t, h, q0, v0, tangent, o, workspace, lam, q, v, a, history, work
    )
    if singular >= 0:
        end_q[:] = np.nan
        end_v[:] = np.nan
        return singular
    end_state(model, table, s, h, q0, v0, q, v, a, workspace.slopes, end_q, end_v)
    drive_state(model, segment, t + h, end_q, end_v)
    return project(model, size, end_q, end_v, workspace, push[0], push[1])


@kernel
def advance_to_switch(
    tag, step, table, s, segment, t, h, c, rate, rounding, tangent, o, lam, history, end_q, end_v, push, work
):
    """Make a step anew that ends where a member switches, for the sake of what needs all stages within a step.

    Constant:
      tag: the method of integration (`method_interface`).
      step: the step (`landing.Landing`), whose stages are overwritten.
      table (3, 17, 17), s: coefficients of the method, and how many stages it has.
    In:
      segment: number of the stretch of time between two breakpoints.
      t, h: time at the start, and length of the step that is too long (s).
      c, rate: the fraction of it that is found on its polynomial, and the rate of the margin there (`first_event`).
      rounding: what rounding leaves of a margin.
      tangent, o: whether tangents of the stages are wanted; number of the first stage in `history`.
    Out:
      lam (n_row,): multipliers of the joints at the last stage.
      history: the history of steps (`StepHistory`), where stages are kept.
      end_q (n_q,), end_v (n,), push (2, n_row): the end of the step, and the multipliers of its projection.
      work (WORK,): counts of work, added to.

    Returns the length (s), whether a margin is used up at its end, and what `advance` returns of it.
    """
    length = c * h
    resolution = RESOLUTION * (abs(t) + h)
    before = 0.0
    at_before = 0.0
    value = 0.0
    singular = -1
    for tries in range(CORRECTIONS):
        singular = advance(
            tag, step.model, table, s, step.member_state, segment, t, length, step.q0, step.v0, tangent, o,
            step.workspace, lam, step.q, step.v, step.a, history, end_q, end_v, push, step.size, work,
        )  # fmt: skip
        work[OF_SWITCHES] += s if tries > 0 else 0
        if singular >= 0:
            break
        relative_pose(step.model, end_q, end_v, step.rel)
        value, _ = smallest_margin(step.model, t + length, step.member_state, step.rel, step.watched)
        near = value < -rounding and (value >= -NEAR_SWITCH * rounding or tries >= CORRECTIONS // 2)
        if near or tries + 1 == CORRECTIONS:
            break
        if tries > 0 and length != before and (value - at_before) / (length - before) < 0.0:
            rate = (value - at_before) / (length - before)
        before = length
        at_before = value
        shift = -(value + AIM * rounding) / rate if rate < 0.0 else resolution * 4.0**tries
        length = min(max(length + shift, 0.5 * length, resolution), h)
    return length, value < -rounding, singular


@kernel
def run_adaptive(
    tag, model, tables, alpha, tangent, settings, limits, history, member_state, work, where
):  # fmt: skip
    """Integrate the motion of a design over model.times.

    Constant:
      tag: the method of integration (`method_interface`).
      model: the compiled scene.
      tables (2, 3, 17, 17): coefficients of both methods (`integrators.runge_kutta_tables`).
      settings (5,): the tolerance; -; a fixed step (s; above 0: no error control); -; not 0 where stages are to lie
        within their steps, as for integrals over time: then steps that end at a switch are made anew, and shorter.
      limits (6,): steps allowed, then sizes of the history of steps (`carve_history`).
    In:
      alpha (N,): the design.
      tangent: whether tangents are kept for a reverse sweep.
    Out:
      history: the history of steps (`StepHistory`).
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member, at the end.
      work (WORK,): counts of work, added to.
      where (3,): each -1 where there is none: the member or the unknown that is to blame for an early end; a member
        whose ends have met; a member that grazes so that the motion has no derivative.

    Returns a code (`integrators.steps`; NEEDS_ROOM asks for larger rooms), the number of steps, that of events, and the
    time reached (s).
    """
    tolerance = MARGIN * settings[0] * max(settings[0] / LOOSE, 1.0) ** SLACK
    fixed_step = settings[2]
    n_q = model.q0.shape[0]
    n = model.v0.shape[0]
    n_pair = model.pair.shape[0]
    n_row = model.size[0]
    history.mass[0] = 0.0
    scale_general(model.block, model.power, alpha, member_state)
    member_state[MODE] = 0.0
    member_state[SET] = 0.0
    method = 1 if model.size[2] != 0 else 0
    s, order, first_error = scheme(tag, method)
    explicit = is_explicit(tag)
    table = tables[method]
    times = model.times
    workspace = make_workspace(model)
    no = np.bool_(False)
    keep = np.bool_(tangent)
    size = scene_size(model)
    rounding = ROUNDING * size  # margins below this count as zero: a member that has just switched has such a one
    rel = np.empty((n_pair, pose_size(model)))
    rel0 = np.empty((n_pair, pose_size(model)))
    before = np.empty((n_pair, pose_size(model)))
    q = np.zeros((MOST, n_q))
    v = np.zeros((MOST, n))
    a = np.zeros((MOST, n))
    lam = np.zeros(n_row)
    push = np.zeros((2, n_row))
    end_q = np.empty(n_q)
    end_v = np.empty(n)
    weight = np.empty(n)
    a0 = np.zeros(n)
    q0 = model.q0.copy()
    v0 = model.v0.copy()
    for i in range(where.shape[0]):
        where[i] = -1
    graze = settings[0] * size
    t = times[0]
    drive_state(model, np.int64(0), t, q0, v0)
    switching = has_switches(model, np.bool_(True))
    watched = room_for_watched(model)
    step = landing_of(model, table, size, member_state, q0, v0, q, v, a, workspace, watched)
    rubbing = explicit and model.contact_pair.shape[0] > 0  # implicit stages bear what brakes
    brake = 0.0  # the rate at which contacts brake
    braking = -1  # the contact that brakes most
    held = 0  # steps in a row that were kept short by the rate of contacts or dampers
    decay = 0.0  # the rate at which dampers damp, as the last step tells
    limited = 0  # steps in a row that were as long as stability allows by it
    ended = 0.0  # length of the last step, if its last stage and the next step's first tell that rate
    moving = np.empty_like(model.mass)
    for d in range(moving.shape[0]):
        moving[d] = model.mass[d] if model.free[d] != 0 else 0.0
    measures = explicit and method == 1 and not fixed_step > 0.0
    if switching:
        most_knotted = knotted_at(settings[0])
        singular = modes_at_start(model, member_state, workspace, q0, v0, a0, lam, most_knotted)
        if singular >= 0:
            where[0] = singular
            return SINGULAR, 0, 0, t
        if model.varied.shape[0] > 0:
            where[2] = begins_divided(model, member_state, q0, v0, graze)
    singular = solve_accelerations(model, member_state, np.int64(0), t, q0, v0, np.bool_(True), workspace, a0, lam)
    work[FORCES] += 1
    work[OF_STARTS] += 1
    if singular >= 0:
        where[0] = singular
        return SINGULAR, 0, 0, t
    sigma = least_singular_value(model, workspace)
    largest = sigma
    way = np.inf  # time until the next pose at which joints repeat each other
    must = True
    ahead = np.inf  # when a switch is foreseen at which slopes begin with a root
    sharp_one = -1  # whose it is
    usual = 0.0  # length of a step before they became short for it
    since = -np.inf  # when the last such one was
    nearest = settings[0] ** NEAREST
    relative_pose(model, q0, v0, rel0)
    motion = np.zeros(n_pair)
    noise = np.empty(n_pair)
    scale = np.empty(n_pair)
    motion_at_start(model, member_state, workspace, rel0, v0, scale, motion, noise)
    shortest = np.empty(n_pair)
    shortest_at_start(model, rel0, shortest)
    shaken = 0.0
    for p in range(n_pair):
        shaken += abs(scale[p]) * noise[p]
    events = log_start(member_state, history) if switching else np.int64(0)
    if events < 0:
        return NEEDS_ROOM, 0, 0, t
    last_time = times[times.shape[0] - 1]
    span = last_time - t
    wanted = fixed_step
    if not fixed_step > 0.0:
        wanted = first_step(
            model, member_state, times[1], q0, v0, a0, rel0, motion, noise, tolerance, order, first_error, workspace,
            lam, q[0], v[0], a[0], work,
        )  # fmt: skip
    if rubbing and not fixed_step > 0.0:
        brake, braking = brake_rate(model, member_state, q0, v0, STABLE / wanted, workspace)
    keep_state(history, 0, t, q0, v0, push[0], push[1])
    history.index[0, FIRST] = 0
    count = np.int64(0)
    stages = np.int64(0)
    longest = 0.0
    crowd_time = t
    crowd = 0
    for segment in range(times.shape[0] - 1):
        end = times[segment + 1]
        ended = 0.0
        if segment > 0:
            drive_state(model, segment, t, q0, v0)
            keep_state(history, count, t, q0, v0, history.push[count, 0], history.push[count, 1])
            if switching:
                work[FORCES] += 1
                work[OF_STARTS] += 1
                events = log_at_breakpoint(
                    model, member_state, segment, t, q0, v0, watched, workspace, a0, lam, history, count, events,
                    rounding, work, where,
                )  # fmt: skip
                if events < 0:
                    return NEEDS_ROOM, count, 0, t
        while t < end:
            where[0] = -1
            fastest = max(decay, brake) if limited > 1 else brake
            held = held + 1 if wanted * fastest > STABLE else 0
            if held > 0:
                wanted = STABLE / fastest
                where[0] = braking
                work[HELD_SHORT] += 1
                if held > HELD and (last_time - t) > HOPELESS * wanted * limits[0]:
                    return STEP_LIMIT, count, events, t
            if count >= limits[0]:
                return STEP_LIMIT, count, events, t
            pieces = np.ceil((end - t) / wanted - 1e-9)
            h = (end - t) / max(pieces, 1.0)
            lands = pieces <= 1.0
            if way < np.inf and not fixed_step > 0.0:
                beside = step_beside(h, way, must and sigma < CLOSE * largest, table[2, 0], s)
                if beside < end - t:
                    h = beside
                    lands = False
            if (ahead < np.inf or since > -np.inf) and not fixed_step > 0.0:
                away = ahead - t
                if sharp_one >= 0:
                    relative_pose(model, q0, v0, before)
                    away = min(away, time_to_switch(model, t, member_state, before, sharp_one))
                beside = step_beside_sharp(away, t - since, nearest * longest)
                if beside < min(h, end - t):
                    h = beside
                    lands = False
            if not h > 1e-14 * max(abs(t), abs(end)) or h < 1e-15 * span:
                return STEP_TOO_SMALL, count, events, t
            if count + 4 > history.t.shape[0] or stages + INSIDE + s > history.when.shape[0]:
                return NEEDS_ROOM, count, events, t
            singular = advance(
                tag, model, table, s, member_state, segment, t, h, q0, v0, keep, stages, workspace, lam, q, v, a,
                history, end_q, end_v, push, size, work,
            )  # fmt: skip
            if singular >= 0:
                # a long step may have gone beyond a singular pose, a shorter one need not; a very short one is at it
                if h < 1e-9 * span:
                    where[0] = singular if singular != UNSOLVED else -1
                    return (SINGULAR if singular != UNSOLVED else NEWTON_FAILED), count, events, t
                wanted = 0.25 * h
                must = False
                work[REJECTED] += 1
                work[OF_REJECTED] += s
                continue
            if ended > 0.0:
                decay = decay_rate(
                    moving, history.stage_a[stages], history.stage_a[stages - 1], history.stage_v[stages],
                    history.stage_v[stages - 1],
                )  # fmt: skip
                limited = limited + 1 if ended * decay > LIMITED else 0
                ended = 0.0
            sigma_end = least_singular_value(model, workspace)
            relative_pose(model, end_q, end_v, rel)
            motion_scale(model, end_q, rel, rel0, motion, noise, tolerance, scale)
            motion_weights(model, rel, scale, weight)
            # near a singular pose errors of velocities do not count as if they lasted: joints determine velocities
            # there, and the step has to reach across the pose
            lasting = longest if sigma >= CLOSE * largest else 0.0
            error = step_error(tag, table[2], s, h, lasting, a, weight)
            if crosses(h, way):
                error = error_along(model, workspace, table[2], s, h, a, weight, error, sigma_end)
            if rubbing:
                grip = friction_error(
                    model, member_state, table[2], s, h, q0, v0, end_q, end_v, a, noise, shaken, tolerance
                )
                if grip > error or not np.isfinite(grip):
                    error = grip
            finite = True
            for d in range(n_q):
                finite = finite and np.isfinite(end_q[d])
            for d in range(n):
                finite = finite and np.isfinite(end_v[d])
            if fixed_step > 0.0:
                if not finite:
                    return NON_FINITE, count, events, t
            else:
                if not finite or not error < 1e6:
                    wanted = 0.1 * h
                    must = False
                    work[REJECTED] += 1
                    work[OF_REJECTED] += s
                    continue
                change = 0.9 * (tolerance / max(error, 1e-30)) ** (1.0 / order)
                if change > 1.0:
                    change **= GROWTH
                turned = largest_turn(model, q0, end_q)
                wanted = h * min(max(change, 0.1), 4.0, TURN / max(turned, 1e-300))
                if error > tolerance or turned > 1.1 * TURN:
                    must = False
                    work[REJECTED] += 1
                    work[OF_REJECTED] += s
                    continue
                if sigma_end < NEAR * sigma and not lands and h > 1e-9 * span:
                    wanted = 0.6 * h
                    work[REJECTED] += 1
                    work[OF_REJECTED] += s
                    continue
            happens = False
            own = s  # stages of the step
            history.share[count] = 1.0
            if switching:
                relative_pose(model, q0, v0, before)
                watch_near(model, segment, t, member_state, before, rel, h, watched)
                margin, who = smallest_margin(model, t + h, member_state, rel, watched)
                c = 2.0
                rate = 0.0
                if margin < -rounding or is_doubtful(
                    model, t, member_state, q0, v0, end_q, end_v, before, rel, h, rounding, watched
                ):
                    if explicit:  # what else the polynomial needs
                        singular = make_stages(
                            tag, model, table, s, INSIDE, member_state, segment, t, h, q0, v0, keep, stages, workspace,
                            lam, q, v, a, history, work,
                        )  # fmt: skip
                        work[OF_SWITCHES] += INSIDE - s
                    if singular >= 0:
                        wanted = 0.25 * h
                        must = False
                        work[REJECTED] += 1
                        work[OF_REJECTED] += s
                        continue
                    c, who, rate = first_event(step, segment, t, h, graze, rounding, end_q, end_v, margin, where)
                happens = c <= 1.0
                sharp = np.bool_(False)
                if happens and not fixed_step > 0.0:
                    relative_pose(model, step.at_q, step.at_v, step.rel)
                    sharp = is_sharp(model, t + c * h, member_state, step.rel, who)
                until = c * h if sharp else 0.0
                if not happens and not fixed_step > 0.0:
                    until, who = time_to_sharp(model, t + h, member_state, rel, watched)
                    until = until + h if until < 0.5 * h else 0.0
                if until > nearest * max(longest, h):
                    ahead = t + until
                    usual = wanted if sharp_one < 0 else usual
                    sharp_one = who
                    must = False
                    work[REJECTED] += 1
                    work[OF_REJECTED] += INSIDE if c < 2.0 else s
                    continue
                if happens and (settings[4] != 0.0 or sharp or not explicit):
                    work[OF_SWITCHES] += s
                    h, happens, singular = advance_to_switch(
                        tag, step, table, s, segment, t, h, c, rate, rounding, keep, stages, lam, history, end_q, end_v,
                        push, work,
                    )  # fmt: skip
                    if singular >= 0:
                        wanted = 0.25 * h
                        must = False
                        work[REJECTED] += 1
                        work[OF_REJECTED] += s
                        continue
                elif happens:
                    own = INSIDE
                    history.share[count] = c
                    h *= c
                    copy_vector(step.at_q, end_q)
                    copy_vector(step.at_v, end_v)
                    copy_vector(step.push[0], push[0])
                    copy_vector(step.push[1], push[1])
                if c <= 1.0:
                    lands = lands and h >= end - t
                    sigma_end = least_singular_value(model, workspace)
                    relative_pose(model, end_q, end_v, rel)
            largest = max(largest, sigma_end)
            way = way_to_pose(h, sigma, sigma_end, largest)
            sigma = sigma_end
            must = True
            for p in range(n_pair):
                motion[p] = max(motion[p], deflection(model, rel, rel0, p))
            if where[1] < 0 and may_meet(shortest, motion):
                relative_pose(model, q0, v0, before)
                where[1] = meeting(model, segment, t, member_state, before, rel)
            ended = h if measures and own == s and not happens else 0.0
            t = end if lands else t + h
            if happens or t >= ahead:
                ahead = np.inf
                sharp_one = -1
            longest = max(longest, h)
            copy_vector(end_q, q0)
            copy_vector(end_v, v0)
            stages += own
            keep_step(history, count, segment, events, stages, t, q0, v0, push)
            count += 1
            work[ACCEPTED] += 1
            if happens:
                solve_accelerations(model, member_state, segment, t, q0, v0, no, workspace, a0, lam)
                work[FORCES] += 1
                work[OF_STARTS] += 1
                events = log_switches(
                    model, member_state, segment, t, q0, v0, watched, workspace, a0, lam, history, count, events, graze,
                    rounding, work, where,
                )  # fmt: skip
                if events < 0:
                    return NEEDS_ROOM, count, 0, t
                if is_sharp(model, t, member_state, rel, who):
                    since = t
                else:
                    wanted = max(wanted, usual)
                usual = 0.0
                crowd = crowd + 1 if t - crowd_time < 1e-6 * span else 0
                if crowd == 0:
                    crowd_time = t
                if crowd > CHATTER:
                    where[0] = who
                    return CHATTERING, count, events, t
            if rubbing and not fixed_step > 0.0:
                brake, braking = brake_rate(model, member_state, q0, v0, STABLE / wanted, workspace)
            history.index[count, EVENTS] = events
    return OK, count, events, t
