"""Applied and gyroscopic forces on bodies in space, and tangents of these and of what acts between two bodies.

Moments on a body are in its principal axes: its turning rate follows J omega' + omega x J omega = moment.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.vector import lanes, load, store
from mdstopo.mechanics.kinematics.spatial_poses import (
    D_RATE,
    FREEDOMS,
    OMEGA_A,
    ROTATIONS,
    TURN_A,
    D,
    S,
    W,
    turn_at,
)
from mdstopo.mechanics.kinematics.timed import ARM, BODY, DIRECTION, KIND, PUSH, TURNS, timed_load_size
from mdstopo.mechanics.kinematics.vectors import (
    add,
    by_columns,
    by_rows,
    cross,
    minus,
    plus,
    put,
    times,
    turned,
    turned_back,
    unit,
    vector_at,
)

#: values of `GeneralModel.load_follows`: force and moment are global; turn with the body; the moment stands for an
#: angular acceleration, global
GLOBAL, FOLLOWS, ACCELERATES = range(3)
#: where forces and tangents begin in sums over the members of a pair (`strides.sums_size`)
K, C = 2 * FREEDOMS + 1, 2 * FREEDOMS + 1 + FREEDOMS * FREEDOMS


@part
def _load(model, segment, k, first, tau):
    """Three numbers of load k from component `first` on, at time tau of a segment."""
    f = model.load_force[segment, k]
    return (
        f[first, 0] + tau * f[first, 1],
        f[first + 1, 0] + tau * f[first + 1, 1],
        f[first + 2, 0] + tau * f[first + 2, 1],
    )


@part
def _inertia_times(model, d, a):
    """J a for the body whose first freedom is d."""
    inertia = vector_at(model.mass, d + 3)
    return inertia[0] * a[0], inertia[1] * a[1], inertia[2] * a[2]


@kernel
def add_loads(model, segment, t, q, v, f):
    """Loads, gravity and gyroscopic moments; see `kinematics_interface.add_loads`."""
    tau = t - model.times[segment]
    force = model.force[segment]
    for i in range(force.shape[0]):
        f[i] += force[i, 0] + tau * force[i, 1]
    for body in range(model.home.shape[0]):
        d = FREEDOMS * body
        omega = vector_at(v, d + 3)
        add(f, d + 3, cross(_inertia_times(model, d, omega), omega))
    if model.load_body.shape[0] == 0 and model.timed_load.shape[0] == 0:
        return
    for k in range(model.load_body.shape[0]):
        turn = turn_at(model.home, model.load_body[k], q)
        push = _load(model, segment, k, 0, tau)
        moment = _load(model, segment, k, 3, tau)
        arm = vector_at(model.load_arm[k], 0)
        _apply(model, model.load_body[k], model.load_follows[k], arm, push, moment, turn, f)
    for k in range(model.timed_load.shape[0]):
        body = model.timed_load[k, BODY]
        turn = turn_at(model.home, body, q)
        arm, push, moment = _timed_load(model, segment, k, t)
        _apply(model, body, model.timed_load[k, TURNS], arm, push, moment, turn, f)


@part
def _timed_load(model, segment, k, t):
    """Point of attack, force and moment of a load that is a formula of time, of which it is one."""
    size = timed_load_size(model, segment, k, t)
    vector = times(size, vector_at(model.timed_arm[k], DIRECTION))
    nothing = (0.0, 0.0, 0.0)
    arm = vector_at(model.timed_arm[k], ARM)
    if model.timed_load[k, KIND] == PUSH:
        return arm, vector, nothing
    return arm, nothing, vector


@part
def _apply(model, body, follows, arm, push, moment, turn, f):
    """Add a force at a point of a body, and a moment.

    model: the compiled scene.
    body, follows: which, and as `load_follows`.
    arm: the point, in the body's frame (m).
    push, moment: the force (N), the moment (N m).
    turn: rows of R of the body.
    f (n,): in and out.
    """
    d = FREEDOMS * body
    if follows == FOLLOWS:
        add(f, d, by_rows(turn, push))
    else:
        add(f, d, push)
        push = by_columns(turn, push)
        moment = by_columns(turn, moment)
        if follows == ACCELERATES:
            moment = _inertia_times(model, d, moment)
    add(f, d + 3, plus(cross(arm, push), moment))


@kernel
def load_tangent(model, segment, t, q, v, turn):
    """Slopes of the loads and gyroscopic moments; see `kinematics_interface.load_tangent`.

    A global vector seen from the body changes by a x dtheta; -omega x J omega by J omega x d - omega x J d.
    """
    turn[:] = 0.0
    tau = t - model.times[segment]
    for body in range(model.home.shape[0]):
        d = FREEDOMS * body
        omega = vector_at(v, d + 3)
        spin = _inertia_times(model, d, omega)
        for c in range(3):
            e = unit(c)
            slope = minus(cross(spin, e), cross(omega, _inertia_times(model, d, e)))
            for i in range(3):
                turn[d + 3 + i, ROTATIONS + c] = slope[i]
    if model.load_body.shape[0] == 0 and model.timed_load.shape[0] == 0:
        return
    for k in range(model.load_body.shape[0]):
        rows = turn_at(model.home, model.load_body[k], q)
        push = _load(model, segment, k, 0, tau)
        moment = _load(model, segment, k, 3, tau)
        arm = vector_at(model.load_arm[k], 0)
        _add_slopes(model, model.load_body[k], model.load_follows[k], arm, push, moment, rows, turn)
    for k in range(model.timed_load.shape[0]):
        body = model.timed_load[k, BODY]
        rows = turn_at(model.home, body, q)
        arm, push, moment = _timed_load(model, segment, k, t)
        _add_slopes(model, body, model.timed_load[k, TURNS], arm, push, moment, rows, turn)


@part
def _add_slopes(model, body, follows, arm, push, moment, rows, turn):
    """Add the slopes of what `_apply` adds by the body's turn.

    model: the compiled scene.
    body, follows: which, and as `load_follows`.
    arm: the point, in the body's frame (m).
    push, moment: the force (N), the moment (N m).
    rows: of R of the body.
    turn (n, 6): in and out.
    """
    d = FREEDOMS * body
    if follows != FOLLOWS:
        push = by_columns(rows, push)
        moment = by_columns(rows, moment)
    for c in range(3):
        e = unit(c)
        if follows == FOLLOWS:
            slope = by_rows(rows, cross(e, push))
            for i in range(3):
                turn[d + i, c] += slope[i]
            continue
        slope = cross(moment, e)
        if follows == ACCELERATES:
            slope = _inertia_times(model, d, slope)
        slope = plus(slope, cross(arm, cross(push, e)))
        for i in range(3):
            turn[d + 3 + i, c] += slope[i]


@kernel
def loads_vjp(model, segment, t, q, v, z, bar_q, bar_v):
    """The transpose of `load_tangent`; see `kinematics_interface.loads_vjp`.

    As z . (J d x omega + J omega x d) = d . (J (omega x z) + z x J omega).
    """
    tau = t - model.times[segment]
    for body in range(model.home.shape[0]):
        d = FREEDOMS * body
        omega = vector_at(v, d + 3)
        own = vector_at(z, d + 3)
        spin = cross(own, _inertia_times(model, d, omega))
        add(bar_v, d + 3, plus(_inertia_times(model, d, cross(omega, own)), spin))
    for k in range(model.load_body.shape[0]):
        rows = turn_at(model.home, model.load_body[k], q)
        push = _load(model, segment, k, 0, tau)
        moment = _load(model, segment, k, 3, tau)
        arm = vector_at(model.load_arm[k], 0)
        _pull_load_back(model, model.load_body[k], model.load_follows[k], arm, push, moment, rows, z, bar_q)
    for k in range(model.timed_load.shape[0]):
        body = model.timed_load[k, BODY]
        rows = turn_at(model.home, body, q)
        arm, push, moment = _timed_load(model, segment, k, t)
        _pull_load_back(model, body, model.timed_load[k, TURNS], arm, push, moment, rows, z, bar_q)


@part
def _pull_load_back(model, body, follows, arm, push, moment, rows, z, bar_q):
    """The transpose of `_add_slopes`.

    model, body, follows, arm, push, moment, rows: as of `_add_slopes`.
    z (n,): cotangents of what the load adds.
    bar_q (n,): in and out.
    """
    d = FREEDOMS * body
    if follows == FOLLOWS:
        add(bar_q, d + 3, cross(push, by_columns(rows, vector_at(z, d))))
        return
    own = vector_at(z, d + 3)
    about = _inertia_times(model, d, own) if follows == ACCELERATES else own
    turning = cross(about, by_columns(rows, moment))
    add(bar_q, d + 3, plus(turning, cross(cross(own, arm), by_columns(rows, push))))


@kernel
def pair_tangent(model, p, rel, sums, damped, k_out, c_out):
    """The tangents of a pair; see `kinematics_interface.pair_tangent`.

    With dxi = T dq and, at given velocities, dxi' = N dq,  K = T^T (K_xi T + C_xi N) - d(T^T Q)/dq,  C = T^T C_xi T:

        d(d') = (d' + omega_A x d) x dtheta_A - omega_A x dd,      dw = dphi x (w + omega_A)
    """
    r = rel[p]
    o = sums[p]
    if damped:
        _damped_tangent(r, o, k_out[p], c_out[p])
    else:
        for i in range(FREEDOMS):
            _times_slopes(r, vector_at(o, K + FREEDOMS * i), vector_at(o, K + FREEDOMS * i + 3), k_out[p, i])
        _pull_pose_back(r, k_out[p], k_out[p])
    _add_turning_of_force(r, o, k_out[p])


@part
def _times_slopes(r, push, moment, out):
    """out (2 D,) = (push, moment) T, of the pose r (POSE,): one row, by 3 x 3 blocks."""
    move = turned(r, TURN_A, push)
    put(out, 0, times(-1.0, move))
    put(out, 3, minus(cross(push, vector_at(r, D)), moment))
    put(out, 6, move)
    put(out, 9, turned_back(r, S, moment))


@part
def _pull_pose_back(r, inner, out):
    """out (2 D, 2 D) = T^T inner, of the pose r (POSE,), by 3 x 3 blocks; inner (D, 2 D) may be out's first rows.

    A vector has a row of `inner` from column 0, 4 or the last one with room for it on, all read before any is written.
    """
    last = 2 * FREEDOMS - lanes()
    columns = _columns(inner, 0)
    others = _columns(inner, 4)
    rest = _columns(inner, last)
    _store_pulled(r, columns, 0, out)
    _store_pulled(r, others, 4, out)
    _store_pulled(r, rest, last, out)


@part
def _columns(inner, j):
    """Of inner (D, 2 D) vectors of columns from j on: of the first three rows, of the others."""
    return (
        (load(inner[0], j), load(inner[1], j), load(inner[2], j)),
        (load(inner[3], j), load(inner[4], j), load(inner[5], j)),
    )


@part
def _store_pulled(r, columns, j, out):
    """`_pull_pose_back` of columns from j on, as `_columns` has them."""
    push, moment = columns
    move = turned(r, TURN_A, push)
    first = minus(cross(push, vector_at(r, D)), moment)
    second = turned_back(r, S, moment)
    for i in range(3):
        store(out[i], j, -1.0 * move[i])
        store(out[3 + i], j, first[i])
        store(out[6 + i], j, move[i])
        store(out[9 + i], j, second[i])


@part
def _add_turning_of_force(r, o, k):
    """k (2 D, 2 D) += the change of the force's direction and arm at fixed Q, - d(T^T Q)/dq.

    r (POSE,): the pose. o (SUMS,): sums over the members of the pair.
    """
    push = vector_at(o, 0)
    moment = vector_at(o, 3)
    arm = vector_at(r, D)
    for c in range(3):
        e = unit(c)
        towards = (r[TURN_A + 3 * c], r[TURN_A + 3 * c + 1], r[TURN_A + 3 * c + 2])
        along = cross(push, towards)
        turning = cross(push, cross(arm, e))
        force = turned(r, TURN_A, cross(e, push))
        opposite = turned_back(r, S, cross(moment, e))
        column = (r[S + c], r[S + 3 + c], r[S + 6 + c])
        own = turned_back(r, S, cross(moment, column))
        for i in range(3):
            k[3 + i, c] += along[i]
            k[3 + i, 6 + c] -= along[i]
            k[3 + i, 3 + c] -= turning[i]
            k[i, 3 + c] += force[i]
            k[6 + i, 3 + c] -= force[i]
            k[9 + i, 3 + c] += opposite[i]
            k[9 + i, 9 + c] -= own[i]


@part
def _damped_tangent(r, o, k, c):
    """k, c (2 D, 2 D) = T^T (K_xi T + C_xi N), T^T C_xi T of the pose r (POSE,) and sums o (SUMS,)."""
    t = np.empty((FREEDOMS, 2 * FREEDOMS))
    n = np.empty((FREEDOMS, 2 * FREEDOMS))
    inner = np.zeros((FREEDOMS, 2 * FREEDOMS))
    by_rate = np.zeros((FREEDOMS, 2 * FREEDOMS))
    _slopes_of_pose(r, t)
    _slopes_of_rates(r, t, n)
    for i in range(FREEDOMS):
        _times_slopes(r, vector_at(o, K + FREEDOMS * i), vector_at(o, K + FREEDOMS * i + 3), inner[i])
        for m in range(FREEDOMS):
            low = min(i, m)
            high = max(i, m)
            value = o[C + high * (high + 1) // 2 + low]
            if value != 0.0:
                for j in range(2 * FREEDOMS):
                    inner[i, j] += value * n[m, j]
                    by_rate[i, j] += value * t[m, j]
    _pull_pose_back(r, by_rate, c)
    _pull_pose_back(r, inner, k)


@part
def _slopes_of_pose(r, t):
    """T (D, 2 D) = dxi/dq of the pose r (POSE,)."""
    t[:] = 0.0
    d = vector_at(r, D)
    for c in range(3):
        e = unit(c)
        arm = cross(d, e)
        for i in range(3):
            t[i, c] = -r[TURN_A + 3 * c + i]
            t[i, 6 + c] = r[TURN_A + 3 * c + i]
            t[i, 3 + c] = arm[i]
            t[3 + i, 3 + c] = -e[i]
            t[3 + i, 9 + c] = r[S + 3 * i + c]


@part
def _slopes_of_rates(r, t, n):
    """N (D, 2 D) = dxi'/dq at given velocities, from the pose r (POSE,) and its slopes t (D, 2 D)."""
    omega = vector_at(r, OMEGA_A)
    speed = plus(vector_at(r, D_RATE), cross(omega, vector_at(r, D)))
    spin = plus(vector_at(r, W), omega)
    for c in range(2 * FREEDOMS):
        move = cross((t[0, c], t[1, c], t[2, c]), omega)
        turn = cross((t[3, c], t[4, c], t[5, c]), spin)
        if c >= 3 and c < 6:
            e = unit(c - 3)
            move = plus(move, cross(speed, e))
        for i in range(3):
            n[i, c] = move[i]
            n[3 + i, c] = turn[i]


@part
def pair_matrix_vjp(model, p, m, z, bar):
    """bar -= m^T z; see `kinematics_interface.pair_matrix_vjp`."""
    for side in range(2):
        first = FREEDOMS * side
        at = FREEDOMS * model.pair[p, side]
        push = (0.0, 0.0, 0.0)
        moment = (0.0, 0.0, 0.0)
        for i in range(2):
            own = FREEDOMS * model.pair[p, i]
            for r in range(FREEDOMS):
                row = m[FREEDOMS * i + r]
                along = z[own + r]
                push = plus(push, times(along, vector_at(row, first)))
                moment = plus(moment, times(along, vector_at(row, first + 3)))
        put(bar, at, minus(vector_at(bar, at), push))
        put(bar, at + 3, minus(vector_at(bar, at + 3), moment))


@part
def pair_pose_vjp(model, p, rel, sums, z, bar):
    """bar -= K^T z without K; see `kinematics_interface.pair_pose_vjp`.

    With u = (u_d, u_phi) = T z, Q = (f, m) and K = T^T K_xi T - d(T^T Q)/dq, of which the second part is

        turns of the first body:  -f x u_d,     of the second:  -S^T (m x u_phi),
        places of the first body: R_A (dtheta_A x f), of the second the opposite,

    K^T z = T^T (K_xi^T u - (z_A x f, S z_B x m)), and for the turn of the first body R_A^T (z_xB - z_xA) x f besides;
    z_A and z_B are the turns in z, z_xA and z_xB its places.
    """
    i = FREEDOMS * model.pair[p, 0]
    j = FREEDOMS * model.pair[p, 1]
    r = rel[p]
    o = sums[p]
    push = vector_at(o, 0)
    moment = vector_at(o, 3)
    d = vector_at(r, D)
    first = vector_at(z, i + 3)
    second = turned(r, S, vector_at(z, j + 3))
    apart = turned_back(r, TURN_A, minus(vector_at(z, j), vector_at(z, i)))
    by_shift = cross(push, first)
    by_turn = cross(moment, second)
    move = plus(apart, cross(d, first))
    turn = minus(second, first)
    for c in range(3):
        along = move[0] if c == 0 else move[1] if c == 1 else move[2]
        about = turn[0] if c == 0 else turn[1] if c == 1 else turn[2]
        at = K + FREEDOMS * c
        other = at + 3 * FREEDOMS
        by_shift = plus(by_shift, plus(times(along, vector_at(o, at)), times(about, vector_at(o, other))))
        by_turn = plus(by_turn, plus(times(along, vector_at(o, at + 3)), times(about, vector_at(o, other + 3))))
    force = turned(r, TURN_A, by_shift)
    put(bar, j, minus(vector_at(bar, j), force))
    put(bar, j + 3, minus(vector_at(bar, j + 3), turned_back(r, S, by_turn)))
    add(bar, i, force)
    own = minus(plus(cross(by_shift, d), cross(apart, push)), by_turn)
    put(bar, i + 3, minus(vector_at(bar, i + 3), own))


@part
def pair_stiffness(model, sums, p):
    """The trace of the stiffness against displacements."""
    return sums[p, K] + sums[p, K + FREEDOMS + 1] + sums[p, K + 2 * (FREEDOMS + 1)]
