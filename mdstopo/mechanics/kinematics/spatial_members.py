"""A member between two bodies in space, and sums over the members of a block.

With r = d + a - p, a = S q, L = |r|, e = r/L and the relative rates xi' = (d', w),

    b = dL/dxi = (e, a x e),   Delta = L - l0,   dDelta/dt = b . xi' = e . r',   r' = d' + w x a

b changes along dxi = (dd, dphi) by B2 dxi; with dr = dd + dphi x a, de = (dr - (e . dr) e)/L it is
(de, a x de + (dphi x a) x e), and (B2^T xi') = (e', a x (e' + e x w)), e' = (r' - (e . r') e)/L. A law
f(Delta, dDelta/dt, t) with its partials gives Q = -sum s f b, K = sum s (b (f_D b + f_Dd B2^T xi')^T + f B2),
C = sum s f_Dd b b^T, E = sum s V, E_xi = sum s V' b, where s = alpha^mu.
"""

import math

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.padding import whole_vectors
from mdstopo.mechanics.kinematics.spatial_forces import C, K
from mdstopo.mechanics.kinematics.spatial_grids import (
    THREADS,
    grid_designs,
    grid_far,
    grid_sums,
    short_designs,
    short_sums,
)
from mdstopo.mechanics.kinematics.spatial_lines import (
    NO_LENGTH,
    add_line_stiffness,
    centripetal,
    line_between,
    line_bias,
    line_rate_slopes,
    line_row,
    line_slopes,
    line_speed,
)
from mdstopo.mechanics.kinematics.spatial_poses import (
    ATTITUDE,
    COORDINATES,
    D_RATE,
    D_SINCE,
    FREEDOMS,
    HOME_PLACE,
    S_SINCE,
    TURN,
    TURN_SINCE,
    D,
    S,
    W,
    fill_attitude,
)
from mdstopo.mechanics.kinematics.spatial_springs import (
    ENERGY,
    EXCESS,
    L0,
    PULL,
    P,
    Q,
    alike_damping,
    alike_sums,
    alike_tangent,
    alike_works,
    elastic_designs,
    elastic_energies,
    far,
)
from mdstopo.mechanics.kinematics.vectors import (
    add,
    cross,
    dot,
    minus,
    plus,
    put,
    times,
    turned,
    turned_back,
    unit,
    vector_at,
)
from mdstopo.mechanics.laws.law_table import SPRING, law, law_is_idle
from mdstopo.mechanics.laws.spring import ZERO_LENGTH_SQUARED
from mdstopo.scene.springs_model import MANY


@part
def end_of(member, first, i):
    """An end of member i in its body's frame, whose coordinates stand from row `first` on."""
    return member[first, i], member[first + 1, i], member[first + 2, i]


@part
def elongation_of(x, length, u, free, excess):
    """Delta = L - l0 of a member (m), with all digits of what its vector has changed by.

    x, length: its vector and length (m). u: what the vector has changed by since home (m).
    free: l0 (m). excess: L0^2 - l0^2 (m^2).
    """
    if dot(u, u) < length * length:
        return (excess + dot(u, minus(plus(x, x), u))) / (length + free)
    return length - free


@part
def vector_of(model, i, r):
    """The vector of member i at the pose r (POSE,), its arm a (m), its length (m), and 1/L (0 where it has none)."""
    arm = turned(r, S, end_of(model.member, Q, i))
    x = plus(vector_at(r, D), minus(arm, end_of(model.member, P, i)))
    square = dot(x, x)
    y = 1.0 / math.sqrt(square) if square > ZERO_LENGTH_SQUARED else 0.0
    return x, arm, square * y, y


@part
def stretched(model, i, r, x, length):
    """Elongation of member i (m), whose vector at the pose r (POSE,) is x."""
    u = plus(vector_at(r, D_SINCE), turned(r, S_SINCE, end_of(model.member, Q, i)))
    return elongation_of(x, length, u, model.member[L0, i], model.member[EXCESS, i])


@part
def stretch_of(model, i, r):
    """Elongation and its rate of member i; see `kinematics_interface.stretch_of`."""
    x, arm, length, y = vector_of(model, i, r)
    rate = y * dot(x, plus(vector_at(r, D_RATE), cross(vector_at(r, W), arm)))
    return stretched(model, i, r, x, length), rate


@part
def member_motion(model, i, r):
    """Length, elongation and its rate of member i; see `kinematics_interface.member_motion`."""
    x, arm, length, y = vector_of(model, i, r)
    rate = y * dot(x, plus(vector_at(r, D_RATE), cross(vector_at(r, W), arm)))
    return length, stretched(model, i, r, x, length), rate


@part
def motion_of_ends(model, i, r):
    """Elongation and its rate of member i from its ends; see `kinematics_interface.motion_of_ends`."""
    x, arm, _, _ = vector_of(model, i, r)
    length = math.sqrt(dot(x, x))
    speed = dot(x, plus(vector_at(r, D_RATE), cross(vector_at(r, W), arm)))
    return stretched(model, i, r, x, length), speed / length if length > 0.0 else 0.0


@part
def member_work(model, i, r, u):
    """Length, elongation and b . u of member i; see `kinematics_interface.member_work`."""
    x, arm, length, y = vector_of(model, i, r)
    along = y * dot(x, plus(vector_at(u, 0), cross(vector_at(u, 3), arm)))
    return length, stretched(model, i, r, x, length), along


@part
def second_rate(model, i, r, acc):
    """d2Delta/dt2 = b . xi'' + (|r'|^2 - L'^2)/L + e . (w x (w x a)); see `kinematics_interface.second_rate`."""
    x, arm, _, y = vector_of(model, i, r)
    w = vector_at(r, W)
    turning = cross(w, arm)
    speed = plus(vector_at(r, D_RATE), turning)
    rate = y * dot(x, speed)
    push = plus(vector_at(acc, 0), plus(cross(vector_at(acc, 3), arm), cross(w, turning)))
    return y * (dot(x, push) + dot(speed, speed) - rate * rate)


@kernel
def member_sums(model, code, p, lo, count, counted, t, value, member_state, r, tangent, o):
    """Forces, energy and tangents of members of one law; see `kinematics_interface.member_sums`."""
    w = vector_at(r, W)
    speed_of_origin = vector_at(r, D_RATE)
    for i in range(lo, lo + count):
        if law_is_idle(code, int(member_state[1, i])):
            continue
        x, arm, length, y = vector_of(model, i, r)
        if length == 0.0:  # not y == 0.0: that is so infinitely far away, too
            continue
        e = times(y, x)
        lever = cross(arm, e)
        speed = plus(speed_of_origin, cross(w, arm))
        rate = dot(e, speed)
        scale = member_state[0, i]
        stretch = stretched(model, i, r, x, length) - member_state[2, i]
        f, fd, fr, energy, pull = law(
            code, p, stretch, rate, int(member_state[1, i]), t, value, model.curves, model.member[6, i]
        )
        f *= scale
        add(o, 0, times(-f, e))
        add(o, 3, times(-f, lever))
        if counted:
            o[ENERGY] += scale * energy
            add(o, PULL, times(scale * pull, e))
            add(o, PULL + 3, times(scale * pull, lever))
        if tangent:
            _add_tangent(e, arm, lever, y, speed, rate, w, f, scale * fd, scale * fr, o)


@part
def _add_tangent(e, arm, lever, y, speed, rate, w, f, fd, fr, o):
    """Add K and C of one member to the sums o (SUMS,).

    e, arm, lever: its direction, its arm a (m) and a x e (m). y: 1/L (1/m).
    speed, rate, w: r' (m/s), e . r' (m/s) and the relative turning rate (rad/s).
    f, fd, fr: the force (N) and its slopes by elongation and rate.
    """
    turning = times(y, minus(speed, times(rate, e)))
    by_turn = cross(arm, plus(turning, cross(e, w)))
    for j in range(FREEDOMS):
        c = j % 3
        axis = unit(c)
        along = e[c] if j < 3 else lever[c]
        by = fd * along + fr * (turning[c] if j < 3 else by_turn[c])
        moved = axis if j < 3 else cross(axis, arm)
        de = times(f * y, minus(moved, times(dot(e, moved), e)))
        dl = cross(arm, de)
        if j >= 3:
            dl = plus(dl, times(f, cross(moved, e)))
        for i in range(3):
            o[K + FREEDOMS * i + j] += e[i] * by + de[i]
            o[K + FREEDOMS * (3 + i) + j] += lever[i] * by + dl[i]
        if fr != 0.0:
            for i in range(j + 1):
                o[C + j * (j + 1) // 2 + i] += fr * along * (e[i] if i < 3 else lever[i - 3])


@kernel
def spring_sums(model, p, start, count, row, counted, member_state, r, tangent, o):
    """Forces, energy and tangents of springs; see `kinematics_interface.spring_sums`."""
    rel = r.reshape((1, 1, r.shape[0]))
    sums = o.reshape((1, 1, o.shape[0]))
    zero = np.int64(0)
    spring_sums_at_poses(
        model, p, start, count, row, counted, member_state, rel, zero, np.int64(1), np.bool_(tangent), sums
    )


@kernel
def spring_sums_at_poses(model, p, start, count, row, counted, member_state, rel, pair, poses, tangent, sums):
    """The same at many poses; see `kinematics_interface.spring_sums_at_poses`."""
    stop = start + whole_vectors(count)
    width = model.member.shape[1]
    rows = model.member.reshape(model.member.size)
    scale = member_state.reshape(member_state.size)
    grid = row > 0 and p[0] != 0.0
    short = row < 0 and p[0] != 0.0 and p[1] == 0.0 and p[2] == 0.0
    if grid:
        threads = model.size[THREADS] if count >= MANY else np.int64(1)
        grid_sums(rows, width, scale, start, count, row, p, rel, pair, poses, np.bool_(counted), tangent, threads, sums)
    for j in range(poses):
        r = rel[j, pair]
        o = sums[j, pair]
        if short:
            short_sums(rows, width, scale, start, stop, -row, p, r, np.bool_(counted), tangent, o)
        elif not grid:
            alike_sums(rows, width, scale, start, stop, p, r, counted, o)
            if tangent:
                alike_tangent(rows, width, scale, start, stop, p, r, o)
        if tangent and p[1] != 0.0:
            alike_damping(rows, width, scale, start, stop, p, r, o)


@part
def member_works(model, lo, count, r, u, out):
    """What many members do at a relative pose; see `kinematics_interface.member_works`."""
    m = model.member
    alike_works(m.reshape(m.size), m.shape[1], lo, lo + whole_vectors(count), r, u, out)


@kernel
def member_designs(model, code, p, lo, count, t, value, member_state, modes_of, r, u, weight, out):
    """What members of one law add to a derivative by alpha^mu; see `kinematics_interface.member_designs`."""
    move = vector_at(u, 0)
    turn = vector_at(u, 3)
    for i in range(lo, lo + count):
        if law_is_idle(code, int(modes_of[i])):
            continue
        x, arm, length, y = vector_of(model, i, r)
        if length == 0.0:
            continue
        rate = y * dot(x, plus(vector_at(r, D_RATE), cross(vector_at(r, W), arm)))
        stretch = stretched(model, i, r, x, length)
        if code != SPRING:
            stretch -= member_state[2, i]
        mode = int(modes_of[i]) if code != SPRING else 0
        f, _, _, energy, _ = law(code, p, stretch, rate, mode, t, value, model.curves, model.member[6, i])
        out[i] += f * (y * dot(x, plus(move, cross(turn, arm)))) + weight * energy


@part
def spring_designs(model, p, lo, count, row, rel, u, pair, out):
    """`member_designs` of springs at many poses; see `kinematics_interface.spring_designs`."""
    rows = model.member.reshape(model.member.size)
    width = model.member.shape[1]
    if row > 0:
        threads = model.size[THREADS] if count >= MANY else np.int64(1)
        grid_designs(rows, width, lo, count, row, p[0], rel, u, pair, threads, out)
    elif row < 0:
        short_designs(rows, width, lo, lo + whole_vectors(count), -row, p[0], rel, u, pair, out)
    else:
        elastic_designs(rows, width, lo, lo + whole_vectors(count), p[0], rel, u, pair, out)


@part
def has_spring_energies(model):
    """See `kinematics_interface.has_spring_energies`."""
    return True


@part
def spring_energies(model, p, lo, count, rel, pair, weight, out):
    """Energies in vectors; see `kinematics_interface.spring_energies`."""
    rows = model.member.reshape(model.member.size)
    elastic_energies(rows, model.member.shape[1], lo, lo + whole_vectors(count), weight * p[0], rel, pair, out)


@part
def spring_designs_of_rows(model, p, lo, count, rel, u, pair, room, out):
    """`spring_designs` for many rows; see `kinematics_interface.spring_designs_of_rows`."""
    for s in range(rel.shape[0]):
        r = rel[s, pair]
        for i in range(lo, lo + count):
            x, arm, length, y = vector_of(model, i, r)
            rate = y * dot(x, plus(vector_at(r, D_RATE), cross(vector_at(r, W), arm)))
            f = p[0] * stretched(model, i, r, x, length) + p[1] * rate + p[2]
            e = times(f * y, x)
            lever = cross(arm, e)
            for m in range(out.shape[0]):
                out[m, i] += dot(e, vector_at(u[m, s, pair], 0)) + dot(lever, vector_at(u[m, s, pair], 3))


@part
def member_designs_of_rows(model, code, p, lo, count, t, value, member_state, r, u, j, pair, seen, out):
    """`member_designs` for many rows; see `kinematics_interface.member_designs_of_rows`."""
    for i in range(lo, lo + count):
        if law_is_idle(code, int(member_state[1, i])):
            continue
        x, arm, length, y = vector_of(model, i, r)
        if length == 0.0:
            continue
        rate = y * dot(x, plus(vector_at(r, D_RATE), cross(vector_at(r, W), arm)))
        stretch = stretched(model, i, r, x, length) - member_state[2, i]
        f, _, _, _, _ = law(code, p, stretch, rate, int(member_state[1, i]), t, value, model.curves, model.member[6, i])
        e = times(f * y, x)
        lever = cross(arm, e)
        for m in range(out.shape[0]):
            out[m, i] += dot(e, vector_at(u[m, j, pair], 0)) + dot(lever, vector_at(u[m, j, pair], 3))


@part
def keep_apart(model, lo, count, row, before, after):
    """Whether no member's ends can meet between two poses; see `kinematics_interface.keep_apart`."""
    rows = model.member.reshape(model.member.size)
    if row > 0:
        return grid_far(rows, model.member.shape[1], lo, count, row, before, after)
    return far(rows, model.member.shape[1], lo, lo + whole_vectors(count), before, after)


@part
def ends_meet(model, i, r, w):
    """Whether the ends of member i meet between two poses; see `kinematics_interface.ends_meet`."""
    x, _, _, _ = vector_of(model, i, r)
    u = minus(vector_of(model, i, w)[0], x)
    square = dot(u, u)
    along = -dot(x, u)
    across = cross(x, u)
    met = square > 0.0 and along >= 0.0 and along <= square and dot(across, across) <= 1e-18 * square * square
    return met or not dot(x, x) > ZERO_LENGTH_SQUARED


@part
def turn_of(model, body, q):
    """The attitude of one body, (ATTITUDE,); see `kinematics_interface.turn_of`."""
    attitude = np.empty(ATTITUDE)
    fill_attitude(model.home, body, q, attitude, 0)
    return attitude


@part
def line_of(model, p, i, turn_one, turn_two, q):
    """The line along member i of pair p of a model.

    turn_one, turn_two (ATTITUDE,): attitudes of its bodies. q (n_q,): coordinates.

    Returns its direction, its length, and the elongation (m).
    """
    one = model.pair[p, 0]
    two = model.pair[p, 1]
    at_home = minus(vector_at(model.home[two], HOME_PLACE), vector_at(model.home[one], HOME_PLACE))
    moved = minus(vector_at(q, COORDINATES * two), vector_at(q, COORDINATES * one))
    first = end_of(model.member, P, i)
    second = end_of(model.member, Q, i)
    x, e, length = line_between(turn_one, TURN, turn_two, TURN, first, second, plus(at_home, moved))
    u = plus(moved, minus(turned(turn_two, TURN_SINCE, second), turned(turn_one, TURN_SINCE, first)))
    return e, length, elongation_of(x, length, u, model.member[L0, i], model.member[EXCESS, i])


@part
def stretch_between(model, p, i, turn_one, turn_two, q, v):
    """Elongation and its rate of member i from turned bodies; see `kinematics_interface.stretch_between`."""
    e, _, stretch = line_of(model, p, i, turn_one, turn_two, q)
    one = FREEDOMS * model.pair[p, 0]
    two = FREEDOMS * model.pair[p, 1]
    first = end_of(model.member, P, i)
    second = end_of(model.member, Q, i)
    return stretch, dot(e, line_speed(turn_one, TURN, turn_two, TURN, first, second, v, one, two))


@kernel
def member_rows(model, p, i, q, v, row, row_rate):
    """Elongation, its rate and the row B of a member; see `kinematics_interface.member_rows`."""
    one = FREEDOMS * model.pair[p, 0]
    two = FREEDOMS * model.pair[p, 1]
    turn_one = turn_of(model, model.pair[p, 0], q)
    turn_two = turn_of(model, model.pair[p, 1], q)
    e, length, stretch = line_of(model, p, i, turn_one, turn_two, q)
    first = end_of(model.member, P, i)
    second = end_of(model.member, Q, i)
    line_row(turn_one, TURN, turn_two, TURN, first, second, e, row, 0)
    line_rate_slopes(turn_one, TURN, turn_two, TURN, first, second, e, length, v, one, two, row_rate)
    return stretch, dot(e, line_speed(turn_one, TURN, turn_two, TURN, first, second, v, one, two))


@kernel
def end_slopes(model, p, i, side, along, q, v, a, row_slope):
    """What moving an end of a member does to its length and row; see `kinematics_interface.end_slopes`.

    With r, r', r'' from the first end to the second, and d, d', d'' what they change by as the end moves,

        dL = e . d,   de = (d - e dL)/L,   dL' = de . r' + e . d',
        L'' = e . r'' + (|r'|^2 - L'^2)/L,   dL'' = de . r'' + e . d'' + (2 r' . d' - 2 L' dL' - (L'' - e . r'') dL)/L.
    """
    one = FREEDOMS * model.pair[p, 0]
    two = FREEDOMS * model.pair[p, 1]
    turn_one = turn_of(model, model.pair[p, 0], q)
    turn_two = turn_of(model, model.pair[p, 1], q)
    e, length, _ = line_of(model, p, i, turn_one, turn_two, q)
    row_slope[:] = 0.0
    if length <= NO_LENGTH:
        return 0.0, 0.0, 0.0, 0.0
    first = end_of(model.member, P, i)
    second = end_of(model.member, Q, i)
    speed = line_speed(turn_one, TURN, turn_two, TURN, first, second, v, one, two)
    push = minus(
        plus(vector_at(a, two), turned(turn_two, TURN, point_push(second, v, a, two))),
        plus(vector_at(a, one), turned(turn_one, TURN, point_push(first, v, a, one))),
    )
    turn = turn_two if side == 1 else turn_one
    at = two if side == 1 else one
    sign = 1.0 if side == 1 else -1.0
    own = vector_at(along, 0)
    d = times(sign, turned(turn, TURN, own))
    d_rate = times(sign, turned(turn, TURN, cross(vector_at(v, at + 3), own)))
    d_push = times(sign, turned(turn, TURN, point_push(own, v, a, at)))
    by_length = dot(e, d)
    de = times(1.0 / length, minus(d, times(by_length, e)))
    rate = dot(e, speed)
    by_rate = dot(de, speed) + dot(e, d_rate)
    excess = (dot(speed, speed) - rate * rate) / length
    by_excess = (2.0 * dot(speed, d_rate) - 2.0 * rate * by_rate - excess * by_length) / length
    put(row_slope, 0, times(-1.0, de))
    put(row_slope, 3, cross(turned_back(turn_one, TURN, de), first))
    put(row_slope, 6, de)
    put(row_slope, 9, cross(second, turned_back(turn_two, TURN, de)))
    add(row_slope, 3 + FREEDOMS * side, times(sign, cross(own, turned_back(turn, TURN, e))))
    return by_length, by_rate, dot(de, push) + dot(e, d_push) + by_excess, dot(e, push) + excess


@part
def point_push(s, v, a, at):
    """The acceleration of a point of a body beside that of its centre of mass, in the body's axes (m/s^2).

    s: the point (m). v, a: velocities and accelerations, of which those of the body begin at `at`.
    """
    return plus(cross(vector_at(a, at + 3), s), centripetal(s, vector_at(v, at + 3)))


@kernel
def inerter_row(model, q, v, i, p, row, row_rate):
    """B of a member as a row over its two bodies; see `kinematics_interface.inerter_row`."""
    one = FREEDOMS * model.pair[p, 0]
    two = FREEDOMS * model.pair[p, 1]
    turn_one = turn_of(model, model.pair[p, 0], q)
    turn_two = turn_of(model, model.pair[p, 1], q)
    e, length, _ = line_of(model, p, i, turn_one, turn_two, q)
    first = end_of(model.member, P, i)
    second = end_of(model.member, Q, i)
    line_row(turn_one, TURN, turn_two, TURN, first, second, e, row, 0)
    row_rate[0] = line_bias(turn_one, TURN, turn_two, TURN, first, second, e, length, v, one, two)
    if length <= NO_LENGTH:
        row_rate[0] = 0.0
        return 0.0
    return length


@kernel
def add_inerter_tangents(model, pair, lo, count, inertance, member_state, q, v, a, k_out, c_out):
    """Slopes of the inerters' forces at fixed a; see `kinematics_interface.add_inerter_tangents`."""
    one = FREEDOMS * model.pair[pair, 0]
    two = FREEDOMS * model.pair[pair, 1]
    turn_one = turn_of(model, model.pair[pair, 0], q)
    turn_two = turn_of(model, model.pair[pair, 1], q)
    row = np.empty(2 * FREEDOMS)
    by_q = np.empty(2 * FREEDOMS)
    by_v = np.empty(2 * FREEDOMS)
    for i in range(lo, lo + count):
        e, length, _ = line_of(model, pair, i, turn_one, turn_two, q)
        if length <= NO_LENGTH:
            continue
        first = end_of(model.member, P, i)
        second = end_of(model.member, Q, i)
        line_row(turn_one, TURN, turn_two, TURN, first, second, e, row, 0)
        second_rate_now = line_slopes(
            turn_one, TURN, turn_two, TURN, first, second, e, length, v, a, one, two, by_q, by_v
        )
        w = member_state[0, i] * inertance
        for r in range(2 * FREEDOMS):
            for c in range(2 * FREEDOMS):
                k_out[pair, r, c] += w * row[r] * by_q[c]
                c_out[pair, r, c] += w * row[r] * by_v[c]
        add_line_stiffness(turn_one, TURN, turn_two, TURN, first, second, e, length, w * second_rate_now, k_out[pair])
