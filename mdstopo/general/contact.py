"""Points against edges in a general scene: forces on both bodies with tangents, and their events.

Along and height are functions of the six coordinates of both bodies, h_u(q) = (R_A u) . w with w the point as seen from
the edge's first end and u its direction or normal. With rows B_u = dh_u/dq and their rates,

    F = N B_n^T + T B_t^T,   dF = B_n^T dN + B_t^T dT + (N H_n + T H_t) dq,

where H_u = d2h_u/dq2 has the angles' terms only. The mode of contact j stands in `member_state` behind those of
members.
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.members import MODE, rate_of_row
from mdstopo.general.strides import pair_freedoms, place_in_pair
from mdstopo.mechanics.contact import (
    CLOSED,
    contact_force,
    contact_margin_slopes,
    contact_next,
)
from mdstopo.mechanics.kinematics.kinematics_interface import add_contact_curvature, contact_rows


@kernel
def add_contacts(model, member_state, q, v, tangent, f, k_out, c_out):
    """The forces of all closed contacts, and on demand their tangents.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q (n_q,), v (n,): coordinates and velocities.
      tangent: whether tangents are asked for.
    Out, all added to:
      f (n,): forces and moments on the coordinates (N, N m).
      k_out, c_out (n_pair, 2 D, 2 D): stiffness -dF/dq and damping -dF/dv of the pairs.
    """
    rows = np.empty((2, pair_freedoms(model)))
    rates = np.empty((2, pair_freedoms(model)))
    first = model.member.shape[1]
    for j in range(model.contact_pair.shape[0]):
        mode = int(member_state[MODE, first + j])
        if mode != CLOSED:
            continue
        p = model.contact_pair[j]
        c = model.contact[j]
        _, height = contact_rows(model, j, q, v, rows, rates)
        slide = rate_of_row(model, p, rows[0], v)
        rise = rate_of_row(model, p, rows[1], v)
        n, n_h, n_r, t, t_h, t_r, t_s = contact_force(c, height, rise, slide, mode)
        for r in range(pair_freedoms(model)):
            f[place_in_pair(model, p, r)] += n * rows[1, r] + t * rows[0, r]
        if not tangent:
            continue
        k = k_out[p]
        d = c_out[p]
        for s in range(pair_freedoms(model)):
            by_q_n = n_h * rows[1, s] + n_r * rates[1, s]
            by_q_t = t_h * rows[1, s] + t_r * rates[1, s] + t_s * rates[0, s]
            by_v_n = n_r * rows[1, s]
            by_v_t = t_r * rows[1, s] + t_s * rows[0, s]
            for r in range(pair_freedoms(model)):
                k[r, s] -= rows[1, r] * by_q_n + rows[0, r] * by_q_t
                d[r, s] -= rows[1, r] * by_v_n + rows[0, r] * by_v_t
        add_contact_curvature(model, j, q, rows, n, t, k)


@kernel
def contact_switch(model, member_state, q, v, a, j, slopes):
    """As `events.switch_of`, of a contact: its next mode, and how far its margin goes beyond zero.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      j: the contact.
    Out:
      slopes (2, n): s_q / s', s_v / s' of its margin s.

    Returns the mode and the distance (m; infinite where the margin depends on the rate of the height).
    """
    n = v.shape[0]
    p = model.contact_pair[j]
    c = model.contact[j]
    rows = np.empty((2, pair_freedoms(model)))
    rates = np.empty((2, pair_freedoms(model)))
    along, height = contact_rows(model, j, q, v, rows, rates)
    slide = rate_of_row(model, p, rows[0], v)
    rise = rate_of_row(model, p, rows[1], v)
    second = rate_of_row(model, p, rows[1], a) + rate_of_row(model, p, rates[1], v)
    mode = int(member_state[MODE, model.member.shape[1] + j])
    by_along, by_height, by_rise = contact_margin_slopes(c, along, height, rise, mode)
    speed = by_along * slide + by_height * rise + by_rise * second
    for d in range(n):
        slopes[0, d] = 0.0
        slopes[1, d] = 0.0
    if speed != 0.0:
        for r in range(pair_freedoms(model)):
            d = place_in_pair(model, p, r)
            slopes[0, d] = (by_along * rows[0, r] + by_height * rows[1, r] + by_rise * rates[1, r]) / speed
            slopes[1, d] = by_rise * rows[1, r] / speed
    bend = 2.0 * abs(by_height * second)
    beyond = speed * speed / bend if by_rise == 0.0 and bend > 0.0 else np.inf
    return contact_next(c, along, height, rise, second, mode), beyond
