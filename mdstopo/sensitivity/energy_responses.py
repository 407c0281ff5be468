"""Objectives, their gradients and the motion between steps, from finished steps of whatever integrator.

`evaluate_responses` and `dense` are compiled entries. They take the packed model; tables, the history of steps and its
sizes (`integrators.driver`); and the tag of the method.
"""

import math

import numpy as np

from mdstopo.compiler.jit import entry, part
from mdstopo.integrators.springs_gauss import TAG as GAUSS
from mdstopo.integrators.steps import ENERGY, FIRST, FORCES, SEGMENT, SPRINGS, TIME, Q, V, carve, solved_to, step_at
from mdstopo.integrators.steps_interface import point_of, steps_of
from mdstopo.mechanics.active_members import active_members
from mdstopo.mechanics.kinematics.planar_forces import add_loads
from mdstopo.mechanics.kinematics.planar_poses import POSE, add_pair_force, copy_rows, relative_pose
from mdstopo.mechanics.kinematics.planar_scales import deflection
from mdstopo.mechanics.laws.spring import elongation_of, meeting_in, passing_in, shortest_in
from mdstopo.mechanics.laws.spring_grid import grid_shortest
from mdstopo.mechanics.passes import SUM_T, SUM_X, SUM_Y, SUMS, member_sums, springs_of, unscale_gradient
from mdstopo.scene.packing import unpack
from mdstopo.scene.springs_model import (
    DESIGN,
    EXCESS,
    L0,
    PAIR,
    PX,
    PY,
    QX,
    QY,
    SCALED_PRELOAD,
    SCALED_STIFFNESS,
    START,
    STOP,
    WIDTH,
)
from mdstopo.sensitivity.springs_adjoint import energy_rows

#: change of the speed with which the ends of a member pass, in tolerances, that may not be left out
UNSEEN = 100.0
#: share of the largest stored energy that rounding of lengths may make up, where the tolerance is not larger; and the
#: roundings from which on an elongation is one: below that a member may as well be as long as at the start
VISIBLE, ELONGATED = 1e-5, 100.0


@entry
def evaluate_responses(
    tag,
    ints,
    floats,
    tables,
    alpha,
    damped,
    settings,
    limits,
    count,
    reductions,
    gradient,
    room,
    room_ints,
    strength,
    padded,
    rows,
    row_counts,
    gradients,
    meeting,
    work,
):
    """Every objective of the load case, from the steps that `simulate` left in room.

    Constant:
      tag: of the integrator (`steps_interface.steps_of`).
      ints, floats: the packed model.
      tables: constant arrays of the integrator.
    In:
      alpha (N,): the design.
      damped: whether any force depends on velocity.
      settings (4,): tolerance, Newton tolerance, fixed step (s) or not above 0, closeness of competing peaks.
      limits (3,): steps allowed, room for steps, room for stages.
      count: steps that were taken.
      reductions (n_obj,): codes of the objectives' reductions.
      gradient: whether gradients are wanted.
      room, room_ints: the steps (`steps.carve`), with tangents where gradients are wanted.
      strength (3 or more, M_padded): as the run left them (N/m, N s/m, N).
    Out:
      rows (n_obj, R, 4): time (s), value, step, fraction of it.
      row_counts (n_obj,): how many rows each objective has.
      gradients (n_obj, R, N): by alpha.
      meeting (3,): of `find_meeting` and `find_unresolved`.
      work (WORK,): counts of work, added to.
    Room:
      padded (R, M_padded): overwritten.
    """
    model = unpack(ints, floats)
    motion, own, left = active_members(model, strength, np.bool_(False))
    turning = model.load_body.shape[0] > 0
    n = model.q0.shape[0]
    steps = steps_of(tag, carve(room, room_ints, n, model.pair.shape[0], limits[1], limits[2], damped, turning))
    pose = np.empty((steps.index[count, FIRST], model.pair.shape[0], POSE))
    for i in range(pose.shape[0]):
        relative_pose(model.pair, model.home, steps.stage[i, 0], steps.stage[i, 1], pose[i])
    find_meeting(model, strength, steps, count, pose, settings, meeting)
    find_unresolved(model, strength, steps, count, pose, len(tag) == len(GAUSS), max(VISIBLE, settings[0]), meeting)
    accuracy = solved_to(settings[0], settings[2])
    for j in range(reductions.shape[0]):
        row_counts[j] = energy_rows(
            model, motion, tables, own, steps, count, pose, damped, reductions[j], settings[3], gradient, accuracy,
            rows[j], padded, work,
        )  # fmt: skip
        if gradient:
            for r in range(row_counts[j]):
                unscale_gradient(model, alpha, padded[r], gradients[j, r])
    work[SPRINGS] += left * work[FORCES]


@part
def find_meeting(model, strength, steps, count, pose, settings, meeting):
    """Find a member whose ends meet while it carries a force: its direction and its force are lost there.

    A pair that moves by some distance shortens no member by more. So lengths are computed only where the motion since
    they were last known could have used up the shortest, and single members only where it could have done so within
    one stretch between stages.

    Between the last node of a collocation window and the first of the next no force is computed. A member that turns
    round there unseen, and by whose force that matters to UNSEEN tolerances, counts as one that meets.

    Constant:
      model: the compiled scene with all members, whose padding repeats them: other padding would have a length of its
        own.
      strength (3 or more, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
    In:
      steps: what the integrator kept.
      count: steps that were taken.
      pose (S, n_pair, POSE): relative poses of the stages.
      settings (4,): of `evaluate_responses`; the tolerance and the fixed step are read.
    Out:
      meeting (2 or more,): index of the member in the padded arrays, or -1; where there is one, then the number of
        the stage before which its ends meet, or the number of stages where they meet after the last one.
    """
    meeting[0] = -1
    pair = model.pair
    block = model.block
    m = model.member
    n_pair = pair.shape[0]
    stages = steps.index[count, FIRST]
    before = np.empty((n_pair, POSE))
    rel = np.empty((n_pair, POSE))
    spare = np.empty(n_pair)
    step = 0
    time = model.times[0]
    for p in range(n_pair):
        spare[p] = model.shortest[p]
    relative_pose(pair, model.home, model.q0, model.v0, before)
    for i in range(steps.index[0, FIRST], stages + 1):
        was = time
        between = False
        if i == stages:
            relative_pose(pair, model.home, steps.state[count, 0], steps.state[count, 1], rel)
            time = steps.t[count]
        else:
            copy_rows(pose[i], rel)
            time = steps.scalar[i, TIME]
            while step < count and steps.index[step, FIRST] < i:
                step += 1
            between = steps.index[step, FIRST] == i and time > was and not settings[2] > 0.0
        for p in range(n_pair):
            moved = deflection(rel, before, model.reach, p)
            spare[p] -= moved
            if spare[p] > 0.0:
                continue
            shortest = np.inf
            for k in range(block.shape[0]):
                lo = block[k, START]
                hi = block[k, STOP]
                if block[k, PAIR] == p:
                    shortest = min(shortest, _shortest(m, lo, hi, block[k, WIDTH], rel[p]))
            spare[p] = shortest
            for k in range(block.shape[0]):
                if shortest > moved or block[k, PAIR] != p:
                    continue
                lo = block[k, START]
                hi = block[k, STOP]
                j = meeting_in(
                    m[0, lo:hi], m[1, lo:hi], m[2, lo:hi], m[3, lo:hi], m[4, lo:hi], strength[SCALED_STIFFNESS, lo:hi],
                    strength[SCALED_PRELOAD, lo:hi], before[p], rel[p],
                )  # fmt: skip
                if j < 0 and between:
                    ease = (time - was) ** 2 * (model.inv_mass[3 * pair[p, 0]] + model.inv_mass[3 * pair[p, 1]])
                    j = passing_in(
                        m[0, lo:hi], m[1, lo:hi], m[2, lo:hi], m[3, lo:hi], m[4, lo:hi],
                        strength[SCALED_STIFFNESS, lo:hi], strength[SCALED_PRELOAD, lo:hi], before[p], rel[p],
                        0.5 * UNSEEN * settings[0] / ease,
                    )  # fmt: skip
                if j >= 0:
                    meeting[0] = lo + j
                    meeting[1] = i
                    return
        copy_rows(rel, before)


@part
def find_unresolved(model, strength, steps, count, pose, collocated, visible, meeting):
    """Find the member by which rounding leaves the largest stored energy no digits to speak of.

    An elongation is known to u X where bodies have moved by X since the start, u = 2.2e-16; an energy k Delta^2/2 then
    to k Delta u X.
    By Cauchy and Schwarz the sum of these is at most u X sqrt(2 sum(k) E), which needs no pass over the members and
    nearly always is small enough.

    Constant:
      model: the compiled scene.
      strength (3 or more, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
    In:
      steps: what the integrator kept.
      count: steps that were taken.
      pose (S, n_pair, POSE): relative poses of the stages.
      collocated: whether all stages lie on the motion, as those of windows do, or only the first of each step.
      visible: share of the energy that is too much.
    Out:
      meeting (3,): of which [2] is written, the member's index in the padded arrays, or -1.
    """
    meeting[2] = -1
    best = steps.index[0, FIRST]
    for step in range(count):
        first = steps.index[step, FIRST]
        for i in range(first, steps.index[step + 1, FIRST] if collocated else first + 1):
            if steps.scalar[i, ENERGY] > steps.scalar[best, ENERGY]:
                best = i
    energy = steps.scalar[best, ENERGY]
    if not energy > 0.0:
        return
    size = 0.0
    for p in range(model.reach.shape[0]):
        r = pose[best, p]
        size = max(size, math.hypot(r[10], r[11]) + model.reach[p] * math.hypot(r[12], r[13]))
    for d in range(0, model.q0.shape[0], 3):
        size = max(size, abs(steps.stage[best, Q, d]), abs(steps.stage[best, Q, d + 1]))
    rounding = 2.2e-16 * size
    stiffness = 0.0
    for b in range(model.block.shape[0]):
        if model.block[b, DESIGN] >= 0:
            stiffness += _sum(strength[SCALED_STIFFNESS, model.block[b, START] : model.block[b, STOP]])
    if rounding * math.sqrt(2.0 * stiffness / energy) <= visible:
        return
    m = model.member
    lost = 0.0
    most = 0.0
    elongated = False
    for b in range(model.block.shape[0]):
        if model.block[b, DESIGN] < 0:
            continue
        r = pose[best, model.block[b, PAIR]]
        for i in range(model.block[b, START], model.block[b, STOP]):
            x = r[0] + r[2] * m[QX, i] - r[3] * m[QY, i] - m[PX, i]
            y = r[1] + r[3] * m[QX, i] + r[2] * m[QY, i] - m[PY, i]
            ux = r[10] + (r[12] * m[QX, i] - r[13] * m[QY, i])
            uy = r[11] + (r[13] * m[QX, i] + r[12] * m[QY, i])
            elongation = abs(elongation_of(x, y, math.sqrt(x * x + y * y), ux, uy, m[L0, i], m[EXCESS, i]))
            force = strength[SCALED_STIFFNESS, i] * elongation
            lost += force * rounding
            elongated = elongated or (force > 0.0 and elongation > ELONGATED * rounding)
            if force > most:
                most = force
                meeting[2] = i
    if not (elongated and lost > visible * energy):  # where nothing is elongated, nothing is stored
        meeting[2] = -1


@part
def _sum(k):
    """Sum of k, whose length is a multiple of four, in four parts that do not wait for one another."""
    a = 0.0
    b = 0.0
    c = 0.0
    d = 0.0
    for i in range(0, k.shape[0], 4):
        a += k[i]
        b += k[i + 1]
        c += k[i + 2]
        d += k[i + 3]
    return (a + b) + (c + d)


@part
def _shortest(m, lo, hi, width, r):
    """Smallest length of the members lo..hi, rows of a grid where there is a width, at relative pose r."""
    px = m[0, lo:hi]
    py = m[1, lo:hi]
    qx = m[2, lo:hi]
    qy = m[3, lo:hi]
    if width > 0:
        whole = (hi - lo) // width * width  # without what pads the block
        return grid_shortest(px[:whole], py[:whole], qx, qy, width, r[0], r[1], r[2], r[3])
    return shortest_in(px, py, qx, qy, r[0], r[1], r[2], r[3])


@entry
def dense(tag, ints, floats, tables, damped, limits, count, room, room_ints, strength, times, out, work):
    """The motion at any times: q, v, and a by the equations of motion, right-continuous at kinks.

    Constant:
      tag: of the integrator (`steps_interface.steps_of`).
      ints, floats: the packed model.
      tables: constant arrays of the integrator.
    In:
      damped: whether any force depends on velocity.
      limits (3,): steps allowed, room for steps, room for stages.
      count: steps that were taken.
      room, room_ints: the steps (`steps.carve`).
      strength (3 or more, M_padded): as the run left them (N/m, N s/m, N).
      times (T,): within what was simulated (s).
    Out:
      out (3, T, n): q, v, a (m, rad and their derivatives).
      work (WORK,): counts of work, added to.
    """
    model = unpack(ints, floats)
    turning = model.load_body.shape[0] > 0
    n = model.q0.shape[0]
    n_pair = model.pair.shape[0]
    steps = steps_of(tag, carve(room, room_ints, n, n_pair, limits[1], limits[2], damped, turning))
    rel = np.empty((1, n_pair, POSE))
    sums = np.empty((1, n_pair, SUMS))
    f = np.empty(n)
    for i in range(times.shape[0]):
        t = times[i]
        k = step_at(steps.t, count, t)
        if k + 1 < count and steps.t[k + 1] == t:
            k += 1  # right-continuous
        h = steps.t[k + 1] - steps.t[k]
        q = out[0, i]
        v = out[1, i]
        c = (t - steps.t[k]) / h
        if t == steps.t[k] or t == steps.t[k + 1]:
            state = steps.state[k if t == steps.t[k] else k + 1]
            for d in range(n):
                q[d] = state[Q, d]
                v[d] = state[V, d]
        else:
            point_of(model, tables, strength, steps, count, k, c, damped, q, v, work)
        relative_pose(model.pair, model.home, q, v, rel[0])
        springs = springs_of(model)
        member_sums(springs, strength, rel, np.int64(1), np.bool_(False), sums)
        f[:] = 0.0
        add_loads(model, steps.index[k, SEGMENT], t, q, f)
        for p in range(n_pair):
            add_pair_force(model.pair, rel[0], p, sums[0, p, SUM_X], sums[0, p, SUM_Y], sums[0, p, SUM_T], f)
        for d in range(n):
            out[2, i, d] = model.inv_mass[d] * f[d]
