"""A point of one body against an edge of another, in a plane.

Along and height are functions of the six coordinates of both bodies, h_u(q) = (R_A u) . w with w the point as seen from
the edge's first end and u its direction or normal. Their second derivatives have the angles' terms only.
"""

from mdstopo.compiler.jit import kernel
from mdstopo.mechanics.kinematics.planar_poses import turned_body
from mdstopo.scene.model import HOME_X, HOME_Y


@kernel
def contact_rows(model, j, q, v, rows, rates):
    """Where a contact's point is as seen from the edge; see `kinematics_interface.contact_rows`."""
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


@kernel
def add_contact_curvature(model, j, q, rows, n, t, k):
    """What the directions of a contact's forces change by; see `kinematics_interface.add_contact_curvature`."""
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
