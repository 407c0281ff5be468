"""The highest peak between looks at a curve, from its heights and slopes there."""

import numpy as np

from benchmarks.peers.problem import Floats


def highest(heights: Floats, slopes: Floats, end: float) -> tuple[float, bool]:
    """Time of the highest peak of the cubics between equally spaced looks, and whether it lies inside of (0, end)."""
    h = end / (len(heights) - 1)
    best, place, inside = float(heights[-1]), end, False
    for k, (g0, g1, s0, s1) in enumerate(zip(heights, heights[1:], h * slopes, h * slopes[1:], strict=False)):
        if s0 >= 0.0 > s1:
            a, b = 3.0 * (s0 + s1) - 6.0 * (g1 - g0), -2.0 * (2.0 * s0 + s1) + 6.0 * (g1 - g0)
            roots = np.roots([a, b, s0])
            for s in roots[np.isreal(roots)].real:
                top = g0 + s * (s0 + s * (0.5 * b + s * a / 3.0))
                if 0.0 < s <= 1.0 and 2.0 * a * s + b < 0.0 and top > best:
                    best, place, inside = float(top), (k + float(s)) * h, True
    return place, inside
