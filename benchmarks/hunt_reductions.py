"""Numbers of smooth pieces between kinks: integrals and extremes over time for the hunt's second model.

A response is the length of a vector: of one component its absolute value, of several either their Euclidean norm or the
largest of their absolute values (`led`). Kinks are where a component alone passes zero or another one becomes the
largest; a norm that comes near zero is cut there as well, where it bends sharply.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar

Vector = np.ndarray[Any, np.dtype[np.float64]]
#: a time -> the components of a response
Look = Callable[[float], Vector]
#: panels of an integral over a piece at first and their nodes, how well they are to agree with their halves
PANELS, NODES, AGREE, DEPTH = 6, 10, 1e-13, 12
#: the smallest size that a response counts with: what joints hold at zero is zero to rounding
SMALLEST = 1e-6
#: of a norm, as a share of the largest: below it, minima are cut at
LOW = 0.3


def length(vector: Vector, led: bool) -> float:
    """The response."""
    return float(np.abs(vector).max(initial=0.0) if led else np.linalg.norm(vector))


def kinks(look: Look, grid: Vector, seen: Vector, led: bool) -> list[float]:
    """Times inside a grid (K,) with components seen (K, C) at which the response has a kink, or nearly one."""
    if led or seen.shape[1] == 1:
        inside = range(1, len(grid) - 1)
        found = [t for k in range(len(grid) - 1) for t in _between(look, grid[k], grid[k + 1], seen[k], seen[k + 1])]
        return found + [t for k in inside for t in _brief(look, grid[k - 1 : k + 2], seen[k - 1 : k + 2])]
    size = np.linalg.norm(seen, axis=1)
    last = len(grid) - 1
    found = []
    for k in range(last + 1):
        before, after = max(k - 1, 0), min(k + 1, last)
        if size[k] <= min(size[before], size[after], LOW * size.max()):
            t = _lowest(lambda t: length(look(t), False) ** 2, grid[before], grid[after])
            t = _sharpened(look, t, grid[before], grid[after])
            found += [t] if grid[0] < t < grid[-1] else []
    return found


def _between(look: Look, a: float, b: float, left: Vector, right: Vector, depth: int = 0) -> list[float]:
    """Where the largest component changes, or its sign, between two times."""
    i, j = int(np.abs(left).argmax()), int(np.abs(right).argmax())
    si, sj = np.sign(left[i]), np.sign(right[j])
    if (i, si) == (j, sj) or depth > 6 or 0.0 in (si, sj):
        return []

    def ahead(t: float) -> float:
        f = look(t)
        return float(f[i]) if i == j else float(si * f[i] - sj * f[j])

    ends = (float(left[i]), float(right[i])) if i == j else (
        float(si * left[i] - sj * left[j]),
        float(si * right[i] - sj * right[j]),
    )  # fmt: skip
    if ends[0] * ends[1] >= 0.0:
        return []
    t = float(brentq(ahead, a, b, xtol=1e-15, rtol=1e-15))
    there = look(t)
    if np.abs(there).max() <= abs(there[i]) * (1.0 + 1e-9) + 1e-12 * np.abs(left).max():
        return [t]
    # a third one leads in between
    middle = int(np.abs(there).argmax())
    if middle in (i, j):
        return [t]
    return _between(look, a, t, left, there, depth + 1) + _between(look, t, b, there, right, depth + 1)


def _brief(look: Look, grid: Vector, seen: Vector) -> list[float]:
    """Where another component leads, or the leading one has another sign, between samples at which it does not."""
    i = int(np.abs(seen[1]).argmax())
    sign = np.sign(seen[1, i])
    found = []
    for j in range(seen.shape[1]):
        for other in (1.0, -1.0):
            if j == i and other > 0.0:
                continue
            d = sign * seen[:, i] - (other * sign * seen[:, j] if j != i else 0.0)
            if not (0.0 < d[1] <= min(d[0], d[2]) and d[1] <= 0.5 * (d[0] + d[2] - 2.0 * d[1])):
                continue

            def ahead(t: float, j: int = j, other: float = other) -> float:
                f = look(t)
                return float(sign * f[i] - (other * sign * f[j] if j != i else 0.0))

            low = _lowest(ahead, grid[0], grid[2])
            if ahead(low) < 0.0:
                sides = (grid[0], low), (low, grid[2])
                found += [float(brentq(ahead, a, b, xtol=1e-15, rtol=1e-15)) for a, b in sides]
    return found


def _lowest(f: Callable[[float], float], a: float, b: float) -> float:
    return float(minimize_scalar(f, bounds=(a, b), method="bounded", options={"xatol": 1e-13}).x)


def _sharpened(look: Look, t: float, a: float, b: float) -> float:
    """Where between two times a vector is shortest, from a time near it: from its components, which are smooth.

    A search for the lowest value knows the time to half the digits, and the length there is off by as much.
    """
    d = 1e-3 * (b - a)
    for _ in range(3):
        if not a + d < t < b - d:
            break
        here, rate = look(t), (look(t + d) - look(t - d)) / (2.0 * d)
        square = float(rate @ rate)
        t -= float(np.clip(here @ rate / square, -d, d)) if square > 0.0 else 0.0
    return float(min(max(t, a), b))


def highest(f: Callable[[float], float], grid: Vector, seen: Vector, sign: float) -> float:
    """The largest value of sign f over a grid (K,) with values seen (K,), refined about those that come near."""
    values = sign * seen
    best = float(np.max(values))
    near = np.flatnonzero(values >= best - 0.02 * max(abs(best), float(np.ptp(values))))
    for i in near.tolist():
        low, high = max(i - 1, 0), min(i + 1, len(grid) - 1)
        if values[i] < values[low] or values[i] < values[high]:
            continue
        found = minimize_scalar(
            lambda t: -sign * f(t), bounds=(grid[low], grid[high]), method="bounded", options={"xatol": 1e-13}
        )
        best = max(best, -float(found.fun))
    return best


def integral(f: Callable[[float], float], edges: list[float], agree: float = AGREE, panels: int = PANELS) -> float:
    """Between edges, by Gauss-Legendre panels that are halved where they do not agree with their halves."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)

    def panel(a: float, b: float) -> float:
        middle, half = 0.5 * (a + b), 0.5 * (b - a)
        return half * float(sum(w * f(middle + half * x) for x, w in zip(nodes, weights, strict=True)))

    cuts = [t for a, b in pairwise(edges) for t in np.linspace(a, b, panels + 1)[:-1].tolist()] + [edges[-1]]
    left = [(a, b, panel(a, b), 0) for a, b in pairwise(cuts)]
    whole = sum(abs(value) for _, _, value, _ in left)
    total = 0.0
    while left:
        a, b, value, depth = left.pop()
        middle = 0.5 * (a + b)
        one, two = panel(a, middle), panel(middle, b)
        if abs(one + two - value) <= agree * max(whole, SMALLEST) or depth == DEPTH or b - a <= 1e-13:
            total += one + two
        else:
            left += [(a, middle, one, depth + 1), (middle, b, two, depth + 1)]
    return total
