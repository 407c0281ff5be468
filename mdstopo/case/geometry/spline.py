"""The not-a-knot cubic spline of a table of positions, as far as a start needs it: value and slope."""

from __future__ import annotations

import numpy as np

from mdstopo.case.arrays import FloatArray


def slopes(t: FloatArray, x: FloatArray) -> FloatArray:
    """Slopes (n,) at the knots of the not-a-knot cubic spline through (t, x), n >= 4, t rising.

    The spline is C2; its third derivative is continuous at the second knot from either end.
    """
    n = len(t)
    h = np.diff(t)
    d = np.diff(x) / h
    # Tridiagonal rows (below, diagonal, above | right): C2 at the inner knots, not-a-knot at the ends.
    below, diagonal, above, right = np.zeros(n), np.empty(n), np.zeros(n), np.empty(n)
    below[1:-1], above[1:-1] = h[1:], h[:-1]
    diagonal[1:-1] = 2.0 * (h[:-1] + h[1:])
    right[1:-1] = 3.0 * (h[1:] * d[:-1] + h[:-1] * d[1:])
    diagonal[0], above[0] = h[1], h[0] + h[1]
    right[0] = ((h[0] + 2.0 * above[0]) * h[1] * d[0] + h[0] ** 2 * d[1]) / above[0]
    diagonal[-1], below[-1] = h[-2], h[-1] + h[-2]
    right[-1] = (h[-1] ** 2 * d[-2] + (2.0 * below[-1] + h[-1]) * h[-2] * d[-1]) / below[-1]
    for i in range(1, n):
        factor = below[i] / diagonal[i - 1]
        diagonal[i] -= factor * above[i - 1]
        right[i] -= factor * right[i - 1]
    found = np.empty(n)
    found[-1] = right[-1] / diagonal[-1]
    for i in range(n - 2, -1, -1):
        found[i] = (right[i] - above[i] * found[i + 1]) / diagonal[i]
    return found


def value_and_slope(t: FloatArray, x: FloatArray, time: float) -> tuple[float, float]:
    """x(time) and dx/dt(time) of the spline; `time` within the table. Not finite where numbers overflow."""
    with np.errstate(all="ignore"):
        m = slopes(t, x)
        i = int(np.clip(np.searchsorted(t, time, side="right") - 1, 0, len(t) - 2))
        h = t[i + 1] - t[i]
        s = (time - t[i]) / h
        d = (x[i + 1] - x[i]) / h
        a, b = m[i] - d, m[i + 1] - d
        value = x[i] + h * s * (d + (1.0 - s) * (a * (1.0 - s) - b * s))
        slope = d + a * (1.0 - s) * (1.0 - 3.0 * s) - b * s * (2.0 - 3.0 * s)
    return float(value), float(slope)
