"""The iterative method: the linearised equations of generalized-alpha, solved by fixed-point sweeps.

Works on the steps that are there already. In every step the acceleration sensitivities follow from the factorised
mass matrix (diagonal here), with the C and K terms of the sweep before and the q and v sensitivities that the
integrator's own update gives for it; the last step's are the first guess. The sweeps end when they change nothing
by 1e-12 of the largest. They contract where beta h^2 rho(M^-1 K) < 1 (here times e1 <= 1, and with the damping);
where not, that is said, and `direct` is the method to take.
"""

import numpy as np

from mdstopo.compiler.jit import entry, kernel, member_kernel
from mdstopo.integrators.springs_generalized_alpha import weights_of
from mdstopo.integrators.steps import FIRST, SWEEPS, carve
from mdstopo.integrators.steps_interface import steps_of
from mdstopo.mechanics.assembly import add_turning, subtract_products
from mdstopo.mechanics.kinematics.planar_poses import POSE, add_pair_force, copy_rows, relative_pose
from mdstopo.mechanics.kinematics.planar_steps import hermite
from mdstopo.mechanics.laws.spring import elastic_design, viscous_design
from mdstopo.mechanics.passes import SUMS
from mdstopo.scene.packing import unpack
from mdstopo.scene.springs_model import (
    DAMPING,
    DESIGN,
    EXCESS,
    KIND,
    L0,
    PAIR,
    PRELOAD,
    PX,
    PY,
    QX,
    QY,
    START,
    STIFFNESS,
    STOP,
)
from mdstopo.sensitivity.propagation import STRIP, add_three
from mdstopo.sensitivity.reductions import INTEGRAL, MEAN
from mdstopo.sensitivity.springs_direct import finish_rows, integral_weights, state_of_row

#: change of a sweep, relative, at which a step is solved
CHANGE = 1e-12
#: sweeps a step may take
MOST_SWEEPS = 200


@kernel
def contraction(pair, inv_mass, k, c, turn, w_q, w_v, damped, turning):
    """Estimate the spectral radius of M^-1 (w_q (K - load tangent) + w_v C) by power iteration.

    pair (n_pair, 2): the bodies of each pair.
    inv_mass (n,): inverse masses and inertias (1/kg, 1/(kg m^2)).
    k, c (1, n_pair, 6, 6): -dF/dq and -dF/dv of each pair; c is read if damped.
    turn (1, n): derivative of the loads by the angle of their body, read if they turn.
    w_q, w_v: how q and v follow the acceleration in a step (s^2, s).
    damped: whether any force depends on velocity.
    turning: whether loads turn.
    """
    n = inv_mass.shape[0]
    x = np.empty((1, n))
    y = np.empty((1, n))
    part = np.empty((1, n))
    radius = 0.0
    for d in range(n):
        x[0, d] = np.sqrt(inv_mass[d]) * (1.0 + 0.1 * (d % 7))
    for _ in range(10):
        size = 0.0
        for d in range(n):
            if inv_mass[d] > 0.0:
                size += x[0, d] * x[0, d] / inv_mass[d]
        radius = np.sqrt(size)
        if radius == 0.0:
            break
        y[:] = 0.0
        part[:] = 0.0
        for d in range(n):
            x[0, d] /= radius
        subtract_products(pair, k, x, y, 1)
        if turning:
            add_turning(turn, x, y, 1)
        if damped:
            subtract_products(pair, c, x, part, 1)
        for d in range(n):
            x[0, d] = inv_mass[d] * (w_q * y[0, d] + w_v * part[0, d])
    return radius


@member_kernel
def _accept(scale, force, guess):
    """guess = scale force; returns the largest change and the largest value."""
    change = 0.0
    size = 0.0
    for i in range(guess.shape[0]):
        value = scale * force[i]
        change = max(change, abs(value - guess[i]))
        size = max(size, abs(value))
        guess[i] = value
    return change, size


@kernel
def _balance_rows(pair, k, c, turn, damped, turning, x, y, out, wide):
    """out -= K x + C y - load tangent x, for a strip of members.

    In:
      pair (n_pair, 2): the bodies of each pair.
      k, c (n_pair, 6, 6): -dF/dq and -dF/dv of each pair; c is read if damped.
      turn (n,): derivative of the loads by the angle of their body, read if they turn.
      damped: whether any force depends on velocity.
      turning: whether loads turn.
      x, y (n, STRIP): derivatives of q and v by each member's alpha^mu.
      wide: how many members the strip has.
    Out:
      out (n, STRIP): added to.
    """
    for p in range(pair.shape[0]):
        for i in range(6):
            o = out[3 * pair[p, i // 3] + i % 3, :wide]
            for side in range(2):
                b = 3 * pair[p, side]
                j = 3 * side
                x0, x1, x2 = x[b, :wide], x[b + 1, :wide], x[b + 2, :wide]
                add_three(-k[p, i, j], -k[p, i, j + 1], -k[p, i, j + 2], x0, x1, x2, o)
                if damped:
                    y0, y1, y2 = y[b, :wide], y[b + 1, :wide], y[b + 2, :wide]
                    add_three(-c[p, i, j], -c[p, i, j + 1], -c[p, i, j + 2], y0, y1, y2, o)
    if turning:
        for d in range(out.shape[0]):
            angle = x[d - d % 3 + 2]
            for i in range(wide):
                out[d, i] += turn[d] * angle[i]


@kernel
def _member_forces(pair, block, member, k, lo, hi, rel, push, out):
    """Forces -T^T b f of the members in places lo to hi of block k on the coordinates, at alpha^mu = 1.

    In:
      pair (n_pair, 2): the bodies of each pair.
      block (n_block, BLOCK), member (MEMBER, M_padded): as of `Model`.
      k: number of the block.
      lo, hi: places in the padded arrays, at most STRIP of them.
      rel (n_pair, POSE): relative poses.
    Out:
      out (n, STRIP): overwritten (N, N m).
    Room:
      push (STRIP,): overwritten.
    """
    wide = hi - lo
    p = block[k, PAIR]
    unit = np.eye(3)
    lever = np.zeros(out.shape[0])
    out[:] = 0.0
    for axis in range(3):
        ux = 1.0 if axis == 0 else 0.0
        uy = 1.0 if axis == 1 else 0.0
        ut = 1.0 if axis == 2 else 0.0
        o = push[:wide]
        o[:] = 0.0
        if block[k, KIND] == 0:
            elastic_design(
                member[PX, lo:hi], member[PY, lo:hi], member[QX, lo:hi], member[QY, lo:hi], member[L0, lo:hi],
                member[EXCESS, lo:hi], member[STIFFNESS, lo:hi], rel[p : p + 1], unit[axis : axis + 1], o,
            )  # fmt: skip
        else:
            viscous_design(
                member[PX, lo:hi], member[PY, lo:hi], member[QX, lo:hi], member[QY, lo:hi], member[L0, lo:hi],
                member[EXCESS, lo:hi], member[STIFFNESS, lo:hi], member[DAMPING, lo:hi], member[PRELOAD, lo:hi],
                rel[p], unit[axis], o,
            )  # fmt: skip
        lever[:] = 0.0
        add_pair_force(pair, rel, p, -ux, -uy, -ut, lever)
        for d in range(out.shape[0]):
            if lever[d] != 0.0:
                for i in range(wide):
                    out[d, i] += lever[d] * o[i]


@kernel
def _add_change(mu, weight_q, weight_v, sq, sv, lo, hi, out):
    """Add mu . (weight_q dq + weight_v dv) for the members in places lo to hi.

    In:
      mu (n,): derivative of a response by the coordinates.
      weight_q, weight_v: of the derivatives of q and v in those of the coordinates.
      sq, sv (n, M_padded): derivatives of q and v by alpha^mu.
      lo, hi: places in the padded arrays.
    Out:
      out (M_padded,): added to.
    """
    for d in range(mu.shape[0]):
        a = mu[d] * weight_q
        b = mu[d] * weight_v
        for i in range(lo, hi):
            out[i] += a * sq[d, i] + b * sv[d, i]


@entry
def iterative(
    tag,
    ints,
    floats,
    tables,
    alpha,
    damped,
    limits,
    count,
    reductions,
    room,
    room_ints,
    strength,
    rows,
    found,
    gradients,
    work,
):
    """Gradients of the rows that `evaluate_responses` found, by fixed-point sweeps of the linearised steps.

    Constant:
      tag: of the integrator (`steps_interface.steps_of`).
      ints, floats: the packed model.
      tables (1,): the spectral radius.
    In:
      alpha (N,): the design.
      damped: whether any force depends on velocity.
      limits (3,): steps allowed, room for steps, room for stages.
      count: steps that were taken.
      reductions (n_obj,): codes of the objectives' reductions.
      room, room_ints: the steps, with tangents (`steps.carve`).
      strength (3 or more, M_padded): as the run left them (N/m, N s/m, N).
      rows (n_obj, R, 4): time, value, step, fraction of it, of what `evaluate_responses` found.
      found (n_obj,): how many rows each objective has.
    Out:
      gradients (n_obj, R, N): by alpha, for the rows that were found.
      work (WORK,): counts of work, added to.

    Returns the step at which the sweeps do not contract, or -1: then the gradients hold.
    """
    model = unpack(ints, floats)
    turning = model.load_body.shape[0] > 0
    n = model.q0.shape[0]
    n_pair = model.pair.shape[0]
    pair = model.pair
    block = model.block
    inv_mass = model.inv_mass
    steps = steps_of(tag, carve(room, room_ints, n, n_pair, limits[1], limits[2], damped, turning))
    n_obj = rows.shape[0]
    n_row = rows.shape[1]
    padded_size = model.member.shape[1]
    e1, e2, e3, beta, gamma, lag = weights_of(tables[0])
    rel = np.empty((3, n_pair, POSE))
    sums = np.empty((1, n_pair, SUMS))
    S = np.zeros((4, n, padded_size))
    sq = S[0]
    sv = S[1]
    sa = S[2]
    sx = S[3]
    padded = np.zeros((n_obj, n_row, padded_size))
    total = np.zeros((1, padded_size))
    mu = np.zeros((n_obj, n_row, n))
    states = np.zeros((n_obj, n_row, 3, n))
    place = np.empty((n_obj, n_row), np.int64)
    fraction = np.empty((n_obj, n_row))
    place[:] = -1  # integrals over time belong to no step
    integral = False
    for j in range(n_obj):
        if reductions[j] == MEAN or reductions[j] == INTEGRAL:
            integral = True
            continue
        for r in range(found[j]):
            place[j, r], fraction[j, r] = state_of_row(
                model, tables, strength, steps, count, damped, rows[j, r], states[j, r, 0], states[j, r, 1],
                rel[:1], sums, mu[j, r], work,
            )  # fmt: skip
    stages = steps.index[count, FIRST] if integral else 0
    weight = np.zeros(stages)
    bar = np.zeros((stages, n))
    if integral:
        integral_weights(model, tables, steps, count, weight, bar)
    room = np.empty((7, n, STRIP))
    force = room[0]
    x = room[1]
    y = room[2]
    base_q = room[3]
    base_v = room[4]
    guess = room[5]
    rhs = room[6]
    push = np.empty(STRIP)
    for w in range(count):
        o = steps.index[w, FIRST]
        last = steps.index[w + 1, FIRST] - 1 - o
        h = steps.t[w + 1] - steps.t[w]
        w_q = h * h * beta * e1
        w_v = h * gamma * e1
        end = steps.K[o + last : o + last + 1]
        radius = contraction(
            pair, inv_mass, end, steps.C[o + last : o + last + 1] if damped else end,
            steps.turn[o + last : o + last + 1] if turning else room[0], w_q, w_v, damped, turning,
        )  # fmt: skip
        if not radius < 1.0:
            return w
        for j in range(last + 1):
            relative_pose(pair, model.home, steps.stage[o + j, 0], steps.stage[o + j, 1], rel[j])
        for b in range(block.shape[0]):
            if block[b, DESIGN] < 0:
                continue
            for lo in range(block[b, START], block[b, STOP], STRIP):
                hi = min(lo + STRIP, block[b, STOP])
                wide = hi - lo
                for j in range(n_obj):
                    for r in range(found[j]):
                        if place[j, r] == w and fraction[j, r] >= 0.0:
                            q0, v0, _, _, _, _, _, _ = hermite(fraction[j, r])
                            _add_change(mu[j, r], q0, h * v0, sq, sv, lo, hi, padded[j, r])
                for j in range(last + 1):
                    k = steps.K[o + j]
                    c = steps.C[o + j] if damped else k
                    turn = steps.turn[o + j] if turning else push
                    _member_forces(pair, block, model.member, b, lo, hi, rel[j], push, force)
                    ahead = lag * h if j == 1 else 0.0
                    for d in range(n):
                        for i in range(wide):
                            g = lo + i
                            if j < last:
                                x[d, i] = sq[d, g]
                                y[d, i] = sv[d, g]
                                if j == 1:
                                    x[d, i] += ahead * (sv[d, g] + 0.5 * ahead * sa[d, g])
                                    y[d, i] += ahead * sa[d, g]
                            else:
                                carry = e2 * sa[d, g] - e3 * sx[d, g]
                                aux = sx[d, g]
                                base_q[d, i] = sq[d, g] + h * sv[d, g]
                                base_q[d, i] += h * h * ((0.5 - beta) * aux + beta * carry)
                                base_v[d, i] = sv[d, g] + h * ((1.0 - gamma) * aux + gamma * carry)
                                guess[d, i] = sa[d, g]
                    sweep = 0
                    while True:
                        if j == last:
                            for d in range(n):
                                for i in range(wide):
                                    x[d, i] = base_q[d, i] + w_q * guess[d, i]
                                    y[d, i] = base_v[d, i] + w_v * guess[d, i]
                        copy_rows(force, rhs)
                        _balance_rows(pair, k, c, turn, damped, turning, x, y, rhs, wide)
                        change = 0.0
                        size = 0.0
                        for d in range(n):
                            if inv_mass[d] > 0.0:
                                moved, largest = _accept(inv_mass[d], rhs[d, :wide], guess[d, :wide])
                                root = np.sqrt(inv_mass[d])
                                change = max(change, moved / root)
                                size = max(size, largest / root)
                        work[SWEEPS] += 1
                        sweep += 1
                        if j < last or change <= CHANGE * size:
                            break
                        if sweep >= MOST_SWEEPS or not change < np.inf:
                            return w
                    for d in range(n):
                        if inv_mass[d] == 0.0:
                            continue
                        for i in range(wide):
                            g = lo + i
                            new = guess[d, i]
                            if j < last:
                                sx[d, g] = new if j == 0 else 2.0 * sa[d, g] - new
                                if j == 0:
                                    sa[d, g] = new
                            else:
                                sx[d, g] = e1 * new + e2 * sa[d, g] - e3 * sx[d, g]
                                sa[d, g] = new
                                sq[d, g] = base_q[d, i] + w_q * new
                                sv[d, g] = base_v[d, i] + w_v * new
                                x[d, i] = sq[d, g]
                    if integral:
                        for d in range(n):
                            for i in range(wide):
                                total[0, lo + i] += bar[o + j, d] * x[d, i]
                for j in range(n_obj):
                    for r in range(found[j]):
                        if place[j, r] == w:
                            at = fraction[j, r]
                            _, _, q1, v1, _, _, _, _ = hermite(at if at >= 0.0 else 1.0)
                            _add_change(mu[j, r], q1, h * v1, sq, sv, lo, hi, padded[j, r])
    finish_rows(model, alpha, steps, count, reductions, found, weight, states, padded, total, gradients)
    return -1
