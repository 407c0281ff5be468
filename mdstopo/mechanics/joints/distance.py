"""A rigid massless link: Phi = |d| - L between two points, d = x_B + c - x_A - p, e = d/|d|.

    Phi' = e . d',    Phi'' = e . d'' + (|d'|^2 - Phi'^2)/|d|

Where the points meet the link has no direction, and its rows are zero (which the balance reports as singular).
Parameters: s_A (2), s_B (2), -, -, -, L, |d|^2 - L^2 at home.
"""

import math

from mdstopo.case.joints import DistanceJoint
from mdstopo.compiler.jit import kernel
from mdstopo.mechanics.joints.joint_kernels import FITTED, AtHome, JointKernels
from mdstopo.mechanics.joints.revolute import apart_since, arms
from mdstopo.mechanics.laws.spring import elongation_of


@kernel
def _line(par, w, wd):
    """Arms, unit vector e, 1/length (0 at no length), relative velocity d', and rate of the length."""
    px, py, cx, cy = arms(par, w)
    x = w[3] + cx - w[0] - px
    y = w[4] + cy - w[1] - py
    length = math.sqrt(x * x + y * y)
    inverse = 1.0 / length if length > 1e-150 else 0.0
    ex = x * inverse
    ey = y * inverse
    dx = wd[3] - wd[5] * cy - wd[0] + wd[2] * py
    dy = wd[4] + wd[5] * cx - wd[1] - wd[2] * px
    rate = ex * dx + ey * dy
    return px, py, cx, cy, ex, ey, inverse, dx, dy, rate


@kernel
def distance_rows(par, w, phi, jac):
    """Phi of a distance joint, and its slopes Phi_q."""
    px, py, cx, cy = arms(par, w)
    x = w[3] + cx - w[0] - px
    y = w[4] + cy - w[1] - py
    length = math.sqrt(x * x + y * y)
    inverse = 1.0 / length if length > 1e-150 else 0.0
    ex = x * inverse
    ey = y * inverse
    ux, uy = apart_since(par, w)
    phi[0] = elongation_of(x, y, length, ux, uy, par[7], par[8])
    jac[0, 0] = -ex
    jac[0, 1] = -ey
    jac[0, 2] = ex * py - ey * px
    jac[0, 3] = ex
    jac[0, 4] = ey
    jac[0, 5] = ey * cx - ex * cy


@kernel
def distance_gamma(par, w, wd, gamma):
    """gamma of Phi_q a + gamma = 0: centripetal accelerations of the points, and that of the turning link."""
    px, py, cx, cy, ex, ey, inverse, dx, dy, rate = _line(par, w, wd)
    bx = wd[2] ** 2 * px - wd[5] ** 2 * cx
    by = wd[2] ** 2 * py - wd[5] ** 2 * cy
    gamma[0] = ex * bx + ey * by + (dx * dx + dy * dy - rate * rate) * inverse


@kernel
def distance_velocity_slope(par, w, wd, out):
    """Slopes of the rate of Phi by coordinates: d(Phi_q v)/dq, which is dPhi_q/dt."""
    px, py, cx, cy, ex, ey, inverse, dx, dy, rate = _line(par, w, wd)
    fx = inverse * (dx - rate * ex)
    fy = inverse * (dy - rate * ey)
    out[0, 0] = -fx
    out[0, 1] = -fy
    out[0, 2] = fx * py - fy * px + wd[2] * (ex * px + ey * py)
    out[0, 3] = fx
    out[0, 4] = fy
    out[0, 5] = fy * cx - fx * cy - wd[5] * (ex * cx + ey * cy)


@kernel
def distance_acceleration_slopes(par, w, wd, wdd, by_q, by_v):
    """Slopes of Phi_q a + gamma at fixed a.

    In:
      par (WIDTH,): parameters of the joint.
      w (PLACES,): where both bodies are (`revolute.place_joint`).
      wd, wdd (6,): their velocities and accelerations (m/s, rad/s; m/s^2, rad/s^2).
    Out:
      by_q (1 or more, 6): d(Phi_q a + gamma)/dq.
      by_v (1 or more, 6): d(gamma)/dv.
    """
    px, py, cx, cy, ex, ey, inverse, dx, dy, rate = _line(par, w, wd)
    wa = wd[2]
    wb = wd[5]
    bx = wdd[3] - wdd[5] * cy - wb * wb * cx - wdd[0] + wdd[2] * py + wa * wa * px
    by = wdd[4] + wdd[5] * cx - wb * wb * cy - wdd[1] - wdd[2] * px + wa * wa * py
    along = ex * bx + ey * by
    excess = (dx * dx + dy * dy - rate * rate) * inverse
    # slopes by d' and by d
    hx = 2.0 * inverse * (dx - rate * ex)
    hy = 2.0 * inverse * (dy - rate * ey)
    gx = inverse * (bx - along * ex) - rate * inverse * hx - excess * inverse * ex
    gy = inverse * (by - along * ey) - rate * inverse * hy - excess * inverse * ey
    by_q[0, 0] = -gx
    by_q[0, 1] = -gy
    by_q[0, 3] = gx
    by_q[0, 4] = gy
    by_v[0, 0] = -hx
    by_v[0, 1] = -hy
    by_v[0, 3] = hx
    by_v[0, 4] = hy
    for side in range(2):
        sign = -1.0 if side == 0 else 1.0
        rx = px if side == 0 else cx
        ry = py if side == 0 else cy
        om = wa if side == 0 else wb
        al = wdd[2] if side == 0 else wdd[5]
        by_q[0, 2 + 3 * side] = sign * (
            gy * rx - gx * ry - om * (hx * rx + hy * ry) + ex * (om * om * ry - al * rx) - ey * (om * om * rx + al * ry)
        )
        by_v[0, 2 + 3 * side] = sign * (hy * rx - hx * ry - 2.0 * om * (ex * rx + ey * ry))


@kernel
def distance_stiffness(par, w, lam, k):
    """Add the slopes of the joint's forces to k: lam d2|d|/dq2 = lam (u^T u (I - e e^T)/|d| and the turning of the
    arms)."""
    px, py, cx, cy = arms(par, w)
    x = w[3] + cx - w[0] - px
    y = w[4] + cy - w[1] - py
    length = math.sqrt(x * x + y * y)
    inverse = 1.0 / length if length > 1e-150 else 0.0
    ex = x * inverse
    ey = y * inverse
    # how far d moves across the link, by each coordinate: (-ey, ex) . dd/dw
    for i in range(6):
        across_i = _across(i, ex, ey, px, py, cx, cy)
        for j in range(6):
            k[i, j] += lam[0] * inverse * across_i * _across(j, ex, ey, px, py, cx, cy)
    k[2, 2] += lam[0] * (ex * px + ey * py)
    k[5, 5] -= lam[0] * (ex * cx + ey * cy)


@kernel
def _across(i, ex, ey, px, py, cx, cy):
    """How far d moves across the link by one coordinate, (-ey, ex) . dd/dw_i.

    i: the coordinate: x, y, angle of the first body, then of the second.
    ex, ey: unit vector along the link.
    px, py, cx, cy: arms of the points on both bodies (m), global axes.
    """
    if i == 0:
        return ey
    if i == 1:
        return -ex
    if i == 2:
        return -(ey * py + ex * px)
    if i == 3:
        return -ey
    if i == 4:
        return ex
    return ey * cy + ex * cx


def distance_at_home(joint: DistanceJoint, home: AtHome) -> dict[int, float]:
    """The square of the distance less that of the length; what only rounding has left of it is zero."""
    length = math.hypot(home.x, home.y)
    off = (length - joint.length) * (length + joint.length)
    return {8: off if abs(length - joint.length) > FITTED * home.size else 0.0}


KERNELS = JointKernels(
    at_home=distance_at_home,
    steady=((),),
    phi=distance_rows,
    gamma=distance_gamma,
    velocity_slope=distance_velocity_slope,
    acceleration_slopes=distance_acceleration_slopes,
    stiffness=distance_stiffness,
    force_rows=1,
)
