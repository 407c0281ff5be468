"""All that acts on the bodies of a general scene but the joints, with tangents.

    (M + sum s b B^T B) a + Phi_q^T lam = F(q, v, t)

F holds loads, gravity, members, bushings, and the part of an inerter's force that does not depend on accelerations.
"""

import math

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.general.contact import add_contacts
from mdstopo.general.members import general_sums
from mdstopo.general.model import INERTER
from mdstopo.general.switches import APART, DAMPED
from mdstopo.mechanics.angles import small_turn
from mdstopo.mechanics.kinematics.planar_forces import add_loads, load_tangent, pair_tangent
from mdstopo.mechanics.kinematics.planar_poses import add_pair_force, fill_pose, turned_body
from mdstopo.mechanics.passes import FIRST_TANGENT, SUMS


@part
def turn_bodies(q, turned):
    """turned (n_body, 2) = cos - 1 and sin of the angle that every body has turned by: pairs and joints share them."""
    for b in range(turned.shape[0]):
        turned[b, 0], turned[b, 1] = small_turn(q[3 * b + 2])


@part
def turned_pose(model, p, turned, q, v, rel):
    """`planar_poses.relative_pose` of one pair, of bodies that are turned by `turn_bodies`.

    Constant:
      model: the compiled scene.
      p: the pair.
      turned (n_body, 2): of `turn_bodies`.
      q, v (n,): coordinates and velocities (m, rad; m/s, rad/s).
    Out:
      rel (n_pair, POSE): relative poses, of which row p is set.
    """
    one = model.pair[p, 0]
    two = model.pair[p, 1]
    fill_pose(model.pair, p, model.home, q, v, turned[one, 0], turned[one, 1], turned[two, 0], turned[two, 1], rel)


@kernel
def drive_state(model, segment, t, q, v):
    """Put the driven coordinates of q and v (n,) where they have to be at time t."""
    tau = t - model.times[segment]
    for i in range(model.driven.shape[0]):
        d = model.driven[i]
        c = model.drive[segment, i]
        q[d] = c[0] + tau * (c[1] + tau * (c[2] + tau * c[3]))
        v[d] = c[1] + tau * (2.0 * c[2] + 3.0 * tau * c[3])


@kernel
def drive_acceleration(model, segment, t, a):
    """Put the accelerations of the driven coordinates into a (n,)."""
    tau = t - model.times[segment]
    for i in range(model.driven.shape[0]):
        c = model.drive[segment, i]
        a[model.driven[i]] = 2.0 * c[2] + 6.0 * tau * c[3]


@kernel
def add_bushings(model, rel, q, tangent, sums):
    """sums (n_pair, SUMS) += Q, K and C of the bushings: u = d + R q - p and theta against springs along A's axes."""
    for j in range(model.bushing_pair.shape[0]):
        b = model.bushing[j]
        p = model.bushing_pair[j]
        r = rel[p]
        o = sums[p]
        ax = r[2] * b[2] - r[3] * b[3]
        ay = r[3] * b[2] + r[2] * b[3]
        ux = b[4] + r[10] + (r[12] * b[2] - r[13] * b[3])
        uy = b[5] + r[11] + (r[13] * b[2] + r[12] * b[3])
        wx = r[4] - ay * r[6]
        wy = r[5] + ax * r[6]
        fx = b[6] * ux + b[9] * wx
        fy = b[7] * uy + b[10] * wy
        turn = q[3 * model.pair[p, 1] + 2] - q[3 * model.pair[p, 0] + 2]
        o[0] -= fx
        o[1] -= fy
        o[2] -= ax * fy - ay * fx + b[8] * turn + b[11] * r[6]
        if not tangent:
            continue
        # g = d(u)/dxi = [I, (-ay, ax)]; K = g^T k g + g^T c d(w)/dxi + (d2u/dtheta2 . f), C = g^T c g
        kxt = -b[6] * ay - b[9] * ax * r[6]
        kyt = b[7] * ax - b[10] * ay * r[6]
        o[7] += b[6]
        o[9] += kxt
        o[11] += b[7]
        o[12] += kyt
        o[13] -= ay * b[6]
        o[14] += ax * b[7]
        o[15] += ax * kyt - ay * kxt - (ax * fx + ay * fy) + b[8]
        o[16] += b[9]
        o[18] += b[10]
        o[19] -= b[9] * ay
        o[20] += b[10] * ax
        o[21] += b[9] * ay * ay + b[10] * ax * ax + b[11]


@kernel
def pose_acceleration(pair, rel, p, a, out):
    """out (3,) = xi'' of pair p from accelerations a (n,)."""
    i = 3 * pair[p, 0]
    j = 3 * pair[p, 1]
    ca = rel[p, 7]
    sa = rel[p, 8]
    omega = rel[p, 9]
    x = a[j] - a[i]
    y = a[j + 1] - a[i + 1]
    turn = a[i + 2]
    # d'' = R^T D'' + omega' (dy, -dx) + 2 omega (vy, -vx) + omega^2 d
    out[0] = ca * x + sa * y + turn * rel[p, 1] + 2.0 * omega * rel[p, 5] + omega * omega * rel[p, 0]
    out[1] = ca * y - sa * x - turn * rel[p, 0] - 2.0 * omega * rel[p, 4] + omega * omega * rel[p, 1]
    out[2] = a[j + 2] - turn


@kernel
def inerter_row(model, q, v, i, a_body, b_body, row, row_rate):
    """B of a member as a row over its two bodies: dDelta/dt = row . v; and d(row)/dt . v.

    In global axes: u = x_B + R_B q - x_A - R_A p, L' = e . u', L'' = e . u'' + (|u'|^2 - L'^2)/L.

    Constant:
      model: the compiled scene.
      q, v (n,): coordinates and velocities (m, rad; m/s, rad/s).
      i: the member (padded).
      a_body, b_body: the first coordinate of each of its bodies.
    Out:
      row (6,): B; zero where the member has no length.
      row_rate (1,): d(row)/dt . v (m/s^2).

    Returns the length (m).
    """
    m = model.member
    ca, sa, _, _ = turned_body(model.home, a_body // 3, q[a_body + 2])
    cb, sb, _, _ = turned_body(model.home, b_body // 3, q[b_body + 2])
    home_x = model.home[b_body // 3, 0] - model.home[a_body // 3, 0]
    home_y = model.home[b_body // 3, 1] - model.home[a_body // 3, 1]
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
def add_inerters(model, segment, member_state, q, v, mass, f):
    """Mass of the inerters, sum s b B^T B, and the part of their forces that accelerations do not change.

    Constant:
      model: the compiled scene.
      segment: segment of `model.times`.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q, v (n,): coordinates and velocities (m, rad; m/s, rad/s).
    Out:
      mass (n_pair, 6, 6): the mass (kg, kg m, kg m^2), set.
      f (n,): forces and moments on the coordinates (N, N m), to which -sum s b B^T (B' v) is added.
    """
    mass[:] = 0.0
    row = np.empty(6)
    bias = np.empty(1)
    for k in range(model.block.shape[0]):
        if model.block[k, 3] != INERTER or model.active[segment, k] == 0:
            continue
        p = model.block[k, 0]
        a_body = 3 * model.pair[p, 0]
        b_body = 3 * model.pair[p, 1]
        lo = model.block[k, 1]
        for i in range(lo, lo + model.block[k, 5]):
            inerter_row(model, q, v, i, a_body, b_body, row, bias)
            w = member_state[0, i] * model.law[k, 0]
            for r in range(6):
                d = a_body + r if r < 3 else b_body + r - 3
                f[d] -= w * row[r] * bias[0]
                for c in range(6):
                    mass[p, r, c] += w * row[r] * row[c]


@kernel
def inerter_force(model, k, i, q, v, a, row):
    """Force b d2Delta/dt2 of an inerter at unit strength (N), and its row.

    Constant:
      model: the compiled scene.
      k, i: the block, and the member (padded).
      q, v, a (n,): coordinates, velocities, accelerations (m, rad; per s; per s^2).
    Out:
      row (6,): B over the coordinates of both bodies.
    """
    p = model.block[k, 0]
    a_body = 3 * model.pair[p, 0]
    b_body = 3 * model.pair[p, 1]
    bias = np.empty(1)
    inerter_row(model, q, v, i, a_body, b_body, row, bias)
    value = bias[0]
    for r in range(6):
        d = a_body + r if r < 3 else b_body + r - 3
        value += row[r] * a[d]
    return model.law[k, 0] * value


@kernel
def add_inerter_tangents(model, segment, member_state, q, v, a, k_out, c_out):
    """Slopes by coordinates and velocities of sum s b B^T d2Delta/dt2 at fixed a (the reverse of `inerter_row`).

    With g = dL''/du, h = dL''/du' = 2 (u' - L' e)/L: g = (u'' - e (e . u''))/L - 2 L' (u' - L' e)/L^2
    - e (|u'|^2 - L'^2)/L^2; the arms turn u, u' and u''.

    Constant:
      model: the compiled scene.
      segment: segment of `model.times`.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q, v, a (n,): coordinates, velocities, accelerations (m, rad; per s; per s^2).
    Out:
      k_out, c_out (n_pair, 6, 6): stiffness and damping of the pairs, to which d/dq and d/dv are added.
    """
    for k in range(model.block.shape[0]):
        if model.block[k, 3] != INERTER or model.active[segment, k] == 0:
            continue
        pair = model.block[k, 0]
        ia = 3 * model.pair[pair, 0]
        ib = 3 * model.pair[pair, 1]
        m = model.member
        ca, sa, _, _ = turned_body(model.home, ia // 3, q[ia + 2])
        cb, sb, _, _ = turned_body(model.home, ib // 3, q[ib + 2])
        home_x = model.home[ib // 3, 0] - model.home[ia // 3, 0]
        home_y = model.home[ib // 3, 1] - model.home[ia // 3, 1]
        wa = v[ia + 2]
        wb = v[ib + 2]
        ra = a[ia + 2]
        rb = a[ib + 2]
        for i in range(model.block[k, 1], model.block[k, 1] + model.block[k, 5]):
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
            w = member_state[0, i] * model.law[k, 0]
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


@kernel
def general_forces(model, member_state, segment, t, q, v, tangent, workspace):
    """All forces of members, bushings, loads and contacts at one state, without inerters; on demand with tangents.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      segment, t: segment of `model.times`, and time in it (s).
      q, v (n,): coordinates and velocities (m, rad; m/s, rad/s).
      tangent: whether workspace.k, .c and .turn are asked for.
    In and out:
      workspace: the workspace. Set are f (N, N m), turned, and, of the pairs that carry more than joints, rel and sums.
    """
    pair = model.pair
    rel = workspace.rel
    sums = workspace.sums
    f = workspace.f
    carries = workspace.carries
    turn_bodies(q, workspace.turned)
    for p in range(pair.shape[0]):
        if carries[p] != 0:
            turned_pose(model, p, workspace.turned, q, v, rel)
            for i in range(SUMS if tangent else FIRST_TANGENT):
                sums[p, i] = 0.0
    general_sums(model, segment, t, member_state, rel, tangent, sums)
    add_bushings(model, rel, q, tangent, sums)
    f[:] = 0.0
    add_loads(model, segment, t, q, f)
    for p in range(pair.shape[0]):
        if carries[p] != 0:
            add_pair_force(pair, rel, p, sums[p, 0], sums[p, 1], sums[p, 2], f)
    if tangent:
        damped = workspace.switches[DAMPED] != 0
        k = workspace.k
        c = workspace.c
        for p in range(pair.shape[0]):
            if carries[p] != 0:
                pair_tangent(p, rel, sums, damped, k, c)
            elif workspace.switches[APART] == 0:
                none = k[p]
                none[:] = 0.0
        load_tangent(model, segment, t, q, workspace.turn)
    if model.contact_pair.shape[0] > 0:
        add_contacts(model, member_state, q, v, tangent, f, workspace.k, workspace.c)
