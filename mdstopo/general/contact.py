"""Points against edges in a general scene: forces on both bodies with tangents, and their events.

Along and height are functions of the six coordinates of both bodies, h_u(q) = (R_A u) . w with w the point as seen from
the edge's first end and u its direction or normal. With rows B_u = dh_u/dq and their rates,

    F = N B_n^T + T B_t^T,   dF = B_n^T dN + B_t^T dT + (N H_n + T H_t) dq,

where H_u = d2h_u/dq2 has the angles' terms only. The mode of contact j stands in `member_state` behind those of
members.
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.members import rate_of_row
from mdstopo.mechanics.contact import (
    CLOSED,
    contact_force,
    contact_margin_slopes,
    contact_next,
)
from mdstopo.mechanics.kinematics.planar_poses import turned_body


@kernel
def contact_rows(model, j, q, v, rows, rates):
    """Where the point of a contact is as seen from the edge, with slopes.

    Constant:
      model: the compiled scene.
      j: the contact.
      q, v (n,): coordinates and velocities (m, rad; m/s, rad/s).
    Out:
      rows (2, 6): slopes of along and of height by the coordinates of both bodies.
      rates (2, 6): their derivatives by time.

    Returns along, height (m).
    """
    p = model.contact_pair[j]
    c = model.contact[j]
    a = 3 * model.pair[p, 0]
    b = 3 * model.pair[p, 1]
    home = model.home
    ca, sa, _, _ = turned_body(home, a // 3, q[a + 2])
    cb, sb, _, _ = turned_body(home, b // 3, q[b + 2])
    qx = cb * c[4] - sb * c[5]
    qy = sb * c[4] + cb * c[5]
    wa = v[a + 2]
    wb = v[b + 2]
    zx = home[b // 3, 0] - home[a // 3, 0] + (q[b] - q[a]) + qx
    zy = home[b // 3, 1] - home[a // 3, 1] + (q[b + 1] - q[a + 1]) + qy
    vx = v[b] - v[a] - wb * qy
    vy = v[b + 1] - v[a + 1] + wb * qx
    for i in range(2):
        lx = c[8] if i == 0 else -c[9]
        ly = c[9] if i == 0 else c[8]
        ux = ca * lx - sa * ly
        uy = sa * lx + ca * ly
        rows[i, 0] = -ux
        rows[i, 1] = -uy
        rows[i, 2] = ux * zy - uy * zx
        rows[i, 3] = ux
        rows[i, 4] = uy
        rows[i, 5] = uy * qx - ux * qy
        dx = -wa * uy
        dy = wa * ux
        rates[i, 0] = -dx
        rates[i, 1] = -dy
        rates[i, 2] = dx * zy - dy * zx + ux * vy - uy * vx
        rates[i, 3] = dx
        rates[i, 4] = dy
        rates[i, 5] = dy * qx - dx * qy - wb * (ux * qx + uy * qy)
    along = rows[0, 3] * zx + rows[0, 4] * zy - (c[8] * c[6] + c[9] * c[7])
    height = rows[1, 3] * zx + rows[1, 4] * zy - (c[8] * c[7] - c[9] * c[6])
    return along, height


@kernel
def add_contacts(model, member_state, q, v, tangent, f, k_out, c_out):
    """The forces of all closed contacts, and on demand their tangents.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q, v (n,): coordinates and velocities (m, rad; m/s, rad/s).
      tangent: whether tangents are asked for.
    Out, all added to:
      f (n,): forces and moments on the coordinates (N, N m).
      k_out, c_out (n_pair, 6, 6): stiffness -dF/dq and damping -dF/dv of the pairs.
    """
    rows = np.empty((2, 6))
    rates = np.empty((2, 6))
    first = model.member.shape[1]
    for j in range(model.contact_pair.shape[0]):
        mode = int(member_state[1, first + j])
        if mode != CLOSED:
            continue
        p = model.contact_pair[j]
        c = model.contact[j]
        _, height = contact_rows(model, j, q, v, rows, rates)
        slide = rate_of_row(model, p, rows[0], v)
        rise = rate_of_row(model, p, rows[1], v)
        n, n_h, n_r, t, t_h, t_r, t_s = contact_force(c, height, rise, slide, mode)
        for r in range(6):
            f[3 * model.pair[p, r // 3] + r % 3] += n * rows[1, r] + t * rows[0, r]
        if not tangent:
            continue
        k = k_out[p]
        d = c_out[p]
        for s in range(6):
            by_q_n = n_h * rows[1, s] + n_r * rates[1, s]
            by_q_t = t_h * rows[1, s] + t_r * rates[1, s] + t_s * rates[0, s]
            by_v_n = n_r * rows[1, s]
            by_v_t = t_r * rows[1, s] + t_s * rows[0, s]
            for r in range(6):
                k[r, s] -= rows[1, r] * by_q_n + rows[0, r] * by_q_t
                d[r, s] -= rows[1, r] * by_v_n + rows[0, r] * by_v_t
        # N H_n + T H_t: with the force as one vector u and its lever arms
        ux = n * rows[1, 3] + t * rows[0, 3]
        uy = n * rows[1, 4] + t * rows[0, 4]
        a = 3 * model.pair[p, 0]
        b = 3 * model.pair[p, 1]
        cb, sb, _, _ = turned_body(model.home, b // 3, q[b + 2])
        qx = cb * c[4] - sb * c[5]
        qy = sb * c[4] + cb * c[5]
        lever = ux * qx + uy * qy
        zx = model.home[b // 3, 0] - model.home[a // 3, 0] + (q[b] - q[a]) + qx
        zy = model.home[b // 3, 1] - model.home[a // 3, 1] + (q[b + 1] - q[a + 1]) + qy
        k[2, 2] += ux * zx + uy * zy
        k[2, 5] -= lever
        k[5, 2] -= lever
        k[5, 5] += lever
        k[2, 3] += uy
        k[3, 2] += uy
        k[2, 4] -= ux
        k[4, 2] -= ux
        k[2, 0] -= uy
        k[0, 2] -= uy
        k[2, 1] += ux
        k[1, 2] += ux


@kernel
def contact_switch(model, member_state, q, v, a, j, slopes):
    """As `events.switch_of`, of a contact: its next mode, and how far its margin goes beyond zero.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q, v, a (n,): coordinates, velocities, accelerations (m, rad; per s; per s^2).
      j: the contact.
    Out:
      slopes (2, n): s_q / s', s_v / s' of its margin s.

    Returns the mode and the distance (m; infinite where the margin depends on the rate of the height).
    """
    n = q.shape[0]
    p = model.contact_pair[j]
    c = model.contact[j]
    rows = np.empty((2, 6))
    rates = np.empty((2, 6))
    along, height = contact_rows(model, j, q, v, rows, rates)
    slide = rate_of_row(model, p, rows[0], v)
    rise = rate_of_row(model, p, rows[1], v)
    second = rate_of_row(model, p, rows[1], a) + rate_of_row(model, p, rates[1], v)
    mode = int(member_state[1, model.member.shape[1] + j])
    by_along, by_height, by_rise = contact_margin_slopes(c, along, height, rise, mode)
    speed = by_along * slide + by_height * rise + by_rise * second
    for d in range(n):
        slopes[0, d] = 0.0
        slopes[1, d] = 0.0
    if speed != 0.0:
        for r in range(6):
            d = 3 * model.pair[p, r // 3] + r % 3
            slopes[0, d] = (by_along * rows[0, r] + by_height * rows[1, r] + by_rise * rates[1, r]) / speed
            slopes[1, d] = by_rise * rows[1, r] / speed
    bend = 2.0 * abs(by_height * second)
    beyond = speed * speed / bend if by_rise == 0.0 and bend > 0.0 else np.inf
    return contact_next(c, along, height, rise, second, mode), beyond
