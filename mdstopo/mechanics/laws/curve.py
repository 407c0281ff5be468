"""`curve`: a monotone cubic (PCHIP) through points [x, f], linear outside; V is its integral from x = 0.

Parameters: where its data begin in the scene's curves, number of knots n, V of the formula below at x = 0, and by how
much a piece goes on beyond its ends (`OVERLAP`). The data: n knots, then for each of the n - 1 pieces four coefficients
of powers of x - knot, then V at each knot from the first.

The second derivative jumps at the knots, where a step has to end if its error is to be of an order above the second. So
every piece is a mode: 1 is the line below the first knot, i + 1 the cubic behind knot i, n + 1 the line above the last
knot; mode 0, where steps need not end at knots, is whichever piece x is in. Force and stiffness are continuous at a
knot: accelerations do not jump there, and derivatives do not feel when it is passed.
"""

import numpy as np

from mdstopo.case.laws import CurveLaw
from mdstopo.compiler.jit import inline
from mdstopo.mechanics.laws.law_kernels import LawKernels, Modes, always

#: how far a piece goes on beyond its ends, relative to the narrowest: what rests on a knot does not change its mode by
#: rounding, and the force is off by no more than the square of it
OVERLAP = 1e-8


@inline
def curve_force(p, x, mode, curves):
    """Force and its slopes by x and xd, energy and its slope by x: f, f_x, f_xd, V, V_x."""
    at = int(p[0])
    n = int(p[1])
    pieces = at + n
    stored = at + n + 4 * (n - 1)
    place = mode if mode > 0 else curve_piece(p, x, curves)
    if place == 1:
        s = x - curves[at]
        f0 = curves[pieces]
        slope = curves[pieces + 1]
        f = f0 + slope * s
        return f, slope, 0.0, s * (f0 + 0.5 * slope * s) - p[2], f
    if place == n + 1:
        o = pieces + 4 * (n - 2)
        w = curves[at + n - 1] - curves[at + n - 2]
        s = x - curves[at + n - 1]
        f0 = curves[o] + w * (curves[o + 1] + w * (curves[o + 2] + w * curves[o + 3]))
        slope = curves[o + 1] + w * (2.0 * curves[o + 2] + 3.0 * w * curves[o + 3])
        f = f0 + slope * s
        return f, slope, 0.0, curves[stored + n - 1] + s * (f0 + 0.5 * slope * s) - p[2], f
    low = place - 2
    o = pieces + 4 * low
    s = x - curves[at + low]
    f = curves[o] + s * (curves[o + 1] + s * (curves[o + 2] + s * curves[o + 3]))
    slope = curves[o + 1] + s * (2.0 * curves[o + 2] + 3.0 * s * curves[o + 3])
    energy = s * (curves[o] + s * (curves[o + 1] / 2.0 + s * (curves[o + 2] / 3.0 + s * curves[o + 3] / 4.0)))
    return f, slope, 0.0, curves[stored + low] + energy - p[2], f


@inline
def curve_piece(p, x, curves):
    """The mode of the piece that x is in: 1 below the first knot, n + 1 from the last one on."""
    at = int(p[0])
    n = int(p[1])
    low = -1
    high = n
    while high - low > 1:
        middle = (low + high) // 2
        if curves[at + middle] <= x:
            low = middle
        else:
            high = middle
    return low + 2


@inline
def curve_start(p, x, xd, xdd, curves):
    """The mode at the start; on a knot, the piece that it moves into."""
    ahead = xd if xd != 0.0 else xdd
    if ahead == 0.0:
        return curve_piece(p, x, curves)
    return curve_piece(p, x + 0.5 * p[3] if ahead > 0.0 else x - 0.5 * p[3], curves)


@inline
def curve_margins(p, mode):
    """How many ends a piece of the curve has; none where steps need not end at knots."""
    if mode <= 0:
        return 0
    return 2 if 1 < mode <= int(p[1]) else 1


@inline
def curve_one_margin(p, which, x, mode, curves):
    """One margin of a piece of the curve (m), and its slopes by x, xd and time.

    which: 0 is the distance of x to the lower end of the piece, 1 that to the upper end. The first piece has no lower
    end: there 0 is the distance to the upper one.
    """
    at = int(p[0])
    if which == 0 and mode > 1:
        return x - curves[at + mode - 2] + p[3], 1.0, 0.0, 0.0
    return curves[at + mode - 1] - x + p[3], -1.0, 0.0, 0.0


@inline
def _least(p, x, mode, curves):
    """The number of the margin that is the least, of a piece that has one."""
    if curve_margins(p, mode) < 2:
        return 0
    below, _, _, _ = curve_one_margin(p, 0, x, mode, curves)
    above, _, _, _ = curve_one_margin(p, 1, x, mode, curves)
    return 1 if above < below else 0


@inline
def curve_margin(p, x, mode, curves):
    """How far the elongation x is from the end of its piece of the curve (m)."""
    if mode <= 0:
        return np.inf
    s, _, _, _ = curve_one_margin(p, _least(p, x, mode, curves), x, mode, curves)
    return s


@inline
def curve_margin_slopes(p, x, mode, curves):
    """Slopes of the margin, which says how far the mode is from its end, by x and xd."""
    if mode <= 0:
        return 0.0, 0.0
    _, by_x, by_rate, _ = curve_one_margin(p, _least(p, x, mode, curves), x, mode, curves)
    return by_x, by_rate


def curve_data(record: CurveLaw, at: int) -> tuple[list[float], list[float]]:
    """Parameters and data of a curve whose data begin at place `at`."""
    from scipy.interpolate import PchipInterpolator

    x, f = record.curve.T
    pieces = PchipInterpolator(x, f)
    # SciPy's coefficients fall in power
    c = pieces.c[::-1].T
    w = np.diff(x)
    areas = w * (c[:, 0] + w * (c[:, 1] / 2.0 + w * (c[:, 2] / 3.0 + w * c[:, 3] / 4.0)))
    stored = np.concatenate([[0.0], np.cumsum(areas)])
    data = np.concatenate([x, c.ravel(), stored])
    parameters = np.array([0.0, len(x), 0.0, OVERLAP * w.min()])
    piece = int(np.searchsorted(x, 0.0, side="right")) + 1
    parameters[2] = curve_force.py_func(parameters, 0.0, piece, data)[3]  # type: ignore[attr-defined]
    parameters[0] = at
    return parameters.tolist(), data.tolist()


KERNELS = LawKernels(
    force=curve_force,
    modes=Modes(
        margin=curve_margin,
        margin_slopes=curve_margin_slopes,
        margins=curve_margins,
        one_margin=curve_one_margin,
        next_mode=curve_piece,
        first_mode=curve_start,
        pieces=True,
        degree=3,
    ),
    data=curve_data,
    is_even=always,
)
