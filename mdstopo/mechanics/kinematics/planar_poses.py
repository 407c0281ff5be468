"""Relative pose of the two bodies of a pair, and how it changes with their coordinates.

    d = R_A^T (x_B - x_A),  theta = psi_B - psi_A,   xi = (d, theta),   xi' = T(q) v

T = dxi/dq (3 x 6, columns x_A y_A psi_A x_B y_B psi_B). With one member's row b = dL/dxi, its row of the
compatibility matrix (Eq. 32) is B = -b T, and dDelta/dq = -B (Eq. 36). Nothing here depends on members.

The coordinates q of a body are what it has moved since a place of its own, its home: (x, y, psi) = home + q. A pose
tells by how much it differs from the one at home, too, without forming the difference of two poses: that keeps all
digits of members that hardly stretch.
"""

import math

import numpy as np

from mdstopo.compiler.fields import FloatArray
from mdstopo.compiler.jit import part
from mdstopo.scene.springs_model import HOME_COS, HOME_SIN, HOME_X, HOME_Y

#: columns of a relative pose: d, cos and sin of theta, xi', cos and sin of psi_A, omega_A, then what has changed since
#: home: d - d_0, cos theta - cos theta_0, sin theta - sin theta_0
DX, DY, COS, SIN, VX, VY, VT, COS_A, SIN_A, OMEGA_A, UX, UY, UC, US = range(14)
POSE = 14


@part
def small_turn(angle):
    """cos - 1 and sin of an angle, rad; the first as -2 sin^2(angle/2), which loses no digits of a small angle."""
    half = math.sin(0.5 * angle)
    return -2.0 * half * half, math.sin(angle)


@part
def turned_body(home, body, angle):
    """cos and sin of a body's psi when it has turned by an angle since home, and by how much they have changed."""
    m, s = small_turn(angle)
    return turned_from(home, body, m, s)


@part
def turned_from(home, body, m, s):
    """`turned_body` from cos - 1 and sin of the angle."""
    c0 = home[body, HOME_COS]
    s0 = home[body, HOME_SIN]
    dc = c0 * m - s0 * s
    ds = s0 * m + c0 * s
    return c0 + dc, s0 + ds, dc, ds


@part
def relative_pose(pair, home, q, v, rel):
    """Fill rel (n_pair, POSE) from one state q, v (n,): displacements since home (n_body, 5), and velocities."""
    for p in range(pair.shape[0]):
        ma, sa = small_turn(q[3 * pair[p, 0] + 2])
        mb, sb = small_turn(q[3 * pair[p, 1] + 2])
        fill_pose(pair, p, home, q, v, ma, sa, mb, sb, rel)


@part
def fill_pose(pair, p, home, q, v, ma, sa, mb, sb, rel):
    """Fill the relative pose of pair p from one state, with the turns of both bodies given.

    With D_0 the vector between the bodies at home and w the change of it,

        d - d_0 = R_A^T w + (R_A - R_A0)^T D_0,      R - R_0 = R_0 (R(theta - theta_0) - I),

    of which no term is larger than what has changed.

    In:
      pair (n_pair, 2): the bodies of each pair.
      p: number of the pair.
      home (n_body, HOME): where bodies are when q is zero.
      q, v (n,): coordinates and velocities (m, rad; m/s, rad/s).
      ma, sa: cos - 1 and sin of the angle by which the first body has turned since home.
      mb, sb: the same of the second body.
    Out:
      rel (n_pair, POSE): of which [p] is written.
    """
    one = pair[p, 0]
    two = pair[p, 1]
    a = 3 * one
    b = 3 * two
    ca = home[one, HOME_COS]
    sine_a = home[one, HOME_SIN]
    cb = home[two, HOME_COS]
    sine_b = home[two, HOME_SIN]
    home_x = home[two, HOME_X] - home[one, HOME_X]
    home_y = home[two, HOME_Y] - home[one, HOME_Y]
    c0 = ca * cb + sine_a * sine_b
    s0 = ca * sine_b - sine_a * cb
    # of the relative turn: cos - 1 and sin
    m = ma + mb + ma * mb + sa * sb
    s = sb - sa + (sb * ma - sa * mb)
    dc = ca * ma - sine_a * sa
    ds = sine_a * ma + ca * sa
    ca += dc
    sine_a += ds
    wx = q[b] - q[a]
    wy = q[b + 1] - q[a + 1]
    x = home_x + wx
    y = home_y + wy
    u = v[b] - v[a]
    w = v[b + 1] - v[a + 1]
    dx = ca * x + sine_a * y
    dy = ca * y - sine_a * x
    omega = v[a + 2]
    uc = c0 * m - s0 * s
    us = s0 * m + c0 * s
    rel[p, DX] = dx
    rel[p, DY] = dy
    rel[p, COS] = c0 + uc
    rel[p, SIN] = s0 + us
    rel[p, VX] = ca * u + sine_a * w + omega * dy
    rel[p, VY] = ca * w - sine_a * u - omega * dx
    rel[p, VT] = v[b + 2] - omega
    rel[p, COS_A] = ca
    rel[p, SIN_A] = sine_a
    rel[p, OMEGA_A] = omega
    rel[p, UX] = (ca * wx + sine_a * wy) + (dc * home_x + ds * home_y)
    rel[p, UY] = (ca * wy - sine_a * wx) + (dc * home_y - ds * home_x)
    rel[p, UC] = uc
    rel[p, US] = us


@part
def copy_rows(source, target):
    """target = source, two-dimensional."""
    for i in range(source.shape[0]):
        one = source[i]
        other = target[i]
        for j in range(source.shape[1]):
            other[j] = one[j]


@part
def pair_displacement(pair, rel, p, dq, out):
    """out (3,) = T dq for pair p: the change of its relative pose under a change dq (n,) of all coordinates."""
    a = 3 * pair[p, 0]
    b = 3 * pair[p, 1]
    ca = rel[p, COS_A]
    sa = rel[p, SIN_A]
    x = dq[b] - dq[a]
    y = dq[b + 1] - dq[a + 1]
    turn = dq[a + 2]
    out[0] = ca * x + sa * y + rel[p, DY] * turn
    out[1] = ca * y - sa * x - rel[p, DX] * turn
    out[2] = dq[b + 2] - turn


@part
def add_pair_force(pair, rel, p, qx, qy, qt, out):
    """Add a force on the relative pose of a pair to the forces on its bodies, T^T (qx, qy, qt).

    In:
      pair (n_pair, 2): the bodies of each pair.
      rel (n_pair, POSE): relative poses.
      p: number of the pair.
      qx, qy, qt: force on d_x, d_y (N), in the axes of the first body, and on theta (N m).
    Out:
      out (n,): forces and moments on the coordinates (N, N m), added to.
    """
    a = 3 * pair[p, 0]
    b = 3 * pair[p, 1]
    ca = rel[p, COS_A]
    sa = rel[p, SIN_A]
    fx = ca * qx - sa * qy
    fy = sa * qx + ca * qy
    out[b] += fx
    out[b + 1] += fy
    out[b + 2] += qt
    out[a] -= fx
    out[a + 1] -= fy
    out[a + 2] += qx * rel[p, DY] - qy * rel[p, DX] - qt


def ends(poses: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Places, turns and their rates of relative poses (n, POSE); see `kinematics_interface.Kinematics`."""
    turn = np.stack([poses[:, [COS, SIN]], poses[:, [SIN, COS]] * [-1.0, 1.0]], axis=2)
    quarter = np.stack([-turn[:, 1], turn[:, 0]], axis=1)
    return poses[:, [DX, DY]], turn, poses[:, [VX, VY]], poses[:, VT, None, None] * quarter
