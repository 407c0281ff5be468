"""`curve`: a monotone cubic (PCHIP) through points [x, f], linear outside; V is its integral from x = 0.

Parameters: where its data begin in the scene's curves, number of knots n, V of the formula below at x = 0. The data: n
knots, then for each of the n - 1 pieces four coefficients of powers of x - knot, then V at each knot from the first.
"""

from typing import Any

import numpy as np

from mdstopo.jit import inline


@inline
def curve_force(p, x, curves):  # type: ignore[no-untyped-def]
    """f, f_x, f_xd, V, V_x."""
    at = int(p[0])
    n = int(p[1])
    pieces = at + n
    stored = at + n + 4 * (n - 1)
    if x <= curves[at]:
        s = x - curves[at]
        f0 = curves[pieces]
        slope = curves[pieces + 1]
        f = f0 + slope * s
        return f, slope, 0.0, s * (f0 + 0.5 * slope * s) - p[2], f
    if x >= curves[at + n - 1]:
        o = pieces + 4 * (n - 2)
        w = curves[at + n - 1] - curves[at + n - 2]
        s = x - curves[at + n - 1]
        f0 = curves[o] + w * (curves[o + 1] + w * (curves[o + 2] + w * curves[o + 3]))
        slope = curves[o + 1] + w * (2.0 * curves[o + 2] + 3.0 * w * curves[o + 3])
        f = f0 + slope * s
        return f, slope, 0.0, curves[stored + n - 1] + s * (f0 + 0.5 * slope * s) - p[2], f
    low = 0
    high = n - 1
    while high - low > 1:
        middle = (low + high) // 2
        if curves[at + middle] <= x:
            low = middle
        else:
            high = middle
    o = pieces + 4 * low
    s = x - curves[at + low]
    f = curves[o] + s * (curves[o + 1] + s * (curves[o + 2] + s * curves[o + 3]))
    slope = curves[o + 1] + s * (2.0 * curves[o + 2] + 3.0 * s * curves[o + 3])
    energy = s * (curves[o] + s * (curves[o + 1] / 2.0 + s * (curves[o + 2] / 3.0 + s * curves[o + 3] / 4.0)))
    return f, slope, 0.0, curves[stored + low] + energy - p[2], f


def curve_data(points: Any, at: int) -> tuple[list[float], list[float]]:
    """Parameters and data of a curve (n, 2) whose data begin at place `at`."""
    from scipy.interpolate import PchipInterpolator

    x, f = np.asarray(points, dtype=np.float64).T
    pieces = PchipInterpolator(x, f)
    # SciPy's coefficients fall in power
    c = pieces.c[::-1].T
    w = np.diff(x)
    areas = w * (c[:, 0] + w * (c[:, 1] / 2.0 + w * (c[:, 2] / 3.0 + w * c[:, 3] / 4.0)))
    stored = np.concatenate([[0.0], np.cumsum(areas)])
    data = np.concatenate([x, c.ravel(), stored])
    parameters = np.array([0.0, len(x), 0.0])
    parameters[2] = curve_force.py_func(parameters, 0.0, data)[3]  # type: ignore[attr-defined]
    parameters[0] = at
    return parameters.tolist(), data.tolist()
