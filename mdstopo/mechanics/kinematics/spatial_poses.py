"""Attitudes of bodies in space, and the relative pose of the two bodies of a pair.

    R = R_home E(e),   d = R_A^T (x_B - x_A),   S = R_A^T R_B,   xi' = (d', w),   w = S omega_B - omega_A

e is the unit quaternion by which a body has turned since home. Turning rates, and the small turns of a change, are
three numbers in the body's own principal axes; those of a relative pose are in the axes of the first body:

    dd = R_A^T (dx_B - dx_A) + d x dtheta_A,      dphi = S dtheta_B - dtheta_A      (dS = dphi x S)

What has changed since home is found without forming the difference of two poses: that keeps all digits of members
that hardly stretch.
"""

import numpy as np

from mdstopo.compiler.fields import FloatArray
from mdstopo.compiler.jit import kernel, part
from mdstopo.mechanics.kinematics.vectors import (
    add,
    column_of,
    cross,
    dot,
    minus,
    plus,
    put,
    row_of,
    times,
    turned,
    turned_back,
    vector_at,
)

COORDINATES, FREEDOMS, ROTATIONS = 7, 6, 3
#: columns of `GeneralModel.home`: x, y, z; R by rows; the matrix by rows that turns principal into the case's body axes
HOME_PLACE, HOME_TURN, HOME_AXES = 0, 3, 12
HOME = 21
#: numbers of an attitude: R by rows, and by how much it has changed since home
TURN, TURN_SINCE = 0, 9
ATTITUDE = 18
#: columns of a relative pose: d; S by rows; d'; w; R_A by rows; omega_A; what d and S have changed by since home
D, S, D_RATE, W, TURN_A, OMEGA_A, D_SINCE, S_SINCE = 0, 3, 12, 15, 18, 27, 30, 33
POSE = 42


@part
def fill_attitude(home, body, q, out, at):
    """The attitude of a body, ATTITUDE numbers from place `at` of `out` on.

    home (n_body, HOME): bodies at home. body: its number. q (n_q,): coordinates.
    """
    h = home[body]
    first, second, third = _turned_since(h, body, q)
    for c in range(3):
        since = first if c == 0 else second if c == 1 else third
        for r in range(3):
            out[at + TURN_SINCE + 3 * r + c] = since[r]
            out[at + TURN + 3 * r + c] = h[HOME_TURN + 3 * r + c] + since[r]


@part
def _turned_since(h, body, q):
    """The columns of R_home (E - I) of a body; with e = (w, u), E - I = 2 w [u] + 2 [u]^2 has no difference of large
    numbers.

    h (HOME,): the body at home. body: its number. q (n_q,): coordinates.
    """
    b = COORDINATES * body + 3
    w, x, y, z = q[b], q[b + 1], q[b + 2], q[b + 3]
    first = (-2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y))
    second = (2.0 * (x * y - w * z), -2.0 * (x * x + z * z), 2.0 * (y * z + w * x))
    third = (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), -2.0 * (x * x + y * y))
    return turned(h, HOME_TURN, first), turned(h, HOME_TURN, second), turned(h, HOME_TURN, third)


@part
def turn_at(home, body, q):
    """The rows of R of a body, as vectors; home, body, q: as of `fill_attitude`."""
    h = home[body]
    a, b, c = _turned_since(h, body, q)
    return (
        (h[HOME_TURN] + a[0], h[HOME_TURN + 1] + b[0], h[HOME_TURN + 2] + c[0]),
        (h[HOME_TURN + 3] + a[1], h[HOME_TURN + 4] + b[1], h[HOME_TURN + 5] + c[1]),
        (h[HOME_TURN + 6] + a[2], h[HOME_TURN + 7] + b[2], h[HOME_TURN + 8] + c[2]),
    )


@kernel
def turn_bodies(model, q, turned):
    """Attitudes of all bodies; see `kinematics_interface.turn_bodies`."""
    for b in range(turned.shape[0]):
        fill_attitude(model.home, b, q, turned[b], 0)


@kernel
def fill_pose(model, p, attitude_a, attitude_b, q, v, r):
    """The relative pose of a pair.

    With D_0 the vector between the bodies at home and w the change of it,

        d - d_0 = R_A^T w + (R_A - R_A0)^T D_0,      S - S_0 = (R_A - R_A0)^T R_B + R_A0^T (R_B - R_B0)

    In:
      model: the compiled scene.
      p: number of the pair.
      attitude_a, attitude_b (ATTITUDE,): of both bodies.
      q (n_q,), v (n,): coordinates and velocities.
    Out:
      r (POSE,): the pose.
    """
    one = model.pair[p, 0]
    two = model.pair[p, 1]
    a = COORDINATES * one
    b = COORDINATES * two
    home_a = model.home[one]
    home_b = model.home[two]
    at_home = minus(vector_at(home_b, HOME_PLACE), vector_at(home_a, HOME_PLACE))
    moved = minus(vector_at(q, b), vector_at(q, a))
    d = turned_back(attitude_a, TURN, plus(at_home, moved))
    put(r, D, d)
    put(r, D_SINCE, plus(turned_back(attitude_a, TURN, moved), turned_back(attitude_a, TURN_SINCE, at_home)))
    for c in range(3):
        column = column_of(attitude_b, TURN, c)
        whole = turned_back(attitude_a, TURN, column)
        since = plus(
            turned_back(attitude_a, TURN_SINCE, column),
            turned_back(home_a, HOME_TURN, column_of(attitude_b, TURN_SINCE, c)),
        )
        for i in range(3):
            r[S + 3 * i + c] = whole[i]
            r[S_SINCE + 3 * i + c] = since[i]
    for i in range(9):
        r[TURN_A + i] = attitude_a[TURN + i]
    a = FREEDOMS * one
    b = FREEDOMS * two
    omega = vector_at(v, a + 3)
    rate = turned_back(attitude_a, TURN, minus(vector_at(v, b), vector_at(v, a)))
    put(r, D_RATE, minus(rate, cross(omega, d)))
    put(r, W, minus(turned(r, S, vector_at(v, b + 3)), omega))
    put(r, OMEGA_A, omega)


@kernel
def turned_pose(model, p, turned, q, v, rel):
    """The relative pose of one pair; see `kinematics_interface.turned_pose`."""
    fill_pose(model, p, turned[model.pair[p, 0]], turned[model.pair[p, 1]], q, v, rel[p])


@part
def pose_acceleration(model, rel, p, a, out):
    """Second derivatives of a relative pose; see `kinematics_interface.pose_acceleration`.

    d'' = R_A^T D'' + d x omega_A' + 2 d' x omega_A + omega_A x (d x omega_A), w' = S omega_B' - omega_A' + w x omega_A.
    """
    i = FREEDOMS * model.pair[p, 0]
    j = FREEDOMS * model.pair[p, 1]
    r = rel[p]
    omega = vector_at(r, OMEGA_A)
    turn = vector_at(a, i + 3)
    d = vector_at(r, D)
    x = turned_back(r, TURN_A, minus(vector_at(a, j), vector_at(a, i)))
    x = plus(x, plus(cross(d, turn), times(2.0, cross(vector_at(r, D_RATE), omega))))
    put(out, 0, plus(x, cross(omega, cross(d, omega))))
    y = minus(turned(r, S, vector_at(a, j + 3)), turn)
    put(out, 3, plus(y, cross(vector_at(r, W), omega)))


@part
def pair_displacement(model, rel, p, dq, out):
    """The change of a relative pose; see `kinematics_interface.pair_displacement`."""
    i = FREEDOMS * model.pair[p, 0]
    j = FREEDOMS * model.pair[p, 1]
    r = rel[p]
    turn = vector_at(dq, i + 3)
    move = turned_back(r, TURN_A, minus(vector_at(dq, j), vector_at(dq, i)))
    put(out, 0, plus(move, cross(vector_at(r, D), turn)))
    put(out, 3, minus(turned(r, S, vector_at(dq, j + 3)), turn))


@part
def add_pair_force(model, rel, p, force, first, out):
    """A force on a relative pose as forces on its bodies; see `kinematics_interface.add_pair_force`."""
    i = FREEDOMS * model.pair[p, 0]
    j = FREEDOMS * model.pair[p, 1]
    r = rel[p]
    push = vector_at(force, first)
    moment = vector_at(force, first + 3)
    f = turned(r, TURN_A, push)
    add(out, j, f)
    add(out, j + 3, turned_back(r, S, moment))
    add(out, i, times(-1.0, f))
    add(out, i + 3, minus(cross(push, vector_at(r, D)), moment))


@part
def deflection_of(r, r0, reach):
    """How far the second body has moved between two poses (POSE,) as the first one sees it, at its points (m)."""
    u = minus(vector_at(r, D_SINCE), vector_at(r0, D_SINCE))
    turn = 0.0
    for i in range(9):
        turn += (r[S_SINCE + i] - r0[S_SINCE + i]) ** 2
    return dot(u, u) ** 0.5 + reach * (0.5 * turn) ** 0.5


@part
def axis_of(model, body, k):
    """Axis k of a body as the case has it, in its principal axes."""
    return row_of(model.home[body], HOME_AXES, k)


def ends(poses: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Places, turns and their rates of relative poses (n, POSE); see `kinematics_interface.Kinematics`."""
    turn = poses[:, S : S + 9].reshape(-1, 3, 3)
    rate = np.cross(poses[:, W : W + 3, None], turn, axis=1)
    return poses[:, D : D + 3], turn, poses[:, D_RATE : D_RATE + 3], rate
