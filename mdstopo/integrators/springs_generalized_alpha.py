"""Generalized-alpha in the form of Arnold and Bruels, in which accelerations too are of second order.

The accelerations a obey the equations of motion at every step's end; an auxiliary x carries the filter,

    (1 - alpha_m) x' + alpha_m x = (1 - alpha_f) a' + alpha_f a
    q' = q + h v + h^2 ((1/2 - beta) x + beta x'),   v' = v + h ((1 - gamma) x + gamma x'),   M a' = F(q', v', t')

with the weights that follow from the spectral radius r (Eq. 15 to 20 in this notation). x lags a by
(alpha_f - alpha_m) h, so at the start of every segment of the loads it is set to a - (a(lag) - a), a(lag) the
acceleration at the state which that acceleration alone would reach after the lag: second order at once, no
transient (a vibration that the steps do not resolve is left with x = a). These evaluations are stages of the step
like its end, so that their derivatives are exact too.

Newton's iteration takes the exact tangent and begins with x extrapolated from the steps before; with small
steps its first correction is rounding, and a step costs one pass over the members.
"""

from collections import namedtuple

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.integrators.banded import factorise, half_width, solve
from mdstopo.integrators.springs_gauss_equations import CLOSELY, fastest_rate
from mdstopo.integrators.steps import (
    ACCEPTED,
    FIELDS,
    FIRST,
    FORCES,
    NEEDS_ROOM,
    NEWTON,
    NEWTON_FAILED,
    NON_FINITE,
    OK,
    SEGMENT,
    STARTS,
    STEP_LIMIT,
    STEP_TOO_SMALL,
    TANGENTS,
    add_preloads,
    keep_stage,
    keep_state,
)
from mdstopo.mechanics.assembly import forces
from mdstopo.mechanics.kinematics.planar_poses import POSE
from mdstopo.mechanics.kinematics.planar_scales import (
    deflection,
    gross_loads,
    motion_weights,
    noise_of,
    rounding_of_pairs,
)
from mdstopo.mechanics.passes import K_XX, K_YY, STORED, SUMS

AlphaSteps = namedtuple("AlphaSteps", FIELDS)  # type: ignore[misc]
TAG = (0, 0, 0)

#: steps that an automatic choice takes at least
FEWEST_STEPS = 16
#: radians of the fastest vibration a step up to which the start looks for the slope of the acceleration
RESOLVED = 2.0
#: Newton corrections before the extrapolated start is given up, and before the step is
RESTART, MOST_CORRECTIONS = 8, 30


@kernel
def weights_of(radius):
    """Return e1, e2, e3, beta, gamma, lag (in steps) for a spectral radius 0..1; x' = e1 a' + e2 a - e3 x."""
    lag = (1.0 - radius) / (1.0 + radius)
    e1 = 1.0 / (2.0 - radius)
    return e1, radius * e1, (2.0 * radius - 1.0) * e1, 0.25 * (1.0 + lag) ** 2, 0.5 + lag, lag


@kernel
def effective_matrix(pair, inv_mass, k, c, turn, w_q, w_v, damped, turning, transposed, half, band, pivots):
    """Factorise I + M^-1 (w_q (K - load tangent) + w_v C) of one stage, or its transpose.

    In:
      pair (n_pair, 2): the bodies of each pair.
      inv_mass (n,): inverse masses and inertias (1/kg, 1/(kg m^2)).
      k, c (n_pair, 6, 6): -dF/dq and -dF/dv of each pair; c is read if damped.
      turn (n,): derivative of the loads by the angle of their body, read if they turn.
      w_q, w_v: how q and v follow the acceleration in a step (s^2, s).
      damped: whether any force depends on velocity.
      turning: whether loads turn.
      transposed: whether the transpose is wanted.
      half: of `banded.half_width`.
    Out:
      band (n, 3 half + 1), pivots (n,): the factors, for `banded.solve`.

    Returns False where the matrix is singular.
    """
    band[:] = 0.0
    for d in range(inv_mass.shape[0]):
        band[d, half] = 1.0
        if turning:
            angle = d - d % 3 + 2
            row = angle if transposed else d
            band[row, (d if transposed else angle) - row + half] -= w_q * inv_mass[d] * turn[d]
    for p in range(pair.shape[0]):
        for i in range(6):
            row = 3 * pair[p, i // 3] + i % 3
            for j in range(6):
                column = 3 * pair[p, j // 3] + j % 3
                if inv_mass[row] == 0.0 or inv_mass[column] == 0.0:
                    continue
                value = w_q * k[p, i, j]
                if damped:
                    value += w_v * c[p, i, j]
                value *= inv_mass[row]
                if transposed:
                    band[column, row - column + half] += value
                else:
                    band[row, column - row + half] += value
    return factorise(band, half, pivots)


@kernel
def integrate(model, tables, strength, damped, newton_tolerance, step, max_steps, steps, work):
    """Integrate from the first to the last of model.times, with equal steps in each segment of the loads.

    Constant:
      model: the compiled scene.
      tables (1,): the spectral radius.
      strength (3, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
    In:
      damped: whether any force depends on velocity.
      newton_tolerance: correction relative to the motion after which the next would be rounding.
      step: the longest step (s).
      max_steps: steps allowed.
    Out:
      steps: `AlphaSteps`.
      work (WORK,): counts of work, added to.

    Returns the code and the number of steps; NEEDS_ROOM, before any step is taken, where `steps` is too small (there
    are two more stages a segment).
    """
    n = model.q0.shape[0]
    n_pair = model.pair.shape[0]
    pair = model.pair
    inv_mass = model.inv_mass
    times = model.times
    n_segment = times.shape[0] - 1
    turning = model.load_body.shape[0] > 0
    e1, e2, e3, beta, gamma, lag = weights_of(tables[0])
    half = half_width(pair, inv_mass)
    band = np.empty((n, 3 * half + 1))
    pivots = np.empty(n, np.int64)
    rel = np.empty((1, n_pair, POSE))
    rel0 = np.empty((n_pair, POSE))
    sums = np.empty((1, n_pair, SUMS))
    k = np.empty((1, n_pair, 6, 6))
    c = np.empty((1, n_pair, 6, 6))
    turn = np.zeros((1, n))
    t_now = np.empty(1)
    q_now = np.empty((1, n))
    v_now = np.empty((1, n))
    f = np.empty((1, n))
    vectors = np.empty((6, n))
    q = vectors[0]
    v = vectors[1]
    a = vectors[2]
    a_now = vectors[3]
    delta = vectors[4]
    weight = vectors[5]
    x = np.zeros((4, n))
    x_now = np.empty(n)
    motion = np.zeros(n_pair)
    noise = np.zeros(n_pair)
    scale = np.empty(n_pair)

    one = np.int64(1)
    yes = np.bool_(True)
    no = np.bool_(False)
    steps.index[0, FIRST] = 0
    for d in range(n):
        q[d] = model.q0[d]
        v[d] = model.v0[d]
    keep_state(steps.t, steps.state, 0, times[0], q, v)
    wanted = 0.0
    for segment in range(n_segment):
        wanted += max(np.ceil((times[segment + 1] - times[segment]) / step - 1e-9), 1.0)
    if not wanted <= max_steps:
        return STEP_LIMIT, 0
    total = int(wanted)
    if total + 1 > steps.t.shape[0] or total + 2 * n_segment > steps.scalar.shape[0]:
        return NEEDS_ROOM, 0

    count = 0
    stages = 0
    for segment in range(n_segment):
        length = times[segment + 1] - times[segment]
        pieces = int(max(np.ceil(length / step - 1e-9), 1.0))
        h = length / pieces
        if not h > 1e-15 * max(abs(times[segment]), abs(times[segment + 1])):
            return STEP_TOO_SMALL, count
        for piece in range(pieces):
            known = min(piece, 3)
            t_end = times[segment] + h * (piece + 1) if piece + 1 < pieces else times[segment + 1]
            starting = (2 if lag > 0.0 else 1) if piece == 0 else 0
            # the stages of the start (counting down), then Newton's iterations of the end
            newton = -starting
            previous = np.inf
            while True:
                if newton == -starting and piece == 0:
                    t_now[0] = times[segment]
                    for d in range(n):
                        q_now[0, d] = q[d]
                        v_now[0, d] = v[d]
                elif newton == -1:
                    t_now[0] = times[segment] + lag * h
                    for d in range(n):
                        q_now[0, d] = q[d] + lag * h * (v[d] + 0.5 * lag * h * a[d])
                        v_now[0, d] = v[d] + lag * h * a[d]
                elif newton == 0 or newton == RESTART:
                    t_now[0] = t_end
                    for d in range(n):
                        x_now[d] = x[0, d]
                        if newton == 0 and known == 1:
                            x_now[d] = 2.0 * x[0, d] - x[1, d]
                        elif newton == 0 and known == 2:
                            x_now[d] = 3.0 * (x[0, d] - x[1, d]) + x[2, d]
                        elif newton == 0 and known == 3:
                            x_now[d] = 4.0 * (x[0, d] + x[2, d]) - 6.0 * x[1, d] - x[3, d]
                        a_now[d] = (x_now[d] - e2 * a[d] + e3 * x[0, d]) / e1
                        q_now[0, d] = q[d] + h * (v[d] + h * ((0.5 - beta) * x[0, d] + beta * x_now[d]))
                        v_now[0, d] = v[d] + h * ((1.0 - gamma) * x[0, d] + gamma * x_now[d])
                    previous = np.inf
                forces(model, strength, segment, one, t_now, q_now, v_now, yes, damped, rel, sums, f, k, c, turn)
                work[FORCES] += 1
                work[TANGENTS] += 1
                if count == 0 and newton == -starting:
                    for p in range(n_pair):
                        scale[p] = sums[0, p, K_XX] + sums[0, p, K_YY]
                        if sums[0, p, STORED] > 0.0 and scale[p] > 0.0:
                            motion[p] = np.sqrt(2.0 * sums[0, p, STORED] / scale[p])  # it starts strained
                    gross_loads(model, delta)
                    add_preloads(model, strength, rel[0], delta)
                    rounding_of_pairs(model, inv_mass, rel[0], v, delta, scale, motion, noise)
                    for p in range(n_pair):
                        for j in range(POSE):
                            rel0[p, j] = rel[0, p, j]
                accepted = newton < 0
                if newton >= 0:
                    work[NEWTON] += 1
                    for d in range(n):
                        delta[d] = inv_mass[d] * f[0, d] - a_now[d]
                    if not effective_matrix(
                        pair, inv_mass, k[0], c[0], turn[0], h * h * beta * e1, h * gamma * e1, damped,
                        turning, no, half, band, pivots,
                    ):  # fmt: skip
                        return NEWTON_FAILED, count
                    solve(band, half, pivots, delta)
                    for p in range(n_pair):
                        reached = max(motion[p], deflection(rel[0], rel0, model.reach, p))
                        scale[p] = max(reached, 1e3 * noise_of(pair, noise, rel[0], model.reach, q_now[0], p))
                    motion_weights(pair, rel0, model.reach, scale, weight)
                    e = 0.0
                    for d in range(n):
                        moved = h * h * beta * e1 * delta[d]
                        a_now[d] += delta[d]
                        x_now[d] += e1 * delta[d]
                        q_now[0, d] += moved
                        v_now[0, d] += h * gamma * e1 * delta[d]
                        size = weight[d] * abs(moved)
                        if not size <= e and not np.isnan(e):
                            e = size
                    # the last clause: rounding is all that is left
                    rounding = 1e-8
                    for p in range(n_pair):
                        lost = noise_of(pair, noise, rel[0], model.reach, q_now[0], p)
                        rounding = max(rounding, 100.0 * lost / scale[p])
                    accepted = e <= newton_tolerance or (e >= 0.5 * previous and e < rounding)
                    previous = e
                    if not accepted and (newton >= MOST_CORRECTIONS or (newton >= RESTART and not e < np.inf)):
                        return (NEWTON_FAILED if e < np.inf else NON_FINITE), count
                    if not accepted and not e < np.inf:
                        newton = RESTART - 1
                if accepted:
                    if newton < 0:
                        for d in range(n):
                            a_now[d] = inv_mass[d] * f[0, d]
                    keep_stage(
                        stages, t_now[0], q_now[0], v_now[0], a_now, rel[0], sums[0], k[0], c[0], turn[0],
                        steps.scalar, steps.stage, steps.pull, steps.K, steps.C, steps.turn,
                    )  # fmt: skip
                    stages += 1
                    for p in range(n_pair):
                        motion[p] = max(motion[p], deflection(rel[0], rel0, model.reach, p))
                    if newton >= 0:
                        break
                    for d in range(n):
                        if newton == -starting:
                            a[d] = a_now[d]
                            x[0, d] = a_now[d]
                        else:
                            x[0, d] = 2.0 * a[d] - a_now[d]
                    if newton == -2 and not h * fastest_rate(pair, inv_mass, k, c, damped, CLOSELY) < RESOLVED:
                        newton = -1  # the lagged state would be far off the motion
                newton += 1
            finite = True
            for d in range(n):
                q[d] = q_now[0, d]
                v[d] = v_now[0, d]
                a[d] = a_now[d]
                x[3, d] = x[2, d]
                x[2, d] = x[1, d]
                x[1, d] = x[0, d]
                x[0, d] = x_now[d]
                finite = finite and np.isfinite(q[d]) and np.isfinite(v[d])
            if not finite:
                return NON_FINITE, count
            steps.index[count, STARTS] = starting
            steps.index[count, SEGMENT] = segment
            count += 1
            work[ACCEPTED] += 1
            steps.index[count, FIRST] = stages
            keep_state(steps.t, steps.state, count, t_end, q, v)
    steps.index[count, STARTS] = -1  # no step follows (`stage_weights`)
    return OK, count


@kernel
def rate_at_start(model, strength, damped):
    """Angular frequency of the fastest vibration at the start, rad/s (an estimate)."""
    n = model.q0.shape[0]
    n_pair = model.pair.shape[0]
    rel = np.empty((1, n_pair, POSE))
    sums = np.empty((1, n_pair, SUMS))
    state = np.empty((3, 1, n))
    k = np.empty((1, n_pair, 6, 6))
    c = np.empty((1, n_pair, 6, 6))
    turn = np.zeros((1, n))
    for d in range(n):
        state[0, 0, d] = model.q0[d]
        state[1, 0, d] = model.v0[d]
    t = np.empty(1)
    t[0] = model.times[0]
    forces(
        model, strength, np.int64(0), np.int64(1), t, state[0], state[1], np.bool_(True), damped, rel, sums,
        state[2], k, c, turn,
    )  # fmt: skip
    return fastest_rate(model.pair, model.inv_mass, k, c, damped, CLOSELY)


@kernel
def longest_step(model, strength, damped, wanted):
    """The step in s: `wanted`, or, where that is negative, so many radians of the fastest vibration at the start.

    So a step that was found good enough (`default_step`) keeps its accuracy when the design becomes stiffer.
    """
    if wanted > 0.0:
        return wanted
    rate = rate_at_start(model, strength, damped)
    longest = (model.times[model.times.shape[0] - 1] - model.times[0]) / FEWEST_STEPS
    return min(-wanted / rate, longest) if rate > 0.0 else longest
