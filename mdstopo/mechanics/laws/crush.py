"""`crush`: elastic up to a plateau, constant there while it deforms further, elastic again on the way back.

Parameters: k, F, gap, side (1 tension, -1 compression). The elongation x that comes in is the member's less its
permanent set (`strength` row 2), so y = side x - gap is what is elastic: 0 <= y <= F / k, f = side k y. Modes: open
(no contact, no force), elastic, and crushing, f = side F, which lasts as long as side x' > 0. While it crushes its set
grows with its elongation; it is written down when crushing ends, where y is F / k again: nothing jumps.
"""

from mdstopo.compiler.jit import inline
from mdstopo.mechanics.laws.law_kernels import LawKernels, Modes, PermanentSet, always

OPEN, ELASTIC, CRUSHING = range(3)
#: an elongation this near to the gap, relative to 1 m or the gap, is at the switch: rates decide
AT_SWITCH = 1e-12


@inline
def crush_force(p, x, mode):
    """Force, its slopes by x and xd, energy and its slope by x; energy is what unloading gives back, f^2 / (2 k)."""
    if mode == OPEN:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    if mode == CRUSHING:
        return p[3] * p[1], 0.0, 0.0, 0.5 * p[1] * p[1] / p[0], 0.0
    y = p[3] * x - p[2]
    pull = p[0] * y
    return p[3] * pull, p[0], 0.0, 0.5 * pull * y, p[3] * pull


@inline
def crush_idle(mode):
    """Whether a member in this mode has no force: in the open one."""
    return mode == OPEN


@inline
def crush_margins(mode):
    """How many margins a mode has: while it is elastic a member may lose contact, or reach its plateau."""
    return 2 if mode == ELASTIC else 1


@inline
def crush_one_margin(p, which, x, xd, mode):
    """One margin and its slopes by x, xd and time; while it is elastic, up to where contact is lost and to the
    plateau."""
    if mode == CRUSHING:
        return p[3] * xd, 0.0, p[3], 0.0
    y = p[3] * x - p[2]
    if mode == OPEN:
        return -y, -p[3], 0.0, 0.0
    if which == 0:
        return y, p[3], 0.0, 0.0
    return p[1] / p[0] - y, -p[3], 0.0, 0.0


@inline
def _nears_plateau(p, x):
    """Whether a member that is elastic is nearer to its plateau than to losing contact."""
    return p[3] * x - p[2] > 0.5 * p[1] / p[0]


@inline
def crush_margin(p, x, xd, mode):
    """How far the mode is from its end: y or what is left to the plateau in m, or the rate in m/s."""
    s, _, _, _ = crush_one_margin(p, 1 if _nears_plateau(p, x) else 0, x, xd, mode)
    return s


@inline
def crush_margin_slopes(p, x, xd, mode):
    """Slopes of the margin, which says how far the mode is from its end, by x and xd."""
    _, by_x, by_rate, _ = crush_one_margin(p, 1 if _nears_plateau(p, x) else 0, x, xd, mode)
    return by_x, by_rate


@inline
def crush_slopes(p, place, x, mode):
    """Slopes of force and energy by the parameters, at a fixed permanent set: df/dp, dV/dp."""
    if mode == OPEN:
        return 0.0, 0.0
    if mode == CRUSHING:
        if place == 1:
            return p[3], p[1] / p[0]
        return 0.0, (-0.5 * p[1] * p[1] / (p[0] * p[0]) if place == 0 else 0.0)
    y = p[3] * x - p[2]
    if place == 0:
        return p[3] * y, 0.5 * y * y
    return (-p[3] * p[0], -p[0] * y) if place == 2 else (0.0, 0.0)


@inline
def crush_margin_slope(p, place, x, mode):
    """Slope of the margin by a parameter, at a fixed set."""
    if mode == CRUSHING:
        return 0.0
    if mode == OPEN:
        return 1.0 if place == 2 else 0.0
    if not _nears_plateau(p, x):
        return -1.0 if place == 2 else 0.0
    if place == 2:
        return 1.0
    return 1.0 / p[0] if place == 1 else -p[1] / (p[0] * p[0])


@inline
def crush_set_slope(p, place):
    """Slope by a parameter of the set that `crush_set` or `crush_first_set` makes at a given elongation."""
    if place == 2:
        return -p[3]
    return -p[3] / p[0] if place == 1 else p[3] * p[1] / (p[0] * p[0])


@inline
def crush_next(p, x, mode):
    """The mode that follows when the margin of this one is used up; the force is continuous, so rates need not
    decide."""
    if mode != ELASTIC:
        return ELASTIC
    return CRUSHING if _nears_plateau(p, x) else OPEN


@inline
def crush_start(p, x, xd, xdd):
    """The mode at the start, by the elongation; at the gap or beyond the plateau its rate decides, then the second."""
    y = p[3] * x - p[2]
    near = AT_SWITCH * max(1.0, abs(p[2]))
    ahead = p[3] * (xd if xd != 0.0 else xdd)
    if y < -near or (y <= near and ahead < 0.0):
        return OPEN
    if y >= p[1] / p[0]:
        return CRUSHING if ahead >= 0.0 else ELASTIC
    return ELASTIC


@inline
def crush_set(p, x, old, new):
    """By how much the permanent set grows where mode `old` gives way to `new`: when crushing ends, y becomes F / k."""
    return p[3] * (p[3] * x - p[2] - p[1] / p[0]) if old == CRUSHING and new == ELASTIC else 0.0


@inline
def crush_first_set(p, x, mode):
    """The permanent set of a member that begins in `mode` beyond the plateau and moves back: it has been crushed."""
    return max(p[3] * x - p[2] - p[1] / p[0], 0.0) * p[3] if mode == ELASTIC else 0.0


@inline
def crush_grazes(p, x, mode):
    """How derivatives would change if a mode were only just left: not at all (0), or through the motion (2).

    A plateau that is only just reached leaves a permanent set on one side and none on the other.
    """
    return 2 if mode == ELASTIC and _nears_plateau(p, x) else 0


@inline
def crush_makes_set(old, new):
    """Whether the set is written down: where crushing ends."""
    return old == CRUSHING and new == ELASTIC


@inline
def crush_divides(p, x, xd, mode, near):
    """Whether a member begins at its plateau and moves back, so that its set would be another if it began beyond."""
    return mode == ELASTIC and p[3] * xd <= 0.0 and abs(p[3] * x - p[2] - p[1] / p[0]) <= near


KERNELS = LawKernels(
    force=crush_force,
    slopes=crush_slopes,
    modes=Modes(
        margin=crush_margin,
        margin_slopes=crush_margin_slopes,
        margin_slope=crush_margin_slope,
        margins=crush_margins,
        one_margin=crush_one_margin,
        next_mode=crush_next,
        first_mode=crush_start,
        idle=crush_idle,
        grazes=crush_grazes,
        degree=1,
    ),
    permanent_set=PermanentSet(
        growth=crush_set,
        first=crush_first_set,
        is_made=crush_makes_set,
        slope=crush_set_slope,
        divides=crush_divides,
    ),
    is_even=always,
)
