"""A point of one body against an edge or a surface of another: modes, normal force and friction, as scalars.

Seen from the body with the edge, the point lies `height` above it, on its free side, and has `room` to the nearest end
(infinite where there is none; negative beside it); `rise` and `slide` are the rates of the height and along the edge.
In contact, with depth = -height,

    N = k depth - c rise >= 0,     T = -mu N tanh(slide / slip).

In space the sliding velocity s has two components, and T = -mu N tanh(|s| / slip) s / |s|.

Modes: above the edge, closed, clipped (damping would make N negative: no force), beside (behind the edge without
having passed through it). In each mode the formula goes on beyond its end. Row of parameters in a plane (CONTACT,): k,
c, mu, slip, the point, the edge's first end, its direction (its left is free), its length. In space the first four are
the same (`kinematics.spatial_contacts`).
"""

import math

from mdstopo.compiler.jit import inline

CONTACT = 11
K, C, MU, SLIP, PX, PY, AX, AY, TX, TY, LENGTH = range(CONTACT)
ABOVE, CLOSED, CLIPPED, BESIDE = range(4)
#: a height this near to the edge, relative to 1 m, is at the switch: rates decide
AT_SWITCH = 1e-12
#: rates below this are rest (m/s): they decide nothing, as rounding alone moves bodies so fast
REST = 1e-10


@inline
def contact_pose(c, r):
    """Where a point lies against an edge, at relative pose r (POSE,): along it, its height, and the rates slide and
    rise."""
    ax = r[2] * c[4] - r[3] * c[5]
    ay = r[3] * c[4] + r[2] * c[5]
    x = r[0] + ax - c[6]
    y = r[1] + ay - c[7]
    u = r[4] - ay * r[6]
    w = r[5] + ax * r[6]
    return c[8] * x + c[9] * y, c[8] * y - c[9] * x, c[8] * u + c[9] * w, c[8] * w - c[9] * u


@inline
def second_rise(c, r, acc):
    """The rate of rise at the relative pose r (POSE,) with its second derivative acc (3,)."""
    ax = r[2] * c[4] - r[3] * c[5]
    ay = r[3] * c[4] + r[2] * c[5]
    x = acc[0] - ay * acc[2] - ax * r[6] * r[6]
    y = acc[1] + ax * acc[2] - ay * r[6] * r[6]
    return c[8] * y - c[9] * x


@inline
def contact_force(c, height, rise, slide, mode):
    """Normal force and friction with their slopes: N, N_height, N_rise, T, T_height, T_rise, T_slide."""
    if mode != CLOSED:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    normal = -c[0] * height - c[1] * rise
    if c[2] == 0.0:
        return normal, -c[0], -c[1], 0.0, 0.0, 0.0, 0.0
    share = math.tanh(slide / c[3])
    grip = c[2] * share
    return (
        normal,
        -c[0],
        -c[1],
        -grip * normal,
        grip * c[0],
        grip * c[1],
        -c[2] * normal * (1.0 - share * share) / c[3],
    )


@inline
def drag_by_slide(c, slide):
    """Friction as T = -N e s against the sliding velocity s in space: e and e', by |s| = slide; de = e' (s . ds).

    With x = slide / slip, e = mu / slip tanh(x) / x and e' = mu / slip^3 (d/dx tanh(x) / x) / x: even powers of x, so
    nothing is special where nothing slides. Near there they are summed as series.
    """
    x = slide / c[3]
    y = x * x
    if y < 0.01:
        even = 1.0 - y * (
            1.0 / 3.0 - y * (2.0 / 15.0 - y * (17.0 / 315.0 - y * (62.0 / 2835.0 - y * 1382.0 / 155925.0)))
        )
        last = 2764.0 / 31185.0 - y * 262128.0 / 6081075.0
        slope = -2.0 / 3.0 + y * (8.0 / 15.0 - y * (34.0 / 105.0 - y * (496.0 / 2835.0 - y * last)))
    else:
        share = math.tanh(x)
        even = share / x
        slope = (1.0 - share * share - even) / y
    return c[2] / c[3] * even, c[2] / (c[3] * c[3] * c[3]) * slope


@inline
def contact_margins(c, mode):
    """How many margins a mode has: on the edge those of contact and of its ends, and with damping that of the force."""
    if mode in (ABOVE, BESIDE):
        return 1
    return 3 if c[1] > 0.0 else 2


@inline
def contact_one_margin(c, which, height, rise, room, mode):
    """One margin of a mode and its slopes by height, rise and room.

    c: the numbers of the contact. which, mode: 0 of height, 1 of room, 2 of the normal force, as many as
    `contact_margins` of the mode; of those that are not on the edge the height alone.
    height, rise, room: where the point is (m), how fast it rises (m/s), and how far it is from the nearer end (m).
    """
    if mode == ABOVE:
        return height, 1.0, 0.0, 0.0
    if which == 0:
        return -height, -1.0, 0.0, 0.0
    if which == 1:
        return room, 0.0, 0.0, 1.0
    sign = (-1.0 if mode == CLOSED else 1.0) / (c[0] + c[1])
    return sign * (c[0] * height + c[1] * rise), sign * c[0], sign * c[1], 0.0


@inline
def contact_margin(c, height, rise, room, mode):
    """How far the mode is from its end: a distance in m, or the normal force before it is cut off, divided by k + c."""
    if mode == ABOVE:
        return height
    if mode == BESIDE:
        return -height
    margin = min(-height, room)
    if c[1] == 0.0:
        return margin
    unclipped = -(c[0] * height + c[1] * rise) / (c[0] + c[1])
    return min(margin, unclipped) if mode == CLOSED else min(margin, -unclipped)


@inline
def contact_margin_slopes(c, height, rise, room, mode):
    """Slopes of the margin by height, rise and room."""
    if mode == ABOVE:
        return 1.0, 0.0, 0.0
    if mode == BESIDE:
        return -1.0, 0.0, 0.0
    margin = min(-height, room)
    if c[1] > 0.0:
        sign = -1.0 if mode == CLOSED else 1.0
        total = c[0] + c[1]
        if sign * (c[0] * height + c[1] * rise) / total < margin:
            return sign * c[0] / total, sign * c[1] / total, 0.0
    if -height <= room:
        return -1.0, 0.0, 0.0
    return 0.0, 0.0, 1.0


@inline
def _touching(c, depth, rise):
    """Closed, or clipped where damping would reverse the force."""
    return CLIPPED if c[1] > 0.0 and c[0] * depth - c[1] * rise < 0.0 else CLOSED


@inline
def contact_next(c, height, rise, second, room, mode):
    """The mode that follows when the margin of this one is used up.

    c (CONTACT,): parameters of the contact.
    height (m): of the point above the edge.
    rise (m/s): rate of the height.
    second (m/s^2): rate of rise.
    room (m): how far it is within the ends.
    mode: the present one.
    """
    on_edge = room >= 0.0
    # what rests beside the edge is on the side where it is: the second rate is that of the mode which it has left
    near = AT_SWITCH if abs(rise) > REST else 0.0
    if mode == BESIDE:
        return ABOVE
    if mode == ABOVE:
        if not on_edge:
            return BESIDE
        if height < -near:
            return _touching(c, -height, rise)
        ahead = rise if rise != 0.0 else second
        return CLOSED if ahead < 0.0 else ABOVE
    if height > near:
        return ABOVE
    if not on_edge:
        return BESIDE
    if height >= -near:
        ahead = rise if rise != 0.0 else second
        return ABOVE if ahead > 0.0 else CLOSED
    return CLIPPED if mode == CLOSED else CLOSED


@inline
def contact_start(c, height, rise, second, room):
    """The mode at the start; what is inside the edge then is in contact, what rests at it has reached it."""
    if height > AT_SWITCH:
        return ABOVE
    if room < 0.0:
        return ABOVE if height >= 0.0 else BESIDE
    if height >= -AT_SWITCH:
        ahead = rise if rise != 0.0 else second
        return _touching(c, max(-height, 0.0), rise) if ahead <= 0.0 else ABOVE
    return _touching(c, -height, rise)


@inline
def contact_grazes(c, mode):
    """How derivatives would change if the contact only just left its mode, as `law_grazes` in
    `mechanics.laws.law_table`.

    A damped touch that only just happens leaves no derivative of the motion: 2.
    """
    return 2 if mode == ABOVE and c[1] > 0.0 else 0
