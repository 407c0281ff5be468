"""`gap` (Eq. 3): nothing until the elongation reaches the gap, then k (x - gap) + c x'.

Parameters: k, c, gap, side (1 tension, -1 compression), clip (1 or 0). With y = side x - gap the law acts for y >= 0
with f = side (k y + c side x'); compression is the mirror image. Modes: open, closed, and closed with a force that
clip holds at zero, because damping would reverse it. In each mode the formula goes on beyond its end.
"""

from mdstopo.jit import inline

OPEN, CLOSED, CLIPPED = range(3)
#: an elongation this near to the gap, relative to 1 m or the gap, is at the switch: rates decide
NEAR = 1e-12


@inline
def gap_force(p, x, xd, mode):  # type: ignore[no-untyped-def]
    """f, f_x, f_xd, V, V_x."""
    if mode == OPEN:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    y = p[3] * x - p[2]
    pull = p[0] * y
    if mode == CLIPPED:
        return 0.0, 0.0, 0.0, 0.5 * pull * y, p[3] * pull
    return p[3] * pull + p[1] * xd, p[0], p[1], 0.5 * pull * y, p[3] * pull


@inline
def gap_margin(p, x, xd, mode):  # type: ignore[no-untyped-def]
    """How far the mode is from its end: in m for opening and closing, in m of spring for clipping."""
    y = p[3] * x - p[2]
    if mode == OPEN:
        return -y
    if p[4] == 0.0 or p[0] == 0.0:
        return y
    unclipped = y + p[1] * p[3] * xd / p[0]
    return min(y, unclipped) if mode == CLOSED else min(y, -unclipped)


@inline
def gap_margin_slopes(p, x, xd, mode):  # type: ignore[no-untyped-def]
    """Slopes of the margin by x and xd."""
    if mode == OPEN:
        return -p[3], 0.0
    y = p[3] * x - p[2]
    if p[4] == 0.0 or p[0] == 0.0:
        return p[3], 0.0
    by_rate = p[1] * p[3] / p[0]
    unclipped = y + by_rate * xd
    if mode == CLOSED:
        if y <= unclipped:
            return p[3], 0.0
        return p[3], by_rate
    if y <= -unclipped:
        return p[3], 0.0
    return -p[3], -by_rate


@inline
def _closed(p, y, rate):  # type: ignore[no-untyped-def]
    """Closed, or clipped where damping would reverse the force."""
    if p[4] != 0.0 and p[0] * y + p[1] * rate < 0.0:
        return CLIPPED
    return CLOSED


@inline
def gap_next(p, x, xd, xdd, mode):  # type: ignore[no-untyped-def]
    """The mode behind the end of this one: the side is that of the rate, then of the second derivative."""
    y = p[3] * x - p[2]
    rate = p[3] * xd
    ahead = rate if rate != 0.0 else p[3] * xdd
    if mode == OPEN:
        return _closed(p, max(y, 0.0), rate) if ahead > 0.0 else OPEN
    near = NEAR * max(1.0, abs(p[2]))
    if y <= near and ahead < 0.0:
        return OPEN
    return _closed(p, y, rate) if mode == CLIPPED or y <= near else CLIPPED


@inline
def gap_start(p, x, xd, xdd):  # type: ignore[no-untyped-def]
    """The mode at the start."""
    y = p[3] * x - p[2]
    rate = p[3] * xd
    near = NEAR * max(1.0, abs(p[2]))
    if y < -near:
        return OPEN
    if y <= near:
        ahead = rate if rate != 0.0 else p[3] * xdd
        return _closed(p, max(y, 0.0), rate) if ahead > 0.0 else OPEN
    return _closed(p, y, rate)


@inline
def gap_jumps(p, before, after):  # type: ignore[no-untyped-def]
    """Whether the force jumps at this switch: with damping, where contact begins or ends with a force."""
    if p[1] == 0.0:
        return False
    return (before == OPEN and after == CLOSED) or (before == CLOSED and after == OPEN)
