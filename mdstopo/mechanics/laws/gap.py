"""`gap` (Eq. 3): nothing until the elongation reaches the gap, then k (x - gap) + c x'.

Parameters: k, c, gap, side (1 tension, -1 compression), clip (1 or 0). With y = side x - gap the law acts for y >= 0
with f = side (k y + c side x'); compression is the mirror image. Modes: open, closed, and closed with a force that
clip holds at zero, because damping would reverse it. In each mode the formula goes on beyond its end.
"""

from mdstopo.compiler.jit import inline
from mdstopo.mechanics.laws.law_kernels import LawKernels, Modes, always

OPEN, CLOSED, CLIPPED = range(3)
#: an elongation this near to the gap, relative to 1 m or the gap, is at the switch: rates decide
AT_SWITCH = 1e-12
#: rates below this are rest (m/s): they decide nothing, as rounding alone moves bodies so fast
REST = 1e-10


@inline
def gap_force(p, x, xd, mode):
    """Force and its slopes by x and xd, energy and its slope by x: f, f_x, f_xd, V, V_x."""
    if mode == OPEN:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    y = p[3] * x - p[2]
    pull = p[0] * y
    if mode == CLIPPED:
        return 0.0, 0.0, 0.0, 0.5 * pull * y, p[3] * pull
    return p[3] * pull + p[1] * xd, p[0], p[1], 0.5 * pull * y, p[3] * pull


@inline
def _clips(p):
    """Whether there is a force, and clip guards its sign."""
    return p[4] != 0.0 and p[0] + p[1] > 0.0


@inline
def gap_idle(mode):
    """Whether a member in this mode has no force: in the open one."""
    return mode == OPEN


@inline
def gap_margin(p, x, xd, mode):
    """How far a member is from the end of its mode: y in m, or the force before it is cut off, divided by k + c."""
    y = p[3] * x - p[2]
    if mode == OPEN:
        return -y
    if not _clips(p):
        return y
    unclipped = (p[0] * y + p[1] * p[3] * xd) / (p[0] + p[1])
    return min(y, unclipped) if mode == CLOSED else min(y, -unclipped)


@inline
def gap_margin_slopes(p, x, xd, mode):
    """Slopes of the margin, which says how far the mode is from its end, by x and xd."""
    if mode == OPEN:
        return -p[3], 0.0
    y = p[3] * x - p[2]
    if not _clips(p):
        return p[3], 0.0
    by_x = p[0] * p[3] / (p[0] + p[1])
    by_rate = p[1] * p[3] / (p[0] + p[1])
    unclipped = (p[0] * y + p[1] * p[3] * xd) / (p[0] + p[1])
    if mode == CLOSED:
        if y <= unclipped:
            return p[3], 0.0
        return by_x, by_rate
    if y <= -unclipped:
        return p[3], 0.0
    return -by_x, -by_rate


@inline
def gap_margins(p, mode):
    """How many margins a mode has: in contact, with clip, that of contact and that of the force."""
    return 2 if mode != OPEN and _clips(p) else 1


@inline
def gap_one_margin(p, which, x, xd, mode):
    """One margin and its slopes by x, xd and time: in contact, up to where contact is lost, then that of the force."""
    y = p[3] * x - p[2]
    if mode == OPEN:
        return -y, -p[3], 0.0, 0.0
    if which == 0:
        return y, p[3], 0.0, 0.0
    sign = (1.0 if mode == CLOSED else -1.0) / (p[0] + p[1])
    return sign * (p[0] * y + p[1] * p[3] * xd), sign * p[0] * p[3], sign * p[1] * p[3], 0.0


@inline
def gap_slopes(p, place, x, xd, mode):
    """Slopes of force and energy by a parameter: df/dp, dV/dp."""
    if mode == OPEN:
        return 0.0, 0.0
    y = p[3] * x - p[2]
    acts = 0.0 if mode == CLIPPED else 1.0
    if place == 0:
        return acts * p[3] * y, 0.5 * y * y
    if place == 1:
        return acts * xd, 0.0
    return -acts * p[3] * p[0], -p[0] * y


@inline
def gap_margin_slope(p, place, x, xd, mode):
    """The slope of the margin, which says how far the mode is from its end, by a parameter."""
    y = p[3] * x - p[2]
    unclipped = (p[0] * y + p[1] * p[3] * xd) / (p[0] + p[1]) if _clips(p) else y
    if mode == OPEN or not _clips(p) or y <= (unclipped if mode == CLOSED else -unclipped):
        return (0.0 if place != 2 else 1.0) if mode == OPEN else (0.0 if place != 2 else -1.0)
    sign = (1.0 if mode == CLOSED else -1.0) / (p[0] + p[1])
    if place == 2:
        return -sign * p[0]
    return sign * ((y if place == 0 else p[3] * xd) - unclipped)


@inline
def _closed(p, y, rate):
    """Closed, or clipped where damping would reverse the force."""
    if _clips(p) and p[0] * y + p[1] * rate < 0.0:
        return CLIPPED
    return CLOSED


@inline
def gap_next(p, x, xd, xdd, mode):
    """The mode that follows when the margin of this one is used up.

    Away from the gap its side decides, for a law may begin to act on a member that has moved meanwhile; at the gap
    the rate does, then the second derivative. What rests beside the gap is on the side where it is, however near: its
    second derivative is that of the mode which it has left, whose force beyond the gap would keep it there forever. In
    contact only the force can have changed its sign: the other mode follows without a second look, which might differ
    from the margin by rounding.
    """
    y = p[3] * x - p[2]
    rate = p[3] * xd
    near = AT_SWITCH * max(1.0, abs(p[2])) if abs(rate) > REST else 0.0
    if y > near:
        if mode == OPEN:
            return _closed(p, y, rate)
        return CLIPPED if mode == CLOSED and _clips(p) else CLOSED
    if y < -near:
        return OPEN
    ahead = rate if rate != 0.0 else p[3] * xdd
    if mode == OPEN:
        return CLOSED if ahead > 0.0 else OPEN
    return OPEN if ahead < 0.0 else CLOSED


@inline
def gap_start(p, x, xd, xdd):
    """The mode at the start; what rests exactly at the gap has reached it."""
    y = p[3] * x - p[2]
    rate = p[3] * xd
    near = AT_SWITCH * max(1.0, abs(p[2]))
    if y < -near:
        return OPEN
    if y <= near:
        ahead = rate if rate != 0.0 else p[3] * xdd
        return _closed(p, max(y, 0.0), rate) if ahead >= 0.0 else OPEN
    return _closed(p, y, rate)


@inline
def gap_grazes(p, mode):
    """How derivatives would change if a mode were only just left: not at all (0), by the force (1), by the motion
    (2).

    Touching by a depth y lasts sqrt(y). Damping gives a force that begins with the root of y; its impulse c (y - y) is
    nothing, unless clip takes the returning half away: then it is c y, which has a kink where nothing touches.
    """
    if mode != OPEN or p[1] == 0.0:
        return 0
    return 2 if p[4] != 0.0 else 1


KERNELS = LawKernels(
    force=gap_force,
    slopes=gap_slopes,
    modes=Modes(
        margin=gap_margin,
        margin_slopes=gap_margin_slopes,
        margin_slope=gap_margin_slope,
        margins=gap_margins,
        one_margin=gap_one_margin,
        next_mode=gap_next,
        first_mode=gap_start,
        idle=gap_idle,
        grazes=gap_grazes,
        degree=1,
    ),
    is_even=always,
)
