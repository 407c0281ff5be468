"""Relative pose of the two bodies of a pair, and how it changes with their coordinates.

    d = R_A^T (x_B - x_A),  theta = psi_B - psi_A,   xi = (d, theta),   xi' = T(q) v

T = dxi/dq (3 x 6, columns x_A y_A psi_A x_B y_B psi_B). With one member's row b = dL/dxi, its row of the
compatibility matrix (Eq. 32) is B = -b T, and dDelta/dq = -B (Eq. 36). Nothing here depends on members.
"""

from mdstopo.compiler.jit import part
from mdstopo.mechanics.angles import cos_sin

#: columns of a relative pose: d, cos and sin of theta, xi', cos and sin of psi_A, omega_A
DX, DY, COS, SIN, VX, VY, VT, COS_A, SIN_A, OMEGA_A = range(10)
POSE = 10


@part
def relative_pose(pair, q, v, rel):  # type: ignore[no-untyped-def]
    """Fill rel (n_pair, POSE) from one state q, v (n,)."""
    for p in range(pair.shape[0]):
        turn = q[3 * pair[p, 0] + 2]
        theta = q[3 * pair[p, 1] + 2] - turn
        ca, sa = cos_sin(turn)
        c, s = cos_sin(theta)
        fill_pose(pair, p, q, v, ca, sa, c, s, rel)


@part
def fill_pose(pair, p, q, v, ca, sa, c, s, rel):  # type: ignore[no-untyped-def]
    """Fill rel[p] from one state and the cos and sin of psi_A and of theta."""
    a = 3 * pair[p, 0]
    b = 3 * pair[p, 1]
    x = q[b] - q[a]
    y = q[b + 1] - q[a + 1]
    u = v[b] - v[a]
    w = v[b + 1] - v[a + 1]
    dx = ca * x + sa * y
    dy = ca * y - sa * x
    omega = v[a + 2]
    rel[p, 0] = dx
    rel[p, 1] = dy
    rel[p, 2] = c
    rel[p, 3] = s
    rel[p, 4] = ca * u + sa * w + omega * dy
    rel[p, 5] = ca * w - sa * u - omega * dx
    rel[p, 6] = v[b + 2] - omega
    rel[p, 7] = ca
    rel[p, 8] = sa
    rel[p, 9] = omega


@part
def copy_rows(source, target):  # type: ignore[no-untyped-def]
    """target = source, two-dimensional."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@part
def pair_displacement(pair, rel, p, dq, out):  # type: ignore[no-untyped-def]
    """out (3,) = T dq for pair p: the change of its relative pose under a change dq (n,) of all coordinates."""
    a = 3 * pair[p, 0]
    b = 3 * pair[p, 1]
    ca = rel[p, 7]
    sa = rel[p, 8]
    x = dq[b] - dq[a]
    y = dq[b + 1] - dq[a + 1]
    turn = dq[a + 2]
    out[0] = ca * x + sa * y + rel[p, 1] * turn
    out[1] = ca * y - sa * x - rel[p, 0] * turn
    out[2] = dq[b + 2] - turn


@part
def add_pair_force(pair, rel, p, qx, qy, qt, out):  # type: ignore[no-untyped-def]
    """out (n,) += T^T (qx, qy, qt): a force on the relative pose as forces and moments on both bodies."""
    a = 3 * pair[p, 0]
    b = 3 * pair[p, 1]
    ca = rel[p, 7]
    sa = rel[p, 8]
    fx = ca * qx - sa * qy
    fy = sa * qx + ca * qy
    out[b] += fx
    out[b + 1] += fy
    out[b + 2] += qt
    out[a] -= fx
    out[a + 1] -= fy
    out[a + 2] += qx * rel[p, 1] - qy * rel[p, 0] - qt
