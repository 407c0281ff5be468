"""How good a front is: what is dominated, hypervolume, spacing. Every objective is to be minimised here."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: the reference point of a front's hypervolume, in objectives scaled to its own ideal and nadir
REFERENCE = 1.1
#: relative difference up to which two values of an objective are the same: finer than optima are found
SAME_VALUE = 1e-6


def dominated(points: Floats) -> Bools:
    """(W,) whether another point is at least as good in every objective and better in one; points (W, m).

    Better is what is lower by more than `SAME_VALUE` of the value: rounding makes no point better, and equal points are
    no better than each other. Points that are not finite are dominated.
    """
    finite: Bools = np.array(np.isfinite(points).all(axis=1))
    marked: Bools = np.array(~finite)
    others = points[finite]
    for j in np.flatnonzero(finite).tolist():
        no_worse = (others <= points[j]).all(axis=1)
        better = ((others < points[j]) & ~_alike(others, points[j])).any(axis=1)
        marked[j] = bool(np.any(no_worse & better))
    return marked


def repeated(points: Floats) -> Bools:
    """(W,) whether an earlier point is the same, but for `SAME_VALUE` of its values; points (W, m)."""
    return np.array([bool(_alike(points[:j], points[j]).all(axis=1).any()) for j in range(len(points))], dtype=np.bool_)


def _alike(points: Floats, point: Floats) -> Bools:
    """(W, m) whether values are the same, but for `SAME_VALUE` of them."""
    size = np.maximum(np.abs(points), np.abs(point))
    return np.asarray(np.abs(points - point) <= SAME_VALUE * size)


def hypervolume(points: Floats, reference: Floats) -> float:
    """The volume that points (W, m) dominate within the reference point (m,).

    Exact, by slicing along the last objective: O(W^(m-1) log W), good for the small m that people look at.
    """
    inside = points[np.isfinite(points).all(axis=1) & (points < reference).all(axis=1)]
    if not len(inside):
        return 0.0
    return _volume(inside, reference)


def _volume(points: Floats, reference: Floats) -> float:
    if points.shape[1] == 1:
        return float(reference[0] - points[:, 0].min())
    order = np.argsort(points[:, -1], kind="stable")
    points = points[order]
    if points.shape[1] == 2:
        total, low = 0.0, float(reference[0])
        for k, (x, _) in enumerate(points.tolist()):
            low = min(low, x)
            upper = points[k + 1, 1] if k + 1 < len(points) else reference[1]
            total += (float(reference[0]) - low) * float(upper - points[k, 1])
        return total
    total = 0.0
    front = np.zeros((0, points.shape[1] - 1))
    for k in range(len(points)):
        here = points[k, :-1]
        # only what is not dominated in the slice counts there
        if not np.any((front <= here).all(axis=1)):
            front = np.concatenate([front[~(front >= here).all(axis=1)], here[None]])
        upper = points[k + 1, -1] if k + 1 < len(points) else reference[-1]
        height = float(upper - points[k, -1])
        if height > 0.0:
            total += height * _volume(front, reference[:-1])
    return total


def neighbour_gaps(points: Floats) -> Floats:
    """Distances between neighbours along a front of two objectives, (W - 1,); of more: to each one's nearest, (W,)."""
    if len(points) < 2:
        return np.zeros(0)
    if points.shape[1] == 2:
        ordered = points[np.lexsort((points[:, 1], points[:, 0]))]
        return np.asarray(np.linalg.norm(np.diff(ordered, axis=0), axis=1))
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    np.fill_diagonal(distance, np.inf)
    return np.asarray(distance.min(axis=1))


def spacing(points: Floats) -> float:
    """Schott's spacing: the standard deviation of the distances between neighbours; 0 is even. points: scaled."""
    gaps = neighbour_gaps(points)
    return float(np.std(gaps, ddof=1)) if len(gaps) > 1 else 0.0


def scaled(points: Floats, ideal: Floats, nadir: Floats) -> Floats:
    """Points (W, m) so that ideal is 0 and nadir 1; a width of nothing counts as 1."""
    width = np.where(nadir > ideal, nadir - ideal, 1.0)
    return np.asarray((points - ideal) / width)
