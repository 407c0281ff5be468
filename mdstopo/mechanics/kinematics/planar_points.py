"""Motion of a point, or of an angle, of body b as an observer riding on body r sees it.

    p = R_r^T u,   u = x_b + c - x_r,  c = R_b s;      displacement p - p(start), velocity p', acceleration p''

With A = R_r^T, J the quarter turn and w the turning rate of r:

    p' = A (u' - w J u),     p'' = A (u'' - 2 w J u' - w' J u - w^2 u)

The slopes follow by c_psi = J c, A_psi = -A J, and for c' = w_b J c, c'' = w_b' J c - w_b^2 c.
"""

import math

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.mechanics.kinematics.components import ACCELERATION, ACROSS, DISPLACEMENT, VELOCITY, X, Y
from mdstopo.mechanics.kinematics.planar_poses import small_turn


@kernel
def turned(home, angle):
    """What `planar_poses.turned_body` gives for a body, from its row of `home` and the angle it has turned by (rad)."""
    m, s = small_turn(angle)
    c = home[3] * m - home[4] * s
    s = home[4] * m + home[3] * s
    return home[3] + c, home[4] + s, c, s


@kernel
def point_response(order, component, s, before, home_b, home_r, qb, vb, ab, qr, vr, ar, slope):
    """Displacement, velocity or acceleration of a point of body b as seen from body r: a component or the norm.

    The norm's slope is zero where the norm is.

    In:
      order: DISPLACEMENT, VELOCITY or ACCELERATION.
      component: X, Y or NORM; ACROSS: the norm, with the slopes of the component perpendicular to the vector, a quarter
        turn ahead.
      s (2,): the point in the frame of b (m).
      before (2,): the displacement that displacements count from, along the axes of r (m).
      home_b, home_r (HOME,): where the observed body b and the observer's body r are at home.
      qb, vb, ab (3,): what b has moved since, its velocities and accelerations (m, rad and derivatives).
      qr, vr, ar (3,): the same of r; accelerations are read for ACCELERATION only.
    Out:
      slope (6, 3): by q_b, v_b, a_b, q_r, v_r, a_r.

    Returns the response (m, m/s or m/s^2).
    """
    cb, sb, cb_since, sb_since = turned(home_b, qb[2])
    ca, sa, ca_since, sa_since = turned(home_r, qr[2])
    cx = cb * s[0] - sb * s[1]
    cy = sb * s[0] + cb * s[1]
    # what u is at home, and what it has changed by
    home_x = home_b[0] - home_r[0] + home_b[3] * s[0] - home_b[4] * s[1]
    home_y = home_b[1] - home_r[1] + home_b[4] * s[0] + home_b[3] * s[1]
    since_x = qb[0] - qr[0] + (cb_since * s[0] - sb_since * s[1])
    since_y = qb[1] - qr[1] + (sb_since * s[0] + cb_since * s[1])
    ux = home_x + since_x
    uy = home_y + since_y
    wb = vb[2]
    w = vr[2]
    # global vector y, whose components along r's axes are the response
    if order == DISPLACEMENT:
        yx = ux
        yy = uy
    else:
        dx = vb[0] - wb * cy - vr[0]
        dy = vb[1] + wb * cx - vr[1]
        yx = dx + w * uy
        yy = dy - w * ux
        if order == ACCELERATION:
            ddx = ab[0] - ab[2] * cy - wb * wb * cx - ar[0]
            ddy = ab[1] + ab[2] * cx - wb * wb * cy - ar[1]
            yx = ddx + 2.0 * w * dy + ar[2] * uy - w * w * ux
            yy = ddy - 2.0 * w * dx - ar[2] * ux - w * w * uy
    gx = ca * yx + sa * yy
    gy = ca * yy - sa * yx
    if order == DISPLACEMENT:
        gx = ca * since_x + sa * since_y + (ca_since * home_x + sa_since * home_y) - before[0]
        gy = ca * since_y - sa * since_x + (ca_since * home_y - sa_since * home_x) - before[1]
    # the weights of the two components
    if component == X:
        value = gx
        ex = 1.0
        ey = 0.0
    elif component == Y:
        value = gy
        ex = 0.0
        ey = 1.0
    else:
        value = math.sqrt(gx * gx + gy * gy)
        ex = gx / value if value > 0.0 else 0.0
        ey = gy / value if value > 0.0 else 0.0
        if component == ACROSS:
            ex, ey = -ey, ex
    # in global axes: dg = e . dy, and r's own turning turns y against its axes
    nx = ca * ex - sa * ey
    ny = sa * ex + ca * ey
    for i in range(6):
        for j in range(3):
            slope[i, j] = 0.0
    slope[3, 2] = nx * yy - ny * yx
    if order == DISPLACEMENT:
        slope[0, 0] = nx
        slope[0, 1] = ny
        slope[0, 2] = ny * cx - nx * cy
        slope[3, 0] = -nx
        slope[3, 1] = -ny
        return value
    if order == VELOCITY:
        # y = u' - w J u:  by u' n, by u  w (ny', ..): y_x = .. + w u_y, y_y = .. - w u_x
        px = -w * ny
        py = w * nx
        slope[0, 0] = px
        slope[0, 1] = py
        slope[0, 2] = py * cx - px * cy - wb * (nx * cx + ny * cy)
        slope[1, 0] = nx
        slope[1, 1] = ny
        slope[1, 2] = ny * cx - nx * cy
        slope[3, 0] = -px
        slope[3, 1] = -py
        slope[4, 0] = -nx
        slope[4, 1] = -ny
        slope[4, 2] = nx * uy - ny * ux
        return value
    # by u, u' and u''
    px = -ar[2] * ny - w * w * nx
    py = ar[2] * nx - w * w * ny
    vx = -2.0 * w * ny
    vy = 2.0 * w * nx
    along = nx * cx + ny * cy
    slope[0, 0] = px
    slope[0, 1] = py
    slope[0, 2] = py * cx - px * cy - wb * (vx * cx + vy * cy) - ab[2] * along - wb * wb * (ny * cx - nx * cy)
    slope[1, 0] = vx
    slope[1, 1] = vy
    slope[1, 2] = vy * cx - vx * cy - 2.0 * wb * along
    slope[2, 0] = nx
    slope[2, 1] = ny
    slope[2, 2] = ny * cx - nx * cy
    slope[3, 0] = -px
    slope[3, 1] = -py
    slope[4, 0] = -vx
    slope[4, 1] = -vy
    slope[4, 2] = 2.0 * (nx * dy - ny * dx) - 2.0 * w * (nx * ux + ny * uy)
    slope[5, 0] = -nx
    slope[5, 1] = -ny
    slope[5, 2] = nx * uy - ny * ux
    return value


@kernel
def angle_response(order, home_b, home_r, qb, vb, ab, qr, vr, ar, slope):
    """Angle of body b as seen from body r, unwrapped, or its first or second derivative.

    In:
      order: DISPLACEMENT (psi_b - psi_r), VELOCITY or ACCELERATION.
      home_b, home_r (HOME,): where the observed body b and the observer's body r are at home.
      qb, vb, ab (3,): what b has moved since, its velocities and accelerations (m, rad and derivatives).
      qr, vr, ar (3,): the same of r; accelerations are read for ACCELERATION only.
    Out:
      slope (6, 3): by q_b, v_b, a_b, q_r, v_r, a_r.

    Returns the response (rad, rad/s or rad/s^2).
    """
    for i in range(6):
        for j in range(3):
            slope[i, j] = 0.0
    slope[order, 2] = 1.0
    slope[3 + order, 2] = -1.0
    if order == DISPLACEMENT:
        return home_b[2] - home_r[2] + (qb[2] - qr[2])
    if order == VELOCITY:
        return vb[2] - vr[2]
    return ab[2] - ar[2]


@part
def point_motion(model, order, component, at, before, b, r, q, v, a, bars):
    """Motion of a point of body b as body r sees it; see `kinematics_interface.point_motion`."""
    slope = np.empty((6, 3))
    i = 3 * b
    k = 3 * r
    value = point_response(
        order, component, at, before, model.home[b], model.home[r], q[i : i + 3], v[i : i + 3], a[i : i + 3],
        q[k : k + 3], v[k : k + 3], a[k : k + 3], slope,
    )  # fmt: skip
    _add_slopes(i, k, slope, bars)
    return value


@part
def angle_motion(model, order, b, r, q, v, a, bars):
    """Angle of body b as body r sees it; see `kinematics_interface.angle_motion`."""
    slope = np.empty((6, 3))
    i = 3 * b
    k = 3 * r
    value = angle_response(
        order, model.home[b], model.home[r], q[i : i + 3], v[i : i + 3], a[i : i + 3], q[k : k + 3], v[k : k + 3],
        a[k : k + 3], slope,
    )  # fmt: skip
    _add_slopes(i, k, slope, bars)
    return value


@part
def _add_slopes(b, r, slope, bars):
    """Add the slopes (6, 3) by two bodies, whose first coordinates are b and r, to bars (3, n)."""
    for i in range(3):
        for c in range(3):
            bars[i, b + c] += slope[i, c]
            bars[i, r + c] += slope[3 + i, c]
