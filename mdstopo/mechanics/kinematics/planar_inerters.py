"""Inerters between bodies in a plane: their rows, and how their forces change with both bodies.

In global axes: u = x_B + R_B q - x_A - R_A p, L' = e . u', L'' = e . u'' + (|u'|^2 - L'^2)/L. With g = dL''/du,
h = dL''/du' = 2 (u' - L' e)/L:

    g = (u'' - e (e . u''))/L - 2 L' (u' - L' e)/L^2 - e (|u'|^2 - L'^2)/L^2;      the arms turn u, u' and u''.
"""

import math

from mdstopo.compiler.jit import kernel
from mdstopo.mechanics.kinematics.planar_poses import turned_body
from mdstopo.scene.springs_model import HOME_X, HOME_Y


@kernel
def inerter_row(model, q, v, i, p, row, row_rate):
    """B of a member as a row over its two bodies; see `kinematics_interface.inerter_row`."""
    m = model.member
    one = model.pair[p, 0]
    two = model.pair[p, 1]
    a_body = 3 * one
    b_body = 3 * two
    ca, sa, _, _ = turned_body(model.home, one, q[a_body + 2])
    cb, sb, _, _ = turned_body(model.home, two, q[b_body + 2])
    home_x = model.home[two, HOME_X] - model.home[one, HOME_X]
    home_y = model.home[two, HOME_Y] - model.home[one, HOME_Y]
    px = ca * m[0, i] - sa * m[1, i]
    py = sa * m[0, i] + ca * m[1, i]
    qx = cb * m[2, i] - sb * m[3, i]
    qy = sb * m[2, i] + cb * m[3, i]
    ux = home_x + (q[b_body] - q[a_body]) + qx - px
    uy = home_y + (q[b_body + 1] - q[a_body + 1]) + qy - py
    length = math.sqrt(ux * ux + uy * uy)
    if length < 1e-15:
        row[:] = 0.0
        row_rate[0] = 0.0
        return 0.0
    ex = ux / length
    ey = uy / length
    row[0] = -ex
    row[1] = -ey
    row[2] = ex * py - ey * px
    row[3] = ex
    row[4] = ey
    row[5] = ey * qx - ex * qy
    wa = v[a_body + 2]
    wb = v[b_body + 2]
    dux = v[b_body] - wb * qy - v[a_body] + wa * py
    duy = v[b_body + 1] + wb * qx - v[a_body + 1] - wa * px
    rate = ex * dux + ey * duy
    # centripetal part of u''
    cx = -wb * wb * qx + wa * wa * px
    cy = -wb * wb * qy + wa * wa * py
    row_rate[0] = ex * cx + ey * cy + (dux * dux + duy * duy - rate * rate) / length
    return length


@kernel
def add_inerter_tangents(model, pair, lo, count, inertance, member_state, q, v, a, k_out, c_out):
    """Slopes of the inerters' forces at fixed a; see `kinematics_interface.add_inerter_tangents`."""
    m = model.member
    one = model.pair[pair, 0]
    two = model.pair[pair, 1]
    ia = 3 * one
    ib = 3 * two
    ca, sa, _, _ = turned_body(model.home, one, q[ia + 2])
    cb, sb, _, _ = turned_body(model.home, two, q[ib + 2])
    home_x = model.home[two, HOME_X] - model.home[one, HOME_X]
    home_y = model.home[two, HOME_Y] - model.home[one, HOME_Y]
    wa = v[ia + 2]
    wb = v[ib + 2]
    ra = a[ia + 2]
    rb = a[ib + 2]
    for i in range(lo, lo + count):
        px = ca * m[0, i] - sa * m[1, i]
        py = sa * m[0, i] + ca * m[1, i]
        qx = cb * m[2, i] - sb * m[3, i]
        qy = sb * m[2, i] + cb * m[3, i]
        ux = home_x + (q[ib] - q[ia]) + qx - px
        uy = home_y + (q[ib + 1] - q[ia + 1]) + qy - py
        length = math.sqrt(ux * ux + uy * uy)
        if length < 1e-15:
            continue
        y = 1.0 / length
        ex = ux * y
        ey = uy * y
        dx = v[ib] - wb * qy - v[ia] + wa * py
        dy = v[ib + 1] + wb * qx - v[ia + 1] - wa * px
        bx = a[ib] - rb * qy - wb * wb * qx - a[ia] + ra * py + wa * wa * px
        by = a[ib + 1] + rb * qx - wb * wb * qy - a[ia + 1] - ra * px + wa * wa * py
        rate = ex * dx + ey * dy
        along = ex * bx + ey * by
        excess = (dx * dx + dy * dy - rate * rate) * y
        hx = 2.0 * y * (dx - rate * ex)
        hy = 2.0 * y * (dy - rate * ey)
        gx = y * (bx - along * ex) - rate * y * hx - excess * y * ex
        gy = y * (by - along * ey) - rate * y * hy - excess * y * ey
        w = member_state[0, i] * inertance
        f = w * (along + excess)
        # columns: how u, u', u'' change with a coordinate, and with its velocity
        for col in range(6):
            second = col >= 3
            part = col % 3
            sign = 1.0 if second else -1.0
            rx = qx if second else px
            ry = qy if second else py
            om = wb if second else wa
            al = rb if second else ra
            if part == 0:
                ux_c = sign
                uy_c = 0.0
                fq = w * sign * gx
                fv = w * sign * hx
            elif part == 1:
                ux_c = 0.0
                uy_c = sign
                fq = w * sign * gy
                fv = w * sign * hy
            else:
                ux_c = -sign * ry
                uy_c = sign * rx
                du_x = -sign * om * rx
                du_y = -sign * om * ry
                ddu_x = sign * (-al * rx + om * om * ry)
                ddu_y = sign * (-al * ry - om * om * rx)
                fq = w * (gx * ux_c + gy * uy_c + hx * du_x + hy * du_y + ex * ddu_x + ey * ddu_y)
                fv = w * (hx * ux_c + hy * uy_c - 2.0 * sign * om * (ex * rx + ey * ry))
            # e changes with u; the arms in the rows turn
            along_c = ex * ux_c + ey * uy_c
            ex_c = y * (ux_c - along_c * ex)
            ey_c = y * (uy_c - along_c * ey)
            row = k_out[pair]
            rate_row = c_out[pair]
            row[0, col] += -fq * ex - f * ex_c
            row[1, col] += -fq * ey - f * ey_c
            row[2, col] += fq * (ex * py - ey * px) + f * (ex_c * py - ey_c * px)
            row[3, col] += fq * ex + f * ex_c
            row[4, col] += fq * ey + f * ey_c
            row[5, col] += fq * (ey * qx - ex * qy) + f * (ey_c * qx - ex_c * qy)
            rate_row[0, col] -= fv * ex
            rate_row[1, col] -= fv * ey
            rate_row[2, col] += fv * (ex * py - ey * px)
            rate_row[3, col] += fv * ex
            rate_row[4, col] += fv * ey
            rate_row[5, col] += fv * (ey * qx - ex * qy)
        k_out[pair, 2, 2] += f * (ex * px + ey * py)
        k_out[pair, 5, 5] -= f * (ex * qx + ey * qy)
