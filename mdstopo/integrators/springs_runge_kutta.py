"""Explicit Runge-Kutta methods, adaptive: Nystroem of order 12 where nothing depends on velocity, else order 8.

The error of a step is that of the embedded method, measured as displacement at the attachment points relative to the
motion so far (a velocity counts with what it moves in a step). Between steps the motion is a partial step from the
step's start: dense output of the method's own order, and what a peak inside a step is differentiated through. The
partial step is kept behind the others, as step `count + 1` (see `parent_of`).
"""

from collections import namedtuple

import numpy as np

from mdstopo.compiler.jit import entry, kernel
from mdstopo.integrators.runge_kutta_tables import BB, E2_Q, E2_V, E_Q, E_V, ORDERS, STAGES, B, C
from mdstopo.integrators.steps import (
    ACCEPTED,
    FIELDS,
    FIRST,
    FORCES,
    HELD_SHORT,
    LIMITED,
    NEEDS_ROOM,
    NON_FINITE,
    OK,
    PARENT,
    REJECTED,
    SEGMENT,
    STABLE,
    STEP_LIMIT,
    STEP_TOO_SMALL,
    TANGENTS,
    TURN,
    add_preloads,
    carve,
    decay_rate,
    keep_stage,
    keep_state,
    lasting,
)
from mdstopo.mechanics.active_members import active_members
from mdstopo.mechanics.assembly import forces
from mdstopo.mechanics.kinematics.planar_poses import POSE, relative_pose
from mdstopo.mechanics.kinematics.planar_scales import (
    deflection,
    gross_loads,
    largest_turn,
    motion_weights,
    noise_of,
    rounding_of_pairs,
)
from mdstopo.mechanics.passes import STORED, SUMS, member_sums, scale_members, springs_of
from mdstopo.scene.packing import unpack
from mdstopo.scene.springs_model import DESIGN, PAIR, SCALED_STIFFNESS, START, STOP

RungeKuttaSteps = namedtuple("RungeKuttaSteps", FIELDS)  # type: ignore[misc]
TAG = (0, 0)

MOST_STAGES = max(STAGES)
#: error of a step relative to the tolerance of the motion: the errors of many steps add up, and a gradient's error is
#: larger than the motion's (over 200 random scenes at most 17 times; a tenth costs about 15 % more steps)
ERROR_SHARE = 0.1


@kernel
def advance(
    model,
    table,
    s,
    strength,
    segment,
    t,
    h,
    q0,
    v0,
    tangent,
    damped,
    o,
    rel,
    sums,
    f,
    k,
    c,
    turn,
    q,
    v,
    a,
    steps,
    ends,
    work,
):
    """Take one step of an explicit method.

    Constant:
      model: the compiled scene.
      table (3, s_max, s_max): of `runge_kutta_tables`, for this method.
      s: number of stages.
      strength (3, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
    In:
      segment: of the loads.
      t, h: start and length of the step (s).
      q0, v0 (n,): coordinates and velocities at its start.
      tangent: whether tangents are wanted.
      damped: whether any force depends on velocity.
      o: number of the first stage in `steps`, where stages are kept; -1: they are not.
    Out:
      q, v, a (s or more, n): the stages.
      steps: with o >= 0 the stages are kept there.
      ends (2, n): q and v at the end.
      work (WORK,): counts of work, added to.
    Room:
      rel (1, n_pair, POSE), sums (1, n_pair, SUMS), f (1, n), k, c (1, n_pair, 6, 6), turn (1, n): what the force
      balance of a stage sees; turn has to be zero where no load turns.
    """
    n = q0.shape[0]
    aa = table[0]
    first = table[1]
    vectors = table[2]
    t_one = np.empty(1)
    for i in range(s):
        for d in range(n):
            q[i, d] = q0[d] + h * vectors[C, i] * v0[d]
            v[i, d] = v0[d]
        for j in range(i):
            w = h * h * aa[i, j]
            u = h * first[i, j]
            if w != 0.0:
                for d in range(n):
                    q[i, d] += w * a[j, d]
            if u != 0.0:
                for d in range(n):
                    v[i, d] += u * a[j, d]
        t_one[0] = t + h * vectors[C, i]
        forces(model, strength, segment, np.int64(1), t_one, q[i:], v[i:], tangent, damped, rel, sums, f, k, c, turn)
        for d in range(n):
            a[i, d] = model.inv_mass[d] * f[0, d]
        if o >= 0:
            keep_stage(
                o + i, t_one[0], q[i], v[i], a[i], rel[0], sums[0], k[0], c[0], turn[0], steps.scalar, steps.stage,
                steps.pull, steps.K, steps.C, steps.turn,
            )  # fmt: skip
    work[FORCES] += s
    if tangent:
        work[TANGENTS] += s
    for d in range(n):
        position = q0[d] + h * v0[d]
        speed = v0[d]
        for j in range(s):
            position += h * h * vectors[BB, j] * a[j, d]
            speed += h * vectors[B, j] * a[j, d]
        ends[0, d] = position
        ends[1, d] = speed


@kernel
def step_error(vectors, s, h, longest, a, weight):
    """Estimate the error of a step relative to the motion; NaN where one appears.

    vectors (7 or more, s_max): weights of the stages, plane VECTORS of the method's table.
    s: number of stages.
    h: length of the step (s).
    longest: step so far (s), see `lasting`.
    a (s or more, n): accelerations at the stages.
    weight (n,): of `motion_weights`.
    """
    later = lasting(h, longest)
    worst = 0.0
    coarse = 0.0
    for d in range(weight.shape[0]):
        eq = 0.0
        ev = 0.0
        fq = 0.0
        fv = 0.0
        for j in range(s):
            eq += vectors[E_Q, j] * a[j, d]
            ev += vectors[E_V, j] * a[j, d]
            fq += vectors[E2_Q, j] * a[j, d]
            fv += vectors[E2_V, j] * a[j, d]
        value = h * h * weight[d] * max(abs(eq), later * abs(ev))
        other = h * h * weight[d] * max(abs(fq), later * abs(fv))
        if not np.isfinite(value):
            return np.nan
        worst = max(worst, value)
        coarse = max(coarse, other)
    if coarse > 0.0 and worst > 0.0:  # two estimates of low order make one of high order
        worst = worst * worst / np.sqrt(worst * worst + 0.01 * coarse * coarse)
    return worst


@entry
def simulate(ints, floats, tables, alpha, damped, tangent, settings, limits, room, room_ints, strength, work):
    """Integrate the motion of a design over model.times, step after step.

    Constant:
      ints, floats: the packed model.
      tables (2, 3, s_max, s_max): of `runge_kutta_tables`.
    In:
      alpha (N,): the design.
      damped: whether any force depends on velocity.
      tangent: whether tangents are kept for a reverse sweep.
      settings (3 or more,): tolerance, the error of a step relative to the motion; one that is not used; fixed step (s;
        > 0: no error control).
      limits (3,): steps allowed, room for steps, room for stages.
    Out:
      room, room_ints: the steps (`steps.carve`); there has to be room for two more than are taken (`point_of`).
      strength (3 or more, M_padded): stiffness, damping and preload times alpha^mu; see `active_members` on further
        rows.
      work (WORK,): counts of work, added to.

    Returns the code, the number of steps and the time reached (s); NEEDS_ROOM asks for more room.
    """
    whole = unpack(ints, floats)
    scale_members(whole, alpha, strength)
    model, strength, _ = active_members(whole, strength, np.bool_(True))
    tolerance = ERROR_SHARE * settings[0]
    fixed_step = settings[2]
    n = model.q0.shape[0]
    n_pair = model.pair.shape[0]
    turning = model.load_body.shape[0] > 0
    steps = RungeKuttaSteps(*carve(room, room_ints, n, n_pair, limits[1], limits[2], damped, turning))
    method = 1 if damped else 0
    s = STAGES[method]
    order = ORDERS[method]
    table = tables[method]
    pair = model.pair
    times = model.times
    reach = model.reach
    rel = np.empty((1, n_pair, POSE))
    sums = np.empty((1, n_pair, SUMS))
    f = np.empty((1, n))
    k = np.empty((1, n_pair, 6, 6))
    c = np.empty((1, n_pair, 6, 6))
    turn = np.zeros((1, n))
    q = np.empty((MOST_STAGES, n))
    v = np.empty((MOST_STAGES, n))
    a = np.empty((MOST_STAGES, n))
    ends = np.empty((2, n))
    weight = np.empty(n)
    q0 = np.empty(n)
    v0 = np.empty(n)
    for d in range(n):
        q0[d] = model.q0[d]
        v0[d] = model.v0[d]
    rel0 = np.empty((n_pair, POSE))
    relative_pose(pair, model.home, q0, v0, rel0)
    motion = np.zeros(n_pair)
    noise = np.empty(n_pair)
    scale = np.empty(n_pair)
    # a pair that starts strained moves on the scale of its mean strain
    relative_pose(pair, model.home, q0, v0, rel[0])
    springs = springs_of(model)
    member_sums(springs, strength, rel, np.int64(1), np.bool_(False), sums)
    work[FORCES] += 1
    for p in range(n_pair):
        scale[p] = 0.0
        for b in range(model.block.shape[0]):
            if model.block[b, PAIR] == p and model.block[b, DESIGN] >= 0:
                for i in range(model.block[b, START], model.block[b, STOP]):
                    scale[p] += strength[SCALED_STIFFNESS, i]
        if sums[0, p, STORED] > 0.0 and scale[p] > 0.0:
            motion[p] = np.sqrt(2.0 * sums[0, p, STORED] / scale[p])
    gross_loads(model, weight)
    add_preloads(model, strength, rel0, weight)
    rounding_of_pairs(model, model.inv_mass, rel0, v0, weight, scale, motion, noise)
    t = times[0]
    last_time = times[times.shape[0] - 1]
    span = last_time - t
    wanted = fixed_step if fixed_step > 0.0 else span
    keep_state(steps.t, steps.state, np.int64(0), t, q0, v0)
    moving = np.zeros(n)
    for d in range(n):
        if model.inv_mass[d] > 0.0:
            moving[d] = 1.0 / model.inv_mass[d]
    last_v = np.zeros(n)
    last_a = np.zeros(n)
    decay = 0.0  # the rate at which dampers damp, as the last step tells
    limited = 0  # steps in a row that were as long as stability allows by it
    ended = 0.0  # length of the last step, if its last stage and the next step's first tell a rate (`decay_rate`)
    steps.index[0, FIRST] = 0
    count = 0
    stages = 0
    longest = 0.0
    for segment in range(times.shape[0] - 1):
        end = times[segment + 1]
        ended = 0.0
        while t < end:
            if count >= limits[0]:
                return STEP_LIMIT, count, t
            pieces = np.ceil((end - t) / wanted - 1e-9)
            h = (end - t) / max(pieces, 1.0)
            lands = pieces <= 1.0
            if not h > 1e-14 * max(abs(t), abs(end)) or h < 1e-15 * span:
                return STEP_TOO_SMALL, count, t
            if count + 4 > steps.t.shape[0] or stages + 2 * s > steps.scalar.shape[0]:
                return NEEDS_ROOM, count, t
            advance(
                model, table, s, strength, segment, t, h, q0, v0, tangent, damped, stages, rel, sums, f, k, c, turn,
                q, v, a, steps, ends, work,
            )  # fmt: skip
            if ended > 0.0:
                decay = decay_rate(moving, a[0], last_a, v[0], last_v)
                limited = limited + 1 if ended * decay > LIMITED else 0
                ended = 0.0
            widest = 0.0
            for p in range(n_pair):
                reached = motion[p]
                relative_pose(pair, model.home, ends[0], ends[1], rel[0])
                reached = max(reached, deflection(rel[0], rel0, reach, p))
                scale[p] = reached
                widest = max(widest, reached)
            for p in range(n_pair):
                lost = noise_of(pair, noise, rel[0], reach, ends[0], p)
                scale[p] = max(scale[p], 0.01 * widest, lost / tolerance, 1e3 * lost)
            motion_weights(pair, rel[0], reach, scale, weight)
            error = step_error(table[2], s, h, longest, a, weight)
            finite = True
            for d in range(n):
                finite = finite and np.isfinite(ends[0, d]) and np.isfinite(ends[1, d])
            if fixed_step > 0.0:
                if not finite:
                    return NON_FINITE, count, t
            else:
                if not finite or not error < 1e6:
                    wanted = 0.1 * h
                    work[REJECTED] += 1
                    continue
                change = 0.9 * (tolerance / max(error, 1e-30)) ** (1.0 / order)
                turned = largest_turn(pair, q0, ends[0])
                wanted = h * min(max(change, 0.1), 4.0, TURN / max(turned, 1e-300))
                if limited > 1 and wanted * decay > STABLE:
                    wanted = STABLE / decay
                    work[HELD_SHORT] += 1
                if error > tolerance or turned > 1.1 * TURN:
                    work[REJECTED] += 1
                    continue
            for p in range(n_pair):
                motion[p] = max(motion[p], deflection(rel[0], rel0, reach, p))
            t = end if lands else t + h
            longest = max(longest, h)
            if damped and not fixed_step > 0.0:
                ended = h
                for d in range(n):
                    last_v[d] = v[s - 1, d]
                    last_a[d] = a[s - 1, d]
            for d in range(n):
                q0[d] = ends[0, d]
                v0[d] = ends[1, d]
            steps.index[count, PARENT] = count - 1
            steps.index[count, SEGMENT] = segment
            stages += s
            count += 1
            steps.index[count, FIRST] = stages
            keep_state(steps.t, steps.state, count, t, q0, v0)
            work[ACCEPTED] += 1
    return OK, count, t
