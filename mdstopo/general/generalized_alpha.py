"""Generalized-alpha steps of a general scene, fixed, with joints and events (Arnold and Bruels' form).

    (1 - alpha_m) x' + alpha_m x = (1 - alpha_f) a' + alpha_f a
    q* = q + h v + h^2 ((1/2 - beta) x + beta x'),  v* = v + h ((1 - gamma) x + gamma x'),  a' = a(q*, v*, t')

as in `integrators.generalized_alpha`, with a(q, v, t) from the balance with its joints: accelerations and multipliers
are of second order like the motion. Then q*, v* are moved onto the joints (`projection`) by what they are off, which is
of third order: no drift, and no transient at the start, because x begins where it belongs. Newton's iteration takes the
exact tangent of the whole balance. A step that a switching member's margin does not survive ends at the event; what
is left of the segment is divided anew.
"""

import numpy as np

from mdstopo.general.balance import balance, factor_matrix, make_desk, solve_unknowns
from mdstopo.general.events import first_sign, has_switches, smallest_margin
from mdstopo.general.forces import drive_state
from mdstopo.general.members import meeting, scale_general
from mdstopo.general.model import unpack_general
from mdstopo.general.projection import project
from mdstopo.general.runge_kutta import CHATTER, ROUNDING, log_switches, scene_size, start_modes
from mdstopo.general.track import carve_track, copy_vector, keep_stage, keep_state
from mdstopo.integrators.gauss import fastest_rate
from mdstopo.integrators.generalized_alpha import FEWEST, MOST, RESOLVED, RESTART, weights_of
from mdstopo.integrators.steps import (
    ACCEPTED,
    CHATTERING,
    FORCES,
    NEEDS_ROOM,
    NEWTON,
    NEWTON_FAILED,
    NON_FINITE,
    OK,
    SINGULAR,
    STEP_LIMIT,
    STEP_TOO_SMALL,
    TANGENTS,
    deflection,
    motion_weights,
)
from mdstopo.jit import entry, kernel
from mdstopo.mechanics.geometry import POSE, relative_pose

TAG = (0, 0)


@kernel
def rate_of(model, desk):  # type: ignore[no-untyped-def]
    """Angular frequency of the fastest vibration at the balanced state on the desk, rad/s (an estimate)."""
    n = model.mass.shape[0]
    n_pair = model.pair.shape[0]
    inverse = np.zeros(n)
    for d in range(n):
        if model.free[d] != 0:
            inverse[d] = 1.0 / model.mass[d]
    return fastest_rate(
        model.pair, inverse, desk.k.reshape((1, n_pair, 6, 6)), desk.c.reshape((1, n_pair, 6, 6)), np.bool_(True)
    )


@kernel
def advance(  # type: ignore[no-untyped-def]
    model,
    radius,
    strength,
    segment,
    t,
    h,
    starting,
    state,
    guess,
    newton_tolerance,
    size,
    o,
    desk,
    track,
    ends,
    push,
    extent,
    rel0,
    work,
):
    """One step of length h from state (4, n) = q, v, a, x to ends (4, n) of the same; q, v of the end on the joints.

    starting: whether a and x are to be made here. guess (3, n): x of the three steps before, for the first iterate.
    extent (2, n_pair): how far each pair has moved so far from its pose rel0 at the start, and its noise, m. push
    (2, n_row). With o >= 0 the stages are kept
    from there on. Returns (code, stages, place of a singular unknown).
    """
    n = state.shape[1]
    n_row = model.size[0]
    e1, e2, e3, beta, gamma, lag = weights_of(radius)
    yes = np.bool_(True)
    q = np.empty(n)
    v = np.empty(n)
    a = state[2]
    x = state[3]
    now = np.empty(n)
    x_now = np.empty(n)
    balanced = np.empty(n)
    delta = np.empty(n)
    lam = np.zeros(n_row)
    row = np.empty(n_row)
    weight = np.empty(n)
    scale = np.empty(model.pair.shape[0])
    stages = 0
    if starting:
        copy_vector(state[0], q)
        copy_vector(state[1], v)
        singular = balance(model, strength, segment, t, q, v, yes, desk, a, lam)
        work[FORCES] += 1
        work[TANGENTS] += 1
        if singular >= 0:
            return SINGULAR, stages, singular
        if o >= 0:
            keep_stage(track, o, t, q, v, a, lam, desk, yes)
        stages = 1
        copy_vector(a, x)
        if lag > 0.0 and h * rate_of(model, desk) < RESOLVED:
            ahead = lag * h
            for d in range(n):
                q[d] = state[0, d] + ahead * (state[1, d] + 0.5 * ahead * a[d])
                v[d] = state[1, d] + ahead * a[d]
            singular = balance(model, strength, segment, t + ahead, q, v, yes, desk, balanced, lam)
            work[FORCES] += 1
            work[TANGENTS] += 1
            if singular >= 0:
                return SINGULAR, stages, singular
            if o >= 0:
                keep_stage(track, o + 1, t + ahead, q, v, balanced, lam, desk, yes)
            stages = 2
            for d in range(n):
                x[d] = 2.0 * a[d] - balanced[d]
    previous = np.inf
    newton = 0
    while True:
        if newton == 0 or newton == RESTART:
            for d in range(n):
                x_now[d] = x[d]
                if newton == 0 and not starting:
                    x_now[d] = 4.0 * (x[d] + guess[1, d]) - 6.0 * guess[0, d] - guess[2, d]
                now[d] = (x_now[d] - e2 * a[d] + e3 * x[d]) / e1
                q[d] = state[0, d] + h * (state[1, d] + h * ((0.5 - beta) * x[d] + beta * x_now[d]))
                v[d] = state[1, d] + h * ((1.0 - gamma) * x[d] + gamma * x_now[d])
            previous = np.inf
        singular = balance(model, strength, segment, t + h, q, v, yes, desk, balanced, lam)
        work[FORCES] += 1
        work[TANGENTS] += 1
        work[NEWTON] += 1
        if singular >= 0:
            return SINGULAR, stages, singular
        for d in range(n):
            if model.free[d] == 0:
                now[d] = balanced[d]
            balanced[d] -= now[d]
            delta[d] = model.mass[d] * balanced[d]
        row[:] = 0.0
        for p in range(model.pair.shape[0]):
            for i in range(6):
                total = 0.0
                for j in range(6):
                    total += desk.mass[p, i, j] * balanced[3 * model.pair[p, j // 3] + j % 3]
                delta[3 * model.pair[p, i // 3] + i % 3] += total
        for j in range(model.joint.shape[0]):
            for r in range(3):
                if model.row[j, r] >= 0:
                    for i in range(6):
                        column = 3 * model.joint[j, 1 + i // 3] + i % 3
                        row[model.row[j, r]] += desk.jac[j, r, i] * balanced[column]
        factor_matrix(
            model, desk, desk.k, desk.c, desk.turn, desk.mass, h * h * beta * e1, h * gamma * e1, np.bool_(False)
        )
        solve_unknowns(model, desk, delta, row)
        rounding = 1e-8
        for p in range(model.pair.shape[0]):
            reached = max(extent[0, p], deflection(desk.rel, rel0, model.reach, p))
            scale[p] = max(reached, 1e3 * extent[1, p])
            rounding = max(rounding, 100.0 * extent[1, p] / scale[p])
        motion_weights(model.pair, rel0, model.reach, scale, weight)
        e = 0.0
        for d in range(n):
            moved = h * h * beta * e1 * delta[d]
            now[d] += delta[d]
            x_now[d] = e1 * now[d] + e2 * a[d] - e3 * x[d]
            q[d] += moved
            v[d] += h * gamma * e1 * delta[d]
            change = weight[d] * abs(moved)
            if not change <= e and not np.isnan(e):
                e = change
        if e <= newton_tolerance or (e >= 0.5 * previous and e < rounding):
            break
        previous = e
        if newton >= MOST or (newton >= RESTART and not e < np.inf):
            return (NEWTON_FAILED if e < np.inf else NON_FINITE), stages, -1
        newton = RESTART if not e < np.inf else newton + 1
    drive_state(model, segment, t + h, q, v)
    if o >= 0:
        # the multipliers that belong to the corrected accelerations
        for r in range(n_row):
            lam[r] += row[r]
        keep_stage(track, o + stages, t + h, q, v, now, lam, desk, yes)
    copy_vector(q, ends[0])
    copy_vector(v, ends[1])
    copy_vector(now, ends[2])
    copy_vector(x_now, ends[3])
    singular = project(model, size, ends[0], ends[1], desk, push[0], push[1])
    return (SINGULAR if singular >= 0 else OK), stages + 1, singular


@entry
def simulate(ints, floats, tables, alpha, tangent, settings, limits, room, room_ints, strength, work, where):  # type: ignore[no-untyped-def]
    """Integrate alpha (N,) over model.times; returns (code, number of steps, number of events, time reached).

    As `general.runge_kutta.simulate`; tables (1,): the spectral radius; settings[2]: the step, or, where negative, so
    many radians of the fastest vibration at the start. Tangents are always kept.
    """
    model = unpack_general(ints, floats)
    newton_tolerance = settings[1]
    n = model.q0.shape[0]
    n_pair = model.pair.shape[0]
    n_row = model.size[0]
    track = carve_track(model, limits, room, room_ints)
    track.mass[0] = 0.0
    scale_general(model.block, model.power, alpha, strength)
    strength[1] = 0.0
    times = model.times
    desk = make_desk(model)
    no = np.bool_(False)
    size = scene_size(model)
    rounding = ROUNDING * size
    nowhere = np.int64(-1)
    rel = np.empty((n_pair, POSE))
    rel0 = np.empty((n_pair, POSE))
    before = np.empty((n_pair, POSE))
    state = np.zeros((4, n))
    ends = np.zeros((4, n))
    guess = np.zeros((3, n))
    trial = np.zeros((4, n))
    kept = np.zeros((4, n))
    push = np.zeros((2, n_row))
    lam = np.zeros(n_row)
    a0 = np.zeros(n)
    q = state[0]
    v = state[1]
    copy_vector(model.q0, q)
    copy_vector(model.v0, v)
    where[0] = -1
    where[1] = -1
    t = times[0]
    drive_state(model, np.int64(0), t, q, v)
    switching = has_switches(model)
    if switching:
        singular = start_modes(model, strength, desk, q, v, a0, lam)
        if singular >= 0:
            where[0] = singular
            return SINGULAR, 0, 0, t
    singular = balance(model, strength, np.int64(0), t, q, v, np.bool_(True), desk, a0, lam)
    if singular >= 0:
        where[0] = singular
        return SINGULAR, 0, 0, t
    relative_pose(model.pair, q, v, rel0)
    extent = np.zeros((2, n_pair))
    motion = extent[0]
    noise = extent[1]
    for p in range(n_pair):
        noise[p] = 1e-15 * (np.sqrt(rel0[p, 0] ** 2 + rel0[p, 1] ** 2) + model.reach[p]) + 1e-300
        stiffness = desk.sums[p, 7] + desk.sums[p, 11]
        if desk.sums[p, 3] > 0.0 and stiffness > 0.0:
            motion[p] = np.sqrt(2.0 * desk.sums[p, 3] / stiffness)
    span = times[times.shape[0] - 1] - t
    step = settings[2]
    if not step > 0.0:
        rate = rate_of(model, desk)
        step = min(-step / rate, span / FEWEST) if rate > 0.0 else span / FEWEST
    events = np.int64(0)
    if switching:
        for i in range(strength.shape[1] - 1):
            if strength[1, i] != 0.0:
                if events >= track.event.shape[0]:
                    return NEEDS_ROOM, 0, 0, t
                track.event[events, 0] = 0
                track.event[events, 1] = i
                track.event[events, 2] = 0
                track.event[events, 3] = int(strength[1, i])
                track.salt[events] = 0.0
                events += 1
        strength[1, strength.shape[1] - 1] = events
    keep_state(track, 0, t, q, v, push[0], push[1])
    track.index[0, 0] = 0
    count = np.int64(0)
    stages = np.int64(0)
    crowd_time = t
    crowd = 0
    for segment in range(times.shape[0] - 1):
        end = times[segment + 1]
        if segment > 0:
            drive_state(model, segment, t, q, v)
            keep_state(track, count, t, q, v, track.push[count, 0], track.push[count, 1])
            if switching:
                balance(model, strength, segment, t, q, v, no, desk, a0, lam)
                first = events
                events = log_switches(
                    model, strength, segment, t, q, v, desk, a0, lam, track, count, events, rounding, work
                )
                if events < 0:
                    return NEEDS_ROOM, count, 0, t
                for e in range(first, events):
                    track.salt[e] = 0.0
        begin = t
        pieces = max(np.ceil((end - begin) / step - 1e-9), 1.0)
        done = 0.0
        known = 0
        while t < end:
            h = (end - begin) / pieces
            if not count + pieces - done <= limits[0]:
                return STEP_LIMIT, count, events, t
            if count + 3 > track.t.shape[0] or stages + 3 > track.when.shape[0]:
                return NEEDS_ROOM, count, events, t
            if not h > 1e-15 * max(abs(begin), abs(end)):
                return STEP_TOO_SMALL, count, events, t
            lands = done + 1.0 >= pieces
            starting = np.bool_(known == 0)
            code, used, singular = advance(
                model, tables[0], strength, segment, t, h, starting, state, guess, newton_tolerance, size, stages, desk,
                track, ends, push, extent, rel0, work,
            )  # fmt: skip
            if code != OK:
                where[0] = singular
                return code, count, events, t
            relative_pose(model.pair, ends[0], ends[1], rel)
            happens = False
            who = nowhere
            if switching:
                margin, who = smallest_margin(model, segment, strength, rel)
                relative_pose(model.pair, q, v, before)
                high = h
                if not margin < -rounding:
                    dip = first_sign(model, segment, strength, q, v, ends[0], ends[1], before, rel, h, rounding)
                    if dip < 1.0:
                        high = dip * h
                        copy_state(state, kept)
                        code, _, singular = advance(
                            model, tables[0], strength, segment, t, high, starting, kept, guess, newton_tolerance,
                            size, nowhere, desk, track, trial, push, extent, rel0, work,
                        )  # fmt: skip
                        relative_pose(model.pair, trial[0], trial[1], rel)
                        margin, who = smallest_margin(model, segment, strength, rel)
                happens = margin < -rounding
                if happens:
                    low = 0.0
                    at_low, _ = smallest_margin(model, segment, strength, before)
                    at_low = max(at_low, rounding)
                    at_high = margin
                    side = 0
                    for visit in range(100):
                        if high - low <= 4e-16 * (abs(t) + h) or at_high >= -50.0 * rounding:
                            break
                        aim = 5.0 * rounding  # behind the switch, by more than rounding
                        middle = (low * (at_high + aim) - high * (at_low + aim)) / (at_high - at_low)
                        if visit > 15 and visit % 2 == 0:
                            middle = 0.5 * (low + high)
                        if middle <= low or middle >= high:
                            middle = 0.5 * (low + high)
                            if middle <= low or middle >= high:
                                break
                        copy_state(state, kept)
                        code, _, singular = advance(
                            model, tables[0], strength, segment, t, middle, starting, kept, guess, newton_tolerance,
                            size, nowhere, desk, track, trial, push, extent, rel0, work,
                        )  # fmt: skip
                        if code != OK:
                            where[0] = singular
                            return code, count, events, t
                        relative_pose(model.pair, trial[0], trial[1], rel)
                        value, who = smallest_margin(model, segment, strength, rel)
                        if value < -rounding:
                            high = middle
                            at_high = value
                            if side == 1:
                                at_low *= 0.5
                            side = 1
                        else:
                            low = middle
                            at_low = max(value, rounding)
                            if side == -1:
                                at_high *= 0.5
                            side = -1
                    h = high
                    lands = lands and t + h >= end
                    code, used, singular = advance(
                        model, tables[0], strength, segment, t, h, starting, state, guess, newton_tolerance, size,
                        stages, desk, track, ends, push, extent, rel0, work,
                    )  # fmt: skip
                relative_pose(model.pair, ends[0], ends[1], rel)
            finite = True
            for d in range(n):
                finite = finite and np.isfinite(ends[0, d]) and np.isfinite(ends[1, d])
            if not finite:
                return NON_FINITE, count, events, t
            for p in range(n_pair):
                motion[p] = max(motion[p], deflection(rel, rel0, model.reach, p))
            if where[1] < 0:
                relative_pose(model.pair, q, v, before)
                where[1] = meeting(model, segment, t, strength, before, rel)
            done += 1.0
            known += 1
            t = end if lands else (t + h if happens else begin + h * done)
            # x of the steps before; in the first ones it counts as having been constant
            for back in range(3):
                source = 2 - back - 1
                for d in range(n):
                    guess[2 - back, d] = guess[source, d] if source >= 0 else state[3, d]
            if known <= 3:
                for d in range(n):
                    slope = ends[3, d] - state[3, d]
                    guess[0, d] = ends[3, d] - slope
                    guess[1, d] = ends[3, d] - 2.0 * slope
                    guess[2, d] = ends[3, d] - 3.0 * slope
            copy_state(ends, state)
            track.index[count, 1] = count - 1
            track.index[count, 2] = segment
            track.index[count, 3] = events
            stages += used
            count += 1
            track.index[count, 0] = stages
            keep_state(track, count, t, q, v, push[0], push[1])
            work[ACCEPTED] += 1
            if happens:
                balance(model, strength, segment, t, q, v, no, desk, a0, lam)
                events = log_switches(
                    model, strength, segment, t, q, v, desk, a0, lam, track, count, events, rounding, work
                )
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
            track.index[count, 3] = events
    track.index[count + 1, 0] = stages  # no step follows (`weights_of`)
    return OK, count, events, t


@kernel
def copy_state(source, target):  # type: ignore[no-untyped-def]
    """target (4, n) = source."""
    for i in range(4):
        for d in range(source.shape[1]):
            target[i, d] = source[i, d]
