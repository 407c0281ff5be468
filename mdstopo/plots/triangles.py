"""Areas as triangles, for viewers that draw nothing else."""

import numpy as np

from mdstopo.plots.scenery import Floats


def triangles(corners: Floats) -> list[tuple[int, int, int]]:
    """Triangles that fill a simple closed line (n, 2) or, flat in space, (n, 3); n - 2, in the sense of the line.

    By cutting ears: a corner that turns as the whole does, with no other corner in its triangle. Where a line crosses
    itself what is left is cut all the same.
    """
    flat = corners if corners.shape[1] == 2 else _in_plane(corners)
    x, y = flat.T
    sign = 1.0 if float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) >= 0.0 else -1.0
    left = list(range(len(flat)))
    found = []
    while len(left) > 3:
        k = next((k for k in range(len(left)) if _is_ear(flat, left, k, sign)), 0)
        found.append((left[k - 1], left[k], left[(k + 1) % len(left)]))
        del left[k]
    return [*found, (left[0], left[1], left[2])]


def _is_ear(flat: Floats, left: list[int], k: int, sign: float) -> bool:
    a, b, c = (flat[left[j % len(left)]] for j in (k - 1, k, k + 1))
    if sign * _cross(b - a, c - b) <= 0.0:
        return False
    rest = flat[[j for n, j in enumerate(left) if n not in (k, (k - 1) % len(left), (k + 1) % len(left))]]
    inside = np.ones(len(rest), dtype=bool)
    for start, end in ((a, b), (b, c), (c, a)):
        way = end - start
        inside &= sign * (way[0] * (rest[:, 1] - start[1]) - way[1] * (rest[:, 0] - start[0])) >= 0.0
    return not bool(inside.any())


def _cross(a: Floats, b: Floats) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def _in_plane(corners: Floats) -> Floats:
    """Corners (n, 2) in the plane of a flat line in space, in whose normal it is counterclockwise."""
    away = corners - corners.mean(axis=0)
    normal = np.cross(away, np.roll(away, -1, axis=0)).sum(axis=0)
    axes = np.linalg.svd(away, full_matrices=True)[2]
    first = axes[0]
    second = np.cross(normal / max(float(np.linalg.norm(normal)), 1e-300), first)
    return np.stack([away @ first, away @ second], axis=1)
