"""The state of bodies in space at the stages and at the end of a step, between steps, and how these change.

Centres of mass move as in a plane. Turns are followed by the rotation vector t from the start of a step, with
t' = J(t)^-1 omega (`rotations`): a Runge-Kutta method of order p keeps its order, and a body that turns evenly is
followed exactly. With t_i = h sum_j a_ij k_j and k_j = J(t_j)^-1 omega_j, coordinates are q_0 exp(t_i).

Backwards, with u_i the cotangent of the turn of stage i, g_i that of its turning rate, and t_i -> k_i:

    bar t_i = J(t_i)^T u_i + (dk_i/dt_i)^T bar k_i,    bar k_i = h sum_{l > i} a_li bar t_l + h b_i bar t_end
    bar omega_i = g_i + J(t_i)^-T bar k_i
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.mechanics.kinematics.brief_steps import evenly_jvp, evenly_vjp, is_brief, shares_of_way
from mdstopo.mechanics.kinematics.planar_steps import BY_RATE, BY_STAGE, END, END_RATE, NODES, VECTORS, hermite
from mdstopo.mechanics.kinematics.rotations import (
    exponential,
    inverse,
    product,
    quaternion_at,
    turn_between,
    turn_by,
    turn_rate,
    turn_rate_jvp,
    turn_rate_vjp,
    vector_rate,
    vector_rate_jvp,
    vector_rate_vjp,
)
from mdstopo.mechanics.kinematics.spatial_poses import COORDINATES, FREEDOMS
from mdstopo.mechanics.kinematics.vectors import add, dot, minus, plus, put, times, vector_at


@part
def put_quaternion(q, i, e):
    """q[i : i + 4] = e."""
    q[i] = e[0]
    q[i + 1] = e[1]
    q[i + 2] = e[2]
    q[i + 3] = e[3]


@part
def back_turned(t, a):
    """A small turn a of a body, as seen behind a further turn by t: exp(-t) a exp(t)."""
    e = exponential(t)
    x = product(product(inverse(e), (0.0, a[0], a[1], a[2])), e)
    return x[1], x[2], x[3]


@kernel
def retract(model, q, shift, out):
    """Bodies move by the first three of a shift, and turn by the others; see `kinematics_interface.retract`."""
    for body in range(shift.shape[0] // FREEDOMS):
        i = COORDINATES * body
        d = FREEDOMS * body
        put(out, i, plus(vector_at(q, i), vector_at(shift, d)))
        put_quaternion(out, i + 3, turn_by(quaternion_at(q, i + 3), vector_at(shift, d + 3)))


@kernel
def difference(model, after, before, out):
    """See `kinematics_interface.difference`; turns of half a turn at most."""
    for body in range(out.shape[0] // FREEDOMS):
        i = COORDINATES * body
        d = FREEDOMS * body
        put(out, d, minus(vector_at(after, i), vector_at(before, i)))
        put(out, d + 3, turn_between(quaternion_at(before, i + 3), quaternion_at(after, i + 3)))


@kernel
def retract_vjp(model, q, moved, bar, bar_q, bar_shift):
    """exp(-t) takes a turn before it along, and J(t) gives its own change; see `kinematics_interface.retract_vjp`."""
    for body in range(bar.shape[0] // FREEDOMS):
        i = COORDINATES * body
        d = FREEDOMS * body
        t = turn_between(quaternion_at(q, i + 3), quaternion_at(moved, i + 3))
        place = vector_at(bar, d)
        turn = vector_at(bar, d + 3)
        put(bar_q, d, place)
        put(bar_shift, d, place)
        put(bar_q, d + 3, back_turned(times(-1.0, t), turn))
        put(bar_shift, d + 3, turn_rate(times(-1.0, t), turn))


@kernel
def retract_jvp(model, q, moved, dq, dshift, out):
    """The changes of both; see `kinematics_interface.retract_jvp`."""
    for body in range(out.shape[0] // FREEDOMS):
        i = COORDINATES * body
        d = FREEDOMS * body
        t = turn_between(quaternion_at(q, i + 3), quaternion_at(moved, i + 3))
        put(out, d, plus(vector_at(dq, d), vector_at(dshift, d)))
        put(out, d + 3, plus(back_turned(t, vector_at(dq, d + 3)), turn_rate(t, vector_at(dshift, d + 3))))


@part
def shift_size(model):
    """J(t) of a body, by rows."""
    return 9


@kernel
def shift_tangents(model, q, moved, out):
    """J(t) of the turns between q and moved; see `kinematics_interface.shift_tangents`."""
    for body in range(out.shape[0]):
        i = COORDINATES * body + 3
        t = turn_between(quaternion_at(q, i), quaternion_at(moved, i))
        for r in range(3):
            u = (1.0 if r == 0 else 0.0, 1.0 if r == 1 else 0.0, 1.0 if r == 2 else 0.0)
            x, y, z = turn_rate(t, u)
            out[body, r] = x
            out[body, 3 + r] = y
            out[body, 6 + r] = z


@part
def slope_by_shift(model, slopes, m, r, i, tangents, body):
    """By a component of a turn, all three slopes times J(t); see `kinematics_interface.slope_by_shift`."""
    k = i % FREEDOMS - 3
    if k < 0:
        return slopes[m, r, i]
    at = i - k
    return (
        slopes[m, r, at] * tangents[body, k]
        + slopes[m, r, at + 1] * tangents[body, 3 + k]
        + slopes[m, r, at + 2] * tangents[body, 6 + k]
    )


@part
def turn_slope_by_shift(model, slopes, d, r, tangents, body):
    """The three slopes by the turn times J(t); see `kinematics_interface.turn_slope_by_shift`."""
    return (
        slopes[d, 0] * tangents[body, r] + slopes[d, 1] * tangents[body, 3 + r] + slopes[d, 2] * tangents[body, 6 + r]
    )


@kernel
def add_shift(model, tangents, w, shift, dq):
    """See `kinematics_interface.add_shift`."""
    for body in range(tangents.shape[0]):
        d = FREEDOMS * body
        turn = vector_at(shift, d + 3)
        add(dq, d, times(w, vector_at(shift, d)))
        for r in range(3):
            row = vector_at(tangents[body], 3 * r)
            dq[d + 3 + r] += w * dot(row, turn)


@kernel
def add_shift_curvature(model, shift, mass, body, first, k):
    """M (J(t)^-T - 1) of the turn t; see `kinematics_interface.add_shift_curvature`.

    With exp(t) = E_0^-1 E_1 and turns a, b of both ends, J(t) dt = b - exp(-t) a: dt = J(t)^-1 b - J(t)^-T a.
    """
    d = FREEDOMS * body + 3
    t = times(-1.0, vector_at(shift, d))
    for r in range(3):
        u = (1.0 if r == 0 else 0.0, 1.0 if r == 1 else 0.0, 1.0 if r == 2 else 0.0)
        change = minus(vector_rate(t, u), u)
        at = first + 3
        k[at, at + r] += mass[d] * change[0]
        k[at + 1, at + r] += mass[d + 1] * change[1]
        k[at + 2, at + r] += mass[d + 2] * change[2]


@kernel
def turn_back(model, shift, transposed, x):
    """J(t)^-1 of each body's turn t; see `kinematics_interface.turn_back`."""
    for body in range(x.shape[0] // FREEDOMS):
        d = FREEDOMS * body + 3
        t = vector_at(shift, d)
        put(x, d, vector_rate(times(-1.0, t) if transposed else t, vector_at(x, d)))


@kernel
def shift_further(model, start, shift, change, q):
    """See `kinematics_interface.shift_further`."""
    for d in range(shift.shape[0]):
        shift[d] += change[d]
    retract(model, start, shift, q)


@kernel
def advance_coordinates(model, q, v, a, e, out):
    """A parabola of places, and of rotation vectors from here; see `kinematics_interface.advance_coordinates`."""
    for body in range(v.shape[0] // FREEDOMS):
        i = COORDINATES * body
        d = FREEDOMS * body
        move = times(e, plus(vector_at(v, d), times(0.5 * e, vector_at(a, d))))
        turn = times(e, plus(vector_at(v, d + 3), times(0.5 * e, vector_at(a, d + 3))))
        put(out, i, plus(vector_at(q, i), move))
        put_quaternion(out, i + 3, turn_by(quaternion_at(q, i + 3), turn))


@kernel
def stage_state(model, table, h, i, q0, v0, q, v, a, slopes):
    """Coordinates and velocities of stage i; see `kinematics_interface.stage_state`.

    slopes (s, n): of each stage k_i in the places of its turns, 0 in the others.
    """
    ahead = h * table[VECTORS, NODES, i]
    stage = q[i]
    own = slopes[i]  # first has the sums of accelerations, then that of slopes
    own[:] = 0.0
    for j in range(i):
        add_row(h * h * table[BY_STAGE, i, j], a[j], own)
    velocity = v[i]
    for d in range(v0.shape[0]):
        velocity[d] = v0[d]
    for body in range(v0.shape[0] // FREEDOMS):
        c = COORDINATES * body
        d = FREEDOMS * body
        put(stage, c, plus(plus(vector_at(q0, c), times(ahead, vector_at(v0, d))), vector_at(own, d)))
    own[:] = 0.0
    for j in range(i):
        add_row(h * table[BY_RATE, i, j], a[j], velocity)
        add_row(h * table[BY_RATE, i, j], slopes[j], own)
    for body in range(v0.shape[0] // FREEDOMS):
        c = COORDINATES * body
        d = FREEDOMS * body
        turn = vector_at(own, d + 3)
        put_quaternion(stage, c + 3, turn_by(quaternion_at(q0, c + 3), turn))
        put(own, d + 3, vector_rate(turn, vector_at(velocity, d + 3)))


@part
def add_row(w, row, out):
    """out += w row, unless w is 0; as a loop of its own it is done in vectors."""
    if w != 0.0:
        for d in range(out.shape[0]):
            out[d] += w * row[d]


@kernel
def end_state(model, table, s, h, q0, v0, q, v, a, slopes, q_end, v_end):
    """Coordinates and velocities at the end of a step; see `kinematics_interface.end_state`."""
    for body in range(v0.shape[0] // FREEDOMS):
        c = COORDINATES * body
        d = FREEDOMS * body
        place = plus(vector_at(q0, c), times(h, vector_at(v0, d)))
        velocity = vector_at(v0, d)
        omega = vector_at(v0, d + 3)
        turn = (0.0, 0.0, 0.0)
        for j in range(s):
            w = h * table[VECTORS, END_RATE, j]
            place = plus(place, times(h * h * table[VECTORS, END, j], vector_at(a[j], d)))
            velocity = plus(velocity, times(w, vector_at(a[j], d)))
            omega = plus(omega, times(w, vector_at(a[j], d + 3)))
            turn = plus(turn, times(w, vector_at(slopes[j], d + 3)))
        put(q_end, c, place)
        put_quaternion(q_end, c + 3, turn_by(quaternion_at(q0, c + 3), turn))
        put(v_end, d, velocity)
        put(v_end, d + 3, omega)


@part
def _find_turns(q, c, d, turns):
    """Find the rotation vectors from the start of a step to its stages.

    q (s, n_q): coordinates of the stages. c, d: where the body begins in coordinates and in velocities.
    turns (s, n): out, in the places of the turn.
    """
    start = quaternion_at(q[0], c + 3)
    for j in range(turns.shape[0]):
        put(turns[j], d + 3, turn_between(start, quaternion_at(q[j], c + 3)))


@part
def _end_turn(table, h, turns, v, d):
    """The rotation vector of the end of a step.

    table, h, v (s, n): as of `end_state`. turns (s, n): of `_find_turns`. d: where the body begins in velocities.
    """
    turn = (0.0, 0.0, 0.0)
    for j in range(turns.shape[0]):
        slope = vector_rate(vector_at(turns[j], d + 3), vector_at(v[j], d + 3))
        turn = plus(turn, times(h * table[VECTORS, END_RATE, j], slope))
    return turn


@part
def _slope_bars(table, h, i, u, out):
    """bar k_i of all bodies at a stage, in the places of their turns, into out (n,).

    table, h, i: the method's table, the length of the step, the stage.
    u (s, n): of the later stages bar t, in the places of their turns; of the first one bar t_end.
    """
    end = u[0]
    w = h * table[VECTORS, END_RATE, i]
    for d in range(out.shape[0]):
        out[d] = w * end[d]
    for m in range(i + 1, u.shape[0]):
        add_row(h * table[BY_RATE, m, i], u[m], out)


@kernel
def stage_vjp(model, table, h, j, q, v, lam_q, lam_v, u, g, turns, z):
    """The cotangent of the accelerations of stage j; see `kinematics_interface.stage_vjp`.

    The turning parts of u and g of the stage behind j, which nobody reads any more, become bar t and bar omega. Until
    stage 0 comes, bar t_end waits in its place in u, which is 0 before and after; that of lam_q, from which it follows,
    becomes the cotangent of the turn of the start by all that comes behind stage j. What is summed over stages is so
    for all bodies at once, as vectors; z is room for bar k until it is set. Turns are those of the stages from the
    start of the step, in their places.
    """
    s, n = u.shape
    if j + 1 == s:
        for body in range(n // FREEDOMS):
            d = FREEDOMS * body
            _find_turns(q, COORDINATES * body, d, turns)
            back = times(-1.0, _end_turn(table, h, turns, v, d))
            seen = vector_at(lam_q, d + 3)
            put(u[0], d + 3, turn_rate(back, seen))
            put(lam_q, d + 3, back_turned(back, seen))
    else:
        _slope_bars(table, h, j + 1, u, z)
        for body in range(n // FREEDOMS):
            _stage_bars(j + 1, turns, v, z, lam_q, u, g, FREEDOMS * body)
    if j == 0:
        _slope_bars(table, h, 0, u, z)
        for body in range(n // FREEDOMS):
            put(u[0], FREEDOMS * body + 3, vector_at(z, FREEDOMS * body + 3))
    by_end_rate = h * table[VECTORS, END_RATE, j]
    by_end = h * h * table[VECTORS, END, j]
    for d in range(n):
        z[d] = by_end * lam_q[d]
    for i in range(j + 1, s):
        add_row(h * h * table[BY_STAGE, i, j], u[i], z)
    for body in range(n // FREEDOMS):  # positions alone depend on accelerations in this way
        put(z, FREEDOMS * body + 3, (0.0, 0.0, 0.0))
    add_row(by_end_rate, lam_v, z)
    for i in range(j + 1, s):
        add_row(h * table[BY_RATE, i, j], g[i], z)
    if j == 0:  # its own turn is none, so bar omega_0 is bar k_0
        for body in range(n // FREEDOMS):
            add(lam_v, FREEDOMS * body + 3, vector_at(u[0], FREEDOMS * body + 3))
            put(u[0], FREEDOMS * body + 3, (0.0, 0.0, 0.0))


@part
def _stage_bars(i, turns, v, bars, lam_q, u, g, d):
    """Cotangents of a turn and a turning rate, in u and g (s, n) of stage i, become bar t and bar omega.

    u_i seen before the turn, exp(t) u_i = exp(t) J(t)^-T (J(t)^T u_i) = J(t)^-1 (J(t)^T u_i), is added to lam_q.

    i: the stage. turns, v (s, n), lam_q (n,): as of `stage_vjp`. bars (n,): of `_slope_bars`.
    d: where the body begins.
    """
    t = vector_at(turns[i], d + 3)
    bar = vector_at(bars, d + 3)
    own = turn_rate(times(-1.0, t), vector_at(u[i], d + 3))
    put(u[i], d + 3, plus(own, vector_rate_vjp(t, vector_at(v[i], d + 3), bar)))
    add(g[i], d + 3, vector_rate(times(-1.0, t), bar))
    add(lam_q, d + 3, vector_rate(t, own))


@kernel
def start_vjp(model, table, s, h, q, v, u, g, lam_q, lam_v):
    """The cotangents of the start of a step; see `kinematics_interface.start_vjp`.

    Of turns, what stage 0 adds is left (`stage_vjp`); of turning rates, what all stages' bar omega add.
    """
    for body in range(lam_q.shape[0] // FREEDOMS):
        d = FREEDOMS * body
        place = vector_at(lam_q, d)
        velocity = plus(vector_at(lam_v, d), times(h, place))
        omega = vector_at(lam_v, d + 3)
        for i in range(s):
            ahead = h * table[VECTORS, NODES, i]
            move = vector_at(u[i], d)
            place = plus(place, move)
            velocity = plus(velocity, plus(times(ahead, move), vector_at(g[i], d)))
            omega = plus(omega, vector_at(g[i], d + 3))
        put(lam_q, d, place)
        put(lam_v, d, velocity)
        add(lam_q, d + 3, vector_at(u[0], d + 3))
        put(lam_v, d + 3, omega)


@kernel
def stage_jvp(model, table, h, first, i, q, v, dq, dv, changes):
    """Changes of coordinates and velocities of stage i; see `kinematics_interface.stage_jvp`."""
    for body in range(dq.shape[0] // FREEDOMS):
        c = COORDINATES * body
        d = FREEDOMS * body
        start = quaternion_at(q[0], c + 3)
        place = plus(vector_at(dq, d), times(h * table[VECTORS, NODES, i], vector_at(dv, d)))
        velocity = vector_at(dv, d)
        omega = vector_at(dv, d + 3)
        turn = (0.0, 0.0, 0.0)
        for j in range(first, i):
            w = h * table[BY_RATE, i, j]
            acceleration = changes[j, 2]
            place = plus(place, times(h * h * table[BY_STAGE, i, j], vector_at(acceleration, d)))
            if w != 0.0:
                velocity = plus(velocity, times(w, vector_at(acceleration, d)))
                omega = plus(omega, times(w, vector_at(acceleration, d + 3)))
                turn = plus(turn, times(w, _slope_change(start, q[j], v[j], dq, changes[j], c, d)))
        t = turn_between(start, quaternion_at(q[i], c + 3))
        put(changes[i, 0], d, place)
        put(changes[i, 0], d + 3, plus(back_turned(t, vector_at(dq, d + 3)), turn_rate(t, turn)))
        put(changes[i, 1], d, velocity)
        put(changes[i, 1], d + 3, omega)


@part
def _slope_change(start, q, v, dq, change, c, d):
    """The change of k = J(t)^-1 omega of a stage.

    start: the quaternion of the step's start. q (n_q,), v (n,), change (3, n): the stage's state, and its change.
    dq (n,): change of the start's coordinates. c, d: where the body begins in coordinates and in velocities.

    The change of its turn is that of t, by J(t), and the start's, seen behind the turn: what J(t)^-1 makes of the rest.
    """
    t = turn_between(start, quaternion_at(q, c + 3))
    rest = minus(vector_at(change[0], d + 3), back_turned(t, vector_at(dq, d + 3)))
    dt = vector_rate(t, rest)
    return plus(vector_rate_jvp(t, vector_at(v, d + 3), dt), vector_rate(t, vector_at(change[1], d + 3)))


@kernel
def end_jvp(model, table, s, h, q, v, changes, dq, dv):
    """Changes of the end of a step; see `kinematics_interface.end_jvp`."""
    turns = np.empty((s, dq.shape[0]))
    for body in range(dq.shape[0] // FREEDOMS):
        c = COORDINATES * body
        d = FREEDOMS * body
        start = quaternion_at(q[0], c + 3)
        turn = (0.0, 0.0, 0.0)
        place = plus(vector_at(dq, d), times(h, vector_at(dv, d)))
        velocity = vector_at(dv, d)
        omega = vector_at(dv, d + 3)
        for j in range(s):
            w = h * table[VECTORS, END_RATE, j]
            acceleration = changes[j, 2]
            place = plus(place, times(h * h * table[VECTORS, END, j], vector_at(acceleration, d)))
            velocity = plus(velocity, times(w, vector_at(acceleration, d)))
            omega = plus(omega, times(w, vector_at(acceleration, d + 3)))
            turn = plus(turn, times(w, _slope_change(start, q[j], v[j], dq, changes[j], c, d)))
        _find_turns(q, c, d, turns)
        t = _end_turn(table, h, turns, v, d)
        seen = plus(back_turned(t, vector_at(dq, d + 3)), turn_rate(t, turn))
        put(dq, d, place)
        put(dq, d + 3, seen)
        put(dv, d, velocity)
        put(dv, d + 3, omega)


@part
def _ends(q0, q1, v0, v1, i, d):
    """The rotation vector across a step and its rates at both ends.

    q0, q1 (n_q,), v0, v1 (n,): both ends. i, d: where the body begins in coordinates and in velocities.
    """
    way = turn_between(quaternion_at(q0, i + 3), quaternion_at(q1, i + 3))
    return way, vector_at(v0, d + 3), vector_rate(way, vector_at(v1, d + 3))


@part
def _cubic_vector(c, h, way, first, last):
    """The cubic of a rotation vector that is 0 at the start of a step, and its derivative.

    c, h: fraction of the step, and its length (s). way: what it is at the end. first, last: its rates at both ends.
    """
    _, b0, a1, b1, _, db0, da1, db1 = hermite(c)
    p = plus(times(a1, way), plus(times(h * b0, first), times(h * b1, last)))
    return p, plus(times(da1 / h, way), plus(times(db0, first), times(db1, last)))


@kernel
def _evenly(c, h, q0, v0, v1, q, v):
    """The cubic of a brief step, whose turns are so small that their rates are angular velocities.

    c, h: fraction of the step, and its length (s).
    q0 (n_q,), v0, v1 (n,): coordinates at its start, velocities at both ends.
    q (n_q,), v (n,): out.
    """
    first, last = shares_of_way(c, h)
    for body in range(v.shape[0] // FREEDOMS):
        i = COORDINATES * body
        for d in (FREEDOMS * body, FREEDOMS * body + 3):
            one = vector_at(v0, d)
            two = vector_at(v1, d)
            way = plus(times(first, one), times(last, two))
            put(v, d, plus(one, times(c, minus(two, one))))
            if d == FREEDOMS * body:
                put(q, i, plus(vector_at(q0, i), way))
            else:
                put_quaternion(q, i + 3, turn_by(quaternion_at(q0, i + 3), way))


@kernel
def cubic(model, c, h, q0, v0, q1, v1, q, v):
    """The cubic through both ends of a step; see `kinematics_interface.cubic`.

    Turns follow the cubic p of the rotation vector from the start: q = q_0 exp(p), omega = J(p) p'.
    """
    if is_brief(model, h):
        _evenly(c, h, q0, v0, v1, q, v)
        return
    a0, b0, a1, b1, _, db0, da1, db1 = hermite(c)
    for body in range(v.shape[0] // FREEDOMS):
        i = COORDINATES * body
        d = FREEDOMS * body
        one = vector_at(q0, i)
        two = vector_at(q1, i)
        first = vector_at(v0, d)
        last = vector_at(v1, d)
        put(q, i, plus(plus(times(a0, one), times(a1, two)), plus(times(h * b0, first), times(h * b1, last))))
        put(v, d, plus(times(da1 / h, minus(two, one)), plus(times(db0, first), times(db1, last))))
        way, first, last = _ends(q0, q1, v0, v1, i, d)
        p, rate = _cubic_vector(c, h, way, first, last)
        put_quaternion(q, i + 3, turn_by(quaternion_at(q0, i + 3), p))
        put(v, d + 3, turn_rate(p, rate))


@kernel
def cubic_vjp(model, c, h, q0, v0, q1, v1, bar_q, bar_v, start_q, start_v, end_q, end_v):
    """The cotangents of both ends of a cubic; see `kinematics_interface.cubic_vjp`."""
    if is_brief(model, h):
        evenly_vjp(c, h, bar_q, bar_v, start_q, start_v, end_q, end_v)
        return
    a0, b0, a1, b1, da0, db0, da1, db1 = hermite(c)
    for body in range(bar_q.shape[0] // FREEDOMS):
        i = COORDINATES * body
        d = FREEDOMS * body
        place = vector_at(bar_q, d)
        speed = vector_at(bar_v, d)
        put(start_q, d, plus(times(a0, place), times(da0 / h, speed)))
        put(start_v, d, plus(times(h * b0, place), times(db0, speed)))
        put(end_q, d, plus(times(a1, place), times(da1 / h, speed)))
        put(end_v, d, plus(times(h * b1, place), times(db1, speed)))
        way, first, last = _ends(q0, q1, v0, v1, i, d)
        p, rate = _cubic_vector(c, h, way, first, last)
        seen = vector_at(bar_q, d + 3)
        spin = vector_at(bar_v, d + 3)
        bar_p = plus(turn_rate(times(-1.0, p), seen), turn_rate_vjp(p, rate, spin))
        bar_rate = turn_rate(times(-1.0, p), spin)
        bar_last = plus(times(h * b1, bar_p), times(db1, bar_rate))
        bar_way = plus(times(a1, bar_p), times(da1 / h, bar_rate))
        bar_way = plus(bar_way, vector_rate_vjp(way, vector_at(v1, d + 3), bar_last))
        put(start_v, d + 3, plus(times(h * b0, bar_p), times(db0, bar_rate)))
        put(end_v, d + 3, vector_rate(times(-1.0, way), bar_last))
        # way = log(q_0^-1 q_1): J(way) dway is what q_1 turns by, less what q_0 does, seen from the end
        by_end = vector_rate(times(-1.0, way), bar_way)
        put(end_q, d + 3, by_end)
        put(start_q, d + 3, minus(back_turned(times(-1.0, p), seen), back_turned(times(-1.0, way), by_end)))


@kernel
def cubic_jvp(model, c, h, q0, v0, q1, v1, dq, dv, end_dq, end_dv):
    """The change of a cubic; see `kinematics_interface.cubic_jvp`."""
    if is_brief(model, h):
        evenly_jvp(c, h, dq, dv, end_dv)
        return
    a0, b0, a1, b1, _, db0, da1, db1 = hermite(c)
    for body in range(dq.shape[0] // FREEDOMS):
        i = COORDINATES * body
        d = FREEDOMS * body
        one = vector_at(dq, d)
        two = vector_at(end_dq, d)
        first = vector_at(dv, d)
        last = vector_at(end_dv, d)
        put(dq, d, plus(plus(times(a0, one), times(a1, two)), plus(times(h * b0, first), times(h * b1, last))))
        put(dv, d, plus(times(da1 / h, minus(two, one)), plus(times(db0, first), times(db1, last))))
        way, start, end = _ends(q0, q1, v0, v1, i, d)
        p, rate = _cubic_vector(c, h, way, start, end)
        turn = vector_at(dq, d + 3)
        first = vector_at(dv, d + 3)
        dway = vector_rate(way, minus(vector_at(end_dq, d + 3), back_turned(way, turn)))
        last = plus(vector_rate_jvp(way, vector_at(v1, d + 3), dway), vector_rate(way, vector_at(end_dv, d + 3)))
        dp = plus(times(a1, dway), plus(times(h * b0, first), times(h * b1, last)))
        drate = plus(times(da1 / h, dway), plus(times(db0, first), times(db1, last)))
        put(dq, d + 3, plus(back_turned(p, turn), turn_rate(p, dp)))
        put(dv, d + 3, plus(turn_rate_jvp(p, rate, dp), turn_rate(p, drate)))


@kernel
def quintic(model, c, h, q0, v0, a0, q1, v1, a1, q, v):
    """The quintic through both ends of a step; see `kinematics_interface.quintic`.

    Turns follow the quintic of the rotation vector from the start, whose rates at the end are J(t)^-1 omega and the
    derivative of that.
    """
    if is_brief(model, h):
        _evenly(c, h, q0, v0, v1, q, v)
        return
    for body in range(v.shape[0] // FREEDOMS):
        i = COORDINATES * body
        d = FREEDOMS * body
        for turning in range(2):
            k = d + 3 * turning
            speed = vector_at(v0, k)
            push = vector_at(a0, k)
            end_speed = vector_at(v1, k)
            end_push = vector_at(a1, k)
            way = (0.0, 0.0, 0.0)
            if turning == 0:
                way = minus(vector_at(q1, i), vector_at(q0, i))
            else:
                way = turn_between(quaternion_at(q0, i + 3), quaternion_at(q1, i + 3))
                omega = end_speed
                end_speed = vector_rate(way, omega)
                end_push = plus(vector_rate(way, end_push), vector_rate_jvp(way, omega, end_speed))
            along, rate = _quintic(c, h, speed, push, way, end_speed, end_push)
            if turning == 0:
                put(q, i, plus(vector_at(q0, i), along))
                put(v, k, rate)
            else:
                put_quaternion(q, i + 3, turn_by(quaternion_at(q0, i + 3), along))
                put(v, k, turn_rate(along, rate))


@part
def _quintic(c, h, v0, a0, way, v1, a1):
    """How far a quintic has come at fraction c of a step, and its derivative.

    h: length of the step (s). v0, a0, v1, a1: velocity and acceleration at both ends. way: how far it comes.
    """
    j = minus(way, times(h, plus(v0, times(0.5 * h, a0))))
    w = times(h, minus(minus(v1, v0), times(h, a0)))
    b = times(h * h, minus(a1, a0))
    x3 = plus(plus(times(10.0, j), times(-4.0, w)), times(0.5, b))
    x4 = minus(plus(times(-15.0, j), times(7.0, w)), b)
    x5 = plus(plus(times(6.0, j), times(-3.0, w)), times(0.5, b))
    inner = plus(x3, times(c, plus(x4, times(c, x5))))
    along = times(c, plus(times(h, v0), times(c, plus(times(0.5 * h * h, a0), times(c, inner)))))
    inner = plus(times(3.0, x3), times(c, plus(times(4.0, x4), times(5.0 * c, x5))))
    rate = plus(v0, times(c / h, plus(times(h * h, a0), times(c, inner))))
    return along, rate
