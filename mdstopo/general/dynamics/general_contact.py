"""Points against edges or surfaces in a general scene: forces on both bodies with tangents, and their events.

How a point is seen from an edge or a surface, and what pushes it there, the kinematics knows (`planar_contacts`,
`spatial_contacts`). The mode of contact j stands in `member_state` behind those of members.
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.dynamics.members import MODE, rate_of_row
from mdstopo.general.model.strides import pair_freedoms, place_in_pair
from mdstopo.mechanics.contact import CLOSED, contact_margin_slopes, contact_next
from mdstopo.mechanics.kinematics.kinematics_interface import add_contact, contact_ends


@kernel
def add_contacts(model, member_state, rel, q, v, tangent, f, k_out, c_out):
    """The forces of all closed contacts, and on demand their tangents.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      rel (n_pair, POSE): relative poses of the pairs that have contacts.
      q (n_q,), v (n,): coordinates and velocities.
      tangent: whether tangents are asked for.
    Out, all added to:
      f (n,): forces and moments on the coordinates (N, N m).
      k_out, c_out (n_pair, 2 D, 2 D): stiffness -dF/dq and damping -dF/dv of the pairs.
    """
    first = model.member.shape[1]
    for j in range(model.contact_pair.shape[0]):
        if int(member_state[MODE, first + j]) == CLOSED:
            p = model.contact_pair[j]
            add_contact(model, j, rel[p], q, v, tangent, f, k_out[p], c_out[p])


@kernel
def contact_switch(model, member_state, q, v, a, j, slopes):
    """The next mode of a contact, and how far its margin goes beyond zero; as `events.switch_of` of members.

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
    rate = np.empty(pair_freedoms(model))
    height, room = contact_ends(model, j, q, v, rows, rate)
    rise = rate_of_row(model, p, rows[1], v)
    second = rate_of_row(model, p, rows[1], a) + rate_of_row(model, p, rate, v)
    mode = int(member_state[MODE, model.member.shape[1] + j])
    by_height, by_rise, by_room = contact_margin_slopes(c, height, rise, room, mode)
    speed = by_room * rate_of_row(model, p, rows[0], v) + by_height * rise + by_rise * second
    for d in range(n):
        slopes[0, d] = 0.0
        slopes[1, d] = 0.0
    if speed != 0.0:
        for r in range(pair_freedoms(model)):
            d = place_in_pair(model, p, r)
            slopes[0, d] = (by_room * rows[0, r] + by_height * rows[1, r] + by_rise * rate[r]) / speed
            slopes[1, d] = by_rise * rows[1, r] / speed
    bend = 2.0 * abs(by_height * second)
    beyond = speed * speed / bend if by_rise == 0.0 and bend > 0.0 else np.inf
    return contact_next(c, height, rise, second, room, mode), beyond
