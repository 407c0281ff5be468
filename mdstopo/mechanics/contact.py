"""A point of one body against an edge of another: modes, normal force and regularised friction, as scalars.

Seen from the body with the edge, the point lies `along` the edge from its first end and `height` above it, on the left
of its direction; `rise` and `slide` are the rates. In contact, with depth = -height,

    N = k depth - c rise >= 0,     T = -mu N tanh(slide / slip).

Modes: above the edge, closed, clipped (damping would make N negative: no force), beside (behind the edge without
having passed through it). In each mode the formula goes on beyond its end. Row of parameters (CONTACT,): k, c, mu,
slip, the point, the edge's first end, its direction, its length.
"""

import math

from mdstopo.compiler.jit import inline

CONTACT = 11
K, C, MU, SLIP, PX, PY, AX, AY, TX, TY, LENGTH = range(CONTACT)
ABOVE, CLOSED, CLIPPED, BESIDE = range(4)
#: a height this near to the edge, relative to 1 m, is at the switch: rates decide
NEAR = 1e-12


@inline
def contact_pose(c, r):
    """along, height, slide, rise at the relative pose r (POSE,) of edge and point."""
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
def contact_margin(c, along, height, rise, mode):
    """How far the mode is from its end, in m, or the unclipped N by k + c."""
    if mode == ABOVE:
        return height
    if mode == BESIDE:
        return -height
    margin = min(-height, along, c[10] - along)
    if c[1] == 0.0:
        return margin
    unclipped = -(c[0] * height + c[1] * rise) / (c[0] + c[1])
    return min(margin, unclipped) if mode == CLOSED else min(margin, -unclipped)


@inline
def contact_margin_slopes(c, along, height, rise, mode):
    """Slopes of the margin by along, height and rise."""
    if mode == ABOVE:
        return 0.0, 1.0, 0.0
    if mode == BESIDE:
        return 0.0, -1.0, 0.0
    margin = min(-height, along, c[10] - along)
    if c[1] > 0.0:
        sign = -1.0 if mode == CLOSED else 1.0
        total = c[0] + c[1]
        if sign * (c[0] * height + c[1] * rise) / total < margin:
            return 0.0, sign * c[0] / total, sign * c[1] / total
    if -height <= along and -height <= c[10] - along:
        return 0.0, -1.0, 0.0
    return (1.0 if along <= c[10] - along else -1.0), 0.0, 0.0


@inline
def _touching(c, depth, rise):
    """Closed, or clipped where damping would reverse the force."""
    return CLIPPED if c[1] > 0.0 and c[0] * depth - c[1] * rise < 0.0 else CLOSED


@inline
def contact_next(c, along, height, rise, second, mode):
    """The mode that follows where this one's margin is negative.

    c (CONTACT,): parameters of the contact.
    along, height (m): where the point is seen from the edge.
    rise (m/s): rate of the height.
    second (m/s^2): rate of rise.
    mode: the present one.
    """
    on_edge = along >= 0.0 and along <= c[10]
    if mode == BESIDE:
        return ABOVE
    if mode == ABOVE:
        if not on_edge:
            return BESIDE
        if height < -NEAR:
            return _touching(c, -height, rise)
        ahead = rise if rise != 0.0 else second
        return CLOSED if ahead < 0.0 else ABOVE
    if height > NEAR:
        return ABOVE
    if not on_edge:
        return BESIDE
    if height >= -NEAR:
        ahead = rise if rise != 0.0 else second
        return ABOVE if ahead > 0.0 else CLOSED
    return CLIPPED if mode == CLOSED else CLOSED


@inline
def contact_start(c, along, height, rise, second):
    """The mode at the start; what is inside the edge then is in contact, what rests at it has reached it."""
    if height > NEAR:
        return ABOVE
    if along < 0.0 or along > c[10]:
        return ABOVE if height >= 0.0 else BESIDE
    if height >= -NEAR:
        ahead = rise if rise != 0.0 else second
        return _touching(c, max(-height, 0.0), rise) if ahead <= 0.0 else ABOVE
    return _touching(c, -height, rise)


@inline
def contact_grazes(c, mode):
    """What a margin that is only just used up (or not) does to derivatives, as `law_grazes` in `mechanics.laws.table`.

    A damped touch that only just happens leaves no derivative of the motion: 2.
    """
    return 2 if mode == ABOVE and c[1] > 0.0 else 0
