"""One step of generalized-alpha of a general scene (formulas in `generalized_alpha`)."""

from typing import Any

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.dynamics.accelerations import OF_STEP, newton_correction, solve_accelerations, subtract_matrices
from mdstopo.general.dynamics.projection import project
from mdstopo.general.model.bundles import bundle
from mdstopo.general.steps.step_history import copy_vector, keep_energy, keep_stage
from mdstopo.integrators.springs_gauss_equations import CLOSELY
from mdstopo.integrators.springs_generalized_alpha import MOST_CORRECTIONS, RESOLVED, RESTART, weights_of
from mdstopo.integrators.steps import FORCES, NEWTON, NEWTON_FAILED, NON_FINITE, OK, SINGULAR, TANGENTS
from mdstopo.mechanics.kinematics.kinematics_interface import (
    advance_coordinates,
    deflection,
    drive_state,
    motion_weights,
    noise_of,
    retract,
    shift_further,
    shift_tangents,
    turned_pose,
)

#: rows of what a step hands to the next beside coordinates: velocities, accelerations, the method's auxiliary ones
VELOCITY, ACCELERATION, AUXILIARY = range(3)


class StepRoom:
    """Scratch of `advance`, made once by `make_step_room`: q (n_q,), vectors (8, n), lam and row (n_row,), scale
    (n_pair,)."""

    def __init__(self, *_arrays: Any) -> None: ...


bundle(StepRoom, ("q", "vectors", "lam", "row", "scale"))


@kernel
def make_step_room(model):
    """A `StepRoom`."""
    n_row = model.size[0]
    return StepRoom(
        np.empty(model.q0.shape[0]), np.empty((8, model.mass.shape[0])), np.empty(n_row), np.empty(n_row),
        np.empty(model.pair.shape[0]),
    )  # fmt: skip


@kernel
def rate_of(model, workspace):
    """An estimate of the angular frequency of the fastest vibration at the state in the workspace, rad/s."""
    n = model.mass.shape[0]
    inverse = np.zeros(n)
    for d in range(n):
        if model.free[d] != 0:
            inverse[d] = 1.0 / model.mass[d]
    x = np.empty(n)
    y = np.empty(n)
    rate = 0.0
    for kind in range(2):  # as `integrators.springs_gauss_equations.fastest_rate` does
        for d in range(n):
            x[d] = np.sqrt(inverse[d]) * (1.0 + 0.1 * (d % 7))
        value = 0.0
        for _ in range(12):
            last = value
            size = 0.0
            for d in range(n):
                if inverse[d] > 0.0:
                    size += x[d] * x[d] / inverse[d]
            value = np.sqrt(size)
            if value == 0.0 or abs(value - last) <= CLOSELY * value:
                break
            for d in range(n):
                x[d] /= value
                y[d] = 0.0
            subtract_matrices(model, workspace.k if kind == 0 else workspace.c, x, y)
            for d in range(n):
                x[d] = inverse[d] * y[d]
        rate = np.sqrt(value) if kind == 0 else max(rate, 1.5 * value)
    return rate


@kernel
def advance(
    model,
    radius,
    member_state,
    segment,
    t,
    h,
    starting,
    q0,
    state,
    guess,
    newton_tolerance,
    size,
    o,
    workspace,
    history,
    end_q,
    ends,
    push,
    extent,
    rel0,
    room,
    work,
):
    """One step of the method, by Newton's iteration.

    Constant:
      model: the compiled scene.
      radius: the spectral radius.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      segment, t, h: segment of `model.times`, time at the start (s), length of the step (s).
      starting: whether a and x are to be made here.
      guess (3, n): x of the three steps before, for the first iterate.
      newton_tolerance: correction at which Newton's iteration ends, relative to the motion.
      size: of the scene (m).
      o: number of the first stage to be kept; below 0 none is.
      extent (2, n_pair): how far each pair has moved so far from its pose at the start, and its noise (m).
      rel0 (n_pair, POSE): relative poses at the start.
      q0 (n_q,): coordinates at the start of the step.
    In and out:
      state (3, n): v, a, x at the start of the step; the last two are set where `starting`.
    Out:
      history: the history of steps, to which the stages are written.
      end_q (n_q,), ends (3, n): coordinates, and v, a, x at the end; q, v on the joints.
      push (2, n_row): the multipliers that put them there (`projection`).
      workspace: workspace of a balance, overwritten.
      room: scratch (`StepRoom`).
      work (WORK,): counts of work, added to.

    Returns a code (`integrators.steps`), the number of stages, and the place of a singular unknown, or -1.
    """
    n = state.shape[1]
    n_row = model.size[0]
    e1, e2, e3, beta, gamma, lag = weights_of(radius)
    yes = np.bool_(True)
    q = room.q
    rows = room.vectors
    v = rows[0]
    way = rows[1]
    shift = rows[2]
    now = rows[3]
    x_now = rows[4]
    balanced = rows[5]
    delta = rows[6]
    weight = rows[7]
    v0 = state[VELOCITY]
    a = state[ACCELERATION]
    x = state[AUXILIARY]
    lam = room.lam
    row = room.row
    scale = room.scale
    lam[:] = 0.0
    stages = 0
    if starting:
        copy_vector(q0, q)
        copy_vector(v0, v)
        singular = solve_accelerations(model, member_state, segment, t, q, v, yes, workspace, a, lam)
        work[FORCES] += 1
        work[TANGENTS] += 1
        if singular >= 0:
            return SINGULAR, stages, singular
        if o >= 0:
            keep_stage(history, o, t, q, v, a, lam, workspace, yes)
        stages = 1
        copy_vector(a, x)
        if lag > 0.0 and h * rate_of(model, workspace) < RESOLVED:
            ahead = lag * h
            advance_coordinates(model, q0, v0, a, ahead, q)
            for d in range(n):
                v[d] = v0[d] + ahead * a[d]
            singular = solve_accelerations(model, member_state, segment, t + ahead, q, v, yes, workspace, balanced, lam)
            work[FORCES] += 1
            work[TANGENTS] += 1
            if singular >= 0:
                return SINGULAR, stages, singular
            if o >= 0:
                keep_stage(history, o + 1, t + ahead, q, v, balanced, lam, workspace, yes)
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
                way[d] = h * (v0[d] + h * ((0.5 - beta) * x[d] + beta * x_now[d]))
                v[d] = v0[d] + h * ((1.0 - gamma) * x[d] + gamma * x_now[d])
            retract(model, q0, way, q)
            previous = np.inf
        singular = solve_accelerations(model, member_state, segment, t + h, q, v, yes, workspace, balanced, lam)
        work[FORCES] += 1
        work[TANGENTS] += 1
        work[NEWTON] += 1
        if singular >= 0:
            return SINGULAR, stages, singular
        for d in range(n):
            if model.free[d] == 0:
                now[d] = balanced[d]
            balanced[d] -= now[d]
        shift_tangents(model, q0, q, workspace.tangents[OF_STEP])
        newton_correction(model, workspace, h * h * beta * e1, h * gamma * e1, balanced, delta, row)
        rounding = 1e-8
        for p in range(model.pair.shape[0]):
            turned_pose(model, p, workspace.turned, q, v, workspace.rel)
            reached = max(extent[0, p], deflection(model, workspace.rel, rel0, p))
            lost = noise_of(model, extent[1], workspace.rel, q, p)
            scale[p] = max(reached, 1e3 * lost)
            rounding = max(rounding, 100.0 * lost / scale[p])
        motion_weights(model, rel0, scale, weight)
        e = 0.0
        for d in range(n):
            shift[d] = h * h * beta * e1 * delta[d]
            now[d] += delta[d]
            x_now[d] = e1 * now[d] + e2 * a[d] - e3 * x[d]
            v[d] += h * gamma * e1 * delta[d]
            change = weight[d] * abs(shift[d])
            if not change <= e and not np.isnan(e):
                e = change
        shift_further(model, q0, way, shift, q)
        if e <= newton_tolerance or (e >= 0.5 * previous and e < rounding):
            break
        previous = e
        if newton >= MOST_CORRECTIONS or (newton >= RESTART and not e < np.inf):
            return (NEWTON_FAILED if e < np.inf else NON_FINITE), stages, -1
        newton = RESTART if not e < np.inf else newton + 1
    drive_state(model, segment, t + h, q, v)
    if o >= 0:
        # the multipliers that belong to the corrected accelerations
        for r in range(n_row):
            lam[r] += row[r]
        keep_stage(history, o + stages, t + h, q, v, now, lam, workspace, yes)
        keep_energy(model, history, o + stages, v, workspace)
    copy_vector(q, end_q)
    copy_vector(v, ends[VELOCITY])
    copy_vector(now, ends[ACCELERATION])
    copy_vector(x_now, ends[AUXILIARY])
    singular = project(model, size, end_q, ends[VELOCITY], workspace, push[0], push[1])
    return (SINGULAR if singular >= 0 else OK), stages + 1, singular
