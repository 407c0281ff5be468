"""A point of one body against an edge of another, in a plane.

Along and height are functions of the six coordinates of both bodies, h_u(q) = (R_A u) . w with w the point as seen from
the edge's first end and u its direction or normal. Their second derivatives have the angles' terms only.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.mechanics.contact import CLOSED, LENGTH, contact_force, contact_pose, second_rise
from mdstopo.mechanics.kinematics.planar_poses import turned_body
from mdstopo.scene.springs_model import HOME_X, HOME_Y

#: directions in which a contact pushes: along the edge, and normal to it
DIRECTIONS = 2


@part
def contact_directions(model):
    """Two directions of a contact's force: along the edge, and normal to it."""
    return DIRECTIONS


@part
def contact_seen(model, j, r):
    """Height, rise, room and its rate, and the nearer end; see `kinematics_interface.contact_seen`."""
    c = model.contact[j]
    along, height, slide, rise = contact_pose(c, r)
    if along <= c[LENGTH] - along:
        return height, rise, along, slide, 0
    return height, rise, c[LENGTH] - along, -slide, 1


@part
def contact_second_rise(model, j, r, acc):
    """Second derivative of the height of a contact's point by time (m/s^2); see `mechanics.contact.second_rise`."""
    return second_rise(model.contact[j], r, acc)


@part
def contact_distance(model, j, r):
    """The distance from the centre of curvature of what is touched (m): infinite, an edge is straight."""
    return np.inf


@kernel
def contact_rows(model, j, q, v, rows, rates):
    """Where a contact's point is as seen from the edge, with slopes.

    In:
      model: the compiled scene.
      j: the contact.
      q (n_q,), v (n,): coordinates and velocities.
    Out:
      rows (2, 2 D): slopes of along and of height by the freedoms of both bodies.
      rates (2, 2 D): their derivatives by time.

    Returns along, height (m).
    """
    p = model.contact_pair[j]
    c = model.contact[j]
    one = model.pair[p, 0]
    two = model.pair[p, 1]
    a = 3 * one
    b = 3 * two
    home = model.home
    ca, sa, _, _ = turned_body(home, one, q[a + 2])
    cb, sb, _, _ = turned_body(home, two, q[b + 2])
    qx = cb * c[4] - sb * c[5]
    qy = sb * c[4] + cb * c[5]
    wa = v[a + 2]
    wb = v[b + 2]
    zx = home[two, HOME_X] - home[one, HOME_X] + (q[b] - q[a]) + qx
    zy = home[two, HOME_Y] - home[one, HOME_Y] + (q[b + 1] - q[a + 1]) + qy
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


@part
def _place(model, p, r):
    """The place of entry r (0 to 2 D - 1) of pair p among the freedoms of all bodies."""
    return 3 * model.pair[p, r // 3] + r % 3


@part
def _rate_of(model, p, row, v):
    """row (2 D,) of pair p times velocities v (n,)."""
    total = 0.0
    for r in range(6):
        total += row[r] * v[_place(model, p, r)]
    return total


@kernel
def contact_ends(model, j, q, v, rows, rate):
    """Height and room with their slopes; see `kinematics_interface.contact_ends`."""
    c = model.contact[j]
    rates = np.empty((2, 6))
    along, height = contact_rows(model, j, q, v, rows, rates)
    for r in range(6):
        rate[r] = rates[1, r]
    if along <= c[LENGTH] - along:
        return height, along
    for r in range(6):
        rows[0, r] = -rows[0, r]
    return height, c[LENGTH] - along


@kernel
def contact_drag(model, j, q, v, rows):
    """Height, rise and slide with their rows; see `kinematics_interface.contact_drag`."""
    p = model.contact_pair[j]
    rates = np.empty((2, 6))
    _, height = contact_rows(model, j, q, v, rows, rates)
    return height, _rate_of(model, p, rows[1], v), (_rate_of(model, p, rows[0], v), 0.0, 0.0)


@kernel
def _add_curvature(model, j, q, rows, n, t, k):
    """Add what the directions of a contact's forces change by with both bodies: N H_n + T H_t, H second derivatives.

    In:
      model: the compiled scene.
      j: the contact.
      q (n_q,): coordinates.
      rows (2, 2 D): of `contact_rows`.
      n, t: normal force and friction (N).
    Out:
      k (2 D, 2 D): the stiffness of its pair, added to.
    """
    p = model.contact_pair[j]
    c = model.contact[j]
    one = model.pair[p, 0]
    two = model.pair[p, 1]
    a = 3 * one
    b = 3 * two
    # the force as one vector u, and its lever arms
    ux = n * rows[1, 3] + t * rows[0, 3]
    uy = n * rows[1, 4] + t * rows[0, 4]
    cb, sb, _, _ = turned_body(model.home, two, q[b + 2])
    qx = cb * c[4] - sb * c[5]
    qy = sb * c[4] + cb * c[5]
    lever = ux * qx + uy * qy
    zx = model.home[two, HOME_X] - model.home[one, HOME_X] + (q[b] - q[a]) + qx
    zy = model.home[two, HOME_Y] - model.home[one, HOME_Y] + (q[b + 1] - q[a + 1]) + qy
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
def add_contact(model, j, r, q, v, tangent, f, k, d):
    """The force of a closed contact; see `kinematics_interface.add_contact`.

    With rows B_u = dh_u/dq and their rates,

        F = N B_n^T + T B_t^T,   dF = B_n^T dN + B_t^T dT + (N H_n + T H_t) dq,   H_u = d2h_u/dq2
    """
    rows = np.empty((2, 6))
    rates = np.empty((2, 6))
    p = model.contact_pair[j]
    _, height = contact_rows(model, j, q, v, rows, rates)
    slide = _rate_of(model, p, rows[0], v)
    rise = _rate_of(model, p, rows[1], v)
    n, n_h, n_r, t, t_h, t_r, t_s = contact_force(model.contact[j], height, rise, slide, CLOSED)
    for i in range(6):
        f[_place(model, p, i)] += n * rows[1, i] + t * rows[0, i]
    if not tangent:
        return
    for s in range(6):
        by_q_n = n_h * rows[1, s] + n_r * rates[1, s]
        by_q_t = t_h * rows[1, s] + t_r * rates[1, s] + t_s * rates[0, s]
        by_v_n = n_r * rows[1, s]
        by_v_t = t_r * rows[1, s] + t_s * rows[0, s]
        for i in range(6):
            k[i, s] -= rows[1, i] * by_q_n + rows[0, i] * by_q_t
            d[i, s] -= rows[1, i] * by_v_n + rows[0, i] * by_v_t
    _add_curvature(model, j, q, rows, n, t, k)
